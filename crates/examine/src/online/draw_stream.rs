//! Tissue, motion, sensor and noise of a stream.

use super::hand_held_motion::{DisturbanceForces, hand_held, stick_slip};
use super::moving_tissue::TissueMotion;
use super::stream_id::{Row, StreamId};
use crate::cases::case_id::{Size, World};
use crate::cases::draw_motion::{log_uniform, uniform};
use crate::cases::rich_world_effects::{RICH_EFFECTS, add_rich_effect, combine};
use crate::simulator::effect::Effect;
use crate::simulator::motion_path::{MotionPath, MotionPiece};
use crate::simulator::rich_world::{Damage, RichEffects, Tearing};
use crate::simulator::sensor_noise::SensorNoise;
use crate::simulator::tissue::{Layer, Tissue};
use core::f64::consts::TAU;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Usual rate in Hz, and noise in N.
const RATE_HZ: f64 = 200.0;
const NOISE_N: f64 = 0.015;
/// Thickness of a layer in m, drop at its puncture in N, friction in N s/m².
const THICKNESS_M: (f64, f64) = (6e-3, 16e-3);
const DROP_N: (f64, f64) = (0.4, 4.0);
const FRICTION_NS_PER_M2: (f64, f64) = (2e3, 1.5e4);
/// Share of the thickness at which a layer is punctured, and share of the layers that only end at their far face.
const PUNCTURED_AT: (f64, f64) = (0.5, 0.9);
const NOT_PUNCTURED: f64 = 0.25;
/// Travel in air in m, and speed of a robot in m/s.
const AIR_M: (f64, f64) = (4e-3, 8e-3);
const SPEED_MPS: (f64, f64) = (2e-3, 6e-3);
/// Speed in m/s at which damage ruptures a layer at its puncture force.
const DAMAGE_SPEED_MPS: f64 = 3e-3;

/// Properties of a stream, without its noise realisation.
#[derive(Clone, Debug)]
pub struct StreamSetup {
    /// The tissue.
    pub tissue: Tissue,
    /// Motion of the base.
    pub path: MotionPath,
    /// Effects of law and sensor.
    pub effects: Vec<Effect>,
    /// Effects of the rich law; `None`: the plain law.
    pub rich: Option<RichEffects>,
    /// Travel in m over which a puncture releases its force.
    pub release_m: f64,
    /// Periodic motion of the tissue.
    pub tissue_motion: Option<TissueMotion>,
    /// Disturbance forces on the needle's base.
    pub disturbances: DisturbanceForces,
    /// Noise of the sensor.
    pub noise: SensorNoise,
    /// Samples per second.
    pub rate_hz: f64,
    /// Share of the samples that are missing.
    pub missing: f64,
    /// Step of the converter in N.
    pub rounding_n: Option<f64>,
}

