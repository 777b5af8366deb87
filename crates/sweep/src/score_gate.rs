//! Gates: scenarios or sweeps with bounds on their scores, for CI. Format: docs/reference/files.md, section "Gates".
//!
//! A bound is compared with the unfavourable end of the statistic's 95 % interval: a rate that could be too high, given the number of
//! insertions, fails.

use crate::parallel_trials::{TrialError, run_trials};
use crate::summary::score_value;
use crate::sweep_file::{Overrides, Sweep};
use crate::trial_row::{Columns, TrialRow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_scenario::{
    FieldError, InputError, Sampling, Scenario, SweepFile, closest_name, parse, read_text,
};
use stylet_stats::{Interval, mean_interval, quantile_interval, sorted, wilson};

/// Statistic of a score over the insertions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Statistic {
    /// Sum over all insertions, exact: the default for `missed`, `false` and `hits_are_chance`.
    Total,
    /// `missed` per rupture; for other counts the share of insertions that have any. Wilson interval.
    Rate,
    /// Median, interval between order statistics: the default for other scores.
    Median,
    /// 95th percentile, interval between order statistics.
    P95,
    /// Mean, normal interval.
    Mean,
    /// Largest value, exact.
    Worst,
}

/// One bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// Path of the score in `score.json`, such as `layers[1].stiffness_n_per_m.relative_error`.
    pub score: String,
    /// Statistic; the default depends on the score.
    #[serde(default)]
    pub statistic: Option<Statistic>,
    /// Upper bound.
    #[serde(default)]
    pub at_most: Option<f64>,
    /// Lower bound.
    #[serde(default)]
    pub at_least: Option<f64>,
}

/// A gate: insertions and the bounds on their scores.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Scenario file, relative to the gates', run with `seeds` noise seeds.
    #[serde(default)]
    pub run: Option<PathBuf>,
    /// Number of noise seeds.
    #[serde(default)]
    pub seeds: Option<u64>,
    /// Sweep file in place of a scenario.
    #[serde(default)]
    pub sweep: Option<PathBuf>,
    /// Number of trials in place of the sweep's.
    #[serde(default)]
    pub trials: Option<u64>,
    /// The bounds.
    pub expect: Vec<Expectation>,
}

/// `Gates([...])`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Gates")]
pub struct GatesFile(pub Vec<Gate>);

/// A bound and its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateResult {
    /// File of the gate, as written.
    pub gate: String,
    /// Score.
    pub score: String,
    /// Statistic.
    pub statistic: Statistic,
    /// Insertions that have the score.
    pub insertions: usize,
    /// Value and interval of the statistic.
    pub found: Option<Interval>,
    /// Upper bound.
    pub at_most: Option<f64>,
    /// Lower bound.
    pub at_least: Option<f64>,
    /// Whether the unfavourable end of the interval is within the bounds.
    pub passed: bool,
}

impl GateResult {
    /// Key in the baseline: gate, score and statistic.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} {} {:?}", self.gate, self.score, self.statistic)
    }
}

/// A validated gate.
#[derive(Clone, Debug)]
pub struct LoadedGate {
    name: String,
    sweep: Sweep,
    expect: Vec<(Expectation, Statistic)>,
}

