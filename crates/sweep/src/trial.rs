//! One trial: law, sensor, core and score, sample by sample; nothing is stored but the ring of raw
//! samples that the core asks for, and nothing is allocated per sample.

use stylet_core::{Enhancer, Sample};
use stylet_record::TrueRupture;
use stylet_scenario::{Scenario, Sensor};
use stylet_score::{LayerTruth, Moment, STORAGE_SAMPLES, Score, Scorer};
use stylet_testbed::{Measuring, SimulateError, rates};
use stylet_tissue::{Law, LawState, Rupture};

/// What a thread keeps from trial to trial.
#[derive(Debug, Default)]
pub struct Workspace {
    storage: Vec<Sample>,
}

/// Runs a scenario through the kinematic replay and scores it: the same bits as
/// [`stylet_testbed::simulate`] with `robot: Replay` and [`stylet_score::score_run`], without the
/// columns and the offline estimates.
///
/// # Errors
/// [`SimulateError`] when the scenario cannot be replayed.
pub fn run(scenario: &Scenario, workspace: &mut Workspace) -> Result<Score, SimulateError> {
    let plan = scenario.motion.plan().ok_or(SimulateError::NoMotion)?;
    let law = Law::new(&scenario.tissue, &scenario.effects)?;
    let Sensor::ForceTorque(sensor) = &scenario.sensor else {
        return Err(SimulateError::NotSupported {
            what: "a virtual sensor in a sweep",
            remedy: "use sensor: ForceTorque(...)",
        });
    };
    let rates = rates(scenario, plan.duration_s());
    let mut measuring = Measuring::new(&scenario.effects, sensor, scenario.seed, scenario.sample_hz);
    let layers: Vec<LayerTruth> = law
        .slabs()
        .iter()
        .map(|s| LayerTruth {
            front_m: s.front_m,
            thickness_m: s.thickness_m,
            stiffness_n_per_m: s.stiffness_n_per_m,
            friction_ns_per_m2: s.friction_ns_per_m2,
        })
        .collect();
    let surface_m = layers.first().map_or(0.0, |l| l.front_m);
    let held = rates.samples.min(STORAGE_SAMPLES);
    if workspace.storage.len() < held {
        workspace.storage.resize(held, Sample::default());
    }
    let storage = workspace.storage.get_mut(..held).unwrap_or_default();
    let mut core = Enhancer::new(scenario.enhance.clone(), surface_m, storage);
    let mut scorer = Scorer::new(layers, scenario.enhance.model);
    let mut ruptures: Vec<Rupture> = Vec::with_capacity(law.slabs().len());
    let mut state = LawState::default();
    // The kinematic replay of `stylet_testbed::replayed`, with nothing but the forces that are needed
    // handed on: a sample's ground truth never goes through memory.
    for k in 0..rates.samples {
        let time_s = k as f64 / rates.sample_hz;
        let at = plan.at(time_s);
        let force = law.step(&mut state, time_s, at.position_m, at.velocity_mps, |r| ruptures.push(r));
        let (total_n, tip_n) = (force.total_n, force.tip_n);
        let force_n = measuring.measure_force(time_s, &at, total_n);
        let position_m = measuring.position(at.position_m);
        let velocity_mps = measuring.position(at.velocity_mps);
        let out = core.step_brief(Sample { time_s, position_m, velocity_mps, force_n });
        scorer.sample(&Moment { position_m, force_n, tip_n }, out);
    }
    for r in ruptures {
        scorer.rupture(TrueRupture {
            layer: r.layer,
            time_s: r.time_s,
            position_m: r.position_m,
            by_force: r.by_force,
        });
    }
    Ok(scorer.finish())
}
