//! Charts stacked over one abscissa.

use super::axis::axis_ticks;
use super::figure_options::FigureOptions;
use super::svg_canvas::{Anchor, Canvas, text_width};
use crate::chart_model::{Chart, LineStyle, Scale, Series, Side, finite_extent};
use crate::palette::Colour;
use stylet_stats::number_format::significant;

const LEFT: f64 = 66.0;
const RIGHT: f64 = 18.0;
const GAP: f64 = 16.0;
const LABEL_ROW: f64 = 17.0;

/// The rectangle of one panel and its scales.
struct Panel<'a> {
    chart: &'a Chart,
    top: f64,
    height: f64,
    width: f64,
    x: (f64, f64),
    y: (f64, f64),
}

impl Panel<'_> {
    fn px(&self, x: f64) -> f64 {
        LEFT + (x - self.x.0) / (self.x.1 - self.x.0) * self.width
    }

    fn py(&self, y: f64) -> f64 {
        let part = (to_chart_scale(self.chart.scale, y) - self.y.0) / (self.y.1 - self.y.0);
        self.top + self.height * (1.0 - part)
    }
}

/// The ordinate on the chart's scale (linear, log10 or asinh).
fn to_chart_scale(scale: Scale, y: f64) -> f64 {
    match scale {
        Scale::Linear => y,
        Scale::Log => {
            if y > 0.0 {
                libm::log10(y)
            } else {
                f64::NAN
            }
        }
        Scale::Asinh(threshold) => (y / threshold).asinh(),
    }
}

/// Draws the charts one above the other over a common abscissa, with one legend; band labels stand in the uppermost.
/// A name with the same colour in several charts appears in the legend once.
#[must_use]
pub fn figure(charts: &[Chart], options: &FigureOptions) -> String {
    let mut canvas = Canvas::new(options);
    let width = canvas.width() - LEFT - RIGHT;
    let x = charts.iter().filter_map(Chart::x_extent).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let x = x.filter(|(low, high)| low < high).unwrap_or((0.0, 1.0));
    let mut top = canvas.heading(options, LEFT);
    top = legend(&mut canvas, charts, top);
    for (index, chart) in charts.iter().enumerate() {
        let last = index + 1 == charts.len();
        let height = f64::from(chart.height_px.clamp(24, 2000));
        let panel = Panel { chart, top, height, width, x, y: ordinates(chart, height) };
        draw_panel(&mut canvas, &panel, index == 0, last);
        top += height + GAP;
    }
    let label = charts.last().map_or("", |chart| chart.x_label.as_str());
    canvas.text(LEFT + width / 2.0, top + 20.0, Anchor::Middle, "", label);
    let titles: Vec<&str> = charts.iter().map(|chart| chart.title.as_str()).collect();
    canvas.finish(top + 32.0, &format!("{}. {}", options.title, titles.join("; ")))
}

/// The range of the panel on its bent scale, with room for labels at the top.
fn ordinates(chart: &Chart, height: f64) -> (f64, f64) {
    let curves = chart.series.iter().filter(|s| !s.hidden).flat_map(|s| s.y.iter().copied());
    let data =
        chart.y_range.or_else(|| finite_extent(curves.chain(chart.levels.iter().map(|level| level.y))));
    let (low, high) = data.unwrap_or((0.0, 1.0));
    let positive = chart.series.iter().flat_map(|s| s.y.iter().copied()).filter(|y| *y > 0.0);
    let low = if chart.scale == Scale::Log { finite_extent(positive).map_or(0.1, |e| e.0) } else { low };
    let (low, high) = (to_chart_scale(chart.scale, low), to_chart_scale(chart.scale, high));
    let (low, high) = if high > low { (low, high) } else { (low - 0.5, low + 0.5) };
    let labels = usize::from(chart.bands.iter().any(|b| !b.label.is_empty()))
        + usize::from(chart.markers.iter().any(|set| set.marks.iter().any(|(_, label)| !label.is_empty())));
    let room = labels as f64 * LABEL_ROW;
    let margin = (high - low) * 0.05;
    (low - margin, high + margin + (high - low) * room / (height - room).max(20.0))
}

