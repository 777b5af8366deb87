//! Shared test helpers: tissues, motions, replays.
#![allow(dead_code)] // each test file uses its own part

use stylet_tissue::*;

/// One sample of motion: time, position, velocity.
pub type Sample = (f64, f64, f64);

pub fn layer(
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction_ns_per_m2: f64,
    puncture_n: Option<f64>,
) -> Layer {
    Layer { name: String::new(), thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n }
}

pub fn tissue(layers: &[Layer]) -> Tissue {
    Tissue { surface_m: 0.0, layers: layers.to_vec() }
}

/// Three gels; the middle one is punctured before its far face.
pub fn three_gels() -> Tissue {
    tissue(&[
        layer(0.02, 50.0, 9000.0, None),
        layer(0.03, 70.0, 12000.0, Some(1.5)),
        layer(0.02, 80.0, 16000.0, None),
    ])
}

/// One thick layer that nothing ruptures.
pub fn block(stiffness_n_per_m: f64, friction_ns_per_m2: f64) -> Tissue {
    tissue(&[layer(1.0, stiffness_n_per_m, friction_ns_per_m2, None)])
}

/// Advance with ripple (to 60 mm by default), hold, retract; `rate` samples per second for 15 s.
pub fn ripple_hold_retract(
    start_m: f64,
    mean_mps: f64,
    ripple_mps: f64,
    ripple_hz: f64,
    rate: f64,
) -> Vec<Sample> {
    let omega = std::f64::consts::TAU * ripple_hz;
    let advanced = |t: f64| {
        start_m
            + mean_mps * t
            + if omega > 0.0 { ripple_mps / omega * (1.0 - (omega * t).cos()) } else { 0.0 }
    };
    let samples = (15.0 * rate) as usize;
    (0..samples)
        .map(|k| k as f64 / rate)
        .map(|t| {
            if t < 9.0 {
                (t, advanced(t), mean_mps + ripple_mps * (omega * t).sin())
            } else if t < 11.0 {
                (t, advanced(9.0), 0.0)
            } else {
                (t, advanced(9.0) - 0.004 * (t - 11.0), -0.004)
            }
        })
        .collect()
}

pub fn usual_motion() -> Vec<Sample> {
    ripple_hold_retract(-0.002, 0.007, 0.003, 0.4, 200.0)
}

pub fn run(tissue: &Tissue, effects: &[AnyEffect], motion: &[Sample]) -> (Vec<TissueForce>, Vec<Rupture>) {
    let law = ForceLaw::new(tissue, effects).expect("few effects");
    let (mut forces, mut ruptures) = (Vec::new(), Vec::new());
    replay(&law, motion.iter().copied(), |r| ruptures.push(r), |f| forces.push(f));
    (forces, ruptures)
}

pub fn forces(tissue: &Tissue, effects: &[AnyEffect], motion: &[Sample]) -> Vec<f64> {
    run(tissue, effects, motion).0.iter().map(|f| f.total_n).collect()
}

#[track_caller]
pub fn near(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} against {b}: {:e} apart", (a - b).abs());
}

/// Largest difference of two lists of the same length.
pub fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Every effect of the library at its typical values, larger variants too.
pub fn typical_effects() -> Vec<AnyEffect> {
    let mut out = Vec::new();
    for entry in general_effects() {
        let mut next = Some(entry);
        while let Some(info) = next {
            let start: Vec<f64> = info.parameters.iter().map(|p| p.start).collect();
            out.push(AnyEffect::from_parameters(info.id, &start).expect("a library effect"));
            next = info.extended;
        }
    }
    out
}
