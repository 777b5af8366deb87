//! Writes SVG elements with rounded coordinates and colours by class, so that one file serves light and dark themes.

use super::axis::svg_coordinate;
use super::figure_options::FigureOptions;
use crate::escaping;
use crate::palette::Colour;
use std::fmt::Write;

const FONT: &str =
    "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif";

/// Eight shades of blue from low to high, for light and dark backgrounds.
const SHADES: [(&str, &str); 8] = [
    ("#f3f6f9", "#1a2027"),
    ("#dbe8f3", "#173247"),
    ("#bad7ec", "#17435f"),
    ("#8fc0e1", "#185779"),
    ("#5ba3d3", "#1b6f9c"),
    ("#2c85c0", "#2f8dc4"),
    ("#0f68a6", "#63b1e0"),
    ("#074a7c", "#a5d6f5"),
];

/// Horizontal alignment of a text.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// An SVG file under construction.
pub(super) struct Canvas {
    body: String,
    width: f64,
    clips: usize,
}

impl Canvas {
    pub(super) fn new(options: &FigureOptions) -> Self {
        let width = if options.width_px.is_finite() { options.width_px.clamp(240.0, 4000.0) } else { 960.0 };
        Self { body: String::new(), width, clips: 0 }
    }

    pub(super) const fn width(&self) -> f64 {
        self.width
    }

    /// Writes heading and subtitle; returns the ordinate below them.
    pub(super) fn heading(&mut self, options: &FigureOptions, left: f64) -> f64 {
        let mut y = 14.0;
        if !options.title.is_empty() {
            y += 16.0;
            self.text(left, y, Anchor::Start, "h", &options.title);
        }
        if !options.subtitle.is_empty() {
            y += 19.0;
            self.text(left, y, Anchor::Start, "s", &options.subtitle);
        }
        y + 8.0
    }

    /// An element without content: numeric attributes, then the class.
    fn element(&mut self, name: &str, numbers: &[(&str, f64)], class: &str) {
        let _ = write!(self.body, "<{name}");
        for (attribute, value) in numbers {
            let _ = write!(self.body, " {attribute}=\"{}\"", svg_coordinate(*value));
        }
        let _ = writeln!(self.body, " class=\"{class}\"/>");
    }

    pub(super) fn rect(&mut self, x: f64, y: f64, width: f64, height: f64, class: &str) {
        let size = [("x", x), ("y", y), ("width", width.max(0.0)), ("height", height.max(0.0))];
        self.element("rect", &size, class);
    }

    /// A rectangle with round corners.
    pub(super) fn rounded(&mut self, x: f64, y: f64, width: f64, height: f64, class: &str) {
        let size = [("x", x), ("y", y), ("width", width), ("height", height), ("rx", 12.0)];
        self.element("rect", &size, class);
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), class: &str) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(svg_coordinate);
        let _ = writeln!(self.body, "<path d=\"M{x1} {y1}L{x2} {y2}\" class=\"{class}\"/>");
    }

    pub(super) fn circle(&mut self, x: f64, y: f64, radius: f64, class: &str) {
        self.element("circle", &[("cx", x), ("cy", y), ("r", radius)], class);
    }

    /// A polyline per run of points; coordinates to a tenth of a pixel.
    pub(super) fn path(&mut self, runs: &[Vec<(f64, f64)>], width: f64, class: &str) {
        let mut data = String::new();
        let tenth = |v: f64| {
            let rounded = (v * 10.0).round() / 10.0;
            if rounded == 0.0 { 0.0 } else { rounded }
        };
        for run in runs {
            for (index, (x, y)) in run.iter().enumerate() {
                let pen = if index == 0 { "M" } else { "L" };
                let _ = write!(data, "{pen}{} {}", tenth(*x), tenth(*y));
            }
        }
        if !data.is_empty() {
            let _ = writeln!(
                self.body,
                "<path d=\"{data}\" stroke-width=\"{}\" class=\"{class}\"/>",
                svg_coordinate(width)
            );
        }
    }

    pub(super) fn text(&mut self, x: f64, y: f64, anchor: Anchor, class: &str, words: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (x, y, words) = (svg_coordinate(x), svg_coordinate(y), escaping::escape_html(words));
        let _ = writeln!(self.body, "<text x=\"{x}\" y=\"{y}\"{anchor} class=\"{class}\">{words}</text>");
    }

    /// Text turned a quarter to the left, centred on the point.
    pub(super) fn vertical_text(&mut self, x: f64, y: f64, class: &str, words: &str) {
        let (x, y, words) = (svg_coordinate(x), svg_coordinate(y), escaping::escape_html(words));
        let _ = writeln!(
            self.body,
            "<text transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\" class=\"{class}\">{words}</text>"
        );
    }

    /// Clips everything drawn until [`Self::unclip`] to the rectangle.
    pub(super) fn clip(&mut self, x: f64, y: f64, width: f64, height: f64) {
        self.clips += 1;
        let [x, y, width, height] = [x, y, width, height].map(svg_coordinate);
        let _ = writeln!(
            self.body,
            "<clipPath id=\"c{0}\"><rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/></clipPath>\n<g clip-path=\"url(#c{0})\">",
            self.clips
        );
    }

    pub(super) fn unclip(&mut self) {
        self.body.push_str("</g>\n");
    }

    /// The finished file.
    pub(super) fn finish(self, height: f64, description: &str) -> String {
        let (w, h) = (svg_coordinate(self.width), svg_coordinate(height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             aria-label=\"{}\">\n<style>{}</style>\n<rect width=\"{w}\" height=\"{h}\" class=\"paper\"/>\n{}</svg>\n",
            escaping::escape_html(description),
            style(),
            self.body
        )
    }
}

