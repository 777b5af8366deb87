//! Builds a recording from the columns of a file: projects components on an axis, fills missing values, checks the time
//! stamps, joins columns of other files.

use crate::columns::{ColumnRole, MappedColumn, MappedColumns, Parts};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
use crate::error::RecordError;
use crate::insertion_axis::{fit_axis, project};
use crate::inspect::magnitude::epoch_unit;
use crate::quality::{QualityKind, QualityNote};
use crate::recording::{JOINTS, Recording};
use crate::table_source::{RawTable, ReadOptions, Select, read_bytes, with_table};
use crate::text::layout::ColumnKind;
use crate::text::rows::RowsRead;
use crate::text::source::SourceFile;
use crate::time_order::{self, MIN_SAMPLE_NUMBERS, retain_rows};

/// Fewest rows that must remain without those that lack a value.
const MIN_ROWS: usize = 3;
/// Share of the rows with a force that lack another value, above which rows of different topics are assumed to alternate.
const ALTERNATING_SHARE: f64 = 0.1;
/// Lines that a note lists.
const MAX_LINES: usize = 100;

/// A quantity with its rows, in SI units.
#[derive(Debug, Clone)]
struct Quantity {
    role: ColumnRole,
    values: Vec<f64>,
}

/// All quantities of a file at common time stamps.
struct Table {
    time_s: Vec<f64>,
    /// Time of the file at `time_s = 0`, where dates or large numbers are counted from the first one.
    base_s: f64,
    quantities: Vec<Quantity>,
    offsets: Vec<usize>,
    notes: Vec<QualityNote>,
}

/// Builds the recording, with notes on what was done.
///
/// # Errors
/// [`RecordError`] with the line.
pub(crate) fn assemble(
    file: &SourceFile<'_>,
    raw: RawTable,
    options: &ReadOptions,
) -> Result<(Recording, Vec<QualityNote>), RecordError> {
    let left_out = raw.read.left_out;
    let mut table = Table::new(file, raw, options)?;
    if let Some(left_out) = left_out {
        let line = file.line_of_row(left_out.offset)?;
        let numbers = [("dropped", left_out.lines as f64)];
        table.notes.push(QualityNote {
            lines: vec![line],
            ..QualityNote::new(QualityKind::RepairedRows, left_out.message(line), numbers)
        });
    }
    table.order(file, options.repair)?;
    table.join(file, options)?;
    let samples = table.time_s.len();
    check_sample_count(file, samples, table.offsets.last().copied())?;
    let Table { time_s, quantities, offsets, notes, .. } = table;
    let mut recording = Recording { time_s, ..Recording::default() };
    for Quantity { role, values } in quantities {
        match role {
            ColumnRole::Time => {}
            ColumnRole::Position => recording.position_m = values,
            ColumnRole::Force => recording.force_n = values,
            ColumnRole::Velocity => {
                recording.velocity_mps = values;
                recording.velocity_measured = true;
            }
            ColumnRole::ForceVirtual => recording.force_virtual_n = Some(values),
            ColumnRole::JointTorque(joint) => {
                recording.joint_torque_nm.resize(samples, [0.0; JOINTS]);
                for (torques, value) in recording.joint_torque_nm.iter_mut().zip(values) {
                    torques[joint] = value;
                }
            }
        }
    }
    if !recording.velocity_measured {
        recording.velocity_mps =
            differentiate(&recording.time_s, &recording.position_m, DEFAULT_HALF_WIDTH_S);
        if let Some(row) = recording.velocity_mps.iter().position(|v| !v.is_finite()) {
            let line = file.line_of_row(offsets.get(row).copied().unwrap_or(file.header))?;
            return Err(RecordError::VelocityNotFinite { path: file.path(), line });
        }
    }
    Ok((recording, notes))
}