/// Loads and checks a gates file with the scenarios and sweeps that it names. `seed` replaces the seed
/// of every gate.
///
/// # Errors
/// [`InputError`] with file, line, column, the problem and its remedy.
pub fn load(path: &Path, seed: Option<u64>) -> Result<Vec<LoadedGate>, InputError> {
    let text = read_text(path)?;
    let shown = path.display().to_string();
    let file: GatesFile = parse(&shown, &text)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    if file.0.is_empty() {
        return Err(InputError::file(
            &shown,
            "holds no gate; write Gates([(run: \"...\", seeds: 200, expect: [...])])",
        ));
    }
    let place = |problem: FieldError| problem.in_file(&shown, &text);
    let mut ready = Vec::with_capacity(file.0.len());
    for (i, gate) in file.0.iter().enumerate() {
        let at = |field: &str| format!("[{i}].{field}");
        let (named, sweep) = match (&gate.run, &gate.sweep) {
            (Some(run), None) => {
                let scenario = Scenario::load(&folder.join(run))?;
                let trials = gate.seeds.unwrap_or(200);
                let file = SweepFile {
                    scenario: run.clone(),
                    trials,
                    sampling: Sampling::Random,
                    seed: seed.unwrap_or(scenario.seed),
                    vary: Vec::new(),
                    effects: Vec::new(),
                };
                let name = run.display().to_string();
                let sweep = Sweep::new(name, file, scenario).map_err(|p| {
                    let field = if p.path == "trials" { "seeds" } else { "run" };
                    place(FieldError::new(at(field), p.message).with_related(format!("[{i}]")))
                })?;
                (run, sweep)
            }
            (None, Some(file)) => {
                let overrides = Overrides { trials: gate.trials, seed };
                (file, Sweep::load(&folder.join(file), overrides)?)
            }
            _ => {
                let what = "names both a scenario and a sweep, or neither; give one of `run` and `sweep`";
                return Err(place(FieldError::new(format!("[{i}]"), what)));
            }
        };
        let columns = Columns::new(&sweep);
        let mut expect = Vec::with_capacity(gate.expect.len());
        for (j, e) in gate.expect.iter().enumerate() {
            let at = |field: &str| format!("[{i}].expect[{j}]{field}");
            if columns.score(&e.score).is_none() {
                let known: Vec<&str> = columns.scores.iter().map(String::as_str).collect();
                let near = closest_name(&e.score, &known)
                    .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
                let what = format!("there is no score `{}`{near} Known: {}", e.score, known.join(", "));
                return Err(place(FieldError::new(at(".score"), what)));
            }
            if e.at_most.is_none() && e.at_least.is_none() {
                let what = "has no bound; give `at_most` or `at_least`";
                return Err(place(FieldError::new(at(""), what)));
            }
            if let Some(wrong) = [e.at_most, e.at_least].into_iter().flatten().find(|b| !b.is_finite()) {
                return Err(place(FieldError::new(
                    at(""),
                    format!("has the bound {wrong}; it must be finite"),
                )));
            }
            expect.push((e.clone(), e.statistic.unwrap_or(default_statistic(&e.score))));
        }
        ready.push(LoadedGate { name: named.display().to_string(), sweep, expect });
    }
    Ok(ready)
}

fn default_statistic(score: &str) -> Statistic {
    if matches!(score, "missed" | "false" | "hits_are_chance") { Statistic::Total } else { Statistic::Median }
}

impl LoadedGate {
    /// Number of insertions.
    #[must_use]
    pub fn trials(&self) -> u64 {
        self.sweep.trials()
    }

    /// Runs the gate's insertions and evaluates the bounds.
    ///
    /// # Errors
    /// [`TrialError`] when a trial fails.
    pub fn run(&self, done: &(dyn Fn(u64) + Sync)) -> Result<Vec<GateResult>, TrialError> {
        let columns = Columns::new(&self.sweep);
        let rows = run_trials(&self.sweep, &columns, 0..self.sweep.trials(), done)?;
        Ok(self
            .expect
            .iter()
            .map(|(e, statistic)| self.evaluate_expectation(&columns, &rows, e, *statistic))
            .collect())
    }

    fn evaluate_expectation(
        &self,
        columns: &Columns,
        rows: &[TrialRow],
        e: &Expectation,
        statistic: Statistic,
    ) -> GateResult {
        let all = sorted(rows.iter().map(|r| {
            let x = score_value(columns, r, &e.score);
            if e.score.starts_with("contact_m") { x.abs() } else { x }
        }));
        let exact = |value: f64| Interval { value, low: value, high: value };
        let sum = |score: &str| rows.iter().map(|r| score_value(columns, r, score)).sum::<f64>();
        let found = match statistic {
            Statistic::Total => Some(exact(all.iter().sum())),
            Statistic::Rate if e.score == "missed" => {
                Some(wilson(sum("missed") as usize, sum("ruptures") as usize))
            }
            Statistic::Rate => Some(wilson(all.iter().filter(|x| **x > 0.0).count(), all.len())),
            Statistic::Median => quantile_interval(&all, 0.5),
            Statistic::P95 => quantile_interval(&all, 0.95),
            Statistic::Mean => mean_interval(&all),
            Statistic::Worst => all.last().map(|x| exact(*x)),
        };
        // A score that is missing in all insertions fails.
        let passed = found.is_some_and(|f| {
            e.at_most.is_none_or(|bound| f.high <= bound) && e.at_least.is_none_or(|bound| f.low >= bound)
        });
        GateResult {
            gate: self.name.clone(),
            score: e.score.clone(),
            statistic,
            insertions: all.len(),
            found,
            at_most: e.at_most,
            at_least: e.at_least,
            passed,
        }
    }
}

