//! The engine under examination: the only place where the referee's questions and the diagnosis meet.

use stylet_diagnose::{NamedRecording, Options};
use stylet_examine::{Answer, Question};
use stylet_scenario::Scenario;

/// Answers a question as `stylet diagnose` would.
///
/// # Errors
/// Why there is no answer.
pub fn answer_question(question: &Question) -> Result<Answer, String> {
    let (scenario, evidence) = scenario_and_recordings(question)?;
    let examined = stylet_diagnose::diagnose(&scenario, &evidence, &Options::default(), |_| {})
        .map_err(|e| e.to_string())?;
    // By way of the file, so that what is judged is what a user gets.
    let json = serde_json::to_string(&examined.diagnosis).map_err(|e| e.to_string())?;
    Answer::from_json(&json).map_err(|e| e.to_string())
}

/// What a question gives: what is believed, and the recordings.
///
/// # Errors
/// What is wrong with the belief.
pub fn scenario_and_recordings(question: &Question) -> Result<(Scenario, Vec<NamedRecording>), String> {
    let scenario = Scenario::parse(&question.name, &question.assumed_ron).map_err(|e| e.to_string())?;
    let evidence = question
        .recordings
        .iter()
        .map(|r| NamedRecording { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    Ok((scenario, evidence))
}
