//! Does a band of 90 % hold 90 %? Sets drawn from the law that a measured set was found to follow, each fitted from that law on.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example drawn_band -- scenarios/measured/skin.ron 16
//! ```
//! Motions, scatter and noise as in `null_sets`; no law is looked for, so that a set costs seconds. A third word is another seed.

mod drawn;

use drawn::{ALL, Asked, asked, one};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::error::Error;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::cross_validation::leave_one_out;
use stylet_diagnose::repeated_insertions::model_selection::fit_stick_slip;
use stylet_diagnose::repeated_insertions::multistart_fit::{SetFit, fit_from, set_blocks};
use stylet_diagnose::repeated_insertions::population_prediction::Population;
use stylet_record::sensor_artefacts::SensorArtefacts;

/// Seed of what is drawn.
const SEED: u64 = 77;
/// Seed of what the starts begin with.
const STARTS: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let Asked { file, set, measured, sets, seed } = asked(16, SEED)?;
    let layers = set.tissue.layers.len();
    let refs: Vec<&SegmentedRecording> = measured.iter().collect();
    let raw = SensorArtefacts::default();
    let mut rng = ChaCha8Rng::seed_from_u64(STARTS);
    let fit = fit_stick_slip(&set.tissue, &refs, &raw, &mut rng).ok_or("no law could be fitted")?.set_fit;
    println!("{file}: {:.3} of what was measured in the band", covered(&fit, &refs));
    let population = Population { recordings: ALL, ..Population::from_fit(&fit, &refs) };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut all = Vec::new();
    for k in 0..sets {
        let runs = refs.iter().enumerate();
        let runs: Vec<SegmentedRecording> = runs
            .filter_map(|(r, run)| one(&population, run, k * refs.len() + r + 1, layers, &mut rng))
            .collect();
        let refs: Vec<&SegmentedRecording> = runs.iter().collect();
        let mut model = fit.fit.model.clone();
        model.rupture_times_s = refs.iter().map(|r| r.ruptures_s.clone()).collect();
        let drops = refs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
        let Some(again) = fit_from(&model, set_blocks(&refs, &raw), drops.collect()) else { continue };
        all.push(covered(&again, &refs));
        println!("{k}: {:.3}", all.last().copied().unwrap_or(f64::NAN));
    }
    println!(
        "{} drawn sets: {:.3} in the mean, standard deviation {:.3}",
        all.len(),
        stylet_stats::mean(&all),
        stylet_stats::sd(&all)
    );
    Ok(())
}

/// Share of runs left out that lies in the band.
fn covered(fit: &SetFit, runs: &[&SegmentedRecording]) -> f64 {
    let out = leave_one_out(fit, runs);
    out.iter().map(|o| o.score.coverage).sum::<f64>() / runs.len().max(1) as f64
}
