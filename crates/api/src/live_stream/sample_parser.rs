//! Parser of stream samples: a CSV line or a JSON object.

use serde::Deserialize;

/// A received sample; a missing velocity is derived from the positions.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
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

/// A line that is no sample.
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

/// Parses `0.001,-0.005,0.02`, optionally with a velocity, or `{"time_s": ...}`. Empty lines, comments (`#`) and a header in
/// the first line give `None`.
///
/// # Errors
/// [`InvalidLine`].
pub fn parse_line(line: u64, text: &str) -> Result<Option<StreamSample>, InvalidLine> {
    let text = text.trim();
    let invalid = |message: String| InvalidLine { line, message };
    if text.is_empty() || text.starts_with('#') {
        return Ok(None);
    }
    if text.starts_with('{') {
        return serde_json::from_str(text).map(Some).map_err(|e| invalid(e.to_string()));
    }
    if line == 1 && text.starts_with("time") {
        return Ok(None);
    }
    let mut values = [0.0; 4];
    let mut count = 0;
    for field in text.split(',') {
        let Some(place) = values.get_mut(count) else {
            return Err(invalid("more than four fields".to_owned()));
        };
        *place = field.trim().parse().map_err(|_| invalid(format!("`{}` is no number", field.trim())))?;
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
        assert_eq!(parse_line(1, "time_s,position_m,force_n"), Ok(None));
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
}
