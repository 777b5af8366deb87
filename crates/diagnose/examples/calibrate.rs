//! The thresholds of `crates/diagnose/src/thresholds.rs`: what each effect gains on clean data, and what it must
//! gain so that all together accuse one clean case in a hundred:
//! `cargo run --release -p stylet-diagnose --features own_world --example calibrate -- 200 7001`
use rayon::prelude::*;
use std::collections::BTreeMap;
use stylet_diagnose::hidden::{self, Kind};
use stylet_diagnose::search::{Search, Settings};
use stylet_diagnose::starts::FROM_THE_RAW_DATA;
use stylet_diagnose::thresholds::LEAST;
use stylet_diagnose::track::Track;

/// Clean cases that may be accused.
const ALARMS: f64 = 0.01;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |k: usize, default: u64| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(default);
    let (count, seed) = (number(1, 200), number(2, 7001));
    let gains: Vec<Vec<(&'static str, f64)>> = (0..count)
        .into_par_iter()
        .filter_map(|i| {
            let case = hidden::case(&hidden::sketch_of(seed, i, Kind::Clean, i).drawn);
            let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
            let settings = Settings { most: 1, ..Settings::default() };
            let mut search =
                Search::base(&case.believed.tissue, case.believed.tolerance, &[], tracks, 0.0, settings)?;
            search.run(|_| {});
            let stage = search.stages.first()?;
            Some(stage.rivals.iter().map(|(name, gain, _)| (*name, *gain)).collect())
        })
        .collect();
    let effects: Vec<&'static str> =
        stylet_tissue::library().map(|i| i.id).filter(|id| !FROM_THE_RAW_DATA.contains(id)).collect();
    let each = ALARMS / effects.len() as f64;
    let mut of: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for case in &gains {
        for id in &effects {
            let gain = case.iter().find(|g| g.0 == *id).map_or(0.0, |g| g.1.max(0.0));
            of.entry(id).or_default().push(gain);
        }
    }
    println!("{} clean cases; nats gained: median, 90 %, 99 %, most; needed", gains.len());
    for (id, gains) in &mut of {
        gains.sort_unstable_by(f64::total_cmp);
        let q = |p: f64| gains[((gains.len() - 1) as f64 * p).round() as usize];
        // The tail of a likelihood ratio falls as exp(-x), a little slower with several numbers.
        let needed = (q(0.9) + (0.1 / each).ln() + 1.0).max(q(1.0) + 1.0).max(LEAST);
        println!("    (\"{id}\", {needed:.1}), // {:.1} {:.1} {:.1} {:.1}", q(0.5), q(0.9), q(0.99), q(1.0));
    }
}
