//! Runs an examination in parallel; deterministic and resumable.

use crate::cases::case_id::{CaseId, GENERATOR_VERSION};
use crate::cases::case_recordings::{Question, make_case_with};
use crate::cases::custom_effect::CustomEffect;
use crate::scoring::case_outcome::CaseOutcome;
use crate::scoring::diagnosis_answer::Answer;
use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use stylet_stats::parallel::*;

/// Error of an examination.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The journal cannot be read or written.
    #[error("{path}: {why}")]
    Journal {
        /// File.
        path: String,
        /// Error of the operating system.
        why: std::io::Error,
    },
    /// A case could not be generated.
    #[error("case {name} cannot be generated: {why}")]
    Draw {
        /// Case.
        name: String,
        /// Reason.
        why: Box<stylet_record::RecordError>,
    },
}

/// Runs an engine on cases and scores its answers, in the order of `cases` for any number of threads.
///
/// With a journal (a file of one JSON line per case) every outcome is written at once, and cases in the journal are not run
/// again, except one whose line was cut off by an interruption. A journal belongs to one engine. `progress` receives the number
/// of finished cases and the total.
///
/// # Errors [`RunError`]. A case that an engine cannot answer counts as wrong and is not an error of the run.
pub fn run_cases(
    cases: &[CaseId],
    journal: Option<&Path>,
    engine: &(dyn Fn(&Question) -> Result<Answer, String> + Sync),
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<CaseOutcome>, RunError> {
    run_cases_with(cases, &[], journal, engine, progress)
}

/// As [`run_cases`]; cases with [`Hide::Custom`](crate::Hide::Custom) hide one of the effects `custom`.
///
/// # Errors
/// As [`run_cases`].
pub fn run_cases_with(
    cases: &[CaseId],
    custom: &[Arc<dyn CustomEffect>],
    journal: Option<&Path>,
    engine: &(dyn Fn(&Question) -> Result<Answer, String> + Sync),
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<CaseOutcome>, RunError> {
    let failed =
        |why| RunError::Journal { path: journal.map_or_else(String::new, |p| p.display().to_string()), why };
    let mut done: BTreeMap<CaseId, CaseOutcome> = BTreeMap::new();
    let file = match journal {
        None => None,
        Some(path) => {
            done = read_journal(path).map_err(failed)?;
            // Written to a temporary file and renamed: a truncated last line is dropped and nothing is lost.
            let part = path.with_extension("part");
            let mut text = Vec::new();
            for outcome in done.values() {
                serde_json::to_writer(&mut text, outcome).map_err(|e| failed(e.into()))?;
                text.push(b'\n');
            }
            std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, path)).map_err(failed)?;
            Some(std::fs::OpenOptions::new().append(true).open(path).map_err(failed)?)
        }
    };
    let missing: Vec<&CaseId> = cases.iter().filter(|id| !done.contains_key(*id)).collect();
    let count = Mutex::new((file, cases.len() - missing.len()));
    progress(cases.len() - missing.len(), cases.len());
    let new: Result<Vec<CaseOutcome>, RunError> = missing
        .par_iter()
        .map(|id| {
            let case = make_case_with(id, custom)
                .map_err(|why| RunError::Draw { name: id.name(), why: Box::new(why) })?;
            let start = Instant::now();
            let answer = engine(&case.question);
            let outcome = CaseOutcome::new(&case, answer, start.elapsed().as_secs_f64());
            if let Ok(mut state) = count.lock() {
                if let Some(file) = &mut state.0 {
                    let mut line = serde_json::to_vec(&outcome).map_err(|e| failed(e.into()))?;
                    line.push(b'\n');
                    file.write_all(&line).map_err(failed)?;
                }
                state.1 += 1;
                progress(state.1, cases.len());
            }
            Ok(outcome)
        })
        .collect();
    done.extend(new?.into_iter().map(|o| (o.id, o)));
    Ok(cases.iter().filter_map(|id| done.get(id).cloned()).collect())
}

/// Reads the outcomes of a journal.
///
/// # Errors Errors of the operating system, except for a missing file; outcomes of another [`GENERATOR_VERSION`].
pub fn read_journal(path: &Path) -> std::io::Result<BTreeMap<CaseId, CaseOutcome>> {
    let file = match std::fs::File::open(path) {
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        other => other?,
    };
    let mut out = BTreeMap::new();
    for line in std::io::BufReader::new(file).lines() {
        if let Ok(outcome) = serde_json::from_str::<CaseOutcome>(&line?) {
            if outcome.generator_version != GENERATOR_VERSION {
                let why = format!(
                    "holds outcomes of version {} of the case generator, and this is version {GENERATOR_VERSION}: the same numbers are other \
                     cases; name another folder",
                    outcome.generator_version
                );
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, why));
            }
            out.insert(outcome.id, outcome);
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::read_journal;
    use crate::examination_plan::Plan;
    use crate::scoring::diagnosis_answer::Answer;

    #[test]
    fn a_journal_of_another_drawing_is_refused_and_not_overwritten() {
        let plan = Plan { cases: 1, hide: vec![crate::Hide::Clean], ..Plan::default() };
        let path = std::env::temp_dir().join(format!("stylet-drawing-{}.jsonl", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let none = |_: &crate::Question| Ok(Answer::none());
        super::run_cases(&plan.cases(), Some(&path), &none, &|_, _| {}).expect("a run");
        assert_eq!(read_journal(&path).expect("a journal").len(), 1);
        let text = std::fs::read_to_string(&path).expect("text");
        let old = text.replace(
            &format!("\"generator_version\":{}", super::GENERATOR_VERSION),
            "\"generator_version\":1",
        );
        assert_ne!(old, text);
        std::fs::write(&path, &old).expect("written");
        let why = read_journal(&path).expect_err("another version").to_string();
        assert!(why.contains("name another folder"), "{why}");
        assert!(super::run_cases(&plan.cases(), Some(&path), &none, &|_, _| {}).is_err());
        assert_eq!(std::fs::read_to_string(&path).expect("text"), old);
        let _ = std::fs::remove_file(&path);
    }
}
