//! Simulates, enhances and scores one trial in blocks of samples, without allocation per sample. Only the ring of raw samples that
//! the enhancer needs is stored.
//!
//! A block passes through tissue, sensor, enhancer and scorer one after the other: four short loops with one recursion each are
//! faster than one long loop.

use stylet_core::{Enhancer, Sample};
use stylet_record::TrueRupture;
use stylet_scenario::{MotionPlan, MotionPoint, Scenario, Sensor};
use stylet_score::{EnhancedSample, MAX_STORED_SAMPLES, Score, Scorer, TrueSample};
use stylet_testbed::{ForceSensor, SampleRates, SimulateError, sample_rates};
use stylet_tissue::{ForceLaw, ForceLawState, Rupture};

/// Samples per block; a block fits into the level 1 cache.
const BLOCK_SAMPLES: usize = 64;

/// A block of samples from motion to score. Its steps are not inlined, so that each can use all registers.
struct Block {
    count: usize,
    points: [MotionPoint; BLOCK_SAMPLES],
    total_n: [f64; BLOCK_SAMPLES],
    tip_n: [f64; BLOCK_SAMPLES],
    samples: [Sample; BLOCK_SAMPLES],
    enhanced: [EnhancedSample; BLOCK_SAMPLES],
}

impl Default for Block {
    fn default() -> Self {
        Self {
            count: 0,
            points: [MotionPoint::default(); BLOCK_SAMPLES],
            total_n: [0.0; BLOCK_SAMPLES],
            tip_n: [0.0; BLOCK_SAMPLES],
            samples: [Sample::default(); BLOCK_SAMPLES],
            enhanced: [EnhancedSample::default(); BLOCK_SAMPLES],
        }
    }
}

impl Block {
    /// True and recorded position and velocity from sample `first` on.
    #[inline(never)]
    fn fill_motion(
        &mut self,
        plan: &MotionPlan,
        measuring: &ForceSensor,
        rates: &SampleRates,
        first: usize,
        start_offset_s: f64,
    ) {
        self.count = BLOCK_SAMPLES.min(rates.samples - first);
        for (k, (point, sample)) in (first..rates.samples).zip(self.points.iter_mut().zip(&mut self.samples))
        {
            // Converting a signed integer is one instruction; the index fits.
            let time_s = start_offset_s + k as i64 as f64 / rates.sample_hz;
            *point = plan.at(time_s);
            sample.time_s = time_s;
            sample.position_m = measuring.position(point.position_m);
            sample.velocity_mps = measuring.position(point.velocity_mps);
        }
    }

    /// The tissue force.
    #[inline(never)]
    fn compute_tissue_force(
        &mut self,
        law: &ForceLaw,
        state: &mut ForceLawState,
        on_rupture: impl FnMut(Rupture),
    ) {
        let moments = self.samples.iter().zip(&self.points).take(self.count);
        let moments = moments.map(|(s, at)| [s.time_s, at.position_m, at.velocity_mps]);
        let mut forces = self.total_n.iter_mut().zip(&mut self.tip_n);
        law.run(state, moments, on_rupture, |force| {
            if let Some((total_n, tip_n)) = forces.next() {
                (*total_n, *tip_n) = (force.total_n, force.tip_n);
            }
        });
    }

    /// The measured force.
    #[inline(never)]
    fn measure(&mut self, measuring: &mut ForceSensor) {
        let truth = self.points.iter().zip(&self.total_n);
        for (sample, (at, total_n)) in self.samples.iter_mut().zip(truth).take(self.count) {
            sample.force_n = measuring.measure_force(sample.time_s, at, *total_n);
        }
    }

    /// Runs the enhancer.
    #[inline(never)]
    fn enhance(&mut self, core: &mut Enhancer<&mut [Sample]>, scorer: &mut Scorer) {
        let mut enhanced = self.enhanced.iter_mut();
        let out = core.run(self.samples.get(..self.count).unwrap_or(&[]), |out| {
            if let Some(enhanced) = enhanced.next() {
                *enhanced = out.into();
            }
            if out.detection.is_some() || out.estimate.is_some() || out.zero_step.is_some() {
                scorer.add_event(out);
            }
        });
        scorer.set_contact(out.contact_m);
    }

    /// Compares with the truth.
    #[inline(never)]
    fn score(&self, scorer: &mut Scorer) {
        let truth = self.points.iter().zip(self.tip_n.iter().zip(&self.total_n));
        for ((sample, enhanced), (at, (tip_n, total_n))) in
            self.samples.iter().zip(&self.enhanced).zip(truth).take(self.count)
        {
            let sample_truth = TrueSample {
                position_m: at.position_m,
                force_n: sample.force_n,
                tip_n: *tip_n,
                total_n: *total_n,
            };
            scorer.add_sample(&sample_truth, enhanced);
        }
    }
}

/// Buffers that a thread reuses between trials.
#[derive(Debug, Default)]
pub struct Workspace {
    storage: Vec<Sample>,
}

/// Simulates a scenario by kinematic replay and scores it, with the same bits as
/// [`stylet_testbed::simulate`] with `robot: Replay` and [`stylet_score::score_run`], without the
/// columns and the offline estimates.
///
/// # Errors
/// [`SimulateError`] when the scenario cannot be replayed.
pub fn run(scenario: &Scenario, workspace: &mut Workspace) -> Result<Score, SimulateError> {
    run_with_sampling_phase(scenario, 0.0, workspace)
}

/// As [`run`], with the first sample `phase` sampling steps after the start of the motion, because robot and sensor clock are not
/// synchronised.
///
/// # Errors
/// As [`run`].
pub fn run_with_sampling_phase(
    scenario: &Scenario,
    phase: f64,
    workspace: &mut Workspace,
) -> Result<Score, SimulateError> {
    let plan = scenario.motion.plan().ok_or(SimulateError::NoMotion)?;
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects)?;
    let Sensor::ForceTorque(sensor) = &scenario.sensor else {
        return Err(SimulateError::NotSupported {
            what: "a virtual sensor in a sweep",
            remedy: "use sensor: ForceTorque(...)",
        });
    };
    let rates = sample_rates(scenario, plan.duration_s());
    let start_offset_s = phase / rates.sample_hz;
    let mut measuring = ForceSensor::new(&scenario.effects, sensor, scenario.seed, scenario.sample_hz);
    let layers = stylet_testbed::true_layers(law.slabs());
    let surface_m = layers.first().map_or(0.0, |l| l.front_m);
    let held = rates.samples.min(MAX_STORED_SAMPLES);
    if workspace.storage.len() < held {
        workspace.storage.resize(held, Sample::default());
    }
    let storage = workspace.storage.get_mut(..held).unwrap_or_default();
    let mut core = Enhancer::new(scenario.enhance.clone(), surface_m, storage);
    let mut scorer = Scorer::new(layers, scenario.enhance.model);
    let mut ruptures: Vec<Rupture> = Vec::with_capacity(law.slabs().len());
    let mut state = ForceLawState::default();
    let mut block = Block::default();
    for first in (0..rates.samples).step_by(BLOCK_SAMPLES) {
        block.fill_motion(&plan, &measuring, &rates, first, start_offset_s);
        block.compute_tissue_force(&law, &mut state, |r| ruptures.push(r));
        block.measure(&mut measuring);
        block.enhance(&mut core, &mut scorer);
        block.score(&mut scorer);
    }
    for r in ruptures {
        scorer.add_rupture(TrueRupture {
            layer: r.layer,
            time_s: r.time_s,
            position_m: r.position_m,
            by_force: r.by_force,
        });
    }
    Ok(scorer.finish())
}
