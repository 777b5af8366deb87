//! Check of old Excel files (xls) before the spreadsheet library reads them.
//!
//! The library allocates the rectangle around all cells, and the size that a sheet declares, when it opens a file; one damaged cell
//! number then asks for hundreds of GB, which ends the program. Records as in \[MS-XLS\], container as in \[MS-CFB\].

use crate::memory_limit;
use std::io::{self, Cursor, Read, Write};

/// Most rows and columns of a sheet in this format.
const MAX_ROWS: u64 = 65_536;
const MAX_COLUMNS: u64 = 256;

/// Memory of a cell in bytes: as parsed, in the rectangle, in its copy.
const CELL_BYTES: u64 = 96;

// Types of records.
const FORMULA: u16 = 0x0006;
const END: u16 = 0x000A;
const SHEET: u16 = 0x0085;
const SEVERAL_NUMBERS: u16 = 0x00BD;
const FORMATTED_STRING: u16 = 0x00D6;
const SHARED_STRING: u16 = 0x00FD;
const DIMENSIONS: u16 = 0x0200;
const NUMBER: u16 = 0x0203;
const LABEL: u16 = 0x0204;
const BOOLEAN: u16 = 0x0205;
const SHORT_NUMBER: u16 = 0x027E;
const BEGIN: u16 = 0x0809;

/// The workbook of a file in a new container, with sheets whose cells fit into the format and the memory limit.
pub(super) fn checked(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut workbook = read_workbook(bytes).map_err(|e| format!("it is damaged ({e})"))?;
    check_sheets(&mut workbook)?;
    in_new_container(&workbook).map_err(|e| e.to_string())
}

fn read_workbook(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut file = cfb::CompoundFile::open(Cursor::new(bytes))?;
    // Excel 5 and 95 call it "Book".
    let name = if file.is_stream("/Workbook") { "/Workbook" } else { "/Book" };
    let mut workbook = Vec::new();
    file.open_stream(name)?.read_to_end(&mut workbook)?;
    Ok(workbook)
}

fn in_new_container(workbook: &[u8]) -> io::Result<Vec<u8>> {
    // The spreadsheet library takes a file of version 4 without short streams for an empty one.
    let mut file = cfb::CompoundFile::create_with_version(cfb::Version::V3, Cursor::new(Vec::new()))?;
    file.create_stream("/Workbook")?.write_all(workbook)?;
    file.flush()?;
    Ok(file.into_inner().into_inner())
}

/// Checks the extent of all sheets and clears the sizes that they declare, which are only hints.
fn check_sheets(workbook: &mut [u8]) -> Result<(), String> {
    let starts: Vec<usize> = records(workbook, 0)
        .take_while(|record| record.kind != END)
        .filter(|record| record.kind == SHEET)
        .filter_map(|record| {
            Some(u32::from_le_bytes(workbook.get(record.from..record.from + 4)?.try_into().ok()?) as usize)
        })
        .collect();
    let mut cells = 0_u64;
    for start in starts {
        let (mut first, mut last) = ((u64::MAX, u64::MAX), (0, 0));
        let mut hints = Vec::new();
        // Charts inside a sheet have a beginning and an end of their own.
        let mut depth = 0_u32;
        for record in records(workbook, start) {
            let number = |at: usize| Some(u64::from(u16_at(workbook.get(record.from..record.to)?, at)?));
            match record.kind {
                BEGIN => depth += 1,
                END if depth <= 1 => break,
                END => depth -= 1,
                DIMENSIONS => hints.push(record.from..record.to),
                FORMULA | NUMBER | LABEL | BOOLEAN | SHORT_NUMBER | SHARED_STRING | FORMATTED_STRING
                | SEVERAL_NUMBERS => {
                    let (Some(row), Some(column)) = (number(0), number(2)) else { continue };
                    let width =
                        if record.kind == SEVERAL_NUMBERS { (record.to - record.from) as u64 / 6 } else { 1 };
                    first = (first.0.min(row), first.1.min(column));
                    last = (last.0.max(row + 1), last.1.max(column + width));
                }
                _ => {}
            }
        }
        for hint in hints {
            workbook[hint].fill(0);
        }
        let count = last.0.saturating_sub(first.0) * last.1.saturating_sub(first.1);
        if count > MAX_ROWS * MAX_COLUMNS {
            return Err(format!("it is damaged: a sheet of {} rows and {} columns", last.0, last.1));
        }
        cells += count;
    }
    memory_limit::check(&format!("its sheets of {cells} cells"), cells * CELL_BYTES)
}

/// A record of the workbook and the place of its data.
struct Record {
    kind: u16,
    from: usize,
    to: usize,
}

/// The records from a place on, up to one that is cut.
fn records(workbook: &[u8], start: usize) -> impl Iterator<Item = Record> {
    let mut at = start;
    std::iter::from_fn(move || {
        let head = workbook.get(at..)?;
        let (kind, length) = (u16_at(head, 0)?, u16_at(head, 2)?);
        let from = at + 4;
        at = from + usize::from(length);
        (at <= workbook.len()).then_some(Record { kind, from, to: at })
    })
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(kind: u16, data: &[u8]) -> Vec<u8> {
        [&kind.to_le_bytes()[..], &(data.len() as u16).to_le_bytes(), data].concat()
    }

    /// A workbook with one sheet of two numbers, at (0, 0) and at `row`, `column`.
    fn workbook(row: u16, column: u16) -> Vec<u8> {
        let number = |row: u16, column: u16| {
            record(NUMBER, &[&row.to_le_bytes()[..], &column.to_le_bytes(), &[0; 10]].concat())
        };
        let head = |start: u32| {
            [record(SHEET, &[&start.to_le_bytes()[..], &[0; 4]].concat()), record(END, &[])].concat()
        };
        let declared = record(DIMENSIONS, &[0, 0, 0, 0, 255, 255, 255, 255, 0, 0, 255, 255, 0, 0]);
        let start = head(0).len() as u32;
        [head(start), record(BEGIN, &[0; 4]), declared, number(0, 0), number(row, column), record(END, &[])]
            .concat()
    }

    #[test]
    fn a_sheet_as_large_as_the_format_allows_passes_and_its_declared_size_is_cleared() {
        let mut sound = workbook(65_535, 255);
        check_sheets(&mut sound).expect("sound");
        assert!(
            records(&sound, 20)
                .filter(|r| r.kind == DIMENSIONS)
                .all(|r| sound[r.from..r.to].iter().all(|b| *b == 0))
        );
    }

    #[test]
    fn a_cell_far_outside_is_refused() {
        let error = check_sheets(&mut workbook(60_000, 40_000)).expect_err("damaged");
        assert!(error.contains("60001 rows and 40001 columns"), "{error}");
    }

    #[test]
    fn a_workbook_survives_the_change_of_its_container_and_a_cut_file_is_refused() {
        let whole = include_bytes!("../../tests/foreign/machine.xls");
        let checked = checked(whole).expect("sound");
        assert_eq!(read_workbook(&checked).expect("sound").len(), read_workbook(whole).expect("sound").len());
        assert!(super::checked(&whole[..600]).is_err());
    }
}
