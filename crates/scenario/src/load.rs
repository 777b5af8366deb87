//! Reading RON files: every failure becomes an [`InputError`] with its place.

use crate::error::{InputError, closest, offset};
use crate::locate::locate;
use ron::error::{Error, SpannedError};
use ron::extensions::Extensions;
use serde::de::DeserializeOwned;
use std::path::Path;

/// The RON dialect of Stylet's files: `Some` may be left out, effects and sensors are written with
/// one pair of brackets.
#[must_use]
pub fn ron_options() -> ron::Options {
    ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
}

/// A number or list that parses but is out of range: the path of the field and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Path such as `tissue.layers[1].thickness_m`.
    pub path: String,
    /// What is wrong and what would be right.
    pub what: String,
}

impl Problem {
    /// A problem with the field at `path`.
    pub fn new(path: impl Into<String>, what: impl Into<String>) -> Self {
        Self { path: path.into(), what: what.into() }
    }

    /// The problem as an error that shows its place in `text`.
    #[must_use]
    pub fn in_file(&self, file: &str, text: &str) -> InputError {
        let mut path = self.path.as_str();
        loop {
            if let Some((start, end)) = locate(text, path) {
                return InputError::at(file, text, start, end, format!("{}: {}", self.path, self.what));
            }
            // The field itself may be a default: show what holds it.
            match path.rfind(['.', '[']) {
                Some(cut) => path = &path[..cut],
                None => return InputError::file(file, format!("{}: {}", self.path, self.what)),
            }
        }
    }
}

/// Reads a text file, refusing what is not one.
///
/// # Errors
/// [`InputError`] when the file is missing, a directory, empty, or not UTF-8 text.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    let file = path.display().to_string();
    if path.is_dir() {
        return Err(InputError::file(&file, "is a directory; name a RON file in it"));
    }
    let bytes = std::fs::read(path).map_err(|e| {
        let remedy =
            if e.kind() == std::io::ErrorKind::NotFound { "; check the spelling of the path" } else { "" };
        InputError::file(&file, format!("cannot be read: {e}{remedy}"))
    })?;
    match String::from_utf8(bytes) {
        Ok(text) if text.trim().is_empty() => {
            Err(InputError::file(&file, "is empty; a RON file begins like `Scenario(name: \"...\", ...)`"))
        }
        Ok(text) if text.contains('\0') => Err(InputError::file(
            &file,
            "is not a text file (it holds a zero byte); a RON file is UTF-8 text",
        )),
        Ok(text) => Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text)),
        Err(e) => Err(InputError::file(
            &file,
            format!(
                "is not a text file (byte {} is not UTF-8); a RON file is UTF-8 text",
                e.utf8_error().valid_up_to() + 1
            ),
        )),
    }
}

/// Parses RON text; `file` is named in errors.
///
/// # Errors
/// [`InputError`] with line and column.
pub fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, InputError> {
    ron_options().from_str(text).map_err(|error| describe(file, text, &error))
}

/// Reads and parses a RON file.
///
/// # Errors
/// As [`read_text`] and [`parse`].
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    parse(&path.display().to_string(), &read_text(path)?)
}

fn list(names: &[&str]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

fn suggestion(found: &str, expected: &[&str]) -> String {
    let known = list(expected);
    match closest(found, expected) {
        Some(near) => format!("did you mean `{near}`? Known: {known}"),
        None => format!("known: {known}"),
    }
}

fn describe(file: &str, text: &str, error: &SpannedError) -> InputError {
    let mut start = offset(text, error.span.start.line, error.span.start.col);
    let mut end = offset(text, error.span.end.line, error.span.end.col);
    // The wrong name itself is underlined, not what stands behind it.
    let mut underline = |name: &str| {
        let upto = end.max(start).min(text.len());
        if let Some(at) = text.get(..upto).and_then(|t| t.rfind(name)) {
            (start, end) = (at, at + name.len());
        }
    };
    let within = |outer: &Option<String>| outer.as_ref().map_or(String::new(), |o| format!(" of `{o}`"));
    let what = match &error.code {
        Error::NoSuchStructField { expected, found, outer } => {
            underline(found);
            format!("unknown field `{found}`{}; {}", within(outer), suggestion(found, expected))
        }
        Error::NoSuchEnumVariant { expected, found, outer } => {
            underline(found);
            format!("unknown name `{found}`{}; {}", within(outer), suggestion(found, expected))
        }
        Error::MissingStructField { field, outer } => {
            format!("missing field `{field}`{}; add `{field}: ...` inside these brackets", within(outer))
        }
        Error::DuplicateStructField { field, outer } => {
            underline(field);
            format!("field `{field}`{} is given twice; keep one", within(outer))
        }
        Error::ExpectedDifferentStructName { expected, found } => {
            underline(found);
            format!("this is a `{found}`, where a `{expected}` is expected")
        }
        other => {
            let mut message = other.to_string();
            if let Some(first) = message.get(..1).map(str::to_lowercase) {
                message.replace_range(..1, &first);
            }
            format!("not valid here: {message}")
        }
    };
    InputError::at(file, text, start, end, what)
}
