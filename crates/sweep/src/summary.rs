//! Summary statistics of a sweep: rates, quantiles, worst trials, and the sensitivity of outcomes to the drawn quantities.

use crate::sensitivity::first_order;
use crate::sweep_file::Sweep;
use crate::trial_row::{Columns, TrialRow};
use crate::trial_table::TrialTable;
use serde::{Deserialize, Serialize};
use stylet_stats::{Interval, quantile_interval, sorted, spearman, wilson};

/// Number of worst trials listed.
const MAX_WORST_TRIALS: usize = 20;

/// A score over all trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreSummary {
    /// Its path in `score.json`.
    pub score: String,
    /// Trials that have it.
    pub trials: usize,
    /// Median with its 95 % interval between order statistics.
    pub median: Interval,
    /// 95th percentile with its interval.
    pub p95: Interval,
    /// Largest value and the trial that has it.
    pub worst: f64,
    /// That trial.
    pub worst_trial: u64,
}

/// One of the worst trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorstTrial {
    /// Number of the trial.
    pub trial: u64,
    /// Ruptures missed.
    pub missed: u64,
    /// False detections.
    #[serde(rename = "false")]
    pub false_alarms: u64,
    /// Enhancement error, relative.
    pub enhancement: Option<f64>,
    /// The drawn values.
    pub drawn: Vec<f64>,
    /// Command that repeats the trial with a full report.
    pub replay: String,
}

/// Sensitivity of an outcome to one drawn quantity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuantitySensitivity {
    /// The quantity.
    pub quantity: String,
    /// Spearman's rank correlation; `None` when either is constant.
    pub rank_correlation: Option<f64>,
    /// Its two-sided p-value.
    pub p_value: Option<f64>,
    /// First-order Sobol index.
    pub first_order: Option<f64>,
}

/// An outcome and its sensitivity to each quantity, largest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutcomeSensitivity {
    /// The outcome.
    pub outcome: String,
    /// The quantities.
    pub by: Vec<QuantitySensitivity>,
}

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Name of the sweep.
    pub sweep: String,
    /// Name of its scenario.
    pub scenario: String,
    /// Version of Stylet.
    pub version: String,
    /// Hash over all that the results depend on.
    pub identity: String,
    /// Number of trials.
    pub trials: usize,
    /// Seed.
    pub seed: u64,
    /// Sampling method.
    pub sampling: String,
    /// Trials whose first draw was invalid.
    pub redrawn: usize,
    /// True ruptures of all trials.
    pub ruptures: u64,
    /// Missed ruptures per rupture.
    pub missed: Interval,
    /// False detections of all trials.
    #[serde(rename = "false")]
    pub false_alarms: u64,
    /// Trials with a false detection.
    pub trials_with_false: Interval,
    /// Trials with a missed or false rupture.
    pub failed: Interval,
    /// Every other score.
    pub scores: Vec<ScoreSummary>,
    /// Names of the drawn quantities.
    pub drawn: Vec<String>,
    /// The worst trials first.
    pub worst: Vec<WorstTrial>,
    /// Sensitivity of the outcomes to the drawn quantities.
    pub explained: Vec<OutcomeSensitivity>,
}

/// Whether the trial has a missed or false rupture.
#[must_use]
pub fn failed(columns: &Columns, row: &TrialRow) -> bool {
    ["missed", "false"].iter().any(|s| score_value(columns, row, s) > 0.0)
}

/// A score of a row; NaN if missing.
#[must_use]
pub fn score_value(columns: &Columns, row: &TrialRow, score: &str) -> f64 {
    columns.score(score).and_then(|i| row.values.get(i)).copied().unwrap_or(f64::NAN)
}

/// Whether the score is signed; its magnitude is summarised.
fn is_signed(score: &str) -> bool {
    score.starts_with("contact_m") || score.contains("delay")
}

/// A score of all rows; NaN where it does not exist.
pub(crate) fn score_column<T: TrialTable + ?Sized>(
    columns: &Columns,
    rows: &T,
    score: &str,
) -> Result<Vec<f64>, T::Error> {
    columns.score(score).map_or_else(|| Ok(vec![f64::NAN; rows.count()]), |value| rows.column(value))
}

