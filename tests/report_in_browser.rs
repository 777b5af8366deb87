//! The report of a run opens in a real browser without an error and shows its curves.
//!
//! The page tests itself when its address ends in `#selftest`; see `stylet-report`. Without a browser the test prints SKIPPED.

#[allow(dead_code)]
#[path = "../crates/report/tests/support/browser.rs"]
mod browser;
use crate::support;

use std::io::Write;
use support::{scenario, stylet};

#[test]
fn the_report_of_the_first_command_opens_in_a_browser_and_shows_every_curve() {
    let Some(program) = browser::find() else {
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: no chromium found: the run's report was not opened in a browser"
        );
        return;
    };
    let scratch = browser::Scratch::new("first-command");
    let folder = scratch.path().join("out");
    let file = scenario("three_layer_latex_constant");
    let arguments = ["run", file.to_str().expect("a path"), "--out", folder.to_str().expect("a path")];
    let output = stylet(&arguments);
    assert!(output.status.success(), "{output:?}");
    let dom = browser::dump_dom(&program, &scratch, "first-command", &folder.join("report.html"));
    let attribute = |name: &str| -> Vec<&str> {
        dom.split(&format!("{name}=\"")).skip(1).filter_map(|rest| rest.split('"').next()).collect()
    };
    assert!(attribute("data-errors").is_empty(), "JavaScript errors: {:?}", attribute("data-errors"));
    let charts: usize =
        attribute("data-ready").first().and_then(|n| n.parse().ok()).expect("a finished self-test");
    let drawn: Vec<usize> = attribute("data-series").iter().filter_map(|n| n.parse().ok()).collect();
    println!("{charts} charts, {} curves", drawn.iter().sum::<usize>());
    assert_eq!(drawn.len(), charts);
    assert!(charts >= 6 && drawn.iter().sum::<usize>() >= 15, "{charts} charts with {drawn:?} curves");
    let missing: Vec<&str> = attribute("data-missing").into_iter().filter(|m| !m.is_empty()).collect();
    assert!(missing.is_empty(), "curves without pixels: {missing:?}");
}
