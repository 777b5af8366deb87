//! `stylet compare`: the same insertions, heard by several algorithms.

use crate::args::CompareArgs;
use crate::compare_page::page;
use crate::compare_world;
use crate::exit::Failure;
use crate::output::Output;
use crate::progress::Progress;
use crate::terminal;
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use stylet_core::config::Algorithm;
use stylet_report::significant;
use stylet_scenario::Scenario;
use stylet_score::Score;
use stylet_stats::{Interval, Z95, quantile_interval, wilson};
use stylet_sweep::trial::{self, Workspace};

/// Median and 95th percentile.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Spread {
    pub median: Option<f64>,
    pub p95: Option<f64>,
}

/// Shares of true values in the core's 95 % intervals; `null` for an algorithm that gives none.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    pub stiffness: Option<f64>,
    pub friction: Option<f64>,
    pub cumulative_friction: Option<f64>,
    pub tip_force: Option<f64>,
}

/// One row of the table.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    pub scenario: String,
    pub algorithm: String,
    pub seeds: u64,
    pub ruptures: usize,
    pub missed: usize,
    #[serde(rename = "false")]
    pub false_alarms: usize,
    /// Missed and false per rupture, with its 95 % interval.
    pub errors_per_rupture: [f64; 3],
    pub delay_s: Spread,
    /// Median relative error per layer.
    pub stiffness_error: Vec<Option<f64>>,
    /// The medians' 95 % intervals.
    pub stiffness_error_interval: Vec<Option<[f64; 2]>>,
    pub friction_error: Vec<Option<f64>>,
    pub enhancement_rms_relative: Option<f64>,
    pub enhancement_interval: Option<[f64; 2]>,
    /// The same against the noise-free tip force.
    pub enhancement_with_noise: Option<f64>,
    pub coverage: Coverage,
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let algorithms = &args.algorithms;
    let scenarios = args.scenarios.iter().map(|path| Scenario::load(path)).collect::<Result<Vec<_>, _>>()?;
    let worlds = compare_world::rows(args)?;
    let progress = Progress::new(
        ((scenarios.len() + worlds.len()) * algorithms.len()) as u64 * args.seeds,
        "insertions",
        args.results.quiet,
    );
    let mut rows = Vec::new();
    let mut said = String::new();
    for (scenario, path) in scenarios.iter().zip(&args.scenarios) {
        for algorithm in algorithms {
            let mut scenario = scenario.clone();
            scenario.enhance.algorithm = algorithm.algorithm();
            let row = row(&scenario, algorithm.name(), args.seeds, &progress)
                .map_err(|why| Failure::Simulate { file: path.display().to_string(), why })?;
            rows.push(row);
        }
    }
    for world in &worlds {
        rows.extend(world.listen(algorithms, &progress)?);
    }
    progress.finish();
    let _ = writeln!(
        said,
        "{:44} {:8} {:>13} {:>13} {:>18} {:>9}  covered K b D band %",
        "", "", "missed/false", "delay ms", "K error %", "enh. off"
    );
    for r in &rows {
        let _ = writeln!(said, "{}", line(r));
    }
    let folder = args.results.out.clone().unwrap_or_else(|| PathBuf::from("stylet-out/compare"));
    let mut json = serde_json::to_vec_pretty(&rows).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    let mut output = Output::default();
    output.add("compare.json", json);
    output.add("report.html", page(&rows, args.seeds).to_html());
    output.write(&folder)?;
    if !args.results.quiet {
        terminal::say(&format!("{said}Report: {}\n", folder.join("report.html").display()))?;
    }
    Ok(())
}

/// The scores of one row.
pub struct Scored {
    pub missed: usize,
    pub false_alarms: usize,
    pub delays_s: Vec<f64>,
    pub ruptures: usize,
}

impl Row {
    /// A row with what every row has; estimates are added where there is a truth for them.
    pub fn new(scenario: &str, algorithm: &str, seeds: u64, scored: &Scored) -> Self {
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
            delay_s: Spread { median: quantile(0.5), p95: quantile(0.95) },
            ..Self::default()
        }
    }
}

/// Errors per rupture with a 95 % interval: Wilson's of a share, or a count's (normal) where there are more errors than ruptures.
fn per_rupture(errors: usize, ruptures: usize) -> [f64; 3] {
    let (n, of) = (errors as f64, ruptures as f64);
    if errors <= ruptures {
        let share = wilson(errors, ruptures);
        return [share.value, share.low, share.high];
    }
    let half = Z95 * n.sqrt();
    [n, (n - half).max(0.0), n + half].map(|x| x / of)
}

fn row(
    scenario: &Scenario,
    algorithm: &str,
    seeds: u64,
    progress: &Progress,
) -> Result<Row, stylet_testbed::SimulateError> {
    // In the order of the seeds, whatever the threads: the same bytes.
    let scores: Vec<Score> = (0..seeds)
        .into_par_iter()
        .map_init(Workspace::default, |workspace, seed| {
            let mut scenario = scenario.clone();
            scenario.seed = scenario.seed.wrapping_add(seed);
            let score = trial::run(&scenario, workspace);
            progress.advance(1);
            score
        })
        .collect::<Result<_, _>>()?;
    let scored = Scored {
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
    Ok(Row {
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
        ..Row::new(&scenario.name, algorithm, seeds, &scored)
    })
}

/// The median with its 95 % interval between order statistics.
fn median(values: impl Iterator<Item = f64>) -> Option<Interval> {
    quantile_interval(&stylet_stats::sorted(values.filter(|x| x.is_finite())), 0.5)
}

/// Thousandths or percent for people; a dash for nothing.
pub fn shown(value: Option<f64>, unit: f64, digits: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |x| significant(x * unit, digits))
}

fn line(r: &Row) -> String {
    let list = |v: &[Option<f64>]| v.iter().map(|x| shown(*x, 100.0, 2)).collect::<Vec<_>>().join("/");
    let c = &r.coverage;
    let covered = [c.stiffness, c.friction, c.cumulative_friction, c.tip_force].map(|x| shown(x, 100.0, 3));
    format!(
        "{:44} {:8} {:>13} {:>13} {:>18} {:>9}  {}",
        r.scenario,
        r.algorithm,
        format!("{}/{} of {}", r.missed, r.false_alarms, r.ruptures),
        format!("{}/{}", shown(r.delay_s.median, 1e3, 2), shown(r.delay_s.p95, 1e3, 2)),
        list(&r.stiffness_error),
        shown(r.enhancement_rms_relative, 1.0, 2),
        covered.join(" ")
    )
}

impl crate::args::Which {
    pub fn algorithm(self) -> Algorithm {
        match self {
            Self::Paper => Algorithm::Paper,
            Self::Literal => Algorithm::Literal,
            Self::Stylet => Algorithm::Stylet,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "Paper",
            Self::Literal => "Literal",
            Self::Stylet => "Stylet",
        }
    }
}
