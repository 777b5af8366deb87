//! Checks which existing files an output may replace: only files that Stylet wrote, and never an input.

use super::manifest::{MANIFEST, Manifest, sha256, sha256_of_file};
use crate::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

/// Files of commands that write several, by the result file; checked before a long computation. The set itself is checked when it is written.
const FILES: [(&str, &[&str]); 10] = [
    ("score.json", &["recording.csv", "score.json", "scenario.ron", "figure.svg", "report.html"]),
    ("enhance.json", &["enhance.json", "events.json", "figure.svg", "report.html", "enhanced.csv"]),
    (
        "diagnosis.json",
        &["report.html", "diagnosis.json", "figure.svg", "extended.ron", "proposed_effects.ron", "gain.svg"],
    ),
    ("predict.json", &["report.html", "predict.json"]),
    ("transfer.json", &["report.html", "transfer.json"]),
    ("identifiability.json", &["report.html", "identifiability.json", "matrix.svg"]),
    (
        "summary.json",
        &["scenario.ron", "sweep.ron", "summary.json", "report.html", "trials.csv", "trials.parquet"],
    ),
    ("compare.json", &["compare.json", "report.html"]),
    ("claims.json", &["claims.json", "switches.json", "index.html"]),
    ("cases.json", &["table.txt", "cases.json", "table.json", "report.html"]),
];

/// A file that no manifest lists.
const NOT_LISTED: &str = "is not a file that Stylet wrote (no manifest.json lists it)";
/// A manifest of another program.
const OTHER_MANIFEST: &str = "is not a manifest of Stylet";
/// An input.
const INPUT: &str = "is an input of this command";

/// Inputs of a command, which its outputs must not replace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    /// All files read.
    pub files: Vec<PathBuf>,
    /// The input after which the output folder is named; `None` if the folder was given.
    pub names_folder: Option<PathBuf>,
}

/// Content of a new file, as far as it is known.
pub(super) enum Content<'a> {
    Bytes(&'a [u8]),
    Sha256(&'a str),
    Unknown,
}

impl Content<'_> {
    fn is_that_of(&self, path: &Path) -> bool {
        match self {
            Self::Bytes(bytes) => sha256_of_file(path).is_ok_and(|found| found == sha256(bytes)),
            Self::Sha256(expected) => sha256_of_file(path).is_ok_and(|found| found == *expected),
            Self::Unknown => false,
        }
    }
}

/// Rejects an output folder in which this command, identified by its result file, would replace foreign files or its inputs.
///
/// # Errors
/// [`Error::NotReplaced`] with the first such file; [`Error::OtherInput`] for a folder named after another input.
pub fn check_folder(folder: &Path, result_file: &str, inputs: &Inputs) -> Result<(), Error> {
    if let Some(input) = &inputs.names_folder {
        check_same_input(folder, &comparable(input))?;
    }
    let alone = [result_file];
    let names =
        FILES.iter().find(|(result, _)| *result == result_file).map_or(&alone[..], |(_, names)| names);
    // An input may be an old file of the set with unchanged content; that is checked when the set is written.
    let inputs: Vec<_> = inputs.files.iter().filter(|input| !is_listed(folder, input)).collect();
    check_files(folder, &inputs, names.iter().map(|name| (*name, Content::Unknown)))
}

fn is_listed(folder: &Path, input: &Path) -> bool {
    let manifest = read_manifest(folder).ok().flatten().unwrap_or_default();
    manifest.sha256.keys().any(|name| is_same(&folder.join(name), input))
}

/// As [`check_folder`], for files with known content: an unchanged file is accepted.
pub(super) fn check_files<'a>(
    folder: &Path,
    inputs: &[impl AsRef<Path>],
    files: impl Iterator<Item = (&'a str, Content<'a>)>,
) -> Result<(), Error> {
    let manifest = read_manifest(folder)?.unwrap_or_default();
    for (name, content) in files {
        let path = folder.join(name);
        let why = if inputs.iter().any(|input| is_same(&path, input.as_ref())) {
            INPUT
        } else if manifest.sha256.contains_key(name) || fs::symlink_metadata(&path).is_err() {
            continue;
        } else {
            NOT_LISTED
        };
        if !path.is_dir() && !content.is_that_of(&path) {
            return Err(Error::NotReplaced { path: path.display().to_string(), why });
        }
    }
    Ok(())
}

/// The manifest of a folder; `None` without one.
fn read_manifest(folder: &Path) -> Result<Option<Manifest>, Error> {
    let path = folder.join(MANIFEST);
    let Ok(text) = fs::read(&path) else { return Ok(None) };
    let foreign = |_| Error::NotReplaced { path: path.display().to_string(), why: OTHER_MANIFEST };
    serde_json::from_slice(&text).map(Some).map_err(foreign)
}

/// The same existing file, by any path.
pub(super) fn is_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Rejects a default folder with the results for another input than `input`.
///
/// # Errors
/// [`Error::OtherInput`].
pub(super) fn check_same_input(folder: &Path, input: &str) -> Result<(), Error> {
    match read_manifest(folder)?.and_then(|manifest| manifest.input) {
        Some(other) if other != input => {
            Err(Error::OtherInput { path: folder.display().to_string(), input: other })
        }
        _ => Ok(()),
    }
}

/// A path as stored in a manifest: without symbolic links, relative to the current folder if it is below it.
pub(super) fn comparable(input: &Path) -> String {
    let full = input.canonicalize().unwrap_or_else(|_| input.to_path_buf());
    let here = std::env::current_dir().and_then(|here| here.canonicalize()).unwrap_or_default();
    let relative: PathBuf = full.strip_prefix(&here).map(Path::to_path_buf).unwrap_or(full);
    relative.display().to_string()
}

/// Rejects replacing a file that is an input, or that `is_own` does not recognise as written by Stylet. An unchanged file is accepted.
///
/// # Errors
/// [`Error::NotReplaced`].
pub fn check_own_file(
    path: &Path,
    inputs: &[&Path],
    content: Option<&[u8]>,
    is_own: impl Fn(&[u8]) -> bool,
) -> Result<(), Error> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(());
    }
    let refused = |why| Err(Error::NotReplaced { path: path.display().to_string(), why });
    let is_input = inputs.iter().any(|input| is_same(path, input));
    // Devices and pipes, also behind links, are written to, not replaced; writing to a folder is reported elsewhere.
    if !is_input && fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Ok(());
    }
    let bytes = fs::read(path).unwrap_or_default();
    if content.is_some_and(|content| content == bytes) {
        return Ok(());
    }
    if is_input {
        return refused(INPUT);
    }
    if is_own(&bytes) { Ok(()) } else { refused("exists, and is not recognised as a file that Stylet wrote") }
}
