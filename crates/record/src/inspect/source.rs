//! Rows of a file for the inspection, from text in pieces or from columns in memory.

use super::facts::{FileFacts, Rows};
use super::scan::{Scan, ThinnedCurves};
use super::{InspectOptions, InspectedColumn, Inspection, TextFacts, candidates, findings, sampling};
use crate::column_map::ColumnMap;
use crate::columns::TableHead;
use crate::error::RecordError;
use crate::file_formats::numeric_columns::column_samples;
use crate::file_formats::{FileFormat, OpenFile};
use crate::table_source::{decoded, read_bytes};
use crate::text::encoding;
use crate::text::find::inspect_layout;
use crate::text::layout::{ColumnKind, TextLayout};
use crate::text::rows::{RowsRead, Tolerance, WantedField, read_rows};
use crate::text::source::{SourceFile, TextSource, Utf8Check, header_start};
use crate::units::Unit;
use encoding_rs::{Encoding, UTF_8};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that decide about encoding and layout.
const HEAD_BYTES: u64 = 1 << 18;
/// Most columns that are inspected.
const MAX_COLUMNS: usize = 512;

struct TextRows<'a> {
    file: SourceFile<'a>,
    layout: &'a TextLayout,
}

impl Rows for TextRows<'_> {
    fn for_each(&self, each: &mut dyn FnMut(usize, &[f64])) -> Result<RowsRead, RecordError> {
        let fields: Vec<WantedField> = self
            .layout
            .names
            .iter()
            .zip(&self.layout.kinds)
            .enumerate()
            .take(MAX_COLUMNS)
            .map(|(index, (name, kind))| WantedField {
                index,
                name: name.clone(),
                kind: *kind,
                from_first: true,
            })
            .collect();
        read_rows(&self.file, self.layout, &fields, Tolerance::Lenient, |offset, row| {
            each(offset, row);
            Ok(())
        })
    }

    fn lines(&self, offsets: &[usize]) -> Result<Vec<u64>, RecordError> {
        self.file.lines_of_offsets(offsets.iter().copied())
    }
}

struct ColumnRows(Vec<Vec<f64>>);

impl Rows for ColumnRows {
    fn for_each(&self, each: &mut dyn FnMut(usize, &[f64])) -> Result<RowsRead, RecordError> {
        let rows = self.0.first().map_or(0, Vec::len);
        let mut row = vec![0.0; self.0.len()];
        for at in 0..rows {
            row.iter_mut().zip(&self.0).for_each(|(x, column)| *x = column[at]);
            each(at, &row);
        }
        Ok(RowsRead { rows, origins: vec![None; self.0.len()], ..RowsRead::default() })
    }

    fn lines(&self, offsets: &[usize]) -> Result<Vec<u64>, RecordError> {
        Ok(offsets.iter().map(|row| *row as u64 + 2).collect())
    }
}

/// Inspects a file. Text tables are read in pieces: memory does not grow with their columns.
///
/// # Errors
/// [`RecordError`] when the file cannot be read at all: missing, empty, neither text nor a known format, damaged.
pub fn inspect(path: impl AsRef<Path>, options: &InspectOptions) -> Result<Inspection, RecordError> {
    let path = path.as_ref();
    let unreadable = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::NotFound => RecordError::NoSuchFile { path: path.to_owned() },
        _ => RecordError::Unreadable { path: path.to_owned(), source },
    };
    if path.is_dir() {
        return Err(RecordError::IsDirectory { path: path.to_owned() });
    }
    let file = File::open(path).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    let mut head = Vec::new();
    (&file).take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
    if !metadata.is_file() || metadata.len() <= HEAD_BYTES || FileFormat::detect(&head).is_some() {
        drop(head);
        return inspect_bytes(&read_bytes(path)?, path, options);
    }
    let map = options.columns.as_ref();
    let given = map.and_then(|map| Encoding::for_label(map.encoding.as_ref()?.as_bytes()));
    let Some(mut encoding) = given.or_else(|| encoding::detect(&head).ok()) else {
        // The error is that of the reader in memory.
        return inspect_bytes(&read_bytes(path)?, path, options);
    };
    let source = |encoding| match encoding == UTF_8 {
        true => TextSource::File(&file),
        false => TextSource::Encoded(&file, encoding),
    };
    if encoding == UTF_8 && given.is_none() {
        let mut check = Utf8Check::default();
        let whole = source(encoding);
        let mut text = whole.reader_at(0).map_err(unreadable)?;
        let mut chunk = vec![0; 1 << 18];
        loop {
            let count = text.read(&mut chunk).map_err(unreadable)?;
            if count > 0 && !check.push(&chunk[..count]) {
                encoding = encoding::code_page(&chunk[..count]);
                break;
            }
            if count == 0 {
                break;
            }
        }
    }
    let head = if encoding == UTF_8 { head } else { encoding::decode(&head, encoding) };
    let head = match std::str::from_utf8(&head) {
        Ok(head) => head,
        Err(error) => std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
    };
    let text = source(encoding);
    inspect_text(text, head, encoding.name(), ("text table".to_owned(), metadata.len()), path, map)
}

