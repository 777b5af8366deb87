//! The diagnosis under test: answers questions of the independent simulator.

use stylet_diagnose::{NamedRecording, Options};
use stylet_examine::{Answer, Question};
use stylet_scenario::Scenario;

/// Answers a question as `stylet diagnose` would.
///
/// # Errors
/// The reason why there is no answer.
pub fn answer_question(question: &Question) -> Result<Answer, String> {
    let (scenario, recordings) = scenario_and_recordings(question)?;
    let result = stylet_diagnose::diagnose(&scenario, &recordings, &Options::default(), |_| {})
        .map_err(|e| e.to_string())?;
    // Through the JSON file, so that the scored answer is what a user gets.
    let json = serde_json::to_string(&result.diagnosis).map_err(|e| e.to_string())?;
    Answer::from_json(&json).map_err(|e| e.to_string())
}

/// The assumed scenario and the recordings of a question.
///
/// # Errors
/// What is wrong with the scenario.
pub fn scenario_and_recordings(question: &Question) -> Result<(Scenario, Vec<NamedRecording>), String> {
    let scenario = Scenario::parse(&question.name, &question.assumed_ron).map_err(|e| e.to_string())?;
    let recordings = question
        .recordings
        .iter()
        .map(|r| NamedRecording { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    Ok((scenario, recordings))
}
