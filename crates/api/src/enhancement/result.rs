//! Result of an enhancement and its files.

use super::identified_model::IdentifiedModel;
use super::result_files::{EnhanceResult, events, results_of_run};
use super::whole_recording::run_enhancer;
use super::{enhanced_csv, plot_samples};
use crate::error::Error;
use crate::output_files::{OutputFiles, to_json_bytes};
use crate::output_folder::StagedFile;
use crate::result_hash;
use crate::run_report::{AlgorithmRun, run_report};
use crate::simulate::settings_note;
use std::path::Path;
use stylet_core::config::Model;
use stylet_record::{QualityKind, QualityNote, Recording};
use stylet_report::insertion_report::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::{EnhancerConfigFile, ron_options};

/// A measured recording and the outputs of the core.
pub struct EnhancementResult {
    /// The recording; of a long one the samples that the report shows.
    pub recording: Recording,
    /// Size of the recording.
    pub extent: RecordingExtent,
    /// Findings about the recording.
    pub notes: Vec<QualityNote>,
    /// Outputs per regressor: all ruptures and layers, and one value per sample of `recording`.
    pub algorithm_runs: Vec<AlgorithmRun>,
    /// Hash over all results: the same recording and configuration give the same.
    pub hash: String,
    /// The identified model used.
    pub model: Option<AppliedModel>,
    pub(super) config: EnhancerConfigFile,
    pub(super) table: EnhancedTable,
}

/// The identified model that provided the shaft friction.
pub struct AppliedModel {
    /// Its file.
    pub file: String,
    /// Warnings.
    pub notes: Vec<String>,
}

impl AppliedModel {
    /// The source of the friction, in one sentence.
    #[must_use]
    pub fn summary(&self) -> String {
        format!("shaft friction from {}, corrected by the measured force during retraction", self.file)
    }

    pub(super) fn new(model: &IdentifiedModel, runs: &[AlgorithmRun]) -> Self {
        let mut notes = runs.first().map(|r| model.warnings(&r.trace)).unwrap_or_default();
        let ignoring = runs.iter().filter(|r| model.check_algorithm(&r.config).is_err());
        notes.extend(
            ignoring.map(|r| format!("{} takes no model and uses its own friction estimate", r.name)),
        );
        Self { file: model.file.clone(), notes }
    }
}

/// Size of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordingExtent {
    /// Number of samples.
    pub samples: usize,
    /// Time from the first to the last sample in s.
    pub duration_s: f64,
    /// Inverse of the median interval in Hz.
    pub sample_hz: f64,
}

/// `enhanced.csv`.
pub(super) enum EnhancedTable {
    InMemory(Vec<u8>),
    /// In the output folder, as part of a set that is being written.
    Staged(StagedFile),
}

/// Files of a recording and its configuration, for the report.
pub struct ResultSource<'a> {
    /// The recording.
    pub data: &'a Path,
    /// The configuration, unless it is the default.
    pub config: Option<&'a Path>,
    /// The command that reproduces the result.
    pub command: String,
}

/// Runs the core over a recording, once per regressor, with an identified model where the algorithm takes one.
///
/// # Errors
/// [`Error::Recording`] when the table cannot be written.
pub fn enhance_recording(
    recording: Recording,
    notes: Vec<QualityNote>,
    config: EnhancerConfigFile,
    regressors: &[Model],
    model: Option<&IdentifiedModel>,
) -> Result<EnhancementResult, Error> {
    let runs: Vec<AlgorithmRun> =
        regressors.iter().map(|&regressor| run_enhancer(&recording, &config, regressor, model)).collect();
    let csv = enhanced_csv::enhanced_csv(&recording, &runs)?;
    let hash = result_hash::hash_results(&csv, &runs.iter().map(|r| &r.trace).collect::<Vec<_>>());
    let extent = RecordingExtent {
        samples: recording.len(),
        duration_s: recording.duration_s(),
        sample_hz: recording.mean_hz(),
    };
    let model = model.map(|model| AppliedModel::new(model, &runs));
    let table = EnhancedTable::InMemory(csv);
    Ok(EnhancementResult { recording, extent, notes, algorithm_runs: runs, hash, config, model, table })
}

/// Samples that the algorithms ignored, and restarts because of a new clock, as a sentence.
#[must_use]
pub fn unused_note(runs: &[AlgorithmRun]) -> Option<String> {
    let unused = runs.iter().map(|r| r.trace.unused).max().unwrap_or(0);
    let restarts = runs.iter().map(|r| r.trace.restarts).max().unwrap_or(0);
    let ignored = (unused > 0).then(|| {
        format!("{unused} sample(s) were ignored by the algorithm; their rows of enhanced.csv say why in the column state.")
    });
    let restarted = (restarts > 0).then(|| {
        format!(
            "The clock was set {restarts} time(s): the algorithm began again there, and counts layers from 1."
        )
    });
    (unused + restarts > 0).then(|| ignored.into_iter().chain(restarted).collect::<Vec<_>>().join(" "))
}

