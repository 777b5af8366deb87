//! Comparison of algorithms on the same simulated insertions: one row of errors per scenario and algorithm.

use crate::sampling_design::sampling_phase;
use crate::trial_simulation::{self, Workspace};
use rayon::prelude::*;
use serde::Serialize;
use stylet_core::config::Algorithm;
use stylet_scenario::Scenario;
use stylet_score::Score;
use stylet_stats::{Interval, Z95, quantile_interval, wilson};
use stylet_testbed::SimulateError;

/// Median and 95th percentile.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct DelayQuantiles {
    /// Median.
    pub median: Option<f64>,
    /// 95th percentile.
    pub p95: Option<f64>,
}

/// Share of true values inside the 95 % intervals; `null` for an algorithm without intervals.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    /// Of stiffness, over layers.
    pub stiffness: Option<f64>,
    /// Of friction, over layers.
    pub friction: Option<f64>,
    /// Of friction along the shaft.
    pub cumulative_friction: Option<f64>,
    /// Of the tip's force, over samples.
    pub tip_force: Option<f64>,
}

/// One row of the table.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ComparisonRow {
    /// Scenario, or type of case.
    pub scenario: String,
    /// Algorithm.
    pub algorithm: String,
    /// Insertions.
    pub seeds: u64,
    /// True ruptures in all of them.
    pub ruptures: usize,
    /// Ruptures without a detection.
    pub missed: usize,
    /// Detections without a rupture.
    #[serde(rename = "false")]
    pub false_alarms: usize,
    /// Missed and false per rupture, with its 95 % interval.
    pub errors_per_rupture: [f64; 3],
    /// Detected minus true rupture time in s.
    pub delay_s: DelayQuantiles,
    /// Median relative error per layer.
    pub stiffness_error: Vec<Option<f64>>,
    /// The medians' 95 % intervals.
    pub stiffness_error_interval: Vec<Option<[f64; 2]>>,
    /// Median relative error per layer.
    pub friction_error: Vec<Option<f64>>,
    /// Median of the RMS of estimated minus true friction force, relative to the RMS of the tip force.
    pub enhancement_rms_relative: Option<f64>,
    /// The median's 95 % interval.
    pub enhancement_interval: Option<[f64; 2]>,
    /// The same for enhanced minus true tip force, sensor noise included.
    pub enhancement_with_noise: Option<f64>,
    /// Coverage of the 95 % intervals.
    pub coverage: Coverage,
}

/// Detections and errors of the insertions of one row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DetectionCounts {
    /// Ruptures without a detection.
    pub missed: usize,
    /// Detections without a rupture.
    pub false_alarms: usize,
    /// Detected minus true rupture times in s.
    pub delays_s: Vec<f64>,
    /// True ruptures.
    pub ruptures: usize,
}

impl ComparisonRow {
    /// A row with detection errors only; the caller adds estimates where true parameters are known.
    #[must_use]
    pub fn new(scenario: &str, algorithm: &str, seeds: u64, scored: &DetectionCounts) -> Self {
        let delays = stylet_stats::sorted(scored.delays_s.iter().copied());
        let quantile = |q| Some(stylet_stats::quantile_of_sorted(&delays, q)).filter(|x| x.is_finite());
        Self {
            scenario: scenario.to_owned(),
            algorithm: algorithm.to_owned(),
            seeds,
            ruptures: scored.ruptures,
            missed: scored.missed,
            false_alarms: scored.false_alarms,
            errors_per_rupture: per_rupture(scored.missed + scored.false_alarms, scored.ruptures),
            delay_s: DelayQuantiles { median: quantile(0.5), p95: quantile(0.95) },
            ..Self::default()
        }
    }
}

/// Errors per rupture with a 95 % interval: Wilson's, or the normal interval of a Poisson count where there are more errors than
/// ruptures.
fn per_rupture(errors: usize, ruptures: usize) -> [f64; 3] {
    let (n, of) = (errors as f64, ruptures as f64);
    if errors <= ruptures {
        let share = wilson(errors, ruptures);
        return [share.value, share.low, share.high];
    }
    let half = Z95 * n.sqrt();
    [n, (n - half).max(0.0), n + half].map(|x| x / of)
}

