//! Errors of the readers, extended by all obstacles that an inspection finds.

use super::model::{Finding, Inspection};
use crate::error::RecordError;
use std::path::Path;

impl RecordError {
    /// Kind and line of the finding with the same content.
    fn matching_findings(&self) -> Vec<(&'static str, Option<u64>)> {
        match self {
            Self::SampleNumber { line, .. } | Self::TimeUnit { line, .. } => {
                // The finding refers to the line of the names, the error to the first row.
                (line.saturating_sub(3)..=*line).map(|line| ("time", Some(line))).collect()
            }
            Self::Bursts { line, .. }
            | Self::SecondRun { line, .. }
            | Self::BackwardTime { line, .. }
            | Self::RepeatedTime { line, .. }
            | Self::RepairTooMuch { line, .. } => vec![("sampling", Some(*line))],
            Self::NotANumber { line, .. } => vec![("values", Some(*line))],
            Self::RaggedRow { line, .. } | Self::OpenDecimal { line, .. } => vec![("layout", Some(*line))],
            _ => Vec::new(),
        }
    }

    /// The error with all further obstacles, and the command that helps.
    pub(crate) fn with_obstacles(
        self,
        inspect: impl FnOnce() -> Result<Inspection, Self>,
        path: &Path,
    ) -> Self {
        let is_about_contents = !matches!(
            self,
            Self::NoSuchFile { .. }
                | Self::IsDirectory { .. }
                | Self::Unreadable { .. }
                | Self::BadColumnMap { .. }
                | Self::BadMapField { .. }
                | Self::EmptyColumnName { .. }
                | Self::TemporaryFile { .. }
                | Self::Refused { .. }
        );
        if !is_about_contents {
            return self;
        }
        let first = self.to_string();
        let others = match inspect() {
            Ok(inspection) => {
                let matching_findings = self.matching_findings();
                let new = |finding: &&Finding| {
                    !first.contains(&finding.message)
                        && !matching_findings.contains(&(finding.kind, finding.line))
                };
                inspection.obstacles().filter(new).map(|finding| finding.message.clone()).collect()
            }
            Err(_) => Vec::new(),
        };
        Self::Refused { first: Box::new(self), others, path: path.to_owned() }
    }
}
