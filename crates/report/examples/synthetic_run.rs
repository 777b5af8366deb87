//! Writes the pages and pictures of a made-up run to a folder, to be looked at:
//! `cargo run -p stylet-report --example synthetic_run -- /tmp/stylet-report`.

#[path = "../tests/support/synthetic.rs"]
mod synthetic;

use std::{fs, io, path::PathBuf};
use stylet_report::Colour;
use stylet_report::svg::{Bar, BarChart, FigureOptions, HeatMap, bar_chart, heat_map};

fn main() -> io::Result<()> {
    let folder =
        std::env::args_os().nth(1).map_or_else(|| std::env::temp_dir().join("stylet-report"), PathBuf::from);
    fs::create_dir_all(&folder)?;
    let run = synthetic::synthetic_run(1);
    let files = [
        ("run.html", run.to_html()),
        ("combinations.html", synthetic::synthetic_run(4).to_html()),
        ("measured.html", synthetic::measured_run().to_html()),
        ("run.svg", run.to_svg(&FigureOptions::default())),
        ("bars.svg", bars()),
        ("confusion.svg", confusion()),
    ];
    for (name, text) in files {
        println!("{} ({} kB)", folder.join(name).display(), text.len() / 1000);
        fs::write(folder.join(name), text)?;
    }
    Ok(())
}

fn bars() -> String {
    let bar = |name: &str, value: f64, half: f64| Bar {
        name: name.into(),
        value,
        interval: Some((value - half, value + half)),
        colour: Colour::Blue,
    };
    let bars = vec![
        bar("Paper, multi-layer", 3.6, 0.4),
        bar("Paper, Kelvin-Voigt", 46.0, 5.0),
        bar("without re-weighting", 21.0, 3.0),
        bar("literal", 112.0, 20.0),
    ];
    let options = FigureOptions {
        title: "Stiffness error of the ablations".into(),
        width_px: 720.0,
        ..Default::default()
    };
    bar_chart(&BarChart { label: "relative error of K (%)".into(), bars }, &options)
}

fn confusion() -> String {
    let names: Vec<String> =
        ["coulomb", "stribeck", "power law", "relaxation", "bias", "none"].map(str::to_owned).to_vec();
    let values = (0..6)
        .map(|r| (0..6).map(|c| if r == c { 18.0 - f64::from(r) } else { f64::from((r * c) % 3) }).collect());
    let map = HeatMap {
        row_label: "hidden cause".into(),
        column_label: "named cause".into(),
        rows: names.clone(),
        columns: names,
        values: values.collect(),
        values_are_fractions: false,
    };
    heat_map(
        &map,
        &FigureOptions { title: "Who is taken for whom".into(), width_px: 640.0, ..Default::default() },
    )
}
