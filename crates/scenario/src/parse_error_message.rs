//! Messages for RON syntax errors that name the field and the remedy.

use crate::input_error::{InputError, closest_name, offset};
use crate::renamed_names::renamed_ron_name;
use crate::ron_outline::RonOutline;
use crate::ron_tokens::{TokenKind, tokenize};
use ron::error::{Error, SpannedError};
use stylet_tissue::{Custom, CustomText};

/// The error with its location and message.
pub(crate) fn explain_parse_error(file: &str, text: &str, error: &SpannedError) -> InputError {
    let outline = RonOutline::new(text);
    let start = offset(text, error.span.start.line, error.span.start.col);
    let end = offset(text, error.span.end.line, error.span.end.col);
    if let Error::Message(_) = &error.code
        && let Some((start, end, what)) = custom_effect_error(text, &outline, start)
    {
        return InputError::at(file, text, start, end, what);
    }
    let place = ErrorLocation { text, outline: &outline, start, end };
    let (start, end, what) = place.explain(&error.code);
    InputError::at(file, text, start, end, what)
}

/// The error of the custom effect that was read last at byte `at`: bytes to underline, and the message.
fn custom_effect_error(text: &str, outline: &RonOutline, at: usize) -> Option<(usize, usize, String)> {
    let before = outline.entries.iter().rev().filter(|e| e.start < at);
    let (entry, body) =
        before.filter_map(|e| Some((e, text.get(e.start..e.end)?.strip_prefix("Custom")?))).next()?;
    let custom: CustomText = crate::ron_dialect::ron_options().from_str(body).ok()?;
    let error = Custom::from_text(&custom).err()?;
    let path =
        if entry.path.is_empty() { error.path.clone() } else { format!("{}.{}", entry.path, error.path) };
    let what = format!("{path}: {}", error.message);
    let Some(field) = outline.locate(&path) else { return Some((entry.start, entry.end, what)) };
    match error.place {
        // Behind the quote that opens the formula.
        Some((start, end)) if text.get(field.start..)?.starts_with('"') => {
            let first = field.start + 1;
            Some(((first + start).min(field.end), (first + end).min(field.end), what))
        }
        _ => Some((field.start, field.end, what)),
    }
}

fn list(names: &[&str]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

fn suggestion(found: &str, expected: &[&str]) -> String {
    let known = list(expected);
    if let Some(renamed) = renamed_ron_name(found, expected) {
        return renamed;
    }
    match closest_name(found, expected) {
        Some(near) => format!("did you mean `{near}`? Known: {known}"),
        None => format!("known: {known}"),
    }
}

/// ` of `Layer``, or nothing; effects are named as in scenarios.
fn within(outer: Option<&String>) -> String {
    match outer.map(String::as_str) {
        None => String::new(),
        Some("AnyEffect") => " among the effects".to_owned(),
        Some(outer) => format!(" of `{outer}`"),
    }
}

struct ErrorLocation<'a> {
    text: &'a str,
    outline: &'a RonOutline,
    start: usize,
    end: usize,
}

