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
    let mut previous_mps = start.velocity_mps;
    for k in 0..rates.samples * steps {
        let time_s = k as f64 / physics_hz;
        let (position_m, velocity_mps) = slide.tip();
        let force = law.step(&mut state, time_s, position_m, velocity_mps, &mut on_rupture);
        if k % steps == 0 {
            sink(&InsertionSample {
                time_s: (k / steps) as f64 / rates.sample_hz,
                position_m,
                velocity_mps,
                acceleration_mps2: (velocity_mps - previous_mps) * physics_hz,
                force,
            });
        }
        previous_mps = velocity_mps;
        let next = plan.at((k + 1) as f64 / physics_hz);
        slide.step(next.position_m, next.velocity_mps, force.total_n);
    }
}
