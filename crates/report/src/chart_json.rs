//! The data for the page's script as JSON: every column stored once, charts refer to columns by index.

use crate::chart_model::{Chart, Scale, Series};
use crate::decimate::{MAX_POINTS, kept_indices, values_at};
use crate::palette::Colour;
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::collections::HashMap;
use stylet_stats::number_format::push_rounded;

/// Significant digits of ordinates, and of abscissae, which must stay distinct over long recordings.
const Y_DIGITS: usize = 6;
const X_DIGITS: usize = 9;

/// A column as it is, or thinned.
type Column<'a> = Cow<'a, [f64]>;

/// Columns as JSON text, in the order of first use.
#[derive(Default)]
struct Columns {
    texts: Vec<String>,
    index: HashMap<String, usize>,
}

impl Columns {
    fn intern(&mut self, values: &[f64], digits: usize) -> usize {
        let mut text = String::with_capacity(values.len() * 8 + 2);
        push_json_array(&mut text, values, digits);
        if let Some(&known) = self.index.get(&text) {
            return known;
        }
        let number = self.texts.len();
        self.index.insert(text.clone(), number);
        self.texts.push(text);
        number
    }
}

/// All charts of a page as one JSON text: `{"palette", "charts", "columns"}`.
pub(crate) fn render(charts: &[&Chart]) -> String {
    let mut columns = Columns::default();
    let charts: Vec<Value> = charts.iter().map(|chart| chart_json(chart, &mut columns)).collect();
    let mut palette = Map::new();
    for colour in Colour::ALL {
        palette.insert(colour.name().to_owned(), json!([colour.light(), colour.dark()]));
    }
    format!(
        "{{\"palette\":{},\"charts\":{},\"columns\":[\n{}\n]}}",
        Value::Object(palette),
        Value::Array(charts),
        columns.texts.join(",\n")
    )
}

fn chart_json(chart: &Chart, columns: &mut Columns) -> Value {
    let thinned = thin(chart);
    let series: Vec<Value> = chart
        .series
        .iter()
        .zip(&thinned)
        .map(|(series, (x, y))| {
            let x_digits = if chart.parametric { Y_DIGITS } else { X_DIGITS };
            json!({
                "name": series.name,
                "colour": series.colour.name(),
                "style": series.style,
                "width": series.width_px,
                "hidden": series.hidden,
                "x": columns.intern(x, x_digits),
                "y": columns.intern(y, Y_DIGITS),
            })
        })
        .collect();
    let markers: Vec<Value> = chart
        .markers
        .iter()
        .map(|set| {
            json!({ "name": set.name, "colour": set.colour.name(), "style": set.style, "side": set.side,
                    "marks": set.marks.iter().filter(|(x, _)| x.is_finite()).collect::<Vec<_>>() })
        })
        .collect();
    let bands: Vec<Value> = chart.bands.iter().map(|b| span_json(b.from, b.to, &b.label, b.colour)).collect();
    let levels: Vec<Value> = chart
        .levels
        .iter()
        .filter(|level| level.y.is_finite())
        .map(|level| json!({"y": level.y, "label": level.label, "colour": level.colour.name(), "style": level.style}))
        .collect();
    let lanes: Vec<Value> = chart
        .lanes
        .iter()
        .map(|lane| {
            let spans: Vec<Value> =
                lane.spans.iter().map(|s| span_json(s.from, s.to, &s.label, s.colour)).collect();
            json!({ "name": lane.name, "spans": spans })
        })
        .collect();
    let (scale, linear_below) = match chart.scale {
        Scale::Linear => ("linear", None),
        Scale::Log => ("log", None),
        Scale::Asinh(threshold) => ("asinh", Some(threshold)),
    };
    let needle = chart.needle.as_ref().map(|needle| {
        json!({
            "time": columns.intern(&needle.time_s, X_DIGITS),
            "tip": columns.intern(&needle.tip_mm, Y_DIGITS),
            "faces": needle.faces_mm,
        })
    });
    json!({
        "title": chart.title, "x": chart.x_label, "y": chart.y_label, "group": chart.group,
        "height": chart.height_px, "scale": scale, "linearBelow": linear_below, "yRange": chart.y_range,
        "parametric": chart.parametric, "series": series, "markers": markers, "bands": bands,
        "levels": levels, "lanes": lanes, "needle": needle,
    })
}

