//! Input of an inspection: facts about the file, and its rows.

use super::model::TextFacts;
use crate::error::RecordError;
use crate::text::rows::RowsRead;
use std::path::Path;

/// Facts about a file that do not come from its rows.
pub(super) struct FileFacts<'a> {
    pub path: &'a Path,
    pub format: String,
    pub bytes: u64,
    pub text: Option<TextFacts>,
    /// Parts of the file that cannot be read, as sentences.
    pub unreadable: Vec<String>,
    /// A number such as `1,234` when nothing decides between decimal comma and thousands.
    pub open_decimal: Option<String>,
}

/// A table that can be read several times.
pub(super) trait Rows {
    /// Calls `each` with the offset and the values of every row, one per column, NaN for missing ones.
    fn for_each(&self, each: &mut dyn FnMut(usize, &[f64])) -> Result<RowsRead, RecordError>;

    /// Lines of ascending offsets.
    fn lines(&self, offsets: &[usize]) -> Result<Vec<u64>, RecordError>;
}