fn draw_panel(canvas: &mut Canvas, panel: &Panel<'_>, first: bool, last: bool) {
    let Panel { chart, top, height, width, .. } = *panel;
    let bottom = top + height;
    canvas.clip(LEFT, top, width, height);
    for band in &chart.bands {
        let (a, b) = (panel.px(band.from), panel.px(band.to));
        canvas.rect(a, top, b - a, height, &format!("area f-{}", band.colour.name()));
    }
    canvas.unclip();
    for x in axis_ticks(panel.x.0, panel.x.1, (width / 90.0) as usize) {
        let px = panel.px(x);
        canvas.line((px, top), (px, bottom), "grid");
        if last {
            canvas.text(px, bottom + 17.0, Anchor::Middle, "t", &significant(x, 6));
        }
    }
    if chart.lanes.is_empty() {
        ordinate_axis(canvas, panel);
    }
    canvas.clip(LEFT, top, width, height);
    lanes(canvas, panel);
    for series in chart.series.iter().filter(|s| !s.hidden) {
        draw_series(canvas, panel, series);
    }
    for level in &chart.levels {
        let y = panel.py(level.y);
        canvas.line(
            (LEFT, y),
            (LEFT + width, y),
            &format!("m l-{} {}", level.colour.name(), dash(level.style)),
        );
        let class = format!("t halo f-{}", level.colour.name());
        canvas.text(
            LEFT + width - 6.0,
            if level.y < 0.0 { y + 14.0 } else { y - 4.0 },
            Anchor::End,
            &class,
            &level.label,
        );
    }
    markers(canvas, panel);
    if first {
        for band in &chart.bands {
            let (a, b) = (panel.px(band.from).max(LEFT), panel.px(band.to).min(LEFT + width));
            if text_width(&band.label, 12.0) < b - a {
                canvas.text((a + b) / 2.0, top + 15.0, Anchor::Middle, "b halo", &band.label);
            }
        }
    }
    canvas.unclip();
    if chart.lanes.is_empty() {
        canvas.line((LEFT, top), (LEFT, bottom), "frame");
        canvas.line((LEFT, bottom), (LEFT + width, bottom), "frame");
    } else {
        canvas.text(LEFT - 7.0, f64::midpoint(top, bottom) + 4.0, Anchor::End, "t", &chart.y_label);
    }
}

fn ordinate_axis(canvas: &mut Canvas, panel: &Panel<'_>) {
    let count = ((panel.height / 36.0) as usize).max(2);
    let values = match panel.chart.scale {
        Scale::Linear => axis_ticks(panel.y.0, panel.y.1, count),
        Scale::Log => (panel.y.0.ceil() as i32..=panel.y.1.floor() as i32).map(|p| 10f64.powi(p)).collect(),
        Scale::Asinh(threshold) => [0.0, 1.0, 10.0, 100.0, 1000.0, 1e4].map(|m| m * threshold).to_vec(),
    };
    for y in values {
        let py = panel.py(y);
        if py.is_finite() && py >= panel.top && py <= panel.top + panel.height {
            canvas.line((LEFT, py), (LEFT + panel.width, py), "grid");
            canvas.text(LEFT - 7.0, py + 4.0, Anchor::End, "t", &significant(y, 3));
        }
    }
    canvas.vertical_text(17.0, panel.top + panel.height / 2.0, "", &panel.chart.y_label);
}

fn lanes(canvas: &mut Canvas, panel: &Panel<'_>) {
    let row = panel.height / panel.chart.lanes.len().max(1) as f64;
    for (index, lane) in panel.chart.lanes.iter().enumerate() {
        let top = panel.top + row * index as f64;
        for span in &lane.spans {
            let (a, b) = (panel.px(span.from), panel.px(span.to));
            canvas.rect(a, top + 1.0, (b - a).max(1.5), row - 2.0, &lane_class(span.colour.name()));
            if text_width(&span.label, 11.5) + 8.0 < b - a {
                canvas.text(
                    (a + b) / 2.0,
                    top + row / 2.0 + 4.0,
                    Anchor::Middle,
                    if span.colour == Colour::Grey { "" } else { "on" },
                    &span.label,
                );
            }
        }
    }
}

/// Grey is the rest state and is drawn faint.
fn lane_class(colour: &str) -> String {
    format!("f-{colour}{}", if colour == Colour::Grey.name() { " rest" } else { "" })
}

fn dash(style: LineStyle) -> &'static str {
    match style {
        LineStyle::Dashed => "dashed",
        LineStyle::Dotted => "dotted",
        LineStyle::Solid | LineStyle::Step | LineStyle::Points => "",
    }
}

/// Up to this many points have a rim in the background colour; with more, the rims would hide the points below.
const MAX_POINTS_WITH_RIM: usize = 100;

fn draw_series(canvas: &mut Canvas, panel: &Panel<'_>, series: &Series) {
    let mut runs: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    for (x, y) in series.x.iter().zip(&series.y) {
        let point = (panel.px(*x), panel.py(*y));
        let Some(run) = runs.last_mut() else { return };
        if !(point.0.is_finite() && point.1.is_finite()) {
            if !run.is_empty() {
                runs.push(Vec::new());
            }
            continue;
        }
        // Clipped points need no exact coordinate.
        let point = (point.0, point.1.clamp(panel.top - 50.0, panel.top + panel.height + 50.0));
        if let (LineStyle::Step, Some(before)) = (series.style, run.last().copied()) {
            run.push((point.0, before.1));
        }
        run.push(point);
    }
    if series.style == LineStyle::Points {
        let rim = if series.x.len() > MAX_POINTS_WITH_RIM { "" } else { "p " };
        for (x, y) in runs.into_iter().flatten() {
            canvas.circle(x, y, series.width_px, &format!("{rim}f-{}", series.colour.name()));
        }
        return;
    }
    let runs: Vec<_> = runs.iter().map(|run| thin(run)).collect();
    canvas.path(&runs, series.width_px, &format!("l l-{} {}", series.colour.name(), dash(series.style)));
}

