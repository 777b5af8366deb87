//! Results of an inspection.

use super::magnitude::UnitProposal;
use crate::column_map::ColumnMap;
use crate::text::layout::ColumnKind;
use crate::units::Dimension;
use serde::Serialize;
use std::path::PathBuf;

/// How to inspect a file.
#[derive(Debug, Clone, Default)]
pub struct InspectOptions {
    /// A column map, whose fields are taken as given.
    pub columns: Option<ColumnMap>,
}

/// Result of an inspection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The file.
    pub path: PathBuf,
    /// Kind of the file: `text table`, `a spreadsheet`, `an MCAP file`, ...
    pub format: String,
    /// Size in bytes.
    pub bytes: u64,
    /// Layout of a text table or sheet.
    pub text: Option<TextFacts>,
    /// Rows of values.
    pub rows: usize,
    /// All columns, in the order of the file.
    pub columns: Vec<InspectedColumn>,
    /// The columns of a recording: time, position, force, velocity, as far as they were found.
    pub candidates: Vec<Candidate>,
    /// Time stamps, if there is a time.
    pub sampling: Option<Sampling>,
    /// Findings, obstacles first.
    pub findings: Vec<Finding>,
    /// The proposed column map.
    pub map: ColumnMap,
    /// Whether the readers need a map for this file.
    pub map_needed: bool,
    /// Time, position and force in the proposed units, thinned to their extremes.
    pub curves: Curves,
}

impl Inspection {
    /// Whether the readers accept the file without map and repair.
    #[must_use]
    pub fn is_readable(&self) -> bool {
        !self.findings.iter().any(|finding| finding.obstacle)
    }

    /// Findings for which the readers reject the file.
    pub fn obstacles(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| finding.obstacle)
    }

    /// The candidate of a role.
    #[must_use]
    pub fn candidate(&self, role: Role) -> Option<&Candidate> {
        self.candidates.iter().find(|candidate| candidate.role == role)
    }

    /// Reverses the sign of a quantity in the proposed map and in the curves. `scale` is the one that it had; `None` for that of the map.
    pub(crate) fn reverse(&mut self, role: Role, scale: Option<f64>) {
        let (column, curve) = match role {
            Role::Position => (&mut self.map.position, &mut self.curves.position_m),
            Role::Force => (&mut self.map.force, &mut self.curves.force_n),
            Role::Time | Role::Velocity => return,
        };
        let Some(candidate) = self.candidates.iter_mut().find(|candidate| candidate.role == role) else {
            return;
        };
        candidate.scale = -scale.unwrap_or(candidate.scale);
        candidate.certain = false;
        candidate.reason.push_str("; the sign is reversed");
        (column.scale, column.offset) = (Some(candidate.scale), -column.offset);
        curve.iter_mut().for_each(|x| *x = -*x);
        self.map_needed = true;
    }

    /// SI units per unit of a quantity, as its column says.
    pub(crate) fn stated_scale(&self, role: Role) -> f64 {
        let number = self.candidate(role).and_then(|candidate| candidate.columns.first());
        let column = number.and_then(|number| self.columns.get(number.checked_sub(1)?));
        column.and_then(|column| column.to_si).unwrap_or(1.0)
    }

    /// The proposed map as a RON file, with remarks.
    #[must_use]
    pub fn to_ron(&self) -> String {
        let name = self.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let mut out = format!(
            "// Column map for {name}, proposed by `stylet inspect`. Check names, units and signs.\n"
        );
        for candidate in self.candidates.iter().filter(|candidate| !candidate.certain) {
            out.push_str(&format!("// {}: {}\n", candidate.role.name(), candidate.reason));
        }
        if self.sampling.as_ref().is_none_or(|sampling| sampling.counts_samples) && self.map.rate_hz.is_none()
        {
            out.push_str("// rate_hz: the file has no time in seconds; fill in the samples per second as a line rate_hz: 200.0,\n");
        }
        out + &self.map.to_ron()
    }
}

