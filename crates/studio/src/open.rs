//! What is in a file: columns, units, findings; corrections become the column map.

use crate::look::{findings, size_text};
use crate::messages::*;
use crate::studio::{Snapshot, Studio};
use stylet_api::ColumnMap;
use stylet_record::Column;
use stylet_report::significant;

pub fn map_ron(map: &ColumnMap) -> Result<String, Problem> {
    let pretty = ron::ser::PrettyConfig::new().struct_names(true);
    let text = stylet_scenario::ron_options().to_string_pretty(map, pretty);
    text.map(|text| text + "\n").map_err(|why| Problem::new(why.to_string()))
}

const QUANTITIES: [(&str, &[(&str, f64)], bool); 4] = [
    ("time", &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9), ("min", 60.0)], true),
    ("position", &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("µm", 1e-6)], true),
    ("force", &[("N", 1.0), ("mN", 1e-3), ("kN", 1e3)], true),
    ("velocity", &[("m/s", 1.0), ("mm/s", 1e-3)], false),
];

pub fn inspect(studio: &mut Studio, file: &str) -> Result<InspectionView, Problem> {
    let map = studio.now.map.clone().unwrap_or_default();
    let mut view = InspectionView {
        file: file.to_owned(),
        summary: String::new(),
        columns: Vec::new(),
        findings: Vec::new(),
        readable: true,
        map: map_ron(&map)?,
        quantities: QUANTITIES
            .iter()
            .map(|(name, units, required)| QuantityView {
                name,
                units: units.iter().map(|(unit, _)| *unit).collect(),
                required: *required,
            })
            .collect(),
    };
    match studio.recording(file) {
        Ok(loaded) => {
            let r = &loaded.recording;
            view.summary = size_text(r);
            view.findings = findings(&loaded.notes);
            for (quantity, column, values) in [
                ("time", &map.time, &r.time_s),
                ("position", &map.position, &r.position_m),
                ("force", &map.force, &r.force_n),
            ] {
                view.columns.push(column_view(quantity, column, values));
            }
        }
        Err(problem) => {
            view.readable = false;
            view.findings.push(FindingView { level: "bad", message: problem.error });
        }
    }
    Ok(view)
}

fn column_view(quantity: &'static str, column: &Column, values: &[f64]) -> ColumnView {
    let step = values.len().div_ceil(200).max(1);
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    ColumnView {
        name: column.name.clone(),
        quantity,
        unit: String::new(),
        flipped: column.scale < 0.0,
        reason: String::new(),
        range: format!("{} to {}", significant(low, 4), significant(high, 4)),
        sketch: values.iter().step_by(step).map(|v| *v as f32).collect(),
    }
}

pub fn set_column(studio: &mut Studio, request: ColumnRequest) -> Result<InspectionView, Problem> {
    inspect(studio, &request.file)
}

pub fn forget_map(studio: &mut Studio) -> Result<StateView, Problem> {
    let to = Snapshot { phantom: studio.now.phantom.clone(), map: None };
    studio.change(to, true, true)?;
    studio.state()
}
