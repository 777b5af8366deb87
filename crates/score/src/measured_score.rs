//! The online core on a measured insertion, where nobody knows the truth: its detections against the drops of the raw force, and what
//! is left of the force on the way back, all of which is friction.

use crate::enhancement_trace::Trace;
use crate::model_friction_score::ModelFrictionScore;
use crate::rupture_matching::{MATCH_EARLIEST_S, MATCH_LATEST_S};
use serde::Serialize;
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_stats::rms;

/// What the core found of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredScore {
    /// Run.
    pub recording: String,
    /// Drops in the raw force.
    pub drops: usize,
    /// Drops that the core found.
    pub found: usize,
    /// Detections without a drop, on the way in.
    pub false_insertion: usize,
    /// In the hold.
    pub false_hold: usize,
    /// On the way back.
    pub false_retraction: usize,
    /// Force on the way back, in the tissue (N rms): all of it is friction, for nothing pushes the tip.
    pub retraction_raw_n: f64,
    /// What the core's enhanced force leaves of it (N rms).
    pub retraction_enhanced_n: f64,
    /// What is left with the friction of a law fitted to the other runs as it is replayed, punctures taken where the core found them (N rms).
    pub retraction_model_n: f64,
    /// The core with that law.
    pub with_model: Option<ModelFrictionScore>,
}

/// What is known of a measured run without the core.
pub struct MeasuredRecording<'a> {
    /// Its name.
    pub name: &'a str,
    /// What was recorded.
    pub recording: &'a Recording,
    /// Samples at which the raw force drops.
    pub drops: &'a [usize],
    /// Sample at which the tip is deepest.
    pub deepest: usize,
    /// Sample at which the way back begins.
    pub retraction: usize,
    /// Position of the surface in m.
    pub contact_m: f64,
}

impl MeasuredScore {
    /// Judges what the core made of a run, so configured. `law` gives the friction (N) of a law fitted to other runs, from the first
    /// sample on, told as in [`Hearing`](crate::Hearing).
    #[must_use]
    pub fn evaluate<L: FnMut(&Sample, usize) -> f64>(
        run: &MeasuredRecording,
        trace: &Trace,
        config: &EnhanceConfig,
        law: impl Fn() -> Option<L>,
    ) -> Self {
        let r = run.recording;
        let mut taken = vec![false; trace.detections.len()];
        let mut found = 0;
        for drop in run.drops {
            let at = r.time_s[*drop];
            let hit = trace.detections.iter().enumerate().position(|(k, d)| {
                !taken[k] && d.time_s >= at + MATCH_EARLIEST_S && d.time_s <= at + MATCH_LATEST_S
            });
            if let Some(k) = hit {
                taken[k] = true;
                found += 1;
            }
        }
        let time = |i: usize| r.time_s.get(i).copied().unwrap_or(f64::INFINITY);
        let (deepest, back) = (time(run.deepest), time(run.retraction));
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
        let inside: Vec<usize> =
            (run.retraction..r.len()).filter(|i| r.position_m[*i] > run.contact_m).collect();
        let of = |what: &dyn Fn(usize) -> f64| rms(&inside.iter().map(|i| what(*i)).collect::<Vec<_>>());
        Self {
            recording: run.name.to_owned(),
            drops: run.drops.len(),
            found,
            false_insertion: count(f64::NEG_INFINITY, deepest),
            false_hold: count(deepest, back),
            false_retraction: count(back, f64::INFINITY),
            retraction_raw_n: of(&|i| r.force_n[i]),
            retraction_enhanced_n: of(&|i| trace.enhanced_n[i]),
            retraction_model_n: replayed.map_or(f64::NAN, |friction| of(&|i| r.force_n[i] - friction[i])),
            with_model: ModelFrictionScore::evaluate(run, config, law),
        }
    }
}
