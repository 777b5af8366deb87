//! A measured recording, heard by the online core: what it found, as files.

mod enhanced_csv;
mod plot_samples;
mod result_files;
mod streaming;

pub use streaming::enhance_long_recording;

use crate::enhance::run_enhancer;
use crate::error::Error;
use crate::identified_model::IdentifiedModel;
use crate::output_files::{OutputFiles, to_json_bytes};
use crate::output_folder::StagedFile;
use crate::result_hash;
use crate::run_report::{AlgorithmRun, run_report};
use crate::simulate::settings_note;
use result_files::{EnhanceResult, events, results_of_run};
use std::path::Path;
use stylet_core::config::Model;
use stylet_record::{QualityNote, Recording};
use stylet_report::insertion_report::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::{EnhancerConfigFile, ron_options};

/// A measured recording and what the core made of it.
pub struct EnhancementResult {
    /// What was recorded; of a long recording the samples that the report shows.
    pub recording: Recording,
    /// How much was recorded.
    pub extent: RecordingExtent,
    /// What is remarkable about it.
    pub notes: Vec<QualityNote>,
    /// What the core made of it, per model: all ruptures and layers, and one value per sample of `recording`.
    pub algorithm_runs: Vec<AlgorithmRun>,
    /// Hash over all results: the same recording and configuration give the same.
    pub hash: String,
    /// The law that it was told.
    pub model: Option<AppliedModel>,
    config: EnhancerConfigFile,
    table: Table,
}

/// A law that the core was told, and what is remarkable about that.
pub struct AppliedModel {
    /// Its file.
    pub file: String,
    /// Sentences for people.
    pub notes: Vec<String>,
}

impl AppliedModel {
    /// Whose friction it is.
    #[must_use]
    pub fn summary(&self) -> String {
        format!(
            "friction along the shaft as {} has it, corrected on the way back by what the force shows",
            self.file
        )
    }

    fn new(law: &IdentifiedModel, ran: &[AlgorithmRun]) -> Self {
        let mut notes = ran.first().map(|r| law.warnings(&r.trace)).unwrap_or_default();
        notes.extend(
            ran.iter()
                .filter(|r| law.check_algorithm(&r.config).is_err())
                .map(|r| format!("{} takes no law: its enhanced force is its own", r.name)),
        );
        Self { file: law.file.clone(), notes }
    }
}

/// How much was recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordingExtent {
    /// Number of samples.
    pub samples: usize,
    /// From the first to the last (s).
    pub duration_s: f64,
    /// Inverse of the median interval (Hz).
    pub sample_hz: f64,
}

/// `enhanced.csv`.
enum Table {
    Here(Vec<u8>),
    /// In the folder where the set is being written.
    There(StagedFile),
}

/// Where a recording and a configuration came from.
pub struct ResultSource<'a> {
    /// The recording's file.
    pub data: &'a Path,
    /// The configuration's, if it is not the default.
    pub config: Option<&'a Path>,
    /// The command that repeats it.
    pub command: String,
}

/// Runs the core over a recording, once per model, and with a law fitted elsewhere where the algorithm takes one.
///
/// # Errors
/// [`Error::Recording`] when the table cannot be written.
pub fn enhance_recording(
    recording: Recording,
    notes: Vec<QualityNote>,
    config: EnhancerConfigFile,
    models: &[Model],
    law: Option<&IdentifiedModel>,
) -> Result<EnhancementResult, Error> {
    let ran: Vec<AlgorithmRun> =
        models.iter().map(|&model| run_enhancer(&recording, &config, model, law)).collect();
    let csv = enhanced_csv::enhanced_csv(&recording, &ran)?;
    let hash = result_hash::hash_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    let extent = RecordingExtent {
        samples: recording.len(),
        duration_s: recording.duration_s(),
        sample_hz: recording.sample_hz(),
    };
    let law = law.map(|law| AppliedModel::new(law, &ran));
    Ok(EnhancementResult {
        recording,
        extent,
        notes,
        algorithm_runs: ran,
        hash,
        config,
        model: law,
        table: Table::Here(csv),
    })
}

impl EnhancementResult {
    /// `enhance.json` for a recording called `name`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self, name: &str) -> Result<Vec<u8>, Error> {
        let Self { extent, notes, algorithm_runs: ran, hash, model: law, .. } = self;
        to_json_bytes(&EnhanceResult {
            recording: name.to_owned(),
            samples: extent.samples,
            duration_s: extent.duration_s,
            sample_hz: extent.sample_hz,
            hash,
            version: env!("CARGO_PKG_VERSION"),
            model: law.as_ref().map(|law| law.file.as_str()),
            found: ran.iter().map(results_of_run).collect(),
            data_quality: notes,
        })
    }

    /// The report.
    ///
    /// # Errors
    /// [`Error::Internal`] when the configuration cannot be written.
    pub fn report(&self, source: &ResultSource) -> Result<RunReport, Error> {
        let Self { recording, extent, notes, algorithm_runs: ran, hash, config, .. } = self;
        let shortened = (extent.samples > recording.len())
            .then(|| plot_samples::selection_note(extent.samples, recording.len(), ran.len()));
        let body = ron_options().to_string_pretty(config, Default::default()).map_err(Error::internal)?;
        let name = source.data.file_name().unwrap_or(source.data.as_os_str());
        let mut page = RunReport {
            title: name.to_string_lossy().into_owned(),
            source: "measured recording; there is no ground truth to score against".to_owned(),
            provenance: Provenance {
                scenario_file: source.config.map_or("defaults".to_owned(), |c| c.display().to_string()),
                scenario_text: format!("Enhance{body}\n"),
                command: source.command.clone(),
                seed: None,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                hash: hash.clone(),
            },
            notes: notes
                .iter()
                .map(|n| n.message.clone())
                .chain(settings_note(ran))
                .chain(self.model.iter().map(AppliedModel::summary))
                .chain(self.model.iter().flat_map(|law| law.notes.clone()))
                .chain(shortened)
                .collect(),
            ..run_report(
                recording,
                vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
                ran,
            )
        };
        if self.is_long() {
            plot_samples::truncate_lists(&mut page);
        }
        Ok(page)
    }

    /// Whether the recording was too long to be kept, so that the report shows a selection.
    #[must_use]
    pub fn is_long(&self) -> bool {
        matches!(self.table, Table::There(_))
    }

    /// All files that `stylet enhance` writes; those of a long recording belong into the folder that was claimed for it.
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
            Table::Here(csv) => output.add("enhanced.csv", csv),
            Table::There(part) => output.add_staged(part),
        }
        Ok(output)
    }
}
