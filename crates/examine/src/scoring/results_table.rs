//! The table: one line per row of an examination.

use super::case_outcome::CaseOutcome;
use super::diagnosis_answer::Verdict;
use crate::cases::case_id::{Hide, Severity, Size, World, Wrong};
use crate::success_rate::SuccessRate;
use core::fmt::Write as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_stats::quantile_of;

/// A cell: cases of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TableCellId {
    /// Tissue law of the simulator.
    pub world: World,
    /// Misspecification.
    pub wrong: Wrong,
    /// Severity of the misspecification.
    pub severity: Severity,
    /// Hidden causes.
    pub hide: Hide,
    /// Strength of the hidden causes.
    pub size: Size,
}

/// Results of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableCell {
    /// Which.
    pub id: TableCellId,
    /// Right answers.
    pub right: SuccessRate,
    /// Answers that name all hidden causes, and possibly others.
    pub all_found: SuccessRate,
    /// Answers with a cause that is not present.
    pub wrong_name: SuccessRate,
    /// Answers `unknown`.
    pub unknown: SuccessRate,
    /// Median wall time of an answer in s.
    pub median_s: f64,
    /// 90 % of the answers took no longer, in s.
    pub p90_s: f64,
}

/// The cells of outcomes, in the order of the words.
#[must_use]
pub fn table_cells(outcomes: &[CaseOutcome]) -> Vec<TableCell> {
    let mut by: BTreeMap<TableCellId, Vec<&CaseOutcome>> = BTreeMap::new();
    for o in outcomes {
        let id = TableCellId {
            world: o.id.world,
            wrong: o.id.wrong,
            severity: o.id.severity,
            hide: o.id.hide,
            size: o.id.size,
        };
        by.entry(id).or_default().push(o);
    }
    by.into_iter()
        .map(|(id, all)| {
            let seconds: Vec<f64> = all.iter().map(|o| o.seconds).collect();
            TableCell {
                id,
                right: SuccessRate::of(&all, |o| o.score.correct),
                all_found: SuccessRate::of(&all, |o| o.score.all_found),
                wrong_name: SuccessRate::of(&all, |o| o.score.wrong_name),
                unknown: SuccessRate::of(&all, |o| o.verdict == Verdict::Unknown && o.failed.is_none()),
                median_s: quantile_of(seconds.iter().copied(), 0.5),
                p90_s: quantile_of(seconds.iter().copied(), 0.9),
            }
        })
        .collect()
}

/// The table as text: rates with 95 % Wilson intervals, then confusions, coverage of intervals, confidence.
#[must_use]
pub fn results_text(outcomes: &[CaseOutcome]) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{:<32}{:<20}{:<28}{:<28}{:<28}{:<10}{:>8}{:>8}",
        "wrong", "hidden", "correct and alone", "all found", "false attribution", "unknown", "med s", "p90 s"
    );
    for c in table_cells(outcomes) {
        let row = match c.id.wrong {
            Wrong::Nothing => format!("{}: nothing", c.id.world),
            wrong => format!("{}: {wrong}, {}", c.id.world, c.id.severity),
        };
        let hidden = match c.id.hide {
            Hide::Clean => "clean".to_owned(),
            hide => format!("{hide}, {}", c.id.size),
        };
        let _ = writeln!(
            out,
            "{row:<32}{hidden:<20}{:<28}{:<28}{:<28}{:<10}{:>8.2}{:>8.2}",
            c.right,
            if matches!(c.id.hide, Hide::Clean | Hide::Outside) {
                SuccessRate::default()
            } else {
                c.all_found
            },
            c.wrong_name,
            format!("{}/{}", c.unknown.hits, c.unknown.of),
            c.median_s,
            c.p90_s
        );
    }
    write_by_hidden_cause(&mut out, outcomes);
    write_wrong_answers(&mut out, outcomes);
    write_interval_coverage(&mut out, outcomes);
    write_coverage_by_label(&mut out, outcomes);
    write_by_grade(&mut out, outcomes);
    write_by_confidence(&mut out, outcomes);
    let failed: Vec<&CaseOutcome> = outcomes.iter().filter(|o| o.failed.is_some()).collect();
    if let Some(first) = failed.first() {
        let why = first.failed.as_deref().unwrap_or("");
        let _ =
            writeln!(out, "\n{} cases without an answer, the first {}: {why}", failed.len(), first.id.name());
    }
    out
}

/// Results by hidden cause over all rows.
fn write_by_hidden_cause(out: &mut String, outcomes: &[CaseOutcome]) {
    let mut by: BTreeMap<_, Vec<&CaseOutcome>> = BTreeMap::new();
    for o in outcomes {
        by.entry((o.id.world, o.id.hide, o.id.size)).or_default().push(o);
    }
    let _ = writeln!(out, "\nall rows: exactly correct; false attribution");
    for ((world, hide, size), all) in by {
        let right = SuccessRate::of(&all, |o| o.score.correct);
        let wrong = SuccessRate::of(&all, |o| o.score.wrong_name);
        let _ = writeln!(out, "    {:<48}{right:<28}{wrong}", format!("{world}: {hide}, {size}"));
    }
}

