//! Renders a [`Page`] to one HTML file: markup here, scripts and style sheet in `assets/`.

use crate::chart_json;
use crate::chart_model::Chart;
use crate::escaping::{escape_html, escape_script_json, percent_encode, slug};
use crate::page_model::{Block, Cell, Code, Page, Section, Status, SvgImage, Table, Text, Tile};
use crate::vendored::{UPLOT_CSS, UPLOT_JS, UPLOT_LICENCE};
use std::fmt::Write;

const PAGE_CSS: &str = include_str!("../assets/page.css");
/// In load order: each may use the ones before.
const PAGE_JS: [&str; 5] = [
    include_str!("../assets/drawing.js"),
    include_str!("../assets/legend.js"),
    include_str!("../assets/needle.js"),
    include_str!("../assets/charts.js"),
    include_str!("../assets/selftest.js"),
];
/// Runs first, so that tests catch every script error.
const ERROR_TRAP: &str = "addEventListener('error',function(e){var d=document.documentElement;\
d.dataset.errors=(d.dataset.errors||'')+e.message+'\\n'});";
/// Forbids all network access.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";
/// A cell with more characters may wrap at a minimum width; shorter cells, such as numbers, stay on one line.
const LONG_TEXT: usize = 48;
const LONG_NUMBER: usize = 14;
/// A longer text without spaces, a path of a field or score, may break after `_` and `.`.
const LONG_IDENTIFIER: usize = 24;
/// A table with more columns is set smaller.
const WIDE_TABLE_COLUMNS: usize = 6;
/// With more sections the links are folded.
const MAX_SECTION_LINKS: usize = 14;
/// How to use the charts; once per page.
const CHART_HINT: &str = "<p class=\"hint\"><b>Drag</b> to zoom, <b>Shift + drag</b> or <b>Shift + wheel</b> to pan, \
<b>Ctrl + wheel</b> to zoom at the cursor, <b>double-click</b> to reset; charts over the same abscissa move together. \
Click a name to hide its curve. <button type=\"button\" data-reset>Reset zoom</button></p>\n";
const DISCLAIMER: &str = "Research software, not a medical device.";

impl Page {
    /// The page as one HTML file: scripts, styles and data inside, the same bytes for the same page.
    #[must_use]
    pub fn to_html(&self) -> String {
        render(self)
    }
}

fn render(page: &Page) -> String {
    let charts: Vec<&Chart> = page
        .sections
        .iter()
        .flat_map(|section| &section.blocks)
        .filter_map(|block| if let Block::Chart(chart) = block { Some(chart) } else { None })
        .collect();
    let mut out = String::with_capacity(1 << 20);
    render_head(&mut out, page);
    out.push_str("<body>\n");
    render_page_header(&mut out, page);
    out.push_str("<main>\n");
    let mut chart_number = 0;
    for (index, section) in page.sections.iter().enumerate() {
        render_section(&mut out, section, index, &mut chart_number);
    }
    out.push_str("</main>\n");
    let _ = writeln!(
        out,
        "<footer><p>{DISCLAIMER} Drawn by Stylet with uPlot (MIT licence, © 2022 Leon Sorokin). \
         This file is self-contained and loads nothing from the network. \
         docs/how-to/read_your_report.md explains every plot and number.</p></footer>"
    );
    if !charts.is_empty() {
        let _ = writeln!(
            out,
            "<script type=\"application/json\" id=\"data\">{}</script>",
            escape_script_json(&chart_json::render(&charts))
        );
        let _ = writeln!(out, "<script>/*\n{}\n*/\n{UPLOT_JS}</script>", UPLOT_LICENCE.trim());
        let _ = writeln!(out, "<script>(function(){{\n\"use strict\";\n{}}})();</script>", PAGE_JS.concat());
    }
    out.push_str("</body>\n</html>\n");
    out
}

fn render_head(out: &mut String, page: &Page) {
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<script>{ERROR_TRAP}</script>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{}</title>\n<style>\n{UPLOT_CSS}{PAGE_CSS}</style>\n</head>\n",
        escape_html(&page.title)
    );
}

