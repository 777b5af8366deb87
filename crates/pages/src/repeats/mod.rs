//! The page of repeated insertions: what the base law cannot say, the causes in the order of what each
//! buys, the extended law, and how well it predicts runs that took no part.

mod law;
mod left_out;
pub mod online;
mod runs;

pub use law::gain_figure;

use crate::words::{remarks, three};
use law::{causes, law};
use left_out::{before_and_after, residual};
use runs::{instrument, repeats};
use stylet_diagnose::outcome::Verdict;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::dataset::Dataset;
use stylet_diagnose::set::study::Study;
use stylet_report::{Page, Section, Status, Tile};
use stylet_score::Online;

/// The page of a study of the data set `set`, which was read from `file`, with what the online core heard in its runs; `commands`
/// repeat it.
#[must_use]
pub fn page(set: &Dataset, file: &str, commands: String, study: &Study, heard: &[Online]) -> Page {
    let runs: Vec<&Insertion> = study.runs.iter().collect();
    let runs = runs.as_slice();
    let samples: usize = runs.iter().map(|r| r.recording.len()).sum();
    Page::new(format!("Diagnosis: {}", set.name))
        .subtitle(sentence(study))
        .fact("data set", file)
        .fact("recordings", runs.len().to_string())
        .fact("samples", samples.to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(verdict(study))
        .section(before_and_after(runs, study))
        .section(causes(study))
        .section(law(study))
        .section(residual(runs, study))
        .section(repeats(study))
        .section(online::section(heard))
        .section(instrument(study))
        .section(quality(study))
        .section(Section::new("To repeat").code("commands", commands))
}

/// The verdict in a sentence.
#[must_use]
pub fn sentence(study: &Study) -> String {
    let d = &study.diagnosis;
    let names: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    match (d.verdict, names.is_empty()) {
        (Verdict::Unknown, true) => {
            "The insertions hold structure that no effect of the library explains.".to_owned()
        }
        (Verdict::Unknown, false) => format!(
            "The insertions hold structure that no effect of the library explains; beside it the simulation lacks {}.",
            names.join(", ")
        ),
        (_, true) => "The base law predicts new insertions as well as any extension of it.".to_owned(),
        (_, false) => format!("The simulation lacks {}.", names.join(", ")),
    }
}

fn verdict(study: &Study) -> Section {
    let m = &study.repeats.mean;
    let floor = m.floor_n;
    let tiles = vec![
        Tile::new(
            "A run that took no part",
            format!("{:.3} → {:.3} N", m.base_n, m.extended_n),
            format!(
                "base law → extended law ({:.3} N) with what it leaves alike of the other runs, root mean square; another real insertion: {} N",
                m.law_n,
                three(floor)
            ),
        )
        .status(floor.map_or(Status::Plain, |f| Status::at_most(m.extended_n, 1.2 * f, 1.5 * f))),
        Tile::new(
            "A speed that took no part",
            format!("{} → {} N", three(m.base_speed_left_out_n), three(m.speed_left_out_n)),
            "all runs of one speed predicted from the other speeds".to_owned(),
        ),
        Tile::new(
            "90 % band",
            format!("{:.1} %", 100.0 * m.covered),
            "of the samples of runs that took no part lie within it".to_owned(),
        )
        .status(if (0.8..=0.97).contains(&m.covered) { Status::Good } else { Status::Warn }),
        Tile::new("Causes", study.diagnosis.causes.len().to_string(), sentence(study)),
    ];
    Section::new("Verdict").tiles(tiles)
}

fn quality(study: &Study) -> Section {
    let title = match study.repeats.instrument.shown.is_empty() {
        true => "Remarks; nothing was corrected or resampled",
        false => "Remarks; but for what the instrument shows nothing was corrected or resampled",
    };
    Section::new("Data quality").table(remarks(title, &study.diagnosis.data_quality))
}
