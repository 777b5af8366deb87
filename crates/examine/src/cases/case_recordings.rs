//! Simulates the recordings of a case: the question given to an engine, and the truth.

use super::case_definition::CaseSetup;
use super::case_id::CaseId;
use super::case_setup::set_up_case;
use super::custom_effect::CustomEffect;
use super::draw_tissue;
use super::misspecification_amounts::MisspecificationAmounts;
use crate::simulator::effect::Effect;
use crate::simulator::force_sensor::SensorModel;
use crate::simulator::insertion::{Insertion, UnmodelledForce, simulate_insertion};
use crate::simulator::motion_path::MotionPath;
use crate::simulator::sensor_noise::NoiseGenerator;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::sync::Arc;
use stylet_record::Recording;

/// Longest step of the simulation in s (5 kHz).
const STEP_S: f64 = 2e-4;
/// Least number of simulation steps per sample.
const STEPS_PER_SAMPLE: f64 = 2.0;

/// One recording under its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedFile {
    /// File name.
    pub name: String,
    /// The columns.
    pub recording: Recording,
}

/// Input of an engine.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Name of the case; it reveals nothing about the truth.
    pub name: String,
    /// The assumed scenario (RON, docs/reference/files.md); `None` when there is none.
    pub assumed_ron: Option<String>,
    /// The measured recordings.
    pub recordings: Vec<NamedFile>,
}

/// A case with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// Identifier.
    pub id: CaseId,
    /// Hidden causes, motions and noise.
    pub setup: CaseSetup,
    /// Input of the engine.
    pub question: Question,
    /// The insertion of each recording, without noise.
    pub insertions: Vec<Insertion>,
}

/// Generates a case.
///
/// # Errors When the simulated columns are not a valid recording, which would be a bug of this crate.
pub fn make_case(id: &CaseId) -> Result<Case, stylet_record::RecordError> {
    make_case_with(id, &[])
}

/// Generates a case, which may hide one of the caller's own effects ([`Hide::Custom`](super::case_id::Hide::Custom)).
///
/// # Errors
/// As [`make_case`].
pub fn make_case_with(
    id: &CaseId,
    custom: &[Arc<dyn CustomEffect>],
) -> Result<Case, stylet_record::RecordError> {
    let setup = set_up_case(id, custom);
    let mut rng = ChaCha8Rng::seed_from_u64(id.case_seed());
    rng.set_stream(0);
    let (mut recordings, mut insertions) = (Vec::new(), Vec::new());
    for (k, path) in setup.paths.iter().enumerate() {
        let mut recording_rng = ChaCha8Rng::seed_from_u64(rng.random());
        let (recording, insertion) = measure(&setup, path, &mut recording_rng)?;
        recordings.push(NamedFile { name: format!("{}.csv", k + 1), recording });
        insertions.push(insertion);
    }
    let name = format!("case {:016x}", id.case_seed());
    let scenario = || draw_tissue::scenario_ron(&name, &setup.assumed, setup.amounts.rate_hz);
    let assumed_ron = setup.amounts.has_scenario.then(scenario);
    Ok(Case { id: *id, question: Question { name, assumed_ron, recordings }, setup, insertions })
}

/// Sample times in s, with jitter and dropped samples.
fn sample_times_s(path: &MotionPath, amounts: &MisspecificationAmounts, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = (path.duration_s() * amounts.rate_hz) as usize;
    let mut out = Vec::with_capacity(n);
    let mut missing = 0;
    for k in 0..n {
        let off = if k == 0 { 0.0 } else { amounts.jitter * (rng.random::<f64>() - 0.5) * 2.0 };
        let lost = rng.random::<f64>();
        let run = rng.random_range(1..=3);
        if missing == 0 && k > 0 && lost < amounts.dropped / 2.0 {
            missing = run;
        }
        if missing > 0 {
            missing -= 1;
            continue;
        }
        out.push((k as f64 + off) / amounts.rate_hz);
    }
    out
}

/// Simulates one insertion and measures it: the recording, and the insertion without noise.
pub(crate) fn measure(
    setup: &CaseSetup,
    path: &MotionPath,
    rng: &mut ChaCha8Rng,
) -> Result<(Recording, Insertion), stylet_record::RecordError> {
    let amounts = &setup.amounts;
    let interval_s = 1.0 / amounts.rate_hz;
    let mut met_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut time_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut noise_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut encoder_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let tissue = draw_tissue::draw_encountered_tissue(&mut met_rng, &setup.truth, amounts);
    let mut instrument = SensorModel::new(&setup.effects, amounts.delay_s());
    if let Some(range) = amounts.bits_range_n {
        instrument = instrument.with_rounding(2.0 * range / 4096.0);
    }
    let at = sample_times_s(path, amounts, &mut time_rng);
    let mut law = setup.law(&tissue, &setup.effects);
    let mut strange = setup.shape.clone();
    let strange = strange.as_mut().map(|s| s as &mut dyn UnmodelledForce);
    let step_s = STEP_S.min(interval_s / STEPS_PER_SAMPLE);
    let insertion = simulate_insertion(law.as_mut(), &instrument, strange, path, &at, step_s);
    let mut noise = setup.noise.clone();
    noise.spikes = setup.effects.iter().find_map(|e| match *e {
        Effect::ForceSpikes { rate_hz, size_n } => Some((rate_hz, size_n)),
        _ => None,
    });
    let mut source = NoiseGenerator::new(&noise, &mut noise_rng);
    let force: Vec<f64> = insertion
        .time_s
        .iter()
        .zip(&insertion.force_n)
        .map(|(&t, &f)| {
            let e = source.next(t, f, interval_s);
            instrument.reading_n(t, f, e)
        })
        .collect();
    let position: Vec<f64> = insertion
        .position_m
        .iter()
        .map(|&z| {
            let e: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut encoder_rng);
            let z = instrument.position_m(z) + amounts.encoder_m * e;
            let q = amounts.encoder_step_m;
            if q > 0.0 { libm::round(z / q) * q } else { z }
        })
        .collect();
    Ok((Recording::new(insertion.time_s.clone(), position, force)?, insertion))
}

impl Case {
    /// Number of samples in all recordings.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.question.recordings.iter().map(|r| r.recording.len()).sum()
    }
}
