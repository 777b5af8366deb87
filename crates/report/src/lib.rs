//! Self-contained HTML reports and SVG figures.
//!
//! This crate draws results and does not compute any. It has four parts:
//!
//! - [`Page`]: a page builder (charts, tables, score tiles, text, code). [`Page::to_html`] gives one self-contained file whose
//!   charts zoom and pan together.
//! - [`RunReport`]: the columns and numbers of one simulated or measured insertion; [`RunReport::to_page`] lays them out.
//! - [`pages`]: the pages of diagnosis, prediction, plan, identifiability, comparison, benchmark and sweep.
//! - [`svg`]: still pictures: stacked charts, bars, heat maps, strips and state diagrams.

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
pub mod vendored;

pub use chart_model::{Band, Chart, Lane, Level, LineStyle, MarkerSet, Scale, Series, Side, Span};
pub use decimate::{kept_indices, values_at};
pub use insertion_report::RunReport;
pub use page_model::{Block, Cell, Code, Page, Section, Status, SvgImage, Table, Text, Tile};
pub use palette::Colour;
pub use stylet_stats::number_format::{p_value, percent, plus_minus, significant};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
