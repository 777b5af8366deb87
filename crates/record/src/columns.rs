//! Assignment of columns to quantities: by a column map, by Stylet's names, or by unambiguous names and units.

use std::path::Path;

use crate::column_map::{Column, ColumnMap};
use crate::error::RecordError;
use crate::recording::JOINTS;
use crate::text::layout::{ColumnKind, ColumnSample};
use crate::units::{Dimension, Unit, is_commanded, is_time, quantity_of, split_name, unit_at, vector_of};

/// Quantity of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ColumnRole {
    Time,
    Position,
    Force,
    Velocity,
    ForceVirtual,
    JointTorque(usize),
}

impl ColumnRole {
    /// Dimension of the quantity.
    pub(crate) fn dimension(self) -> Dimension {
        match self {
            Self::Time => Dimension::Time,
            Self::Position => Dimension::Length,
            Self::Force | Self::ForceVirtual => Dimension::Force,
            Self::Velocity => Dimension::Velocity,
            Self::JointTorque(_) => Dimension::Other,
        }
    }

    /// Name for messages, with the field of the map.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Position => "position",
            Self::Force => "force",
            Self::Velocity => "velocity",
            Self::ForceVirtual => "force_virtual",
            Self::JointTorque(_) => "joint torque",
        }
    }

    /// Stylet's name and what it holds.
    fn own(self) -> (&'static str, &'static str) {
        match self {
            Self::Time => ("time_s", "time in seconds"),
            Self::Position => ("position_m", "tip position in metres"),
            Self::Force => ("force_n", "axial force in newtons"),
            Self::Velocity => ("velocity_mps", "tip velocity in m/s"),
            Self::ForceVirtual => ("force_virtual_n", "virtual force in newtons"),
            Self::JointTorque(_) => ("joint_torque_1_nm", "joint torque in N m"),
        }
    }
}

/// Columns of a file, before they are read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TableHead<'a> {
    pub path: &'a Path,
    /// Line of the names, or of the first row without names.
    pub line: u64,
    pub names: &'a [String],
    /// Whether the file has names.
    pub named: bool,
    /// Units from a row of units or from typed columns.
    pub units: &'a [Option<Unit>],
    pub kinds: &'a [ColumnKind],
    /// Values of the columns in some rows; empty where they are not known.
    pub samples: &'a [ColumnSample],
}

impl<'a> TableHead<'a> {
    /// Columns of a file that is no text, without samples.
    pub(crate) fn of_columns(
        path: &'a Path,
        names: &'a [String],
        units: &'a [Option<Unit>],
        kinds: &'a [ColumnKind],
    ) -> Self {
        Self { path, line: 1, names, named: true, units, kinds, samples: &[] }
    }
}

/// How the parts of a column make one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Parts {
    /// One column.
    Single,
    /// Seconds and nanoseconds.
    SecondsNanoseconds,
    /// Three components along an axis.
    Components,
}

/// A column to be read: its role, its places in a row, its name and unit.
#[derive(Debug, Clone)]
pub(crate) struct MappedColumn {
    pub role: ColumnRole,
    pub indices: Vec<usize>,
    pub parts: Parts,
    pub name: String,
    pub scale: f64,
    pub offset: f64,
    pub kind: ColumnKind,
    /// Whether the user's map gives the scale.
    pub scale_is_given: bool,
}

impl MappedColumn {
    /// `scale * raw + offset`. A scale of 1 and an offset of 0 keep every bit, including the sign of zero.
    #[inline]
    pub(crate) fn apply(&self, raw: f64) -> f64 {
        let scaled = if self.scale == 1.0 { raw } else { self.scale * raw };
        if self.offset == 0.0 { scaled } else { scaled + self.offset }
    }
}

/// The columns of a recording, and what was taken from names and units.
#[derive(Debug, Clone, Default)]
pub(crate) struct MappedColumns {
    /// Time first where there is one; each role at most once.
    pub columns: Vec<MappedColumn>,
    /// Units that were applied, as sentences.
    pub remarks: Vec<String>,
}

const REQUIRED: [ColumnRole; 3] = [ColumnRole::Time, ColumnRole::Position, ColumnRole::Force];

