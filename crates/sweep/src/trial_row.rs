//! The result of a trial as a row: drawn values, then scores, in a fixed order.

use crate::sample_trial::SampledTrial;
use crate::sweep_file::Sweep;
use stylet_score::{EstimateError, Score};
use stylet_tissue::Effect;

/// The row of one trial.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrialRow {
    /// Number of the trial, from 0.
    pub trial: u64,
    /// Seed of its noise.
    pub seed: u64,
    /// Number of draws rejected because their scenario is invalid.
    pub redrawn: u64,
    /// Drawn values, then scores; NaN where a score does not exist.
    pub values: Vec<f64>,
}

/// Names of the columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    /// Drawn quantities: paths, and `effect.<id>` for effects that are on (1) or off (0).
    pub drawn: Vec<String>,
    /// Scores, by their path in `score.json`.
    pub scores: Vec<String>,
    layers: usize,
}

/// Scores of the whole trial.
const TRIAL_SCORES: [&str; 10] = [
    "ruptures",
    "missed",
    "false",
    "hits_are_chance",
    "cumulative_friction_ns_per_m.relative_error",
    "contact_m.error",
    "enhancement.rms_relative",
    "enhancement.in_tissue_relative",
    "enhancement.after_exit_relative",
    "reconstruction_rms_n",
];

/// Scores per layer.
const LAYER_SCORES: [&str; 4] = [
    "stiffness_n_per_m.relative_error",
    "friction_ns_per_m2.relative_error",
    "thickness_m.relative_error",
    "cumulative_friction_ns_per_m.relative_error",
];

impl Columns {
    /// The columns of a sweep.
    #[must_use]
    pub fn new(sweep: &Sweep) -> Self {
        let layers = sweep.template.tissue.layers.len();
        let mut drawn: Vec<String> = sweep.file.vary.iter().map(|v| v.path.clone()).collect();
        for (i, random) in sweep.file.effects.iter().enumerate() {
            let id = random.effect.id();
            let before = sweep.file.effects[..i].iter().filter(|e| e.effect.id() == id).count();
            let again = if before > 0 { format!(".{}", before + 1) } else { String::new() };
            drawn.push(format!("effect.{id}{again}"));
        }
        let mut scores: Vec<String> = TRIAL_SCORES.iter().map(|s| (*s).to_owned()).collect();
        for layer in 0..layers {
            scores.push(format!("ruptures[{layer}].delay_s"));
            scores.push(format!("ruptures[{layer}].delay_mm"));
            scores.extend(LAYER_SCORES.iter().map(|s| format!("layers[{layer}].{s}")));
        }
        Self { drawn, scores, layers }
    }

    /// All names, in the order of a written row.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        ["trial", "seed", "redrawn"]
            .into_iter()
            .chain(self.drawn.iter().chain(&self.scores).map(String::as_str))
    }

    /// Number of values of a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.drawn.len() + self.scores.len()
    }

    /// Index of a score in [`TrialRow::values`].
    #[must_use]
    pub fn score(&self, name: &str) -> Option<usize> {
        self.scores.iter().position(|s| s == name).map(|i| self.drawn.len() + i)
    }

    /// The row of a trial.
    #[must_use]
    pub fn row(&self, drawn: &SampledTrial, score: &Score) -> TrialRow {
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let error = |c: &EstimateError| or_nan(c.relative_error);
        let mut values = Vec::with_capacity(self.width());
        values.extend(&drawn.values);
        values.extend([
            score.ruptures.len() as f64,
            score.missed as f64,
            score.false_alarms as f64,
            f64::from(u8::from(score.hits_are_chance)),
            error(&score.cumulative_friction_ns_per_m),
            or_nan(score.contact_m.estimated.map(|found| found - score.contact_m.truth)),
            or_nan(score.enhancement.rms_relative),
            or_nan(score.enhancement.in_tissue_relative),
            or_nan(score.enhancement.after_exit_relative),
            or_nan(score.reconstruction_rms_n),
        ]);
        for layer in 1..=self.layers {
            let rupture = score.ruptures.iter().find(|r| r.layer == layer);
            values.push(or_nan(rupture.and_then(|r| r.delay_s)));
            values.push(or_nan(rupture.and_then(|r| r.delay_mm)));
            match score.layers.iter().find(|l| l.layer == layer) {
                Some(l) => values.extend([
                    error(&l.stiffness_n_per_m),
                    error(&l.friction_ns_per_m2),
                    error(&l.thickness_m),
                    error(&l.cumulative_friction_ns_per_m),
                ]),
                None => values.extend([f64::NAN; LAYER_SCORES.len()]),
            }
        }
        TrialRow { trial: drawn.trial, seed: drawn.seed, redrawn: u64::from(drawn.redrawn), values }
    }
}
