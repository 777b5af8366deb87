use alloc::string::String;
use core::fmt;

/// Error in a formula, with its place in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormulaError {
    /// First byte of the place.
    pub start: usize,
    /// Byte behind the place.
    pub end: usize,
    /// Cause and remedy.
    pub message: String,
}

impl FormulaError {
    /// An error between two bytes of the text.
    #[must_use]
    pub fn new((start, end): (usize, usize), message: impl Into<String>) -> Self {
        Self { start, end, message: message.into() }
    }

    /// The part of the formula that the error is about.
    #[must_use]
    pub fn part<'a>(&self, text: &'a str) -> &'a str {
        text.get(self.start..self.end).unwrap_or_default()
    }
}

impl fmt::Display for FormulaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (at character {})", self.message, self.start + 1)
    }
}

impl core::error::Error for FormulaError {}