fn render_page_header(out: &mut String, page: &Page) {
    let _ = writeln!(
        out,
        "<header>\n<p class=\"disclaimer\">{DISCLAIMER}</p>\n<h1>{}</h1>",
        escape_html(&page.title)
    );
    if !page.subtitle.is_empty() {
        let _ = writeln!(out, "<p class=\"subtitle\">{}</p>", escape_html(&page.subtitle));
    }
    if !page.facts.is_empty() {
        out.push_str("<dl class=\"facts\">");
        for (name, value) in &page.facts {
            let _ = write!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escape_html(name), escape_html(value));
        }
        out.push_str("</dl>\n");
    }
    let links = page.sections.len();
    let folded = links > MAX_SECTION_LINKS;
    if folded {
        let _ = write!(out, "<details class=\"contents\"><summary>Contents ({links} sections)</summary>");
    }
    if links > 2 {
        out.push_str("<nav aria-label=\"Sections\">");
        for (index, section) in page.sections.iter().enumerate() {
            let _ =
                write!(out, "<a href=\"#{}\">{}</a>", anchor(section, index), escape_html(&section.title));
        }
        out.push_str("</nav>\n");
    }
    if folded {
        out.push_str("</details>\n");
    }
    out.push_str("</header>\n");
}

fn anchor(section: &Section, index: usize) -> String {
    format!("{}-{}", slug(&section.title), index + 1)
}

fn render_section(out: &mut String, section: &Section, index: usize, number: &mut usize) {
    let _ = writeln!(
        out,
        "<section id=\"{}\">\n<h2>{}</h2>",
        anchor(section, index),
        escape_html(&section.title)
    );
    for block in &section.blocks {
        match block {
            Block::Chart(chart) => {
                if *number == 0 {
                    out.push_str(CHART_HINT);
                }
                render_chart(out, chart, *number);
                *number += 1;
            }
            Block::Table(table) => render_table(out, table),
            Block::Scorecard(tiles) => render_scorecard(out, tiles),
            Block::Text(words) => render_text(out, words),
            Block::Svg(image) => render_image(out, image),
            Block::Code(code) => render_code(out, code),
        }
    }
    out.push_str("</section>\n");
}

fn render_chart(out: &mut String, chart: &Chart, number: usize) {
    let names: Vec<&str> =
        chart.series.iter().map(|s| &*s.name).chain(chart.lanes.iter().map(|l| &*l.name)).collect();
    let description =
        format!("{}: {} against {}: {}", chart.title, chart.y_label, chart.x_label, names.join(", "));
    let _ = writeln!(out, "<figure class=\"chart\">\n<figcaption><h3>{}</h3>", escape_html(&chart.title));
    if !chart.caption.is_empty() {
        let _ = writeln!(out, "<p>{}</p>", escape_html(&chart.caption));
    }
    let _ = writeln!(out, "</figcaption>\n<div class=\"legend\" id=\"legend-{number}\"></div>");
    let plot = format!(
        "<div class=\"plot\" id=\"plot-{number}\" style=\"min-height:{}px\" role=\"img\" tabindex=\"0\" aria-label=\"{}\">\
         <noscript>This chart needs JavaScript.</noscript></div>",
        chart.height_px,
        escape_html(&description)
    );
    let _ = if chart.needle.is_some() {
        writeln!(
            out,
            "<div class=\"insertion\"><canvas id=\"needle-{number}\" role=\"img\" aria-label=\"Needle in the layers\"></canvas>{plot}</div>\n\
             <div class=\"player\" id=\"player-{number}\"><button type=\"button\">Play</button>\
             <input type=\"range\" min=\"0\" max=\"1000\" value=\"1000\" aria-label=\"Time of the insertion\"><output></output></div>\n</figure>"
        )
    } else {
        writeln!(out, "{plot}\n</figure>")
    };
}

fn render_scorecard(out: &mut String, tiles: &[Tile]) {
    out.push_str("<dl class=\"scorecard\">\n");
    for tile in tiles {
        let _ = writeln!(
            out,
            "<div class=\"tile {}\"><dt>{}</dt><dd>{}<small>{}</small></dd></div>",
            tile.status.class(),
            escape_html(&tile.label),
            escape_html(&tile.value),
            escape_html(&tile.detail)
        );
    }
    out.push_str("</dl>\n");
}

