//! Still pictures: SVG text without scripts or fonts of its own, the same bytes for the same numbers.
//!
//! [`figure`] stacks charts over one abscissa, [`bar_chart`] compares values with error bars, [`heat_map`] colours a
//! matrix (a confusion matrix, a sweep over two parameters), [`strip_chart`] shows all values of several groups, and
//! [`state_machine`] boxes and arrows.

mod bar_chart;
mod heat_map;
mod line_figure;
mod state_diagram;
mod strip_chart;
mod svg_canvas;

pub use bar_chart::{Bar, BarChart, bar_chart};
pub use heat_map::{HeatMap, heat_map};
pub use line_figure::figure;
pub use state_diagram::{Arrow, Diagram, Node, state_machine};
pub use strip_chart::{Strip, StripChart, StripGroup, strip_chart};

use serde::{Deserialize, Serialize};

/// On which ground the picture is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Theme {
    /// Light or dark as the reader's system asks (README pages).
    #[default]
    Auto,
    /// Light (papers).
    Light,
    /// Dark (slides).
    Dark,
}

/// Size and words of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureOptions {
    /// Heading; may be empty.
    pub title: String,
    /// Line below the heading; may be empty.
    pub subtitle: String,
    /// Width in pixels; the height follows from the content.
    pub width_px: f64,
    /// Ground.
    pub theme: Theme,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self { title: String::new(), subtitle: String::new(), width_px: 960.0, theme: Theme::Auto }
    }
}
