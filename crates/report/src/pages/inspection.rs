//! The page of inspected files: contents and obstacles.

use crate::chart_model::{Chart, Series};
use crate::page_model::{Cell, Page, Section, Status, Table, Tile};
use crate::palette::Colour;
use stylet_record::inspect::{ColumnKind, Inspection};
use stylet_stats::number_format::significant;

/// The page of one or more inspected files.
#[must_use]
pub fn page(inspections: &[Inspection]) -> Page {
    let title = match inspections {
        [one] => format!("Inspection: {}", name(one)),
        several => format!("Inspection of {} files", several.len()),
    };
    let mut page = Page::new(title).fact("stylet", env!("CARGO_PKG_VERSION"));
    for inspection in inspections {
        page = page.section(section(inspection));
    }
    page
}

fn name(inspection: &Inspection) -> String {
    let path = &inspection.path;
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

fn section(inspection: &Inspection) -> Section {
    let obstacles = inspection.obstacles().count();
    let mut tiles = vec![
        Tile::new("Rows", inspection.rows.to_string(), inspection.format.clone()),
        Tile::new(
            "Obstacles",
            obstacles.to_string(),
            if obstacles == 0 { "the file is read as it is" } else { "see below" },
        )
        .status(if obstacles == 0 { Status::Good } else { Status::Bad }),
    ];
    if let Some(sampling) = &inspection.sampling {
        tiles.push(Tile::new(
            "Rate",
            format!("{} Hz", significant(sampling.rate_hz, 3)),
            format!("{} samples over {} s", sampling.samples, significant(sampling.duration_s, 4)),
        ));
    }
    if let Some(text) = &inspection.text {
        tiles.push(Tile::new(
            "Text",
            text.encoding.clone(),
            format!("{}, decimal sign \"{}\"", text.delimiter, text.decimal),
        ));
    }
    let mut section = Section::new(name(inspection)).tiles(tiles);
    if !inspection.findings.is_empty() {
        let rows = inspection.findings.iter().map(|finding| {
            let (word, status) =
                if finding.obstacle { ("obstacle", Status::Bad) } else { ("remark", Status::Plain) };
            vec![Cell::text(word).status(status), Cell::text(finding.message.clone())]
        });
        section = section.table(Table::new("Findings", &["", "finding"], rows.collect()));
    }
    let curves = &inspection.curves;
    for (title, unit, y, colour) in [
        ("Force", "N", &curves.force_n, Colour::Blue),
        ("Position", "m", &curves.position_m, Colour::Vermillion),
    ] {
        if !y.is_empty() {
            let series = Series::line(title, colour, curves.time_s.clone(), y.clone());
            section = section.chart(
                Chart::new(title, "time (s)", format!("{} ({unit})", title.to_lowercase()))
                    .with_series(series)
                    .group(name(inspection)),
            );
        }
    }
    let rows = inspection.columns.iter().map(|column| {
        let role = inspection
            .candidates
            .iter()
            .find(|c| c.columns.contains(&column.number))
            .map_or("", |c| c.role.name());
        let range = column.range.map_or_else(String::new, |(low, high)| {
            format!("{} to {}", significant(low, 4), significant(high, 4))
        });
        vec![
            Cell::text(format!("{}", column.number)),
            Cell::text(column.name.clone()),
            Cell::text(column.unit.clone().unwrap_or_default()),
            Cell::text(kind_name(column.kind)),
            Cell::number(range),
            Cell::number(if column.missing == 0 { String::new() } else { column.missing.to_string() }),
            Cell::text(role),
        ]
    });
    let headers = ["column", "name", "unit", "contents", "range", "missing", "used as"];
    section.table(Table::new("Columns", &headers, rows.collect())).code("Column map", inspection.to_ron())
}

/// Name of the contents of a column.
#[must_use]
pub fn kind_name(kind: ColumnKind) -> &'static str {
    match kind {
        ColumnKind::Number => "numbers",
        ColumnKind::Date => "dates",
        ColumnKind::Text => "text",
        ColumnKind::Empty => "empty",
    }
}
