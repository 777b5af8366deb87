//! Self-contained HTML reports and SVG figures.
//!
//! Results only: this crate knows no other crate of Stylet. It offers three things:
//!
//! - [`Page`]: a general page builder (charts, tables, score tiles, text, code). [`Page::to_html`] gives one file that
//!   opens in any browser, without a network, and whose charts zoom and pan together.
//! - [`RunReport`]: the columns and numbers of one simulated or measured insertion; [`RunReport::to_page`] lays them out.
//! - [`svg`]: still pictures of the same charts, and bars, heat maps and confusion matrices, with the same bytes every time.
//!
//! ```
//! use stylet_report::{Block, Chart, Colour, Page, Section, Series};
//!
//! let time_s: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.005).collect();
//! let force_n = time_s.iter().map(|t| 2.0 * t).collect();
//! let chart = Chart::new("Force", "Time (s)", "Force (N)")
//!     .with_series(Series::line("measured", Colour::Blue, time_s, force_n));
//! let html = Page::new("One needle").section(Section::new("Force").block(Block::Chart(chart))).to_html();
//! assert!(html.starts_with("<!DOCTYPE html>"));
//! ```

mod chart_json;
mod chart_model;
mod decimate;
mod escaping;
mod html_renderer;
pub mod insertion_report;
pub mod live_page;
mod page_model;
pub mod pages;
mod palette;
pub mod svg;

pub use chart_model::{Band, Chart, Lane, Level, LineStyle, MarkerSet, Scale, Series, Side, Span};
pub use insertion_report::RunReport;
pub use page_model::{Block, Cell, Code, Page, Scorecard, Section, Status, SvgImage, Table, Text, Tile};
pub use palette::Colour;
pub use stylet_stats::number_format::{p_value, percent, plus_minus, significant};
