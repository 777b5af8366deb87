//! A measured recording, heard by the online core: what it found, as files.

mod files;

use crate::enhance::listen;
use crate::error::Error;
use crate::hash;
use crate::output::{Output, json};
use crate::picture::{self, Ran};
use crate::run::settings_note;
use files::{EnhanceResult, events, found_by, with_state};
use std::path::Path;
use stylet_core::config::Model;
use stylet_record::{QualityNote, Recording, write_csv};
use stylet_report::run::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::{EnhanceFile, ron_options};

/// A measured recording and what the core made of it.
pub struct Heard {
    /// What was recorded.
    pub recording: Recording,
    /// What is remarkable about it.
    pub notes: Vec<QualityNote>,
    /// What the core made of it, per model.
    pub ran: Vec<Ran>,
    /// Hash over all results: the same recording and configuration give the same.
    pub hash: String,
    config: EnhanceFile,
    csv: Vec<u8>,
}

/// Where a recording and a configuration came from.
pub struct Source<'a> {
    /// The recording's file.
    pub data: &'a Path,
    /// The configuration's, if it is not the default.
    pub config: Option<&'a Path>,
    /// The command that repeats it.
    pub command: String,
}

/// Runs the core over a recording, once per model.
///
/// # Errors
/// [`Error::Recording`] when the table cannot be written.
pub fn hear(
    recording: Recording,
    notes: Vec<QualityNote>,
    config: EnhanceFile,
    models: &[Model],
) -> Result<Heard, Error> {
    let ran: Vec<Ran> = models.iter().map(|&model| listen(&recording, &config, model)).collect();
    let csv = table(&recording, &ran)?;
    let hash = hash::of_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    Ok(Heard { recording, notes, ran, hash, config, csv })
}

impl Heard {
    /// `enhance.json` for a recording called `name`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self, name: &str) -> Result<Vec<u8>, Error> {
        let Self { recording, notes, ran, hash, .. } = self;
        json(&EnhanceResult {
            recording: name.to_owned(),
            samples: recording.len(),
            duration_s: recording.duration_s(),
            sample_hz: recording.sample_hz(),
            hash,
            version: env!("CARGO_PKG_VERSION"),
            found: ran.iter().map(found_by).collect(),
            data_quality: notes,
        })
    }

    /// The report.
    ///
    /// # Errors
    /// [`Error::Internal`] when the configuration cannot be written.
    pub fn report(&self, source: &Source) -> Result<RunReport, Error> {
        let Self { recording, notes, ran, hash, config, .. } = self;
        let body = ron_options().to_string_pretty(config, Default::default()).map_err(Error::internal)?;
        let name = source.data.file_name().unwrap_or(source.data.as_os_str());
        Ok(RunReport {
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
            notes: notes.iter().map(|n| n.message.clone()).chain(settings_note(ran)).collect(),
            ..picture::report(
                recording,
                vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
                ran,
            )
        })
    }

    /// All files that `stylet enhance` writes.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, source: &Source) -> Result<Output, Error> {
        let report = self.report(source)?;
        let events = self.ran.first().map(|r| events(&r.trace)).unwrap_or_default();
        let mut output = Output::default();
        output.add("enhanced.csv", self.csv.clone());
        output.add("enhance.json", self.json(&source.data.display().to_string())?);
        output.add_json("events.json", &events)?;
        output.add("figure.svg", report.to_svg(&FigureOptions::default()));
        output.add("report.html", report.to_html());
        Ok(output)
    }
}

/// `enhanced.csv`: the recording beside what the first model made of it.
fn table(recording: &Recording, ran: &[Ran]) -> Result<Vec<u8>, Error> {
    let Some(first) = ran.first() else { return Ok(Vec::new()) };
    let extra: [(&str, &[f64]); 5] = [
        ("enhanced_n", &first.trace.enhanced_n),
        ("low_n", &first.trace.low_n),
        ("high_n", &first.trace.high_n),
        ("reconstructed_n", &first.trace.reconstructed_n),
        ("estimated_cumulative_friction_ns_per_m", &first.trace.cumulative_friction_ns_per_m),
    ];
    let mut csv = Vec::new();
    write_csv(recording, None, &extra, &mut csv)?;
    Ok(with_state(&csv, &first.trace.state))
}
