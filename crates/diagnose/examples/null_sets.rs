//! Sets drawn from the law that a measured set was found to follow: is any of them accused of an effect that it does not have, and is
//! what it has found?
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example null_sets -- scenarios/measured/skin.ron 40
//! ```
//! Every drawn set has the motions of the measured one; what the law leaves is drawn beside it as slow noise, and the sensor's as white noise.
//! The belief is the base law, so that every effect of the law is one that is taken away from it. A third word is another seed of what is
//! drawn.

mod drawn;

use drawn::{ALL, Asked, asked, one};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::error::Error;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::diagnose_set;
use stylet_diagnose::repeated_insertions::instrument_faults::ReferenceRecordings;
use stylet_diagnose::repeated_insertions::model_selection::{CandidateModels, active_effects};
use stylet_diagnose::repeated_insertions::population_prediction::Population;
use stylet_stats::wilson;

/// Seed of what is drawn.
const SEED: u64 = 125;

fn main() -> Result<(), Box<dyn Error>> {
    let Asked { file, set, measured, sets, seed } = asked(40, SEED)?;
    let layers = set.tissue.layers.len();
    let refs: Vec<&SegmentedRecording> = measured.iter().collect();
    let found = diagnose_set(&set.name, &set.tissue, &refs, &ReferenceRecordings::default(), |_| {})
        .ok_or("no law")?;
    let has = active_effects(&found.candidates.best.set_fit.fit.model);
    // The population itself, not what so many recordings tell of it.
    let population =
        Population { recordings: ALL, ..Population::from_fit(&found.candidates.best.set_fit, &refs) };
    println!("{file}: {} runs follow {}", refs.len(), has.join(", "));
    tell(&found.candidates);
    let m = &found.report.mean;
    println!(
        "    {:.3} N on runs left out, {:.3} N with what is alike, floor {:.3} N, in band {:.3}; speed left out {:.3} N, in band {:.3}",
        m.model_n,
        m.with_discrepancy_n,
        m.floor_n.unwrap_or(f64::NAN),
        m.coverage,
        m.held_out_speed_n.unwrap_or(f64::NAN),
        m.held_out_speed_coverage.unwrap_or(f64::NAN)
    );
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Every seed has draws of its own.
    let from = usize::try_from(seed.abs_diff(SEED))? * sets * refs.len();
    let (measured_in, mut covered) = (m.coverage, Vec::new());
    let (mut accused, mut named) = (0, vec![0; has.len()]);
    for k in 0..sets {
        let runs: Vec<SegmentedRecording> = refs
            .iter()
            .enumerate()
            .filter_map(|(r, run)| one(&population, run, from + k * refs.len() + r + 1, layers, &mut rng))
            .collect();
        let refs: Vec<&SegmentedRecording> = runs.iter().collect();
        let Some(s) = diagnose_set(&set.name, &set.tissue, &refs, &ReferenceRecordings::default(), |_| {})
        else {
            println!("{k}: no law");
            continue;
        };
        let names: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
        let wrong = names.iter().any(|n| !has.contains(n));
        accused += usize::from(wrong);
        for (n, effect) in named.iter_mut().zip(&has) {
            *n += usize::from(names.contains(effect));
        }
        let m = &s.report.mean;
        println!(
            "{k}: {:?} {} (left out: base law {:.3}, library {:.3}, slip {:.3}); {:.3} N on runs left out, floor {:.3} N, in band {:.2}",
            s.diagnosis.verdict,
            names.join(", "),
            s.candidates.base.held_out_n(),
            s.candidates.library.as_ref().map_or(f64::NAN, |l| l.held_out_n()),
            s.candidates.slip.as_ref().map_or(f64::NAN, |l| l.held_out_n()),
            m.model_n,
            m.floor_n.unwrap_or(f64::NAN),
            m.coverage
        );
        tell(&s.candidates);
        covered.push(m.coverage);
        totals(accused, &named, &has, &covered, measured_in);
    }
    Ok(())
}

/// What all sets so far say.
fn totals(accused: usize, named: &[usize], has: &[&str], covered: &[f64], measured_in: f64) {
    let rate = |hits: usize| {
        let i = wilson(hits, covered.len());
        format!("{hits} of {} ({:.0} to {:.0} %)", covered.len(), 100.0 * i.low, 100.0 * i.high)
    };
    println!("so far: accused of an effect that it does not have: {}", rate(accused));
    for (n, effect) in named.iter().zip(has) {
        println!("    {effect} named: {}", rate(*n));
    }
    println!(
        "    in band {:.3} in the mean, standard deviation {:.3}; as many as of the measured set ({measured_in:.3}): {}",
        stylet_stats::mean(covered),
        stylet_stats::sd(covered),
        rate(covered.iter().filter(|c| **c >= measured_in).count())
    );
}

/// What the parts of a law are worth.
fn tell(laws: &CandidateModels) {
    for p in &laws.terms {
        let error = stylet_stats::sd(&p.held_out_loss) / (p.held_out_loss.len() as f64).sqrt();
        println!(
            "    {}: without it squares are {:.1} % larger, standard error {:.1} %; with a speed left out {:.1} %; {:.1} nats{}",
            p.name,
            1e2 * stylet_stats::mean(&p.held_out_loss),
            1e2 * error,
            1e2 * stylet_stats::mean(&p.held_out_speed_loss),
            p.gain_nats,
            if p.kept { "" } else { "; taken away" }
        );
    }
}