/// Rejects fewer than two samples.
pub(crate) fn check_sample_count(
    file: &SourceFile<'_>,
    samples: usize,
    last_offset: Option<usize>,
) -> Result<(), RecordError> {
    if samples >= 2 {
        return Ok(());
    }
    let line = file.line_of_row(last_offset.unwrap_or(file.header))?;
    Err(RecordError::TooFewSamples { path: file.path(), line, samples })
}

/// The note on units that names or types gave.
pub(crate) fn unit_notes(mapped: &MappedColumns) -> Vec<QualityNote> {
    mapped.remarks.iter().map(|remark| QualityNote::new(QualityKind::Converted, remark.clone(), [])).collect()
}

/// The note on rows without a value; the first of them begin at `offsets`.
pub(crate) fn missing_values_note(
    file: &SourceFile<'_>,
    count: usize,
    offsets: Vec<usize>,
) -> Result<QualityNote, RecordError> {
    let lines = file.lines_of_offsets(offsets.into_iter())?;
    let message = format!(
        "{count} row(s) without a value, such as line {}, were left out: the recording has a hole there",
        lines.first().copied().unwrap_or(1)
    );
    Ok(QualityNote { lines, ..QualityNote::new(QualityKind::Gaps, message, [("count", count as f64)]) })
}

impl Table {
    fn new(file: &SourceFile<'_>, raw: RawTable, options: &ReadOptions) -> Result<Self, RecordError> {
        let map = options.columns.as_ref();
        let RawTable { columns, offsets, mapped, read } = raw;
        let mut notes = unit_notes(&mapped);
        let axis = map.and_then(|map| map.axis);
        let mut columns = columns.into_iter();
        let mut parts: Vec<Vec<Vec<f64>>> = mapped
            .columns
            .iter()
            .map(|column| columns.by_ref().take(column.indices.len()).collect())
            .collect();
        // The axis of the motion is used for the force, too.
        let of_position = mapped
            .columns
            .iter()
            .position(|c| c.role == ColumnRole::Position && c.parts == Parts::Components);
        let of_any = of_position.or_else(|| mapped.columns.iter().position(|c| c.parts == Parts::Components));
        let axis = match (axis, of_any) {
            (None, Some(at)) => {
                let fitted = fit_axis(&parts[at]);
                let (axis, share) = (fitted.axis, fitted.share);
                let message = format!(
                    "the components of \"{}\" are projected on the axis ({:.4}, {:.4}, {:.4}), which was fitted to them and holds {:.1} % of their \
                     variance; give `axis` in the column map for another one",
                    mapped.columns[at].name,
                    axis[0],
                    axis[1],
                    axis[2],
                    100.0 * share
                );
                notes.push(QualityNote::new(
                    QualityKind::Converted,
                    message,
                    [("x", axis[0]), ("y", axis[1]), ("z", axis[2]), ("share", share)],
                ));
                Some(axis)
            }
            (Some((x, y, z)), _) => Some([x, y, z]),
            (None, None) => None,
        };
        let (mut time, mut quantities, mut base_s) = (None, Vec::new(), 0.0);
        let rows = offsets.len();
        let mut place = 0;
        for (column, parts) in mapped.columns.iter().zip(&mut parts) {
            let origin = read.origins.get(place).copied().flatten();
            place += column.indices.len();
            // Counted from the first whole second, as dates from the first one.
            let whole_s = parts.first().and_then(|p| p.first()).copied().filter(|x| x.is_finite());
            let mut raw_values = combine(column, std::mem::take(parts), axis);
            raw_values.resize(rows, f64::NAN);
            if column.role == ColumnRole::Time {
                base_s = match (column.parts, origin) {
                    (Parts::SecondsNanoseconds, _) => whole_s.unwrap_or(0.0),
                    (_, Some(x)) if column.kind == ColumnKind::Date => x as f64 / 1e9,
                    (_, Some(x)) => x as f64 * column.scale,
                    (_, None) => 0.0,
                };
                time =
                    Some(seconds(file, column, raw_values, (&offsets, origin), map.and_then(|m| m.rate_hz))?);
                continue;
            }
            let values = converted(file, column, raw_values, &offsets)?;
            quantities.push(Quantity { role: column.role, values });
        }
        let time_s = match (time, map.and_then(|map| map.rate_hz)) {
            (Some(time), _) => time,
            (None, Some(rate)) => (0..rows).map(|row| row as f64 / rate).collect(),
            (None, None) => {
                return Err(RecordError::TooFewSamples { path: file.path(), line: 1, samples: 0 });
            }
        };
        let mut table = Self { time_s, base_s, quantities, offsets, notes };
        table.remove_missing_values(file, &mapped, &read)?;
        Ok(table)
    }