/// Name of an algorithm in scenario files.
#[must_use]
pub const fn algorithm_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Paper => "Paper",
        Algorithm::Literal => "Literal",
        Algorithm::Stylet => "Stylet",
    }
}

/// Runs an algorithm on a scenario with `seeds` seeds, counted from the scenario's; calls `done` after each insertion. A seed draws the
/// noise and the sampling phase, the position of the samples relative to the start of the motion, so that faces do not always coincide
/// with samples. The draws of a seed are the same for every algorithm.
///
/// # Errors
/// [`SimulateError`] when the scenario cannot be replayed.
pub fn compare_algorithm(
    scenario: &Scenario,
    algorithm: Algorithm,
    seeds: u64,
    done: &(dyn Fn(u64) + Sync),
) -> Result<ComparisonRow, SimulateError> {
    let mut scenario = scenario.clone();
    scenario.enhance.algorithm = algorithm;
    // In the order of the seeds, so that the result does not depend on the number of threads.
    let scores: Vec<Score> = (0..seeds)
        .into_par_iter()
        .map_init(Workspace::default, |workspace, seed| {
            let mut scenario = scenario.clone();
            scenario.seed = scenario.seed.wrapping_add(seed);
            let score = trial_simulation::run_with_sampling_phase(
                &scenario,
                sampling_phase(scenario.seed),
                workspace,
            );
            done(1);
            score
        })
        .collect::<Result<_, _>>()?;
    let scored = DetectionCounts {
        ruptures: scores.iter().map(|s| s.ruptures.len()).sum(),
        missed: scores.iter().map(|s| s.missed).sum(),
        false_alarms: scores.iter().map(|s| s.false_alarms).sum(),
        delays_s: scores.iter().flat_map(|s| s.ruptures.iter().filter_map(|r| r.delay_s)).collect(),
    };
    let layers = scores.iter().flat_map(|s| s.layers.iter().map(|l| l.layer)).max().unwrap_or(0);
    let of_layers = |what: &dyn Fn(&stylet_score::LayerScore) -> Option<f64>| -> Vec<Option<Interval>> {
        (1..=layers)
            .map(|number| {
                let all = scores.iter().flat_map(|s| s.layers.iter().filter(|l| l.layer == number));
                median(all.filter_map(what))
            })
            .collect()
    };
    let share = |of: &dyn Fn(&stylet_score::Coverage) -> [f64; 2]| {
        let (inside, all) = scores.iter().fold((0.0, 0.0), |(i, n), s| {
            let [inside, of] = of(&s.coverage);
            (i + inside, n + of)
        });
        (all > 0.0).then(|| inside / all)
    };
    let value = |x: &Option<Interval>| x.map(|x| x.value);
    let ends = |x: &Option<Interval>| x.map(|x| [x.low, x.high]);
    let stiffness = of_layers(&|l| l.stiffness_n_per_m.relative_error);
    let friction = of_layers(&|l| l.friction_ns_per_m2.relative_error);
    let enhancement = median(scores.iter().filter_map(|s| s.enhancement.friction_rms_relative));
    let with_noise = median(scores.iter().filter_map(|s| s.enhancement.rms_relative));
    Ok(ComparisonRow {
        stiffness_error: stiffness.iter().map(value).collect(),
        stiffness_error_interval: stiffness.iter().map(ends).collect(),
        friction_error: friction.iter().map(value).collect(),
        enhancement_rms_relative: value(&enhancement),
        enhancement_interval: ends(&enhancement),
        enhancement_with_noise: value(&with_noise),
        coverage: Coverage {
            stiffness: share(&|c| c.stiffness),
            friction: share(&|c| c.friction),
            cumulative_friction: share(&|c| c.cumulative),
            tip_force: share(&|c| c.band),
        },
        ..ComparisonRow::new(&scenario.name, algorithm_name(algorithm), seeds, &scored)
    })
}

/// The median with its 95 % interval between order statistics.
fn median(values: impl Iterator<Item = f64>) -> Option<Interval> {
    quantile_interval(&stylet_stats::sorted(values.filter(|x| x.is_finite())), 0.5)
}
