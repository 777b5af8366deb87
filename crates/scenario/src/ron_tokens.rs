//! The words, strings, brackets and separators of a RON text; white space and comments are skipped.

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// A name or a number.
    Word,
    /// A string, raw or not, possibly unterminated.
    Text,
    /// An opening bracket.
    Open(u8),
    /// A closing bracket.
    Close,
    /// `:`
    Colon,
    /// `,`
    Comma,
    /// Anything else.
    Other,
}

/// A token and its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

/// The tokens of a text. Attributes (`#![enable(...)]`) count as comments.
pub(crate) fn tokenize(text: &str) -> Vec<Token> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(&first) = bytes.get(at) {
        let start = at;
        let rest = &bytes[at..];
        let (kind, length) = if first.is_ascii_whitespace() {
            (None, 1)
        } else if rest.starts_with(b"//") {
            (None, until(rest, b"\n"))
        } else if rest.starts_with(b"/*") {
            (None, block_comment(rest))
        } else if rest.starts_with(b"#!") {
            (None, until(rest, b"]") + 1)
        } else if let Some(length) = string(rest) {
            (Some(TokenKind::Text), length)
        } else if is_word(first) {
            (Some(TokenKind::Word), rest.iter().take_while(|c| is_word(**c)).count())
        } else {
            let kind = match first {
                b'(' | b'[' | b'{' => TokenKind::Open(first),
                b')' | b']' | b'}' => TokenKind::Close,
                b':' => TokenKind::Colon,
                b',' => TokenKind::Comma,
                _ => TokenKind::Other,
            };
            (Some(kind), 1)
        };
        at = (at + length).min(bytes.len());
        if let Some(kind) = kind {
            tokens.push(Token { kind, start, end: at });
        }
    }
    tokens
}

/// Letters of any script, digits, and what numbers are made of.
fn is_word(c: u8) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, b'_' | b'.' | b'+' | b'-') || c >= 0x80
}

/// Bytes before `end`, or all.
fn until(bytes: &[u8], end: &[u8]) -> usize {
    bytes.windows(end.len()).position(|w| w == end).unwrap_or(bytes.len())
}

/// Length of a block comment; they nest.
fn block_comment(bytes: &[u8]) -> usize {
    let (mut at, mut depth) = (0, 0usize);
    while at < bytes.len() {
        if bytes[at..].starts_with(b"/*") {
            depth += 1;
            at += 2;
        } else if bytes[at..].starts_with(b"*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += 1;
        }
    }
    at
}

/// Length of a string, if one begins here.
fn string(bytes: &[u8]) -> Option<usize> {
    if bytes.first() == Some(&b'"') {
        let mut at = 1;
        while let Some(c) = bytes.get(at) {
            at += if *c == b'\\' { 2 } else { 1 };
            if *c == b'"' {
                break;
            }
        }
        return Some(at);
    }
    let raw = bytes.strip_prefix(b"r")?;
    let hashes = raw.iter().take_while(|c| **c == b'#').count();
    let content = raw.get(hashes..)?.strip_prefix(b"\"")?;
    let mut end = vec![b'"'];
    end.resize(hashes + 1, b'#');
    Some(2 + hashes + until(content, &end) + end.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        tokenize(text).iter().map(|t| &text[t.start..t.end]).collect()
    }

    #[test]
    fn strings_and_comments_hide_what_is_in_them() {
        assert_eq!(
            words(r##"a: "x \" ) //" /* , /* ( */ ] */ r#"y ")"#, // z"##),
            ["a", ":", r#""x \" ) //""#, r##"r#"y ")"#"##, ","]
        );
    }

    #[test]
    fn an_unterminated_string_or_comment_ends_with_the_text() {
        assert_eq!(words("a \"bc\\"), ["a", "\"bc\\"]);
        assert_eq!(words("a r##\"b\"#"), ["a", "r##\"b\"#"]);
        assert_eq!(words("a /* b /* c */"), ["a"]);
    }
}
