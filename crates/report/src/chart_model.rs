//! A chart as plain data: curves, marked times, bands, thresholds, lanes. Drawing is done by the page script and by `svg`.

use crate::palette::Colour;
use serde::Serialize;

/// How a curve or a marker line is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LineStyle {
    /// Unbroken line.
    #[default]
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Constant until the next value. For markers the same as `Solid`.
    Step,
    /// Separate points. For markers the same as `Solid`.
    Points,
}

/// The vertical axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; values of zero and below are omitted.
    Log,
    /// Linear up to the given value, logarithmic beyond, with sign: for a statistic with a threshold.
    Asinh(f64),
}

/// One curve with its abscissae; equal columns are stored once in the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// Line, dashes, steps or points.
    pub style: LineStyle,
    /// Line width or half the point size, in pixels.
    pub width_px: f64,
    /// Abscissae, not decreasing unless the chart is parametric.
    pub x: Vec<f64>,
    /// Ordinates; a value that is not finite leaves a gap.
    pub y: Vec<f64>,
    /// Hidden until switched on.
    pub hidden: bool,
}

impl Series {
    /// A solid line.
    #[must_use]
    pub fn line(name: impl Into<String>, colour: Colour, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { name: name.into(), colour, style: LineStyle::Solid, width_px: 1.5, x, y, hidden: false }
    }

    /// Steps: `y[i]` holds from `x[i]` to `x[i + 1]`.
    #[must_use]
    pub fn step(name: impl Into<String>, colour: Colour, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { style: LineStyle::Step, ..Self::line(name, colour, x, y) }
    }

    /// Separate points.
    #[must_use]
    pub fn points(name: impl Into<String>, colour: Colour, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self { style: LineStyle::Points, width_px: 4.5, ..Self::line(name, colour, x, y) }
    }

    /// The same curve in another style.
    #[must_use]
    pub fn styled(mut self, style: LineStyle) -> Self {
        self.style = style;
        self
    }

    /// The same curve with another line width.
    #[must_use]
    pub fn width(mut self, width_px: f64) -> Self {
        self.width_px = width_px;
        self
    }

    /// The same curve, hidden (`true`) until the reader switches it on.
    #[must_use]
    pub fn hidden(mut self, hidden: bool) -> Self {
        self.hidden = hidden;
        self
    }
}

/// Side of the line on which a marker's label is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// To the left of the line.
    Left,
    /// To the right of the line.
    #[default]
    Right,
}

/// Vertical lines with one meaning: true ruptures, detections, compensation times.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerSet {
    /// Name in the legend.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// Solid, dashed or dotted.
    pub style: LineStyle,
    /// Side of the labels.
    pub side: Side,
    /// Abscissa and label (may be empty) of each line.
    pub marks: Vec<(f64, String)>,
}

/// A shaded interval of the abscissa over the chart's full height.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Name written at its top.
    pub label: String,
    /// Colour, drawn faint.
    pub colour: Colour,
}

/// A horizontal line: a threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Ordinate.
    pub y: f64,
    /// Name written at its right end.
    pub label: String,
    /// Colour.
    pub colour: Colour,
    /// Solid, dashed or dotted.
    pub style: LineStyle,
}

impl Level {
    /// A grey line at zero, without a name.
    #[must_use]
    pub fn zero() -> Self {
        Self { y: 0.0, label: String::new(), colour: Colour::Grey, style: LineStyle::Solid }
    }

    /// A dotted grey line.
    #[must_use]
    pub fn dotted(y: f64, label: impl Into<String>) -> Self {
        Self { y, label: label.into(), colour: Colour::Grey, style: LineStyle::Dotted }
    }
}

/// One row of coloured spans: the states of a state machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Lane {
    /// Name of the row.
    pub name: String,
    /// Its spans; one label has one colour.
    pub spans: Vec<Span>,
}

/// A span of a [`Lane`].
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Name of the state.
    pub label: String,
    /// Colour.
    pub colour: Colour,
}

