//! Columns for time, position and force: as the readers find them, otherwise as suggested by contents and magnitudes.

use super::magnitude::{EPOCH_S, epoch_unit, is_implausible, may_be_days, propose_units};
use super::scan::{ColumnScan, Scan};
use super::{Candidate, Role, UnitProposal};
use crate::column_map::{Column, ColumnMap};
use crate::columns::{ColumnRole, MappedColumn, Parts, TableHead, check_clocks, find_role, unit_of};
use crate::error::RecordError;
use crate::insertion_axis::project;
use crate::text::layout::ColumnKind;
use crate::text::rows::RowsRead;
use crate::time_order::MIN_SAMPLE_NUMBERS;
use crate::units::{Dimension, is_commanded, is_other_quantity, quantity_of, split_name, vector_of};

/// Share of the variance from which one of three components is used instead of all.
const MAIN_COMPONENT_SHARE: f64 = 0.99;

/// The columns of a recording with the conversion of each row.
pub(super) struct ChosenColumns {
    pub candidates: Vec<Candidate>,
    pub map: ColumnMap,
    pub map_needed: bool,
    /// Errors that the readers would report about the columns.
    pub errors: Vec<(Role, RecordError)>,
    time: Option<ValueSource>,
    position: Option<ValueSource>,
    force: Option<ValueSource>,
    rate_hz: Option<f64>,
    counts_samples: bool,
}

/// Where the values of a quantity come from.
#[derive(Debug, Clone)]
struct ValueSource {
    indices: Vec<usize>,
    scale: f64,
    offset: f64,
    axis: [f64; 3],
}

impl ValueSource {
    fn value(&self, row: &[f64]) -> f64 {
        let part =
            |k: usize| self.indices.get(k).and_then(|index| row.get(*index)).copied().unwrap_or(f64::NAN);
        let raw = match self.indices.len() {
            2 => part(0) + part(1) / 1e9,
            3 => project([&vec![part(0)], &vec![part(1)], &vec![part(2)]], self.axis)
                .first()
                .copied()
                .unwrap_or(f64::NAN),
            _ => part(0),
        };
        self.scale * raw + self.offset
    }
}

impl ChosenColumns {
    /// Time, position and force of a row in SI units; NaN for what the file lacks.
    pub(super) fn values(&self, row: &[f64], number: usize) -> [f64; 3] {
        let of = |source: &Option<ValueSource>| source.as_ref().map_or(f64::NAN, |source| source.value(row));
        let time = match (&self.time, self.rate_hz) {
            (Some(source), _) => source.value(row),
            (None, rate) => number as f64 / rate.unwrap_or(1.0),
        };
        let (position, force) = (of(&self.position), of(&self.force));
        // A curve of one quantity is worth a plot, too.
        [
            time,
            if self.position.is_none() { 0.0 } else { position },
            if self.force.is_none() { 0.0 } else { force },
        ]
    }

    /// Seconds per unit of the time.
    pub(super) fn time_unit_s(&self) -> f64 {
        self.time.as_ref().map_or(1.0, |time| time.scale)
    }

    pub(super) fn has_time(&self) -> bool {
        self.time.is_some() || self.rate_hz.is_some()
    }

    pub(super) fn indices(&self, role: Role) -> &[usize] {
        let source = match role {
            Role::Time => &self.time,
            Role::Position => &self.position,
            Role::Force => &self.force,
            Role::Velocity => &None,
        };
        source.as_ref().map_or(&[], |source| source.indices.as_slice())
    }
}

/// Counts of rows with position or force only.
#[derive(Debug, Default)]
pub(super) struct Alternation {
    position_alone: usize,
    force_alone: usize,
    both: usize,
}

impl Alternation {
    pub(super) fn push(&mut self, position: f64, force: f64) {
        match (position.is_finite(), force.is_finite()) {
            (true, false) => self.position_alone += 1,
            (false, true) => self.force_alone += 1,
            (true, true) => self.both += 1,
            (false, false) => {}
        }
    }

    /// Whether position and force are in different rows.
    pub(super) fn found(&self) -> bool {
        self.force_alone * 10 > self.both && self.position_alone * 10 > self.both && self.force_alone > 1
    }
}

