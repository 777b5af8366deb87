//! Coverage of the 90 % band on simulated sets, each fitted from the true model.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example band_coverage -- scenarios/measured/skin.ron 16
//! ```
//!
//! Motion, scatter and noise as in `false_positives`; without model selection a set takes seconds. An
//! optional third argument is the seed.

mod simulated_recordings;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use simulated_recordings::{Arguments, EXACT, parse_arguments, simulate};
use std::error::Error;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::cross_validation::leave_one_out;
use stylet_diagnose::repeated_insertions::multistart_fit::{SetFit, fit_from, set_blocks};
use stylet_diagnose::repeated_insertions::random_effects_population::Population;
use stylet_diagnose::repeated_insertions::stick_slip_fit::fit_stick_slip;
use stylet_record::sensor_artefacts::SensorArtefacts;

/// Seed of the simulated sets.
const SEED: u64 = 77;
/// Seed of the start values.
const START_VALUE_SEED: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let Arguments { file, set, measured, sets, seed } = parse_arguments(16, SEED)?;
    let layers = set.tissue.layers.len();
    let refs: Vec<&SegmentedRecording> = measured.iter().collect();
    let artefacts = SensorArtefacts::default();
    let mut rng = ChaCha8Rng::seed_from_u64(START_VALUE_SEED);
    let fit =
        fit_stick_slip(&set.tissue, &refs, &artefacts, &mut rng).ok_or("no model could be fitted")?.set_fit;
    println!("{file}: {:.3} of the measured samples in the band", coverage(&fit, &refs));
    let population = Population { recordings: EXACT, ..Population::from_fit(&fit, &refs) };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut all = Vec::new();
    for k in 0..sets {
        let recordings = refs.iter().enumerate();
        let recordings: Vec<SegmentedRecording> = recordings
            .filter_map(|(r, run)| simulate(&population, run, k * refs.len() + r + 1, layers, &mut rng))
            .collect();
        let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
        let mut model = fit.fit.model.clone();
        model.rupture_times_s = refs.iter().map(|r| r.ruptures_s.clone()).collect();
        let drops = refs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
        let Some(refit) = fit_from(&model, set_blocks(&refs, &artefacts), drops.collect()) else { continue };
        all.push(coverage(&refit, &refs));
        println!("{k}: {:.3}", all.last().copied().unwrap_or(f64::NAN));
    }
    println!(
        "{} simulated sets: mean coverage {:.3}, standard deviation {:.3}",
        all.len(),
        stylet_stats::mean(&all),
        stylet_stats::sd(&all)
    );
    Ok(())
}

/// Share of held-out samples inside the band.
fn coverage(fit: &SetFit, recordings: &[&SegmentedRecording]) -> f64 {
    let out = leave_one_out(fit, recordings);
    out.iter().map(|o| o.score.coverage).sum::<f64>() / recordings.len().max(1) as f64
}
