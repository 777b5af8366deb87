//! A validated sweep file with its scenario.

use crate::sampling_design::MAX_SOBOL_DIMENSIONS;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use stylet_scenario::{
    FieldError, InputError, Robot, Sampling, Scenario, ScenarioField, Sensor, SweepFile, read_text,
};

/// Largest number of trials, which bounds row numbers and memory.
const MAX_TRIALS: u64 = 100_000_000;

/// Values from the command line that replace those of the file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overrides {
    /// Number of trials.
    pub trials: Option<u64>,
    /// Seed.
    pub seed: Option<u64>,
}

/// A validated sweep with its scenario.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Name: the stem of the file name.
    pub name: String,
    /// The file as written, with the overrides.
    pub file: SweepFile,
    /// The scenario for the kinematic replay, with the effects of the sweep appended.
    pub template: Scenario,
    /// Number of the template's effects that belong to the scenario.
    pub scenario_effects: usize,
    /// The fields that are drawn, in the order of `vary`.
    pub fields: Vec<ScenarioField>,
}

impl Sweep {
    /// Loads and checks a sweep file and its scenario.
    ///
    /// # Errors
    /// [`InputError`] with file, line, column, the problem and its remedy.
    pub fn load(path: &Path, overrides: Overrides) -> Result<Self, InputError> {
        let text = read_text(path)?;
        let shown = path.display().to_string();
        let mut file = SweepFile::parse(&shown, &text)?;
        file.trials = overrides.trials.unwrap_or(file.trials);
        file.seed = overrides.seed.unwrap_or(file.seed);
        let scenario_path = path.parent().unwrap_or(Path::new("")).join(&file.scenario);
        let scenario = Scenario::load(&scenario_path)?;
        let name = path.file_stem().map_or_else(|| shown.clone(), |s| s.to_string_lossy().into_owned());
        Self::new(name, file, scenario).map_err(|problem| problem.in_file(&shown, &text))
    }

    /// A sweep over a loaded scenario.
    ///
    /// # Errors
    /// [`FieldError`] with the path of the field of the sweep that is wrong.
    pub fn new(name: String, file: SweepFile, scenario: Scenario) -> Result<Self, FieldError> {
        if file.trials == 0 || file.trials > MAX_TRIALS {
            let what = format!("is {}; it must lie between 1 and {MAX_TRIALS}", file.trials);
            return Err(FieldError::new("trials", what));
        }
        let own_effects = scenario.effects.len();
        let mut template = as_replayed(scenario)?;
        for (i, random) in file.effects.iter().enumerate() {
            let at = format!("effects[{i}].probability");
            if !(0.0..=1.0).contains(&random.probability) {
                let what = format!("is {}; it must lie between 0 and 1", random.probability);
                return Err(FieldError::new(at, what));
            }
            // Each effect is validated alone.
            template.effects.push(random.effect.clone());
            template.check().map_err(|p| in_sweep(&p, own_effects, i))?;
            template.effects.truncate(own_effects);
        }
        template.effects.extend(file.effects.iter().map(|random| random.effect.clone()));
        let mut fields: Vec<ScenarioField> = Vec::with_capacity(file.vary.len());
        for (i, vary) in file.vary.iter().enumerate() {
            let at = format!("vary[{i}].path");
            vary.with.check(&format!("vary[{i}].with"))?;
            if let Some(first) = file.vary[..i].iter().position(|earlier| earlier.path == vary.path) {
                let what = format!("`{}` is drawn twice; vary[{first}] draws it already", vary.path);
                return Err(FieldError::new(at, what));
            }
            fields
                .push(ScenarioField::find(&template, &vary.path).map_err(|what| FieldError::new(at, what))?);
        }
        let dimensions = file.vary.len() + file.effects.len();
        if file.sampling == Sampling::Sobol && dimensions > MAX_SOBOL_DIMENSIONS {
            let what = format!(
                "is Sobol with {dimensions} quantities; it serves up to {MAX_SOBOL_DIMENSIONS}, use LatinHypercube"
            );
            return Err(FieldError::new("sampling", what));
        }
        Ok(Self { name, file, template, scenario_effects: own_effects, fields })
    }

    /// Number of trials.
    #[must_use]
    pub fn trials(&self) -> u64 {
        self.file.trials
    }

    /// Number of coordinates of a trial's point.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.file.vary.len() + self.file.effects.len()
    }

    /// The sweep as a file over `scenario.ron` in the same folder, with the overrides.
    #[must_use]
    pub fn to_ron(&self) -> String {
        SweepFile { scenario: PathBuf::from("scenario.ron"), ..self.file.clone() }.to_ron()
    }

    /// The scenario of [`Sweep::to_ron`], without the sweep's effects.
    #[must_use]
    pub fn scenario(&self) -> Scenario {
        let mut scenario = self.template.clone();
        scenario.effects.truncate(self.scenario_effects);
        scenario
    }

    /// SHA-256 over everything that determines the results: resolved scenario, sweep, seed, trials, version.
    #[must_use]
    pub fn identity(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        let file = SweepFile { scenario: PathBuf::new(), ..self.file.clone() };
        for part in [self.template.to_json(), file.to_json()] {
            hash.update(part);
            hash.update([0]);
        }
        hex(&hash.finalize())
    }
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Translates the path of an error in the sweep's effect `index`, validated as effect `scenario_effects` of the scenario.
fn in_sweep(problem: &FieldError, scenario_effects: usize, index: usize) -> FieldError {
    let prefix = format!("effects[{scenario_effects}]");
    match problem.path.strip_prefix(&prefix) {
        Some(rest) => FieldError::new(format!("effects[{index}].effect{rest}"), problem.message.clone()),
        None => problem.clone(),
    }
}

/// The scenario for the kinematic replay: no rigid bodies, one model, the force/torque sensor.
fn as_replayed(mut scenario: Scenario) -> Result<Scenario, FieldError> {
    if scenario.motion.plan().is_none() {
        let what =
            "has the motion `Recorded`; a sweep needs one that it can carry out, for example Constant(...)";
        return Err(FieldError::new("scenario", what));
    }
    if !matches!(scenario.sensor, Sensor::ForceTorque(_)) {
        let what = "has a virtual sensor, which needs an arm; sweeps replay the motion: use sensor: ForceTorque(...)";
        return Err(FieldError::new("scenario", what));
    }
    scenario.robot = Robot::Replay;
    scenario.compare.clear();
    Ok(scenario)
}
