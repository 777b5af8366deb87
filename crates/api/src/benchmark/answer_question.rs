//! The diagnosis under test: answers questions of the independent simulator.

use stylet_diagnose::{NamedRecording, Options};
use stylet_examine::{Answer, Question};
use stylet_scenario::Scenario;
use stylet_tissue::AnyEffect;

/// Answers a question as `stylet diagnose` would, with custom effects among the candidates.
///
/// # Errors The reason for a missing answer.
pub fn answer_question(question: &Question, custom: &[AnyEffect]) -> Result<Answer, String> {
    let (options, recordings) = (Options::default(), named_recordings(question));
    let result = if question.assumed_ron.is_some() {
        let mut scenario = assumed_scenario(question)?;
        scenario.candidates.extend_from_slice(custom);
        stylet_diagnose::diagnose(&scenario, &recordings, &options, |_| {})
    } else {
        stylet_diagnose::identify(&question.name, &recordings, None, &options, |_| {}).map(|found| found.1)
    };
    // Through the JSON file, so that the scored answer is what a user gets.
    let json = serde_json::to_string(&result.map_err(|e| e.to_string())?.diagnosis);
    Answer::from_json(&json.map_err(|e| e.to_string())?).map_err(|e| e.to_string())
}

/// The assumed scenario of a question that has one.
///
/// # Errors
/// What is wrong with it.
pub fn assumed_scenario(question: &Question) -> Result<Scenario, String> {
    let ron = question.assumed_ron.as_deref().unwrap_or_default();
    Scenario::parse(&question.name, ron).map_err(|e| e.to_string())
}

/// The recordings of a question.
#[must_use]
pub fn named_recordings(question: &Question) -> Vec<NamedRecording> {
    let named = |r: &stylet_examine::NamedFile| NamedRecording {
        name: r.name.clone(),
        recording: r.recording.clone(),
        notes: Vec::new(),
    };
    question.recordings.iter().map(named).collect()
}
