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
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::instrument::Checks;
use stylet_diagnose::set::laws::{Laws, effects};
use stylet_diagnose::set::population::Population;
use stylet_diagnose::set::study::study;
use stylet_stats::wilson;

/// Seed of what is drawn.
const SEED: u64 = 125;

fn main() -> Result<(), Box<dyn Error>> {
    let Asked { file, set, measured, sets, seed } = asked(40, SEED)?;
    let layers = set.tissue.layers.len();
    let refs: Vec<&Insertion> = measured.iter().collect();
    let found = study(&set.name, &set.tissue, &refs, &Checks::default(), |_| {}).ok_or("no law")?;
    let has = effects(&found.laws.best.fitted.fit.model);
    // The population itself, not what so many recordings tell of it.
    let population = Population { recordings: ALL, ..Population::of(&found.laws.best.fitted, &refs) };
    println!("{file}: {} runs follow {}", refs.len(), has.join(", "));
    tell(&found.laws);
    let m = &found.repeats.mean;
    println!(
        "    {:.3} N on runs left out, {:.3} N with what is alike, floor {:.3} N, in band {:.3}; speed left out {:.3} N, in band {:.3}",
        m.law_n,
        m.extended_n,
        m.floor_n.unwrap_or(f64::NAN),
        m.covered,
        m.speed_left_out_n.unwrap_or(f64::NAN),
        m.speed_covered.unwrap_or(f64::NAN)
    );
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Every seed has draws of its own.
    let from = usize::try_from(seed.abs_diff(SEED))? * sets * refs.len();
    let (measured_in, mut covered) = (m.covered, Vec::new());
    let (mut accused, mut named) = (0, vec![0; has.len()]);
    for k in 0..sets {
        let runs: Vec<Insertion> = refs
            .iter()
            .enumerate()
            .filter_map(|(r, run)| one(&population, run, from + k * refs.len() + r + 1, layers, &mut rng))
            .collect();
        let refs: Vec<&Insertion> = runs.iter().collect();
        let Some(s) = study(&set.name, &set.tissue, &refs, &Checks::default(), |_| {}) else {
            println!("{k}: no law");
            continue;
        };
        let names: Vec<&str> = s.diagnosis.causes.iter().map(|c| c.effect.as_str()).collect();
        let wrong = names.iter().any(|n| !has.contains(n));
        accused += usize::from(wrong);
        for (n, effect) in named.iter_mut().zip(&has) {
            *n += usize::from(names.contains(effect));
        }
        let m = &s.repeats.mean;
        println!(
            "{k}: {:?} {} (left out: base law {:.3}, library {:.3}, slip {:.3}); {:.3} N on runs left out, floor {:.3} N, in band {:.2}",
            s.diagnosis.verdict,
            names.join(", "),
            s.laws.base.left_out_n(),
            s.laws.library.as_ref().map_or(f64::NAN, |l| l.left_out_n()),
            s.laws.slip.as_ref().map_or(f64::NAN, |l| l.left_out_n()),
            m.law_n,
            m.floor_n.unwrap_or(f64::NAN),
            m.covered
        );
        tell(&s.laws);
        covered.push(m.covered);
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
fn tell(laws: &Laws) {
    for p in &laws.parts {
        let error = stylet_stats::sd(&p.loses) / (p.loses.len() as f64).sqrt();
        println!(
            "    {}: without it squares are {:.1} % larger, standard error {:.1} %; with a speed left out {:.1} %; {:.1} nats{}",
            p.name,
            1e2 * stylet_stats::mean(&p.loses),
            1e2 * error,
            1e2 * stylet_stats::mean(&p.speeds_lose),
            p.nats,
            if p.kept { "" } else { "; taken away" }
        );
    }
}
