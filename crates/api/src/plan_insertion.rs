//! Which insertion to make next, and what an experiment can show.

use crate::diagnose::diagnose;
use crate::diagnosis_inputs::DiagnosisInputs;
use crate::error::Error;
use crate::output_files::{OutputFiles, to_json_bytes};
use crate::output_folder::write_file_atomically;
use std::path::Path;
use stylet_diagnose::NamedRecording;
use stylet_plan::identifiability::Identifiability;
use stylet_plan::{InformationState, Limits, Plan};
use stylet_report::pages::{diagnosis, experiment_plan as plan_page, identifiability as shown_page};
use stylet_scenario::{Motion, Scenario, motion_to_ron};

/// A planned insertion, and what it was planned on.
pub struct PlanReport {
    /// The plan.
    pub plan: Plan,
    scenario: Scenario,
    verdict: Option<String>,
    ground: InformationState,
}

/// The limits of a file.
///
/// # Errors
/// [`Error::Input`] or [`Error::Request`] with what is wrong with them.
pub fn load_limits(file: &Path) -> Result<Limits, Error> {
    let limits: Limits = stylet_scenario::load(file)?;
    limits.check().map_err(|why| Error::of_plan(file, why))?;
    Ok(limits)
}

/// Plans the next insertion within the limits of a file: before any measurement, or after those of the inputs. With `simulated` the
/// best motions are tried by simulated insertions. `progress` is told what is being done.
///
/// # Errors
/// What is wrong with the inputs, or why no motion is within the limits.
pub fn plan(
    inputs: &DiagnosisInputs,
    (limits_file, limits): (&Path, &Limits),
    simulated: bool,
    progress: &dyn Fn(&str),
) -> Result<PlanReport, Error> {
    let scenario = Scenario::load(&inputs.scenario)?;
    let evidence = inputs.read_recordings()?;
    let at = [inputs.scenario.as_path(), limits_file];
    plan_after_recordings(scenario, &evidence, limits, simulated, at, progress)
}

/// Plans the next insertion after recordings that are at hand, or, without any, before the first. `named`: what messages call the
/// scenario and the limits.
///
/// # Errors
/// What is wrong with scenario or recordings, or why no motion is within the limits.
pub fn plan_after_recordings(
    scenario: Scenario,
    evidence: &[NamedRecording],
    limits: &Limits,
    simulated: bool,
    named: [&Path; 2],
    progress: &dyn Fn(&str),
) -> Result<PlanReport, Error> {
    let failed = |why| Error::of_plan(named[0], why);
    let (diagnosed, (ground, begin)) = if evidence.is_empty() {
        (None, stylet_plan::from_scenario(&scenario, None).map_err(failed)?)
    } else {
        let found = diagnose(&scenario, evidence, |what| progress(what))?;
        let start = stylet_plan::from_diagnosis(&scenario, &found.details).map_err(failed)?;
        (Some(found), start)
    };
    progress("looking for the motion that tells most");
    let (mut plan, found) =
        stylet_plan::plan(&ground, limits, &begin).map_err(|why| Error::of_plan(named[1], why))?;
    if simulated {
        plan = stylet_plan::check_by_simulation(&found, limits, &scenario, &ground, evidence, progress)
            .map_err(failed)?;
    }
    let verdict = diagnosed.map(|d| diagnosis::summary_sentence(&d.diagnosis));
    Ok(PlanReport { plan, scenario, verdict, ground })
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

    /// Writes the motion to `out`, and the plan beside it as JSON and as a page.
    ///
    /// # Errors
    /// [`Error::Output`] when a file cannot be written.
    pub fn write(&self, out: &Path) -> Result<(), Error> {
        if let Some(folder) = out.parent().filter(|p| !p.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|why| Error::output(out, why))?;
        }
        let motion = format!(
            "// The next insertion, planned by stylet {}: a motion for `stylet run SCENARIO.ron --motion {}`.\n{}\n",
            env!("CARGO_PKG_VERSION"),
            out.file_name().unwrap_or(out.as_os_str()).to_string_lossy(),
            self.motion_ron()?
        );
        write_file_atomically(&out.with_extension("json"), &self.json()?)?;
        write_file_atomically(&out.with_extension("html"), self.html().as_bytes())?;
        write_file_atomically(out, motion.as_bytes())
    }
}

/// What an experiment can show.
pub struct IdentifiabilityReport {
    /// Effect by effect, and which resemble one another.
    pub identifiability: Identifiability,
    scenario: Scenario,
}

/// What the scenario's motion can show, or another `motion` (a file), or the recordings of the inputs. `progress` is told what is being
/// done.
///
/// # Errors
/// What is wrong with the inputs; [`Error::Request`] when there is neither a motion nor a recording.
pub fn identifiability(
    inputs: &DiagnosisInputs,
    motion: Option<&Path>,
    progress: &dyn Fn(&str),
) -> Result<IdentifiabilityReport, Error> {
    let mut scenario = Scenario::load(&inputs.scenario)?;
    if let Some(path) = motion {
        replace_motion(&mut scenario, path)?;
    }
    let evidence = inputs.read_recordings()?;
    if evidence.is_empty() && scenario.motion.plan().is_none() {
        return Err(Error::Request(
            "the scenario's motion is `Recorded`: give recordings with --data, or a motion with --motion"
                .to_owned(),
        ));
    }
    let failed = |why| Error::of_plan(&inputs.scenario, why);
    let ground = if evidence.is_empty() {
        stylet_plan::from_scenario(&scenario, None).map_err(failed)?.0
    } else {
        let found = diagnose(&scenario, &evidence, |what| progress(what))?;
        stylet_plan::starting_information::from_recordings(&scenario, &found.details).map_err(failed)?
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

/// Gives a scenario the motion of a file, such as one that a plan wrote.
///
/// # Errors
/// What is wrong with the file, or why the scenario cannot be carried along.
pub fn replace_motion(scenario: &mut Scenario, motion: &Path) -> Result<(), Error> {
    scenario.motion = stylet_scenario::load::<Motion>(motion)?;
    scenario.check().map_err(|p| Error::Request(format!("{}: {p}", motion.display())))
}
