//! Separators of columns.

/// Separator of the columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// A character.
    Byte(u8),
    /// One or more blanks or tabs.
    Blanks,
}

impl Delimiter {
    /// Name for people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Byte(b',') => "comma",
            Self::Byte(b';') => "semicolon",
            Self::Byte(b'\t') => "tab",
            Self::Byte(b'|') => "|",
            Self::Byte(_) => "character",
            Self::Blanks => "blanks",
        }
    }
}

/// Delimiters in the order of preference: a comma may be a decimal sign, and blanks occur inside fields.
pub(crate) const DELIMITERS: [Delimiter; 5] = [
    Delimiter::Byte(b';'),
    Delimiter::Byte(b'\t'),
    Delimiter::Byte(b'|'),
    Delimiter::Byte(b','),
    Delimiter::Blanks,
];

/// The fields of a line without surrounding blanks and quotation marks.
pub(crate) fn split(line: &str, delimiter: Delimiter) -> Vec<String> {
    let (mut out, mut field, mut quoted, mut any) = (Vec::new(), String::new(), false, false);
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        let separates = !quoted
            && match delimiter {
                Delimiter::Byte(byte) => c == char::from(byte),
                Delimiter::Blanks => c == ' ' || c == '\t',
            };
        if separates {
            if delimiter != Delimiter::Blanks || any {
                out.push(field.trim().to_owned());
            }
            field.clear();
            any = false;
        } else if c == '"' && (quoted || field.trim().is_empty()) {
            if quoted && chars.peek() == Some(&'"') {
                field.push('"');
                chars.next();
            } else {
                quoted = !quoted;
            }
            any = true;
        } else {
            field.push(c);
            any = true;
        }
    }
    if delimiter != Delimiter::Blanks || any {
        out.push(field.trim().to_owned());
    }
    out
}
