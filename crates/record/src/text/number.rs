//! Numbers and dates as text: decimal comma, thousands, missing values, ISO dates.

/// Content of a table's field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FieldKind {
    /// A number; how its separators can be read.
    Number(Separators),
    /// A date or a time of day.
    Date,
    /// No value: empty, `nan`, `NA`, `null`, `-`, an error of a spreadsheet, an overload of a meter.
    Missing,
    /// Anything else.
    Text,
}

/// Readings of the separators of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Separators {
    /// No separator.
    None,
    /// Only a decimal point is possible.
    Point,
    /// Only a decimal comma is possible.
    Comma,
    /// `1,234`: a decimal comma or thousands.
    PointOrComma,
}

/// Whether a field has no value. Infinite values count as missing: no sensor gives them.
pub(crate) fn is_missing(text: &str) -> bool {
    const WORDS: [&str; 22] = [
        "nan",
        "na",
        "n/a",
        "null",
        "none",
        "-",
        "--",
        "inf",
        "-inf",
        "+inf",
        "infinity",
        "-infinity",
        "+infinity",
        "#n/a",
        "#nv",
        "#num!",
        "#div/0!",
        "#value!",
        "ol",
        "ovl",
        "---",
        "-nan",
    ];
    text.is_empty() || (text.len() <= 9 && WORDS.iter().any(|word| text.eq_ignore_ascii_case(word)))
}

/// Classifies a field.
pub(crate) fn classify(field: &str) -> FieldKind {
    let text = field.trim();
    if is_missing(text) {
        return FieldKind::Missing;
    }
    if let Some(separators) = separators(text) {
        return FieldKind::Number(separators);
    }
    if parse_date_ns(text).is_some() { FieldKind::Date } else { FieldKind::Text }
}

/// The possible readings of a number, if it is one.
fn separators(text: &str) -> Option<Separators> {
    let body = text.strip_prefix(['+', '-', '\u{2212}']).unwrap_or(text);
    let (mantissa, exponent) = match body.find(['e', 'E']) {
        Some(at) => (&body[..at], Some(&body[at + 1..])),
        None => (body, None),
    };
    if let Some(exponent) = exponent {
        let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        if digits.is_empty() || digits.len() > 4 || !digits.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
    }
    let mut digits = 0;
    for c in mantissa.chars() {
        match c {
            '0'..='9' => digits += 1,
            '.' | ',' | ' ' | '\u{a0}' | '\u{202f}' | '\'' => {}
            _ => return None,
        }
    }
    if digits == 0 {
        return None;
    }
    let as_point = clean(mantissa, false).is_some();
    let as_comma = clean(mantissa, true).is_some();
    match (as_point, as_comma) {
        _ if mantissa.bytes().all(|b| b.is_ascii_digit()) => Some(Separators::None),
        // `1.234` with thousands is rarer than with a decimal point; `1,234` is open.
        (true, true) if mantissa.contains(',') => Some(Separators::PointOrComma),
        (true, _) => Some(Separators::Point),
        (false, true) => Some(Separators::Comma),
        (false, false) => None,
    }
}

/// The mantissa with a decimal point and without thousands; `None` when its separators do not fit.
fn clean(mantissa: &str, comma: bool) -> Option<String> {
    let (decimal, group) = if comma { (',', '.') } else { ('.', ',') };
    let (whole, fraction) = match mantissa.rfind(decimal) {
        Some(at) => (&mantissa[..at], &mantissa[at + 1..]),
        None => (mantissa, ""),
    };
    if !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let mut groups = whole.split([group, ' ', '\u{a0}', '\u{202f}', '\'']);
    let first = groups.next().unwrap_or_default();
    if !first.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let mut text = first.to_owned();
    for group in groups {
        // A group of thousands has three digits, and a number with groups does not begin with zero.
        if group.len() != 3 || !group.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        if !(1..=3).contains(&first.len()) || first.starts_with('0') {
            return None;
        }
        text.push_str(group);
    }
    text.push('.');
    text.push_str(fraction);
    text.bytes().any(|b| b.is_ascii_digit()).then_some(text)
}