/// Summarises a sweep. `replay` is the folder in the replay commands. Holds a few columns in memory at a time, not the rows.
///
/// # Errors
/// When the rows cannot be read.
pub fn summarise<T: TrialTable + ?Sized>(
    sweep: &Sweep,
    columns: &Columns,
    rows: &T,
    replay: &str,
) -> Result<Summary, T::Error> {
    let sum = |name: &str| Ok::<f64, T::Error>(score_column(columns, rows, name)?.iter().sum::<f64>());
    let trials = rows.count();
    let counted = ["ruptures", "missed", "false", "hits_are_chance"];
    let mut scores = Vec::new();
    for name in columns.scores.iter().filter(|s| !counted.contains(&s.as_str())) {
        scores.extend(summary_of(name, score_column(columns, rows, name)?));
    }
    let (mut redrawn, mut failures) = (0, 0);
    rows.for_each_row(|row| {
        redrawn += usize::from(row.redrawn > 0);
        failures += usize::from(failed(columns, row));
    })?;
    let with_false = score_column(columns, rows, "false")?.iter().filter(|count| **count > 0.0).count();
    Ok(Summary {
        sweep: sweep.name.clone(),
        scenario: sweep.template.name.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        identity: sweep.identity(),
        trials,
        seed: sweep.file.seed,
        sampling: format!("{:?}", sweep.file.sampling),
        redrawn,
        ruptures: sum("ruptures")? as u64,
        missed: wilson(sum("missed")? as usize, sum("ruptures")? as usize),
        false_alarms: sum("false")? as u64,
        trials_with_false: wilson(with_false, trials),
        failed: wilson(failures, trials),
        scores,
        drawn: columns.drawn.clone(),
        worst: worst(columns, rows, replay)?,
        explained: outcome_sensitivities(columns, rows)?,
    })
}

/// A score over all trials; `None` when no trial has it.
fn summary_of(name: &str, mut values: Vec<f64>) -> Option<ScoreSummary> {
    if is_signed(name) {
        values.iter_mut().for_each(|x| *x = x.abs());
    }
    let worst = values
        .iter()
        .zip(0_u64..)
        .filter(|(x, _)| !x.is_nan())
        .max_by(|a, b| a.0.total_cmp(b.0).then(b.1.cmp(&a.1)))
        .map(|(x, trial)| (*x, trial))?;
    let all = sorted(values);
    Some(ScoreSummary {
        score: name.to_owned(),
        trials: all.len(),
        median: quantile_interval(&all, 0.5)?,
        p95: quantile_interval(&all, 0.95)?,
        worst: worst.0,
        worst_trial: worst.1,
    })
}

fn worst<T: TrialTable + ?Sized>(
    columns: &Columns,
    rows: &T,
    replay: &str,
) -> Result<Vec<WorstTrial>, T::Error> {
    let mut errors = score_column(columns, rows, "missed")?;
    errors.iter_mut().zip(score_column(columns, rows, "false")?).for_each(|(errors, more)| *errors += more);
    let off: Vec<f64> = score_column(columns, rows, "enhancement.rms_relative")?;
    let off = |place: usize| if off[place].is_nan() { f64::INFINITY } else { off[place] };
    let mut order: Vec<usize> = (0..rows.count()).collect();
    order.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(off(b).total_cmp(&off(a))).then(a.cmp(&b)));
    order.truncate(MAX_WORST_TRIALS);
    let mut worst = Vec::with_capacity(order.len());
    for place in order {
        let r = rows.row(place)?;
        worst.push(WorstTrial {
            trial: r.trial,
            missed: score_value(columns, &r, "missed") as u64,
            false_alarms: score_value(columns, &r, "false") as u64,
            enhancement: Some(score_value(columns, &r, "enhancement.rms_relative")).filter(|x| !x.is_nan()),
            drawn: r.values[..columns.drawn.len()].to_vec(),
            replay: format!("stylet replay {replay} {}", r.trial),
        });
    }
    Ok(worst)
}

/// Outcomes for which sensitivities are computed: name and the scores that are summed.
const OUTCOMES: [(&str, &[&str]); 4] = [
    ("missed and false ruptures", &["missed", "false"]),
    ("missed ruptures", &["missed"]),
    ("false ruptures", &["false"]),
    ("enhancement error", &["enhancement.rms_relative"]),
];

fn outcome_sensitivities<T: TrialTable + ?Sized>(
    columns: &Columns,
    rows: &T,
) -> Result<Vec<OutcomeSensitivity>, T::Error> {
    let mut found = Vec::new();
    for (outcome, scores) in OUTCOMES {
        // Start from -0.0, the neutral element of addition.
        let mut y = vec![-0.0; rows.count()];
        for name in scores {
            y.iter_mut().zip(score_column(columns, rows, name)?).for_each(|(sum, x)| *sum += x);
        }
        let there: Vec<bool> = y.iter().map(|y| !y.is_nan()).collect();
        y.retain(|y| !y.is_nan());
        let mut by = Vec::with_capacity(columns.drawn.len());
        for (i, quantity) in columns.drawn.iter().enumerate() {
            let mut x = rows.column(i)?;
            let mut kept = there.iter();
            x.retain(|_| kept.next().is_some_and(|there| *there));
            let rank = spearman(&x, &y);
            by.push(QuantitySensitivity {
                quantity: quantity.clone(),
                rank_correlation: rank.map(|r| r.0),
                p_value: rank.map(|r| r.1),
                first_order: first_order(&x, &y),
            });
        }
        by.sort_by(|a, b| {
            let key = |e: &QuantitySensitivity| e.first_order.unwrap_or(-1.0);
            key(b).total_cmp(&key(a)).then(a.quantity.cmp(&b.quantity))
        });
        if by.iter().any(|e| e.first_order.is_some() || e.rank_correlation.is_some()) {
            found.push(OutcomeSensitivity { outcome: outcome.to_owned(), by });
        }
    }
    Ok(found)
}
