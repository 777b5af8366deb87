//! Layout of a text table: preamble, line of names, row of units, delimiter, decimal sign, first row of numbers.

use super::delimiter::{DELIMITERS, Delimiter, split};
use super::number::{FieldKind, Separators, classify, parse_date_ns, parse_number};
use super::ros;
use crate::units::{Dimension, Unit, parse_unit, quantity_of};

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

/// Values of a column in some rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSample {
    /// Values in rows spread evenly over the text; NaN for what is no number. Seconds since 1970 for dates.
    pub spread: Vec<f64>,
    /// Mean step over the first rows.
    pub step: f64,
    /// Whether each of the first rows exceeds the one before.
    pub increases: bool,
}

impl ColumnSample {
    /// Largest less smallest value.
    pub(crate) fn range(&self) -> f64 {
        let known = || self.spread.iter().copied().filter(|x| x.is_finite());
        (known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min)).max(0.0)
    }

    /// Whether two clocks differ by more than half a step.
    pub(crate) fn differs_as_clock(&self, other: &Self) -> bool {
        let half = 0.5 * self.step.min(other.step).abs();
        self.spread.iter().zip(&other.spread).any(|(a, b)| (a - b).abs() > half || a.is_nan() != b.is_nan())
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
    /// Fewest fields of a row; the columns behind them, such as remarks, are empty in most rows.
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

/// Index of the first line with numbers in every column in which most rows have numbers. A row of a header, such as `Samples  1582  1582`,
/// has text in one of them; a row of values may have further fields, such as a remark.
fn first_row(
    lines: &[Line<'_>],
    rows: &[Option<usize>],
    delimiter: Delimiter,
    width: usize,
) -> Option<usize> {
    let is_text = |field: &String| classify(field) == FieldKind::Text;
    let wide = |at: &usize| rows[*at].is_some_and(|row| row >= width);
    let sample: Vec<Vec<bool>> = (0..lines.len())
        .filter(|at| rows[*at] == Some(width))
        .take(SAMPLE_ROWS)
        .map(|at| split(lines[at].text, delimiter).iter().take(width).map(is_text).collect())
        .collect();
    let mostly_text: Vec<bool> =
        (0..width).map(|k| 2 * sample.iter().filter(|row| row[k]).count() > sample.len()).collect();
    (0..lines.len()).filter(wide).find(|at| {
        let fields = split(lines[*at].text, delimiter);
        fields.iter().zip(&mostly_text).all(|(field, text)| *text || !is_text(field))
    })
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
        let mut widths = vec![0_u32; width + 1];
        for line in rows.iter().take(complete.min(SAMPLE_ROWS)) {
            let fields = split(line.text, self.delimiter);
            if let Some(count) = widths.get_mut(fields.len().min(width)) {
                *count += u32::from(fields.iter().any(|field| !field.is_empty()));
            }
            for (at, field) in fields.iter().take(width).enumerate() {
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
        // Rows without the last fields are complete if most rows are like that.
        let most = widths.iter().enumerate().skip(2).max_by_key(|(_, count)| **count);
        self.least_width = match self.delimiter {
            Delimiter::Byte(_) => most.map_or(width, |(fields, _)| fields.min(width)),
            // Between blanks, the field that is missing may be any.
            Delimiter::Blanks => width,
        };
        self.kinds = (0..width)
            .map(|at| match (numbers[at], dates[at], texts[at]) {
                (0, 0, 0) => ColumnKind::Empty,
                (n, d, t) if d >= n && d >= t => ColumnKind::Date,
                (n, _, t) if n >= t => ColumnKind::Number,
                _ => ColumnKind::Text,
            })
            .collect();
        self.samples = self.column_samples(head, &rows[..rows.len().min(complete).min(SAMPLE_ROWS)]);
    }

    fn column_samples(&self, head: &str, first_rows: &[Line<'_>]) -> Vec<ColumnSample> {
        let values = |line: &str| -> Vec<f64> {
            let fields = split(line, self.delimiter);
            let value = |at: usize| {
                let field = fields.get(at)?;
                match self.kinds.get(at)? {
                    ColumnKind::Date => parse_date_ns(field).map(|ns| ns as f64 / 1e9),
                    _ => parse_number(field, self.decimal_comma),
                }
            };
            (0..self.width()).map(|at| value(at).unwrap_or(f64::NAN)).collect()
        };
        let first: Vec<Vec<f64>> = first_rows.iter().map(|line| values(line.text)).collect();
        let spread: Vec<Vec<f64>> =
            spread_lines(&head[self.data_start.min(head.len())..]).map(values).collect();
        let sample = |at: usize| {
            let steps: Vec<f64> = first.windows(2).map(|pair| pair[1][at] - pair[0][at]).collect();
            ColumnSample {
                spread: spread.iter().map(|row| row[at]).collect(),
                step: steps.iter().sum::<f64>() / steps.len().max(1) as f64,
                increases: steps.iter().all(|step| *step > 0.0),
            }
        };
        (0..self.width()).map(sample).collect()
    }
}

/// Lines spread evenly over a text, without a last one that may be cut short.
fn spread_lines(text: &str) -> impl Iterator<Item = &str> {
    let mut from = 0;
    (0..SAMPLE_ROWS).map_while(move |k| {
        // The next beginning of a line; an ASCII character is no part of another one.
        let wanted = (text.len() as u128 * k as u128 / SAMPLE_ROWS as u128) as usize;
        if wanted > from {
            from = wanted + text.as_bytes()[wanted..].iter().position(|b| *b == b'\n')? + 1;
        }
        let length = text.as_bytes()[from..].iter().position(|b| *b == b'\n')?;
        let line = &text[from..from + length];
        from += length + 1;
        Some(line)
    })
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
    let mut names_at = None;
    for (at, fields) in &above {
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
        } else if hints.header_line.is_none() && fields.iter().any(|f| f.chars().any(char::is_alphabetic)) {
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
        // A line such as `Y_Unit_Label  mm  N` further up, as LabVIEW writes it.
        let labelled = all[..before].iter().rev().take(MAX_PREAMBLE_LINES).find_map(|line| {
            let fields = split(line.text, block.delimiter);
            let (label, units) = fields.split_first()?;
            let is_label = label.to_lowercase().contains("unit") && fields.len() <= block.width + 1;
            let known = units.iter().all(|unit| unit.is_empty() || parse_unit(unit).is_some());
            let any = units.iter().any(|unit| !unit.is_empty());
            (is_label && known && any).then_some((line.number, units.to_vec()))
        });
        if let Some((number, units)) = labelled {
            header.units = std::iter::once(None).chain(units.iter().map(|unit| parse_unit(unit))).collect();
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