/// Width of a text of the given size, estimated without font metrics.
pub(super) fn text_width(words: &str, size: f64) -> f64 {
    words
        .chars()
        .map(|c| {
            if "il.,:;|'()·! ".contains(c) {
                0.32
            } else if c.is_uppercase() {
                0.68
            } else {
                0.57
            }
        })
        .sum::<f64>()
        * size
}

fn style() -> String {
    let fixed = format!(
        "text{{font:12px {FONT}}}.h{{font-size:18px;font-weight:650}}.s{{font-size:13px}}.b{{font-weight:600}}.t{{font-size:11.5px}}\
         .l{{fill:none;stroke-linejoin:round}}.dashed{{stroke-dasharray:7 4}}.dotted{{stroke-dasharray:1.5 3.5;stroke-width:2}}\
         .m{{stroke-width:1.5;fill:none}}.area{{fill-opacity:.13;stroke:none}}.halo{{paint-order:stroke;stroke-width:3.5px;stroke-linejoin:round}}\
         .grid{{fill:none;stroke-width:1}}.frame{{fill:none;stroke-width:1}}.p{{stroke-width:1.3}}.rest{{fill-opacity:.35}}.faint{{fill-opacity:.28}}"
    );
    format!("{fixed}{}@media(prefers-color-scheme:dark){{{}}}", colours(false), colours(true))
}

fn colours(dark: bool) -> String {
    let (paper, soft, grid) =
        if dark { ("#12161b", "#a3adb8", "#262d35") } else { ("#ffffff", "#5a636d", "#e9ecef") };
    let ink = if dark { Colour::Ink.dark() } else { Colour::Ink.light() };
    let mut out = format!(
        ".paper{{fill:{paper}}}text{{fill:{ink}}}.s,.t{{fill:{soft}}}.grid{{stroke:{grid}}}.frame{{stroke:{soft}}}\
         .halo{{stroke:{paper}}}.p{{stroke:{paper}}}.on{{fill:#101418}}"
    );
    for (step, (light, deep)) in SHADES.iter().enumerate() {
        let _ = write!(out, ".q{step}{{fill:{}}}", if dark { deep } else { light });
    }
    out.push_str(if dark {
        ".lo{fill:#eef1f4}.hi{fill:#101418}"
    } else {
        ".lo{fill:#1b1f24}.hi{fill:#ffffff}"
    });
    for colour in Colour::ALL {
        let hex = if dark { colour.dark() } else { colour.light() };
        let _ = write!(out, ".l-{0}{{stroke:{hex}}}.f-{0}{{fill:{hex}}}", colour.name());
    }
    out
}
