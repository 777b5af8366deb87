//! Strip chart: all values of several groups side by side, with median, 5th to 95th percentile and reference value.

use super::axis::axis_ticks;
use super::figure_options::FigureOptions;
use super::svg_canvas::{Anchor, Canvas};
use crate::chart_model::finite_extent;
use crate::palette::Colour;
use stylet_stats::number_format::significant;

/// The values of one strip.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// Name in the legend; the same name has the same colour.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// All values; values that are not finite are left out.
    pub values: Vec<f64>,
}

/// Strips that belong together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StripGroup {
    /// Name below the group.
    pub name: String,
    /// Reference value, drawn across the group.
    pub truth: Option<f64>,
    /// The strips.
    pub strips: Vec<Strip>,
}

/// Groups over one ordinate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StripChart {
    /// Quantity and unit.
    pub label: String,
    /// Name of the reference value in the legend.
    pub truth_label: String,
    /// The groups.
    pub groups: Vec<StripGroup>,
    /// Height of the drawing in pixels.
    pub height_px: f64,
}

const LEFT: f64 = 76.0;

/// Draws the chart as SVG.
#[must_use]
pub fn strip_chart(chart: &StripChart, options: &FigureOptions) -> String {
    let mut canvas = Canvas::new(options);
    let top = canvas.heading(options, LEFT);
    let top = legend(&mut canvas, chart, top);
    let width = canvas.width() - LEFT - 18.0;
    let bottom = top + chart.height_px;
    let values = chart.groups.iter().flat_map(|g| {
        g.strips.iter().flat_map(|s| s.values.iter().copied()).chain(g.truth).collect::<Vec<_>>()
    });
    let (low, high) = finite_extent(values.chain([0.0])).unwrap_or((0.0, 1.0));
    let high = if high > low { high + 0.05 * (high - low) } else { low + 1.0 };
    let py = |y: f64| bottom - (y - low) / (high - low) * chart.height_px;
    for tick in axis_ticks(low, high, (chart.height_px / 40.0) as usize) {
        canvas.line((LEFT, py(tick)), (LEFT + width, py(tick)), "grid");
        canvas.text(LEFT - 7.0, py(tick) + 4.0, Anchor::End, "t", &significant(tick, 4));
    }
    let each = width / chart.groups.len().max(1) as f64;
    for (index, group) in chart.groups.iter().enumerate() {
        let left = LEFT + each * index as f64 + each * 0.06;
        let room = each * 0.88;
        let strip = room / group.strips.len().max(1) as f64;
        if let Some(truth) = group.truth {
            canvas.path(&[vec![(left, py(truth)), (left + room, py(truth))]], 1.6, "l l-ink dashed");
        }
        for (place, s) in group.strips.iter().enumerate() {
            draw(&mut canvas, s, (left + strip * (place as f64 + 0.5), strip), &py);
        }
        canvas.text(left + room / 2.0, bottom + 20.0, Anchor::Middle, "", &group.name);
        if index > 0 {
            let x = LEFT + each * index as f64;
            canvas.line((x, top), (x, bottom), "grid");
        }
    }
    canvas.line((LEFT, top), (LEFT, bottom), "frame");
    canvas.line((LEFT, bottom), (LEFT + width, bottom), "frame");
    canvas.vertical_text(17.0, f64::midpoint(top, bottom), "", &chart.label);
    canvas.finish(bottom + 36.0, &format!("{}. {}", options.title, chart.label))
}

fn draw(canvas: &mut Canvas, strip: &Strip, (x, width): (f64, f64), py: &dyn Fn(f64) -> f64) {
    let sorted = stylet_stats::sorted(strip.values.iter().copied().filter(|v| v.is_finite()));
    if sorted.is_empty() {
        canvas.text(x, py(0.0) - 6.0, Anchor::Middle, "t", "none");
        return;
    }
    let colour = strip.colour.name();
    // Every value, spread over the strip in a fixed pattern so that equal ones do not hide each other.
    for (index, value) in strip.values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let aside = ((index * 7) % 11) as f64 / 10.0 - 0.5;
        canvas.circle(x + aside * width * 0.3, py(*value), 2.2, &format!("faint f-{colour}"));
    }
    let at = |q: f64| stylet_stats::quantile_of_sorted(&sorted, q);
    let (low, middle, high) = (py(at(0.05)), py(at(0.5)), py(at(0.95)));
    let side = x + width * 0.26;
    canvas.path(&[vec![(side, low), (side, high)]], 2.4, &format!("l l-{colour}"));
    canvas.circle(side, middle, 4.5, &format!("p f-{colour}"));
}

fn legend(canvas: &mut Canvas, chart: &StripChart, top: f64) -> f64 {
    let mut names: Vec<(&str, Colour)> = Vec::new();
    for strip in chart.groups.iter().flat_map(|g| &g.strips) {
        if !names.contains(&(strip.name.as_str(), strip.colour)) {
            names.push((&strip.name, strip.colour));
        }
    }
    let mut x = LEFT;
    let mut y = top + 16.0;
    for (name, colour) in names {
        let wide = super::svg_canvas::text_width(name, 12.0) + 34.0;
        if x + wide > canvas.width() - 18.0 && x > LEFT {
            x = LEFT;
            y += 20.0;
        }
        canvas.circle(x + 6.0, y - 4.0, 4.5, &format!("p f-{}", colour.name()));
        canvas.text(x + 16.0, y, Anchor::Start, "", name);
        x += wide;
    }
    if chart.groups.iter().any(|g| g.truth.is_some()) {
        canvas.path(&[vec![(x, y - 4.0), (x + 24.0, y - 4.0)]], 1.6, "l l-ink dashed");
        canvas.text(x + 30.0, y, Anchor::Start, "", &chart.truth_label);
    }
    y + 14.0
}
