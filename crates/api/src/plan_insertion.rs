//! Planning of the next insertion, and identifiability of an experiment, with the files that the commands write.

use crate::diagnose::diagnose;
use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::{OutputFiles, one_line, to_json_bytes};
use crate::output_folder::{check_own_file, write_file_atomically};
use std::path::Path;
use stylet_diagnose::{NamedRecording, Options};
use stylet_plan::identifiability::Identifiability;
use stylet_plan::{InformationState, Limits, Plan};
use stylet_report::pages::{diagnosis, experiment_plan as plan_page, identifiability as shown_page};
use stylet_scenario::{Scenario, load_motion, motion_to_ron};

/// A planned insertion and its basis.
pub struct PlanReport {
    /// The plan.
    pub plan: Plan,
    scenario: Scenario,
    verdict: Option<String>,
    ground: InformationState,
}

/// Reads the limits of a motion.
///
/// # Errors
/// [`Error::Input`] or [`Error::Request`] when they are invalid.
pub fn load_limits(file: &Path) -> Result<Limits, Error> {
    let limits: Limits = stylet_scenario::load(file)?;
    limits.check().map_err(|why| Error::of_plan(file, why))?;
    Ok(limits)
}

/// Plans the next insertion within limits read from a file: before any measurement, or after the recordings of the inputs. With `simulated`
/// the best motions are checked by simulated insertions. `progress` is called with the name of each stage.
///
/// # Errors
/// Invalid inputs, or no motion within the limits.
pub fn plan(
    inputs: &DiagnosisInputs,
    (limits_file, limits): (&Path, &Limits),
    simulated: bool,
    progress: &dyn Fn(&str),
) -> Result<PlanReport, Error> {
    let scenario = inputs.load_scenario()?;
    let recordings = inputs.read_recordings()?;
    let at = [inputs.scenario.as_path(), limits_file];
    plan_after_recordings(scenario, &recordings, limits, simulated, at, progress)
}

/// Plans the next insertion after the given recordings, or without any before the first. `named` are the names of scenario and limits in
/// error messages.
///
/// # Errors
/// Invalid scenario or recordings, or no motion within the limits.
pub fn plan_after_recordings(
    scenario: Scenario,
    recordings: &[NamedRecording],
    limits: &Limits,
    simulated: bool,
    named: [&Path; 2],
    progress: &dyn Fn(&str),
) -> Result<PlanReport, Error> {
    let failed = |why| Error::of_plan(named[0], why);
    let (diagnosed, (ground, begin)) = if recordings.is_empty() {
        (None, stylet_plan::from_scenario(&scenario, None).map_err(failed)?)
    } else {
        let report = diagnose(&scenario, recordings, &Options::default(), |stage| progress(stage))?;
        let start = stylet_plan::from_diagnosis(&scenario, &report.details).map_err(failed)?;
        (Some(report), start)
    };
    progress("searching the most informative motion");
    let (mut plan, found) =
        stylet_plan::plan(&ground, limits, &begin).map_err(|why| Error::of_plan(named[1], why))?;
    if simulated {
        plan = stylet_plan::check_by_simulation(&found, limits, &scenario, &ground, recordings, progress)
            .map_err(failed)?;
    }
    let verdict = diagnosed.map(|d| diagnosis::summary_sentence(&d.diagnosis));
    Ok(PlanReport { plan, scenario, verdict, ground })
}

/// First line of the file of a planned motion.
const MOTION_COMMENT: &str = "// The next insertion, planned by stylet";

/// Checks that a plan written to `out` replaces neither an input nor a file that is not from an earlier plan.
///
/// # Errors
/// [`Error::NotReplaced`].
pub fn check_plan_files(out: &Path, inputs: &[&Path]) -> Result<(), Error> {
    let contains = |text: &'static str| {
        move |bytes: &[u8]| bytes.windows(text.len()).any(|window| window == text.as_bytes())
    };
    check_own_file(out, inputs, None, |bytes| bytes.starts_with(MOTION_COMMENT.as_bytes()))?;
    check_own_file(&out.with_extension("json"), inputs, None, contains("\"probability_decided\""))?;
    check_own_file(&out.with_extension("html"), inputs, None, contains("class=\"disclaimer\""))
}

