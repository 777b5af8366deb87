//! What is in a file: columns, units, findings; corrections become the column map.

use crate::look::{findings, size_text};
use crate::messages::*;
use crate::studio::{Snapshot, Studio};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;
use stylet_api::ColumnMap;
use stylet_record::Column;
use stylet_report::significant;

/// Rows of a file that are looked at for the small plots.
const SKETCH_ROWS: u64 = 160;
/// Bytes that are read for one of these rows.
const ROW_BYTES: u64 = 4096;
/// Columns that are shown.
const MAX_COLUMNS: usize = 60;

/// A unit and its size in SI units.
type Unit = (&'static str, f64);
const QUANTITIES: [(&str, &[Unit], bool); 4] = [
    ("time", &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9), ("min", 60.0)], true),
    ("position", &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("µm", 1e-6), ("inch", 0.0254)], true),
    ("force", &[("N", 1.0), ("mN", 1e-3), ("gram-force", 9.80665e-3), ("kN", 1e3)], true),
    ("velocity", &[("m/s", 1.0), ("mm/s", 1e-3)], false),
];

pub fn map_ron(map: &ColumnMap) -> Result<String, Problem> {
    let pretty = ron::ser::PrettyConfig::new().struct_names(true);
    let text = stylet_scenario::ron_options().to_string_pretty(map, pretty);
    text.map(|text| text + "\n").map_err(|why| Problem::new(why.to_string()))
}

fn column<'a>(map: &'a ColumnMap, quantity: &str) -> Option<&'a Column> {
    match quantity {
        "time" => Some(&map.time),
        "position" => Some(&map.position),
        "force" => Some(&map.force),
        _ => map.velocity.as_ref(),
    }
}

/// SI units per unit of the file.
fn scale(column: &Column) -> f64 {
    serde_json::to_value(column).ok().and_then(|column| column["scale"].as_f64()).unwrap_or(1.0)
}

fn set(map: &mut ColumnMap, quantity: &str, column: Option<Column>) {
    let required = |column: Option<Column>| column.unwrap_or_else(|| Column::si(""));
    match quantity {
        "time" => map.time = required(column),
        "position" => map.position = required(column),
        "force" => map.force = required(column),
        _ => map.velocity = column,
    }
}

/// Names of the columns and some values of each.
struct Sample {
    names: Vec<String>,
    values: Vec<Vec<f32>>,
}

/// The header and evenly spaced rows of a text; empty for other files.
fn sample(path: &Path) -> Option<Sample> {
    let mut file = File::open(path).ok()?;
    let size = file.metadata().ok()?.len();
    let mut piece = |from: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(from)).ok()?;
        file.by_ref().take(ROW_BYTES).read_to_end(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    };
    let head = piece(0)?;
    let header = head.trim_start_matches('\u{feff}').lines().find(|line| !line.trim().is_empty())?.to_owned();
    let delimiter = [',', ';', '\t', '|'].into_iter().max_by_key(|d| header.matches(*d).count())?;
    let cells = |line: &str| -> Vec<String> {
        line.split(delimiter).map(|cell| cell.trim().trim_matches('"').trim().to_owned()).collect()
    };
    let names: Vec<String> = cells(&header).into_iter().take(MAX_COLUMNS).collect();
    if head.contains('\0') || names.len() < 2 {
        return None;
    }
    let mut values = vec![Vec::new(); names.len()];
    for k in 0..SKETCH_ROWS {
        // The first line of a piece is cut, or the header.
        let text = piece(k * size / SKETCH_ROWS)?;
        let Some(row) = text.lines().nth(1) else { continue };
        let row = cells(row);
        for (column, cell) in values.iter_mut().zip(row.iter().chain(std::iter::repeat(&String::new()))) {
            column.push(cell.replace(',', ".").parse().unwrap_or(f32::NAN));
        }
    }
    Some(Sample { names, values })
}

/// What is in a file, as the map says.
pub fn inspect(studio: &mut Studio, file: &str) -> Result<InspectionView, Problem> {
    let map = studio.now.map.clone().unwrap_or_default();
    let sample = sample(&studio.workspace.data(file)?);
    let quantities = QUANTITIES.iter().map(|(name, units, required)| QuantityView {
        name,
        units: units.iter().map(|(unit, _)| *unit).collect(),
        required: *required,
    });
    let mut view = InspectionView {
        file: file.to_owned(),
        summary: String::new(),
        columns: sample.map(|sample| columns(&map, sample)).unwrap_or_default(),
        findings: Vec::new(),
        readable: true,
        map: map_ron(&map)?,
        quantities: quantities.collect(),
    };
    match studio.recording(file) {
        Ok(loaded) => {
            view.summary = size_text(&loaded.recording);
            view.findings = findings(&loaded.notes);
        }
        Err(problem) => {
            view.readable = false;
            view.findings.push(FindingView { level: "bad", message: problem.error });
        }
    }
    Ok(view)
}

fn columns(map: &ColumnMap, sample: Sample) -> Vec<ColumnView> {
    let view = |(name, sketch): (String, Vec<f32>)| {
        let used = QUANTITIES.iter().find_map(|(quantity, units, _)| {
            let column = column(map, quantity).filter(|c| c.name == name)?;
            Some((*quantity, *units, column))
        });
        let finite = sketch.iter().copied().filter(|v| v.is_finite()).map(f64::from);
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        ColumnView {
            quantity: used.map_or("", |(quantity, _, _)| quantity),
            unit: used.map_or(String::new(), |(_, units, column)| {
                let known = units.iter().find(|(_, size)| *size == scale(column).abs());
                known.map_or(format!("× {}", scale(column).abs()), |(unit, _)| (*unit).to_owned())
            }),
            flipped: used.is_some_and(|(_, _, column)| scale(column) < 0.0),
            reason: String::new(),
            range: format!("{} to {}", significant(low, 4), significant(high, 4)),
            name,
            sketch,
        }
    };
    sample.names.into_iter().zip(sample.values).map(view).collect()
}

/// Takes a correction into the map.
pub fn set_column(studio: &mut Studio, request: ColumnRequest) -> Result<InspectionView, Problem> {
    let mut map = studio.now.map.clone().unwrap_or_default();
    for (quantity, units, _) in QUANTITIES {
        if quantity == request.quantity {
            let size = units.iter().find(|(unit, _)| *unit == request.unit).map_or(1.0, |(_, size)| *size);
            let scale = if request.flipped { -size } else { size };
            set(&mut map, quantity, Some(Column::scaled(request.column.clone(), scale)));
        } else if column(&map, quantity).is_some_and(|c| c.name == request.column) {
            set(&mut map, quantity, None);
        }
    }
    studio.change(Snapshot { map: Some(map), ..studio.now.clone() }, true, true)?;
    inspect(studio, &request.file)
}

/// Goes back to Stylet's own names and units.
pub fn forget_map(studio: &mut Studio) -> Result<StateView, Problem> {
    studio.change(Snapshot { map: None, ..studio.now.clone() }, true, true)?;
    studio.state()
}