/// Layout of a text table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TextFacts {
    /// Encoding, such as `UTF-8`.
    pub encoding: String,
    /// Separator of the columns: `comma`, `semicolon`, `tab`, `|` or `blanks`.
    pub delimiter: String,
    /// Decimal sign.
    pub decimal: char,
    /// Line of the names, from 1.
    pub names_line: Option<u64>,
    /// Line of the row of units.
    pub units_line: Option<u64>,
    /// Line of the first row of values.
    pub data_line: u64,
    /// Lines above the names that are not blank, at most 40.
    pub preamble: Vec<String>,
}

/// A column of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InspectedColumn {
    /// Number, from 1.
    pub number: usize,
    /// Name; `column 3` where the file has no names.
    pub name: String,
    /// Symbol of the unit in the name, the row of units or the type.
    pub unit: Option<String>,
    /// SI units per unit.
    pub to_si: Option<f64>,
    /// Dimension of the unit.
    pub dimension: Option<Dimension>,
    /// Numbers, dates or text.
    pub kind: ColumnKind,
    /// Number of values.
    pub values: usize,
    /// Number of rows without a value.
    pub missing: usize,
    /// Smallest and largest value, in the unit of the file.
    pub range: Option<(f64, f64)>,
}

/// Quantity of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Time.
    Time,
    /// Tip position.
    Position,
    /// Axial force.
    Force,
    /// Tip velocity.
    Velocity,
}

impl Role {
    /// Name, which is the field of the map.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Position => "position",
            Self::Force => "force",
            Self::Velocity => "velocity",
        }
    }

    /// Dimension of the quantity.
    #[must_use]
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Time => Dimension::Time,
            Self::Position => Dimension::Length,
            Self::Force => Dimension::Force,
            Self::Velocity => Dimension::Velocity,
        }
    }
}

/// The column that holds a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// The quantity.
    pub role: Role,
    /// Numbers of the columns, from 1: one, or three components.
    pub columns: Vec<usize>,
    /// Their names.
    pub names: Vec<String>,
    /// Unit of the values.
    pub unit: String,
    /// SI units per unit.
    pub scale: f64,
    /// Whether name and unit identify it; otherwise contents and magnitude suggest it.
    pub certain: bool,
    /// Why.
    pub reason: String,
    /// Units that the magnitude suggests, the most typical one first, if the file has no unit or an implausible one.
    pub proposals: Vec<UnitProposal>,
}

/// Time stamps of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sampling {
    /// Number of rows with a time.
    pub samples: usize,
    /// Time from the first to the last sample (s).
    pub duration_s: f64,
    /// Samples per duration (Hz).
    pub rate_hz: f64,
    /// Median interval (s) between different time stamps.
    pub median_interval_s: f64,
    /// Rows that repeat the time stamp before them, and the line of the first.
    pub repeated: usize,
    /// Line of the first repeated time stamp.
    pub repeated_line: Option<u64>,
    /// Rows whose time is before that of the row above.
    pub backward: usize,
    /// Line of the first step back.
    pub backward_line: Option<u64>,
    /// Samples per time stamp, where the samples arrive in bursts.
    pub per_burst: Option<f64>,
    /// Intervals above five median intervals.
    pub gaps: usize,
    /// The largest interval (s).
    pub largest_interval_s: f64,
    /// Line where a second recording begins.
    pub second_run_line: Option<u64>,
    /// Whether the time counts the samples.
    pub counts_samples: bool,
    /// Whether position and force are in alternate rows.
    pub alternating: bool,
}

/// A finding about a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Kind: `columns`, `time`, `unit`, `sampling`, `values`, `layout`, `quality`.
    pub kind: &'static str,
    /// What and where, and the remedy.
    pub message: String,
    /// Line, from 1.
    pub line: Option<u64>,
    /// Whether the readers reject the file for it.
    pub obstacle: bool,
}

/// Curves for plots, of equal lengths.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Curves {
    /// Time (s).
    pub time_s: Vec<f64>,
    /// Position (m).
    pub position_m: Vec<f64>,
    /// Force (N).
    pub force_n: Vec<f64>,
}