/// Finds the columns of a recording.
///
/// # Errors
/// [`RecordError::MissingColumn`], [`RecordError::AmbiguousColumn`], [`RecordError::NoHeader`], [`RecordError::NoSuchColumn`].
pub(crate) fn map_columns(
    head: TableHead<'_>,
    map: Option<&ColumnMap>,
) -> Result<MappedColumns, RecordError> {
    match map {
        None => without_map(head),
        Some(map) => {
            let mut wanted = vec![
                (ColumnRole::Time, &map.time),
                (ColumnRole::Position, &map.position),
                (ColumnRole::Force, &map.force),
            ];
            wanted.extend(map.velocity.iter().map(|column| (ColumnRole::Velocity, column)));
            wanted.extend(map.force_virtual.iter().map(|column| (ColumnRole::ForceVirtual, column)));
            let mut found = MappedColumns::default();
            let taken: Vec<usize> = wanted
                .iter()
                .filter_map(|(role, column)| mapped_by_user(head, *role, column).ok()?)
                .flat_map(|c| c.indices)
                .collect();
            for (role, column) in wanted {
                if column.file.is_some()
                    || (role == ColumnRole::Time && column.is_open() && map.rate_hz.is_some())
                {
                    continue;
                }
                let mapped = match mapped_by_user(head, role, column)? {
                    Some(mapped) => mapped,
                    None => {
                        let mut mapped = find_by_name_and_unit(head, role, &taken)?;
                        mapped.scale = column.scale.unwrap_or(mapped.scale);
                        mapped.scale_is_given = column.scale.is_some();
                        mapped.offset = column.offset;
                        mapped
                    }
                };
                found.add(head, mapped);
            }
            // A map that names all three is right.
            if map.time.is_open() || map.position.is_open() || map.force.is_open() {
                found.check_clocks(head)?;
            }
            Ok(found)
        }
    }
}

/// The columns of one role and the time in another file.
pub(crate) fn map_series(
    head: TableHead<'_>,
    map: &ColumnMap,
    role: ColumnRole,
    column: &Column,
) -> Result<MappedColumns, RecordError> {
    let mut found = MappedColumns::default();
    if map.rate_hz.is_none() || !map.time.is_open() {
        // The other file may name its time otherwise, and numbers of columns are those of the first file.
        let by_number = map.time.column.is_some() || !map.time.columns.is_empty();
        let time = match mapped_by_user(head, ColumnRole::Time, &map.time) {
            Ok(Some(time)) if !by_number => time,
            _ => find_by_name_and_unit(head, ColumnRole::Time, &[])?,
        };
        found.add(head, time);
    }
    let column = match mapped_by_user(head, role, column)? {
        Some(mapped) => mapped,
        None => {
            let mapped = find_by_name_and_unit(head, role, &[])?;
            MappedColumn { scale: column.scale.unwrap_or(mapped.scale), offset: column.offset, ..mapped }
        }
    };
    found.add(head, column);
    Ok(found)
}

/// The column of one role, as [`map_columns`] would choose it.
///
/// # Errors
/// As [`map_columns`].
pub(crate) fn find_role(
    head: TableHead<'_>,
    role: ColumnRole,
    column: &Column,
) -> Result<MappedColumn, RecordError> {
    match mapped_by_user(head, role, column)? {
        Some(mapped) => Ok(mapped),
        None => {
            let mapped = find_by_name_and_unit(head, role, &[])?;
            Ok(MappedColumn {
                scale: column.scale.unwrap_or(mapped.scale),
                scale_is_given: column.scale.is_some(),
                offset: column.offset,
                ..mapped
            })
        }
    }
}

impl MappedColumns {
    fn add(&mut self, head: TableHead<'_>, column: MappedColumn) {
        if column.scale != 1.0 && !column.scale_is_given && column.kind != ColumnKind::Date {
            let index = column.indices.first().copied().unwrap_or(0);
            if let Some(unit) = unit_of(head, index) {
                self.remarks.push(format!(
                    "{} \"{}\" is in {}: multiplied by {}",
                    column.role.name(),
                    column.name,
                    unit.symbol,
                    unit.to_si
                ));
            }
        }
        self.columns.push(column);
    }

    fn check_clocks(&self, head: TableHead<'_>) -> Result<(), RecordError> {
        let indices = |role| self.of(role).map_or(&[][..], |column| column.indices.as_slice());
        check_clocks(head, indices(ColumnRole::Position), indices(ColumnRole::Force))
    }

    /// Places of all parts, in the order of the columns.
    pub(crate) fn indices(&self) -> Vec<usize> {
        self.columns.iter().flat_map(|column| column.indices.iter().copied()).collect()
    }

    /// The column of a role.
    pub(crate) fn of(&self, role: ColumnRole) -> Option<&MappedColumn> {
        self.columns.iter().find(|column| column.role == role)
    }
}

