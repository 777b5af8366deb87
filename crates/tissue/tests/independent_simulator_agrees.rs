//! Promise: the independent simulator (`stylet_examine::simulator`) and the force law give the same force for every effect.
//! Neither uses code of the other; where they differ, one of them does not follow docs/reference/model.md.

use stylet_examine::simulator::effect::{Effect, IDS};
use stylet_examine::simulator::force_sensor::SensorModel;
use stylet_examine::simulator::insertion::simulate_insertion;
use stylet_examine::simulator::motion_path::{MotionPath, MotionPiece};
use stylet_examine::simulator::plain_world::PlainWorld;
use stylet_examine::simulator::tissue::{Layer, Tissue};
use stylet_tissue::{AnyEffect, ForceLaw, ForceLawState, MeasurementChain, SensorInput};

/// Steps of both laws in s.
const STEP_S: f64 = 1e-4;

fn tissue() -> Tissue {
    let layer = |thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n| Layer {
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
    };
    Tissue {
        surface_m: 0.001,
        layers: vec![
            layer(0.025, 50.0, 9000.0, Some(0.9)),
            layer(0.030, 80.0, 12000.0, None),
            layer(0.028, 60.0, 7000.0, Some(1.3)),
        ],
    }
}

fn path() -> MotionPath {
    MotionPath::new(
        -0.004,
        vec![
            MotionPiece::constant(0.004, 5.0),
            MotionPiece::Move { speed_mps: 0.003, ripple_mps: 0.002, ripple_hz: 0.7, duration_s: 8.0 },
            MotionPiece::constant(0.0, 1.5),
            MotionPiece::constant(-0.003, 1.2),
            MotionPiece::constant(0.005, 9.0),
            MotionPiece::constant(0.0, 1.0),
            MotionPiece::constant(-0.006, 6.0),
        ],
    )
}

fn effects() -> Vec<Effect> {
    use Effect::*;
    vec![
        NonlinearElasticity { kappa_per_m: 12.0 },
        StressRelaxation { terms: [(0.2, 0.4), (0.25, 4.0)] },
        CoulombFriction { c_n_per_m: 6.0 },
        StribeckFriction { c_n_per_m: 4.0, c_static_n_per_m: 9.0, v_stribeck_mps: 1.5e-3 },
        PreslidingFriction { c_n_per_m: 6.0, delta_m: 8e-4 },
        AsymmetricFriction { eps: 0.2 },
        PowerLawFriction { exponent: 0.7 },
        CuttingForce { force_n: 0.3 },
        IncompleteRelease { fraction: 0.3 },
        RateDependentPuncture { alpha: 0.15 },
        HiddenMembrane { depth_m: 0.034, stiffness_n_per_m: 150.0, puncture_n: 0.5 },
        BoundaryShift { layer: 1, shift_m: 0.004 },
        SoftBoundary { width_m: 0.003 },
        Respiration { amplitude_m: 8e-4, frequency_hz: 0.3, phase_rad: 0.6 },
        NeedleCompliance { stiffness_n_per_m: 600.0 },
        ToolInertia { mass_kg: 4.0 },
        DriveFriction { force_n: 0.2 },
        ForceGain { eps: 0.1 },
        LowPassLag { time_constant_s: 0.05 },
        TimeDelay { delay_s: 0.037 },
        ForceBias { force_n: -0.1 },
        ForceDrift { rate_n_per_s: 0.004 },
        PeriodicInterference { amplitude_n: 0.07, frequency_hz: 3.3, phase_rad: 1.0 },
        Saturation { limit_n: 1.1 },
        Quantisation { step_n: 0.05 },
        PositionScale { eps: 0.03 },
        ForceSpikes { rate_hz: 0.5, size_n: 1.0 },
        ZeroStep { time_s: 9.2, step_n: -0.4 },
        PositionDependentForce { stiffness_n_per_m: 8.0, rest_m: -0.01 },
        LoadingHysteresis { fraction: 0.3, reversal_n: 0.06 },
    ]
}

/// The library's force at 200 Hz.
fn library(effect: Option<&Effect>) -> Vec<f64> {
    let t = tissue();
    let stack = stylet_tissue::Tissue {
        surface_m: t.surface_m,
        layers: t
            .layers
            .iter()
            .map(|l| stylet_tissue::Layer {
                name: String::new(),
                thickness_m: l.thickness_m,
                stiffness_n_per_m: l.stiffness_n_per_m,
                friction_ns_per_m2: l.friction_ns_per_m2,
                puncture_n: l.puncture_n,
            })
            .collect(),
    };
    let made: Vec<AnyEffect> = effect
        .iter()
        .map(|e| {
            let values: Vec<f64> = e.parameters().iter().map(|p| p.1).collect();
            AnyEffect::from_parameters(e.id(), &values).expect("an effect of the library")
        })
        .collect();
    let law = ForceLaw::new(&stack, &made).expect("a law");
    let chain = MeasurementChain::new(&made);
    let (mut state, mut measuring) = (ForceLawState::default(), chain.start(1.0 / STEP_S));
    let (path, mut piece, mut out) = (path(), 0, Vec::new());
    let n = (path.duration_s() / STEP_S) as usize;
    for k in 0..n {
        let time_s = k as f64 * STEP_S;
        while time_s >= path.piece_end_s(piece) {
            piece += 1;
        }
        let p = path.at(piece, time_s);
        let tissue_n = law.step(&mut state, time_s, p.z, p.v, |_| {}).total_n;
        let reading = SensorInput {
            time_s,
            position_m: p.z,
            velocity_mps: p.v,
            acceleration_mps2: p.a,
            tissue_n,
            noise_n: 0.0,
        };
        let force = chain.step(&mut measuring, &reading);
        if k % 50 == 0 {
            out.push(force);
        }
    }
    out
}

/// Force of the independent simulator.
fn simulator(effect: Option<&Effect>) -> Vec<f64> {
    let made: Vec<Effect> = effect.into_iter().copied().collect();
    let instrument = SensorModel::new(&made, 0.0);
    let path = path();
    let n = (path.duration_s() / STEP_S) as usize;
    let at: Vec<f64> = (0..n).step_by(50).map(|k| k as f64 * STEP_S).collect();
    let mut law = PlainWorld::new(&tissue(), &made);
    let there = simulate_insertion(&mut law, &instrument, None, &path, &at, STEP_S);
    at.iter().zip(&there.force_n).map(|(&t, &f)| instrument.reading_n(t, f, 0.0)).collect()
}

#[test]
fn every_effect_has_the_same_force_in_both_implementations() {
    let all = effects();
    assert_eq!(all.iter().map(Effect::id).collect::<Vec<_>>(), IDS);
    let base = simulator(None);
    let mut worst = Vec::new();
    for effect in [None].into_iter().chain(all.iter().map(Some)) {
        let (a, b) = (library(effect), simulator(effect));
        assert_eq!(a.len(), b.len());
        let largest = b.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        // A jump may fall on the other side of a sample: a few samples are left out.
        let mut off: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        let off = off[off.len() - 1 - off.len() / 300];
        let acts = base.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let name = effect.map_or("nothing", Effect::id);
        println!("{name:<26} differs {off:.2e} N of {largest:.2} N; acts by {acts:.2} N");
        worst.push((name, off / largest));
        // Noise and recorded positions are not the law's.
        assert!(
            effect.is_none() || acts > 0.02 || ["position_scale", "force_spikes"].contains(&name),
            "{name}"
        );
    }
    let wrong: Vec<_> = worst.iter().filter(|w| w.1 > 1e-3).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}
