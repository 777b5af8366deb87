//! Maps field paths to locations in RON text and back, for error messages.
//!
//! RON's parser reports locations of syntax errors only, and no paths. The outline parses names, brackets, commas, strings and comments. It accepts
//! any text, also invalid RON.

use crate::ron_tokens::{Token, TokenKind, tokenize};

/// Values nested deeper than this have no path; the limit of RON is 128.
const MAX_DEPTH: usize = 64;

/// One value of the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OutlineEntry {
    /// Path such as `tissue.layers[1].thickness_m`; empty for the whole.
    pub(crate) path: String,
    /// Start of the field name, or of the value when it has none.
    pub(crate) from: usize,
    /// The value's first byte.
    pub(crate) start: usize,
    /// End of the value.
    pub(crate) end: usize,
}

/// The values of a text in the order of their start.
#[derive(Clone, Debug, Default)]
pub(crate) struct RonOutline {
    pub(crate) entries: Vec<OutlineEntry>,
    /// Brackets that are never closed, outermost first.
    pub(crate) open_brackets: Vec<usize>,
}

/// A bracket that is being read.
struct Frame {
    path: String,
    /// Place of the bracket; none for the whole text.
    bracket: Option<usize>,
    /// A name precedes the round bracket: `Some(...)`, `Known(...)`.
    named: bool,
    index: usize,
    label: Option<(usize, usize)>,
    entry: Option<usize>,
}

impl Frame {
    fn new(path: String, bracket: Option<usize>, named: bool) -> Self {
        Self { path, bracket, named, index: 0, label: None, entry: None }
    }

    /// Path of the value that starts here.
    fn child(&self, text: &str) -> String {
        match self.label {
            Some((start, end)) => {
                let name = &text[start..end];
                if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
            }
            // The content of `Some(...)` and of a variant with one value has the same path.
            None if self.bracket.is_none() || (self.named && self.index == 0) => self.path.clone(),
            None => format!("{}[{}]", self.path, self.index),
        }
    }
}

impl RonOutline {
    pub(crate) fn new(text: &str) -> Self {
        let tokens = tokenize(text);
        let mut outline = Self::default();
        let mut frames = vec![Frame::new(String::new(), None, false)];
        let mut named = false;
        for (i, token) in tokens.iter().enumerate() {
            let depth = frames.len();
            let Some(frame) = frames.last_mut() else { break };
            match token.kind {
                TokenKind::Word if tokens.get(i + 1).is_some_and(|next| next.kind == TokenKind::Colon) => {
                    frame.label = Some((token.start, token.end));
                    frame.entry = None;
                }
                TokenKind::Word | TokenKind::Text | TokenKind::Other => {
                    outline.extend(text, frame, depth, token)
                }
                TokenKind::Open(bracket) => {
                    outline.extend(text, frame, depth, token);
                    let path = frame.entry.and_then(|e| outline.entries.get(e)).map(|e| e.path.clone());
                    let named = named && bracket == b'(';
                    frames.push(Frame::new(path.unwrap_or_default(), Some(token.start), named));
                }
                TokenKind::Close => {
                    if frames.len() > 1 {
                        frames.pop();
                    }
                    if let Some(frame) = frames.last_mut() {
                        outline.extend(text, frame, depth, token);
                    }
                }
                TokenKind::Comma => {
                    (frame.index, frame.label, frame.entry) = (frame.index + 1, None, None);
                }
                TokenKind::Colon => {}
            }
            named = token.kind == TokenKind::Word;
        }
        for frame in &frames {
            outline.open_brackets.extend(frame.bracket);
        }
        frames.pop();
        for entry in frames.iter().filter_map(|frame| frame.entry) {
            if let Some(entry) = outline.entries.get_mut(entry) {
                entry.end = text.len();
            }
        }
        outline
    }

