//! Export of cases for other programs: assumed scenarios and recordings without the truth, and an answer key kept apart.

use crate::cases::case_id::{CaseId, GENERATOR_VERSION, first_generator_version};
use crate::cases::case_recordings::make_case;
use crate::examination_plan::Plan;
use crate::scoring::case_outcome::CaseOutcome;
use crate::scoring::diagnosis_answer::Answer;
use crate::simulator::effect::{FURTHER_IDS, IDS};
use core::fmt::Write as _;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use stylet_stats::parallel::*;

/// The answer key: the case of each number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnswerKey {
    /// Version of the case generator ([`GENERATOR_VERSION`]).
    #[serde(default = "first_generator_version")]
    pub generator_version: u32,
    /// Cases by their numbers.
    pub cases: BTreeMap<String, CaseId>,
}

/// Error of writing or scoring a challenge.
#[derive(Debug, thiserror::Error)]
pub enum ChallengeError {
    /// A file or folder cannot be read or written.
    #[error("{path}: {why}")]
    File {
        /// Which.
        path: String,
        /// Error of the operating system.
        why: io::Error,
    },
    /// The folder exists already.
    #[error("{0} exists already; choose a new folder, or remove it")]
    FolderExists(String),
    /// A file has the wrong content.
    #[error("{path}: {why}")]
    Content {
        /// Which.
        path: String,
        /// Error and expected content.
        why: String,
    },
    /// A case cannot be generated.
    #[error(transparent)]
    Record(#[from] stylet_record::RecordError),
}

/// Path of the answer key, next to the challenge's folder.
#[must_use]
pub fn key_path(folder: &Path) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_os_string();
    name.push(".key.json");
    folder.with_file_name(name)
}

/// Writes a challenge into a new folder, and the answer key next to it. The order of the cases is random.
///
/// # Errors [`ChallengeError`]; partial output is removed.
pub fn export(plan: &Plan, folder: &Path) -> Result<usize, ChallengeError> {
    if folder.exists() {
        return Err(ChallengeError::FolderExists(folder.display().to_string()));
    }
    let mut part = folder.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let failed = |why| ChallengeError::File { path: folder.display().to_string(), why };
    let _ = std::fs::remove_dir_all(&part);
    let mut cases = plan.cases();
    let mut rng = ChaCha8Rng::seed_from_u64(plan.seed);
    for k in (1..cases.len()).rev() {
        cases.swap(k, rng.random_range(0..=k));
    }
    let numbered: Vec<(String, CaseId)> =
        cases.into_iter().enumerate().map(|(k, id)| (format!("{:04}", k + 1), id)).collect();
    let written: Result<Vec<()>, ChallengeError> =
        numbered.par_iter().map(|(number, id)| write_case(&part.join("cases").join(number), id)).collect();
    let finish = || -> Result<(), ChallengeError> {
        written?;
        std::fs::write(part.join("README.md"), readme(numbered.len())).map_err(failed)?;
        std::fs::write(part.join("names.txt"), names()).map_err(failed)?;
        let key =
            AnswerKey { generator_version: GENERATOR_VERSION, cases: numbered.iter().cloned().collect() };
        let text = serde_json::to_vec_pretty(&key).map_err(|e| failed(e.into()))?;
        std::fs::write(key_path(folder), text).map_err(failed)?;
        std::fs::rename(&part, folder).map_err(failed)
    };
    let result = finish();
    if result.is_err() {
        let _ = std::fs::remove_dir_all(&part);
    }
    result.map(|()| numbered.len())
}

fn write_case(folder: &Path, id: &CaseId) -> Result<(), ChallengeError> {
    let failed = |why| ChallengeError::File { path: folder.display().to_string(), why };
    std::fs::create_dir_all(folder).map_err(failed)?;
    let case = make_case(id)?;
    if let Some(ron) = &case.question.assumed_ron {
        std::fs::write(folder.join("assumed.ron"), ron).map_err(failed)?;
    }
    for named in &case.question.recordings {
        let file = std::fs::File::create(folder.join(&named.name)).map_err(failed)?;
        stylet_record::write_csv(&named.recording, None, &[], file)?;
    }
    Ok(())
}

