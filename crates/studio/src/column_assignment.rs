//! Contents of a file: columns, units, findings of `stylet inspect`; corrections by the user become the column map.

use crate::messages::*;
use crate::online_algorithm::{finding, findings, size_text};
use crate::studio::{Snapshot, Studio};
use serde_json::{Value, json};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;
use stylet_api::ColumnMap;
use stylet_record::Column;
use stylet_record::inspect::{
    Candidate, InspectOptions, InspectedColumn, Inspection, inspect as inspect_file,
};
use stylet_report::significant;

/// Number of rows sampled for the small plots.
const PLOT_SAMPLE_ROWS: u64 = 160;
/// Bytes that are read for one of these rows.
const ROW_BYTES: u64 = 4096;
/// Columns that are shown.
const MAX_COLUMNS: usize = 60;
/// Relative difference below which a scale matches a unit.
const SAME_SCALE: f64 = 1e-9;

/// A unit and its size in SI units.
type Unit = (&'static str, f64);
const QUANTITIES: [(&str, &[Unit]); 4] = [
    ("time", &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9), ("min", 60.0)]),
    ("position", &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("µm", 1e-6), ("inch", 0.0254)]),
    ("force", &[("N", 1.0), ("mN", 1e-3), ("gram-force", 9.80665e-3), ("kN", 1e3)]),
    ("velocity", &[("m/s", 1.0), ("mm/s", 1e-3)]),
];

fn column<'a>(map: &'a ColumnMap, quantity: &str) -> Option<&'a Column> {
    match quantity {
        "time" => Some(&map.time),
        "position" => Some(&map.position),
        "force" => Some(&map.force),
        _ => map.velocity.as_ref(),
    }
}

fn set(map: &mut ColumnMap, quantity: &str, column: Option<Column>) {
    match quantity {
        "time" => map.time = column.unwrap_or_default(),
        "position" => map.position = column.unwrap_or_default(),
        "force" => map.force = column.unwrap_or_default(),
        _ => map.velocity = column,
    }
}

/// Some values of each column of a text, from evenly spaced rows; `None` for other files and for texts with other columns.
fn sample_columns(path: &Path, columns: usize) -> Option<Vec<Vec<f64>>> {
    let mut file = File::open(path).ok()?;
    let size = file.metadata().ok()?.len();
    let mut piece = |from: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(from)).ok()?;
        file.by_ref().take(ROW_BYTES).read_to_end(&mut bytes).ok()?;
        String::from_utf8(bytes).ok().or_else(|| Some(String::new()))
    };
    let cells = |row: &str, delimiter: char| {
        row.split(delimiter).map(|c| c.trim().replace(',', ".")).collect::<Vec<_>>()
    };
    let mut values = vec![Vec::new(); columns];
    for k in 0..PLOT_SAMPLE_ROWS {
        // The first line of a piece is truncated, or is the header.
        let text = piece(k * size / PLOT_SAMPLE_ROWS)?;
        let Some(row) = text.lines().nth(1) else { continue };
        let split = [';', '\t', '|', ',', ' '].map(|d| cells(row, d));
        let Some(row) = split.iter().find(|row| row.len() == columns) else { continue };
        for (column, cell) in values.iter_mut().zip(row) {
            column.push(cell.parse().unwrap_or(f64::NAN));
        }
    }
    values.first().is_some_and(|column| column.len() > 1).then_some(values)
}

/// Contents of a file under the present map.
pub fn inspect(studio: &mut Studio, file: &str) -> Result<Value, Problem> {
    let path = studio.workspace.data(file)?;
    let options = InspectOptions { columns: studio.now.map.clone() };
    let found = inspect_file(&path, &options)?;
    let map = studio.now.map.clone().unwrap_or_else(|| found.map.clone());
    let quantities = QUANTITIES.iter().map(|(name, units)| {
        json!({ "name": name, "units": units.iter().map(|(unit, _)| unit).collect::<Vec<_>>() })
    });
    let mut remarks: Vec<_> = found.findings.iter().map(|f| finding(f.obstacle, &f.message)).collect();
    let read = studio.recording(file);
    let size = match &read {
        Ok(loaded) => {
            remarks.retain(|f| f.level != "bad");
            remarks.extend(findings(&loaded.notes));
            remarks.dedup_by(|a, b| a.message == b.message);
            size_text(&loaded.recording)
        }
        Err(problem) => {
            if remarks.iter().all(|f| f.level != "bad") {
                remarks.insert(0, finding(true, &problem.error));
            }
            format!("{} rows", found.rows)
        }
    };
    Ok(json!({
        "file": file,
        "summary": format!("{}, {size}", found.format),
        "columns": columns(&map, &found, &path),
        "findings": remarks,
        "readable": read.is_ok(),
        "map": map.to_ron(),
        "quantities": quantities.collect::<Value>(),
    }))
}

/// The entry of a map for a column of the file.
fn is_column(mapped: &Column, candidate: Option<&Candidate>, number: usize, name: &str) -> bool {
    match mapped.is_open() {
        true => candidate.is_some_and(|c| c.columns.contains(&number)),
        false => {
            mapped.column == Some(number)
                || mapped.columns.contains(&number)
                || mapped.name == name
                || mapped.names.iter().any(|n| n == name)
        }
    }
}

