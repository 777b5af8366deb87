//! The page of repeated insertions: held-out prediction errors, the causes with their improvement, the extended law, and the
//! variation between recordings.

mod fitted_law;
mod held_out_prediction;
pub mod online_enhancement;
mod recording_variation;

pub use fitted_law::ablation_figure;

use crate::page_model::{Page, Section, Status, Tile};
use crate::pages::diagnosis::{findings, wrong_numbers};
use crate::pages::formatting::{data_quality_table, three_decimals};
use fitted_law::{causes, extended_law};
use held_out_prediction::{held_out_predictions, residual_charts};
use recording_variation::{between_recordings, measurement_chain};
use stylet_diagnose::claims::contradicts;
use stylet_diagnose::diagnosis_json::Verdict;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::Dataset;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;
use stylet_score::MeasuredScore;

/// The page of the data set `set`, read from `file`, with the scores of the online algorithm on its recordings; `commands` reproduce
/// it.
#[must_use]
pub fn page(
    set: &Dataset,
    file: &str,
    commands: String,
    study: &SetDiagnosis,
    online: &[MeasuredScore],
) -> Page {
    let runs: Vec<&SegmentedRecording> = study.recordings.iter().collect();
    let runs = runs.as_slice();
    let samples: usize = runs.iter().map(|r| r.recording.len()).sum();
    Page::new(format!("Diagnosis: {}", set.name))
        .subtitle(match &study.diagnosis.grade {
            Some(grade) => format!("{} Grade {:?}.", summary_sentence(study), grade.letter),
            None => summary_sentence(study),
        })
        .fact("data set", file)
        .fact("recordings", runs.len().to_string())
        .fact("samples", samples.to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(verdict(study))
        .section(held_out_predictions(runs, study))
        .section(causes(study))
        .section(extended_law(study))
        .section(residual_charts(runs, study))
        .section(between_recordings(study))
        .section(online_enhancement::section(online))
        .section(measurement_chain(study))
        .section(quality(study))
        .section(Section::new("Reproduce").code("commands", commands))
}

/// The verdict in one sentence.
#[must_use]
pub fn summary_sentence(study: &SetDiagnosis) -> String {
    let d = &study.diagnosis;
    let names: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    let finding = d.findings.iter().find(|f| contradicts(f.kind));
    let but = finding.map_or_else(String::new, |f| format!(" But {}.", f.message));
    let text = match (d.verdict, names.is_empty()) {
        (Verdict::Unknown, true) => {
            "The insertions hold structure that no effect of the library explains.".to_owned()
        }
        (Verdict::Unknown, false) => format!(
            "The insertions hold structure that no effect of the library explains; in addition the simulation lacks {}.",
            names.join(", ")
        ),
        (Verdict::Parameters, _) => wrong_numbers(d),
        (_, true) => {
            let model = if study.mean_scenario.effects.is_empty() { "base law" } else { "assumed model" };
            format!("The {model} predicts new insertions as well as any extension of it.")
        }
        (_, false) => format!("The simulation lacks {}.", names.join(", ")),
    };
    text + &but
}

fn verdict(study: &SetDiagnosis) -> Section {
    let m = &study.report.mean;
    let floor = m.floor_n;
    let tiles = vec![
        Tile::new(
            "Held-out recording",
            format!("{:.3} → {:.3} N", m.base_n, m.with_discrepancy_n),
            format!(
                "RMS: base law → extended law ({:.3} N) plus empirical discrepancy; mean of the other recordings: {} N",
                m.model_n,
                three_decimals(floor)
            ),
        )
        .status(floor.map_or(Status::Plain, |f| Status::at_most(m.with_discrepancy_n, 1.2 * f, 1.5 * f))),
        Tile::new(
            "Held-out speed",
            format!("{} → {} N", three_decimals(m.base_held_out_speed_n), three_decimals(m.held_out_speed_n)),
            "RMS: all recordings of one speed predicted from the other speeds".to_owned(),
        ),
        Tile::new(
            "90 % band",
            format!("{:.1} %", 100.0 * m.coverage),
            "of the samples of held-out recordings are inside".to_owned(),
        )
        .status(if (0.8..=0.97).contains(&m.coverage) { Status::Good } else { Status::Warn }),
        Tile::new("Causes", study.diagnosis.causes.len().to_string(), summary_sentence(study)),
    ];
    let section = Section::new("Verdict").tiles(tiles);
    let findings = findings(&study.diagnosis);
    if findings.is_empty() { section } else { section.warnings(findings) }
}

fn quality(study: &SetDiagnosis) -> Section {
    let title = match study.report.instrument.detected.is_empty() {
        true => "Remarks; nothing was corrected or resampled",
        false => "Remarks; only the instrument effects above were corrected",
    };
    Section::new("Data quality").table(data_quality_table(title, &study.diagnosis.data_quality))
}
