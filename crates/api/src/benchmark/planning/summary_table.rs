//! The table of the planning benchmark as text.

use super::second_insertion::PlanningCase;
use std::fmt::Write as _;
use stylet_examine::success_rate::SuccessRate;
use stylet_stats::quantile;

/// Appends the table of a row's cases.
pub(super) fn write_table(out: &mut String, row: &str, cases: &[PlanningCase]) {
    let open: Vec<&PlanningCase> = cases.iter().filter(|c| c.open_because.is_some()).collect();
    let rate = |of: &[&PlanningCase], holds: &dyn Fn(&PlanningCase) -> bool| {
        SuccessRate::of(of.iter().copied(), |c| holds(c))
    };
    let planned = |c: &PlanningCase| c.planned.as_ref().is_some_and(|s| s.correct);
    let sinusoid = |c: &PlanningCase| c.sinusoid.as_ref().is_some_and(|s| s.correct);
    let _ = writeln!(out, "{row}");
    let _ = writeln!(
        out,
        "  {} cases, {} open after one insertion at constant speed (class {}, not identifiable {})",
        cases.len(),
        open.len(),
        open.iter().filter(|c| c.open_because.as_deref() == Some("class")).count(),
        open.iter().filter(|c| c.open_because.as_deref() == Some("not_identifiable")).count()
    );
    let predicted: Vec<f64> =
        open.iter().filter(|c| c.planned.is_some()).map(|c| c.predicted_probability).collect();
    let mean = predicted.iter().sum::<f64>() / predicted.len().max(1) as f64;
    let _ = writeln!(out, "  correct single cause, planned second insertion {}", rate(&open, &planned));
    let _ = writeln!(out, "  correct single cause, the paper's sinusoid     {}", rate(&open, &sinusoid));
    let named = |c: &PlanningCase| c.planned.as_ref().is_some_and(|s| s.correct && s.hidden_effect_named);
    let _ = writeln!(out, "  ... and the hidden effect itself (planned)     {}", rate(&open, &named));
    let _ = writeln!(out, "  predicted for the planned insertion            {:.0} %", 100.0 * mean);
    let mut seconds: Vec<f64> = open.iter().map(|c| c.plan_s).collect();
    let mut all: Vec<f64> = open.iter().map(|c| c.seconds).collect();
    let _ = writeln!(
        out,
        "  seconds of planning: median {:.1}, p90 {:.1}, longest {:.1}; of a whole case: median {:.1}",
        quantile(&mut seconds, 0.5),
        quantile(&mut seconds, 0.9),
        quantile(&mut seconds, 1.0),
        quantile(&mut all, 0.5)
    );
    let failed = cases.iter().filter(|c| c.error.is_some()).count();
    if failed > 0 {
        let _ = writeln!(out, "  no answer: {failed}");
    }
    let mut names: Vec<&str> = open.iter().map(|c| c.hidden.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let _ = writeln!(out, "  {:<26} {:<28} sinusoid", "hidden", "planned");
    for name in names {
        let of: Vec<&PlanningCase> = open.iter().copied().filter(|c| c.hidden == name).collect();
        let wrong: Vec<String> = of
            .iter()
            .filter(|c| !planned(c))
            .map(|c| match &c.planned {
                None => "no answer".to_owned(),
                Some(s) if s.unknown => "unknown".to_owned(),
                Some(s) if s.causes.is_empty() => "none".to_owned(),
                Some(s) => s.causes.iter().map(|c| c.join("|")).collect::<Vec<_>>().join(" + "),
            })
            .collect();
        let line = format!(
            "  {name:<26} {:<28} {:<28} {}",
            rate(&of, &planned).to_string(),
            rate(&of, &sinusoid).to_string(),
            if wrong.is_empty() { String::new() } else { format!("reported {}", wrong.join("; ")) }
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
}