fn columns(map: &ColumnMap, found: &Inspection, path: &Path) -> Value {
    let sample_columns = sample_columns(path, found.columns.len());
    let view = |c: &InspectedColumn| {
        let candidate = |quantity: &str| found.candidates.iter().find(|k| k.role.name() == quantity);
        let used = QUANTITIES.iter().find_map(|(quantity, units)| {
            let candidate = candidate(quantity);
            let mapped = column(map, quantity).filter(|m| is_column(m, candidate, c.number, &c.name))?;
            let same = candidate.filter(|k| k.columns.contains(&c.number));
            let scale = mapped.scale.or(same.map(|k| k.scale)).or(c.to_si).unwrap_or(1.0);
            Some((*quantity, *units, scale, same))
        });
        let unit = used.map(|(_, units, scale, _)| {
            let same = |size: f64| (size - scale.abs()).abs() < SAME_SCALE * size;
            let known = units.iter().find(|(_, size)| same(*size));
            known.map_or(format!("× {}", significant(scale.abs(), 4)), |(unit, _)| (*unit).to_owned())
        });
        let range = |(low, high)| format!("{} to {}", significant(low, 4), significant(high, 4));
        json!({
            "name": c.name,
            // Empty when the column is not used.
            "quantity": used.map_or("", |(quantity, ..)| quantity),
            "unit": unit.or_else(|| c.unit.clone()).unwrap_or_default(),
            "flipped": used.is_some_and(|(_, _, scale, _)| scale < 0.0),
            "reason": used.and_then(|(.., candidate)| candidate).map_or("", |k| &k.reason),
            "range": c.range.map_or(String::new(), range),
            "sketch": sample_columns.as_ref().and_then(|s| s.get(c.number.checked_sub(1)?)),
        })
    };
    found.columns.iter().take(MAX_COLUMNS).map(view).collect()
}

/// Adopts the proposed map for a file that cannot be read without one, so that only wrong guesses need a click.
pub fn adopt_proposal(studio: &mut Studio, file: &str) -> Result<(), Problem> {
    if studio.now.map.is_none()
        && studio.recording(file).is_err()
        && let Ok(found) = inspect_file(studio.workspace.data(file)?, &InspectOptions::default())
        && found.map_needed
        && found.map.check().is_ok()
    {
        studio.change(Snapshot { map: Some(found.map), ..studio.now.clone() }, true, true)?;
    }
    Ok(())
}

/// Adds a correction to the map.
pub fn set_column(studio: &mut Studio, request: ColumnRequest) -> Result<Value, Problem> {
    let options = InspectOptions { columns: studio.now.map.clone() };
    let found = inspect_file(studio.workspace.data(&request.file)?, &options);
    let found = found?;
    let gone = || Problem::new(format!("the file has no column {:?}", request.column));
    let in_file = found.columns.iter().find(|c| c.name == request.column).ok_or_else(gone)?;
    let (number, of_file) = (in_file.number, in_file.to_si);
    let named = found.text.as_ref().is_none_or(|text| text.names_line.is_some());
    let mut map = studio.now.map.clone().unwrap_or_else(|| found.map.clone());
    for (quantity, units) in QUANTITIES {
        let candidate = found.candidates.iter().find(|k| k.role.name() == quantity);
        if quantity == request.quantity {
            let given = units.iter().find(|(unit, _)| *unit == request.unit).map(|(_, size)| *size);
            // Without a unit, the unit of the file is used.
            let scale = match request.flipped {
                true => Some(-given.or(of_file).unwrap_or(1.0)),
                false => given,
            };
            let chosen = match named {
                true => Column { name: request.column.clone(), scale, ..Column::default() },
                false => Column { column: Some(number), scale, ..Column::default() },
            };
            set(&mut map, quantity, Some(chosen));
        } else if column(&map, quantity).is_some_and(|m| is_column(m, candidate, number, &request.column)) {
            set(&mut map, quantity, None);
        }
    }
    studio.change(Snapshot { map: Some(map), ..studio.now.clone() }, true, true)?;
    inspect(studio, &request.file)
}

/// Adds the sampling rate of a file without usable times to the map.
pub fn set_rate(studio: &mut Studio, request: RateRequest) -> Result<Value, Problem> {
    let path = studio.workspace.data(&request.file)?;
    let options = InspectOptions { columns: studio.now.map.clone() };
    let mut map = studio.now.map.clone().map_or_else(|| inspect_file(path, &options).map(|f| f.map), Ok)?;
    (map.rate_hz, map.time.scale) = (Some(request.rate_hz), None);
    map.check()?;
    studio.change(Snapshot { map: Some(map), ..studio.now.clone() }, true, true)?;
    inspect(studio, &request.file)
}

/// Resets the map to the automatic assignment.
pub fn reset_map(studio: &mut Studio) -> Result<Value, Problem> {
    studio.change(Snapshot { map: None, ..studio.now.clone() }, true, true)?;
    studio.state()
}
