//! A diagnosis in words, for the terminal.

use std::fmt::Write as _;
use stylet_diagnose::Diagnosis;
use stylet_report::pages::diagnosis::{
    different_recordings, findings, general_forms, lower_limits, partial_model, recording_differences,
    summary_sentence, undetermined_parameters,
};
use stylet_report::significant;

/// Verdict, causes, errors and findings in words.
pub fn summary(d: &Diagnosis) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", summary_sentence(d));
    for c in &d.causes {
        let _ = writeln!(out, "\n  {}, confidence {}", c.effect, significant(c.confidence, 3));
        if let Some(remark) = &c.remark {
            let _ = writeln!(out, "    {remark}");
        }
        for (path, e) in &c.parameters {
            let _ = writeln!(
                out,
                "    {path} = {} (95 %: {} to {}){}",
                significant(e.value, 4),
                significant(e.low, 4),
                significant(e.high, 4),
                if c.at_bound.contains(path) { ", at its bound" } else { "" }
            );
        }
        if !c.equivalent.is_empty() {
            let _ = writeln!(out, "    equivalent: {}", c.equivalent.join(", "));
        }
        if let Some(sentence) = general_forms(c) {
            let _ = writeln!(out, "    {sentence}");
        }
    }
    let g = &d.gain;
    let what = if g.held_out { "on held-out recordings" } else { "on the one recording, which was fitted" };
    let _ = writeln!(
        out,
        "\n  residual {what}: {} N before, {} N after{}, noise {} N",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        if g.rmse_given_scatter_n < 0.9 * g.rmse_after_n {
            format!(
                " ({} N with each recording's own ruptures, surface and friction)",
                significant(g.rmse_given_scatter_n, 3)
            )
        } else {
            String::new()
        },
        significant(g.floor_n, 3)
    );
    if let Some(grade) = &d.grade {
        let _ = writeln!(out, "  {}", grade.sentence());
    }
    for sentence in findings(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    if let Some(sentence) = partial_model(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    for sentence in lower_limits(d) {
        let _ = writeln!(out, "  {sentence}");
    }
    for sentence in undetermined_parameters(d).into_iter().chain(different_recordings(d)) {
        let _ = writeln!(out, "  {sentence}");
    }
    if let Some(differ) = recording_differences(d) {
        let _ = writeln!(out, "  {differ}");
    }
    let imitated = d.negligible.iter().filter(|t| t.reason == stylet_diagnose::REASON_IMITATES_UNMODELLED);
    let imitated: Vec<&str> = imitated.map(|t| t.effect.as_str()).collect();
    if !imitated.is_empty() {
        let _ = writeln!(
            out,
            "  nearest effects of the library, which may only imitate the true one: {}",
            imitated.join(", ")
        );
    }
    if !d.not_identifiable.is_empty() {
        let _ = writeln!(out, "  not identifiable from these recordings: {}", d.not_identifiable.join(", "));
    }
    for q in &d.data_quality {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}