/// The unit of a column: from the row of units or its type, or from its name.
pub(crate) fn unit_of(head: TableHead<'_>, index: usize) -> Option<Unit> {
    unit_at(head.units, head.names, index)
}

/// A column with the unit in the file, if it is a unit of the quantity.
fn mapped(head: TableHead<'_>, role: ColumnRole, indices: Vec<usize>, column: &Column) -> MappedColumn {
    let first = indices.first().copied().unwrap_or(0);
    let kind = head.kinds.get(first).copied().unwrap_or(ColumnKind::Number);
    let unit = unit_of(head, first).filter(|unit| unit.dimension == role.dimension());
    let parts = match indices.len() {
        2 => Parts::SecondsNanoseconds,
        3 => Parts::Components,
        _ => Parts::Single,
    };
    let name =
        if column.is_open() { head.names.get(first).cloned().unwrap_or_default() } else { column.label() };
    let of_file = match (kind, parts) {
        (ColumnKind::Date, _) | (_, Parts::SecondsNanoseconds) => 1.0,
        _ => unit.map_or(1.0, |unit| unit.to_si),
    };
    MappedColumn {
        role,
        indices,
        parts,
        name,
        scale: column.scale.unwrap_or(of_file),
        offset: column.offset,
        kind,
        scale_is_given: column.scale.is_some(),
    }
}

/// The column that a map names; `None` when the map leaves it open.
fn mapped_by_user(
    head: TableHead<'_>,
    role: ColumnRole,
    column: &Column,
) -> Result<Option<MappedColumn>, RecordError> {
    let numbers: Vec<usize> = column.column.into_iter().chain(column.columns.iter().copied()).collect();
    let names: Vec<&String> =
        if column.name.is_empty() { column.names.iter().collect() } else { vec![&column.name] };
    let mut indices = Vec::new();
    for number in numbers {
        if number == 0 || number > head.names.len() {
            return Err(RecordError::NoSuchColumn {
                path: head.path.to_owned(),
                line: head.line,
                number,
                columns: head.names.len(),
            });
        }
        indices.push(number - 1);
    }
    for name in names {
        match column_index(head, name.trim())? {
            Some(index) => indices.push(index),
            None => {
                // `wrench` denotes `wrench.1`, `wrench.2`, `wrench.3`.
                let parts: Vec<usize> = (1..=4)
                    .filter_map(|k| head.names.iter().position(|n| *n == format!("{}.{k}", name.trim())))
                    .collect();
                if parts.len() != 3 {
                    return Err(missing(head, name, map_words(role)));
                }
                indices.extend(parts);
            }
        }
    }
    Ok((!indices.is_empty()).then(|| mapped(head, role, indices, column)))
}

fn map_words(role: ColumnRole) -> &'static str {
    match role {
        ColumnRole::Time => "the column map's time",
        ColumnRole::Position => "the column map's position",
        ColumnRole::Force => "the column map's force",
        ColumnRole::Velocity => "the column map's velocity",
        _ => "the column map's virtual force",
    }
}

/// The place of a name; an error when it occurs twice.
fn column_index(head: TableHead<'_>, name: &str) -> Result<Option<usize>, RecordError> {
    let mut places = head.names.iter().enumerate().filter(|(_, existing)| existing.trim() == name);
    let found = places.next().map(|(index, _)| index);
    match places.next() {
        Some(_) => Err(RecordError::AmbiguousColumn {
            path: head.path.to_owned(),
            line: head.line,
            column: name.to_owned(),
        }),
        None => Ok(found),
    }
}

/// The error for a column that is not there.
pub(crate) fn missing(head: TableHead<'_>, column: &str, what: &'static str) -> RecordError {
    if !head.named {
        return RecordError::NoHeader {
            path: head.path.to_owned(),
            line: head.line,
            columns: head.names.len(),
        };
    }
    RecordError::MissingColumn {
        path: head.path.to_owned(),
        line: head.line,
        suggestion: most_similar_name(column, head.names),
        column: column.to_owned(),
        what,
        available: head.names.to_vec(),
    }
}

