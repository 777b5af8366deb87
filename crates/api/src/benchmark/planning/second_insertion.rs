//! One case: diagnosed after one insertion and, if the cause is then ambiguous, after a second one.

use crate::benchmark::answer_question::{answer_question, assumed_scenario, named_recordings};
use serde::{Deserialize, Serialize};
use std::time::Instant;
use stylet_diagnose::Options;
use stylet_examine::simulator::motion_path::{MotionPath, MotionPiece};
use stylet_examine::{Answer, CaseId, SecondInsertion};
use stylet_plan::Limits;
use stylet_scenario::{Motion, Segment};
use stylet_tissue::ForceGain;

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanningCase {
    pub id: CaseId,
    pub hidden: String,
    /// Why the first diagnosis leaves the cause open: `class` or `not_identifiable`.
    pub open_because: Option<String>,
    /// Predicted probability that the planned insertion decides.
    pub predicted_probability: f64,
    pub planned: Option<SecondDiagnosis>,
    pub sinusoid: Option<SecondDiagnosis>,
    pub plan_s: f64,
    pub seconds: f64,
    pub error: Option<String>,
}

/// Diagnosis after the second insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SecondDiagnosis {
    /// Causes, each with its equivalents.
    pub causes: Vec<Vec<String>>,
    /// A single correct cause without equivalents, by the benchmark's rules.
    pub correct: bool,
    /// The hidden effect itself is named; the rules do not require it for negligible effects.
    pub hidden_effect_named: bool,
    pub unknown: bool,
}

/// Runs a case; an error is recorded in the case.
pub(super) fn run_case(id: &CaseId) -> PlanningCase {
    let started = Instant::now();
    let mut case = PlanningCase {
        id: *id,
        hidden: String::new(),
        open_because: None,
        predicted_probability: 0.0,
        planned: None,
        sinusoid: None,
        plan_s: 0.0,
        seconds: 0.0,
        error: None,
    };
    if let Err(why) = diagnose_twice(id, &mut case) {
        case.error = Some(why);
    }
    case.seconds = started.elapsed().as_secs_f64();
    case
}

fn diagnose_twice(id: &CaseId, case: &mut PlanningCase) -> Result<(), String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let mut first = SecondInsertion::new(id);
    case.hidden = first.hidden().join("+");
    // A gain is not identifiable by any motion.
    if case.hidden == ForceGain::ID {
        return Ok(());
    }
    first.add_insertion(first.constant()).map_err(|e| text(&e))?;
    let question = first.question();
    let (scenario, recordings) = (assumed_scenario(&question)?, named_recordings(&question));
    let result = stylet_diagnose::diagnose(&scenario, &recordings, &Options::default(), |_| {})
        .map_err(|e| text(&e))?;
    let d = &result.diagnosis;
    let in_class = d.causes.iter().any(|c| {
        !c.equivalent.is_empty() && (c.effect == case.hidden || c.equivalent.contains(&case.hidden))
    });
    case.open_because = if in_class {
        Some("class".to_owned())
    } else {
        d.not_identifiable.contains(&case.hidden).then(|| "not_identifiable".to_owned())
    };
    if case.open_because.is_none() {
        return Ok(());
    }
    let started = Instant::now();
    let limits = Limits {
        depth_m: first.depth_m(),
        speed_mps: 0.008,
        acceleration_mps2: 0.1,
        duration_s: 90.0,
        force_n: 30.0,
    };
    let (ground, begin) = stylet_plan::from_diagnosis(&scenario, &result).map_err(|e| text(&e))?;
    let (plan, _) = stylet_plan::plan(&ground, &limits, &begin).map_err(|e| text(&e))?;
    case.plan_s = started.elapsed().as_secs_f64();
    case.predicted_probability = plan.probability_decided;
    let second = |path: MotionPath| -> Result<SecondDiagnosis, String> {
        let mut second = first.clone();
        second.add_insertion(path).map_err(|e| e.to_string())?;
        let answer = answer_question(&second.question(), &[])?;
        Ok(summarise(&second, &answer, &case.hidden))
    };
    let path = path_of(&plan.motion).ok_or_else(|| "the plan is no program".to_owned())?;
    let (planned, sinusoid) = rayon::join(|| second(path), || second(first.sinusoid()));
    (case.planned, case.sinusoid) = (Some(planned?), Some(sinusoid?));
    Ok(())
}

fn summarise(case: &SecondInsertion, answer: &Answer, hidden: &str) -> SecondDiagnosis {
    let judged = case.score_answer(answer);
    SecondDiagnosis {
        causes: answer
            .causes
            .iter()
            .map(|c| std::iter::once(&c.effect).chain(&c.equivalent).cloned().collect())
            .collect(),
        correct: judged.correct && answer.causes.iter().all(|c| c.equivalent.is_empty()),
        hidden_effect_named: answer.causes.iter().any(|c| c.effect == hidden && c.equivalent.is_empty()),
        unknown: answer.verdict == stylet_examine::Verdict::Unknown,
    }
}

/// A program as a path of the independent simulator, which has the same segments.
fn path_of(motion: &Motion) -> Option<MotionPath> {
    let Motion::Program { start_m, segments } = motion else { return None };
    let piece = |s: &Segment| match *s {
        Segment::Move { velocity_mps, duration_s } => MotionPiece::constant(velocity_mps, duration_s),
        Segment::Hold { duration_s } => MotionPiece::constant(0.0, duration_s),
        Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s } => MotionPiece::Move {
            speed_mps: velocity_mps,
            ripple_mps: amplitude_mps,
            ripple_hz: frequency_hz,
            duration_s,
        },
    };
    Some(MotionPath::new(*start_m, segments.iter().map(piece).collect()))
}
