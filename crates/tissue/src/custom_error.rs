//! Errors in the text of a custom effect.

use alloc::format;
use alloc::string::String;
use stylet_formula::FormulaError;

/// What is wrong with the text of a custom effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CustomError {
    /// Path of the field inside the effect, such as `force` or `parameters.k.unit`.
    pub path: String,
    /// First byte of the part of the field's formula that is wrong, and the byte behind it.
    pub place: Option<(usize, usize)>,
    /// Cause and remedy.
    pub message: String,
}

impl CustomError {
    pub(crate) fn new(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), place: None, message: message.into() }
    }

    /// An error in a formula that begins at byte `from` of the field.
    pub(crate) fn formula(path: impl Into<String>, text: &str, from: usize, error: &FormulaError) -> Self {
        let part = error.part(text);
        let says_it = part.is_empty() || error.message.starts_with(&format!("`{part}`"));
        let message = if says_it { error.message.clone() } else { format!("`{part}`: {}", error.message) };
        Self { path: path.into(), place: Some((from + error.start, from + error.end)), message }
    }
}

impl core::fmt::Display for CustomError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.path, self.message)?;
        match self.place {
            Some((start, _)) => write!(f, " (character {} of the text)", start + 1),
            None => Ok(()),
        }
    }
}

impl core::error::Error for CustomError {}
