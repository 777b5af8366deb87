//! One insertion, sample by sample, on the slide or as kinematic replay.

use crate::rapier_slide::Slide;
use stylet_scenario::{MotionPlan, MotionPoint};
use stylet_tissue::{ForceLaw, ForceLawState, Rupture, TissueForce};

/// Needle and tissue at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsertionSample {
    /// Time in seconds.
    pub time_s: f64,
    /// Position of the needle along the insertion axis in metres.
    pub position_m: f64,
    /// Its velocity in m/s.
    pub velocity_mps: f64,
    /// Its acceleration in m/s².
    pub acceleration_mps2: f64,
    /// Tissue force with its ground truth.
    pub force: TissueForce,
}

/// Sampling of an insertion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleRates {
    /// Samples per second.
    pub sample_hz: f64,
    /// Physics steps per sample, at least one.
    pub steps_per_sample: usize,
    /// Number of samples.
    pub samples: usize,
}

/// Kinematic replay: the needle follows the commanded motion exactly. The force law is evaluated once per sample.
pub fn simulate_replay(
    plan: &MotionPlan,
    law: &ForceLaw,
    rates: &SampleRates,
    mut on_rupture: impl FnMut(Rupture),
    mut sink: impl FnMut(&InsertionSample),
) {
    let mut state = ForceLawState::default();
    for k in 0..rates.samples {
        let time_s = k as f64 / rates.sample_hz;
        let MotionPoint { position_m, velocity_mps, acceleration_mps2 } = plan.at(time_s);
        let force = law.step(&mut state, time_s, position_m, velocity_mps, &mut on_rupture);
        sink(&InsertionSample { time_s, position_m, velocity_mps, acceleration_mps2, force });
    }
}

/// Velocity and acceleration of a body at the time of its position.
///
/// rapier integrates by semi-implicit Euler: the velocity of a body is the mean over the step that ended, half a step earlier than its position. The
/// drive's deviation from the commanded mean of that step is added to the commanded velocity at that time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityAtStepEnd {
    commanded: MotionPoint,
    /// Mean commanded velocity of the step that ended, m/s.
    mean_mps: f64,
    deviation_mps: f64,
    dt_s: f64,
}

impl VelocityAtStepEnd {
    /// State at the first sample, where the body moves as commanded.
    pub(crate) fn new(start: MotionPoint, dt_s: f64) -> Self {
        let mean_mps = start.velocity_mps;
        Self { commanded: start, mean_mps, deviation_mps: 0.0, dt_s }
    }

    /// Mean commanded velocity (m/s) of the step to `next`, which then ends there.
    pub(crate) fn advance(&mut self, next: MotionPoint) -> f64 {
        self.mean_mps = (next.position_m - self.commanded.position_m) / self.dt_s;
        self.commanded = next;
        self.mean_mps
    }

    /// Velocity (m/s) and acceleration (m/s²) at the end of the step, from the body's mean velocity over it.
    pub(crate) fn at_step_end(&mut self, body_mps: f64) -> (f64, f64) {
        let deviation_mps = body_mps - self.mean_mps;
        let deviation_mps2 = (deviation_mps - self.deviation_mps) / self.dt_s;
        self.deviation_mps = deviation_mps;
        let MotionPoint { velocity_mps, acceleration_mps2, .. } = self.commanded;
        (velocity_mps + deviation_mps, acceleration_mps2 + deviation_mps2)
    }
}

/// Slide: rapier moves the needle. The force law is evaluated at every physics step at the needle's actual position and velocity; its force acts
/// on the needle.
pub fn simulate_on_slide(
    plan: &MotionPlan,
    law: &ForceLaw,
    rates: &SampleRates,
    mut on_rupture: impl FnMut(Rupture),
    mut sink: impl FnMut(&InsertionSample),
) {
    let steps = rates.steps_per_sample.max(1);
    let physics_hz = rates.sample_hz * steps as f64;
    let start = plan.at(0.0);
    let mut slide = Slide::new(start.position_m, start.velocity_mps, 1.0 / physics_hz);
    let mut state = ForceLawState::default();
    let mut motion = VelocityAtStepEnd::new(start, 1.0 / physics_hz);
    for k in 0..rates.samples * steps {
        let time_s = k as f64 / physics_hz;
        let (position_m, body_mps) = slide.tip();
        let (velocity_mps, acceleration_mps2) = motion.at_step_end(body_mps);
        let force = law.step(&mut state, time_s, position_m, velocity_mps, &mut on_rupture);
        if k % steps == 0 {
            let time_s = (k / steps) as f64 / rates.sample_hz;
            sink(&InsertionSample { time_s, position_m, velocity_mps, acceleration_mps2, force });
        }
        let next = plan.at((k + 1) as f64 / physics_hz);
        slide.step(next.position_m, motion.advance(next), force.total_n);
    }
}
