//! The online core on a measured insertion, where nobody knows the truth: its detections against the drops of the raw force, and what
//! is left of the force on the way back, all of which is friction.

use crate::detection::{EARLIEST_S, LATEST_S};
use crate::trace::Trace;
use crate::with_law::WithLaw;
use serde::Serialize;
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_stats::rms;

/// What the core found of one run.
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
    /// What the core's enhanced force leaves of it (N rms).
    pub back_before_n: f64,
    /// What is left with the friction of a law fitted to the other runs as it is replayed, punctures taken where the core found them (N rms).
    pub back_after_n: f64,
    /// The core with that law.
    pub with_law: Option<WithLaw>,
}

/// What is known of a measured run without the core.
pub struct Measured<'a> {
    /// Its name.
    pub name: &'a str,
    /// What was recorded.
    pub recording: &'a Recording,
    /// Samples at which the raw force drops.
    pub drops: &'a [usize],
    /// Sample at which the tip is deepest.
    pub deepest: usize,
    /// Sample at which the way back begins.
    pub back: usize,
    /// Position of the surface in m.
    pub contact_m: f64,
}

impl Online {
    /// Judges what the core made of a run, so configured. `law` gives the friction (N) of a law fitted to other runs, from the first
    /// sample on, told as in [`Hearing`](crate::Hearing).
    #[must_use]
    pub fn of<L: FnMut(&Sample, usize) -> f64>(
        run: &Measured,
        trace: &Trace,
        config: &EnhanceConfig,
        law: impl Fn() -> Option<L>,
    ) -> Self {
        let r = run.recording;
        let mut taken = vec![false; trace.detections.len()];
        let mut found = 0;
        for drop in run.drops {
            let at = r.time_s[*drop];
            let hit = trace
                .detections
                .iter()
                .enumerate()
                .position(|(k, d)| !taken[k] && d.time_s >= at + EARLIEST_S && d.time_s <= at + LATEST_S);
            if let Some(k) = hit {
                taken[k] = true;
                found += 1;
            }
        }
        let time = |i: usize| r.time_s.get(i).copied().unwrap_or(f64::INFINITY);
        let (deepest, back) = (time(run.deepest), time(run.back));
        let count = |from: f64, to: f64| {
            let lost = trace.detections.iter().zip(&taken).filter(|(_, taken)| !**taken);
            lost.filter(|(d, _)| d.time_s >= from && d.time_s < to).count()
        };
        // Causally: a layer counts as punctured from the sample at which the core says so.
        let replayed: Option<Vec<f64>> = law().map(|mut law| {
            let mut ruptured = 0;
            r.samples()
                .zip(&r.force_n)
                .map(|(s, &force_n)| {
                    ruptured +=
                        trace.detections[ruptured..].iter().take_while(|d| d.time_s <= s.time_s).count();
                    let sample = Sample {
                        time_s: s.time_s,
                        position_m: s.position_m,
                        velocity_mps: s.velocity_mps,
                        force_n,
                    };
                    law(&sample, ruptured)
                })
                .collect()
        });
        let inside: Vec<usize> = (run.back..r.len()).filter(|i| r.position_m[*i] > run.contact_m).collect();
        let of = |what: &dyn Fn(usize) -> f64| rms(&inside.iter().map(|i| what(*i)).collect::<Vec<_>>());
        Self {
            run: run.name.to_owned(),
            drops: run.drops.len(),
            found,
            false_in: count(f64::NEG_INFINITY, deepest),
            false_hold: count(deepest, back),
            false_back: count(back, f64::INFINITY),
            back_raw_n: of(&|i| r.force_n[i]),
            back_before_n: of(&|i| trace.enhanced_n[i]),
            back_after_n: replayed.map_or(f64::NAN, |friction| of(&|i| r.force_n[i] - friction[i])),
            with_law: WithLaw::of(run, config, law),
        }
    }
}
