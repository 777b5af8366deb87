//! A coloured matrix: a confusion matrix, a score over two parameters.

use super::figure_options::FigureOptions;
use super::svg_canvas::{Anchor, Canvas, text_width};
use crate::chart_model::finite_extent;
use stylet_stats::number_format::significant;

/// A matrix with named rows and columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeatMap {
    /// Meaning of the rows.
    pub row_label: String,
    /// Meaning of the columns.
    pub column_label: String,
    /// Names of the rows, from the top.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// `values[row][column]`; a value that is not finite stays blank.
    pub values: Vec<Vec<f64>>,
    /// The values are fractions, 0 to 1: coloured over that range and written in per cent, zeros included; a value that is not
    /// finite has no cell.
    pub values_are_fractions: bool,
}

/// Draws the matrix in eight shades of blue with each value in its cell; zeros stay empty unless the values are fractions.
#[must_use]
pub fn heat_map(map: &HeatMap, options: &FigureOptions) -> String {
    let mut canvas = Canvas::new(options);
    let longest = |names: &[String]| names.iter().map(|name| text_width(name, 12.0)).fold(0.0, f64::max);
    let left = (longest(&map.rows) + 44.0).min(canvas.width() * 0.4);
    let top = canvas.heading(options, 16.0);
    let columns = map.columns.len().max(1) as f64;
    let cell_width = ((canvas.width() - left - 20.0) / columns).min(90.0);
    let cell_height = cell_width.clamp(20.0, 38.0);
    let turned = longest(&map.columns) + 8.0 > cell_width;
    let head = if turned { longest(&map.columns) + 14.0 } else { 24.0 };
    let grid_top = top + head;
    let range = finite_extent(map.values.iter().flatten().copied()).unwrap_or((0.0, 1.0));
    let low = range.0.min(0.0);
    let span = if map.values_are_fractions {
        1.0
    } else if range.1 > low {
        range.1 - low
    } else {
        1.0
    };
    for (column, name) in map.columns.iter().enumerate() {
        let x = left + cell_width * (column as f64 + 0.5);
        if turned {
            canvas.vertical_text(x + 4.0, grid_top - 7.0 - text_width(name, 12.0) / 2.0, "", name);
        } else {
            canvas.text(x, grid_top - 8.0, Anchor::Middle, "", name);
        }
    }
    for (row, name) in map.rows.iter().enumerate() {
        let y = grid_top + cell_height * row as f64;
        canvas.text(left - 8.0, y + cell_height / 2.0 + 4.0, Anchor::End, "", name);
        for (column, value) in map.values.get(row).into_iter().flatten().enumerate().take(map.columns.len()) {
            if map.values_are_fractions && !value.is_finite() {
                continue;
            }
            let x = left + cell_width * column as f64;
            let part = if value.is_finite() { (value - low) / span } else { 0.0 };
            canvas.rect(
                x + 0.5,
                y + 0.5,
                cell_width - 1.0,
                cell_height - 1.0,
                &format!("q{}", (part * 7.999) as usize),
            );
            if value.is_finite() && (*value != 0.0 || map.values_are_fractions) {
                let class = if part > 0.5 { "t hi" } else { "t lo" };
                let middle = y + cell_height / 2.0 + 4.0;
                let label = if map.values_are_fractions {
                    format!("{:.0} %", 100.0 * value)
                } else {
                    significant(*value, 3)
                };
                canvas.text(x + cell_width / 2.0, middle, Anchor::Middle, class, &label);
            }
        }
    }
    let bottom = grid_top + cell_height * map.rows.len() as f64;
    // A label longer than the rows are high would be cut at the ends.
    if text_width(&map.row_label, 11.5) <= bottom - grid_top {
        canvas.vertical_text(14.0, f64::midpoint(grid_top, bottom), "t", &map.row_label);
    } else {
        canvas.text(left - 8.0, grid_top - 8.0, Anchor::End, "t", &map.row_label);
    }
    canvas.text(left + cell_width * columns / 2.0, bottom + 22.0, Anchor::Middle, "t", &map.column_label);
    canvas
        .finish(bottom + 34.0, &format!("{}. {} against {}", options.title, map.row_label, map.column_label))
}