    fn of(&self, role: ColumnRole) -> Option<&Vec<f64>> {
        self.quantities.iter().find(|q| q.role == role).map(|q| &q.values)
    }

    fn retain(&mut self, keep: &[bool]) {
        self.time_s = retain_rows(&self.time_s, keep);
        self.offsets = retain_rows(&self.offsets, keep);
        for quantity in &mut self.quantities {
            quantity.values = retain_rows(&quantity.values, keep);
        }
    }

    /// Leaves out rows without a value; where rows of different topics alternate, interpolates on the stamps of the force.
    fn remove_missing_values(
        &mut self,
        file: &SourceFile<'_>,
        mapped: &MappedColumns,
        read: &RowsRead,
    ) -> Result<(), RecordError> {
        let rows = self.time_s.len();
        let complete: Vec<bool> = (0..rows)
            .map(|row| {
                self.time_s[row].is_finite() && self.quantities.iter().all(|q| q.values[row].is_finite())
            })
            .collect();
        if complete.iter().all(|complete| *complete) {
            return Ok(());
        }
        if let Some(force) = self.of(ColumnRole::Force) {
            let with_force: Vec<bool> =
                (0..rows).map(|row| self.time_s[row].is_finite() && force[row].is_finite()).collect();
            let count = with_force.iter().filter(|with| **with).count();
            let lacking = (0..rows).filter(|row| with_force[*row] && !complete[*row]).count();
            if lacking as f64 > ALTERNATING_SHARE * count as f64 && self.interpolate_on(&with_force) {
                let message = format!(
                    "rows of different topics alternate: the other columns are interpolated on the {} time stamps of the force",
                    self.time_s.len()
                );
                let numbers = [("samples", self.time_s.len() as f64), ("rows", rows as f64)];
                self.notes.push(QualityNote::new(QualityKind::Interpolated, message, numbers));
                return Ok(());
            }
        }
        let left = complete.iter().filter(|complete| **complete).count();
        if left < MIN_ROWS {
            return Err(first_missing_value(file, mapped, read)?);
        }
        let dropped =
            self.offsets.iter().zip(&complete).filter(|(_, complete)| !**complete).map(|(offset, _)| *offset);
        self.notes.push(missing_values_note(file, rows - left, dropped.take(MAX_LINES).collect())?);
        self.retain(&complete);
        Ok(())
    }

    /// Interpolates all quantities on the rows of the force, within the time that all of them cover. `false` when that leaves
    /// too few rows.
    fn interpolate_on(&mut self, with_force: &[bool]) -> bool {
        let mut quantities = Vec::with_capacity(self.quantities.len());
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for quantity in &self.quantities {
            let known: Vec<(f64, f64)> = self
                .time_s
                .iter()
                .zip(&quantity.values)
                .filter(|(t, x)| t.is_finite() && x.is_finite())
                .map(|(t, x)| (*t, *x))
                .collect();
            let (t, x): (Vec<f64>, Vec<f64>) = known.into_iter().unzip();
            if !t.windows(2).all(|pair| pair[1] > pair[0]) {
                return false;
            }
            let (Some(first), Some(last)) = (t.first(), t.last()) else { return false };
            from = from.max(*first);
            to = to.min(*last);
            quantities.push((quantity.role, t, x));
        }
        let keep: Vec<bool> =
            with_force.iter().zip(&self.time_s).map(|(with, t)| *with && (from..=to).contains(t)).collect();
        let stamps = retain_rows(&self.time_s, &keep);
        if stamps.len() < MIN_ROWS {
            return false;
        }
        self.quantities = quantities
            .into_iter()
            .map(|(role, t, x)| Quantity {
                role,
                values: stamps.iter().map(|at| stylet_stats::interpolate(&t, &x, *at)).collect(),
            })
            .collect();
        self.offsets = retain_rows(&self.offsets, &keep);
        self.time_s = stamps;
        true
    }

