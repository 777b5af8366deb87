//! A sample as it comes: a CSV line or a JSON object.

use serde::Deserialize;

/// A sample as given; without a velocity it is taken from the positions.
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

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "line {line}: {message}; right is time_s,position_m,force_n[,velocity_mps] or a JSON object with these names"
)]
pub struct InvalidLine {
    /// Number of the line or datagram, from 1.
    pub line: u64,
    /// What is wrong.
    pub message: String,
}

/// Reads a line: `0.001,-0.005,0.02`, with or without a velocity behind, or `{"time_s": ...}`. Empty lines, headers (the
/// first line may hold names) and comments (`#`) give `None`.
///
/// # Errors
/// [`BadLine`].
pub fn parse_line(line: u64, text: &str) -> Result<Option<StreamSample>, InvalidLine> {
    let text = text.trim();
    let bad = |what: String| InvalidLine { line, message: what };
    if text.is_empty() || text.starts_with('#') {
        return Ok(None);
    }
    if text.starts_with('{') {
        return serde_json::from_str(text).map(Some).map_err(|e| bad(e.to_string()));
    }
    if line == 1 && text.starts_with("time") {
        return Ok(None);
    }
    let mut values = [0.0; 4];
    let mut count = 0;
    for field in text.split(',') {
        let Some(place) = values.get_mut(count) else { return Err(bad("more than four fields".to_owned())) };
        *place = field.trim().parse().map_err(|_| bad(format!("`{}` is no number", field.trim())))?;
        count += 1;
    }
    let [time_s, position_m, force_n, velocity_mps] = values;
    match count {
        3 => Ok(Some(StreamSample { time_s, position_m, force_n, velocity_mps: None })),
        4 => Ok(Some(StreamSample { time_s, position_m, force_n, velocity_mps: Some(velocity_mps) })),
        _ => Err(bad(format!("{count} field(s)"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_and_json_say_the_same() {
        let given =
            StreamSample { time_s: 0.5, position_m: -0.005, force_n: 0.02, velocity_mps: Some(0.002) };
        assert_eq!(parse_line(2, "0.5, -0.005, 0.02, 0.002\n"), Ok(Some(given)));
        let json = r#"{"time_s":0.5,"position_m":-0.005,"force_n":0.02,"velocity_mps":0.002}"#;
        assert_eq!(parse_line(1, json), Ok(Some(given)));
        assert_eq!(parse_line(1, "time_s,position_m,force_n"), Ok(None));
        assert_eq!(parse_line(9, "  "), Ok(None));
    }

    #[test]
    fn a_wrong_line_is_named() {
        for (text, said) in
            [("1,2", "2 field(s)"), ("1,x,3", "`x` is no number"), ("1,2,3,4,5", "more than four")]
        {
            let error = parse_line(7, text).expect_err(text).to_string();
            assert!(error.starts_with("line 7: ") && error.contains(said), "{error}");
        }
        assert!(parse_line(3, r#"{"time_s":1}"#).expect_err("incomplete").message.contains("position_m"));
    }
}