/// The columns of a file without a map.
fn without_map(head: TableHead<'_>) -> Result<MappedColumns, RecordError> {
    let mut found = MappedColumns::default();
    for role in REQUIRED {
        found.add(head, find_by_name_and_unit(head, role, &[])?);
    }
    found.check_clocks(head)?;
    let mut own = |role, name: &str| -> Result<bool, RecordError> {
        let index = column_index(head, name)?;
        if let Some(index) = index {
            found.add(head, mapped(head, role, vec![index], &Column::si(name)));
        }
        Ok(index.is_some())
    };
    own(ColumnRole::Velocity, "velocity_mps")?;
    own(ColumnRole::ForceVirtual, "force_virtual_n")?;
    let torques = (0..JOINTS).filter(|joint| head.names.contains(&joint_torque_name(*joint))).count();
    if torques > 0 {
        for joint in 0..JOINTS {
            let name = joint_torque_name(joint);
            if !own(ColumnRole::JointTorque(joint), &name)? {
                return Err(missing(head, &name, "joint torque in N m: all seven joints or none"));
            }
        }
    }
    Ok(found)
}

/// A column found by its name and unit. Columns in `taken` are already assigned.
fn find_by_name_and_unit(
    head: TableHead<'_>,
    role: ColumnRole,
    taken: &[usize],
) -> Result<MappedColumn, RecordError> {
    let (own, what) = role.own();
    let column = Column::default();
    if let Some(index) = column_index(head, own)? {
        return Ok(
            mapped(head, role, vec![index], &Column { scale: Some(1.0), ..column }).with_scale_of_name()
        );
    }
    // Seconds and nanoseconds, as ROS prints them.
    let place_of = |part: &str| head.names.iter().position(|name| name == part);
    for (s, ns) in [("header.stamp.sec", "header.stamp.nanosec"), ("secs", "nsecs"), ("sec", "nanosec")] {
        if let (ColumnRole::Time, Some(s), Some(ns)) = (role, place_of(s), place_of(ns)) {
            return Ok(mapped(head, role, vec![s, ns], &column));
        }
    }
    let found = identified_by_name_and_unit(head, role, taken);
    match found.as_slice() {
        [index] => Ok(mapped(head, role, vec![*index], &column)),
        [] => Err(missing(head, own, what)),
        [first, ..] if role == ColumnRole::Time => {
            // A date with whole seconds may stand beside the time of the samples.
            let is_clock = |index: usize| head.samples.get(index).is_some_and(ColumnSample::is_clock);
            let other = found.iter().find(|index| is_clock(**index));
            let time = if is_clock(*first) { first } else { other.unwrap_or(first) };
            Ok(mapped(head, role, vec![*time], &column))
        }
        several => Err(RecordError::SeveralColumns {
            path: head.path.to_owned(),
            line: head.line,
            what,
            field: role.name(),
            columns: several.iter().filter_map(|index| head.names.get(*index).cloned()).collect(),
        }),
    }
}

impl MappedColumn {
    /// A scale that follows from the name, not from a map.
    fn with_scale_of_name(self) -> Self {
        let scale_is_given = self.kind == ColumnKind::Date;
        Self { scale_is_given, ..self }
    }
}

/// Columns whose name and unit identify the quantity.
fn identified_by_name_and_unit(head: TableHead<'_>, role: ColumnRole, taken: &[usize]) -> Vec<usize> {
    let (own, _) = role.own();
    let free = || (0..head.names.len()).filter(|index| !taken.contains(index));
    // `/insertion.time_s`, as `stylet convert` writes MCAP.
    let suffix = format!(".{own}");
    let ends: Vec<usize> = free().filter(|index| head.names[*index].ends_with(&suffix)).collect();
    if !ends.is_empty() {
        return ends;
    }
    let kind = |index: usize| head.kinds.get(index).copied().unwrap_or(ColumnKind::Number);
    let with_unit: Vec<usize> = free()
        .filter(|index| match kind(*index) {
            ColumnKind::Date => role == ColumnRole::Time,
            ColumnKind::Number | ColumnKind::Empty => {
                unit_of(head, *index).is_some_and(|unit| unit.dimension == role.dimension())
            }
            ColumnKind::Text => false,
        })
        .collect();
    let by_name: Vec<usize> = with_unit
        .iter()
        .copied()
        .filter(|index| quantity_of(&split_name(&head.names[*index]).base) == Some(role.dimension()))
        .collect();
    let found = if by_name.is_empty() { with_unit.clone() } else { by_name };
    // Columns without any value, and commands beside measurements, are candidates only if all are.
    let found = filter_or_all(found, |index| kind(index) != ColumnKind::Empty);
    let found = filter_or_all(found, |index| !is_commanded(&head.names[index]));
    if let ([index], ColumnRole::Position | ColumnRole::Force) = (found.as_slice(), role) {
        let rival = with_unit
            .iter()
            .copied()
            .find(|other| other != index && is_competing_column(head, role, *index, *other));
        return std::iter::once(*index).chain(rival).collect();
    }
    found
}

