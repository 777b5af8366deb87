//! Comparison of a group of recordings with a model, and the plan of a new group's recordings, with the files that the commands write.

use crate::diagnose::usable_recordings;
use crate::diagnose_repeats::recording_files;
use crate::diagnosis_inputs::{DiagnosisInputs, INPUTS_FILE, read_options, read_recordings};
use crate::error::Error;
use crate::output_files::{OutputFiles, to_json_bytes};
use crate::output_folder::{recover, write_file_atomically};
use crate::prediction_files::diagnosis;
use std::path::{Path, PathBuf};
use stylet_diagnose::prediction::{Factor, TransferPlan, TransferResult, compare_groups, plan_transfer};
use stylet_diagnose::repeated_insertions::dataset::{Dataset, is_dataset};
use stylet_diagnose::{Diagnosis, NamedRecording};
use stylet_record::ReadOptions;
use stylet_report::pages::transfer::page;
use stylet_scenario::Scenario;

/// A model with the diagnosis that made it.
pub struct DiagnosedModel {
    file: PathBuf,
    scenario: Scenario,
    diagnosis: Diagnosis,
}

/// The model's file, from its path or the folder of its diagnosis.
#[must_use]
pub fn model_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("extended.ron") } else { path.to_owned() }
}

impl DiagnosedModel {
    /// Loads a model by its file or the folder of its diagnosis.
    ///
    /// # Errors
    /// [`Error::Input`] for the scenario; [`Error::Request`] without a `diagnosis.json` of this version next to it.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let file = model_file(path);
        let folder = file.parent().unwrap_or(Path::new("."));
        recover(folder)?;
        let scenario = Scenario::load(&file)?;
        let found = diagnosis(&folder.join("diagnosis.json"))?.ok_or_else(|| {
            Error::Request(format!(
                "{}: there is no diagnosis.json next to it; give the folder that `stylet diagnose` wrote, or the extended.ron in it",
                file.display()
            ))
        })?;
        Ok(Self { file, scenario, diagnosis: found })
    }

    /// Compares the recordings of a new group with those that made the model.
    ///
    /// # Errors
    /// As [`crate::predict_recordings`]; [`Error::Diagnose`] when the diagnosis does not have the curves of its recordings.
    pub fn compare_groups(
        &self,
        recordings: &[NamedRecording],
    ) -> Result<(TransferResult, OutputFiles), Error> {
        let found = compare_groups(&self.scenario, &self.diagnosis, &usable_recordings(recordings)?)?;
        let mut output = OutputFiles::default();
        output.add("report.html", page(&self.scenario, &self.file.display().to_string(), &found).to_html());
        output.add_json("transfer.json", &found.transfer)?;
        Ok((found, output))
    }

    /// Plans the recordings of a new group that differs in the factors `varying`.
    ///
    /// # Errors
    /// [`Error::Diagnose`] when the diagnosis does not have the curves of its recordings.
    pub fn plan_transfer(&self, varying: &[Factor]) -> Result<TransferPlan, Error> {
        Ok(plan_transfer(&self.scenario, &self.diagnosis, varying)?)
    }
}

/// Files of a group of recordings, and how to read them.
pub struct GroupFiles {
    /// The recordings.
    pub data: Vec<PathBuf>,
    options: ReadOptions,
}

impl GroupFiles {
    /// The recordings `data`; without any, those of `group`: a data set, or the folder of a diagnosis of single recordings.
    ///
    /// # Errors
    /// [`Error::Request`] when there are none; [`Error::Input`] or [`Error::Dataset`] when a file is wrong or missing.
    pub fn new(
        group: Option<&Path>,
        data: &[PathBuf],
        columns: Option<&Path>,
        repair: bool,
    ) -> Result<Self, Error> {
        let given = read_options(columns, repair)?;
        let Some(group) = group else {
            if data.is_empty() {
                return Err(Error::Request(
                    "no recordings of the other group: name them with --data B1.csv B2.csv, or give a data set".to_owned(),
                ));
            }
            return Ok(Self { data: data.to_vec(), options: given });
        };
        let named = |why: &str| Error::Request(format!("{}: {why}", group.display()));
        if !data.is_empty() {
            return Err(named(
                "gives the recordings of the other group, and so does --data; leave out one of them",
            ));
        }
        if group.is_dir() {
            if !group.join(INPUTS_FILE).is_file() {
                return Err(named(
                    "holds no inputs.json; name the recordings of the other group with --data, or give their data set",
                ));
            }
            let inputs = DiagnosisInputs::from_folder(group)?;
            let options = read_options(inputs.columns.as_deref(), inputs.repair)?;
            return Ok(Self { data: inputs.data, options });
        }
        if !is_dataset(group)? {
            return Err(named(
                "is no data set; with --transfer the model takes the place of a scenario, and --data names the recordings",
            ));
        }
        let set = Dataset::load(group)?;
        if !set.split_by.is_empty() {
            return Err(named(
                "separates specimens with `split_by`; a group holds recordings of one specimen",
            ));
        }
        let options = ReadOptions { columns: given.columns.or_else(|| set.columns.clone()), repair };
        Ok(Self { data: recording_files(&set, &[])?, options })
    }

    /// Reads the recordings.
    ///
    /// # Errors
    /// [`Error::Recording`] with file and line.
    pub fn read(&self) -> Result<Vec<NamedRecording>, Error> {
        read_recordings(&self.data, &self.options)
    }
}

/// Writes the plan of a new group's recordings.
///
/// # Errors
/// [`Error::Output`] when the file cannot be written.
pub fn write_plan(plan: &TransferPlan, out: &Path) -> Result<(), Error> {
    if let Some(folder) = out.parent().filter(|p| !p.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|why| Error::output(out, why))?;
    }
    write_file_atomically(out, &to_json_bytes(plan)?)
}
