//! Simulated sets of recordings with known models.
#![allow(dead_code, reason = "every test uses a part")]

use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_record::Recording;
use stylet_tissue::{
    AnyEffect, DelayedPuncture, ForceLaw, ForceLawState, Layer, ReleaseDepth, ShaftSlip, Tissue,
};

/// Exponent of the slip law.
pub const EXPONENT: f64 = 9.0;
/// Standard deviation of the sensor noise in N.
const NOISE_N: f64 = 0.02;
/// Shift of the surface on the second day in m.
pub const SHIFT_M: f64 = 1.5e-3;

/// Seed and surface shift.
pub struct SimulatedSet {
    pub seed: u64,
    pub shift_m: f64,
}

impl Default for SimulatedSet {
    fn default() -> Self {
        Self { seed: 7, shift_m: SHIFT_M }
    }
}

pub fn assumed_tissue() -> Tissue {
    let layer = Layer {
        name: "gel".into(),
        thickness_m: 0.08,
        stiffness_n_per_m: 100.0,
        friction_ns_per_m2: 0.0,
        puncture_n: None,
    };
    Tissue { surface_m: 0.004, layers: vec![layer] }
}

/// One stick_slip_recording by 25 mm with a hold of 5 s and a retraction.
fn stick_slip_recording(
    name: String,
    speed_mps: f64,
    shift_m: f64,
    rng: &mut impl Rng,
) -> SegmentedRecording {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let (surface, friction, tough) = (1e-4 * normal(), 0.03 * normal(), 0.03 * normal());
    let mut tissue = assumed_tissue();
    tissue.surface_m += shift_m + surface;
    let mut slip = ShaftSlip {
        layer: 1,
        push_n: 1.8 * friction.exp(),
        pull_n: 1.1 * friction.exp(),
        retained_share: 0.7,
        exponent: EXPONENT,
        curvature_n_per_m2: 3e4,
        fractions: [0.15, 0.2],
        time_constants_s: [1.0, 9.0],
        ..ShaftSlip::default()
    };
    slip.rate = -0.05;
    let effects: [AnyEffect; 3] = [
        slip.into(),
        DelayedPuncture { layer: 1, force_n: 3.0 * (1.0 + tough), exponent: 12.0 }.into(),
        ReleaseDepth { layer: 1, depth_m: 1e-3 + 2e-4 * normal() }.into(),
    ];
    simulate(name, (0.025, speed_mps, 5.0), &tissue, &effects, rng)
}

/// Simulates a recording at 100 Hz with noise.
fn simulate(
    name: String,
    (stroke_m, speed_mps, rest_s): (f64, f64, f64),
    tissue: &Tissue,
    effects: &[AnyEffect],
    rng: &mut impl Rng,
) -> SegmentedRecording {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let law = ForceLaw::new(tissue, effects).expect("three effects");
    let travel_s = stroke_m / speed_mps;
    let (mut state, mut columns) = (ForceLawState::default(), [vec![], vec![], vec![]]);
    for k in 0..((2.0 * travel_s + rest_s + 0.5) * 100.0) as usize {
        let t = k as f64 * 0.01;
        let (z, v) = match t {
            t if t < travel_s => (speed_mps * t, speed_mps),
            t if t < travel_s + rest_s => (stroke_m, 0.0),
            t if t < 2.0 * travel_s + rest_s => (stroke_m - speed_mps * (t - travel_s - rest_s), -speed_mps),
            _ => (0.0, 0.0),
        };
        let f = law.step(&mut state, t, z, v, |_| {}).total_n + NOISE_N * normal();
        columns.iter_mut().zip([t, z, f]).for_each(|(c, x)| c.push(x));
    }
    let [t, z, f] = columns;
    SegmentedRecording::new(name, Recording::new(t, z, f).expect("clean columns"), 1)
}

/// Four recordings at each of two speeds with the stick-slip model.
pub fn stick_slip_set(d: &SimulatedSet) -> Vec<SegmentedRecording> {
    let mut rng = ChaCha8Rng::seed_from_u64(d.seed);
    let mut out = Vec::new();
    for (speed_mps, shift_m) in [(1e-3, 0.0), (3e-3, d.shift_m)] {
        for k in 0..4 {
            out.push(stick_slip_recording(format!("{speed_mps} {k}"), speed_mps, shift_m, &mut rng));
        }
    }
    out
}

/// Four recordings at each of two speeds with the base law: spring, viscous friction, puncture force.
pub fn base_law_set(seed: u64) -> Vec<SegmentedRecording> {
    base_law_set_in(&assumed_tissue(), seed)
}

/// The same in another tissue of one layer, with other parameters of its law.
pub fn base_law_set_in(assumed: &Tissue, seed: u64) -> Vec<SegmentedRecording> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut out = Vec::new();
    for speed_mps in [2.5e-3, 6e-3] {
        for k in 0..4 {
            let (surface, tough): (f64, f64) =
                (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
            let mut tissue = assumed.clone();
            tissue.surface_m += 1e-4 * surface;
            tissue.layers[0].stiffness_n_per_m = 250.0;
            tissue.layers[0].friction_ns_per_m2 = 2e4;
            tissue.layers[0].puncture_n = Some(2.0 * (1.0 + 0.03 * tough));
            out.push(simulate(format!("{speed_mps} {k}"), (0.016, speed_mps, 2.0), &tissue, &[], &mut rng));
        }
    }
    out
}
