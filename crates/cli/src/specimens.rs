//! `stylet diagnose` on many specimens, each indented once and held.

use crate::args::DiagnoseArgs;
use crate::exit::Failure;
use crate::output::Output;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::dataset::{Dataset, DatasetError};
use stylet_diagnose::set::specimens::{Specimens, look};
use stylet_report::svg::{Bar, BarChart, FigureOptions, bar_chart};
use stylet_report::{
    Block, Cell, Colour, Page, Scorecard, Section, SvgImage, Table, Text, Tile, significant,
};

#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    specimens: &'a Specimens,
}

/// The command, for a data set with `split_by`.
pub fn diagnose(args: &DiagnoseArgs, set: &Dataset, runs: &[Insertion]) -> Result<(), Failure> {
    let found = look(&set.tissue, runs).ok_or_else(|| {
        Failure::Dataset(DatasetError::TooLittle(
            "no specimen is indented and held for 3 s with 50 samples or more".to_owned(),
        ))
    })?;
    let d = found.diagnosis(runs);
    let written = Written { diagnosis: &d, specimens: &found };
    let mut json = serde_json::to_vec_pretty(&written).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    let mut output = Output::default();
    output.add("report.html", page(args, set, &found, &d).to_html());
    output.add("diagnosis.json", json);
    let folder = args.results.out.clone().unwrap_or_else(|| {
        let stem = args.scenario.file_stem().unwrap_or(args.scenario.as_os_str());
        PathBuf::from("stylet-out").join(format!("{}-diagnosis", stem.to_string_lossy()))
    });
    output.write(&folder)?;
    if !args.results.quiet {
        crate::terminal::say(&format!(
            "{}\nReport: {}\n",
            summary(&found, &d),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

fn sentence(found: &Specimens) -> String {
    let names: Vec<&str> = found.kept().collect();
    let puncture = match found.punctured.len() {
        0 => "no specimen is punctured".to_owned(),
        n => format!("{n} specimen(s) show a drop as at a puncture"),
    };
    if names.is_empty() {
        return format!("The base law says what {} specimens do; {puncture}.", found.used);
    }
    format!("The simulation lacks {} in {} specimens; {puncture}.", names.join(" and "), found.used)
}

fn summary(found: &Specimens, d: &Diagnosis) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}\n", sentence(found));
    let _ = writeln!(
        out,
        "    {:<36} {:>10} {:>16} {:>8}",
        "median error, mN", "fitted", "rest of hold", "better"
    );
    for r in &found.rungs {
        let _ = writeln!(
            out,
            "    {:<36} {:>10.2} {:>16.2} {:>7.0} % {}",
            r.step,
            1e3 * r.fitted_n,
            1e3 * r.left_out_n,
            100.0 * r.better,
            if r.kept { "" } else { "not kept" }
        );
    }
    for n in &found.numbers {
        let _ = writeln!(
            out,
            "    {} = {} (95 %: {} to {}; nine of ten specimens {} to {})",
            n.name,
            significant(n.mean, 3),
            significant(n.low, 3),
            significant(n.high, 3),
            significant(n.nine_of_ten.0, 2),
            significant(n.nine_of_ten.1, 2)
        );
    }
    let _ = writeln!(
        out,
        "    noise {} mN; punctures {}",
        significant(1e3 * d.noise.sd_n, 2),
        found.punctured.len()
    );
    for (name, why) in &found.unused {
        let _ = writeln!(out, "  not used: {name}: {why}");
    }
    out
}

fn page(args: &DiagnoseArgs, set: &Dataset, found: &Specimens, d: &Diagnosis) -> Page {
    let tile = |label: &str, value: String, detail: &str| Tile::new(label, value, detail);
    let tiles = vec![
        tile("Specimens", found.used.to_string(), "indented once and held, each a material of its own"),
        tile("Punctures", found.punctured.len().to_string(), "specimens whose force drops"),
        tile(
            "The rest of the hold",
            format!("{:.1} → {:.1} mN", 1e3 * d.gain.rmse_before_n, 1e3 * d.gain.rmse_after_n),
            "median error before and after, on the last two fifths of the hold, which took no part in the fit",
        ),
    ];
    let bars = found
        .rungs
        .iter()
        .map(|r| Bar {
            name: r.step.clone(),
            value: 1e3 * r.left_out_n,
            interval: None,
            colour: if r.kept { Colour::Blue } else { Colour::Grey },
        })
        .collect();
    let options = FigureOptions {
        title: "What each cause buys".to_owned(),
        subtitle: "median error on the rest of the hold; grey: not kept".to_owned(),
        width_px: 860.0,
        ..FigureOptions::default()
    };
    let markup = bar_chart(&BarChart { label: "mN rms".to_owned(), bars }, &options);
    let rows = found
        .numbers
        .iter()
        .map(|n| {
            vec![
                Cell::text(n.name.clone()),
                Cell::number(significant(n.mean, 3)),
                Cell::number(format!("{} to {}", significant(n.low, 3), significant(n.high, 3))),
                Cell::number(format!(
                    "{} to {}",
                    significant(n.nine_of_ten.0, 2),
                    significant(n.nine_of_ten.1, 2)
                )),
            ]
        })
        .collect();
    let unused = found.unused.iter().map(|(name, why)| format!("Not used: {name}: {why}.")).collect();
    Page::new(format!("Diagnosis: {}", set.name))
        .subtitle(sentence(found))
        .fact("data set", args.scenario.display().to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(Section::new("Verdict").block(Block::Scorecard(Scorecard { title: String::new(), tiles })))
        .section(
            Section::new("What each cause buys").block(Block::Svg(SvgImage {
                description: "Error on the rest of the hold".to_owned(),
                markup,
            })),
        )
        .section(
            Section::new("Numbers over the specimens")
                .table(Table {
                    title: "Mean with its 95 % interval, and the scatter".to_owned(),
                    groups: Vec::new(),
                    headers: ["", "mean", "95 % interval", "nine of ten specimens"]
                        .map(str::to_owned)
                        .to_vec(),
                    rows,
                })
                .block(Block::Text(Text { paragraphs: unused, status: stylet_report::Status::Plain })),
        )
}
