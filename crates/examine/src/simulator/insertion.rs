//! Simulation of one insertion through tissue and instrument.

use super::force_law::{ForceKnot, ForceLaw};
use super::force_sensor::SensorModel;
use super::motion_path::{MotionPath, MotionState};

/// True values at the samples, without noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Insertion {
    /// Sample times in s.
    pub time_s: Vec<f64>,
    /// True position of the base in m.
    pub position_m: Vec<f64>,
    /// True velocity of the base in m/s.
    pub velocity_mps: Vec<f64>,
    /// Acceleration of the base in m/s².
    pub acceleration_mps2: Vec<f64>,
    /// Force after tool, gain, lag and delay in N.
    pub force_n: Vec<f64>,
    /// Force on the tip in N, without sensor and tool.
    pub tip_n: Vec<f64>,
    /// Times of the ruptures in s.
    pub ruptures_s: Vec<f64>,
    /// Elastic force in N that each of them released.
    pub released_n: Vec<f64>,
}

/// A force outside the library, added at the needle's base.
pub trait UnmodelledForce {
    /// The force in N at a point of the base's motion; `ruptures` are the times of the ruptures so far.
    fn force_n(&mut self, at: &MotionState, ruptures: &[f64]) -> f64;
}

/// Simulates a needle along `path`; samples the force at the times `at_s` (increasing, from 0), with steps of at most
/// `step_s` in between and at the borders of the path's pieces.
pub fn simulate_insertion(
    law: &mut dyn ForceLaw,
    instrument: &SensorModel,
    mut strange: Option<&mut dyn UnmodelledForce>,
    path: &MotionPath,
    at_s: &[f64],
    step_s: f64,
) -> Insertion {
    let mut out = Insertion::default();
    let mut line = instrument.start();
    let mut knots: Vec<ForceKnot> = Vec::new();
    let mut piece = 0;
    let mut here = path.at(0, 0.0);
    let mut extra =
        |p: &MotionState, ruptures: &[f64]| strange.as_mut().map_or(0.0, |s| s.force_n(p, ruptures));
    let first = law.start(&here);
    let first = first + extra(&here, law.ruptures()) + instrument.tool_n(here.z, here.v, here.a);
    line.add_knot(ForceKnot { t: here.t, force_n: first });
    for &t in at_s {
        while here.t < t {
            let border = path.piece_end_s(piece);
            let stop = if border <= t { border } else { t };
            let parts = ((stop - here.t) / step_s).ceil().max(1.0) as usize;
            let from_t = here.t;
            for k in 1..=parts {
                let time = if k == parts { stop } else { from_t + (stop - from_t) * k as f64 / parts as f64 };
                let next = path.at(piece, time);
                knots.clear();
                law.advance(&next, &mut knots);
                let length = next.t - here.t;
                for knot in &knots {
                    // Within the step the base's speed is approximately linear.
                    let s = if length > 0.0 { (knot.t - here.t) / length } else { 1.0 };
                    let p = MotionState {
                        t: knot.t,
                        z: here.z + (next.z - here.z) * s,
                        v: here.v + (next.v - here.v) * s,
                        a: here.a + (next.a - here.a) * s,
                    };
                    let force_n = knot.force_n + extra(&p, law.ruptures()) + instrument.tool_n(p.z, p.v, p.a);
                    line.add_knot(ForceKnot { t: knot.t, force_n });
                }
                here = next;
            }
            if stop == border {
                piece += 1;
                here = path.at(piece, stop);
                knots.clear();
                law.jump(&here, &mut knots);
                for knot in &knots {
                    let force_n = knot.force_n
                        + extra(&here, law.ruptures())
                        + instrument.tool_n(here.z, here.v, here.a);
                    line.add_knot(ForceKnot { t: knot.t, force_n });
                }
            }
        }
        out.time_s.push(t);
        out.position_m.push(here.z);
        out.velocity_mps.push(here.v);
        out.acceleration_mps2.push(here.a);
        out.force_n.push(line.read(t));
        out.tip_n.push(law.tip_n());
    }
    out.ruptures_s = law.ruptures().to_vec();
    out.released_n = law.released_n().to_vec();
    out
}