impl PlanReport {
    /// The motion as RON: for `stylet run --motion`, or as a scenario's motion.
    ///
    /// # Errors
    /// [`Error::Internal`] when it cannot be written.
    pub fn motion_ron(&self) -> Result<String, Error> {
        motion_to_ron(&self.plan.motion).map_err(Error::internal)
    }

    /// `plan.json`.
    ///
    /// # Errors
    /// [`Error::Internal`] when it cannot be written.
    pub fn json(&self) -> Result<Vec<u8>, Error> {
        to_json_bytes(&self.plan)
    }

    /// The report.
    #[must_use]
    pub fn html(&self) -> String {
        plan_page::page(&self.scenario, self.verdict.clone(), &self.ground, &self.plan).to_html()
    }

    /// Writes the motion to `out`, and the plan with the endings `.json` and `.html`.
    ///
    /// # Errors
    /// [`Error::Output`] when a file cannot be written.
    pub fn write(&self, out: &Path) -> Result<(), Error> {
        if let Some(folder) = out.parent().filter(|p| !p.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|why| Error::output(out, why))?;
        }
        let motion = format!(
            "{MOTION_COMMENT} {}: a motion for `stylet run SCENARIO.ron --motion {}`.\n{}\n",
            env!("CARGO_PKG_VERSION"),
            one_line(&out.file_name().unwrap_or(out.as_os_str()).to_string_lossy()),
            self.motion_ron()?
        );
        write_file_atomically(&out.with_extension("json"), &self.json()?)?;
        write_file_atomically(&out.with_extension("html"), self.html().as_bytes())?;
        write_file_atomically(out, motion.as_bytes())
    }
}

/// Identifiability of the effects in an experiment.
pub struct IdentifiabilityReport {
    /// Result per effect, and groups of indistinguishable effects.
    pub identifiability: Identifiability,
    scenario: Scenario,
}

/// Identifiability with the scenario's motion, another `motion` (a file), or the recordings of the inputs. `progress` is called with the name
/// of each stage.
///
/// # Errors
/// Invalid inputs; [`Error::Request`] when there is neither a motion nor a recording.
pub fn identifiability(
    inputs: &DiagnosisInputs,
    motion: Option<&Path>,
    progress: &dyn Fn(&str),
) -> Result<IdentifiabilityReport, Error> {
    let mut scenario = inputs.load_scenario()?;
    if let Some(path) = motion {
        replace_motion(&mut scenario, path)?;
    }
    let recordings = inputs.read_recordings()?;
    if recordings.is_empty() && scenario.motion.plan().is_none() {
        return Err(Error::Request(
            "the scenario's motion is `Recorded`: give recordings with --data, or a motion with --motion"
                .to_owned(),
        ));
    }
    let failed = |why| Error::of_plan(&inputs.scenario, why);
    let ground = if recordings.is_empty() {
        stylet_plan::from_scenario(&scenario, None).map_err(failed)?.0
    } else {
        let report = diagnose(&scenario, &recordings, &Options::default(), |stage| progress(stage))?;
        stylet_plan::starting_information::from_recordings(&scenario, &report.details).map_err(failed)?
    };
    Ok(IdentifiabilityReport { identifiability: stylet_plan::identifiability(&ground), scenario })
}

impl IdentifiabilityReport {
    /// All files that `stylet identifiability` writes.
    ///
    /// # Errors
    /// [`Error::Internal`] when a value cannot be written.
    pub fn output(&self) -> Result<OutputFiles, Error> {
        let Self { identifiability: shown, scenario } = self;
        let mut output = OutputFiles::default();
        output.add("report.html", shown_page::page(scenario, shown).to_html());
        output.add_json("identifiability.json", shown)?;
        output.add("matrix.svg", shown_page::correlation_map(scenario, shown));
        Ok(output)
    }
}

/// Replaces a scenario's motion by the one in a file, such as `stylet plan` writes.
///
/// # Errors
/// An invalid file, or a motion that the scenario's robot cannot make.
pub fn replace_motion(scenario: &mut Scenario, motion: &Path) -> Result<(), Error> {
    scenario.motion = load_motion(motion)?;
    scenario.check().map_err(|p| Error::Request(format!("{}: {p}", motion.display())))
}
