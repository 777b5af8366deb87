//! Identifiability of each parameter from the recordings, and correlations of the estimates.

use crate::page_model::{Cell, Section, Status, Table};
use crate::svg::{FigureOptions, HeatMap, heat_map};
use stylet_diagnose::claims::SIGNIFICANT_P_VALUE;
use stylet_diagnose::diagnosis_json::{
    Diagnosis, Estimate, LabelledParameter, ParameterByRecording, ParameterLabel,
};
use stylet_stats::number_format::{p_value, significant};

/// Parameters that these recordings do not determine, in one sentence. Those at their bounds and puncture forces that were never reached
/// have separate sentences.
#[must_use]
pub fn undetermined_parameters(d: &Diagnosis) -> Option<String> {
    let has_own_sentence = |p: &&LabelledParameter| {
        p.label == ParameterLabel::AtBound
            || d.base_parameters.iter().any(|b| b.at_least && b.layer == p.layer && b.name == p.name)
    };
    let open = d.parameters.iter().filter(|p| p.label != ParameterLabel::Determined);
    let words: Vec<String> =
        open.filter(|p| !has_own_sentence(p)).map(|p| format!("{p} ({})", p.label_in_words())).collect();
    (!words.is_empty()).then(|| format!("these recordings do not determine {}", words.join(", ")))
}

/// A table's cell with the label; empty for a parameter without one.
pub(crate) fn label_cell(
    parameters: &[LabelledParameter],
    layer: usize,
    effect: Option<&str>,
    name: &str,
) -> Cell {
    let is_it = |p: &&LabelledParameter| p.layer == layer && p.effect.as_deref() == effect && p.name == name;
    let Some(p) = parameters.iter().find(is_it) else { return Cell::text("") };
    let status = if p.label == ParameterLabel::Determined { Status::Plain } else { Status::Warn };
    Cell::text(p.label_in_words()).status(status)
}

/// Parameters fitted to each recording separately, and whether they agree; nothing for a single recording.
pub(super) fn by_recording(d: &Diagnosis) -> Section {
    let section = Section::new("Each recording alone");
    if d.by_recording.is_empty() {
        return section;
    }
    let value = |e: &Option<Estimate>| {
        Cell::number(e.map_or_else(String::new, |e| {
            format!("{} ± {}", significant(e.value, 4), significant(0.5 * (e.high - e.low), 2))
        }))
    };
    let rows = d.by_recording.iter().map(|p| {
        let status = if is_different(d, p) { Status::Warn } else { Status::Plain };
        let mut row = vec![Cell::text(p.parameter.clone()), Cell::number(p_value(p.p_value)).status(status)];
        row.extend(p.estimates.iter().map(value));
        row
    });
    let mut headers = vec!["parameter", "one value"];
    headers.extend(d.gain.recordings.iter().map(String::as_str));
    let title = "Parameters fitted to each recording alone, with 95 % intervals, and the p-value of their differences";
    let section = section.table(Table::new(title, &headers, rows.collect()));
    match different_recordings(d) {
        Some(sentence) => section.warnings(vec![sentence]),
        None => section.text("The recordings have one value of each parameter, as far as they determine it."),
    }
}

/// Whether the recordings have different values of a parameter, with all parameters taken into account (Bonferroni).
fn is_different(d: &Diagnosis, p: &ParameterByRecording) -> bool {
    p.p_value * (d.by_recording.len() as f64) < SIGNIFICANT_P_VALUE
}

/// Parameters of which the recordings have different values, in one sentence.
#[must_use]
pub fn different_recordings(d: &Diagnosis) -> Option<String> {
    let different = d.by_recording.iter().filter(|p| is_different(d, p));
    let names: Vec<&str> = different.map(|p| p.parameter.as_str()).collect();
    (!names.is_empty()).then(|| format!("the recordings differ in {}", names.join(", ")))
}

/// Heat map of the correlations between the estimates; nothing for fewer than two.
pub(super) fn correlations(d: &Diagnosis) -> Section {
    let section = Section::new("Correlations of the estimates");
    let n = d.parameters.len();
    if n < 2 || d.covariance.len() != n {
        return section.text("Fewer than two parameters are free.");
    }
    let correlation = |i: usize, j: usize| {
        let r = d.covariance[i][j] / (d.covariance[i][i] * d.covariance[j][j]).sqrt();
        if i == j { f64::NAN } else { r.abs() }
    };
    let names: Vec<String> = d.parameters.iter().map(short_name).collect();
    let map = HeatMap {
        row_label: String::new(),
        column_label: "absolute correlation in per cent".to_owned(),
        rows: names.clone(),
        columns: names,
        values: (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect(),
        values_are_fractions: true,
    };
    let options = FigureOptions {
        title: "Which estimates trade with one another".to_owned(),
        subtitle: "dark pairs: only a combination of the two is known well".to_owned(),
        width_px: 1200.0,
    };
    section.picture("Correlations between the estimated parameters", heat_map(&map, &options))
}

/// Name of a parameter in the notation of docs/reference/model.md.
fn short_name(p: &LabelledParameter) -> String {
    let symbol = match (p.effect.as_deref(), p.name.as_str()) {
        (Some(_), path) => return path.to_owned(),
        (None, "stiffness_n_per_m") => "K",
        (None, "friction_ns_per_m2") => "b",
        (None, "puncture_n") => "F",
        (None, "thickness_m") => "d",
        (None, _) => return "surface".to_owned(),
    };
    format!("{symbol} {}", p.layer)
}