/// Intervals by name: the committed baseline.
pub type Baseline = BTreeMap<String, Interval>;

/// The baseline of these results.
#[must_use]
pub fn baseline(results: &[GateResult]) -> Baseline {
    results.iter().filter_map(|j| Some((j.name(), j.found?))).collect()
}

/// Changes against a baseline, one line each; empty when all values are the same.
#[must_use]
pub fn baseline_changes(old: &Baseline, new: &Baseline) -> Vec<String> {
    let show = |i: &Interval| stylet_stats::number_format::significant(i.value, 4);
    let mut lines = Vec::new();
    for (name, now) in new {
        match old.get(name) {
            None => lines.push(format!("+ {name}: {} (new)", show(now))),
            // A value read from a file may differ in its last bit.
            Some(before) if (before.value - now.value).abs() > 1e-12 * now.value.abs() => {
                let share = if before.value != 0.0 {
                    format!(" ({:+.1} %)", 100.0 * (now.value - before.value) / before.value.abs())
                } else {
                    String::new()
                };
                let apart = now.low > before.high || now.high < before.low;
                let word = if apart { ", beyond the intervals" } else { "" };
                lines.push(format!("~ {name}: {} -> {}{share}{word}", show(before), show(now)));
            }
            Some(_) => {}
        }
    }
    for name in old.keys().filter(|n| !new.contains_key(*n)) {
        lines.push(format!("- {name} (gone)"));
    }
    lines
}

/// The results as JUnit XML, one test case per bound.
#[must_use]
pub fn junit_xml(results: &[GateResult]) -> String {
    let escape = escape_xml;
    let failures = results.iter().filter(|j| !j.passed).count();
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n  <testsuite name=\"stylet gate\" tests=\"{}\" failures=\"{failures}\">\n",
        results.len()
    );
    for j in results {
        let name = escape(&format!("{} {:?}", j.score, j.statistic));
        let class = escape(&j.gate);
        if j.passed {
            xml.push_str(&format!("    <testcase classname=\"{class}\" name=\"{name}\"/>\n"));
        } else {
            let what = escape(&describe_result(j));
            xml.push_str(&format!(
                "    <testcase classname=\"{class}\" name=\"{name}\"><failure message=\"{what}\"/></testcase>\n"
            ));
        }
    }
    xml.push_str("  </testsuite>\n</testsuites>\n");
    xml
}

/// Escapes a text for an attribute of XML 1.0, which cannot contain most control characters: they become U+FFFD.
fn escape_xml(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A bound and its result in one line.
#[must_use]
pub fn describe_result(j: &GateResult) -> String {
    let number = |x: f64| stylet_stats::number_format::significant(x, 4);
    let bound = match (j.at_most, j.at_least) {
        (Some(most), Some(least)) => format!("{} to {}", number(least), number(most)),
        (Some(most), None) => format!("at most {}", number(most)),
        (None, Some(least)) => format!("at least {}", number(least)),
        (None, None) => String::new(),
    };
    let found = match &j.found {
        None => "no insertion has this score".to_owned(),
        Some(f) if f.low == f.high => number(f.value),
        Some(f) => format!("{} [{}, {}]", number(f.value), number(f.low), number(f.high)),
    };
    format!("{} {:?}: {found}, allowed {bound}", j.score, j.statistic)
}
