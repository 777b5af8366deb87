//! False positives and power on sets simulated with the model of a measured set.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example false_positives -- scenarios/measured/skin.ron 40
//! ```
//!
//! Every set true_effects the motions of the measured one, correlated noise like its residual and white sensor
//! noise. The assumed model is the base law, so that every effect of the true model true_effects to be found. An
//! optional third argument is the seed.

mod simulated_recordings;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use simulated_recordings::{Arguments, EXACT, parse_arguments, simulate};
use std::error::Error;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::diagnose_set;
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;
use stylet_diagnose::repeated_insertions::model_selection::CandidateModels;
use stylet_diagnose::repeated_insertions::random_effects_population::Population;
use stylet_diagnose::repeated_insertions::scored_model::active_effects;
use stylet_stats::wilson;

/// Seed of the simulated sets.
const SEED: u64 = 125;

fn main() -> Result<(), Box<dyn Error>> {
    let Arguments { file, set, measured, sets, seed } = parse_arguments(40, SEED)?;
    let layers = set.tissue.layers.len();
    let refs: Vec<&SegmentedRecording> = measured.iter().collect();
    let found =
        diagnose_set(&set.name, &set.tissue, None, &refs, &ReferenceRecordings::default(), &mut |_| {})
            .ok_or("no model")?;
    let true_effects = active_effects(&found.candidates.best.set_fit.fit.model);
    // The population without sampling uncertainty.
    let population =
        Population { recordings: EXACT, ..Population::from_fit(&found.candidates.best.set_fit, &refs) };
    println!("{file}: {} recordings follow the model {}", refs.len(), true_effects.join(", "));
    print_terms(&found.candidates);
    let m = &found.report.mean;
    println!(
        "    {:.3} N held out, {:.3} N with the empirical discrepancy, floor {:.3} N, coverage {:.3}; speed held out {:.3} N, coverage {:.3}",
        m.model_n,
        m.with_discrepancy_n,
        m.floor_n.unwrap_or(f64::NAN),
        m.coverage,
        m.held_out_speed_n.unwrap_or(f64::NAN),
        m.held_out_speed_coverage.unwrap_or(f64::NAN)
    );
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Seeds do not share draws.
    let from = usize::try_from(seed.abs_diff(SEED))? * sets * refs.len();
    let (measured_coverage, mut coverages) = (m.coverage, Vec::new());
    let (mut false_positives, mut found_count) = (0, vec![0; true_effects.len()]);
    for k in 0..sets {
        let recordings: Vec<SegmentedRecording> = refs
            .iter()
            .enumerate()
            .filter_map(|(r, run)| {
                simulate(&population, run, from + k * refs.len() + r + 1, layers, &mut rng)
            })
            .collect();
        let refs: Vec<&SegmentedRecording> = recordings.iter().collect();
        let Some(s) =
            diagnose_set(&set.name, &set.tissue, None, &refs, &ReferenceRecordings::default(), &mut |_| {})
        else {
            println!("{k}: no model");
            continue;
        };
        let names: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
        let false_positive = names.iter().any(|n| !true_effects.contains(n));
        false_positives += usize::from(false_positive);
        for (n, effect) in found_count.iter_mut().zip(&true_effects) {
            *n += usize::from(names.contains(effect));
        }
        let m = &s.report.mean;
        println!(
            "{k}: {:?} {} (held out: base law {:.3}, library {:.3}, stick-slip {:.3}); {:.3} N held out, floor {:.3} N, coverage {:.2}",
            s.diagnosis.verdict,
            names.join(", "),
            s.candidates.base.held_out_n(),
            s.candidates.library.as_ref().map_or(f64::NAN, |l| l.held_out_n()),
            s.candidates.slip.as_ref().map_or(f64::NAN, |l| l.held_out_n()),
            m.model_n,
            m.floor_n.unwrap_or(f64::NAN),
            m.coverage
        );
        print_terms(&s.candidates);
        coverages.push(m.coverage);
        totals(false_positives, &found_count, &true_effects, &coverages, measured_coverage);
    }
    Ok(())
}

/// Rates over all sets so far.
fn totals(
    false_positives: usize,
    found_count: &[usize],
    true_effects: &[&str],
    coverages: &[f64],
    measured_coverage: f64,
) {
    let rate = |hits: usize| {
        let i = wilson(hits, coverages.len());
        format!("{hits} of {} ({:.0} to {:.0} %)", coverages.len(), 100.0 * i.low, 100.0 * i.high)
    };
    println!("so far: false positives: {}", rate(false_positives));
    for (n, effect) in found_count.iter().zip(true_effects) {
        println!("    {effect} found: {}", rate(*n));
    }
    println!(
        "    coverage {:.3} in the mean, standard deviation {:.3}; at least that of the measured set ({measured_coverage:.3}): {}",
        stylet_stats::mean(coverages),
        stylet_stats::sd(coverages),
        rate(coverages.iter().filter(|c| **c >= measured_coverage).count())
    );
}

/// Prints the ablation of a model.
fn print_terms(candidates: &CandidateModels) {
    for p in &candidates.terms {
        let error = stylet_stats::sd(&p.held_out_loss) / (p.held_out_loss.len() as f64).sqrt();
        println!(
            "    {}: held-out loss {:.1} %, standard error {:.1} %; with a speed held out {:.1} %; {:.1} nats{}",
            p.name,
            1e2 * stylet_stats::mean(&p.held_out_loss),
            1e2 * error,
            1e2 * stylet_stats::mean(&p.held_out_speed_loss),
            p.gain_nats,
            if p.kept { "" } else { "; removed" }
        );
    }
}
