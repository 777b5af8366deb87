//! Layout of a text table: preamble, line of names, row of units, delimiter, decimal sign, first row of numbers.

use super::delimiter::{DELIMITERS, Delimiter, split};
use super::number::{FieldKind, Separators, classify, parse_date_ns, parse_number};
use super::ros;
use crate::units::{Dimension, Unit, parse_unit, quantity_of, split_name, unit_at};

/// Contents of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColumnKind {
    /// Numbers.
    Number,
    /// Dates or times of day.
    Date,
    /// Text.
    Text,
    /// No values.
    Empty,
}

/// Values of a column in some rows; of columns with times, lengths and forces only.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSample {
    /// Values in rows spread evenly over the text, in SI units; NaN for what is no number. Seconds since 1970 for dates.
    pub spread: Vec<f64>,
    /// Mean step over the first rows.
    pub step: f64,
    /// Share of the first rows that exceed the one before.
    pub rising_share: f64,
    pub is_date: bool,
}

/// Least number of values in the sample of a longer column that is not read as text.
const SPREAD_VALUES: usize = 512;
/// Share of rising steps of a clock; the others repeat a stamp.
const CLOCK_SHARE: f64 = 0.9;

impl ColumnSample {
    /// A column of a file that is no text, with values in units of `to_si`.
    pub(crate) fn of_values(values: &[f64], to_si: f64) -> Self {
        let step = (values.len() / SPREAD_VALUES).max(1);
        Self { spread: values.iter().step_by(step).map(|x| x * to_si).collect(), ..Self::default() }
    }

    /// Largest less smallest value; NaN without values.
    pub(crate) fn range(&self) -> f64 {
        let known = || self.spread.iter().copied().filter(|x| x.is_finite());
        known().fold(f64::NAN, f64::max) - known().fold(f64::NAN, f64::min)
    }

    /// Whether every sample has a stamp of its own, with few exceptions.
    pub(crate) fn is_clock(&self) -> bool {
        self.rising_share >= CLOCK_SHARE
    }

    /// Whether two clocks differ by more than half a step; only in elapsed time if one of them is a date.
    pub(crate) fn differs_as_clock(&self, other: &Self) -> bool {
        let start = |sample: &Self| match self.is_date || other.is_date {
            true => sample.spread.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0),
            false => 0.0,
        };
        let (half, shift) = (0.5 * self.step.min(other.step).abs(), start(self) - start(other));
        self.spread.iter().zip(&other.spread).any(|(a, b)| (a - b - shift).abs() > half)
    }
}

/// Layout of a text table.
#[derive(Debug, Clone)]
pub(crate) struct TextLayout {
    pub delimiter: Delimiter,
    pub decimal_comma: bool,
    /// A number such as `1,234` when nothing decides between decimal comma and thousands.
    pub open_decimal: Option<String>,
    /// First byte of comment lines.
    pub comment: Option<u8>,
    /// One name per column; `column 1` ... without names.
    pub names: Vec<String>,
    pub names_line: Option<u64>,
    pub units: Vec<Option<Unit>>,
    pub units_line: Option<u64>,
    pub kinds: Vec<ColumnKind>,
    /// Fewest fields of a row: the columns behind them are remarks, which may be missing.
    pub least_width: usize,
    pub samples: Vec<ColumnSample>,
    /// Offset and line of the first row.
    pub data_start: usize,
    pub data_line: u64,
    /// Lines before the names that are not blank.
    pub preamble: Vec<String>,
}

impl TextLayout {
    /// Columns of a row.
    pub(crate) fn width(&self) -> usize {
        self.names.len()
    }
}

/// Layout settings given by a column map.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LayoutHints {
    pub header_line: Option<u64>,
    pub decimal_comma: Option<bool>,
}

/// Most lines used to find the layout.
const MAX_LINES: usize = 3000;
/// Rows used to find kinds of columns and the decimal sign.
const SAMPLE_ROWS: usize = 400;
/// Most lines between a line of units and the names below it.
const MAX_PREAMBLE_LINES: usize = 15;
/// Most lines between names and numbers.
const MAX_HEADER_LINES: usize = 4;

