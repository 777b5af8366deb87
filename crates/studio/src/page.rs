//! The page, embedded: modules without a build step, and uPlot, which the reports draw with, too.

/// The page itself.
pub const INDEX: &str = include_str!("../page/index.html");

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// Type and text of a file of the page.
pub fn asset(name: &str) -> Option<(&'static str, &'static str)> {
    Some(match name {
        "style.css" => (STYLE, include_str!("../page/style.css")),
        "app.js" => (SCRIPT, include_str!("../page/app.js")),
        "api.js" => (SCRIPT, include_str!("../page/api.js")),
        "dom.js" => (SCRIPT, include_str!("../page/dom.js")),
        "chart.js" => (SCRIPT, include_str!("../page/chart.js")),
        "open.js" => (SCRIPT, include_str!("../page/open.js")),
        "look.js" => (SCRIPT, include_str!("../page/look.js")),
        "phantom.js" => (SCRIPT, include_str!("../page/phantom.js")),
        "explain.js" => (SCRIPT, include_str!("../page/explain.js")),
        "drawer.js" => (SCRIPT, include_str!("../page/drawer.js")),
        "uplot.js" => (SCRIPT, stylet_report::vendored::UPLOT_JS),
        "uplot.css" => (STYLE, stylet_report::vendored::UPLOT_CSS),
        _ => return None,
    })
}
