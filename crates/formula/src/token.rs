//! Tokens of a formula.

use crate::formula_error::FormulaError;
use alloc::format;
use alloc::vec::Vec;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TokenKind<'a> {
    Number(f64),
    Name(&'a str),
    /// One of `+-*/^(),<>`.
    Symbol(u8),
}

/// A token with its place in the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Token<'a> {
    pub place: (usize, usize),
    pub kind: TokenKind<'a>,
}

/// The tokens of a text.
pub(crate) fn tokenize(text: &str) -> Result<Vec<Token<'_>>, FormulaError> {
    let bytes = text.as_bytes();
    let mut out = Vec::new();
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let start = at;
        let run = |from: usize, allowed: fn(&u8) -> bool| {
            from + bytes.iter().skip(from).take_while(|b| allowed(b)).count()
        };
        let kind = match byte {
            b' ' | b'\t' | b'\n' | b'\r' => {
                at += 1;
                continue;
            }
            b'+' | b'-' | b'*' | b'/' | b'^' | b'(' | b')' | b',' | b'<' | b'>' => {
                at += 1;
                TokenKind::Symbol(byte)
            }
            b'0'..=b'9' | b'.' => {
                at = run(at, |b| b.is_ascii_digit() || *b == b'.');
                if matches!(bytes.get(at), Some(b'e' | b'E')) {
                    let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
                    let digits = run(at + 1 + sign, u8::is_ascii_digit);
                    at = if digits > at + 1 + sign { digits } else { at };
                }
                let number = text.get(start..at).unwrap_or_default();
                match number.parse::<f64>() {
                    Ok(x) if x.is_finite() => TokenKind::Number(x),
                    _ => return Err(FormulaError::new((start, at), format!("`{number}` is no number"))),
                }
            }
            b'a'..=b'z' | b'A'..=b'Z' | b'_' => {
                at = run(at, |b| b.is_ascii_alphanumeric() || *b == b'_');
                TokenKind::Name(text.get(start..at).unwrap_or_default())
            }
            _ => {
                let symbol = text.get(start..).and_then(|rest| rest.chars().next()).unwrap_or('?');
                let place = (start, start + symbol.len_utf8());
                return Err(FormulaError::new(place, format!("`{symbol}` has no meaning in a formula")));
            }
        };
        out.push(Token { place: (start, at), kind });
    }
    Ok(out)
}
