//! The online core on measured insertions, before and after: what it finds by itself, and what a law fitted to the
//! other runs lets it take away.

use serde::Serialize;
use std::fmt::Write as _;
use stylet_core::EnhanceConfig;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::population::friction;
use stylet_diagnose::set::study::Study;
use stylet_report::{Cell, Section, Table};
use stylet_score::Trace;
use stylet_stats::rms;

/// A detection belongs to a drop that it follows by at most this (s).
const LATEST_S: f64 = 1.0;
/// or precedes by at most this (s).
const EARLIEST_S: f64 = 0.05;

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Online {
    /// Run.
    pub run: String,
    /// Drops in the raw force.
    pub drops: usize,
    /// Drops that the core found.
    pub found: usize,
    /// Detections without a drop, on the way in.
    pub false_in: usize,
    /// In the hold.
    pub false_hold: usize,
    /// On the way back.
    pub false_back: usize,
    /// Force on the way back, in the tissue (N rms): all of it is friction, for nothing pushes the tip.
    pub back_raw_n: f64,
    /// What the core leaves of it with its own friction estimate (N rms).
    pub back_before_n: f64,
    /// What is left with the friction of a law fitted to the other runs, punctures taken where the core found them.
    pub back_after_n: f64,
}

/// Runs the core over all runs.
pub fn listen(runs: &[&Insertion], study: &Study) -> Vec<Online> {
    runs.iter().enumerate().map(|(i, run)| one(run, study, i)).collect()
}

fn one(run: &Insertion, study: &Study, i: usize) -> Online {
    let r = &run.recording;
    let trace = Trace::record(r, &r.force_n, &EnhanceConfig::paper(), 0.0, |_, _| {});
    let phases = run.phases;
    let seen = run.drops();
    let mut taken = vec![false; trace.detections.len()];
    let mut found = 0;
    for drop in &seen {
        let at = r.time_s[drop.at];
        let hit = trace
            .detections
            .iter()
            .enumerate()
            .position(|(k, d)| !taken[k] && d.time_s >= at - EARLIEST_S && d.time_s <= at + LATEST_S);
        if let Some(k) = hit {
            taken[k] = true;
            found += 1;
        }
    }
    let time = |i: usize| r.time_s.get(i).copied().unwrap_or(f64::INFINITY);
    let (deepest, back) = (time(phases.deepest), time(phases.back));
    let count = |from: f64, to: f64| {
        let lost = trace.detections.iter().zip(&taken).filter(|(_, taken)| !**taken);
        lost.filter(|(d, _)| d.time_s >= from && d.time_s < to).count()
    };
    // Causally: a layer counts as punctured from the sample at which the core says so.
    let instants: Vec<f64> = trace.detections.iter().map(|d| d.time_s).collect();
    let population = study.out.get(i).and_then(|o| o.population.as_ref());
    let friction = population.and_then(|p| friction(p, r, &instants));
    let inside: Vec<usize> = (phases.back..r.len()).filter(|i| r.position_m[*i] > run.contact_m).collect();
    let of = |what: &dyn Fn(usize) -> f64| rms(&inside.iter().map(|i| what(*i)).collect::<Vec<_>>());
    Online {
        run: run.name.clone(),
        drops: seen.len(),
        found,
        false_in: count(f64::NEG_INFINITY, deepest),
        false_hold: count(deepest, back),
        false_back: count(back, f64::INFINITY),
        back_raw_n: of(&|i| r.force_n[i]),
        back_before_n: of(&|i| trace.enhanced_n[i]),
        back_after_n: friction.map_or(f64::NAN, |friction| of(&|i| r.force_n[i] - friction[i])),
    }
}

fn sums(all: &[Online]) -> [usize; 5] {
    let of = |what: &dyn Fn(&Online) -> usize| all.iter().map(what).sum();
    [of(&|o| o.drops), of(&|o| o.found), of(&|o| o.false_in), of(&|o| o.false_hold), of(&|o| o.false_back)]
}

fn mean(all: &[Online], what: impl Fn(&Online) -> f64) -> f64 {
    stylet_stats::mean(&all.iter().map(what).collect::<Vec<_>>())
}

/// For the terminal.
pub fn summary(all: &[Online]) -> String {
    let [drops, found, inside, hold, back] = sums(all);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "  online core: {found} of {drops} drops found; false: {inside} on the way in, {hold} in the hold, {back} on the way back"
    );
    let _ = writeln!(
        out,
        "  force on the way back, all of it friction (N rms): {:.3} measured, {:.3} left by the core, {:.3} with the extended law's friction",
        mean(all, |o| o.back_raw_n),
        mean(all, |o| o.back_before_n),
        mean(all, |o| o.back_after_n)
    );
    out
}

/// For the report.
pub fn section(all: &[Online]) -> Section {
    let rows = all
        .iter()
        .map(|o| {
            vec![
                Cell::text(o.run.clone()),
                Cell::number(format!("{} of {}", o.found, o.drops)),
                Cell::number(format!("{} / {} / {}", o.false_in, o.false_hold, o.false_back)),
                Cell::number(format!("{:.3}", o.back_raw_n)),
                Cell::number(format!("{:.3}", o.back_before_n)),
                Cell::number(format!("{:.3}", o.back_after_n)),
            ]
        })
        .collect();
    Section::new("The online core on these insertions")
        .text(
            "On the way back nothing pushes the tip: all force there is friction, and an enhanced force should be zero. Before: the core with its \
             own viscous estimate. After: the friction of the extended law fitted to the other runs, a layer counting as punctured from the moment \
             the core says so.",
        )
        .text(summary(all).lines().map(|l| format!("All: {}.", l.trim())).collect::<Vec<_>>().join(" "))
        .table(Table {
            title: "By run".to_owned(),
            groups: vec![(String::new(), 3), ("force on the way back, N rms".to_owned(), 3)],
            headers: ["", "drops found", "false: in / hold / back", "measured", "core", "extended law"].map(str::to_owned).to_vec(),
            rows,
        })
}