/// Draws a stream. The severity changes amounts, not the order of the draws.
#[must_use]
pub fn set_up_stream(id: &StreamId) -> StreamSetup {
    let mut rng = ChaCha8Rng::seed_from_u64(id.stream_seed());
    let mut tissue_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut path_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let rng = &mut rng;
    let of = |three: [f64; 3]| three[id.severity as usize];
    let tissue = draw_tissue(&mut tissue_rng, id);
    let start_m = -uniform(&mut path_rng, AIR_M.0, AIR_M.1);
    let depth_m = tissue.end_m() + uniform(&mut path_rng, 2e-3, 6e-3);
    let range = MotionRange { start_m, depth_m, speed_mps: uniform(&mut path_rng, SPEED_MPS.0, SPEED_MPS.1) };
    let path = draw_path(&mut path_rng, id, &range, &tissue);
    let mut effects = Vec::new();
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    match id.row {
        Row::SoftBoundary if id.world == World::Plain => {
            effects.push(Effect::SoftBoundary { width_m: of([0.5e-3, 1e-3, 2e-3]) });
        }
        Row::Offset => effects.push(Effect::ForceBias { force_n: sign * of([0.5, 2.0, 10.0]) }),
        Row::Drift => effects.push(Effect::ForceDrift { rate_n_per_s: sign * of([5e-3, 15e-3, 30e-3]) }),
        Row::Tare => {
            let time_s = uniform(rng, 0.05, 0.95) * path.duration_s();
            effects.push(Effect::ZeroStep { time_s, step_n: sign * of([0.2, 0.5, 2.0]) });
        }
        Row::Delay => effects.push(Effect::TimeDelay { delay_s: of([5e-3, 15e-3, 30e-3]) }),
        Row::Lag => effects.push(Effect::LowPassLag { time_constant_s: of([5e-3, 15e-3, 40e-3]) }),
        _ => {}
    }
    let tissue_motion = (id.row == Row::Breathing).then(|| TissueMotion {
        amplitude_m: of([0.5e-3, 1e-3, 2e-3]),
        frequency_hz: uniform(rng, 0.15, 0.3),
        phase_rad: uniform(rng, 0.0, TAU),
    });
    let disturbances = if id.row == Row::HandHeld {
        DisturbanceForces::draw(rng, of([1.0, 3.0, 6.0]) as usize, of([0.05, 0.1, 0.2]), path.duration_s())
    } else {
        DisturbanceForces::default()
    };
    let mut noise = SensorNoise::white(match id.row {
        Row::Constant | Row::Sinusoid | Row::Rate50Hz | Row::Rate1kHz | Row::Rate5kHz => {
            of([0.01, 0.025, 0.05])
        }
        Row::Membranes => 0.01,
        _ => NOISE_N,
    });
    if id.row == Row::Coloured {
        noise.ar = [of([0.5, 0.8, 0.95]), 0.0];
    }
    let rich = draw_rich(rng, id, &tissue);
    let tearing_m = rich.and_then(|r| r.tearing).map_or(0.0, |t| f64::from(t.steps) * t.travel_m);
    let softness_m = effects.iter().find_map(|e| match *e {
        Effect::SoftBoundary { width_m } => Some(width_m),
        _ => None,
    });
    StreamSetup {
        release_m: softness_m.unwrap_or(tearing_m),
        rich,
        path,
        effects,
        tissue_motion,
        disturbances,
        noise,
        rate_hz: match id.row {
            Row::Rate50Hz => 50.0,
            Row::Rate1kHz => 1000.0,
            Row::Rate5kHz => 5000.0,
            _ => RATE_HZ,
        },
        missing: if id.row == Row::Gaps { of([0.03, 0.1, 0.3]) } else { 0.0 },
        rounding_n: (id.row == Row::TwelveBits).then(|| 2.0 * of([20.0, 50.0, 100.0]) / 4096.0),
        tissue,
    }
}

fn draw_tissue(rng: &mut ChaCha8Rng, id: &StreamId) -> Tissue {
    let of = |three: [(f64, f64); 3]| three[id.severity as usize];
    let count = rng.random_range(2..=4);
    let thin = rng.random_range(0..count);
    let mut layers = Vec::new();
    for i in 0..count {
        let drawn_m = uniform(rng, THICKNESS_M.0, THICKNESS_M.1);
        let thin_m = of([(3e-3, 3e-3), (2e-3, 2e-3), (1e-3, 1e-3)]).0;
        let thickness_m = if id.row == Row::ThinLayer && i == thin { thin_m } else { drawn_m };
        let (low, high) =
            if id.row == Row::WeakDrops { of([(0.4, 0.6), (0.2, 0.4), (0.1, 0.2)]) } else { DROP_N };
        let drop_n = log_uniform(rng, low, high);
        let at = uniform(rng, PUNCTURED_AT.0, PUNCTURED_AT.1);
        let punctured = rng.random::<f64>() >= NOT_PUNCTURED || id.row == Row::DelayedPuncture;
        let friction_ns_per_m2 = log_uniform(rng, FRICTION_NS_PER_M2.0, FRICTION_NS_PER_M2.1);
        layers.push(Layer {
            thickness_m,
            stiffness_n_per_m: drop_n / (thickness_m * if punctured { at } else { 1.0 }),
            friction_ns_per_m2,
            puncture_n: punctured.then_some(drop_n),
        });
        if id.row == Row::Membranes && i + 1 < count {
            let thickness_m = uniform(rng, 0.6e-3, 1.5e-3);
            let drop_n = uniform(rng, 0.8, 1.2) * of([(0.3, 0.3), (0.15, 0.15), (0.05, 0.05)]).0;
            layers.push(Layer {
                thickness_m,
                stiffness_n_per_m: drop_n / (thickness_m * 0.8),
                friction_ns_per_m2,
                puncture_n: Some(drop_n),
            });
        }
    }
    Tissue { surface_m: 0.0, layers }
}