/// A line of the head of a file.
#[derive(Debug, Clone, Copy)]
struct Line<'a> {
    text: &'a str,
    offset: usize,
    number: u64,
}

fn lines(text: &str, from: usize, first_number: u64) -> Vec<Line<'_>> {
    let (mut out, mut offset, mut number) = (Vec::new(), from, first_number);
    while offset < text.len() && out.len() < MAX_LINES {
        let rest = &text[offset..];
        let end = rest.find(['\n', '\r']).unwrap_or(rest.len());
        out.push(Line { text: &rest[..end], offset, number });
        let ends = if rest[end..].starts_with("\r\n") { 2 } else { usize::from(end < rest.len()) };
        offset += end + ends;
        number += 1;
    }
    out
}

/// The rows that look like numbers, with one delimiter.
struct Block {
    delimiter: Delimiter,
    /// Fields per row, without an empty last one.
    width: usize,
    /// Index of the first line.
    first: usize,
    score: f64,
}

/// Width of a row without an empty last field.
fn data_width(fields: &[String]) -> usize {
    fields.len() - usize::from(fields.len() > 1 && fields.last().is_some_and(String::is_empty))
}

/// Share of the fields of a row that are numbers, dates or missing; `None` when it is not a row of data.
fn purity(fields: &[String]) -> Option<f64> {
    let (mut numbers, mut others) = (0, 0);
    for field in fields {
        match classify(field) {
            FieldKind::Number(_) | FieldKind::Date => numbers += 1,
            FieldKind::Missing => {}
            FieldKind::Text => others += 1,
        }
    }
    (numbers > 0 && numbers >= others).then(|| 1.0 - f64::from(others) / fields.len().max(1) as f64)
}