/// The columns of the topic of the force, and those of other topics; all columns of a file without topics.
pub(super) fn rows_of_topic(names: &[String]) -> Vec<usize> {
    // Columns of other topics are interpolated to the rows of the first one that is read.
    let force = names.iter().position(|name| quantity_of(&split_name(name).base) == Some(Dimension::Force));
    force
        .into_iter()
        .chain((0..names.len()).filter(|at| Some(*at) != force))
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect()
}

const ROLES: [Role; 3] = [Role::Time, Role::Position, Role::Force];

fn column_role(role: Role) -> ColumnRole {
    match role {
        Role::Time => ColumnRole::Time,
        Role::Position => ColumnRole::Position,
        Role::Force => ColumnRole::Force,
        Role::Velocity => ColumnRole::Velocity,
    }
}

/// Chooses the columns.
pub(super) fn choose_columns(
    head: TableHead<'_>,
    scan: &Scan,
    read: &RowsRead,
    map: Option<&ColumnMap>,
) -> ChosenColumns {
    let open = ColumnMap::open();
    let given = map.unwrap_or(&open);
    let rate_hz = given.rate_hz;
    let mut chosen = ChosenColumns {
        candidates: Vec::new(),
        map: map.cloned().unwrap_or_else(ColumnMap::open),
        map_needed: false,
        errors: Vec::new(),
        time: None,
        position: None,
        force: None,
        rate_hz,
        counts_samples: false,
    };
    // Of recordings side by side, the first one is suggested.
    let first_block = repeated_after(head.names);
    let mut taken: Vec<usize> = (first_block..head.names.len()).collect();
    for role in ROLES {
        let column = match role {
            Role::Time => &given.time,
            Role::Position => &given.position,
            _ => &given.force,
        };
        if column.file.is_some() || (role == Role::Time && rate_hz.is_some() && column.is_open()) {
            continue;
        }
        let (found, certain) = match find_role(head, column_role(role), column) {
            Ok(found) => (Some(found), true),
            Err(error) => {
                let found = suggest(head, scan, role, &taken, column_role(role));
                chosen.errors.push((role, error));
                (found, false)
            }
        };
        let Some(found) = found else { continue };
        taken.extend(&found.indices);
        chosen.add(head, (scan, read), role, found, certain);
    }
    if let Err(error) = check_clocks(head, chosen.indices(Role::Position), chosen.indices(Role::Force)) {
        chosen.errors.push((Role::Time, error));
        // Its own time is in another file.
        chosen.map.position = Column::default();
    }
    chosen.map_needed = !chosen.errors.is_empty();
    chosen
}

/// Number of columns after which all names are repeated, as of several recordings side by side; else the number of columns.
fn repeated_after(names: &[String]) -> usize {
    let all = names.len();
    let repeats = |count: &usize| {
        all.is_multiple_of(*count) && names.iter().zip(&names[*count..]).all(|(name, next)| name == next)
    };
    (2..all).find(repeats).unwrap_or(all)
}

