//! A measured recording, heard by the online core: what it found, as files.

mod files;
mod long;
mod picture;
mod table;

pub use long::hear_long;

use crate::enhance::listen_told;
use crate::error::Error;
use crate::folder::Written;
use crate::hash;
use crate::law::FittedLaw;
use crate::output::{Output, json};
use crate::picture::{Ran, report};
use crate::run::settings_note;
use files::{EnhanceResult, events, found_by};
use std::path::Path;
use stylet_core::config::Model;
use stylet_record::{QualityNote, Recording};
use stylet_report::run::{ForceTrace, Provenance, RunReport};
use stylet_report::svg::FigureOptions;
use stylet_scenario::{EnhanceFile, ron_options};

/// A measured recording and what the core made of it.
pub struct Heard {
    /// What was recorded; of a long recording the samples that the report shows.
    pub recording: Recording,
    /// How much was recorded.
    pub extent: Extent,
    /// What is remarkable about it.
    pub notes: Vec<QualityNote>,
    /// What the core made of it, per model: all ruptures and layers, and one value per sample of `recording`.
    pub ran: Vec<Ran>,
    /// Hash over all results: the same recording and configuration give the same.
    pub hash: String,
    /// The law that it was told.
    pub law: Option<Told>,
    config: EnhanceFile,
    table: Table,
}

/// A law that the core was told, and what is remarkable about that.
pub struct Told {
    /// Its file.
    pub file: String,
    /// Sentences for people.
    pub notes: Vec<String>,
}

impl Told {
    /// Whose friction it is.
    #[must_use]
    pub fn sentence(&self) -> String {
        format!(
            "friction along the shaft as {} has it, corrected on the way back by what the force shows",
            self.file
        )
    }

    fn new(law: &FittedLaw, ran: &[Ran]) -> Self {
        let mut notes = ran.first().map(|r| law.doubts(&r.trace)).unwrap_or_default();
        notes.extend(
            ran.iter()
                .filter(|r| law.fits(&r.config).is_err())
                .map(|r| format!("{} takes no law: its enhanced force is its own", r.name)),
        );
        Self { file: law.file.clone(), notes }
    }
}

/// How much was recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
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
    There(Written),
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

/// Runs the core over a recording, once per model, and with a law fitted elsewhere where the algorithm takes one.
///
/// # Errors
/// [`Error::Recording`] when the table cannot be written.
pub fn hear(
    recording: Recording,
    notes: Vec<QualityNote>,
    config: EnhanceFile,
    models: &[Model],
    law: Option<&FittedLaw>,
) -> Result<Heard, Error> {
    let ran: Vec<Ran> = models.iter().map(|&model| listen_told(&recording, &config, model, law)).collect();
    let csv = table::of(&recording, &ran)?;
    let hash = hash::of_results(&csv, &ran.iter().map(|r| &r.trace).collect::<Vec<_>>());
    let extent = Extent {
        samples: recording.len(),
        duration_s: recording.duration_s(),
        sample_hz: recording.sample_hz(),
    };
    let law = law.map(|law| Told::new(law, &ran));
    Ok(Heard { recording, extent, notes, ran, hash, config, law, table: Table::Here(csv) })
}

impl Heard {
    /// `enhance.json` for a recording called `name`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self, name: &str) -> Result<Vec<u8>, Error> {
        let Self { extent, notes, ran, hash, law, .. } = self;
        json(&EnhanceResult {
            recording: name.to_owned(),
            samples: extent.samples,
            duration_s: extent.duration_s,
            sample_hz: extent.sample_hz,
            hash,
            version: env!("CARGO_PKG_VERSION"),
            law: law.as_ref().map(|law| law.file.as_str()),
            found: ran.iter().map(found_by).collect(),
            data_quality: notes,
        })
    }

    /// The report.
    ///
    /// # Errors
    /// [`Error::Internal`] when the configuration cannot be written.
    pub fn report(&self, source: &Source) -> Result<RunReport, Error> {
        let Self { recording, extent, notes, ran, hash, config, .. } = self;
        let shortened = (extent.samples > recording.len())
            .then(|| picture::note(extent.samples, recording.len(), ran.len()));
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
                .chain(self.law.iter().map(Told::sentence))
                .chain(self.law.iter().flat_map(|law| law.notes.clone()))
                .chain(shortened)
                .collect(),
            ..report(
                recording,
                vec![ForceTrace { sensor: "force_torque".to_owned(), force_n: recording.force_n.clone() }],
                ran,
            )
        };
        if self.is_long() {
            picture::shorten(&mut page);
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
    pub fn output(self, source: &Source) -> Result<Output, Error> {
        let report = self.report(source)?;
        let events = self.ran.first().map(|r| events(&r.trace)).unwrap_or_default();
        let mut output = Output::default();
        output.add("enhance.json", self.json(&source.data.display().to_string())?);
        output.add_json("events.json", &events)?;
        output.add("figure.svg", report.to_svg(&FigureOptions::default()));
        output.add("report.html", report.to_html());
        match self.table {
            Table::Here(csv) => output.add("enhanced.csv", csv),
            Table::There(part) => output.add_part(part),
        }
        Ok(output)
    }
}