    /// Checks the order of the time stamps, or repairs it.
    fn order(&mut self, file: &SourceFile<'_>, repair: bool) -> Result<(), RecordError> {
        if !repair {
            return time_order::check(file, &self.time_s, &self.offsets);
        }
        let repaired = time_order::repair(file, &self.time_s, &self.offsets)?;
        if let Some(time_s) = repaired.time_s {
            self.time_s = time_s;
        }
        if let Some(keep) = repaired.keep {
            self.retain(&keep);
        }
        self.notes.splice(0..0, repaired.notes);
        Ok(())
    }

    /// Adds the columns that the map takes from other files, at the time stamps of the force.
    fn join(&mut self, file: &SourceFile<'_>, options: &ReadOptions) -> Result<(), RecordError> {
        let Some(map) = &options.columns else { return Ok(()) };
        let columns = [
            (ColumnRole::Force, Some(&map.force)),
            (ColumnRole::Position, Some(&map.position)),
            (ColumnRole::Velocity, map.velocity.as_ref()),
            (ColumnRole::ForceVirtual, map.force_virtual.as_ref()),
        ];
        for (role, column) in columns {
            let Some((column, name)) = column.and_then(|column| Some((column, column.file.as_ref()?))) else {
                continue;
            };
            let path = file.path.parent().map_or_else(|| name.into(), |folder| folder.join(name));
            let bytes = read_bytes(&path)?;
            let of_series = ReadOptions { columns: Some(map.clone()), ..options.clone() };
            let mut series =
                with_table(&bytes, &path, Some(map), Select::Series(role, column), |file, raw| {
                    let mut series = Table::new(file, raw, &of_series)?;
                    series.order(file, options.repair)?;
                    Ok(series)
                })?;
            let shift_s = series.base_s - self.base_s;
            series.time_s.iter_mut().for_each(|t| *t += shift_s);
            let Some(values) = series.quantities.pop().map(|quantity| quantity.values) else { continue };
            let (Some(first), Some(last)) = (series.time_s.first().copied(), series.time_s.last().copied())
            else {
                continue;
            };
            let own = (
                self.time_s.first().copied().unwrap_or(f64::NAN),
                self.time_s.last().copied().unwrap_or(f64::NAN),
            );
            if role == ColumnRole::Force {
                // The rows of the recording are those of the force.
                let keep: Vec<bool> = series.time_s.iter().map(|t| (own.0..=own.1).contains(t)).collect();
                let stamps = retain_rows(&series.time_s, &keep);
                for quantity in &mut self.quantities {
                    quantity.values = stamps
                        .iter()
                        .map(|at| stylet_stats::interpolate(&self.time_s, &quantity.values, *at))
                        .collect();
                }
                self.quantities.push(Quantity { role, values: retain_rows(&values, &keep) });
                self.offsets = vec![file.header; stamps.len()];
                self.time_s = stamps;
            } else {
                let keep: Vec<bool> = self.time_s.iter().map(|t| (first..=last).contains(t)).collect();
                self.retain(&keep);
                let values = self
                    .time_s
                    .iter()
                    .map(|at| stylet_stats::interpolate(&series.time_s, &values, *at))
                    .collect();
                self.quantities.push(Quantity { role, values });
            }
            if self.time_s.len() < 2 {
                return Err(RecordError::NoOverlap {
                    path: file.path(),
                    own,
                    other_path: path,
                    other: (first, last),
                });
            }
            self.notes.append(&mut series.notes);
            let message = format!(
                "the {} is that of {name}, joined by time: {} samples in common",
                role.name(),
                self.time_s.len()
            );
            self.notes.push(QualityNote::new(
                QualityKind::Interpolated,
                message,
                [("samples", self.time_s.len() as f64)],
            ));
        }
        Ok(())
    }
}

