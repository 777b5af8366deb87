//! Findings of an inspection: obstacles for the readers, and remarks.

use super::candidates::{ChosenColumns, si_symbol};
use super::facts::{FileFacts, Rows};
use super::magnitude::{epoch_unit, in_words};
use super::scan::Scan;
use super::{Finding, Role, Sampling};
use crate::columns::TableHead;
use crate::error::RecordError;
use crate::text::layout::ColumnKind;
use crate::text::rows::RowsRead;
use stylet_stats::number_format::significant;

/// Ratio of the roughness of position and force above which both seem swapped.
const SWAPPED_RATIO: f64 = 10.0;

/// The text of an error without the name of the file.
pub(super) fn without_path(error: &RecordError, path: &std::path::Path) -> String {
    let text = error.to_string();
    text.strip_prefix(&format!("{}: ", path.display())).map_or_else(|| text.clone(), str::to_owned)
}

struct Findings<'a> {
    path: &'a std::path::Path,
    found: Vec<Finding>,
}

impl Findings<'_> {
    fn obstacle(&mut self, kind: &'static str, line: Option<u64>, message: String) {
        self.found.push(Finding { kind, message, line, obstacle: true });
    }

    fn remark(&mut self, kind: &'static str, message: String) {
        self.found.push(Finding { kind, message, line: None, obstacle: false });
    }

    fn error(&mut self, kind: &'static str, line: Option<u64>, error: &RecordError) {
        let message = without_path(error, self.path);
        self.obstacle(kind, line, message);
    }
}

/// All findings, obstacles first.
pub(super) fn findings(
    facts: &FileFacts<'_>,
    head: TableHead<'_>,
    scan: &Scan,
    read: &RowsRead,
    chosen: &ChosenColumns,
    sampling: Option<&Sampling>,
    rows: &dyn Rows,
) -> Result<Vec<Finding>, RecordError> {
    let mut found = Findings { path: facts.path, found: Vec::new() };
    columns(&mut found, head, chosen, facts);
    rows_and_values(&mut found, head, scan, read, chosen, sampling, rows)?;
    if let Some(sampling) = sampling {
        time(&mut found, head, chosen, sampling);
    }
    units(&mut found, head, chosen);
    found.found.sort_by_key(|finding| !finding.obstacle);
    Ok(found.found)
}

fn columns(found: &mut Findings<'_>, head: TableHead<'_>, chosen: &ChosenColumns, facts: &FileFacts<'_>) {
    let mut said: Vec<String> = Vec::new();
    for (role, error) in &chosen.errors {
        let candidate = chosen.candidates.iter().find(|candidate| candidate.role == *role);
        let message = match (error, candidate) {
            // Reported below.
            (RecordError::MissingColumn { .. }, None) => continue,
            (RecordError::MissingColumn { .. }, Some(candidate)) => format!(
                "the {} is probably \"{}\": {}",
                role.name(),
                candidate.names.join(", "),
                candidate.reason
            ),
            _ => without_path(error, found.path),
        };
        if !said.contains(&message) {
            found.obstacle("columns", Some(head.line), message.clone());
            said.push(message);
        }
    }
    let lacks = |role: Role| chosen.indices(role).is_empty();
    if !chosen.has_time() {
        found.obstacle(
            "time",
            None,
            "there is no time: give the sampling rate in a column map, such as rate_hz: 200".to_owned(),
        );
    }
    for (role, example) in [
        (Role::Position, "position: (file: \"pose.csv\", name: ...)"),
        (Role::Force, "force: (file: \"wrench.csv\", name: ...)"),
    ] {
        let elsewhere = match role {
            Role::Position => chosen.map.position.file.is_some(),
            _ => chosen.map.force.file.is_some(),
        };
        if lacks(role) && !elsewhere {
            let message = format!(
                "no column can be the {}; take it from another file of the same clock in a column map: {example}",
                role.name()
            );
            found.obstacle("columns", None, message);
        }
    }
    if let Some(text) = &facts.open_decimal {
        let error =
            RecordError::OpenDecimal { path: found.path.to_owned(), line: head.line, text: text.clone() };
        found.error("layout", Some(head.line), &error);
    }
    for part in &facts.unreadable {
        found.remark("columns", format!("not read: {part}"));
    }
}

