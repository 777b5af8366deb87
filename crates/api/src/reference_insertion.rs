//! Reference insertion without and with an effect of the library.

use stylet_tissue::{
    AnyEffect, EffectInfo, ForceLaw, ForceLawState, Layer, MeasurementChain, SensorInput, Tissue,
};

/// The force of a reference insertion without and with an effect.
pub struct ReferenceInsertion {
    /// Parameters of the effect, in order: typical values, or values with a visible influence on this insertion.
    pub parameters: Vec<f64>,
    /// Force at the needle's base by the base law (N), every 5 ms over 25 s.
    pub base_n: Vec<f64>,
    /// The same with the effect (N).
    pub with_effect_n: Vec<f64>,
}

/// Insertion into three gels: ripple, hold at 10 s, advance at 14 s, retraction from 20 s on.
#[must_use]
pub fn reference_insertion(entry: &'static EffectInfo) -> ReferenceInsertion {
    let typical: Vec<f64> = entry.parameters.iter().map(|p| p.demonstration.unwrap_or(p.start)).collect();
    let with: Vec<AnyEffect> = entry.with_parameters(&typical).into_iter().collect();
    ReferenceInsertion { base_n: force(&[]), with_effect_n: force(&with), parameters: typical }
}

/// Motion of the reference insertion: time, position, velocity, acceleration.
fn motion() -> Vec<[f64; 4]> {
    let (mut z, dt) = (-0.002, 0.005);
    (0..5000)
        .map(|i| {
            let t = f64::from(i) * dt;
            let w = core::f64::consts::TAU * 0.4;
            let (v, a) = match t {
                t if t < 10.0 => (0.003 + 0.0015 * (w * t).sin(), 0.0015 * w * (w * t).cos()),
                t if t < 14.0 => (0.0, 0.0),
                t if t < 20.0 => (0.004, 0.0),
                _ => (-0.008, 0.0),
            };
            z += v * dt;
            [t, z, v, a]
        })
        .collect()
}

fn force(effects: &[AnyEffect]) -> Vec<f64> {
    let layer = |d: f64, k: f64, b: f64, f: Option<f64>| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: b,
        puncture_n: f,
    };
    let tissue = Tissue {
        surface_m: 0.0,
        layers: vec![
            layer(0.015, 60.0, 6000.0, None),
            layer(0.02, 90.0, 9000.0, Some(1.4)),
            layer(0.03, 70.0, 7000.0, None),
        ],
    };
    let Ok(law) = ForceLaw::new(&tissue, effects) else { return Vec::new() };
    let chain = MeasurementChain::new(effects);
    let (mut state, mut measuring) = (ForceLawState::default(), chain.start(200.0));
    motion()
        .into_iter()
        .map(|[t, z, v, a]| {
            let tissue_n = law.step(&mut state, t, z, v, |_| {}).total_n;
            chain.step(
                &mut measuring,
                &SensorInput {
                    time_s: t,
                    position_m: z,
                    velocity_mps: v,
                    acceleration_mps2: a,
                    tissue_n,
                    noise_n: 0.0,
                },
            )
        })
        .collect()
}