impl ChosenColumns {
    fn add(
        &mut self,
        head: TableHead<'_>,
        (scan, read): (&Scan, &RowsRead),
        role: Role,
        mut found: MappedColumn,
        certain: bool,
    ) {
        let first = found.indices.first().copied().unwrap_or(0);
        let Some(column) = scan.columns.get(first) else { return };
        let unit = unit_of(head, first).filter(|unit| unit.dimension == role.dimension());
        let origin = read.origins.get(first).copied().flatten();
        let magnitude = self.magnitude(scan, role, &found, column);
        let mut proposals: Vec<UnitProposal> = Vec::new();
        let mut reason = match (certain, unit) {
            (true, _) if found.scale_is_given => "the column map".to_owned(),
            (true, _) => "name and unit".to_owned(),
            (false, Some(unit)) => format!("by the unit {}", unit.symbol),
            (false, None) => "by its values".to_owned(),
        };
        let name_of = |name: &str| quantity_of(&split_name(name).base) == Some(role.dimension());
        if !certain && head.named && head.names.get(first).is_some_and(|name| name_of(name)) {
            reason = "by its name".to_owned();
        }
        let first_time = origin.map_or(column.first, |x| x as f64);
        let epoch = epoch_unit(first_time * found.scale)
            .filter(|_| role == Role::Time && found.kind == ColumnKind::Number);
        let counts = role == Role::Time && column.values >= MIN_SAMPLE_NUMBERS && column.is_counter();
        if counts && !found.scale_is_given {
            reason = "it counts the samples: rate_hz, the samples per second, must be filled in".to_owned();
            self.counts_samples = true;
        } else if found.kind == ColumnKind::Date
            || found.parts == Parts::SecondsNanoseconds
            || found.scale_is_given
        {
        } else if let Some((unit, scale)) = epoch {
            found.scale = scale;
            reason.push_str(&format!("; it begins at {first_time:e}, {unit} since 1970"));
            proposals.push(UnitProposal { unit: unit.to_owned(), scale, value: first_time });
        } else if unit.is_none() || is_implausible(role.dimension(), magnitude * found.scale) {
            let all = propose_units(role.dimension(), magnitude);
            if is_implausible(role.dimension(), magnitude * found.scale)
                || may_be_days(role.dimension(), magnitude)
            {
                if let Some(best) = all.first() {
                    found.scale = best.scale;
                    reason.push_str(&format!("; the magnitude suggests {}", best.unit));
                }
                proposals = all;
            } else if unit.is_none() && !certain {
                reason.push_str("; no unit is given, SI is assumed");
                proposals = all;
            }
        }
        let kind = found.kind;
        let column_of_map = Column {
            scale: (kind != ColumnKind::Date && found.parts != Parts::SecondsNanoseconds)
                .then_some(found.scale),
            offset: found.offset,
            ..name_or_number(head, &found.indices)
        };
        let slot = match role {
            Role::Time => &mut self.map.time,
            Role::Position => &mut self.map.position,
            _ => &mut self.map.force,
        };
        *slot = column_of_map;
        if role == Role::Time && (self.rate_hz.is_some() || self.counts_samples) {
            slot.scale = None;
        }
        let unit_name = match (kind, proposals.iter().find(|p| p.scale == found.scale), unit) {
            (ColumnKind::Date, _, _) => "date".to_owned(),
            (_, Some(proposal), _) => proposal.unit.clone(),
            (_, None, Some(unit)) => unit.symbol.to_owned(),
            _ if found.scale == 1.0 => si_symbol(role).to_owned(),
            _ => format!("{} {}", found.scale, si_symbol(role)),
        };
        self.candidates.push(Candidate {
            role,
            columns: found.indices.iter().map(|index| index + 1).collect(),
            names: found.indices.iter().filter_map(|index| head.names.get(*index).cloned()).collect(),
            unit: unit_name,
            scale: found.scale,
            certain: certain && proposals.is_empty() && !(role == Role::Time && self.counts_samples),
            reason,
            proposals,
        });
        let rate = if role == Role::Time { self.rate_hz } else { None };
        let axis = self.map.axis.map_or_else(|| main_axis(scan, &found.indices), |(x, y, z)| [x, y, z]);
        let source = Some(ValueSource {
            indices: found.indices,
            scale: rate.map_or(found.scale, |rate| 1.0 / rate),
            offset: found.offset,
            axis,
        });
        match role {
            Role::Time => self.time = source,
            Role::Position => self.position = source,
            _ => self.force = source,
        }
    }

    /// The magnitude from which the unit is checked, in the unit of the file.
    fn magnitude(&self, scan: &Scan, role: Role, found: &MappedColumn, column: &ColumnScan) -> f64 {
        let all = || found.indices.iter().filter_map(|index| scan.columns.get(*index));
        match role {
            Role::Time => column.range() / (column.up.max(1)) as f64,
            Role::Position => all().map(|c| c.range().powi(2)).sum::<f64>().sqrt(),
            _ => all().map(|c| c.max.abs().max(c.min.abs())).fold(0.0, f64::max),
        }
    }
}

/// The SI unit of a quantity.
pub(super) fn si_symbol(role: Role) -> &'static str {
    match role {
        Role::Time => "s",
        Role::Position => "m",
        Role::Force => "N",
        Role::Velocity => "m/s",
    }
}

/// A rough axis for the plot: standard deviations of the components; the reader fits it.
fn main_axis(scan: &Scan, indices: &[usize]) -> [f64; 3] {
    let sd = |k: usize| {
        indices
            .get(k)
            .and_then(|index| scan.columns.get(*index))
            .map_or(0.0, |c| c.variance().sqrt() * (c.max + c.min - 2.0 * c.first).signum())
    };
    [sd(0), sd(1), sd(2)]
}