/// The number that a field holds.
#[inline]
pub(crate) fn parse_number(field: &str, comma: bool) -> Option<f64> {
    match field.parse::<f64>() {
        // `1.234` with a decimal comma has thousands.
        Ok(x) if !comma || !field.contains('.') => Some(x),
        _ => parse_separated(field.trim(), comma),
    }
}

#[cold]
fn parse_separated(text: &str, comma: bool) -> Option<f64> {
    if (!comma || !text.contains('.'))
        && let Ok(x) = text.parse::<f64>()
    {
        return Some(x);
    }
    let (negative, body) = match text.strip_prefix(['-', '\u{2212}']) {
        Some(body) => (true, body),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let at = body.find(['e', 'E']).unwrap_or(body.len());
    let cleaned = clean(&body[..at], comma)? + &body[at..];
    cleaned.parse::<f64>().ok().map(|x| if negative { -x } else { x })
}

/// Nanoseconds since 1970 of a date with time, `2026-01-31T10:00:00.25Z`, `31.01.2026 10:00:00`, `2026/01/31 10:00`, or of a
/// time of day `10:00:00.25`.
pub(crate) fn parse_date_ns(text: &str) -> Option<i64> {
    let text = text.trim();
    if let Some(ns) = parse_duration_ns(text) {
        return Some(ns);
    }
    if text.len() < 7 || text.len() > 40 || !text.is_ascii() || !text.as_bytes()[0].is_ascii_digit() {
        return None;
    }
    let (date, time) = match text.find(['T', ' ']) {
        Some(at) => (Some(&text[..at]), text[at + 1..].trim()),
        None if text.contains(':') => (None, text),
        None => return None,
    };
    let days = match date {
        Some(date) => days_since_1970(date)?,
        None => 0,
    };
    let (time, offset_s) = split_zone(time)?;
    let mut parts = time.split(':');
    let hours = parse_digits(parts.next()?)?;
    let minutes = parse_digits(parts.next()?)?;
    let seconds = parts.next().unwrap_or("0");
    if parts.next().is_some() || hours > 24 || minutes > 59 {
        return None;
    }
    let (whole, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, ""));
    let whole = parse_digits(whole)?;
    if whole > 60 || fraction.len() > 12 || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let mut nanoseconds = 0_i64;
    for (place, digit) in fraction.bytes().take(9).enumerate() {
        nanoseconds += i64::from(digit - b'0') * 10_i64.pow(8 - place as u32);
    }
    let of_day = hours * 3600 + minutes * 60 + whole - offset_s;
    days.checked_mul(86_400)?.checked_add(of_day)?.checked_mul(1_000_000_000)?.checked_add(nanoseconds)
}

/// Nanoseconds of a duration with its unit, `0.01 sec`, as MATLAB writes timetables.
fn parse_duration_ns(text: &str) -> Option<i64> {
    let (number, unit) = text.split_once(' ')?;
    let seconds = match unit {
        "sec" | "s" => 1.0,
        "min" => 60.0,
        "hr" => 3600.0,
        _ => return None,
    };
    let ns = libm::round(number.parse::<f64>().ok()? * seconds * 1e9);
    (ns.abs() < 9e18).then_some(ns as i64)
}

fn parse_digits(text: &str) -> Option<i64> {
    ((1..=4).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit()))
        .then(|| text.parse().ok())
        .flatten()
}

/// A time of day and its offset from UTC (s).
fn split_zone(time: &str) -> Option<(&str, i64)> {
    if let Some(time) = time.strip_suffix(['Z', 'z']) {
        return Some((time.trim_end(), 0));
    }
    let Some(at) = time.rfind(['+', '-']) else { return Some((time, 0)) };
    let zone = time[at + 1..].replace(':', "");
    let value = parse_digits(&zone)?;
    let seconds = if zone.len() <= 2 { value * 3600 } else { value / 100 * 3600 + value % 100 * 60 };
    Some((time[..at].trim_end(), if time.as_bytes()[at] == b'-' { -seconds } else { seconds }))
}

