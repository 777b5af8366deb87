//! From the path of a field to its place in the RON text, so that a number out of range can be
//! underlined.
//!
//! RON's parser gives places for syntax errors only. This walker knows just enough of the grammar to
//! follow a path: names, brackets, commas, strings and comments.

/// Finds the value at a path such as `tissue.layers[1].thickness_m`; `None` when the text does not
/// hold it (a default) or cannot be followed.
pub(crate) fn locate(text: &str, path: &str) -> Option<(usize, usize)> {
    let mut walker = Walker { bytes: text.as_bytes(), at: 0 };
    walker.skip_attributes();
    for step in steps(path) {
        walker.enter(&step)?;
    }
    walker.blank();
    let start = walker.at;
    walker.value()?;
    Some((start, walker.at))
}

enum Step {
    Field(String),
    Index(usize),
}

fn steps(path: &str) -> Vec<Step> {
    path.split(['.', '['])
        .filter(|part| !part.is_empty())
        .map(|part| match part.strip_suffix(']').and_then(|n| n.parse().ok()) {
            Some(index) => Step::Index(index),
            None => Step::Field(part.to_owned()),
        })
        .collect()
}

struct Walker<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Walker<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn starts(&self, with: &str) -> bool {
        self.bytes[self.at..].starts_with(with.as_bytes())
    }

    /// Skips white space and comments.
    fn blank(&mut self) {
        loop {
            if self.peek().is_some_and(|c| c.is_ascii_whitespace()) {
                self.at += 1;
            } else if self.starts("//") {
                while self.peek().is_some_and(|c| c != b'\n') {
                    self.at += 1;
                }
            } else if self.starts("/*") {
                let mut depth = 0;
                while self.at < self.bytes.len() {
                    if self.starts("/*") {
                        depth += 1;
                        self.at += 2;
                    } else if self.starts("*/") {
                        depth -= 1;
                        self.at += 2;
                        if depth == 0 {
                            break;
                        }
                    } else {
                        self.at += 1;
                    }
                }
            } else {
                return;
            }
        }
    }

    /// Skips `#![enable(...)]` lines.
    fn skip_attributes(&mut self) {
        loop {
            self.blank();
            if !self.starts("#!") {
                return;
            }
            while self.peek().is_some_and(|c| c != b']') {
                self.at += 1;
            }
            self.at += 1;
        }
    }

    fn word(&mut self) -> &str {
        let start = self.at;
        while self.peek().is_some_and(|c| c.is_ascii_alphanumeric() || matches!(c, b'_' | b'.' | b'+' | b'-'))
        {
            self.at += 1;
        }
        core::str::from_utf8(&self.bytes[start..self.at]).unwrap_or("")
    }

    /// Skips a string, escaped or raw, if there is one.
    fn string(&mut self) -> bool {
        let start = self.at;
        if self.peek() == Some(b'r') {
            let mut at = self.at + 1;
            while self.bytes.get(at) == Some(&b'#') {
                at += 1;
            }
            let hashes = at - self.at - 1;
            if self.bytes.get(at) == Some(&b'"') {
                let end: Vec<u8> = core::iter::once(b'"').chain(core::iter::repeat_n(b'#', hashes)).collect();
                self.at = at + 1;
                while self.at < self.bytes.len() && !self.bytes[self.at..].starts_with(&end) {
                    self.at += 1;
                }
                self.at = (self.at + end.len()).min(self.bytes.len());
                return true;
            }
        }
        if self.peek() == Some(b'"') {
            self.at += 1;
            while let Some(c) = self.peek() {
                self.at += if c == b'\\' { 2 } else { 1 };
                if c == b'"' {
                    return true;
                }
            }
        }
        self.at = start;
        false
    }

    /// Skips one value: scalar, string, or a name with brackets behind it.
    fn value(&mut self) -> Option<()> {
        self.blank();
        if self.string() {
            return Some(());
        }
        let named = !self.word().is_empty();
        let end_of_word = self.at;
        self.blank();
        match self.peek() {
            Some(b'(' | b'[' | b'{') => self.bracket(),
            _ if named => {
                self.at = end_of_word;
                Some(())
            }
            _ => None,
        }
    }

    /// Skips from an opening bracket to its closing one.
    fn bracket(&mut self) -> Option<()> {
        let mut depth = 0usize;
        loop {
            self.blank();
            if self.string() {
                continue;
            }
            match self.peek()? {
                b'(' | b'[' | b'{' => depth += 1,
                b')' | b']' | b'}' => depth -= 1,
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return Some(());
            }
        }
    }

    /// Moves to the beginning of a field's or an element's value.
    fn enter(&mut self, step: &Step) -> Option<()> {
        self.blank();
        let name = self.word().to_owned();
        self.blank();
        if !matches!(self.peek()?, b'(' | b'[') {
            return None;
        }
        self.at += 1;
        if name == "Some" {
            return self.enter(step);
        }
        let mut index = 0;
        loop {
            self.blank();
            if matches!(self.peek()?, b')' | b']') {
                return None;
            }
            match step {
                Step::Index(wanted) if index == *wanted => return Some(()),
                Step::Index(_) => {}
                Step::Field(wanted) => {
                    let found = self.word() == wanted;
                    self.blank();
                    if self.peek()? != b':' {
                        return None;
                    }
                    self.at += 1;
                    if found {
                        return Some(());
                    }
                }
            }
            self.value()?;
            self.blank();
            if self.peek()? == b',' {
                self.at += 1;
            }
            index += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
)
"##;

    fn text_at(path: &str) -> Option<&'static str> {
        locate(TEXT, path).map(|(start, end)| &TEXT[start..end])
    }

    #[test]
    fn a_path_leads_to_its_value_past_comments_and_strings() {
        assert_eq!(text_at("tissue.layers[0].thickness_m"), Some("0.01"));
        assert_eq!(text_at("tissue.layers[1].thickness_m"), Some("-2.5e-3"));
        assert_eq!(text_at("tissue.layers[1].puncture_n"), Some("Some(2.2)"));
        assert_eq!(text_at("motion.velocity_mps"), Some("0.0023"));
        assert_eq!(text_at("motion"), Some("Constant(start_m: -0.005, velocity_mps: 0.0023)"));
        assert_eq!(text_at("maybe.inner"), Some("7"));
    }

    #[test]
    fn a_defaulted_field_has_no_place() {
        assert_eq!(text_at("sample_hz"), None);
        assert_eq!(text_at("tissue.layers[7].thickness_m"), None);
        assert_eq!(text_at("motion.duration_s"), None);
    }
}