/// Names where they are unique, else numbers.
fn name_or_number(head: TableHead<'_>, indices: &[usize]) -> Column {
    let names: Vec<String> = indices.iter().filter_map(|index| head.names.get(*index).cloned()).collect();
    let unique =
        |name: &String| !name.trim().is_empty() && head.names.iter().filter(|n| *n == name).count() == 1;
    let numbers: Vec<usize> = indices.iter().map(|index| index + 1).collect();
    match (head.named && names.iter().all(unique), names.as_slice(), numbers.as_slice()) {
        (true, [name], _) => Column::named(name.clone()),
        (true, _, _) => Column { names, ..Column::default() },
        (false, _, [number]) => Column { column: Some(*number), ..Column::default() },
        (false, _, _) => Column { columns: numbers, ..Column::default() },
    }
}

/// A column suggested by its contents.
fn suggest(
    head: TableHead<'_>,
    scan: &Scan,
    role: Role,
    taken: &[usize],
    column_role: ColumnRole,
) -> Option<MappedColumn> {
    let free: Vec<usize> = (0..scan.columns.len())
        .filter(|at| {
            !taken.contains(at)
                && head.kinds.get(*at) != Some(&ColumnKind::Text)
                && scan.columns[*at].values > 1
        })
        .collect();
    let indices = match role {
        Role::Time => time_columns(head, scan, &free)?,
        _ => signal_columns(head, scan, role, &free)?,
    };
    let parts = match indices.len() {
        2 => Parts::SecondsNanoseconds,
        3 => Parts::Components,
        _ => Parts::Single,
    };
    let first = *indices.first()?;
    let unit = unit_of(head, first).filter(|unit| unit.dimension == role.dimension());
    let kind = head.kinds.get(first).copied().unwrap_or(ColumnKind::Number);
    Some(MappedColumn {
        role: column_role,
        parts,
        name: head.names.get(first).cloned().unwrap_or_default(),
        scale: if kind == ColumnKind::Date || parts == Parts::SecondsNanoseconds {
            1.0
        } else {
            unit.map_or(1.0, |unit| unit.to_si)
        },
        offset: 0.0,
        kind,
        scale_is_given: false,
        indices,
    })
}

fn time_columns(head: TableHead<'_>, scan: &Scan, free: &[usize]) -> Option<Vec<usize>> {
    // Seconds since 1970 and nanoseconds, as ROS prints them.
    let seconds = free.iter().copied().find(|at| {
        let (s, Some(ns)) = (&scan.columns[*at], scan.columns.get(at + 1)) else { return false };
        free.contains(&(at + 1))
            && s.down == 0
            && (EPOCH_S.0..EPOCH_S.1).contains(&s.first)
            && ns.min >= 0.0
            && ns.max < 1e9
            && ns.max > 1e6
    });
    if let Some(at) = seconds {
        return Some(vec![at, at + 1]);
    }
    let named = free.iter().copied().find(|at| {
        let quantity = quantity_of(&split_name(&head.names[*at]).base);
        head.named && quantity == Some(Dimension::Time) && scan.columns[*at].is_clock()
    });
    // A motion at constant speed increases, too: without names the first such column is the time, if it is even.
    named
        .or_else(|| {
            let other = |at: &usize| head.named && quantity_of(&split_name(&head.names[*at]).base).is_some();
            free.iter().copied().find(|at| !other(at) && scan.columns[*at].is_clock())
        })
        .map(|at| vec![at])
}