fn span_json(from: f64, to: f64, label: &str, colour: Colour) -> Value {
    json!([from, to, label, colour.name()])
}

/// Every curve's columns, thinned when long. Curves on one abscissa keep the same samples, so that they stay aligned.
fn thin(chart: &Chart) -> Vec<(Column<'_>, Column<'_>)> {
    let thin_one = |series: &'_ Series| -> Option<Vec<usize>> {
        if series.y.len() <= MAX_POINTS {
            return None;
        }
        let twins: Vec<&[f64]> = chart
            .series
            .iter()
            .filter(|other| same_abscissa(other, series))
            .map(|other| &other.y[..])
            .collect();
        kept_indices(&twins, series.x.len().min(series.y.len()), MAX_POINTS)
    };
    chart
        .series
        .iter()
        .map(|series| match thin_one(series) {
            Some(kept) => (Cow::Owned(values_at(&series.x, &kept)), Cow::Owned(values_at(&series.y, &kept))),
            None => {
                let length = series.x.len().min(series.y.len());
                (Cow::Borrowed(&series.x[..length]), Cow::Borrowed(&series.y[..length]))
            }
        })
        .collect()
}

fn same_abscissa(a: &Series, b: &Series) -> bool {
    a.x.len() == b.x.len()
        && a.y.len() == b.y.len()
        && a.x.iter().zip(&b.x).all(|(p, q)| p.to_bits() == q.to_bits())
}

/// Appends a JSON array of numbers rounded to `digits` significant digits; NaN and infinity become `null`.
fn push_json_array(out: &mut String, values: &[f64], digits: usize) {
    out.push('[');
    for (index, &value) in values.iter().enumerate() {
        if index > 0 {
            out.push(',');
        }
        if value.is_finite() {
            push_rounded(out, value, digits);
        } else {
            out.push_str("null");
        }
    }
    out.push(']');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_digits_are_kept_and_what_is_not_finite_becomes_null() {
        let mut out = String::new();
        push_json_array(
            &mut out,
            &[1.234_567_89, f64::NAN, -0.0, 1.0e-7, f64::INFINITY, 123_456_789.0, 0.1 + 0.2],
            6,
        );
        assert_eq!(out, "[1.23457,null,0,1e-7,null,123457000,0.3]");
    }

    #[test]
    fn a_column_used_by_several_charts_is_stored_once() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let chart = Chart::new("a", "t", "f").with_series(Series::line("f", Colour::Blue, x.clone(), x));
        let text = render(&[&chart, &chart]);
        let value: Value = serde_json::from_str(&text).expect("valid JSON");
        assert_eq!(value["columns"].as_array().map(Vec::len), Some(1));
        assert_eq!(value["charts"][1]["series"][0]["y"], 0);
    }

    #[test]
    fn long_curves_on_one_abscissa_stay_aligned() {
        let n = 100_000;
        let x: Vec<f64> = (0..n).map(f64::from).collect();
        let y: Vec<f64> = (0..n).map(|i| f64::from((i * 619) % 1000)).collect();
        let z: Vec<f64> = (0..n).map(|i| f64::from((i * 733) % 1000)).collect();
        let chart = Chart::new("a", "t", "f")
            .with_series(Series::line("y", Colour::Blue, x.clone(), y))
            .with_series(Series::line("z", Colour::Green, x, z));
        let value: Value = serde_json::from_str(&render(&[&chart])).expect("valid JSON");
        assert_eq!(value["charts"][0]["series"][0]["x"], value["charts"][0]["series"][1]["x"]);
        assert_eq!(value["columns"].as_array().map(Vec::len), Some(3));
    }
}
