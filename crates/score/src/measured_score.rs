//! Scores of the online core on a measured recording without ground truth: its detections against the drops of the raw force,
//! and the enhanced force during retraction, where nothing acts at the tip. A pull added to the recording, and the share of it
//! in the output, reveals an enhancement that is always zero.

use crate::enhancement_trace::Trace;
use crate::rupture_matching::{MATCH_EARLIEST_S, MATCH_LATEST_S};
use serde::Serialize;
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_stats::{median_of, rms};

/// Size of the added pull in N.
const PULL_N: f64 = 0.5;
/// Travel of its half sine in m; a step is evaluated after half of it.
const PULSE_M: f64 = 2e-3;
/// Retraction at which it begins, in m: while the shaft is stretched, and while it slides.
const PULL_PLACES_M: [f64; 3] = [4e-3, 7e-3, 12e-3];

/// A measured recording with reference events from the raw data.
pub struct MeasuredRecording<'a> {
    /// Name.
    pub name: &'a str,
    /// Samples.
    pub recording: &'a Recording,
    /// Indices at which the raw force drops.
    pub drops: &'a [usize],
    /// Index at which the tip is deepest.
    pub deepest: usize,
    /// Index at which the retraction begins.
    pub retraction: usize,
    /// Position of the surface in m.
    pub contact_m: f64,
}

impl MeasuredRecording<'_> {
    /// Retraction at a sample, in m.
    fn retracted_m(&self, i: usize) -> f64 {
        let z = &self.recording.position_m;
        if i > self.retraction { z[self.retraction] - z[i] } else { 0.0 }
    }

    /// Samples of the retraction inside the tissue.
    fn retraction_in_tissue(&self) -> Vec<usize> {
        let z = &self.recording.position_m;
        (self.retraction..z.len()).filter(|i| z[*i] > self.contact_m).collect()
    }
}

/// Score of the core on one recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredScore {
    /// Name of the recording.
    pub recording: String,
    /// Drops in the raw force.
    pub drops: usize,
    /// Drops that the core detected.
    pub found: usize,
    /// Detections without a drop during insertion.
    pub false_insertion: usize,
    /// Detections in the hold.
    pub false_hold: usize,
    /// Detections during retraction.
    pub false_retraction: usize,
    /// Force during retraction in the tissue (N rms): friction, because nothing pushes the tip.
    pub retraction_raw_n: f64,
    /// Enhanced force of the core there (N rms).
    pub retraction_enhanced_n: f64,
    /// Force minus the replayed friction of a model fitted to the other recordings, with the ruptures of the core (N rms).
    pub retraction_model_n: f64,
    /// The core with that model.
    pub with_model: Option<ModelFrictionScore>,
}

