//! The core with the friction of a law fitted elsewhere, on the way back of a measured insertion, where the tip feels nothing; and what it
//! keeps of a pull that is put into the recording, for an output of zero would leave nothing.

use crate::enhancement_trace::Trace;
use crate::measured_score::MeasuredRecording;
use serde::Serialize;
use stylet_core::{EnhanceConfig, Sample};
use stylet_stats::{median_of, rms};

/// Size of the pull that is put in, in N.
const PULL_N: f64 = 0.5;
/// Travel of its half sine, in m; a step is looked at after half of it.
const PULSE_M: f64 = 2e-3;
/// Where on the way back it begins, in m from where the needle turned: while the shaft is stretched, and sliding.
const PLACES_M: [f64; 3] = [4e-3, 7e-3, 12e-3];

/// What is left of the force on the way back, and what is kept of a pull.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModelFrictionScore {
    /// What the enhanced force leaves (N rms).
    pub residual_rms_n: f64,
    /// The largest of it in N.
    pub residual_max_n: f64,
    /// Share of its peak that a pull of 0.5 N over 2 mm keeps, and of its size that a step keeps after 1 mm: medians over three places; not
    /// numbers where the way back is too short.
    pub pulse_kept: f64,
    /// See `pulse_kept`.
    pub step_kept: f64,
}

impl ModelFrictionScore {
    /// Hears a run with a law's friction, as [`Trace::with_law`] does; `law` gives it from the first sample on, or `None` where there is none.
    #[must_use]
    pub fn evaluate<L: FnMut(&Sample, usize) -> f64>(
        run: &MeasuredRecording,
        config: &EnhanceConfig,
        law: impl Fn() -> Option<L>,
    ) -> Option<Self> {
        let r = run.recording;
        let hear = |pull: &dyn Fn(f64) -> f64| {
            let force: Vec<f64> = (0..r.len()).map(|i| r.force_n[i] + pull(travelled(run, i))).collect();
            law().map(|law| Trace::run_with_model(r, &force, config, 0.0, law).enhanced_n)
        };
        let plain = hear(&|_| 0.0)?;
        let inside = || (run.retraction..r.len()).filter(|i| r.position_m[*i] > run.contact_m);
        let (mut pulses, mut steps) = (Vec::new(), Vec::new());
        for at in PLACES_M {
            let half = |x: f64| (x - at) / PULSE_M;
            if travelled(run, r.len() - 1) < at + 1.5 * PULSE_M {
                continue;
            }
            let pulsed = hear(&|x| {
                if (0.0..1.0).contains(&half(x)) {
                    -PULL_N * (std::f64::consts::PI * half(x)).sin()
                } else {
                    0.0
                }
            })?;
            let stepped = hear(&|x| if half(x) > 0.0 { -PULL_N } else { 0.0 })?;
            let kept = |heard: &[f64], i: usize| (plain[i] - heard[i]) / PULL_N;
            pulses.push((run.retraction..r.len()).map(|i| kept(&pulsed, i).abs()).fold(0.0, f64::max));
            steps.extend(
                (run.retraction..r.len())
                    .find(|i| half(travelled(run, *i)) >= 0.5)
                    .map(|i| kept(&stepped, i)),
            );
        }
        Some(Self {
            residual_rms_n: rms(&inside().map(|i| plain[i]).collect::<Vec<_>>()),
            residual_max_n: inside().map(|i| plain[i].abs()).fold(0.0, f64::max),
            pulse_kept: median_of(pulses),
            step_kept: median_of(steps),
        })
    }
}

/// Travel back at sample `i`, in m.
fn travelled(run: &MeasuredRecording, i: usize) -> f64 {
    let z = &run.recording.position_m;
    if i > run.retraction { z[run.retraction] - z[i] } else { 0.0 }
}