impl ErrorLocation<'_> {
    /// Bytes to underline, and the message.
    fn explain(&self, code: &Error) -> (usize, usize, String) {
        let here = |what: String| (self.start, self.end, what);
        if self.outline.entries.is_empty() {
            return here(
                "holds nothing but comments; a RON file begins like `Scenario(name: \"...\", ...)`".into(),
            );
        }
        match code {
            Error::NoSuchStructField { expected, found, outer } => here(format!(
                "unknown field `{found}`{}; {}",
                within(outer.as_ref()),
                suggestion(found, expected)
            )),
            Error::NoSuchEnumVariant { expected, found, outer } => here(format!(
                "unknown name `{found}`{}; {}",
                within(outer.as_ref()),
                suggestion(found, expected)
            )),
            Error::DuplicateStructField { field, outer } => {
                here(format!("field `{field}`{} is given twice; keep one", within(outer.as_ref())))
            }
            Error::MissingStructField { field, outer } => self.missing(field, &within(outer.as_ref())),
            Error::ExpectedDifferentStructName { expected, found } if self.before_colon() => here(format!(
                "`{found}` is a field, where a whole `{expected}` is expected; put brackets around it: \
                 `({found}: ...)`"
            )),
            Error::ExpectedDifferentStructName { expected, found } => here(format!(
                "this is a `{found}`, where a `{expected}` is expected; write `{expected}(...)`"
            )),
            Error::Eof | Error::ExpectedStructLikeEnd | Error::ExpectedArrayEnd if self.at_end() => {
                self.unexpected_end()
            }
            Error::ExpectedStructLike | Error::ExpectedNamedStructLike(_) => self.missing_bracket(),
            Error::ExpectedComma => self.missing_comma(),
            Error::ExpectedFloat => self.wrong("a number, for example `0.5`,"),
            Error::ExpectedBoolean => self.wrong("`true` or `false`"),
            Error::ExpectedString => self.wrong("text in double quotes"),
            Error::ExpectedArray => self.wrong("a list in square brackets, `[...]`,"),
            Error::ExpectedIdentifier => self.wrong("a name without quotes"),
            Error::ExpectedInteger | Error::InvalidIntegerDigit { .. } | Error::IntegerOutOfBounds => {
                self.wrong("a whole number from 0, for example `1`,")
            }
            Error::InvalidIdentifier(found) | Error::SuggestRawIdentifier(found)
                if found.starts_with(|c: char| c.is_ascii_digit()) =>
            {
                here(format!(
                    "a field name is expected, not `{found}`; decimals are written with a point, `0.{found}`"
                ))
            }
            Error::ExpectedMapColon => {
                here("a colon is expected between a field and its value: `field: value`".into())
            }
            Error::UnclosedBlockComment => {
                here("a comment begins with `/*` and never ends; close it with `*/`".into())
            }
            Error::ExpectedStringEnd => {
                here("a string begins and never ends; close it with a double quote".into())
            }
            Error::TrailingCharacters => {
                let (start, end) = self.next_token();
                let what = "text behind the end; the file ends with the bracket that closes the first one";
                (start, end, what.to_owned())
            }
            Error::ExceededRecursionLimit => here("brackets are nested too deeply; remove some".into()),
            other => here(format!("not valid here: {}", decapitalised(&other.to_string()))),
        }
    }

    fn missing(&self, field: &str, within: &str) -> (usize, usize, String) {
        let what = |path: &str| {
            let at = if path.is_empty() { String::new() } else { format!("{path}: ") };
            format!("{at}missing field `{field}`{within}; add `{field}: ...` inside its brackets")
        };
        match self.outline.enclosing_entry(self.start) {
            // From the name or bracket that opens it.
            Some(entry) => {
                let name = self.text[entry.start..entry.end]
                    .find(['(', '['])
                    .map_or(entry.end, |n| entry.start + n + 1);
                (entry.start, name, what(&entry.path))
            }
            None => (self.start, self.end, what("")),
        }
    }

    /// A value of the wrong type.
    fn wrong(&self, expected: &str) -> (usize, usize, String) {
        // The parser may still be at the blank before the value.
        let on = |at: usize| self.outline.enclosing_entry(at).filter(|e| !e.path.is_empty() && e.start <= at);
        match on(self.start).or_else(|| on(self.end)) {
            Some(entry) => {
                let value = self.text[entry.start..entry.end].lines().next().unwrap_or_default();
                let excerpt: String = value.chars().take(40).collect();
                let what = format!("{}: is `{excerpt}`, where {expected} is expected", entry.path);
                (entry.start, entry.start + value.len(), what)
            }
            _ => (self.start, self.end, format!("{expected} is expected here")),
        }
    }

    /// A name without its brackets, or another token where brackets are expected.
    fn missing_bracket(&self) -> (usize, usize, String) {
        let before = self.start.saturating_sub(1);
        let name = tokenize(self.text).into_iter().find(|t| t.start <= before && before < t.end);
        match name {
            Some(token) if token.kind == TokenKind::Word => {
                let name = &self.text[token.start..token.end];
                let what = if name.starts_with(|c: char| c.is_ascii_alphabetic()) {
                    format!(
                        "`{name}` needs brackets behind it, also empty ones for its defaults: `{name}(...)`"
                    )
                } else {
                    format!("brackets with fields are expected, not `{name}`: `(field: value, ...)`")
                };
                (token.start, token.end, what)
            }
            _ => self
                .stray_bracket()
                .unwrap_or_else(|| self.wrong("fields in brackets, `(field: value, ...)`,")),
        }
    }

    /// A closing bracket where a value is expected.
    fn stray_bracket(&self) -> Option<(usize, usize, String)> {
        let (start, end) = self.next_token();
        let found = self.text.get(start..end).filter(|t| matches!(*t, ")" | "]" | "}"))?;
        let path = self.outline.enclosing_entry(self.start).map_or("", |e| e.path.as_str());
        let inside = if path.is_empty() { String::new() } else { format!("{path}: ") };
        let what = format!(
            "{inside}`{found}` closes another bracket than the one that is open; close that one first"
        );
        Some((start, end, what))
    }

    fn missing_comma(&self) -> (usize, usize, String) {
        if self.at_end() {
            return self.unexpected_end();
        }
        let rest = &self.text[self.start.min(self.text.len())..];
        if rest.starts_with('.') {
            return self.wrong("a whole number from 0, for example `1`,");
        }
        let string = tokenize(self.text)
            .into_iter()
            .rfind(|t| t.end <= self.start)
            .filter(|t| t.kind == TokenKind::Text);
        if let Some(string) = string
            && self.text[string.start..string.end].contains('\n')
        {
            let what = "this string runs over several lines; is its closing double quote missing?";
            return (string.start, string.start + 1, what.to_owned());
        }
        let (start, end) = self.next_token();
        let what = format!("a comma or a closing bracket is expected before `{}`", &self.text[start..end]);
        (start, end, what)
    }

    /// Bytes of the first token from here on.
    fn next_token(&self) -> (usize, usize) {
        let token = self.text.get(self.start..).and_then(|rest| tokenize(rest).first().copied());
        token.map_or((self.start, self.end), |t| (self.start + t.start, self.start + t.end))
    }

    /// The text ends too early.
    fn unexpected_end(&self) -> (usize, usize, String) {
        match self.outline.open_brackets.last() {
            Some(open) => {
                let close = if self.text[*open..].starts_with('[') { ']' } else { ')' };
                let many = self.outline.open_brackets.len();
                let what = format!(
                    "the file ends inside {many} open bracket{}; this one is never closed: close it with `{close}`",
                    if many == 1 { "" } else { "s" }
                );
                (*open, open + 1, what)
            }
            None => (self.start, self.end, "the file ends too early".to_owned()),
        }
    }

    fn at_end(&self) -> bool {
        self.text.get(self.start..).is_none_or(|rest| tokenize(rest).is_empty())
    }

    fn before_colon(&self) -> bool {
        self.text.get(self.end..).is_some_and(|rest| rest.trim_start().starts_with(':'))
    }
}

fn decapitalised(message: &str) -> String {
    let mut chars = message.chars();
    chars.next().map_or(String::new(), |first| first.to_lowercase().chain(chars).collect())
}
