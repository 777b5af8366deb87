//! A state diagram: boxes at given positions and labelled arrows.

use super::figure_options::FigureOptions;
use super::svg_canvas::{Anchor, Canvas, text_width};

/// A state.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Its name, one or more lines.
    pub lines: Vec<String>,
    /// Centre, in pixels from the left and from below the heading.
    pub at: (f64, f64),
}

/// An arrow from the border of one box to that of another.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrow {
    /// Index of the box where it begins.
    pub from: usize,
    /// Index of the box where it ends.
    pub to: usize,
    /// Label at its middle, one or more lines.
    pub lines: Vec<String>,
    /// Offset of its middle to the left of its direction, in pixels.
    pub bend_px: f64,
    /// Drawn dashed.
    pub dashed: bool,
}

/// Boxes and arrows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagram {
    /// The boxes.
    pub nodes: Vec<Node>,
    /// The arrows.
    pub arrows: Vec<Arrow>,
    /// Height of the drawing below the heading, in pixels.
    pub height_px: f64,
}

const HALF: (f64, f64) = (84.0, 27.0);
const LINE: f64 = 16.0;

/// Draws the diagram as SVG.
#[must_use]
pub fn state_machine(diagram: &Diagram, options: &FigureOptions) -> String {
    let mut canvas = Canvas::new(options);
    let top = canvas.heading(options, 16.0);
    let at = |index: usize| diagram.nodes.get(index).map(|n| (n.at.0, n.at.1 + top));
    for arrow in &diagram.arrows {
        let (Some(from), Some(to)) = (at(arrow.from), at(arrow.to)) else { continue };
        draw(&mut canvas, arrow, from, to);
    }
    for node in &diagram.nodes {
        let (x, y) = (node.at.0, node.at.1 + top);
        canvas.rounded(x - HALF.0, y - HALF.1, 2.0 * HALF.0, 2.0 * HALF.1, "paper m l-ink");
        let first = y + 4.5 - LINE * (node.lines.len().saturating_sub(1)) as f64 / 2.0;
        for (row, line) in node.lines.iter().enumerate() {
            canvas.text(x, first + LINE * row as f64, Anchor::Middle, "b", line);
        }
    }
    let names: Vec<String> = diagram.nodes.iter().map(|n| n.lines.join(" ")).collect();
    canvas.finish(top + diagram.height_px, &format!("{}. States: {}", options.title, names.join("; ")))
}

fn draw(canvas: &mut Canvas, arrow: &Arrow, from: (f64, f64), to: (f64, f64)) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = libm::hypot(dx, dy).max(1e-9);
    let left = (dy / length, -dx / length);
    let middle = (
        f64::midpoint(from.0, to.0) + left.0 * arrow.bend_px,
        f64::midpoint(from.1, to.1) + left.1 * arrow.bend_px,
    );
    // A quadratic curve through the middle; its control point lies twice as far out.
    let control =
        (2.0 * middle.0 - f64::midpoint(from.0, to.0), 2.0 * middle.1 - f64::midpoint(from.1, to.1));
    let at = |t: f64| {
        let (a, b, c) = ((1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t);
        (a * from.0 + b * control.0 + c * to.0, a * from.1 + b * control.1 + c * to.1)
    };
    let inside = |p: (f64, f64), centre: (f64, f64), gap: f64| {
        (p.0 - centre.0).abs() < HALF.0 + gap && (p.1 - centre.1).abs() < HALF.1 + gap
    };
    let points: Vec<(f64, f64)> = (0..=200)
        .map(|i| at(f64::from(i) / 200.0))
        .filter(|p| !inside(*p, from, 0.0) && !inside(*p, to, 3.0))
        .collect();
    let dash = if arrow.dashed { "dashed" } else { "" };
    if let (Some(tip), Some(before)) =
        (points.last(), points.len().checked_sub(6).and_then(|i| points.get(i)))
    {
        let (ux, uy) = (tip.0 - before.0, tip.1 - before.1);
        let norm = libm::hypot(ux, uy).max(1e-9);
        let (ux, uy) = (ux / norm, uy / norm);
        let back = (tip.0 - 11.0 * ux, tip.1 - 11.0 * uy);
        let head = vec![(back.0 - 5.0 * uy, back.1 + 5.0 * ux), *tip, (back.0 + 5.0 * uy, back.1 - 5.0 * ux)];
        canvas.path(&[head], 1.8, "l l-ink");
    }
    canvas.path(&[points], 1.6, &format!("l l-ink {dash}"));
    // The label is placed on the outer side of the bend.
    let widest = arrow.lines.iter().map(|l| text_width(l, 12.0)).fold(0.0, f64::max);
    let rows = arrow.lines.len() as f64;
    let side = if arrow.bend_px < 0.0 { -1.0 } else { 1.0 };
    let away = 9.0 + left.0.abs() * widest / 2.0 + left.1.abs() * rows * LINE / 2.0;
    let centre = (middle.0 + side * left.0 * away, middle.1 + side * left.1 * away);
    let first = centre.1 + 4.5 - LINE * (rows - 1.0) / 2.0;
    for (row, line) in arrow.lines.iter().enumerate() {
        canvas.text(centre.0, first + LINE * row as f64, Anchor::Middle, "t halo", line);
    }
}
