//! The page of a set of specimens, each indented once and held (stress relaxation).

use crate::page_model::{Cell, Page, Section, Table, Tile};
use crate::palette::Colour;
use crate::svg::{Bar, BarChart, FigureOptions, bar_chart};
use stylet_diagnose::Diagnosis;
use stylet_diagnose::repeated_insertions::dataset::Dataset;
use stylet_diagnose::repeated_insertions::indentation_relaxation::SpecimenReport;
use stylet_stats::number_format::significant;

/// The page of the data set `set`, read from `file`.
#[must_use]
pub fn page(set: &Dataset, file: &str, found: &SpecimenReport, d: &Diagnosis) -> Page {
    let tile = |label: &str, value: String, detail: &str| Tile::new(label, value, detail);
    let tiles = vec![
        tile("Specimens", found.used.to_string(), "each indented once and held; parameters per specimen"),
        tile("Punctures", found.punctured.len().to_string(), "specimens with a force drop"),
        tile(
            "End of the hold",
            format!("{:.1} → {:.1} mN", 1e3 * d.gain.rmse_before_n, 1e3 * d.gain.rmse_after_n),
            "median held-out RMS on the last two fifths of the hold: base law → extended law",
        ),
    ];
    let bars = found
        .candidates
        .iter()
        .map(|r| Bar {
            name: r.step.clone(),
            value: 1e3 * r.held_out_n,
            interval: None,
            colour: if r.kept { Colour::Blue } else { Colour::Grey },
        })
        .collect();
    let options = FigureOptions {
        title: "Error by step".to_owned(),
        subtitle: "median held-out RMS on the end of the hold; grey: not kept".to_owned(),
        width_px: 860.0,
    };
    let markup = bar_chart(&BarChart { label: "mN rms".to_owned(), bars }, &options);
    let rows = found
        .parameters
        .iter()
        .map(|n| {
            vec![
                Cell::text(n.name.clone()),
                Cell::number(significant(n.mean, 3)),
                Cell::number(format!("{} to {}", significant(n.low, 3), significant(n.high, 3))),
                Cell::number(format!("{} to {}", significant(n.range_90.0, 2), significant(n.range_90.1, 2))),
            ]
        })
        .collect();
    let unused = found.unused.iter().map(|(name, why)| format!("Not used: {name}: {why}.")).collect();
    Page::new(format!("Diagnosis: {}", set.name))
        .subtitle(summary_sentence(found))
        .fact("data set", file)
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(Section::new("Verdict").tiles(tiles))
        .section(
            Section::new("Error by step")
                .picture("Held-out RMS on the end of the hold, by step of the model", markup),
        )
        .section(
            Section::new("Parameters over the specimens")
                .table(Table::new(
                    "Mean with its 95 % interval, and the spread between specimens",
                    &["", "mean", "95 % interval", "5th to 95th percentile"],
                    rows,
                ))
                .texts(unused),
        )
}

/// The result in one sentence.
#[must_use]
pub fn summary_sentence(found: &SpecimenReport) -> String {
    let names: Vec<&str> = found.kept_effects().collect();
    let puncture = match found.punctured.len() {
        0 => "no specimen is punctured".to_owned(),
        n => format!("{n} specimen(s) show a drop as at a puncture"),
    };
    if names.is_empty() {
        return format!("The base law describes {} specimens; {puncture}.", found.used);
    }
    format!("The simulation lacks {} in {} specimens; {puncture}.", names.join(" and "), found.used)
}