fn render_table(out: &mut String, table: &Table) {
    let title = escape_html(&table.title);
    let wide = if table.headers.len() > WIDE_TABLE_COLUMNS { " wide" } else { "" };
    let _ =
        writeln!(out, "<div class=\"table{wide}\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\">");
    let _ = writeln!(out, "<table><caption>{title}</caption><thead>");
    if !table.column_groups.is_empty() {
        out.push_str("<tr>");
        for (name, columns) in &table.column_groups {
            let _ = write!(
                out,
                "<th scope=\"colgroup\" colspan=\"{columns}\" class=\"group\">{}</th>",
                escape_html(name)
            );
        }
        out.push_str("</tr>\n");
    }
    out.push_str("<tr>");
    for (column, header) in table.headers.iter().enumerate() {
        let numeric = table.rows.iter().any(|row| row.get(column).is_some_and(|cell| cell.right_aligned));
        let class = if numeric { " class=\"n\"" } else { "" };
        let _ = write!(out, "<th scope=\"col\"{class}>{}</th>", escape_html(header));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        out.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            render_cell(out, cell, column == 0);
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
}

fn render_cell(out: &mut String, cell: &Cell, heading: bool) {
    let (tag, scope) = if heading { ("th", " scope=\"row\"") } else { ("td", "") };
    let mut classes: Vec<&str> = Vec::new();
    if cell.right_aligned {
        classes.push("n");
    }
    if cell.text.chars().count() > if cell.right_aligned { LONG_NUMBER } else { LONG_TEXT } {
        classes.push("long");
    }
    if cell.status != Status::Plain {
        classes.push(cell.status.class());
    }
    let class = if classes.is_empty() { String::new() } else { format!(" class=\"{}\"", classes.join(" ")) };
    let mut text = escape_html(&cell.text);
    if cell.text.len() > LONG_IDENTIFIER && !cell.text.contains(' ') {
        text = text.replace('_', "_<wbr>").replace('.', ".<wbr>");
    }
    let _ = write!(out, "<{tag}{scope}{class}>{text}</{tag}>");
}

fn render_text(out: &mut String, words: &Text) {
    let _ = write!(out, "<div class=\"text {}\">", words.status.class());
    for paragraph in &words.paragraphs {
        let _ = write!(out, "<p>{}</p>", escape_html(paragraph));
    }
    out.push_str("</div>\n");
}

fn render_image(out: &mut String, image: &SvgImage) {
    let _ = writeln!(
        out,
        "<p class=\"picture\"><img alt=\"{}\" src=\"data:image/svg+xml;charset=utf-8,{}\"></p>",
        escape_html(&image.description),
        percent_encode(&image.markup)
    );
}

fn render_code(out: &mut String, code: &Code) {
    let title = escape_html(&code.title);
    let body = format!("<pre tabindex=\"0\"><code>{}</code></pre>", escape_html(&code.text));
    if code.folded {
        let _ = writeln!(out, "<details><summary>{title}</summary>{body}</details>");
    } else {
        let _ = writeln!(out, "<h3>{title}</h3>{body}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart_model::Series;
    use crate::palette::Colour;

    #[test]
    fn every_text_is_escaped_wherever_it_is_put() {
        let evil = "</script><script>alert('x')</script>\"";
        let chart = Chart::new(evil, evil, evil).group(evil).with_series(Series::line(
            evil,
            Colour::Blue,
            vec![0.0, 1.0],
            vec![f64::NAN, f64::INFINITY],
        ));
        let page = Page::new(evil).subtitle(evil).fact(evil, evil).section(
            Section::new(evil)
                .block(Block::Chart(chart))
                .table(Table {
                    title: evil.into(),
                    column_groups: vec![(evil.into(), 1)],
                    headers: vec![evil.into()],
                    rows: vec![vec![Cell::text(evil)]],
                })
                .text(evil)
                .block(Block::Svg(SvgImage { description: evil.into(), markup: evil.into() }))
                .block(Block::Code(Code { title: evil.into(), text: evil.into(), folded: true })),
        );
        let html = page.to_html();
        assert!(!html.contains("alert('x')</script>"));
        assert_eq!(html.matches("<script").count(), 4);
        assert_eq!(html.matches("</script>").count(), 4);
        assert!(html.contains("[null,null]"));
    }

    #[test]
    fn the_file_asks_the_network_for_nothing() {
        let html = Page::new("t").section(Section::new("s").text("x")).to_html();
        assert!(html.contains("default-src 'none'"));
        assert!(!html.contains("src=\"http") && !html.contains("href=\"http") && !html.contains("@import"));
        assert!(html.contains("Research software, not a medical device"));
    }
}