/// Inspects the bytes of a file. `path` appears in messages.
///
/// # Errors
/// As [`inspect`].
pub fn inspect_bytes(bytes: &[u8], path: &Path, options: &InspectOptions) -> Result<Inspection, RecordError> {
    let map = options.columns.as_ref();
    let size = bytes.len() as u64;
    match FileFormat::detect(bytes) {
        None => {
            let (text, encoding) = decoded(bytes, path, map)?;
            let head = std::str::from_utf8(&text).unwrap_or_default();
            inspect_text(
                TextSource::Bytes(&text),
                head,
                encoding.name(),
                ("text table".to_owned(), size),
                path,
                map,
            )
        }
        Some(kind) => match OpenFile::open(kind, bytes, path, map)? {
            OpenFile::Text(text) => {
                let head = std::str::from_utf8(&text).unwrap_or_default();
                inspect_text(
                    TextSource::Bytes(&text),
                    head,
                    "UTF-8",
                    (kind.name().to_owned(), size),
                    path,
                    map,
                )
            }
            OpenFile::Columns(source) => {
                let (names, units, kinds) = source.names_and_units();
                let unreadable = source.source.unreadable();
                if names.is_empty() {
                    let none = |_: TableHead<'_>| Ok(crate::columns::MappedColumns::default());
                    return source
                        .read(path, none)
                        .and_then(|_| Err(RecordError::EmptyFile { path: path.to_owned() }));
                }
                let chosen = candidates::rows_of_topic(&names);
                let wanted: Vec<&str> =
                    chosen.iter().take(MAX_COLUMNS).map(|at| names[*at].as_str()).collect();
                let (columns, left_out) = source.read_equal(&wanted)?;
                let used: Vec<usize> = chosen
                    .iter()
                    .copied()
                    .filter(|at| columns.iter().any(|(name, _)| *name == names[*at]))
                    .collect();
                let names: Vec<String> = used.iter().map(|at| names[*at].clone()).collect();
                let units: Vec<Option<Unit>> = used.iter().map(|at| units[*at]).collect();
                let kinds: Vec<ColumnKind> = used.iter().map(|at| kinds[*at]).collect();
                let head = TableHead::of_columns(path, &names, &units, &kinds);
                let samples = column_samples(head, &columns);
                let head = TableHead { samples: &samples, ..head };
                let facts = FileFacts {
                    path,
                    format: kind.name().to_owned(),
                    bytes: size,
                    text: None,
                    unreadable: unreadable.into_iter().chain(left_out).collect(),
                    open_decimal: None,
                };
                let rows = ColumnRows(columns.into_iter().map(|(_, values)| values).collect());
                inspect_rows(&rows, head, facts, map)
            }
        },
    }
}

fn inspect_text(
    text: TextSource<'_>,
    head: &str,
    encoding: &str,
    (format, bytes): (String, u64),
    path: &Path,
    map: Option<&ColumnMap>,
) -> Result<Inspection, RecordError> {
    let start =
        header_start(head.as_bytes()).ok_or_else(|| RecordError::EmptyFile { path: path.to_owned() })?;
    let file = SourceFile { text, path, header: start };
    let layout = inspect_layout(head, start, file.line_of_row(start)?, path, map, &file.spread_lines()?)?;
    let facts = FileFacts {
        path,
        format,
        bytes,
        text: Some(TextFacts {
            encoding: encoding.to_owned(),
            delimiter: layout.delimiter.name().to_owned(),
            decimal: if layout.decimal_comma { ',' } else { '.' },
            names_line: layout.names_line,
            units_line: layout.units_line,
            data_line: layout.data_line,
            preamble: layout.preamble.clone(),
        }),
        unreadable: Vec::new(),
        open_decimal: layout.open_decimal.clone(),
    };
    let rows = TextRows { file, layout: &layout };
    inspect_rows(&rows, layout.head(path), facts, map)
}

fn inspect_rows(
    rows: &dyn Rows,
    head: TableHead<'_>,
    facts: FileFacts<'_>,
    map: Option<&ColumnMap>,
) -> Result<Inspection, RecordError> {
    let mut scan = Scan::new(head.names.len().min(MAX_COLUMNS));
    let read = rows.for_each(&mut |_, row| scan.push(row))?;
    let chosen = candidates::choose_columns(head, &scan, &read, map);
    let mut times = Vec::new();
    let mut offsets = Vec::new();
    let mut curves = ThinnedCurves::new(scan.rows);
    let mut alternating = candidates::Alternation::default();
    rows.for_each(&mut |offset, row| {
        let [time_s, position_m, force_n] = chosen.values(row, times.len());
        times.push(time_s);
        offsets.push(offset);
        alternating.push(position_m, force_n);
        curves.push(time_s, position_m, force_n);
    })?;
    let line = |row: usize| rows.lines(&[*offsets.get(row)?]).ok()?.first().copied();
    let sampling = sampling::sampling(&times, chosen.time_unit_s(), line)
        .filter(|_| chosen.has_time())
        .map(|sampling| super::Sampling { alternating: alternating.found(), ..sampling });
    drop(times);
    let findings = findings::findings(&facts, head, &scan, &read, &chosen, sampling.as_ref(), rows)?;
    let columns = head
        .names
        .iter()
        .enumerate()
        .map(|(at, name)| {
            let unit = crate::columns::unit_of(head, at);
            let column = scan.columns.get(at);
            InspectedColumn {
                number: at + 1,
                name: name.clone(),
                unit: unit.map(|unit| unit.symbol.to_owned()),
                to_si: unit.map(|unit| unit.to_si),
                dimension: unit.map(|unit| unit.dimension),
                kind: head.kinds.get(at).copied().unwrap_or(ColumnKind::Number),
                values: column.map_or(0, |c| c.values),
                missing: column.map_or(0, |c| c.missing),
                range: column.filter(|c| c.values > 0).map(|c| (c.min, c.max)),
            }
        })
        .collect();
    let map_needed =
        chosen.map_needed || findings.iter().any(|f| f.obstacle && matches!(f.kind, "columns" | "time"));
    Ok(Inspection {
        path: facts.path.to_owned(),
        format: facts.format,
        bytes: facts.bytes,
        text: facts.text,
        rows: scan.rows,
        columns,
        map: chosen.map,
        map_needed,
        candidates: chosen.candidates,
        sampling,
        findings,
        curves: curves.finish(),
    })
}