fn signal_columns(head: TableHead<'_>, scan: &Scan, role: Role, free: &[usize]) -> Option<Vec<usize>> {
    let moving: Vec<usize> = free
        .iter()
        .copied()
        // A counter of messages or rows is not a motion.
        .filter(|at| !scan.columns[*at].is_constant() && !scan.columns[*at].is_counter())
        .filter(|at| !is_other_quantity(&head.names[*at]))
        .collect();
    let of_quantity = |at: &usize| {
        let by_unit = unit_of(head, *at).map(|unit| unit.dimension);
        by_unit == Some(role.dimension())
            || (by_unit.is_none()
                && quantity_of(&split_name(&head.names[*at]).base) == Some(role.dimension()))
    };
    let named: Vec<usize> = moving.iter().copied().filter(of_quantity).collect();
    let known_otherwise = |at: &usize| {
        head.named && quantity_of(&split_name(&head.names[*at]).base).is_some_and(|q| q != role.dimension())
    };
    let measured: Vec<usize> = named.iter().copied().filter(|at| !is_commanded(&head.names[*at])).collect();
    let named = if measured.is_empty() { named } else { measured };
    let is_named = !named.is_empty();
    let candidates = if named.is_empty() {
        moving.into_iter().filter(|at| !known_otherwise(at) && unit_of(head, *at).is_none()).collect()
    } else {
        named
    };
    let translation = (role == Role::Position && !is_named).then(|| translation(head, scan, free)).flatten();
    if let Some(parts) = translation.or_else(|| components(head, free, &candidates)) {
        let variances: Vec<f64> = parts.iter().map(|at| scan.columns[*at].variance()).collect();
        let total: f64 = variances.iter().sum();
        let (main, most) = variances.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        // A force is projected only where the motion is oblique to its sensor; its main component is the first guess.
        return Some(match most >= MAIN_COMPONENT_SHARE * total || role == Role::Force {
            true => vec![parts[main]],
            false => parts,
        });
    }
    let by_roughness =
        |a: &usize, b: &usize| scan.columns[*a].roughness().total_cmp(&scan.columns[*b].roughness());
    let range = |at: &usize| scan.columns[*at].range() * unit_of(head, *at).map_or(1.0, |unit| unit.to_si);
    // A motion is smooth, a force noisy; of several forces, the axial one is the largest.
    let best = match role {
        Role::Position => candidates.into_iter().min_by(by_roughness),
        _ if is_named => candidates.into_iter().max_by(|a, b| range(a).total_cmp(&range(b))),
        _ => candidates.into_iter().max_by(by_roughness),
    };
    best.map(|at| vec![at])
}

/// The translation of a pose that is recorded as a homogeneous 4 × 4 matrix, column by column (as libfranka does) or row by row: sixteen columns
/// of one name, four of them 0, 0, 0 and 1.
fn translation(head: TableHead<'_>, scan: &Scan, free: &[usize]) -> Option<Vec<usize>> {
    const ELEMENTS: usize = 16;
    let stem = |at: usize| head.names[at].trim_end_matches(|c: char| !c.is_alphabetic());
    let is_matrix = |at: &usize| {
        head.named
            && (*at..at + ELEMENTS).all(|k| free.contains(&k) && stem(k) == stem(*at))
            && scan.columns[at + ELEMENTS - 1].is_constant_at(1.0)
    };
    // A commanded pose has a longer name, such as `O_T_EE_d`.
    let mut starts: Vec<usize> = free.iter().copied().filter(is_matrix).collect();
    starts.sort_by_key(|at| stem(*at).len());
    starts.into_iter().find_map(|start| {
        let of = |elements: [usize; 3]| elements.map(|k| start + k);
        let (last_by_columns, last_by_rows) = (of([3, 7, 11]), of([12, 13, 14]));
        let are_zero = |part: [usize; 3]| part.iter().all(|at| scan.columns[*at].is_constant_at(0.0));
        let moves = |part: [usize; 3]| part.iter().any(|at| !scan.columns[*at].is_constant());
        [(last_by_columns, last_by_rows), (last_by_rows, last_by_columns)]
            .into_iter()
            .find(|(zero, translation)| are_zero(*zero) && moves(*translation))
            .map(|(_, translation)| translation.to_vec())
    })
}

/// Three columns of one name with x, y, z or three numbers; of six, as of a pose or a wrench, the first three.
fn components(head: TableHead<'_>, free: &[usize], candidates: &[usize]) -> Option<Vec<usize>> {
    candidates.iter().find_map(|first| {
        let of = vector_of(&head.names[*first])?;
        let is_part = |at: &usize| vector_of(&head.names[*at]).as_ref() == Some(&of);
        let mut group: Vec<usize> = free.iter().copied().filter(is_part).collect();
        let is_vector = head.named && matches!(group.len(), 3 | 6);
        group.truncate(3);
        is_vector.then_some(group)
    })
}