/// The columns for which `keep` holds; all if there is none.
fn filter_or_all(columns: Vec<usize>, keep: impl Fn(usize) -> bool) -> Vec<usize> {
    let kept: Vec<usize> = columns.iter().copied().filter(|index| keep(*index)).collect();
    if kept.is_empty() { columns } else { kept }
}

/// Ratio of the ranges of two columns of one quantity from which the wider one may be meant although its name says less.
const COMPETING_RANGE_RATIO: f64 = 3.0;
/// The same for components of a position: the motion is oblique to the axis that the name says.
const OBLIQUE_RANGE_RATIO: f64 = 0.3;

/// Whether another column of the same quantity varies so much that the name alone does not decide.
fn is_competing_column(head: TableHead<'_>, role: ColumnRole, index: usize, other: usize) -> bool {
    let vector = |index: usize| vector_of(&head.names[index]);
    let is_component = vector(index).is_some() && vector(index) == vector(other);
    let factor = if is_component && role == ColumnRole::Position {
        OBLIQUE_RANGE_RATIO
    } else {
        COMPETING_RANGE_RATIO
    };
    let range = |index: usize| head.samples.get(index).map_or(f64::NAN, ColumnSample::range);
    range(other) > factor * range(index)
}

/// Checks that position and force have one clock: in `time_1, force, time_2, position` each follows a time of its own.
///
/// # Errors
/// [`RecordError::TwoClocks`].
pub(crate) fn check_clocks(
    head: TableHead<'_>,
    position: &[usize],
    force: &[usize],
) -> Result<(), RecordError> {
    let clock = |indices: &[usize]| {
        let before = indices.first()?.checked_sub(1)?;
        let sample = head.samples.get(before).filter(|sample| sample.is_clock())?;
        let name = head.names.get(before)?;
        is_time(name).then_some((sample, name))
    };
    match (clock(position), clock(force)) {
        (Some((of_position, position)), Some((of_force, force)))
            if position != force && of_position.differs_as_clock(of_force) =>
        {
            Err(RecordError::TwoClocks {
                path: head.path.to_owned(),
                line: head.line,
                force: force.clone(),
                position: position.clone(),
            })
        }
        _ => Ok(()),
    }
}

/// Header name of the torque of a joint (0-based); names count from one.
pub(crate) fn joint_torque_name(joint: usize) -> String {
    format!("joint_torque_{}_nm", joint + 1)
}

/// The most similar existing name, if any is close.
fn most_similar_name(wanted: &str, names: &[String]) -> Option<String> {
    let target = wanted.to_lowercase();
    let stem = target.rsplit_once('_').map_or(target.as_str(), |(stem, _unit)| stem);
    let max_distance = (target.chars().count() / 3).max(2);
    names
        .iter()
        .filter(|name| !name.is_empty())
        .map(|name| {
            let candidate = name.to_lowercase();
            let same_quantity =
                candidate.starts_with(stem) || (candidate.len() >= 3 && stem.starts_with(&candidate));
            let distance = edit_distance(&target, &candidate).min(1 + edit_distance(stem, &candidate));
            (if same_quantity { distance.min(max_distance) } else { distance }, name)
        })
        .filter(|(distance, _)| *distance <= max_distance)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name.clone())
}

/// Levenshtein distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(line: &str) -> Vec<String> {
        line.split(',').map(str::to_owned).collect()
    }

    #[test]
    fn a_similar_name_is_suggested_and_a_different_one_is_not() {
        assert_eq!(most_similar_name("time_s", &names("Time_s,fz")), Some("Time_s".to_owned()));
        assert_eq!(most_similar_name("time_s", &names("timestamp_ns,fz")), Some("timestamp_ns".to_owned()));
        assert_eq!(most_similar_name("position_m", &names("t,pos,fz")), Some("pos".to_owned()));
        assert_eq!(most_similar_name("force_n", &names("fz,px,forse_n")), Some("forse_n".to_owned()));
        assert_eq!(most_similar_name("force_n", &names("fz,px,py")), None);
    }

    #[test]
    fn edit_distance_counts_insertions_deletions_and_substitutions() {
        assert_eq!(edit_distance("force", "forse"), 1);
        assert_eq!(edit_distance("time", ""), 4);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }
}