/// Thins a curve to the first, lowest, highest and last point of every pixel column.
fn thin(run: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    for group in run.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        let by = |a: &usize, b: &usize| group[*a].1.total_cmp(&group[*b].1);
        let lowest = (0..group.len()).min_by(by).unwrap_or_default();
        let highest = (0..group.len()).max_by(by).unwrap_or_default();
        let mut kept = vec![0, lowest, highest, group.len() - 1];
        kept.sort_unstable();
        kept.dedup();
        out.extend(kept.into_iter().map(|index| group[index]));
    }
    out
}

fn markers(canvas: &mut Canvas, panel: &Panel<'_>) {
    for set in &panel.chart.markers {
        for (x, _) in &set.marks {
            let px = panel.px(*x);
            let class = format!("m l-{} {}", set.colour.name(), dash(set.style));
            canvas.line((px, panel.top), (px, panel.top + panel.height), &class);
        }
    }
    let first = if panel.chart.bands.iter().any(|b| !b.label.is_empty()) { LABEL_ROW } else { 0.0 };
    let mut rows: [Vec<(f64, f64)>; 3] = Default::default();
    for set in &panel.chart.markers {
        for (x, label) in set.marks.iter().filter(|(_, label)| !label.is_empty()) {
            let (px, width) = (panel.px(*x), text_width(label, 11.5) + 5.0);
            let fits_right = px + 4.0 + width < LEFT + panel.width;
            let right = (set.side == Side::Right && fits_right) || px - width < LEFT;
            let left = if right { px + 5.0 } else { px - width };
            let Some(row) =
                rows.iter().position(|row| row.iter().all(|(a, b)| left + width < *a || left > *b))
            else {
                continue;
            };
            rows[row].push((left, left + width));
            let y = panel.top + first + 14.0 + LABEL_ROW * row as f64;
            canvas.text(left, y, Anchor::Start, &format!("t halo f-{}", set.colour.name()), label);
        }
    }
}

/// Symbol before a name in the legend.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Curve,
    Upright,
    Area,
}

/// One legend over all panels; gives the ordinate below it.
fn legend(canvas: &mut Canvas, charts: &[Chart], top: f64) -> f64 {
    let mut entries: Vec<(&str, &str, LineStyle, Mark)> = Vec::new();
    for chart in charts {
        let curves =
            chart.series.iter().filter(|s| !s.hidden).map(|s| (&s.name, s.colour, s.style, Mark::Curve));
        let lines = chart.markers.iter().map(|m| (&m.name, m.colour, m.style, Mark::Upright));
        let spans = chart
            .lanes
            .iter()
            .flat_map(|l| &l.spans)
            .map(|s| (&s.label, s.colour, LineStyle::Solid, Mark::Area));
        for (name, colour, style, mark) in curves.chain(lines).chain(spans) {
            let entry = (name.as_str(), colour.name(), style, mark);
            if !entries.iter().any(|known| known.0 == entry.0 && known.1 == entry.1) {
                entries.push(entry);
            }
        }
    }
    entries.sort_by_key(|entry| entry.3 == Mark::Area);
    let (mut x, mut y) = (LEFT, top + 16.0);
    let mut areas = false;
    for (name, colour, style, mark) in &entries {
        let sign = if *mark == Mark::Upright { 10.0 } else { 24.0 };
        let width = sign + 6.0 + text_width(name, 12.0) + 16.0;
        let first_area = !areas && *mark == Mark::Area;
        areas |= first_area;
        if (first_area || x + width > canvas.width() - RIGHT) && x > LEFT {
            x = LEFT;
            y += 20.0;
        }
        let class = format!("l l-{colour} {}", dash(*style));
        match (style, mark) {
            (LineStyle::Points, _) => canvas.circle(x + 12.0, y - 4.0, 4.5, &format!("p f-{colour}")),
            (_, Mark::Upright) => canvas.path(&[vec![(x + 5.0, y - 12.0), (x + 5.0, y + 4.0)]], 2.0, &class),
            (_, Mark::Area) => canvas.rect(x, y - 10.0, 24.0, 12.0, &lane_class(colour)),
            (_, Mark::Curve) => canvas.path(&[vec![(x, y - 4.0), (x + 24.0, y - 4.0)]], 2.4, &class),
        }
        canvas.text(x + sign + 6.0, y, Anchor::Start, "", name);
        x += width;
    }
    if entries.is_empty() { top } else { y + 14.0 }
}