/// Wrong answers by hidden cause.
fn write_wrong_answers(out: &mut String, outcomes: &[CaseOutcome]) {
    let mut by: BTreeMap<(String, String), usize> = BTreeMap::new();
    for o in outcomes.iter().filter(|o| !o.score.correct) {
        let hidden = if o.hidden.is_empty() { "(clean)".to_owned() } else { o.hidden.join(" + ") };
        let causes: Vec<String> = o.named.iter().map(|c| c.join("|")).collect();
        let answered = match o.verdict {
            _ if o.failed.is_some() => "no answer".to_owned(),
            Verdict::None => "none".to_owned(),
            Verdict::Parameters if causes.is_empty() => "parameters".to_owned(),
            Verdict::Unknown if causes.is_empty() => "unknown".to_owned(),
            Verdict::Unknown => format!("unknown, with {}", causes.join(" + ")),
            _ => causes.join(" + "),
        };
        *by.entry((hidden, answered)).or_default() += 1;
    }
    if !by.is_empty() {
        let _ = writeln!(out, "\nwrong answers: hidden -> answer (cases)");
    }
    for ((hidden, answered), n) in by {
        let _ = writeln!(out, "    {hidden} -> {answered}  {n}");
    }
}

/// Coverage of the 95 % intervals.
fn write_interval_coverage(out: &mut String, outcomes: &[CaseOutcome]) {
    let mut by: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
    for n in outcomes.iter().flat_map(|o| &o.parameters) {
        if let Some(covers) = n.interval_covers {
            by.entry(&n.name).or_default().push(covers);
        }
    }
    let all = |base: bool| {
        SuccessRate::of(
            by.iter().filter(|(name, _)| name.starts_with("base.") == base).flat_map(|(_, h)| h),
            |h| **h,
        )
    };
    if by.is_empty() {
        return;
    }
    let _ = writeln!(
        out,
        "\n95 % intervals that contain the truth: effect parameters {}, base parameters {}",
        all(false),
        all(true)
    );
    for (name, covers) in &by {
        let rate = SuccessRate::of(covers, |h| **h);
        let _ = writeln!(out, "    {name:<52}{rate}");
    }
}

/// Coverage of the 95 % intervals, and share of those within 10 % of the value, by the label of the parameter.
fn write_coverage_by_label(out: &mut String, outcomes: &[CaseOutcome]) {
    /// Half width of a narrow interval, relative to the value.
    const NARROW: f64 = 0.1;
    let mut by: BTreeMap<&str, Vec<(bool, bool)>> = BTreeMap::new();
    for n in outcomes.iter().flat_map(|o| &o.parameters) {
        if let (Some(label), Some(covers), Some((low, high))) =
            (&n.label, n.interval_covers, n.low.zip(n.high))
        {
            by.entry(label).or_default().push((covers, high - low <= 2.0 * NARROW * n.value.abs()));
        }
    }
    if !by.is_empty() {
        let _ = writeln!(
            out,
            "\nparameters by label: 95 % interval holds the truth; is within 10 % of the value"
        );
    }
    for (label, all) in &by {
        let [covers, close] =
            [SuccessRate::of(all, |(covers, _)| *covers), SuccessRate::of(all, |(_, close)| *close)];
        let _ = writeln!(out, "    {label:<24}{covers:<28}{close}");
    }
}

/// How often the answer is right, by the grade of its model.
fn write_by_grade(out: &mut String, outcomes: &[CaseOutcome]) {
    let mut by: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
    for o in outcomes {
        if let Some(grade) = &o.grade {
            by.entry(grade).or_default().push(o.score.correct);
        }
    }
    if !by.is_empty() {
        let _ = writeln!(out, "\nby the grade of the model: correct");
    }
    for (grade, right) in &by {
        let _ = writeln!(out, "    {grade}  {}", SuccessRate::of(right, |right| **right));
    }
}

/// Share of correct causes by their confidence, and the Brier score.
fn write_by_confidence(out: &mut String, outcomes: &[CaseOutcome]) {
    let all: Vec<(f64, bool)> = outcomes.iter().flat_map(|o| o.confidence.iter().copied()).collect();
    if all.is_empty() {
        return;
    }
    let brier =
        all.iter().map(|(p, present)| (p - f64::from(*present)).powi(2)).sum::<f64>() / all.len() as f64;
    let _ = writeln!(out, "\nconfidence of {} causes, Brier score {brier:.4}", all.len());
    for k in 0..10 {
        let (low, high) = (0.1 * f64::from(k), 0.1 * f64::from(k + 1));
        let bin = all.iter().filter(|(p, _)| *p >= low && (*p < high || (k == 9 && *p <= 1.0)));
        let rate = SuccessRate::of(bin, |(_, present)| *present);
        if rate.of > 0 {
            let _ = writeln!(out, "    stated {low:.1} to {high:.1}: correct in {rate}");
        }
    }
}
