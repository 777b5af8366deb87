//! Errors of input files: location, cause and remedy.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::sync::Arc;

/// An input file that cannot be used. The message names file, line, column, cause and remedy; rendered by `miette` it shows the source line.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{location}: {message}")]
#[diagnostic(code(stylet::input))]
pub struct InputError {
    /// File, and line and column when they are known: `name.ron:12:5`.
    pub location: String,
    /// Cause and remedy.
    pub message: String,
    /// Line and column, from 1.
    pub position: Option<(usize, usize)>,
    #[source_code]
    source_code: Option<Arc<NamedSource<String>>>,
    #[label("here")]
    span: Option<SourceSpan>,
}

impl InputError {
    /// An error about a whole file.
    #[must_use]
    pub fn file(file: &str, what: impl Into<String>) -> Self {
        Self {
            location: file.to_owned(),
            message: what.into(),
            position: None,
            source_code: None,
            span: None,
        }
    }

    /// An error about the bytes `start..end` of a file's text.
    #[must_use]
    pub fn at(file: &str, text: &str, start: usize, end: usize, what: impl Into<String>) -> Self {
        let start = floor_char_boundary(text, start);
        let end = floor_char_boundary(text, end.max(start));
        let before = &text[..start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        let is_shown = fits_on_screen(text, start, end);
        Self {
            location: format!("{file}:{line}:{column}"),
            message: what.into(),
            position: Some((line, column)),
            source_code: is_shown.then(|| Arc::new(NamedSource::new(file, text.to_owned()))),
            span: is_shown.then(|| SourceSpan::new(start.into(), end - start)),
        }
    }
}

/// Longest line, in bytes, that is shown with an error; `miette` cannot render longer ones.
const MAX_SHOWN_LINE_BYTES: usize = 1000;
/// Lines shown before and after the location.
const CONTEXT_LINES: usize = 1;

/// Whether the lines around the bytes `start..end` are short enough to be shown.
fn fits_on_screen(text: &str, start: usize, end: usize) -> bool {
    let first = text[..start].matches('\n').count().saturating_sub(CONTEXT_LINES);
    let last = text[..end].matches('\n').count() + CONTEXT_LINES;
    text.split('\n').take(last + 1).skip(first).all(|line| line.len() <= MAX_SHOWN_LINE_BYTES)
}

fn floor_char_boundary(text: &str, index: usize) -> usize {
    let mut index = index.min(text.len());
    while !text.is_char_boundary(index) {
        index -= 1;
    }
    index
}

/// Byte offset of a line and column (both from 1, columns in characters).
pub(crate) fn offset(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let rest = &text[start.min(text.len())..];
    start + rest.char_indices().nth(column.saturating_sub(1)).map_or(rest.len(), |(i, _)| i)
}

/// The known name closest to a misspelt one: few letters differ, or one is the beginning of the other.
#[must_use]
pub fn closest_name<'a>(wrong: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = wrong.to_lowercase();
    let mut longer = known.iter().filter(|k| lower.len() > 2 && k.to_lowercase().starts_with(&lower));
    if let (Some(only), None) = (longer.next(), longer.next()) {
        return Some(only);
    }
    known
        .iter()
        .map(|k| (strsim::damerau_levenshtein(&lower, &k.to_lowercase()), *k))
        .min()
        .filter(|(distance, k)| *distance <= 1 + k.len() / 5)
        .map(|(_, k)| k)
}
