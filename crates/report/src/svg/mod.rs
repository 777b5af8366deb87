//! Still pictures as SVG text without scripts or embedded fonts; the same input gives the same bytes.
//!
//! [`figure`] stacks charts over one abscissa, [`bar_chart`] compares values with error bars, [`heat_map`] colours a
//! matrix (a confusion matrix, a sweep over two parameters), [`strip_chart`] shows all values of several groups, and
//! [`state_machine`] boxes and arrows.

mod axis;
mod bar_chart;
mod figure_options;
mod heat_map;
mod line_figure;
mod state_diagram;
mod strip_chart;
mod svg_canvas;

pub use bar_chart::{Bar, BarChart, bar_chart};
pub use figure_options::FigureOptions;
pub use heat_map::{HeatMap, heat_map};
pub use line_figure::figure;
pub use state_diagram::{Arrow, Diagram, Node, state_machine};
pub use strip_chart::{Strip, StripChart, StripGroup, strip_chart};
