//! A case: what is believed, what is true, and what was measured.

use super::amounts::Amounts;
use super::draw;
use super::id::{CaseId, World};
use super::outside::Shape;
use super::setup::set_up;
use crate::reality::effect::Effect;
use crate::reality::insertion::{Insertion, Strange, insert};
use crate::reality::law::Law;
use crate::reality::motion::Path;
use crate::reality::noise::{Noise, NoiseSource};
use crate::reality::plain::Plain;
use crate::reality::rich::{Ingredients, Rich};
use crate::reality::sensor::Instrument;
use crate::reality::tissue::Tissue;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use stylet_record::Recording;

/// Steps of the simulation are at most this long in s: 5 kHz.
const STEP_S: f64 = 2e-4;
/// ... and at least two to a sample.
const STEPS_PER_SAMPLE: f64 = 2.0;

/// Everything about a case but the noise.
#[derive(Clone, Debug)]
pub struct Setup {
    /// How much is wrong.
    pub amounts: Amounts,
    /// The stack as it is believed.
    pub believed: Tissue,
    /// The stack as it is.
    pub truth: Tissue,
    /// The motions.
    pub paths: Vec<Path>,
    /// The noise.
    pub noise: Noise,
    /// The law that the tissue follows.
    pub world: World,
    /// Ingredients of the rich law.
    pub rich: Ingredients,
    /// What of the library is hidden.
    pub effects: Vec<Effect>,
    /// What else is.
    pub shape: Option<Shape>,
    /// Strength of all that is hidden, in noise standard deviations.
    pub strength_sd: f64,
}

impl Setup {
    /// The law of a tissue in this world. The rich law knows no effects of the library but those of tool and sensor.
    #[must_use]
    pub fn law(&self, tissue: &Tissue, effects: &[Effect]) -> Box<dyn Law> {
        match self.world {
            World::Plain => Box::new(Plain::new(tissue, effects)),
            World::Rich => Box::new(Rich::new(tissue, &self.rich)),
        }
    }
}

/// One recording under its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Such as a file's name.
    pub name: String,
    /// The columns.
    pub recording: Recording,
}

/// What an engine is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// The case's name; it says nothing about the truth that the recordings do not.
    pub name: String,
    /// The believed scenario (RON, SPEC section 8).
    pub believed_ron: String,
    /// What was measured.
    pub recordings: Vec<Named>,
}

/// A case with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// Which.
    pub id: CaseId,
    /// What is hidden, and how it was measured.
    pub setup: Setup,
    /// What an engine is given.
    pub question: Question,
    /// What each recording met, without noise.
    pub there: Vec<Insertion>,
}
/// Draws a case.
///
/// # Errors
/// When the columns make no recording, which is a mistake of the referee.
pub fn case(id: &CaseId) -> Result<Case, stylet_record::RecordError> {
    let setup = set_up(id);
    let mut rng = ChaCha8Rng::seed_from_u64(id.own_seed());
    rng.set_stream(0);
    let (mut recordings, mut there) = (Vec::new(), Vec::new());
    for (k, path) in setup.paths.iter().enumerate() {
        let mut own = ChaCha8Rng::seed_from_u64(rng.random());
        let (recording, insertion) = measured(&setup, path, &mut own)?;
        recordings.push(Named { name: format!("{}.csv", k + 1), recording });
        there.push(insertion);
    }
    let name = format!("case {:016x}", id.own_seed());
    let believed_ron = draw::scenario_ron(&name, &setup.believed, setup.amounts.rate_hz);
    Ok(Case { id: *id, question: Question { name, believed_ron, recordings }, setup, there })
}

/// Instants at which samples are taken in s.
fn instants(path: &Path, amounts: &Amounts, rng: &mut ChaCha8Rng) -> Vec<f64> {
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

pub(crate) fn measured(
    setup: &Setup,
    path: &Path,
    rng: &mut ChaCha8Rng,
) -> Result<(Recording, Insertion), stylet_record::RecordError> {
    let amounts = &setup.amounts;
    let interval_s = 1.0 / amounts.rate_hz;
    let mut met_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut time_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut noise_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut encoder_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let tissue = draw::met(&mut met_rng, &setup.truth, amounts);
    let mut instrument = Instrument::new(&setup.effects, amounts.late_s());
    if let Some(range) = amounts.bits_range_n {
        instrument = instrument.rounding(2.0 * range / 4096.0);
    }
    let at = instants(path, amounts, &mut time_rng);
    let mut law = setup.law(&tissue, &setup.effects);
    let mut strange = setup.shape.clone();
    let strange = strange.as_mut().map(|s| s as &mut dyn Strange);
    let step_s = STEP_S.min(interval_s / STEPS_PER_SAMPLE);
    let there = insert(law.as_mut(), &instrument, strange, path, &at, step_s);
    let mut noise = setup.noise.clone();
    noise.spikes = setup.effects.iter().find_map(|e| match *e {
        Effect::ForceSpikes { rate_hz, size_n } => Some((rate_hz, size_n)),
        _ => None,
    });
    let mut source = NoiseSource::new(&noise, &mut noise_rng);
    let force: Vec<f64> = there
        .time_s
        .iter()
        .zip(&there.force_n)
        .map(|(&t, &f)| {
            let e = source.next(t, f, interval_s);
            instrument.reading_n(t, f, e)
        })
        .collect();
    let position: Vec<f64> = there
        .position_m
        .iter()
        .map(|&z| {
            let e: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut encoder_rng);
            let z = instrument.position_m(z) + amounts.encoder_m * e;
            let q = amounts.encoder_step_m;
            if q > 0.0 { libm::round(z / q) * q } else { z }
        })
        .collect();
    Ok((Recording::new(there.time_s.clone(), position, force)?, there))
}

impl Case {
    /// Samples of all recordings.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.question.recordings.iter().map(|r| r.recording.len()).sum()
    }
}