/// The raw values of a column from its parts.
fn combine(column: &MappedColumn, mut parts: Vec<Vec<f64>>, axis: Option<[f64; 3]>) -> Vec<f64> {
    match (column.parts, parts.as_slice()) {
        (Parts::SecondsNanoseconds, [seconds, nanoseconds]) => {
            let first = seconds.first().copied().unwrap_or(0.0);
            // Counted from the first whole second, so that nanoseconds keep their digits.
            let first = if first.is_finite() { first } else { 0.0 };
            seconds.iter().zip(nanoseconds).map(|(s, ns)| (s - first) + ns / 1e9).collect()
        }
        (Parts::Components, [x, y, z]) => project([x, y, z], axis.unwrap_or([0.0, 0.0, 1.0])),
        _ => parts.pop().unwrap_or_default(),
    }
}

/// The time in seconds.
fn seconds(
    file: &SourceFile<'_>,
    column: &MappedColumn,
    mut raw: Vec<f64>,
    (offsets, origin): (&[usize], Option<i64>),
    rate_hz: Option<f64>,
) -> Result<Vec<f64>, RecordError> {
    if let Some(rate) = rate_hz {
        raw.iter_mut().for_each(|x| *x /= rate);
        return Ok(raw);
    }
    if !column.scale_is_given && column.kind != ColumnKind::Date && column.parts == Parts::Single {
        let line = || file.line_of_row(offsets.first().copied().unwrap_or(file.header));
        if raw.len() >= MIN_SAMPLE_NUMBERS && raw.windows(2).all(|pair| pair[1] - pair[0] == 1.0) {
            return Err(RecordError::SampleNumber {
                path: file.path(),
                line: line()?,
                column: column.name.clone(),
            });
        }
        let first = raw.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0) + origin.unwrap_or(0) as f64;
        if let Some((unit, scale)) = epoch_unit(first * column.scale) {
            return Err(RecordError::TimeUnit {
                path: file.path(),
                line: line()?,
                column: column.name.clone(),
                value: first,
                unit,
                scale,
            });
        }
    }
    converted(file, column, raw, offsets)
}

/// Raw values in SI units.
fn converted(
    file: &SourceFile<'_>,
    column: &MappedColumn,
    mut raw: Vec<f64>,
    offsets: &[usize],
) -> Result<Vec<f64>, RecordError> {
    for (row, x) in raw.iter_mut().enumerate() {
        let value = column.apply(*x);
        if x.is_finite() && !value.is_finite() {
            return Err(RecordError::NotFinite {
                path: file.path(),
                line: file.line_of_row(offsets.get(row).copied().unwrap_or(file.header))?,
                column: column.name.clone(),
                text: format!("{x:e}"),
            });
        }
        *x = value;
    }
    Ok(raw)
}

/// The error of the first missing value.
fn first_missing_value(
    file: &SourceFile<'_>,
    mapped: &MappedColumns,
    read: &RowsRead,
) -> Result<RecordError, RecordError> {
    let Some(missing) = &read.first_missing else {
        return Ok(RecordError::TooFewSamples {
            path: file.path(),
            line: file.line_of_row(file.header)?,
            samples: 0,
        });
    };
    let mut fields =
        mapped.columns.iter().flat_map(|column| column.indices.iter().map(move |_| column.name.clone()));
    let column = fields.nth(missing.field).unwrap_or_default();
    let (path, line, text) = (file.path(), file.line_of_row(missing.offset)?, missing.text.clone());
    Ok(if text.is_empty() {
        RecordError::NotANumber { path, line, column, text, remedy: "fill in the value or remove the row" }
    } else {
        RecordError::NotFinite { path, line, column, text }
    })
}
