//! Drawing a case: what is believed, what is true, what was measured.

use super::motion::{Motions, Path, paths};
use super::outside::Outside;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use stylet_record::Recording;
use stylet_scenario::Scenario;
use stylet_tissue::{AnyEffect, ForceLaw, ForceLawState, Layer, MeasurementChain, SensorInput, Tissue};

/// Samples per second of the recordings.
pub const SAMPLE_HZ: f64 = STEP_HZ / STEPS as f64;
/// Steps per second of the law.
const STEP_HZ: f64 = 1000.0;
/// One in so many steps is sampled.
const STEPS: usize = 5;

/// What a case is drawn from.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Seed.
    pub seed: u64,
    /// Effects of the library.
    pub effects: Vec<AnyEffect>,
    /// An effect outside the library.
    pub outside: Option<Outside>,
    /// Marginal standard deviation of the noise in N.
    pub noise_n: f64,
    /// Coefficients of the noise.
    pub ar: [f64; 2],
    /// How far the believed base parameters are off, relative.
    pub off: f64,
    /// Motions.
    pub motions: Motions,
    /// Relative scatter of the puncture forces between recordings.
    pub scatter: f64,
    /// Noise of the measured velocity in m/s.
    pub velocity_noise_mps: f64,
}

/// A case.
#[derive(Clone, Debug)]
pub struct Case {
    /// What the simulation believes.
    pub believed: Scenario,
    /// The tissue that was there.
    pub truth: Tissue,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// Instant (s) at which each layer ruptured, per recording; infinite for never.
    pub ruptures: Vec<Vec<f64>>,
}

/// The ids that can be hidden.
#[must_use]
pub fn library_ids() -> Vec<&'static str> {
    stylet_tissue::general_effects().map(|i| i.id).collect()
}

