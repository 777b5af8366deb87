//! Forces of the plain and rich worlds for one motion, as JSON, for a check by an integrator that shares nothing with them:
//! `cargo run --release -p stylet-examine --example trace > trace.json; python3 benches/peers/referee_scipy.py trace.json`

use serde_json::json;
use stylet_examine::simulator::effect::Effect;
use stylet_examine::simulator::force_law::ForceLaw;
use stylet_examine::simulator::force_sensor::SensorModel;
use stylet_examine::simulator::insertion::simulate_insertion;
use stylet_examine::simulator::motion_path::{MotionPath, MotionPiece};
use stylet_examine::simulator::plain_world::PlainWorld;
use stylet_examine::simulator::rich_world::{RichEffects, RichWorld};
use stylet_examine::simulator::tissue::{Layer, Tissue};

/// Samples per second.
const SAMPLE_HZ: f64 = 100.0;
/// Largest step in s: that of the cases.
const STEP_S: f64 = 2e-4;

fn main() {
    let layers =
        [(0.025, 50.0, 9000.0, Some(0.9)), (0.030, 80.0, 12000.0, None), (0.028, 60.0, 7000.0, Some(1.3))];
    let tissue = Tissue {
        surface_m: 0.001,
        layers: layers
            .iter()
            .map(|&(thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n)| Layer {
                thickness_m,
                stiffness_n_per_m,
                friction_ns_per_m2,
                puncture_n,
            })
            .collect(),
    };
    // Speed, ripple (m/s), its frequency (Hz), duration (s).
    let pieces = [
        [0.004, 0.0, 0.0, 5.0],
        [0.003, 0.002, 0.7, 8.0],
        [0.0, 0.0, 0.0, 1.5],
        [-0.003, 0.0, 0.0, 1.2],
        [0.005, 0.0, 0.0, 9.0],
        [0.0, 0.0, 0.0, 1.0],
        [-0.006, 0.0, 0.0, 6.0],
    ];
    let start_m = -0.004;
    let path = MotionPath::new(
        start_m,
        pieces
            .iter()
            .map(|&[speed_mps, ripple_mps, ripple_hz, duration_s]| MotionPiece::Move {
                speed_mps,
                ripple_mps,
                ripple_hz,
                duration_s,
            })
            .collect(),
    );
    let at: Vec<f64> =
        (0..(path.duration_s() * SAMPLE_HZ) as usize).map(|k| (k as f64 + 0.37) / SAMPLE_HZ).collect();
    let terms = [(0.2, 0.4), (0.25, 4.0)];
    let runs: Vec<(&str, Option<Vec<Effect>>)> = vec![
        ("base", Some(vec![])),
        ("rich, inactive", None),
        ("stress_relaxation", Some(vec![Effect::StressRelaxation { terms }])),
        ("presliding_friction", Some(vec![Effect::PreslidingFriction { c_n_per_m: 6.0, delta_m: 8e-4 }])),
        ("rate_dependent_puncture", Some(vec![Effect::RateDependentPuncture { alpha: 0.15 }])),
        ("needle_compliance", Some(vec![Effect::NeedleCompliance { stiffness_n_per_m: 600.0 }])),
    ];
    let runs: Vec<_> = runs
        .into_iter()
        .map(|(name, effects)| {
            let mut law: Box<dyn ForceLaw> = match &effects {
                Some(effects) => Box::new(PlainWorld::new(&tissue, effects)),
                None => Box::new(RichWorld::new(&tissue, &RichEffects::default())),
            };
            let insertion = simulate_insertion(law.as_mut(), &SensorModel::new(&[], 0.0), None, &path, &at, STEP_S);
            let numbers: serde_json::Map<String, serde_json::Value> = effects
                .iter()
                .flatten()
                .flat_map(Effect::parameters)
                .map(|(path, value)| (path, json!(value)))
                .collect();
            json!({"name": name, "numbers": numbers, "force_n": insertion.force_n, "ruptures_s": insertion.ruptures_s})
        })
        .collect();
    println!(
        "{}",
        json!({"surface_m": tissue.surface_m, "layers": layers, "start_m": start_m, "pieces": pieces, "time_s": at, "runs": runs})
    );
}