/// Effects of the rich law: those of the row, and in the rich world one or two others.
fn draw_rich(rng: &mut ChaCha8Rng, id: &StreamId, tissue: &Tissue) -> Option<RichEffects> {
    let of = |three: [f64; 3]| three[id.severity as usize];
    let mut others = RichEffects::default();
    for _ in 0..rng.random_range(1..=2) {
        // A membrane is left out: the law does not report its puncture.
        let which = [0, 1, 2, 3, 5][rng.random_range(0..RICH_EFFECTS.len() - 1)];
        add_rich_effect(rng, which, tissue, Size::Medium, &mut others);
    }
    let mut own = RichEffects::default();
    match id.row {
        Row::Tearing => own.tearing = Some(Tearing { steps: 3, travel_m: of([0.2e-3, 0.53e-3, 1e-3]) }),
        Row::DelayedPuncture => {
            let exponent = of([20.0, 12.0, 7.0]);
            let layer = &tissue.layers[0];
            let travel_m = layer.puncture_n.unwrap_or(1.0) / layer.stiffness_n_per_m;
            own.damage = Some(Damage { exponent, time_s: travel_m / ((exponent + 1.0) * DAMAGE_SPEED_MPS) });
        }
        _ => {}
    }
    match id.world {
        World::Rich => Some(combine(&others, &own)),
        World::Plain => (own != RichEffects::default()).then_some(own),
    }
}

struct MotionRange {
    start_m: f64,
    depth_m: f64,
    speed_mps: f64,
}

impl MotionRange {
    /// A move at constant speed from one position to another.
    fn constant_move(&self, from_m: f64, to_m: f64) -> MotionPiece {
        let speed_mps = if to_m < from_m { -1.5 * self.speed_mps } else { self.speed_mps };
        MotionPiece::constant(speed_mps, (to_m - from_m) / speed_mps)
    }
}

fn draw_path(rng: &mut ChaCha8Rng, id: &StreamId, range: &MotionRange, tissue: &Tissue) -> MotionPath {
    let of = |three: [f64; 3]| three[id.severity as usize];
    let length_m = range.depth_m - range.start_m;
    let mut pieces = Vec::new();
    match id.row {
        Row::Sinusoid => {
            let duration_s = length_m / range.speed_mps * 2.0;
            return MotionPath::new(
                range.start_m,
                vec![MotionPiece::Swing {
                    amplitude_m: 0.5 * length_m,
                    frequency_hz: uniform(rng, 0.65, 0.9) / duration_s,
                    duration_s,
                }],
            );
        }
        Row::HandHeld => return hand_held(rng, range.start_m, range.depth_m, of([2e-5, 5e-5, 1e-4])),
        Row::StickSlip => return stick_slip(rng, range.start_m, range.depth_m, of([2e-4, 5e-4, 1e-3])),
        Row::Hold => {
            let mut places: Vec<f64> =
                (0..of([1.0, 2.0, 4.0]) as usize).map(|_| uniform(rng, 0.0, range.depth_m)).collect();
            places.sort_by(f64::total_cmp);
            let mut from_m = range.start_m;
            for to_m in places {
                pieces.extend([
                    range.constant_move(from_m, to_m),
                    MotionPiece::constant(0.0, uniform(rng, 0.5, 3.0)),
                ]);
                from_m = to_m;
            }
            pieces.push(range.constant_move(from_m, range.depth_m));
        }
        Row::Ripple => pieces.push(MotionPiece::Move {
            speed_mps: range.speed_mps,
            ripple_mps: range.speed_mps * of([0.2, 0.5, 0.9]),
            ripple_hz: uniform(rng, 0.3, 2.0),
            duration_s: length_m / range.speed_mps,
        }),
        Row::Reinsertion => {
            let mut from_m = range.start_m;
            for _ in 0..of([1.0, 2.0, 3.0]) as usize {
                let to_m = uniform(rng, 0.4, 1.0) * range.depth_m;
                let back_m = uniform(rng, -2e-3, 0.5 * to_m);
                let to_m = to_m.max(from_m);
                pieces.extend([
                    range.constant_move(from_m, to_m),
                    MotionPiece::constant(0.0, 0.5),
                    range.constant_move(to_m, back_m),
                    MotionPiece::constant(0.0, 0.5),
                ]);
                from_m = back_m;
            }
            pieces.push(range.constant_move(from_m, range.depth_m));
        }
        Row::DelayedPuncture => {
            let layer = rng.random_range(0..tissue.layers.len());
            let full_m =
                tissue.layers[layer].puncture_n.unwrap_or(0.0) / tissue.layers[layer].stiffness_n_per_m;
            let at_m = tissue.front_m(layer) + of([0.95, 0.9, 0.85]) * full_m;
            pieces.extend([
                range.constant_move(range.start_m, at_m),
                MotionPiece::constant(0.0, 4.0),
                range.constant_move(at_m, range.depth_m),
            ]);
        }
        _ => pieces.push(range.constant_move(range.start_m, range.depth_m)),
    }
    let back_m = uniform(rng, 0.3, 0.7) * range.depth_m;
    pieces.extend([
        MotionPiece::constant(0.0, uniform(rng, 0.5, 1.5)),
        range.constant_move(range.depth_m, back_m),
    ]);
    MotionPath::new(range.start_m, pieces)
}