    /// Starts a value with this token, or adds it to the present value.
    fn extend(&mut self, text: &str, frame: &mut Frame, depth: usize, token: &Token) {
        if let Some(entry) = frame.entry.and_then(|e| self.entries.get_mut(e)) {
            entry.end = token.end;
        } else if depth <= MAX_DEPTH && token.kind != TokenKind::Close {
            frame.entry = Some(self.entries.len());
            self.entries.push(OutlineEntry {
                path: frame.child(text),
                from: frame.label.map_or(token.start, |(start, _)| start),
                start: token.start,
                end: token.end,
            });
        }
    }

    /// The value at a path, `Some(...)` included; `None` when the text does not contain it.
    pub(crate) fn locate(&self, path: &str) -> Option<&OutlineEntry> {
        self.entries.iter().find(|entry| entry.path == path)
    }

    /// The innermost value around a place, its field name included.
    pub(crate) fn enclosing_entry(&self, offset: usize) -> Option<&OutlineEntry> {
        self.entries.iter().rfind(|entry| entry.from <= offset && offset < entry.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = r##"#![enable(implicit_some)]
// a comment with tissue: (layers: [
Scenario(
    name: "a ) tricky \" name: (", /* nested /* tissue */ comment */
    raw: r#"tissue: "("#,
    tissue: (
        surface_m: 0.0,
        layers: [
            (name: "first", thickness_m: 0.01),
            (thickness_m: -2.5e-3, puncture_n: Some(2.2)), // second
        ],
    ),
    motion: Constant(start_m: -0.005, velocity_mps: 0.0023),
    maybe: Some((inner: 7)),
    depths: Known([0.1, 0.2]),
    limits: (0.01, 0.99),
)
"##;

    fn text_at(path: &str) -> Option<&'static str> {
        RonOutline::new(TEXT).locate(path).map(|e| &TEXT[e.start..e.end])
    }

    #[test]
    fn a_path_leads_to_its_value_past_comments_and_strings() {
        assert_eq!(text_at("tissue.layers[0].thickness_m"), Some("0.01"));
        assert_eq!(text_at("tissue.layers[1].thickness_m"), Some("-2.5e-3"));
        assert_eq!(text_at("tissue.layers[1].puncture_n"), Some("Some(2.2)"));
        assert_eq!(text_at("motion.velocity_mps"), Some("0.0023"));
        assert_eq!(text_at("motion"), Some("Constant(start_m: -0.005, velocity_mps: 0.0023)"));
        assert_eq!(text_at("maybe.inner"), Some("7"));
        assert_eq!(text_at("depths[1]"), Some("0.2"));
        assert_eq!(text_at("limits[1]"), Some("0.99"));
    }

    #[test]
    fn a_place_leads_to_the_field_around_it() {
        let outline = RonOutline::new(TEXT);
        for (at, path) in
            [("-2.5e-3", "tissue.layers[1].thickness_m"), ("velocity_mps", "motion.velocity_mps")]
        {
            let offset = TEXT.find(at).map(|o| outline.enclosing_entry(o + 1).map(|e| e.path.as_str()));
            assert_eq!(offset, Some(Some(path)));
        }
    }

    #[test]
    fn a_defaulted_field_has_no_place() {
        assert_eq!(text_at("sample_hz"), None);
        assert_eq!(text_at("tissue.layers[7].thickness_m"), None);
        assert_eq!(text_at("motion.duration_s"), None);
    }

    #[test]
    fn an_unclosed_bracket_is_known() {
        let outline = RonOutline::new("Scenario(tissue: (layers: [], motion: 1");
        assert_eq!(outline.open_brackets, [8, 17]);
    }

    #[test]
    fn deep_nesting_costs_neither_stack_nor_memory() {
        let outline = RonOutline::new(&"(".repeat(200_000));
        assert_eq!(outline.open_brackets.len(), 200_000);
        assert!(outline.entries.len() <= MAX_DEPTH);
    }

    proptest! {
        #[test]
        fn any_text_has_an_outline_within_it(text in "[(){}\\[\\]:,\"\\\\/*#r a-c.0é\n]{0,80}") {
            for entry in RonOutline::new(&text).entries {
                prop_assert!(text.get(entry.from..entry.end).is_some());
                prop_assert!(entry.from <= entry.start && entry.start <= entry.end);
            }
        }
    }
}