fn block(lines: &[Line<'_>], delimiter: Delimiter) -> Option<Block> {
    // Rows by width: how many, and their purity.
    let mut widths: std::collections::BTreeMap<usize, (f64, f64)> = std::collections::BTreeMap::new();
    let mut rows: Vec<Option<usize>> = Vec::with_capacity(lines.len());
    for line in lines {
        let fields = split(line.text, delimiter);
        let width = data_width(&fields);
        let pure = (!is_comment(line.text)).then(|| purity(&fields[..width])).flatten();
        if let Some(pure) = pure {
            let entry = widths.entry(width).or_default();
            entry.0 += 1.0;
            entry.1 += pure;
        }
        rows.push(pure.map(|_| width));
    }
    let (width, (count, pure)) = widths
        .into_iter()
        .filter(|(width, _)| *width > 1 || delimiter == Delimiter::Blanks)
        .max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let first = first_row(lines, &rows, delimiter, width)?;
    let mean = pure / count;
    // A table of one column is chosen last.
    let score = count * mean * mean * if width > 1 { 1.0 } else { 0.1 };
    Some(Block { delimiter, width, first, score })
}

/// Index of the first row. A row of a header, such as `Samples  1582  1582`, has text in the first column where most rows have numbers; a row
/// of values may have remarks behind them.
fn first_row(
    lines: &[Line<'_>],
    rows: &[Option<usize>],
    delimiter: Delimiter,
    width: usize,
) -> Option<usize> {
    let is_text = |field: &String| classify(field) == FieldKind::Text;
    let first_is_text = |at: &usize| split(lines[*at].text, delimiter).first().is_some_and(is_text);
    let of_width = || (0..lines.len()).filter(|at| rows[*at] == Some(width));
    let texts = of_width().take(SAMPLE_ROWS).filter(first_is_text).count();
    let mostly_text = 2 * texts > of_width().take(SAMPLE_ROWS).count();
    let is_row = |at: &usize| {
        let remarks = |fields: &[String]| fields.iter().skip(width).all(|f| f.is_empty() || is_text(f));
        rows[*at].is_some_and(|row| row >= width)
            && (mostly_text || !first_is_text(at))
            && (rows[*at] == Some(width) || remarks(&split(lines[*at].text, delimiter)))
    };
    (0..lines.len()).find(is_row).or_else(|| of_width().next())
}

/// Whether a line is a comment.
fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

fn without_comment_mark(line: &str) -> &str {
    line.trim_start_matches(|c: char| matches!(c, '#' | '%') || c.is_whitespace())
}

/// Finds the layout of the table in the head of a text; `None` without rows of numbers.
pub(crate) fn find_layout(head: &str, from: usize, from_line: u64, hints: LayoutHints) -> Option<TextLayout> {
    let all = lines(head, from, from_line);
    let candidates = match hints.header_line {
        // Rows before the given line are not data.
        Some(names) => all.iter().filter(|line| line.number > names).copied().collect::<Vec<_>>(),
        None => all.clone(),
    };
    let found = DELIMITERS
        .iter()
        .filter_map(|delimiter| block(&candidates, *delimiter))
        .reduce(|best, next| if next.score > best.score { next } else { best })?;
    let first_row = candidates.get(found.first)?;
    let first = all.iter().position(|line| line.offset == first_row.offset)?;
    let header = header(&all, first, &found, hints);
    let width = header.names.as_ref().map_or(found.width, Vec::len);
    let mut layout = TextLayout {
        delimiter: found.delimiter,
        decimal_comma: false,
        open_decimal: None,
        comment: Some(if all[first..].iter().take(SAMPLE_ROWS).any(|l| l.text.starts_with('%')) {
            b'%'
        } else {
            b'#'
        }),
        names: header.names.unwrap_or_else(|| ros::echoed_names(first_row.text, found.delimiter, width)),
        names_line: header.names_line,
        units: header.units,
        units_line: header.units_line,
        kinds: Vec::new(),
        least_width: width,
        samples: Vec::new(),
        data_start: first_row.offset,
        data_line: first_row.number,
        preamble: header.preamble,
    };
    layout.units.resize(width, None);
    ros::add_units(&layout.names, &mut layout.units);
    layout.look_at_rows(head, hints);
    Some(layout)
}

impl TextLayout {
    /// Kinds of the columns and the decimal sign, from the first rows.
    pub(crate) fn look_at_rows(&mut self, head: &str, hints: LayoutHints) {
        let rows = lines(head, self.data_start, self.data_line);
        let complete = rows.len().saturating_sub(1).max(1);
        let width = self.width();
        let (mut numbers, mut dates, mut texts) =
            (vec![0_u32; width], vec![0_u32; width], vec![0_u32; width]);
        let (mut points, mut commas, mut open) = (0, 0, None);
        for line in rows.iter().take(complete.min(SAMPLE_ROWS)) {
            for (at, field) in split(line.text, self.delimiter).iter().take(width).enumerate() {
                match classify(field) {
                    FieldKind::Number(separators) => {
                        numbers[at] += 1;
                        match separators {
                            Separators::Point => points += 1,
                            Separators::Comma => commas += 1,
                            Separators::PointOrComma => open = open.or_else(|| Some(field.clone())),
                            Separators::None => {}
                        }
                    }
                    FieldKind::Date => dates[at] += 1,
                    FieldKind::Text => texts[at] += 1,
                    FieldKind::Missing => {}
                }
            }
        }
        self.decimal_comma = hints.decimal_comma.unwrap_or(commas > 0 && commas > points);
        self.open_decimal =
            if points == 0 && commas == 0 && hints.decimal_comma.is_none() { open } else { None };
        self.kinds = (0..width)
            .map(|at| match (numbers[at], dates[at], texts[at]) {
                (0, 0, 0) => ColumnKind::Empty,
                (n, d, t) if d >= n && d >= t => ColumnKind::Date,
                (n, _, t) if n >= t => ColumnKind::Number,
                _ => ColumnKind::Text,
            })
            .collect();
        // Remarks behind the values may be missing. Between blanks, the field that is missing may be any.
        let is_remark = |at: usize| {
            matches!(self.kinds[at], ColumnKind::Text | ColumnKind::Empty)
                && self.unit(at).is_none()
                && quantity_of(&split_name(&self.names[at]).base).is_none()
        };
        let remarks = (2..width).rev().take_while(|at| is_remark(*at)).count();
        self.least_width = if self.delimiter == Delimiter::Blanks { width } else { width - remarks };
    }

    fn unit(&self, at: usize) -> Option<Unit> {
        unit_at(&self.units, &self.names, at)
    }

    /// The layout with values of the columns in the first rows and in `spread`, lines spread over the text.
    pub(crate) fn with_samples(mut self, head: &str, spread: &[String]) -> Self {
        let rows = lines(head, self.data_start, self.data_line);
        let is_row = |line: &&Line<'_>| !line.text.trim().is_empty() && !is_comment(line.text);
        let first: Vec<&str> = rows.iter().filter(is_row).map(|line| line.text).take(SAMPLE_ROWS).collect();
        // The last of them may be cut short.
        self.samples = self.column_samples(&first[..first.len().saturating_sub(1)], spread);
        self
    }

    fn column_samples(&self, first_rows: &[&str], spread: &[String]) -> Vec<ColumnSample> {
        let scale = |at: usize| match (self.kinds.get(at), self.unit(at)) {
            (Some(ColumnKind::Date), _) => Some(1.0),
            (_, Some(unit)) => {
                matches!(unit.dimension, Dimension::Time | Dimension::Length | Dimension::Force)
                    .then_some(unit.to_si)
            }
            _ => None,
        };
        let scales: Vec<Option<f64>> = (0..self.width()).map(scale).collect();
        let values = |line: &str| -> Vec<f64> {
            let fields = split(line, self.delimiter);
            let value = |at: usize| {
                let (scale, field) = (scales[at]?, fields.get(at)?);
                match self.kinds.get(at)? {
                    ColumnKind::Date => parse_date_ns(field).map(|ns| ns as f64 / 1e9),
                    _ => parse_number(field, self.decimal_comma).map(|x| scale * x),
                }
            };
            (0..self.width()).map(|at| value(at).unwrap_or(f64::NAN)).collect()
        };
        let first: Vec<Vec<f64>> = first_rows.iter().map(|line| values(line)).collect();
        let spread: Vec<Vec<f64>> = spread.iter().map(|line| values(line)).collect();
        let sample = |at: usize| {
            if scales[at].is_none() {
                return ColumnSample::default();
            }
            let steps: Vec<f64> = first.windows(2).map(|pair| pair[1][at] - pair[0][at]).collect();
            let count = steps.iter().filter(|step| step.is_finite()).count().max(1) as f64;
            ColumnSample {
                spread: spread.iter().map(|row| row[at]).collect(),
                step: steps.iter().filter(|step| step.is_finite()).sum::<f64>() / count,
                rising_share: steps.iter().filter(|step| **step > 0.0).count() as f64 / count,
                is_date: self.kinds.get(at) == Some(&ColumnKind::Date),
            }
        };
        (0..self.width()).map(sample).collect()
    }
}

#[derive(Default)]
struct Header {
    names: Option<Vec<String>>,
    names_line: Option<u64>,
    units: Vec<Option<Unit>>,
    units_line: Option<u64>,
    preamble: Vec<String>,
}

/// Names and units in the lines above the first row.
fn header(all: &[Line<'_>], first: usize, block: &Block, hints: LayoutHints) -> Header {
    let above: Vec<(usize, Vec<String>)> = all[..first]
        .iter()
        .enumerate()
        .rev()
        .filter(|(_, line)| !line.text.trim().is_empty())
        .take(if hints.header_line.is_some() { usize::MAX } else { MAX_HEADER_LINES })
        .map(|(at, line)| (at, header_fields(line.text, block)))
        .collect();
    let mut header = Header::default();
    let fits = |fields: &[String]| {
        let width = data_width(fields);
        width == block.width || (fields.len() == block.width + 1 && width == block.width + 1)
    };
    let is_given = |at: usize| hints.header_line == Some(all[at].number);
    let has_letters = |fields: &[String]| fields.iter().any(|f| f.chars().any(char::is_alphabetic));
    // Below names and units there may be a row of channels, which is neither.
    let is_row_of_channels = |place: usize| match &above[place..] {
        [(_, channels), (_, units), (_, names), ..] => {
            fits(units)
                && is_row_of_units(units)
                && fits(names)
                && has_letters(names)
                && channels.iter().all(|name| quantity_of(&split_name(name).base).is_none())
        }
        _ => false,
    };
    let mut names_at = None;
    for (place, (at, fields)) in above.iter().enumerate() {
        if is_given(*at) {
            let mut fields = fields.clone();
            fields.truncate(data_width(&fields).max(block.width));
            fields.resize(block.width.max(fields.len()), String::new());
            header.names = Some(fields);
            names_at = Some(*at);
            break;
        }
        if !fits(fields) {
            if hints.header_line.is_none() && header.names.is_some() {
                break;
            }
            continue;
        }
        if is_row_of_units(fields) && header.units_line.is_none() {
            header.units = fields.iter().map(|field| parse_unit(field)).collect();
            header.units_line = Some(all[*at].number);
        } else if header.units_line.is_none() && is_row_of_channels(place) {
            continue;
        } else if hints.header_line.is_none() && has_letters(fields) {
            let mut fields = fields.clone();
            fields.truncate(data_width(&fields));
            header.names = Some(fields);
            names_at = Some(*at);
            break;
        }
    }
    if header.names.is_none() {
        // A row that looks like units holds the names if there is nothing above it.
        header.units.clear();
        if let (Some(line), None) = (header.units_line.take(), hints.header_line)
            && let Some((at, fields)) = above.iter().find(|(at, _)| all[*at].number == line)
        {
            header.names = Some(fields[..data_width(fields)].to_vec());
            names_at = Some(*at);
        }
    }
    header.names_line = names_at.map(|at| all[at].number);
    let before = names_at.unwrap_or(first);
    if header.units_line.is_none() && names_at.is_some() {
        // A line such as `Y_Unit_Label  mm  N` further up, as LabVIEW writes it: a label in place of the first unit, or before it.
        let names = header.names.as_deref().unwrap_or_default();
        let labelled = all[..before].iter().rev().take(MAX_PREAMBLE_LINES).find_map(|line| {
            let mut fields = split(line.text, block.delimiter);
            while fields.last().is_some_and(String::is_empty) {
                fields.pop();
            }
            let is_label = fields.first()?.to_lowercase().contains("unit");
            let from = fields.len().checked_sub(block.width)?;
            let mut units: Vec<Option<Unit>> = fields.iter().map(|field| parse_unit(field)).collect();
            units[0] = None;
            let known =
                fields.iter().zip(&units).skip(1).all(|(field, unit)| field.is_empty() || unit.is_some());
            let real = units.iter().flatten().filter(|unit| unit.dimension != Dimension::Other).count();
            (is_label && known && real > 1 && from < 2).then(|| (line.number, units.split_off(from)))
        });
        if let Some((number, units)) = labelled {
            // A unit in the name of the column counts more.
            let in_name = |at: usize| names.get(at).is_some_and(|name| split_name(name).unit.is_some());
            header.units =
                units.into_iter().enumerate().map(|(at, unit)| unit.filter(|_| !in_name(at))).collect();
            header.units_line = Some(number);
        }
    }
    header.preamble = all[..before]
        .iter()
        .map(|line| line.text.trim().to_owned())
        .filter(|t| !t.is_empty())
        .take(40)
        .collect();
    header
}

/// Fields of a line above the rows; a blank inside brackets does not separate names.
fn header_fields(line: &str, block: &Block) -> Vec<String> {
    let fields = split(without_comment_mark(line), block.delimiter);
    if is_comment(line) && data_width(&fields) != block.width {
        // The names in a comment need not be separated like the numbers.
        let others = DELIMITERS.iter().map(|delimiter| split(without_comment_mark(line), *delimiter));
        if let Some(names) = others.into_iter().find(|names| names.len() == block.width) {
            return names;
        }
    }
    if block.delimiter != Delimiter::Blanks || fields.len() <= block.width {
        return fields;
    }
    let mut merged: Vec<String> = Vec::new();
    for field in fields {
        match merged.last_mut() {
            Some(last) if field.starts_with(['(', '[']) => {
                last.push(' ');
                last.push_str(&field);
            }
            _ => merged.push(field),
        }
    }
    merged
}

/// Whether the fields of a line are units rather than names.
pub(crate) fn is_row_of_units(fields: &[String]) -> bool {
    let filled: Vec<&String> = fields.iter().filter(|field| !field.is_empty()).collect();
    let units = filled.iter().filter_map(|field| parse_unit(field).map(|unit| (field, unit)));
    let mut known = 0;
    for (field, unit) in units {
        // A column may be called `time`, but not `kN`.
        if unit.dimension == Dimension::Other || quantity_of(field).is_none() || field.starts_with(['(', '['])
        {
            known += 1;
        }
    }
    // Names such as `s, m, g` would be odd; two thirds decide.
    !filled.is_empty() && known * 3 >= filled.len() * 2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(text: &str) -> TextLayout {
        find_layout(text, 0, 1, LayoutHints::default()).expect("a table")
    }

    #[test]
    fn a_preamble_a_row_of_units_and_decimal_commas_are_found() {
        let text = "\"Test\";\"7\"\r\n\"Operator\";\"A. B.\"\r\n\r\n\"Zeit\";\"Weg\";\"Kraft\"\r\n\"(s)\";\"(mm)\";\"(N)\"\r\n\
                    \"0,000\";\"-1,5\";\"0,01\"\r\n\"0,005\";\"-1,4\";\"0,02\"\r\n";
        let found = layout(text);
        assert_eq!(found.names, ["Zeit", "Weg", "Kraft"]);
        assert_eq!((found.names_line, found.units_line, found.data_line), (Some(4), Some(5), 6));
        assert_eq!(found.units[1].map(|u| u.symbol), Some("mm"));
        assert!(found.decimal_comma);
        assert_eq!(found.preamble.len(), 2);
    }

    #[test]
    fn a_row_of_channels_below_names_and_units_holds_neither() {
        let found = layout("Time;Force_U9C;Stage\ns;N;mm\nCH1;CH2;CH3\n0,0;0,01;-1,5\n0,1;0,02;-1,4\n");
        assert_eq!(found.names, ["Time", "Force_U9C", "Stage"]);
        assert_eq!((found.names_line, found.units_line, found.data_line), (Some(1), Some(2), 4));
    }

    #[test]
    fn a_commented_header_and_blanks_are_found() {
        let found =
            layout("# time_s position_m force_n\n0.0 -0.01 0.1\n 0.005  -0.0099 0.2\n0.01 -0.0098 0.3\n");
        assert_eq!(found.names, ["time_s", "position_m", "force_n"]);
        assert_eq!(found.delimiter, Delimiter::Blanks);
    }

    #[test]
    fn rows_without_names_and_with_a_comma_at_the_end_have_numbered_columns() {
        let found = layout("0.0,-0.01,0.1,\n0.005,-0.0099,0.2,\n");
        assert_eq!(found.names, ["column 1", "column 2", "column 3"]);
        assert_eq!((found.names_line, found.data_line), (None, 1));
    }

    #[test]
    fn thousands_in_quotation_marks_are_no_decimal_commas() {
        let found = layout("t,x,f\n0.0,0.1,\"999.500\"\n0.005,0.2,\"1,000.250\"\n0.01,0.3,\"1,001.5\"\n");
        assert!(!found.decimal_comma && found.delimiter == Delimiter::Byte(b','));
        assert_eq!(found.kinds, [ColumnKind::Number; 3]);
    }

    #[test]
    fn semicolons_with_decimal_commas_are_not_commas() {
        let found = layout("t;note;f\n0,0;abc;1,2\n0,5;def;1,3\n");
        assert_eq!(found.delimiter, Delimiter::Byte(b';'));
        assert!(found.decimal_comma);
        assert_eq!(found.kinds, [ColumnKind::Number, ColumnKind::Text, ColumnKind::Number]);
    }
}