/// What the simulation believes.
#[must_use]
pub fn scenario() -> Scenario {
    let layer = |name: &str, d: f64, k: f64, b: f64, f: Option<f64>| Layer {
        name: name.to_owned(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: b,
        puncture_n: f,
    };
    Scenario {
        name: "three gel layers, as believed".to_owned(),
        source: "drawn".to_owned(),
        tissue: Tissue {
            surface_m: 0.0,
            layers: vec![
                layer("soft", 0.0282, 40.0, 9000.0, Some(0.95)),
                layer("in latex", 0.0377, 60.0, 12000.0, Some(1.9)),
                layer("hard", 0.0322, 80.0, 16000.0, None),
            ],
        },
        effects: Vec::new(),
        motion: stylet_scenario::Motion::Recorded,
        robot: Default::default(),
        sensor: Default::default(),
        enhance: Default::default(),
        enhance_virtual: None,
        compare: Vec::new(),
        sample_hz: SAMPLE_HZ,
        physics_hz: 1000.0,
        tolerance: 0.3,
        thickness_tolerance: 0.1,
        surface_tolerance_m: 0.002,
        seed: 1,
    }
}

/// Samples per second when one in `steps` is kept.
fn sampled_hz(steps: usize) -> f64 {
    STEP_HZ / steps as f64
}

struct Hidden {
    truth: Tissue,
    paths: Vec<Path>,
    phase_s: f64,
    rng: ChaCha8Rng,
}

fn prepare(drawn: &Drawn) -> Hidden {
    let mut rng = ChaCha8Rng::seed_from_u64(drawn.seed);
    let mut truth = scenario().tissue;
    for layer in &mut truth.layers {
        let mut off = || 1.0 + if rng.random::<bool>() { drawn.off } else { -drawn.off };
        layer.stiffness_n_per_m *= off();
        layer.friction_ns_per_m2 *= off();
        let factor = off();
        // Below the far face, so that the membrane of the layer gives way by force.
        layer.puncture_n =
            layer.puncture_n.map(|f| (f * factor).min(0.97 * layer.stiffness_n_per_m * layer.thickness_m));
    }
    let mut u = || rng.random::<f64>();
    let paths = paths(drawn.motions, &mut u);
    let phase_s = u() / SAMPLE_HZ;
    Hidden { truth, paths, phase_s, rng }
}

/// Position as recorded, its velocity, the force without noise, and where layers ruptured.
#[allow(clippy::type_complexity, reason = "columns")]
fn simulate(
    drawn: &Drawn,
    tissue: &Tissue,
    path: &Path,
    (phase_s, steps): (f64, usize),
    noise: &mut dyn FnMut() -> f64,
) -> ([Vec<f64>; 4], Vec<f64>) {
    let layers = tissue.layers.len();
    let mut out = [const { Vec::new() }; 4];
    let mut ruptures = vec![f64::INFINITY; layers];
    let Ok(law) = ForceLaw::new(tissue, &drawn.effects) else { return (out, ruptures) };
    let chain = MeasurementChain::new(&drawn.effects);
    let mut measuring = chain.start(STEP_HZ);
    let mut state = ForceLawState::default();
    let mut outside = drawn.outside.clone();
    if let Some(o) = &mut outside {
        o.restart();
    }
    let dt = 1.0 / STEP_HZ;
    let n = (path.duration() * sampled_hz(steps)) as usize;
    let end = tissue.end_m();
    for k in 0..n * steps {
        let t = k as f64 * dt;
        let [z, v, a] = path.at(t + phase_s);
        let force = law.step(&mut state, t, z, v, |r| {
            if let Some(slot) = ruptures.get_mut(r.layer - 1) {
                *slot = r.time_s;
            }
        });
        let mut tissue_n = force.total_n;
        if let Some(o) = &mut outside {
            tissue_n += o.force(t, z, v, a, z.clamp(0.0, end));
        }
        let sampled = k % steps == 0;
        let noise_n = if sampled { noise() } else { 0.0 };
        let reading = SensorInput { time_s: t, velocity_mps: v, acceleration_mps2: a, tissue_n, noise_n };
        let recorded = chain.step(&mut measuring, &reading);
        if sampled {
            out[0].push(t);
            out[1].push(chain.recorded_position(z));
            out[2].push(chain.recorded_position(v));
            out[3].push(recorded);
        }
    }
    (out, ruptures)
}

/// The force without noise of every recording: for measuring how strong an effect is.
#[must_use]
pub fn clean_force(drawn: &Drawn) -> Vec<Vec<f64>> {
    let hidden = prepare(drawn);
    hidden
        .paths
        .iter()
        .map(|p| {
            let [_, _, _, f] = simulate(drawn, &hidden.truth, p, (hidden.phase_s, STEPS), &mut || 0.0).0;
            f
        })
        .collect()
}

/// Draws the case.
#[must_use]
pub fn case(drawn: &Drawn) -> Case {
    case_sampled(drawn, STEPS)
}

/// Draws the case with one in `steps` (1 or more) of the law's 1000 steps a second sampled: noise of the same size and colour from sample
/// to sample, however many there are.
#[must_use]
pub fn case_sampled(drawn: &Drawn, steps: usize) -> Case {
    let steps = steps.max(1);
    let Hidden { truth, paths, phase_s, mut rng } = prepare(drawn);
    let [a1, a2] = drawn.ar;
    let rho = a1 / (1.0 - a2);
    let inner = (1.0 - a1 * rho - a2 * (a2 + a1 * rho)).max(0.0).sqrt();
    let spikes = drawn.effects.iter().find_map(|e| match e {
        AnyEffect::ForceSpikes(s) => Some((s.rate_hz, s.size_n)),
        _ => None,
    });
    let mut recordings = Vec::new();
    let mut ruptures = Vec::new();
    for path in &paths {
        let mut tissue = truth.clone();
        for layer in &mut tissue.layers {
            let w: f64 = StandardNormal.sample(&mut rng);
            layer.puncture_n = layer.puncture_n.map(|f| f * (1.0 + drawn.scatter * w));
        }
        let (mut e1, mut e2) = (0.0, 0.0);
        for _ in 0..200 {
            let w: f64 = StandardNormal.sample(&mut rng);
            let e = a1 * e1 + a2 * e2 + inner * w;
            e2 = e1;
            e1 = e;
        }
        let mut noise = || {
            let w: f64 = StandardNormal.sample(&mut rng);
            let e = a1 * e1 + a2 * e2 + inner * w;
            e2 = e1;
            e1 = e;
            let mut x = drawn.noise_n * e;
            if let Some((rate, size)) = spikes
                && rng.random::<f64>() < rate / sampled_hz(steps)
            {
                x += if rng.random::<bool>() { size } else { -size };
            }
            if drawn.noise_n == 0.0 { 0.0 } else { x }
        };
        let ([t, z, mut v, f], r) = simulate(drawn, &tissue, path, (phase_s, steps), &mut noise);
        if drawn.velocity_noise_mps > 0.0 {
            for v in &mut v {
                let w: f64 = StandardNormal.sample(&mut rng);
                *v += drawn.velocity_noise_mps * w;
            }
        }
        if let Ok(recording) = Recording::with_velocity(t, z, v, f) {
            recordings.push(recording);
            ruptures.push(r);
        }
    }
    Case { believed: scenario(), truth, recordings, ruptures }
}

#[cfg(test)]
mod tests {
    use super::library_ids;

    #[test]
    fn every_effect_of_the_library_can_be_hidden() {
        let ids = library_ids();
        assert_eq!(ids.len(), stylet_tissue::general_effects().count());
        assert!(ids.contains(&"force_spikes") && ids.contains(&"coulomb_friction"));
    }
}
