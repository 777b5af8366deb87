//! Spreadsheets: xlsx, xls, ods, as the text table that their program would export.

use crate::memory_limit;
use calamine::{Data, Range, Reader, Sheets, Xls, Xlsx, open_workbook_auto_from_rs};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Cursor;

/// Most cells of a sheet; a damaged file may announce any number.
const MAX_CELLS: usize = 200_000_000;

/// Memory of a cell in bytes, with its text.
const CELL_BYTES: u64 = 48;

/// A sheet as text, one line per row, columns separated by tabs. Without a name the sheet with most numbers is taken.
pub(super) fn to_text(bytes: &[u8], sheet: Option<&str>) -> Result<Vec<u8>, String> {
    let unreadable = |e: calamine::Error| format!("it cannot be read ({e}); save it as xlsx, ods or CSV");
    let mut book = if bytes.starts_with(b"PK") {
        open_workbook_auto_from_rs(Cursor::new(Cow::Borrowed(bytes))).map_err(unreadable)?
    } else {
        let checked = Cursor::new(Cow::Owned(super::xls::checked(bytes)?));
        Sheets::Xls(Xls::new(checked).map_err(|e| unreadable(e.into()))?)
    };
    let names = book.sheet_names();
    let list = || names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    if let Sheets::Xlsx(book) = &mut book {
        for name in names.iter().filter(|name| sheet.is_none_or(|wanted| wanted == *name)) {
            check_extent(book, name)?;
        }
    }
    let range = match sheet {
        Some(name) if !names.iter().any(|existing| existing == name) => {
            return Err(format!("it has no sheet \"{name}\"; it has {}", list()));
        }
        Some(name) => {
            book.worksheet_range(name).map_err(|e| format!("the sheet \"{name}\" cannot be read ({e})"))?
        }
        None => {
            let mut best: Option<(usize, Range<Data>)> = None;
            for name in &names {
                let Ok(range) = book.worksheet_range(name) else { continue };
                let count = range
                    .used_cells()
                    .filter(|(_, _, cell)| matches!(cell, Data::Float(_) | Data::Int(_)))
                    .count();
                if best.as_ref().is_none_or(|(most, _)| count > *most) {
                    best = Some((count, range));
                }
            }
            best.map(|(_, range)| range).ok_or_else(|| "it has no sheet that can be read".to_owned())?
        }
    };
    let Some((first_row, _)) = range.start() else { return Ok(Vec::new()) };
    let (height, width) = range.get_size();
    if height.saturating_mul(width) > MAX_CELLS {
        return Err(format!(
            "the sheet has {height} rows of {width} cells; at most {MAX_CELLS} cells are read"
        ));
    }
    // Lines have the numbers of the rows.
    let mut text = "\n".repeat(first_row as usize);
    for row in range.rows() {
        // An empty row is an empty line, however wide the sheet is.
        if row.iter().any(|cell| !matches!(cell, Data::Empty)) {
            for (at, cell) in row.iter().enumerate() {
                if at > 0 {
                    text.push('\t');
                }
                write_cell(&mut text, cell);
            }
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}

/// Compares the rectangle around the cells of a sheet, which is allocated as a whole, with the limit on memory: two distant cells make it
/// any size.
fn check_extent(book: &mut Xlsx<Cursor<Cow<'_, [u8]>>>, name: &str) -> Result<(), String> {
    let Ok(mut cells) = book.worksheet_cells_reader(name) else { return Ok(()) };
    let (mut first, mut last) = ((u32::MAX, u32::MAX), (0, 0));
    while let Ok(Some(cell)) = cells.next_cell() {
        let (row, column) = cell.get_position();
        first = (first.0.min(row), first.1.min(column));
        last = (last.0.max(row), last.1.max(column));
    }
    let length = |first: u32, last: u32| u64::from(last.saturating_sub(first)) + 1;
    let count = length(first.0, last.0).saturating_mul(length(first.1, last.1));
    memory_limit::check(&format!("the sheet \"{name}\" of {count} cells"), count.saturating_mul(CELL_BYTES))
}

fn write_cell(text: &mut String, cell: &Data) {
    match cell {
        Data::Float(x) => {
            let _ = write!(text, "{x}");
        }
        Data::Int(x) => {
            let _ = write!(text, "{x}");
        }
        Data::Bool(x) => text.push(if *x { '1' } else { '0' }),
        // Days since 1899-12-30, as seconds; differences are what counts.
        Data::DateTime(x) => {
            let _ = write!(text, "{}", x.as_f64() * 86_400.0);
        }
        Data::String(s) | Data::DateTimeIso(s) | Data::DurationIso(s) => {
            let clean: String =
                s.chars().map(|c| if matches!(c, '\t' | '\n' | '\r') { ' ' } else { c }).collect();
            if clean.contains('"') {
                let _ = write!(text, "\"{}\"", clean.replace('"', "\"\""));
            } else {
                text.push_str(&clean);
            }
        }
        Data::Error(_) | Data::Empty => {}
        #[allow(unreachable_patterns)] // calamine may add kinds
        _ => {}
    }
}