fn rows_and_values(
    found: &mut Findings<'_>,
    head: TableHead<'_>,
    scan: &Scan,
    read: &RowsRead,
    chosen: &ChosenColumns,
    sampling: Option<&Sampling>,
    rows: &dyn Rows,
) -> Result<(), RecordError> {
    let used: Vec<usize> = [Role::Time, Role::Position, Role::Force]
        .iter()
        .flat_map(|role| chosen.indices(*role).iter().copied())
        .collect();
    for bad in read.bad_values.iter().filter(|bad| used.contains(&bad.field)) {
        let more = if bad.count > 1 {
            format!(" ({} such fields in this column)", bad.count)
        } else {
            String::new()
        };
        found.obstacle("values", Some(bad.line), without_path(&bad.first, found.path) + &more);
    }
    if let Some((count, line, error)) = &read.ragged {
        let more = if *count > 1 { format!(" ({count} such rows)") } else { String::new() };
        found.obstacle("layout", Some(*line), without_path(error, found.path) + &more);
    }
    if let Some(left_out) = read.left_out {
        let line = rows.lines(&[left_out.offset])?.first().copied().unwrap_or(1);
        found.remark("layout", left_out.message(line));
    }
    if sampling.is_some_and(|s| s.alternating) {
        found.remark("values", "rows of different topics alternate: the position is interpolated on the time stamps of the force".to_owned());
    } else {
        for at in used {
            let Some(column) = scan.columns.get(at).filter(|c| c.missing > 0) else { continue };
            let message = format!(
                "column \"{}\" has no value in {} of {} rows: holes in the recording",
                head.names[at], column.missing, scan.rows
            );
            found.remark("values", message);
        }
    }
    for role in [Role::Position, Role::Force] {
        let constant = chosen
            .indices(role)
            .iter()
            .all(|at| scan.columns.get(*at).is_some_and(super::scan::ColumnScan::is_constant));
        if constant && !chosen.indices(role).is_empty() {
            found.remark("values", format!("the {} is constant", role.name()));
        }
    }
    if let (&[position], &[force]) = (chosen.indices(Role::Position), chosen.indices(Role::Force))
        && let (Some(z), Some(f)) = (scan.columns.get(position), scan.columns.get(force))
        && z.roughness() > SWAPPED_RATIO * f.roughness()
        && !f.is_constant()
    {
        let message = format!(
            "\"{}\" is {:.0} times as rough as \"{}\": are position and force swapped?",
            head.names[position],
            z.roughness() / f.roughness(),
            head.names[force]
        );
        found.remark("columns", message);
    }
    Ok(())
}

fn time(found: &mut Findings<'_>, head: TableHead<'_>, chosen: &ChosenColumns, sampling: &Sampling) {
    let path = found.path.to_owned();
    let name =
        chosen.indices(Role::Time).first().and_then(|at| head.names.get(*at)).cloned().unwrap_or_default();
    let is_certain = chosen.candidates.iter().any(|c| c.role == Role::Time && c.reason == "the column map");
    if sampling.counts_samples && !is_certain {
        let error = RecordError::SampleNumber { path, line: head.line, column: name };
        found.error("time", None, &error);
        return;
    }
    if let Some(candidate) = chosen.candidates.iter().find(|c| c.role == Role::Time && !is_certain)
        && let Some(proposal) = candidate.proposals.first()
        && let Some((unit, scale)) = epoch_unit(proposal.value)
    {
        let error = RecordError::TimeUnit {
            path: path.clone(),
            line: head.line,
            column: name,
            value: proposal.value,
            unit,
            scale,
        };
        found.error("time", None, &error);
    }
    if let Some(line) = sampling.second_run_line {
        let message = format!(
            "line {line}: a second recording begins here; put the lines from {line} on into a file of their own"
        );
        found.obstacle("sampling", Some(line), message);
    }
    if let (Some(per_burst), Some(line)) = (sampling.per_burst, sampling.repeated_line) {
        let message = format!(
            "the samples arrive in bursts of {} with one time stamp each, first on line {line}; --repair spreads them evenly",
            significant(per_burst, 2)
        );
        found.obstacle("sampling", Some(line), message);
    } else if let Some(line) = sampling.repeated_line {
        let message = format!(
            "line {line}: {} row(s) repeat the time stamp before them; --repair drops them, up to 1 %",
            sampling.repeated
        );
        found.obstacle("sampling", Some(line), message);
    }
    if let (Some(line), None) = (sampling.backward_line, sampling.second_run_line) {
        let message = format!(
            "line {line}: time runs backward in {} row(s); --repair drops up to 1 % of the rows",
            sampling.backward
        );
        found.obstacle("sampling", Some(line), message);
    }
    if sampling.gaps > 0 && sampling.per_burst.is_none() {
        let message = format!(
            "{} gap(s) in the sampling, the largest of {} s; typical interval {} s",
            sampling.gaps,
            significant(sampling.largest_interval_s, 3),
            significant(sampling.median_interval_s, 3)
        );
        found.remark("sampling", message);
    }
}

fn units(found: &mut Findings<'_>, head: TableHead<'_>, chosen: &ChosenColumns) {
    for candidate in &chosen.candidates {
        let (role, symbol) = (candidate.role, si_symbol(candidate.role));
        let name = candidate.names.first().cloned().unwrap_or_default();
        if role == Role::Time && candidate.proposals.first().is_some_and(|p| epoch_unit(p.value).is_some()) {
            continue;
        }
        if !candidate.proposals.is_empty() {
            let what = match role {
                Role::Time => "sampling interval",
                Role::Position => "travel",
                _ => "largest force",
            };
            let message = format!(
                "{} \"{name}\": by its {what} it may be in {}",
                role.name(),
                in_words(&candidate.proposals, symbol)
            );
            found.remark("unit", message);
        } else if candidate.certain && candidate.scale != 1.0 {
            found.remark(
                "unit",
                format!("{} \"{name}\" is in {}: scale {}", role.name(), candidate.unit, candidate.scale),
            );
        }
        if candidate.columns.len() == 3 {
            found.remark(
                "columns",
                format!(
                    "{} has three components, which are projected on `axis`, or on an axis fitted to them",
                    role.name()
                ),
            );
        }
    }
    for (at, kind) in head.kinds.iter().enumerate() {
        if *kind == ColumnKind::Date && !chosen.indices(Role::Time).contains(&at) {
            found.remark("columns", format!("column \"{}\" holds dates and is not used", head.names[at]));
        }
    }
}
