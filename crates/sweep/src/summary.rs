//! What the rows say together: rates, medians, the worst trials, and which drawn quantity explains
//! the failures.

use crate::row::{Columns, Row};
use crate::sensitivity::first_order;
use crate::sweep::Sweep;
use serde::{Deserialize, Serialize};
use stylet_stats::{Interval, quantile_interval, sorted, spearman, wilson};

/// How many of the worst trials are listed.
const WORST: usize = 20;

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
    /// What runs it again with a full report.
    pub replay: String,
}

/// How much of an outcome one drawn quantity explains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explained {
    /// The quantity.
    pub quantity: String,
    /// Spearman's rank correlation; none when either does not vary.
    pub rank_correlation: Option<f64>,
    /// Its two-sided p-value.
    pub p_value: Option<f64>,
    /// First-order Sobol index.
    pub first_order: Option<f64>,
}

/// An outcome and what explains it, the strongest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The outcome.
    pub outcome: String,
    /// The quantities.
    pub by: Vec<Explained>,
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
    /// How the points were spread.
    pub sampling: String,
    /// Trials whose first draw no scenario allows.
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
    /// Trials that missed a rupture or alarmed falsely.
    pub failed: Interval,
    /// Every other score.
    pub scores: Vec<ScoreSummary>,
    /// Names of the drawn quantities.
    pub drawn: Vec<String>,
    /// The worst trials first.
    pub worst: Vec<WorstTrial>,
    /// What explains the outcomes.
    pub explained: Vec<Outcome>,
}

/// Whether the trial missed a rupture or alarmed falsely.
#[must_use]
pub fn failed(columns: &Columns, row: &Row) -> bool {
    ["missed", "false"].iter().any(|s| value(columns, row, s) > 0.0)
}

/// A score of a row; not a number when it has none.
#[must_use]
pub fn value(columns: &Columns, row: &Row, score: &str) -> f64 {
    columns.score(score).and_then(|i| row.values.get(i)).copied().unwrap_or(f64::NAN)
}

/// Scores whose size matters, not their sign.
fn is_signed(score: &str) -> bool {
    score.starts_with("contact_m") || score.contains("delay")
}

/// Sums up a sweep. `replay` is the folder that the replay commands name.
#[must_use]
pub fn summarise(sweep: &Sweep, columns: &Columns, rows: &[Row], replay: &str) -> Summary {
    let sum = |score: &str| rows.iter().map(|r| value(columns, r, score)).sum::<f64>();
    let count = |test: &dyn Fn(&Row) -> bool| rows.iter().filter(|r| test(r)).count();
    let trials = rows.len();
    let counted = ["ruptures", "missed", "false", "hits_are_chance"];
    let scores = columns.scores.iter().filter(|s| !counted.contains(&s.as_str()));
    let size = |score: &str, x: f64| if is_signed(score) { x.abs() } else { x };
    let scores = scores
        .filter_map(|score| {
            let all = sorted(rows.iter().map(|r| size(score, value(columns, r, score))));
            let worst = rows
                .iter()
                .map(|r| (size(score, value(columns, r, score)), r.trial))
                .filter(|(x, _)| !x.is_nan())
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?;
            Some(ScoreSummary {
                score: score.clone(),
                trials: all.len(),
                median: quantile_interval(&all, 0.5)?,
                p95: quantile_interval(&all, 0.95)?,
                worst: worst.0,
                worst_trial: worst.1,
            })
        })
        .collect();
    Summary {
        sweep: sweep.name.clone(),
        scenario: sweep.template.name.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        identity: sweep.identity(),
        trials: rows.len(),
        seed: sweep.file.seed,
        sampling: format!("{:?}", sweep.file.sampling),
        redrawn: rows.iter().filter(|r| r.redrawn > 0).count(),
        ruptures: sum("ruptures") as u64,
        missed: wilson(sum("missed") as usize, sum("ruptures") as usize),
        false_alarms: sum("false") as u64,
        trials_with_false: wilson(count(&|r| value(columns, r, "false") > 0.0), trials),
        failed: wilson(count(&|r| failed(columns, r)), trials),
        scores,
        drawn: columns.drawn.clone(),
        worst: worst(columns, rows, replay),
        explained: explained(columns, rows),
    }
}

fn worst(columns: &Columns, rows: &[Row], replay: &str) -> Vec<WorstTrial> {
    let rank = |r: &Row| {
        let errors = value(columns, r, "missed") + value(columns, r, "false");
        let off = value(columns, r, "enhancement.rms_relative");
        (errors, if off.is_nan() { f64::INFINITY } else { off })
    };
    let mut order: Vec<&Row> = rows.iter().collect();
    order.sort_by(|a, b| {
        let (x, y) = (rank(a), rank(b));
        y.0.total_cmp(&x.0).then(y.1.total_cmp(&x.1)).then(a.trial.cmp(&b.trial))
    });
    order
        .into_iter()
        .take(WORST)
        .map(|r| WorstTrial {
            trial: r.trial,
            missed: value(columns, r, "missed") as u64,
            false_alarms: value(columns, r, "false") as u64,
            enhancement: Some(value(columns, r, "enhancement.rms_relative")).filter(|x| !x.is_nan()),
            drawn: r.values[..columns.drawn.len()].to_vec(),
            replay: format!("stylet replay {replay} {}", r.trial),
        })
        .collect()
}

/// Outcomes of a trial that the drawn quantities are held against.
const OUTCOMES: [(&str, &[&str]); 4] = [
    ("missed and false ruptures", &["missed", "false"]),
    ("missed ruptures", &["missed"]),
    ("false ruptures", &["false"]),
    ("enhancement error", &["enhancement.rms_relative"]),
];

fn explained(columns: &Columns, rows: &[Row]) -> Vec<Outcome> {
    OUTCOMES
        .iter()
        .map(|(outcome, scores)| {
            let (mut kept, mut y) = (Vec::new(), Vec::new());
            for row in rows {
                let sum: f64 = scores.iter().map(|s| value(columns, row, s)).sum();
                if !sum.is_nan() {
                    kept.push(row);
                    y.push(sum);
                }
            }
            let mut by: Vec<Explained> = columns
                .drawn
                .iter()
                .enumerate()
                .map(|(i, quantity)| {
                    let x: Vec<f64> = kept.iter().map(|r| r.values[i]).collect();
                    let rank = spearman(&x, &y);
                    Explained {
                        quantity: quantity.clone(),
                        rank_correlation: rank.map(|r| r.0),
                        p_value: rank.map(|r| r.1),
                        first_order: first_order(&x, &y),
                    }
                })
                .collect();
            by.sort_by(|a, b| {
                let key = |e: &Explained| e.first_order.unwrap_or(-1.0);
                key(b).total_cmp(&key(a)).then(a.quantity.cmp(&b.quantity))
            });
            Outcome { outcome: (*outcome).to_owned(), by }
        })
        .filter(|o| o.by.iter().any(|e| e.first_order.is_some() || e.rank_correlation.is_some()))
        .collect()
}
