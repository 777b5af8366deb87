//! What a scenario gets wrong about measured recordings. The only file here that knows the engine.

use crate::error::Error;
use crate::inputs::{INPUTS, Inputs};
use crate::output::{Output, json};
use stylet_diagnose::predict::{Foretold, Refit};
use stylet_diagnose::{Diagnosis, Evidence, Examined, Options};
use stylet_record::{QualityNote, assess, thin, usable};
use stylet_scenario::Scenario;

/// What a diagnosis gives.
pub struct Diagnosed {
    /// Verdict, causes, intervals, gain.
    pub diagnosis: Diagnosis,
    /// The scenario with re-fitted parameters and the effects found.
    pub extended: Scenario,
    /// All that the engine knows, for the report.
    pub examined: Examined,
}

impl Diagnosed {
    /// `diagnosis.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn json(&self) -> Result<Vec<u8>, Error> {
        json(&self.diagnosis)
    }

    /// `extended.ron`; `believed` names the scenario in its first line.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn extended_ron(&self, believed: &str) -> Result<String, Error> {
        Ok(format!(
            "// {believed} with re-fitted parameters and the effects found by stylet diagnose {}.\n{}",
            env!("CARGO_PKG_VERSION"),
            self.extended.to_ron().map_err(Error::internal)?
        ))
    }

    /// The report: `believed` was read from `file`, `command` repeats it.
    #[must_use]
    pub fn html(&self, believed: &Scenario, file: &str, command: String) -> String {
        stylet_pages::diagnosis::page(believed, file, command, &self.examined).to_html()
    }

    /// All files that `stylet diagnose` writes for single recordings; `believed` was read from the inputs' scenario.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self, believed: &Scenario, inputs: &Inputs) -> Result<Output, Error> {
        let file = inputs.scenario.display().to_string();
        let mut output = Output::default();
        output.add("report.html", self.html(believed, &file, inputs.command()));
        output.add("diagnosis.json", self.json()?);
        output.add_json(INPUTS, &inputs.absolute())?;
        output.add("extended.ron", self.extended_ron(&file)?);
        Ok(output)
    }
}

/// Compares what a scenario believes with what was measured; `progress` is told what is being done. At least one recording;
/// with two or more the gain is measured on recordings left out of the fit.
///
/// Recordings that are too long are thinned first, and the diagnosis says so.
///
/// # Errors
/// [`Error::Recording`] when a recording allows no conclusion (a dead or reversed sensor, millimetres for metres, ...),
/// [`Error::Diagnose`] when the recordings do not fit the scenario.
pub fn diagnose(
    believed: &Scenario,
    evidence: &[Evidence],
    progress: impl FnMut(&str),
) -> Result<Diagnosed, Error> {
    let thinned = within_reach_all(evidence)?;
    let examined = stylet_diagnose::diagnose(believed, &thinned, &Options::default(), progress)?;
    Ok(Diagnosed { diagnosis: examined.diagnosis.clone(), extended: examined.extended.clone(), examined })
}

/// How well a scenario predicts recordings that took no part in making it. `diagnosis` is the one it came from, for noise,
/// scatter and intervals; `believed` is what was believed before; what is in `refit` is fitted to the recordings first, and
/// with two or more each is predicted by what the others say.
///
/// # Errors
/// As [`diagnose`].
pub fn forecast(
    model: &Scenario,
    diagnosis: Option<&Diagnosis>,
    believed: Option<&Scenario>,
    refit: &[Refit],
    evidence: &[Evidence],
) -> Result<Foretold, Error> {
    let thinned = within_reach_all(evidence)?;
    Ok(stylet_diagnose::predict::predict(model, diagnosis, believed, refit, &thinned)?)
}

/// The recordings as long as the engine can use them, if it can.
fn within_reach_all(evidence: &[Evidence]) -> Result<Vec<Evidence>, Error> {
    let mut judged: Vec<(&str, Vec<QualityNote>)> = Vec::with_capacity(evidence.len());
    for e in evidence {
        // Samples that are no numbers are the engine's to cut out.
        let notes = if e.recording.check().is_ok() { assess(&e.recording) } else { Vec::new() };
        judged.push((&e.name, notes));
    }
    usable(judged.iter().map(|(name, notes)| (*name, notes.as_slice())))?;
    Ok(evidence.iter().map(within_reach).collect())
}

/// The recording as long as a diagnosis can use it.
fn within_reach(evidence: &Evidence) -> Evidence {
    let Some((recording, note)) = thin(&evidence.recording) else { return evidence.clone() };
    let mut notes = evidence.notes.clone();
    notes.push(note);
    Evidence { name: evidence.name.clone(), recording, notes }
}
