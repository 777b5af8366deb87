//! The scores of a simulated run as text.

use std::fmt::Write as _;
use stylet_api::run_report::layer_name;
use stylet_api::{Run, settings_note, virtual_note};
use stylet_report::pages::formatting::{or_dash, significant_or_dash};
use stylet_report::{percent, significant};
use stylet_scenario::Scenario;
use stylet_score::{EstimateError, Score, Trace};

/// Detected ruptures, estimates and errors of a simulated run.
#[must_use]
pub fn scorecard(finished: &Run) -> String {
    let (scenario, hash) = (&finished.scenario, &finished.hash);
    let mut out = String::new();
    let recording = &finished.simulation.recording;
    let _ = writeln!(
        out,
        "{}\n{} samples over {} s, seed {}, hash {hash}",
        scenario.name,
        recording.len(),
        significant(recording.duration_s(), 3),
        scenario.seed
    );
    if let Some(note) = virtual_note(&finished.simulation) {
        let _ = writeln!(out, "{note}");
    }
    if let Some(note) = settings_note(&finished.algorithm_runs) {
        let _ = writeln!(out, "note: {note}");
    }
    for run in &finished.algorithm_runs {
        let Some(score) = &run.score else { continue };
        let _ = writeln!(out, "\n{}", run.name);
        ruptures(&mut out, scenario, score, &run.trace);
        layers(&mut out, score);
        summary(&mut out, score);
    }
    out
}

fn ruptures(out: &mut String, scenario: &Scenario, score: &Score, trace: &Trace) {
    let found = score.ruptures.len() - score.missed;
    let _ = writeln!(
        out,
        "  ruptures  {found} of {} found, {} missed, {} false{}",
        score.ruptures.len(),
        score.missed,
        score.false_alarms,
        if score.hits_are_chance { " (more false than true: the hits are chance)" } else { "" }
    );
    let _ = writeln!(out, "    layer                          true s   found s   delay ms  delay mm  by");
    for r in &score.ruptures {
        let cause = r.detection.and_then(|d| trace.detections.get(d - 1)).map_or("-", |d| d.cause.name());
        let _ = writeln!(
            out,
            "    {} {:<26} {:>8.3}  {:>8}  {:>8}  {:>8}  {cause}",
            r.layer,
            layer_name(scenario, r.layer - 1).chars().take(26).collect::<String>(),
            r.true_s,
            or_dash(r.detected_s.map(|t| format!("{t:.3}"))),
            or_dash(r.delay_s.map(|d| format!("{:.1}", d * 1e3))),
            or_dash(r.delay_mm.map(|d| format!("{d:.3}"))),
        );
    }
    for t in &score.false_s {
        let _ = writeln!(out, "    false alarm at {t:.3} s");
    }
}

fn layers(out: &mut String, score: &Score) {
    if score.layers.is_empty() {
        return;
    }
    let _ = writeln!(out, "  estimates          true   online    error  offline");
    let mut row = |name: String, c: EstimateError, offline: Option<f64>| {
        let _ = writeln!(
            out,
            "    {name:<12} {:>8} {:>8} {:>8} {:>8}",
            significant(c.truth, 4),
            significant_or_dash(c.estimated, 1.0, 4),
            or_dash(c.relative_error.map(percent)),
            significant_or_dash(offline, 1.0, 4),
        );
    };
    for l in &score.layers {
        let n = l.layer;
        row(format!("K{n} N/m"), l.stiffness_n_per_m, l.offline_stiffness_n_per_m);
        row(format!("b{n} N s/m²"), l.friction_ns_per_m2, l.offline_friction_ns_per_m2);
        row(format!("d{n} m"), l.thickness_m, None);
    }
    row("D N s/m".to_owned(), score.cumulative_friction_ns_per_m, None);
    let inseparable = score.layers.iter().filter(|l| l.offline_separable == Some(false));
    let inseparable: Vec<String> = inseparable.map(|l| l.layer.to_string()).collect();
    if !inseparable.is_empty() {
        let _ = writeln!(
            out,
            "    (layer {}: the motion does not separate K from b; the force drop at the rupture does)",
            inseparable.join(", ")
        );
    }
}

fn summary(out: &mut String, score: &Score) {
    let share = |value: Option<f64>| or_dash(value.map(percent));
    let _ = writeln!(
        out,
        "  enhanced force  relative rms error {}; {} before the exit; residual force after the exit {}",
        share(score.enhancement.rms_relative),
        share(score.enhancement.in_tissue_relative),
        share(score.enhancement.after_exit_relative),
    );
    let _ =
        writeln!(out, "  reconstruction  {} N rms", significant_or_dash(score.reconstruction_rms_n, 1.0, 3));
}