/// Animation of the needle in the layers, next to a chart over time, driven by playing or dragging the time.
#[derive(Clone, Debug, PartialEq)]
pub struct Needle {
    /// Time in s, increasing, as the chart's abscissa.
    pub time_s: Vec<f64>,
    /// Position of the tip in mm at these times, positive into the tissue.
    pub tip_mm: Vec<f64>,
    /// Faces of the layers in mm: the surface, then the end of each layer.
    pub faces_mm: Vec<f64>,
}

/// One chart. Charts with the same `group` share zoom, pan and cursor.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// One sentence under the heading; may be empty.
    pub caption: String,
    /// Name and unit of the abscissa.
    pub x_label: String,
    /// Name and unit of the ordinate.
    pub y_label: String,
    /// Charts of one group share zoom, pan and cursor.
    pub group: Option<String>,
    /// Height of the drawing in pixels.
    pub height_px: u32,
    /// Vertical scale.
    pub scale: Scale,
    /// Fixed vertical range instead of the data's.
    pub y_range: Option<(f64, f64)>,
    /// The abscissa need not increase (force against depth): points are connected in the order given.
    pub parametric: bool,
    /// Curves.
    pub series: Vec<Series>,
    /// Vertical lines.
    pub markers: Vec<MarkerSet>,
    /// Shaded intervals.
    pub bands: Vec<Band>,
    /// Horizontal lines.
    pub levels: Vec<Level>,
    /// Rows of spans; a chart with lanes shows no curves.
    pub lanes: Vec<Lane>,
    /// A needle that moves with the time of the curves.
    pub needle: Option<Needle>,
}

impl Chart {
    /// An empty chart.
    #[must_use]
    pub fn new(title: impl Into<String>, x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            caption: String::new(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            group: None,
            height_px: 260,
            scale: Scale::Linear,
            y_range: None,
            parametric: false,
            series: Vec::new(),
            markers: Vec::new(),
            bands: Vec::new(),
            levels: Vec::new(),
            lanes: Vec::new(),
            needle: None,
        }
    }

    /// Adds a curve.
    #[must_use]
    pub fn with_series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds vertical lines, unless there are none.
    #[must_use]
    pub fn with_markers(mut self, markers: MarkerSet) -> Self {
        if !markers.marks.is_empty() {
            self.markers.push(markers);
        }
        self
    }

    /// Adds shaded intervals.
    #[must_use]
    pub fn with_bands(mut self, bands: Vec<Band>) -> Self {
        self.bands.extend(bands);
        self
    }

    /// Adds a threshold.
    #[must_use]
    pub fn with_level(mut self, level: Level) -> Self {
        self.levels.push(level);
        self
    }

    /// Adds a needle that moves with the time of the curves.
    #[must_use]
    pub fn with_needle(mut self, needle: Needle) -> Self {
        self.needle = Some(needle);
        self
    }

    /// Sets the sentence under the heading.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Sets the group that shares zoom, pan and cursor.
    #[must_use]
    pub fn group(mut self, group: impl Into<String>) -> Self {
        self.group = Some(group.into());
        self
    }

    /// Sets the height in pixels.
    #[must_use]
    pub fn height(mut self, height_px: u32) -> Self {
        self.height_px = height_px;
        self
    }

    /// Whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let curve =
            self.series.iter().any(|s| s.x.iter().zip(&s.y).any(|(x, y)| x.is_finite() && y.is_finite()));
        !curve && self.lanes.iter().all(|lane| lane.spans.is_empty())
    }

    /// Smallest and largest finite abscissa of curves and lanes.
    #[must_use]
    pub fn x_extent(&self) -> Option<(f64, f64)> {
        let curves = self.series.iter().flat_map(|s| s.x.iter().copied());
        let lanes = self.lanes.iter().flat_map(|l| l.spans.iter().flat_map(|s| [s.from, s.to]));
        finite_extent(curves.chain(lanes))
    }
}

/// Smallest and largest finite value, if there is one.
pub(crate) fn finite_extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
    })
}