impl EnhancementResult {
    /// `enhance.json` for a recording called `name`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self, name: &str) -> Result<Vec<u8>, Error> {
        let Self { extent, notes, algorithm_runs: runs, hash, model, .. } = self;
        to_json_bytes(&EnhanceResult {
            recording: name.to_owned(),
            samples: extent.samples,
            duration_s: extent.duration_s,
            sample_hz: extent.sample_hz,
            hash,
            version: env!("CARGO_PKG_VERSION"),
            identified_model: model.as_ref().map(|model| model.file.as_str()),
            found: runs.iter().map(results_of_run).collect(),
            data_quality: notes,
        })
    }

    /// The report.
    ///
    /// # Errors
    /// [`Error::Internal`] when the configuration cannot be written.
    pub fn report(&self, source: &ResultSource) -> Result<RunReport, Error> {
        let Self { recording, extent, notes, algorithm_runs: runs, hash, config, .. } = self;
        // Units that were applied as the file says are no reason to doubt the recording.
        let (converted, doubtful): (Vec<_>, Vec<_>) =
            notes.iter().partition(|note| note.kind == QualityKind::Converted);
        let conversions = converted.iter().map(|note| note.message.as_str()).collect::<Vec<_>>().join("; ");
        let selection = (extent.samples > recording.len())
            .then(|| plot_samples::selection_note(extent.samples, recording.len(), runs.len()));
        let body = ron_options().to_string_pretty(config, Default::default()).map_err(Error::internal)?;
        let name = source.data.file_name().unwrap_or(source.data.as_os_str());
        let mut page = RunReport {
            title: name.to_string_lossy().into_owned(),
            source: "measured recording without ground truth".to_owned(),
            provenance: Provenance {
                scenario_file: source.config.map_or("defaults".to_owned(), |c| c.display().to_string()),
                scenario_text: format!("Enhance{body}\n"),
                command: source.command.clone(),
                seed: None,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                hash: hash.clone(),
            },
            notes: doubtful
                .iter()
                .map(|n| n.message.clone())
                .chain(settings_note(runs))
                .chain(unused_note(runs))
                .chain(self.model.iter().flat_map(|model| model.notes.clone()))
                .chain(selection)
                .collect(),
            remarks: Some(conversions)
                .filter(|text| !text.is_empty())
                .into_iter()
                .chain(self.model.iter().map(AppliedModel::summary))
                .collect(),
            ..run_report(
                recording,
                vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
                runs,
            )
        };
        if self.is_long() {
            plot_samples::truncate_lists(&mut page);
        }
        Ok(page)
    }

    /// The recording was too long to be kept in memory; the report shows a selection.
    #[must_use]
    pub fn is_long(&self) -> bool {
        matches!(self.table, EnhancedTable::Staged(_))
    }

    /// All files of `stylet enhance`; those of a long recording belong into the folder that was locked for it.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output_files(self, source: &ResultSource) -> Result<OutputFiles, Error> {
        let report = self.report(source)?;
        let events = self.algorithm_runs.first().map(|r| events(&r.trace)).unwrap_or_default();
        let mut output = OutputFiles::default();
        output.add("enhance.json", self.json(&source.data.display().to_string())?);
        output.add_json("events.json", &events)?;
        output.add("figure.svg", report.to_svg(&FigureOptions::default()));
        output.add("report.html", report.to_html());
        match self.table {
            EnhancedTable::InMemory(csv) => output.add("enhanced.csv", csv),
            EnhancedTable::Staged(file) => output.add_staged(file),
        }
        Ok(output)
    }
}

#[cfg(test)]
mod tests {
    use super::{ResultSource, enhance_recording};
    use std::collections::BTreeMap;
    use std::path::Path;
    use stylet_record::{QualityKind, QualityNote, Recording};
    use stylet_scenario::EnhancerConfigFile;

    #[test]
    fn the_page_warns_of_gaps_and_not_of_conversions() -> Result<(), Box<dyn std::error::Error>> {
        let time_s: Vec<f64> = (0..200).map(|k| 0.005 * f64::from(k)).collect();
        let recording = Recording {
            position_m: time_s.iter().map(|t| 0.002 * t).collect(),
            velocity_mps: vec![0.002; 200],
            force_n: vec![0.0; 200],
            time_s,
            ..Recording::default()
        };
        let note = |kind, message: &str| QualityNote {
            kind,
            message: message.to_owned(),
            numbers: BTreeMap::new(),
            lines: Vec::new(),
            blocking: false,
        };
        let notes = vec![
            note(QualityKind::Converted, "force converted from kN"),
            note(QualityKind::Gaps, "2 gap(s)"),
            note(QualityKind::Converted, "position converted from mm"),
        ];
        let config = EnhancerConfigFile::default();
        let model = config.enhance.model;
        let result = enhance_recording(recording, notes, config, &[model], None)?;
        let source = ResultSource { data: Path::new("gel.csv"), config: None, command: String::new() };
        let page = result.report(&source)?;
        assert_eq!(page.notes, ["2 gap(s)"]);
        assert_eq!(page.remarks, ["force converted from kN; position converted from mm"]);
        let html = page.to_html();
        assert!(html.contains("force converted from kN; position converted from mm"));
        Ok(())
    }
}
