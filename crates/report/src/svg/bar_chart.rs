//! Bars with intervals: rates, errors, times side by side.

use super::axis::axis_ticks;
use super::figure_options::FigureOptions;
use super::svg_canvas::{Anchor, Canvas, text_width};
use crate::chart_model::finite_extent;
use crate::palette::Colour;
use stylet_stats::number_format::significant;

/// One bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Label of the bar.
    pub name: String,
    /// Length.
    pub value: f64,
    /// Interval drawn as whisker: low and high, in the units of the value.
    pub interval: Option<(f64, f64)>,
    /// Colour.
    pub colour: Colour,
}

/// Bars of one quantity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BarChart {
    /// Quantity and unit.
    pub label: String,
    /// The bars, from the top.
    pub bars: Vec<Bar>,
}

/// Draws horizontal bars: names stay readable however long.
#[must_use]
pub fn bar_chart(chart: &BarChart, options: &FigureOptions) -> String {
    const ROW: f64 = 30.0;
    let mut canvas = Canvas::new(options);
    let longest = chart.bars.iter().map(|bar| text_width(&bar.name, 12.0)).fold(0.0, f64::max);
    let left = (longest + 20.0).min(canvas.width() * 0.45);
    let width = canvas.width() - left - 70.0;
    let top = canvas.heading(options, 16.0);
    let values = chart.bars.iter().flat_map(|bar| {
        let (low, high) = bar.interval.unwrap_or((bar.value, bar.value));
        [bar.value, low, high]
    });
    let (low, high) = finite_extent(values.chain([0.0])).unwrap_or((0.0, 1.0));
    let high = if high > low { high } else { low + 1.0 };
    let px = |value: f64| left + (value - low) / (high - low) * width;
    let bottom = top + ROW * chart.bars.len() as f64;
    for tick in axis_ticks(low, high, (width / 90.0) as usize) {
        canvas.line((px(tick), top), (px(tick), bottom), "grid");
        canvas.text(px(tick), bottom + 17.0, Anchor::Middle, "t", &significant(tick, 4));
    }
    for (index, bar) in chart.bars.iter().enumerate() {
        let y = top + ROW * index as f64;
        canvas.text(left - 10.0, y + ROW / 2.0 + 4.0, Anchor::End, "", &bar.name);
        if !bar.value.is_finite() {
            canvas.text(px(0.0) + 6.0, y + ROW / 2.0 + 4.0, Anchor::Start, "t", "no value");
            continue;
        }
        let (a, b) = (px(bar.value.min(0.0)), px(bar.value.max(0.0)));
        canvas.rect(a, y + 6.0, b - a, ROW - 12.0, &format!("f-{}", bar.colour.name()));
        let mut end = b;
        if let Some((from, to)) = bar.interval.filter(|(from, to)| from.is_finite() && to.is_finite()) {
            let middle = y + ROW / 2.0;
            canvas.line((px(from), middle), (px(to), middle), "m l-ink");
            for edge in [from, to] {
                canvas.line((px(edge), middle - 5.0), (px(edge), middle + 5.0), "m l-ink");
            }
            end = end.max(px(to));
        }
        canvas.text(end + 8.0, y + ROW / 2.0 + 4.0, Anchor::Start, "b", &significant(bar.value, 3));
    }
    canvas.line((px(0.0), top), (px(0.0), bottom), "frame");
    canvas.text(left + width / 2.0, bottom + 38.0, Anchor::Middle, "", &chart.label);
    canvas.finish(bottom + 50.0, &format!("{}. Bars of {}", options.title, chart.label))
}