fn days_since_1970(date: &str) -> Option<i64> {
    let mut parts = date.split(['-', '/', '.']);
    let (a, b, c) = (parts.next()?, parse_digits(parts.next()?)?, parts.next()?);
    if parts.next().is_some() {
        return None;
    }
    let (year, month, day) = if a.len() == 4 {
        (parse_digits(a)?, b, parse_digits(c)?)
    } else {
        (parse_digits(c)?, b, parse_digits(a)?)
    };
    // Month first, as in the USA.
    let (month, day) = if month > 12 { (day, month) } else { (month, day) };
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1900..=2200).contains(&year) {
        return None;
    }
    // Days from civil (Howard Hinnant).
    let y = if month <= 2 { year - 1 } else { year };
    let era = y.div_euclid(400);
    let of_era = y.rem_euclid(400);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_are_read_where_they_are_unmistakable() {
        let kind = |text| classify(text);
        assert_eq!(kind("12"), FieldKind::Number(Separators::None));
        assert_eq!(kind("0,5"), FieldKind::Number(Separators::Comma));
        assert_eq!(kind("0,123"), FieldKind::Number(Separators::Comma));
        assert_eq!(kind("1,234"), FieldKind::Number(Separators::PointOrComma));
        assert_eq!(kind("1,234.5"), FieldKind::Number(Separators::Point));
        assert_eq!(kind("1.234,5"), FieldKind::Number(Separators::Comma));
        assert_eq!(kind("-1.5e-3"), FieldKind::Number(Separators::Point));
        assert_eq!(kind("1,5E-3"), FieldKind::Number(Separators::Comma));
        assert_eq!(kind("NaN"), FieldKind::Missing);
        assert_eq!(kind("tool0"), FieldKind::Text);
        assert_eq!(kind("1_000"), FieldKind::Text);
        assert_eq!(kind("10:00:00.5"), FieldKind::Date);
    }

    #[test]
    fn numbers_are_parsed_in_both_conventions() {
        assert_eq!(parse_number("1,234.5", false), Some(1234.5));
        assert_eq!(parse_number("1.234,5", true), Some(1234.5));
        assert_eq!(parse_number("-0,25", true), Some(-0.25));
        assert_eq!(parse_number("1 234,5", true), Some(1234.5));
        assert_eq!(parse_number("\u{2212}3.5", false), Some(-3.5));
        assert_eq!(parse_number("1.234", true), Some(1234.0));
        assert_eq!(parse_number("12,34", false), None);
        assert_eq!(parse_number("1.5e3", true), None);
        assert_eq!(parse_number(" 2.5 ", false), Some(2.5));
    }

    #[test]
    fn dates_are_nanoseconds_since_1970() {
        assert_eq!(parse_date_ns("1970-01-01T00:00:01.5"), Some(1_500_000_000));
        assert_eq!(parse_date_ns("2026-01-01T10:00:00.005000000"), Some(1_767_261_600_005_000_000));
        assert_eq!(parse_date_ns("2026-01-01 10:00:00+01:00"), Some(1_767_258_000_000_000_000));
        assert_eq!(parse_date_ns("01.01.2026 10:00:00"), Some(1_767_261_600_000_000_000));
        assert_eq!(parse_date_ns("1/31/2026 10:00:00"), parse_date_ns("31/1/2026 10:00:00"));
        assert_eq!(parse_date_ns("10:00:00.25"), Some(36_000_250_000_000));
        assert_eq!(parse_date_ns("12.5.3"), None);
        assert_eq!(parse_date_ns("0-0-0 0:0:0"), None);
    }
}