impl MeasuredScore {
    /// Scores the trace of a core with this configuration. `model` returns, from the first sample on, the shaft friction (N)
    /// of a model fitted to other recordings, as in [`EnhancerWithModel`](crate::EnhancerWithModel).
    #[must_use]
    pub fn evaluate<M: FnMut(&Sample, usize) -> f64>(
        measured: &MeasuredRecording,
        trace: &Trace,
        config: &EnhanceConfig,
        model: impl Fn() -> Option<M>,
    ) -> Self {
        let r = measured.recording;
        let mut matched = vec![false; trace.detections.len()];
        let mut found = 0;
        for drop in measured.drops {
            let at = r.time_s[*drop];
            let hit = trace.detections.iter().enumerate().position(|(k, d)| {
                !matched[k] && d.time_s >= at + MATCH_EARLIEST_S && d.time_s <= at + MATCH_LATEST_S
            });
            if let Some(k) = hit {
                matched[k] = true;
                found += 1;
            }
        }
        let time = |i: usize| r.time_s.get(i).copied().unwrap_or(f64::INFINITY);
        let (deepest_s, retraction_s) = (time(measured.deepest), time(measured.retraction));
        let count = |from: f64, to: f64| {
            let unmatched = trace.detections.iter().zip(&matched).filter(|(_, matched)| !**matched);
            unmatched.filter(|(d, _)| d.time_s >= from && d.time_s < to).count()
        };
        let replayed: Option<Vec<f64>> = model().map(|mut model| {
            let mut ruptures = 0;
            let samples = r.samples().zip(&r.force_n).map(|(s, &force_n)| Sample {
                time_s: s.time_s,
                position_m: s.position_m,
                velocity_mps: s.velocity_mps,
                force_n,
            });
            samples
                .map(|sample| {
                    // Causal: a layer counts as punctured from the sample of its detection.
                    let later = &trace.detections[ruptures..];
                    ruptures += later.iter().take_while(|d| d.time_s <= sample.time_s).count();
                    model(&sample, ruptures)
                })
                .collect()
        });
        let inside = measured.retraction_in_tissue();
        let rms_of =
            |value: &dyn Fn(usize) -> f64| rms(&inside.iter().map(|i| value(*i)).collect::<Vec<_>>());
        Self {
            recording: measured.name.to_owned(),
            drops: measured.drops.len(),
            found,
            false_insertion: count(f64::NEG_INFINITY, deepest_s),
            false_hold: count(deepest_s, retraction_s),
            false_retraction: count(retraction_s, f64::INFINITY),
            retraction_raw_n: rms_of(&|i| r.force_n[i]),
            retraction_enhanced_n: rms_of(&|i| trace.enhanced_n[i]),
            retraction_model_n: replayed.map_or(f64::NAN, |friction| rms_of(&|i| r.force_n[i] - friction[i])),
            with_model: ModelFrictionScore::evaluate(measured, config, model),
        }
    }
}

/// The core with the friction of an identified model, during retraction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModelFrictionScore {
    /// Enhanced force (N rms).
    pub residual_rms_n: f64,
    /// Largest enhanced force in N.
    pub residual_max_n: f64,
    /// Peak of the enhanced force due to an added pull of 0.5 N over 2 mm, relative to the pull: median over three positions,
    /// NaN if the retraction is too short.
    pub pulse_kept: f64,
    /// The same for an added step, 1 mm after it.
    pub step_kept: f64,
}

impl ModelFrictionScore {
    /// Runs the core with the model; `None` without one.
    #[must_use]
    pub fn evaluate<M: FnMut(&Sample, usize) -> f64>(
        measured: &MeasuredRecording,
        config: &EnhanceConfig,
        model: impl Fn() -> Option<M>,
    ) -> Option<Self> {
        let r = measured.recording;
        let enhance = |pull: &dyn Fn(f64) -> f64| {
            let force: Vec<f64> =
                (0..r.len()).map(|i| r.force_n[i] + pull(measured.retracted_m(i))).collect();
            model().map(|model| Trace::run_with_model(r, &force, config, 0.0, model).enhanced_n)
        };
        let plain = enhance(&|_| 0.0)?;
        let (mut pulses, mut steps) = (Vec::new(), Vec::new());
        for at in PULL_PLACES_M {
            let phase = |x: f64| (x - at) / PULSE_M;
            if measured.retracted_m(r.len() - 1) < at + 1.5 * PULSE_M {
                continue;
            }
            let pulsed = enhance(&|x| {
                if (0.0..1.0).contains(&phase(x)) {
                    -PULL_N * (std::f64::consts::PI * phase(x)).sin()
                } else {
                    0.0
                }
            })?;
            let stepped = enhance(&|x| if phase(x) > 0.0 { -PULL_N } else { 0.0 })?;
            let kept = |pulled: &[f64], i: usize| (plain[i] - pulled[i]) / PULL_N;
            let retraction = || measured.retraction..r.len();
            pulses.push(retraction().map(|i| kept(&pulsed, i).abs()).fold(0.0, f64::max));
            let half = retraction().find(|i| phase(measured.retracted_m(*i)) >= 0.5);
            steps.extend(half.map(|i| kept(&stepped, i)));
        }
        let residual: Vec<f64> = measured.retraction_in_tissue().into_iter().map(|i| plain[i]).collect();
        Some(Self {
            residual_rms_n: rms(&residual),
            residual_max_n: residual.iter().map(|f| f.abs()).fold(0.0, f64::max),
            pulse_kept: median_of(pulses),
            step_kept: median_of(steps),
        })
    }
}
