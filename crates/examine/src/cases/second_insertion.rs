//! A second insertion into the tissue of a case: same layers, effects and sensor, another motion.

use super::case_definition::CaseSetup;
use super::case_id::CaseId;
use super::case_recordings::{NamedFile, Question, measure};
use super::case_setup::set_up_case;
use super::draw_motion::uniform;
use super::draw_tissue;
use crate::scoring::diagnosis_answer::Answer;
use crate::scoring::expected_answer::{AnswerScore, Expected, expected_answer, score_answer};
use crate::simulator::motion_path::{MotionPath, MotionPiece};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// The tissue of a case with the insertions made so far.
#[derive(Clone, Debug)]
pub struct SecondInsertion {
    id: CaseId,
    setup: CaseSetup,
    insertions: Vec<(MotionPath, NamedFile)>,
}

impl SecondInsertion {
    /// The tissue of a case, before any insertion.
    #[must_use]
    pub fn new(id: &CaseId) -> Self {
        let mut setup = set_up_case(id, &[]);
        setup.paths.clear();
        Self { id: *id, setup, insertions: Vec::new() }
    }

    /// Start position of an insertion in m.
    #[must_use]
    pub fn start_m(&self) -> f64 {
        -self.setup.amounts.air_m
    }

    /// Slightly beyond the end of the assumed layers, in m.
    #[must_use]
    pub fn depth_m(&self) -> f64 {
        1.03 * self.setup.assumed.end_m() + 3e-3
    }

    /// Names of the hidden causes.
    #[must_use]
    pub fn hidden(&self) -> Vec<String> {
        self.setup.effects.iter().map(|e| e.id().to_owned()).collect()
    }

    /// One constant speed, 2.2 to 3.5 mm/s, from the start to the end, without retraction.
    #[must_use]
    pub fn constant(&self) -> MotionPath {
        let mut rng = ChaCha8Rng::seed_from_u64(self.id.case_seed());
        rng.set_stream(77);
        let speed = uniform(&mut rng, 2.2e-3, 3.5e-3);
        MotionPath::new(
            self.start_m(),
            vec![MotionPiece::constant(speed, (self.depth_m() - self.start_m()) / speed)],
        )
    }

    /// The paper's sinusoid, a quarter of a period from rest at 0.0167 Hz, with the amplitude of this stack.
    #[must_use]
    pub fn sinusoid(&self) -> MotionPath {
        let (amplitude_m, frequency_hz) = (self.depth_m() - self.start_m(), 0.0167);
        let duration_s = 0.25 / frequency_hz;
        MotionPath::new(self.start_m(), vec![MotionPiece::Swing { amplitude_m, frequency_hz, duration_s }])
    }

    /// Makes one more insertion.
    ///
    /// # Errors When the columns are not a valid recording.
    pub fn add_insertion(&mut self, path: MotionPath) -> Result<(), stylet_record::RecordError> {
        let number = self.insertions.len() as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(self.id.case_seed());
        rng.set_stream(100 + number);
        let (recording, _) = measure(&self.setup, &path, &mut rng)?;
        self.setup.paths.push(path.clone());
        self.insertions.push((path, NamedFile { name: format!("{}.csv", number + 1), recording }));
        Ok(())
    }

    /// Input of an engine: all insertions so far.
    #[must_use]
    pub fn question(&self) -> Question {
        let name = format!("case {:016x}", self.id.case_seed());
        Question {
            assumed_ron: Some(draw_tissue::scenario_ron(
                &name,
                &self.setup.assumed,
                self.setup.amounts.rate_hz,
            )),
            name,
            recordings: self.insertions.iter().map(|m| m.1.clone()).collect(),
        }
    }

    /// The expected answer for these insertions (see [`expected_answer`](crate::scoring::expected_answer)).
    #[must_use]
    pub fn expected_answer(&self) -> Expected {
        expected_answer(&self.id, &self.setup)
    }

    /// Scores an answer to these insertions.
    #[must_use]
    pub fn score_answer(&self, answer: &Answer) -> AnswerScore {
        score_answer(&self.expected_answer(), answer)
    }
}
