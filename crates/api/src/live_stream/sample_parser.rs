//! Parser of stream samples: a CSV line or a JSON object.

use super::line_splitter::MAX_LINE_BYTES;
use serde::Deserialize;

/// A received sample; a missing velocity is derived from the positions.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct StreamSample {
    /// Time in s.
    pub time_s: f64,
    /// Tip position in m.
    pub position_m: f64,
    /// Axial force in N.
    pub force_n: f64,
    /// Tip velocity in m/s.
    #[serde(default)]
    pub velocity_mps: Option<f64>,
}

/// A line that is not a sample.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "line {line}: {message}; expected time_s,position_m,force_n[,velocity_mps] or a JSON object with these names"
)]
pub struct InvalidLine {
    /// Number of the line or datagram, from 1.
    pub line: u64,
    /// Reason.
    pub message: String,
}

impl InvalidLine {
    /// Shortens the message and escapes its control characters: it may quote the line, and goes to a terminal.
    fn new(line: u64, message: &str) -> Self {
        /// Longest message in characters.
        const LONGEST: usize = 200;
        let mut shown: String = message.chars().take(LONGEST).flat_map(escape).collect();
        if message.chars().nth(LONGEST).is_some() {
            shown.push_str("...");
        }
        Self { line, message: shown }
    }
}

/// A character as it is, or escaped when it may act on a terminal or is invisible.
fn escape(c: char) -> impl Iterator<Item = char> {
    let plain = matches!(c, '"' | '\'' | '\\');
    std::iter::once(c).filter(move |_| plain).chain(c.escape_debug().filter(move |_| !plain))
}

/// A field as quoted in a message.
fn excerpt(field: &str) -> String {
    /// Longest quotation in characters.
    const LONGEST: usize = 40;
    let shown: String = field.chars().take(LONGEST).collect();
    if shown.len() < field.len() { format!("`{shown}...`") } else { format!("`{shown}`") }
}

/// As [`parse_line`] for bytes as received.
///
/// # Errors
/// [`InvalidLine`], also for lines that are too long or not UTF-8.
pub fn parse_bytes(line: u64, bytes: &[u8]) -> Result<Option<StreamSample>, InvalidLine> {
    if bytes.len() > MAX_LINE_BYTES {
        return Err(InvalidLine::new(line, &format!("longer than {MAX_LINE_BYTES} bytes")));
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => parse_line(line, text),
        Err(why) => Err(InvalidLine::new(line, &format!("byte {} is not UTF-8", why.valid_up_to() + 1))),
    }
}

/// Parses `0.001,-0.005,0.02`, optionally with a velocity, or `{"time_s": ...}`, whose further fields are ignored. Empty
/// lines, comments (`#`) and a header (a line that begins with `time`) give `None`.
///
/// # Errors
/// [`InvalidLine`].
pub fn parse_line(line: u64, text: &str) -> Result<Option<StreamSample>, InvalidLine> {
    let text = text.trim_start_matches('\u{feff}').trim();
    let invalid = |message: String| InvalidLine::new(line, &message);
    if text.is_empty() || text.starts_with('#') {
        return Ok(None);
    }
    if text.starts_with('{') {
        return serde_json::from_str(text).map(Some).map_err(|e| invalid(e.to_string()));
    }
    if text.starts_with("time") {
        return Ok(None);
    }
    let mut values = [0.0; 4];
    let mut count = 0;
    for field in text.split(',') {
        let Some(place) = values.get_mut(count) else {
            return Err(invalid("more than four fields".to_owned()));
        };
        *place =
            field.trim().parse().map_err(|_| invalid(format!("{} is no number", excerpt(field.trim()))))?;
        count += 1;
    }
    let [time_s, position_m, force_n, velocity_mps] = values;
    let velocity_mps = match count {
        3 => None,
        4 => Some(velocity_mps),
        _ => return Err(invalid(format!("{count} field(s)"))),
    };
    Ok(Some(StreamSample { time_s, position_m, force_n, velocity_mps }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_and_json_give_the_same_sample() {
        let sample =
            StreamSample { time_s: 0.5, position_m: -0.005, force_n: 0.02, velocity_mps: Some(0.002) };
        assert_eq!(parse_line(2, "0.5, -0.005, 0.02, 0.002\n"), Ok(Some(sample)));
        let json = r#"{"time_s":0.5,"position_m":-0.005,"force_n":0.02,"velocity_mps":0.002}"#;
        assert_eq!(parse_line(1, json), Ok(Some(sample)));
        let more = r#"{"seq":7,"time_s":0.5,"position_m":-0.005,"pose":{"x":[1,2]},"force_n":0.02,"velocity_mps":0.002}"#;
        assert_eq!(parse_line(1, more), Ok(Some(sample)), "further fields");
        let null = r#"{"time_s":0.5,"position_m":-0.005,"force_n":0.02,"velocity_mps":null}"#;
        assert_eq!(parse_line(1, null), Ok(Some(StreamSample { velocity_mps: None, ..sample })));
        for header in ["time_s,position_m,force_n", "\u{feff}time_s,position_m,force_n"] {
            // Also in the middle: a controller that starts again sends it again.
            assert_eq!((parse_line(1, header), parse_line(70, header)), (Ok(None), Ok(None)));
        }
        assert_eq!(parse_line(9, "  "), Ok(None));
    }

    #[test]
    fn an_invalid_line_is_reported_by_number() {
        for (text, reason) in
            [("1,2", "2 field(s)"), ("1,x,3", "`x` is no number"), ("1,2,3,4,5", "more than four")]
        {
            let error = parse_line(7, text).expect_err(text).to_string();
            assert!(error.starts_with("line 7: ") && error.contains(reason), "{error}");
        }
        let error = parse_line(3, r#"{"time_s":1}"#).expect_err("incomplete");
        assert!(error.message.contains("position_m"));
    }

    #[test]
    fn a_message_is_short_and_has_no_control_characters() {
        let escapes = "\u{1b}[2J\u{7}\u{202e}\r\0".repeat(10);
        let long = "x".repeat(1_000_000);
        let json =
            format!("{{\"time_s\":\"{escapes}{long}\"}}").replace(['\0', '\r', '\u{1b}', '\u{7}'], "?");
        for text in
            [format!("1,{escapes},3"), format!("1,{long},3"), json, escapes.clone(), format!("{{\"{long}")]
        {
            let error = parse_line(1, &text).expect_err("no sample").to_string();
            assert!(error.chars().count() < 1500, "{} characters", error.len());
            assert!(!error.chars().any(|c| c.is_control() || c == '\u{202e}'), "{error}");
        }
    }

    #[test]
    fn bytes_that_are_not_utf8_or_too_many_are_an_invalid_line() {
        let error = parse_bytes(4, b"1,2,\xff").expect_err("not text");
        assert_eq!((error.line, error.message.as_str()), (4, "byte 5 is not UTF-8"));
        assert!(parse_bytes(4, &[b'1'; MAX_LINE_BYTES + 1]).is_err());
        assert!(matches!(parse_bytes(4, b"1,2,3"), Ok(Some(_))));
    }
}
