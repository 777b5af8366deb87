//! Third-party code that pages contain.

/// uPlot 1.6.32, draws charts on a canvas; defines `uPlot`.
pub const UPLOT_JS: &str = include_str!("../assets/uPlot.iife.min.js");
/// Its style sheet.
pub const UPLOT_CSS: &str = include_str!("../assets/uPlot.min.css");
/// Its licence (MIT).
pub const UPLOT_LICENCE: &str = include_str!("../assets/LICENSE-uPlot");
