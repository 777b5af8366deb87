//! Promise: the report opens in a real browser, without an error, and every curve is on the screen.
//!
//! The page itself looks for its curves' pixels and drags a mouse over its charts when its address ends in `#selftest`
//! (`assets/selftest.js`); this test reads the verdicts, and counts colours in a screenshot that the page had no part in.
//! Without a browser the test prints SKIPPED.

#[path = "support/browser.rs"]
mod browser;
#[path = "support/synthetic.rs"]
mod synthetic;

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use stylet_report::{Block, Chart, Colour, Page, RunReport, Scale, Section, Series};

/// The attributes of the opening tags that contain `needle`.
fn tags<'a>(dom: &'a str, needle: &str) -> Vec<HashMap<&'a str, &'a str>> {
    dom.split('<')
        .filter(|tag| tag.contains(needle))
        .map(|tag| attributes(tag.split('>').next().unwrap_or("")))
        .collect()
}

fn attributes(tag: &str) -> HashMap<&str, &str> {
    let mut out = HashMap::new();
    let mut parts = tag.split('"');
    while let (Some(name), Some(value)) = (parts.next(), parts.next()) {
        out.insert(name.trim().trim_end_matches('=').rsplit(' ').next().unwrap_or(""), value);
    }
    out
}

fn charts(page: &Page) -> Vec<&Chart> {
    let blocks = page.sections.iter().flat_map(|section| &section.blocks);
    blocks.filter_map(|block| if let Block::Chart(chart) = block { Some(chart) } else { None }).collect()
}

/// Opens the page and checks the results of its self-test.
fn check(program: &std::path::Path, scratch: &browser::Scratch, name: &str, page: &Page) {
    let file = scratch.path().join(format!("{name}.html"));
    fs::write(&file, page.to_html()).expect("the page can be written");
    let dom = browser::dump_dom(program, scratch, name, &file);
    let root = tags(&dom, "html lang");
    assert_eq!(root.first().and_then(|r| r.get("data-errors")), None, "{name}: JavaScript errors");
    let expected = charts(page);
    let ready = root.first().and_then(|r| r.get("data-ready")).copied();
    assert_eq!(
        ready,
        Some(expected.len().to_string().as_str()),
        "{name}: the page did not finish its self-test"
    );
    let plots = tags(&dom, "class=\"plot\"");
    assert_eq!(plots.len(), expected.len(), "{name}: number of charts");
    for (plot, chart) in plots.iter().zip(&expected) {
        let number = |key: &str| plot.get(key).and_then(|v| v.parse::<usize>().ok());
        let visible = chart.series.iter().filter(|s| !s.hidden).count();
        let spans: usize = chart.lanes.iter().map(|lane| lane.spans.len()).sum();
        let title = format!("{name}: {}", chart.title);
        assert_eq!(number("data-series"), Some(visible), "{title}: curves drawn");
        assert_eq!(
            number("data-seen"),
            Some(visible),
            "{title}: not on the canvas: {:?}",
            plot.get("data-missing")
        );
        assert_eq!(number("data-spans"), Some(spans), "{title}: spans drawn");
        assert_eq!(number("data-markers"), Some(chart.markers.len()), "{title}: marker kinds drawn");
        assert!(visible + spans > 0, "{title}: an empty chart proves nothing");
        assert!(visible == 0 || number("data-points") > Some(0), "{title}: points drawn");
        assert_eq!(plot.get("data-moves"), Some(&"ok"), "{title}: zoom, values under the cursor, reset");
    }
}

/// Straight to the terminal: the output of a test that passes is not shown otherwise.
fn skipped(what: &str) {
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: no chromium found: {what} not tested in a browser (set CHROME or install chromium)"
    );
}

fn count(pixels: &[[u8; 3]], colour: Colour) -> usize {
    let channel =
        |at: usize| u8::from_str_radix(&colour.light()[at..at + 2], 16).expect("a hexadecimal colour");
    let want = [channel(1), channel(3), channel(5)];
    pixels.iter().filter(|p| p.iter().zip(want).all(|(a, b)| a.abs_diff(b) <= 6)).count()
}

fn report_is_drawn(name: &str, report: &RunReport) {
    let Some(program) = browser::find() else {
        skipped(name);
        return;
    };
    let scratch = browser::Scratch::new(name);
    let page = report.to_page();
    check(&program, &scratch, name, &page);
    let pixels = browser::screenshot(
        &program,
        &scratch,
        &format!("{name}-shot"),
        &scratch.path().join(format!("{name}.html")),
    );
    for chart in charts(&page) {
        for series in chart.series.iter().filter(|s| !s.hidden) {
            let found = count(&pixels, series.colour);
            assert!(
                found > 50,
                "{name}: {} of {} leaves {found} pixels in the screenshot",
                series.colour.name(),
                series.name
            );
        }
    }
    assert_eq!(
        count(&pixels, Colour::SkyBlue).min(1),
        usize::from(uses(&page, Colour::SkyBlue)),
        "a colour nobody drew"
    );
}

fn uses(page: &Page, colour: Colour) -> bool {
    charts(page).iter().any(|chart| {
        chart.series.iter().any(|s| s.colour == colour)
            || chart.lanes.iter().any(|lane| lane.spans.iter().any(|span| span.colour == colour))
    })
}

#[test]
fn the_report_of_a_simulated_run_draws_every_curve_and_zooms_as_one() {
    report_is_drawn("run", &synthetic::synthetic_run(1));
}

#[test]
fn four_combinations_side_by_side_stay_visible() {
    report_is_drawn("combinations", &synthetic::synthetic_run(4));
}

#[test]
fn the_report_of_measured_data_needs_no_truth() {
    report_is_drawn("measured", &synthetic::measured_run());
}

/// What no run report contains: logarithmic axes, hostile names, long data with gaps, charts outside any group.
#[test]
fn odd_pages_are_drawn_too() {
    let Some(program) = browser::find() else {
        skipped("odd pages");
        return;
    };
    let x: Vec<f64> = (0..60_000).map(f64::from).collect();
    let gappy =
        x.iter().map(|v| if (*v / 3500.0) as i64 % 2 == 0 { (v / 900.0).sin() } else { f64::NAN }).collect();
    let name = "</script><script>throw 1</script>";
    let long = Chart::new(name, "n", "y").group("'\"<g>").with_series(Series::line(
        name,
        Colour::Green,
        x.clone(),
        gappy,
    ));
    let powers: Vec<f64> = x.iter().step_by(100).map(|v| 10f64.powf(v / 10_000.0 - 3.0)).collect();
    let few: Vec<f64> = x.iter().copied().step_by(100).collect();
    let log = Chart::new("log", "n", "y").with_series(Series::line("powers", Colour::Purple, few, powers));
    let log = Chart { scale: Scale::Log, ..log };
    let lone = Chart::new("one point", "n", "y").with_series(Series::points(
        "p",
        Colour::Blue,
        vec![3.0],
        vec![4.0],
    ));
    let mut page = Page::new(name).section(Section::new(name).chart(long).chart(log).chart(lone.clone()));
    page.sections[0].blocks.push(Block::Chart(Chart { title: "again".into(), ..lone }));
    let scratch = browser::Scratch::new("odd");
    check(&program, &scratch, "odd", &page);
}