fn names() -> String {
    IDS.iter().chain(&FURTHER_IDS).fold(String::new(), |mut out, id| {
        let _ = writeln!(out, "{id}");
        out
    })
}

fn readme(cases: usize) -> String {
    format!(
        "# What does the simulation get wrong?

{cases} cases. Each folder `cases/NNNN` holds the assumed scenario (`assumed.ron`) and recordings: `1.csv`, `2.csv` ...
with the columns `time_s,position_m,force_n` (SI units; position positive into the tissue, force positive when it resists).

The assumed law: in the active layer an elastic force `K (z - front)`; the layer ruptures when that force reaches `puncture_n` (if
given) or the tip its far face, and the elastic force is gone at once; viscous friction `v sum(b_i l_i)` along the needle inside,
`l_i` the length inside layer `i`. Fronts follow from `surface_m` and the thicknesses.

These deviations are normal and are no answer: `K`, `b`, `F` within 30 %, thicknesses within 10 %, the surface within 2 mm;
coloured noise, noise that grows with the force, outliers; scatter between recordings.

Name for every case what is wrong beyond that, with the names in `names.txt`. One file `answers.json`:

    {{ \"0001\": {{ \"verdict\": \"none\" }},
      \"0002\": {{ \"verdict\": \"named\", \"causes\": [ {{ \"effect\": \"coulomb_friction\", \"equivalent\": [], \"confidence\": 0.9,
                \"parameters\": {{ \"c_n_per_m\": {{ \"value\": 4.1, \"low\": 3.9, \"high\": 4.3 }} }} }} ] }},
      \"0003\": {{ \"verdict\": \"unknown\" }} }}

`none`: the simulation agrees with the data. `named`: one or more causes. `ambiguous`: several effects explain the data
equally well (one as `effect`, the others under `equivalent`, at most four names in all). `unknown`: structure that none of the names describes. Everything but
`verdict` and `effect` may be left out; a case without an answer counts as wrong.

With the key, `stylet benchmark score FOLDER answers.json` scores the answers.
"
    )
}

/// Scores answers to a challenge, in the order of the case numbers.
///
/// # Errors [`ChallengeError`] with the file and the expected content.
pub fn score_answers(folder: &Path, answers: &Path) -> Result<Vec<CaseOutcome>, ChallengeError> {
    let key_file = key_path(folder);
    let key: AnswerKey =
        json(&key_file, "it should be the answer key that the export wrote next to the folder")?;
    if key.generator_version != GENERATOR_VERSION {
        let why = format!(
            "was made by version {} of the case generator, and this is version {GENERATOR_VERSION}: export the challenge again",
            key.generator_version
        );
        return Err(ChallengeError::Content { path: key_file.display().to_string(), why });
    }
    let answers_given: BTreeMap<String, serde_json::Value> =
        json(answers, "it should be an object: case number -> diagnosis, as the challenge's README says")?;
    if let Some(stray) = answers_given.keys().find(|k| !key.cases.contains_key(*k)) {
        return Err(ChallengeError::Content {
            path: answers.display().to_string(),
            why: format!(
                "there is no case \"{stray}\"; the cases are \"0001\" to \"{:04}\"",
                key.cases.len()
            ),
        });
    }
    key.cases
        .iter()
        .into_par_iter()
        .map(|(number, id)| {
            let case = make_case(id)?;
            let answer = match answers_given.get(number) {
                None => Err("no answer".to_owned()),
                Some(value) => Ok(serde_json::from_value::<Answer>(value.clone()).map_err(|e| {
                    ChallengeError::Content {
                        path: answers.display().to_string(),
                        why: format!("case \"{number}\": {e}"),
                    }
                })?),
            };
            Ok(CaseOutcome::new(&case, answer, 0.0))
        })
        .collect()
}

fn json<T: serde::de::DeserializeOwned>(path: &Path, what: &str) -> Result<T, ChallengeError> {
    let at = || path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|why| ChallengeError::File { path: at(), why })?;
    serde_json::from_str(&text)
        .map_err(|e| ChallengeError::Content { path: at(), why: format!("{e}; {what}") })
}
