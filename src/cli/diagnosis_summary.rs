//! A diagnosis in words, for the terminal.

use std::fmt::Write as _;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::diagnosis_json::FindingKind;
use stylet_report::pages::diagnosis::{
    different_recordings, findings, general_forms, lower_limits, partial_model, proposed_formula,
    recording_differences, summary_sentence, undetermined_parameters, unneeded_custom_effects,
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
    if d.gain.recordings.len() > 2 && d.findings.iter().any(|finding| finding.kind == FindingKind::Scatter) {
        let _ = writeln!(out, "  if the recordings repeat one insertion, diagnose them with --repeats");
    }
    for sentence in partial_model(d).into_iter().chain(proposed_formula(d)).chain(unneeded_custom_effects(d))
    {
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

/// Layers and surface of the fitted law, with 95 % intervals.
pub fn fitted_law(d: &Diagnosis) -> String {
    let value = |layer: usize, name: &str, scale: f64, unit: &str| -> Option<String> {
        let b = d.base_parameters.iter().find(|b| b.layer == layer && b.name == name)?;
        let number = |x: f64| significant(scale * x, 4);
        if b.at_least {
            return Some(format!("at least {} {unit}", number(b.low)));
        }
        let label = d.parameters.iter().find(|p| p.effect.is_none() && p.layer == layer && p.name == name);
        let open = label.map(|p| p.label_in_words()).filter(|words| words != "determined");
        let remark = open.map_or(String::new(), |words| format!(", {words}"));
        Some(format!("{} {unit} ({} to {}{remark})", number(b.value), number(b.low), number(b.high)))
    };
    let count = d.base_parameters.iter().map(|b| b.layer).max().unwrap_or(0);
    let mut out = String::new();
    let surface = value(0, "surface_m", 1e3, "mm").map_or(String::new(), |at| format!(", surface at {at}"));
    let _ = writeln!(out, "{count} layer{}{surface}", if count == 1 { "" } else { "s" });
    for layer in 1..=count {
        let parts = [
            ("thickness", value(layer, "thickness_m", 1e3, "mm")),
            ("K", value(layer, "stiffness_n_per_m", 1.0, "N/m")),
            ("b", value(layer, "friction_ns_per_m2", 1.0, "N s/m²")),
            ("ruptures at", value(layer, "puncture_n", 1.0, "N")),
        ];
        let part = |(name, text): (&str, Option<String>)| {
            let text = text?;
            let name = if text.starts_with("at least") { "puncture force" } else { name };
            Some(format!("{name} {text}"))
        };
        let parts: Vec<String> = parts.into_iter().filter_map(part).collect();
        let _ = writeln!(out, "  layer {layer}: {}", parts.join(", "));
    }
    out
}
