//! Draws the scenario of a trial from its number.

use crate::sampling_design::{SamplingDesign, trial_seed};
use crate::sweep_file::Sweep;
use stylet_scenario::{Scenario, set_fields};

/// Consecutive invalid draws after which the sweep fails.
pub const MAX_DRAW_ATTEMPTS: u32 = 100;

/// A drawn trial.
#[derive(Clone, Debug)]
pub struct SampledTrial {
    /// Number of the trial, from 0.
    pub trial: u64,
    /// Seed of its noise.
    pub seed: u64,
    /// Number of draws rejected because their scenario is invalid.
    pub redrawn: u32,
    /// Values of `vary`, then 1 or 0 for each effect of the sweep.
    pub values: Vec<f64>,
    /// The scenario.
    pub scenario: Scenario,
}

/// Every draw of a trial was invalid.
#[derive(Clone, Debug, thiserror::Error)]
#[error(
    "trial {trial}: {MAX_DRAW_ATTEMPTS} consecutive draws make no valid scenario; the last: {why}; narrow the distributions"
)]
pub struct SamplingError {
    /// Number of the trial.
    pub trial: u64,
    /// Why the last draw is invalid.
    pub why: String,
}

/// Draws the trials of a sweep.
#[derive(Clone, Debug)]
pub struct TrialSampler<'a> {
    sweep: &'a Sweep,
    design: SamplingDesign,
}

impl<'a> TrialSampler<'a> {
    /// A sampler of the sweep's trials.
    #[must_use]
    pub fn new(sweep: &'a Sweep) -> Self {
        let file = &sweep.file;
        Self { sweep, design: SamplingDesign::new(file.sampling, file.seed, file.trials, sweep.dimensions()) }
    }

    /// Trial `trial`, a function of scenario, sweep, seed and trial number.
    ///
    /// # Errors
    /// [`SamplingError`] when no draw is valid.
    pub fn draw(&self, trial: u64) -> Result<SampledTrial, SamplingError> {
        let mut point = vec![0.0; self.sweep.dimensions()];
        let mut why = String::new();
        for redrawn in 0..MAX_DRAW_ATTEMPTS {
            self.design.point(trial, redrawn, &mut point);
            let (values, scenario) = self.scenario(trial, &point);
            match scenario {
                Ok(scenario) => {
                    return Ok(SampledTrial { trial, seed: scenario.seed, redrawn, values, scenario });
                }
                Err(problem) => why = problem,
            }
        }
        Err(SamplingError { trial, why })
    }

    fn scenario(&self, trial: u64, point: &[f64]) -> (Vec<f64>, Result<Scenario, String>) {
        let sweep = self.sweep;
        let (drawn, switches) = point.split_at(sweep.fields.len());
        let mut values: Vec<f64> = sweep
            .fields
            .iter()
            .zip(&sweep.file.vary)
            .zip(drawn)
            .map(|((field, vary), u)| field.round_to_type(vary.with.quantile(*u)))
            .collect();
        let on: Vec<bool> =
            sweep.file.effects.iter().zip(switches).map(|(e, u)| *u < e.probability).collect();
        let mut scenario = sweep.template.clone();
        scenario.seed = trial_seed(sweep.file.seed, trial);
        let set = set_fields(&mut scenario, &sweep.fields, &values);
        let mut index = 0;
        scenario.effects.retain(|_| {
            index += 1;
            index <= sweep.scenario_effects
                || on.get(index - 1 - sweep.scenario_effects).copied().unwrap_or(false)
        });
        if !sweep.fields.iter().any(|f| f.path() == "physics_hz") {
            // The replay takes no physics steps; the rate is kept valid for the rigid-body simulation.
            let steps = libm::rint(sweep.template.physics_hz / scenario.sample_hz).max(1.0);
            scenario.physics_hz = steps * scenario.sample_hz;
        }
        values.extend(on.iter().map(|on| f64::from(u8::from(*on))));
        let checked = set.and_then(|()| scenario.check().map_err(|p| p.to_string())).map(|()| scenario);
        (values, checked)
    }
}
