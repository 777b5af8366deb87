//! Text shared by several pages and the terminal.

use crate::page_model::{Cell, Table};
use std::collections::BTreeMap;
use stylet_diagnose::diagnosis_json::DataQualityNote;
use stylet_stats::number_format::significant;

/// The base law in the notation of docs/reference/model.md, section "Base law".
pub(crate) const BASE_LAW_EQUATIONS: &str = "f   = f_K + f_B            until layer a = r + 1 ruptures: f_K >= F_a, or z >= s_a + d_a\nf_K = K_a max(0, z - s_a)\nf_B = v sum_i b_i l_i,      l_i = clamp(z - s_i, 0, d_i)\n";

/// The value, or a dash.
#[must_use]
pub fn or_dash(value: Option<String>) -> String {
    value.unwrap_or_else(|| "-".to_owned())
}

/// Three decimals, or a dash when there is no finite value.
#[must_use]
pub fn three_decimals(x: Option<f64>) -> String {
    or_dash(x.filter(|x| x.is_finite()).map(|x| format!("{x:.3}")))
}

/// An effect's id with spaces for underscores.
pub(crate) fn effect_label(id: &str) -> String {
    id.replace('_', " ")
}

/// The strength parameters of an effect with their units.
#[must_use]
pub fn strength_parameters(effect: &str, values: &BTreeMap<String, f64>) -> String {
    let known = |path: &str| stylet_tissue::known_effect_info(effect).and_then(|i| i.parameter(path));
    let unit = |path: &str| known(path).map_or("", |p| p.unit);
    let one = |(path, x): (&String, &f64)| {
        format!("{path} = {} {}", significant(*x, 2), unit(path)).trim_end().to_owned()
    };
    let strength = |path: &str| known(path).is_some_and(|p| p.strength);
    values.iter().filter(|(p, _)| strength(p)).map(one).collect::<Vec<_>>().join(", ")
}

/// `value * unit` with `digits` significant digits, or a dash.
#[must_use]
pub fn significant_or_dash(value: Option<f64>, unit: f64, digits: usize) -> String {
    or_dash(value.map(|x| significant(x * unit, digits)))
}

/// The data quality remarks as a table.
pub(crate) fn data_quality_table(title: &str, quality: &[DataQualityNote]) -> Table {
    let row = |q: &DataQualityNote| vec![Cell::text(q.recording.clone()), Cell::text(q.note.message.clone())];
    Table::new(title, &["recording", "remark"], quality.iter().map(row).collect())
}

/// Sentences on recordings whose force is off zero in air, from their names and offsets (N).
#[must_use]
pub fn zero_offset_sentences<'a>(
    recordings: impl IntoIterator<Item = (&'a str, Option<f64>)>,
) -> Vec<String> {
    let sentence = |(name, offset_n): (&str, Option<f64>)| {
        let offset = significant(offset_n?, 3);
        Some(format!(
            "{name}: the force is off zero by {offset} N in air, as with a sensor that was not zeroed; the offset was subtracted."
        ))
    };
    recordings.into_iter().filter_map(sentence).collect()
}
