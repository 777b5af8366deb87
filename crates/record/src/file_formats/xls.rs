//! Check of old Excel files (xls) before the spreadsheet library reads them.
//!
//! The library allocates the rectangle around all cells, and the size that a sheet declares, when it opens a file; one damaged cell
//! number then asks for hundreds of GB, which ends the program. Records as in \[MS-XLS\], container as in \[MS-CFB\].

use crate::memory_limit;
use std::io::{self, Cursor, Read, Write};

/// Most rows and columns of a sheet in this format.
const MAX_ROWS: u64 = 65_536;
const MAX_COLUMNS: u64 = 256;

/// Memory of a cell in bytes: as parsed into a list that grows, in the rectangle, in its copy, and the same for formulas.
const CELL_BYTES: u64 = 256;

// Types of records.
const FORMULA: u16 = 0x0006;
const END: u16 = 0x000A;
const PASSWORD: u16 = 0x002F;
const SHEET: u16 = 0x0085;
const SEVERAL_NUMBERS: u16 = 0x00BD;
const FORMATTED_STRING: u16 = 0x00D6;
const SHARED_STRING: u16 = 0x00FD;
const DIMENSIONS: u16 = 0x0200;
const NUMBER: u16 = 0x0203;
const LABEL: u16 = 0x0204;
const BOOLEAN: u16 = 0x0205;
/// The text that the formula before it gives.
const STRING: u16 = 0x0207;
const SHORT_NUMBER: u16 = 0x027E;
const BEGIN: u16 = 0x0809;

/// What to do with a file that cannot be read.
const REMEDY: &str = "save it as xlsx, ods or CSV";

/// The workbook of a file in a new container, with sheets whose cells fit into the format and the memory limit.
pub(super) fn checked(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let damaged = |e: io::Error| format!("it is damaged ({e}); {REMEDY}");
    let mut file = cfb::CompoundFile::open(Cursor::new(bytes)).map_err(damaged)?;
    if file.is_stream("/EncryptedPackage") {
        return Err(PROTECTED.to_owned());
    }
    // Excel 5 and 95 call it "Book".
    let name = ["/Workbook", "/Book"].into_iter().find(|name| file.is_stream(name));
    let name = name.ok_or_else(|| format!("it holds no spreadsheet; {REMEDY}"))?;
    let mut workbook = Vec::new();
    file.open_stream(name).and_then(|mut stream| stream.read_to_end(&mut workbook)).map_err(damaged)?;
    check_sheets(&mut workbook)?;
    in_new_container(&workbook).map_err(damaged)
}

const PROTECTED: &str = "it is protected by a password; save it without one";

fn in_new_container(workbook: &[u8]) -> io::Result<Vec<u8>> {
    // The spreadsheet library takes a file of version 4 without short streams for an empty one.
    let mut file = cfb::CompoundFile::create_with_version(cfb::Version::V3, Cursor::new(Vec::new()))?;
    file.create_stream("/Workbook")?.write_all(workbook)?;
    file.flush()?;
    Ok(file.into_inner().into_inner())
}

/// Clears the sizes that the sheets declare, which are only hints, and checks the extent of their cells.
fn check_sheets(workbook: &mut [u8]) -> Result<(), String> {
    let globals: Vec<Record> = records(workbook, 0).take_while(|record| record.kind != END).collect();
    if globals.iter().any(|record| record.kind == PASSWORD) {
        return Err(PROTECTED.to_owned());
    }
    let start = |record: &Record| {
        Some(u32::from_le_bytes(workbook.get(record.from..record.from + 4)?.try_into().ok()?) as usize)
    };
    let starts: Vec<usize> = globals.iter().filter(|r| r.kind == SHEET).filter_map(start).collect();
    for start in &starts {
        let hints: Vec<Record> =
            sheet_records(workbook, *start).into_iter().filter(|r| r.kind == DIMENSIONS).collect();
        for hint in hints {
            // Other lengths are refused by the library, too.
            if !matches!(hint.to - hint.from, 10 | 14 | 16) {
                return Err(format!("it is damaged (size of a sheet); {REMEDY}"));
            }
            workbook[hint.from..hint.to].fill(0);
        }
    }
    let mut cells = 0_u64;
    for start in starts {
        let extent = Extent::of(workbook, &sheet_records(workbook, start))
            .ok_or_else(|| format!("it is damaged (sheets overlap); {REMEDY}"))?;
        let (rows, columns) = extent.size();
        if rows.saturating_mul(columns) > MAX_ROWS * MAX_COLUMNS {
            return Err(format!("it is damaged (a sheet of {rows} rows and {columns} columns); {REMEDY}"));
        }
        cells += rows * columns;
    }
    memory_limit::check(&format!("its sheets of {cells} cells"), cells.saturating_mul(CELL_BYTES))
}

/// The smallest rectangle around all cells of a sheet: its first cell, and one past its last.
struct Extent {
    first: (u64, u64),
    last: (u64, u64),
}

impl Extent {
    /// `None` if the records hold a declared size.
    fn of(workbook: &[u8], records: &[Record]) -> Option<Self> {
        let mut extent = Self { first: (u64::MAX, u64::MAX), last: (0, 0) };
        let mut formula = (0, 0);
        for record in records {
            let data = workbook.get(record.from..record.to)?;
            let cell =
                u16_at(data, 0).zip(u16_at(data, 2)).map(|(row, column)| (u64::from(row), u64::from(column)));
            match (record.kind, cell) {
                (DIMENSIONS, _) if data.iter().any(|byte| *byte != 0) => return None,
                (STRING, _) => extent.add(formula, 1),
                (FORMULA, Some(cell)) => {
                    formula = cell;
                    extent.add(cell, 1);
                }
                // Row, first column, six bytes for each number, last column.
                (SEVERAL_NUMBERS, Some(cell)) => extent.add(cell, (data.len() as u64).saturating_sub(6) / 6),
                (NUMBER | LABEL | BOOLEAN | SHORT_NUMBER | SHARED_STRING | FORMATTED_STRING, Some(cell)) => {
                    extent.add(cell, 1)
                }
                _ => {}
            }
        }
        Some(extent)
    }

    fn add(&mut self, (row, column): (u64, u64), width: u64) {
        self.first = (self.first.0.min(row), self.first.1.min(column));
        self.last = (self.last.0.max(row + 1), self.last.1.max(column + width));
    }

    /// Rows and columns.
    fn size(&self) -> (u64, u64) {
        (self.last.0.saturating_sub(self.first.0), self.last.1.saturating_sub(self.first.1))
    }
}

/// The records of a sheet that begins at `start`, without those of charts inside it, which have a beginning and an end of their own.
fn sheet_records(workbook: &[u8], start: usize) -> Vec<Record> {
    let mut depth = 0_u32;
    let mut out = Vec::new();
    for record in records(workbook, start) {
        match record.kind {
            BEGIN => depth += 1,
            END if depth <= 1 => break,
            END => depth -= 1,
            _ if depth <= 1 => out.push(record),
            _ => {}
        }
    }
    out
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

    /// Place of the sheet in [`workbook`].
    const START: usize = 16;

    /// A workbook with one sheet of two numbers, at (0, 0) and at `row`, `column`.
    fn workbook(row: u16, column: u16) -> Vec<u8> {
        let number = |row: u16, column: u16| {
            record(NUMBER, &[&row.to_le_bytes()[..], &column.to_le_bytes(), &[0; 10]].concat())
        };
        let head = [record(SHEET, &[&(START as u32).to_le_bytes()[..], &[0; 4]].concat()), record(END, &[])]
            .concat();
        assert_eq!(head.len(), START);
        let declared = record(DIMENSIONS, &[0, 0, 0, 0, 255, 255, 255, 255, 0, 0, 255, 255, 0, 0]);
        [head, record(BEGIN, &[0; 4]), declared, number(0, 0), number(row, column), record(END, &[])].concat()
    }

    #[test]
    fn a_sheet_as_large_as_the_format_allows_passes_and_its_declared_size_is_cleared() {
        let mut sound = workbook(65_535, 255);
        check_sheets(&mut sound).expect("sound");
        let declared = records(&sound, START).find(|r| r.kind == DIMENSIONS).expect("a declared size");
        assert!(sound[declared.from..declared.to].iter().all(|byte| *byte == 0));
    }

    #[test]
    fn a_cell_far_outside_is_refused() {
        let error = check_sheets(&mut workbook(60_000, 40_000)).expect_err("damaged");
        assert!(error.contains("60001 rows and 40001 columns"), "{error}");
        // A text without a formula before it is at the first cell.
        let mut one = workbook(60_000, 40_000);
        let first = records(&one, START).find(|r| r.kind == NUMBER).expect("a number").from - 4;
        one[first..first + 2].copy_from_slice(&STRING.to_le_bytes());
        check_sheets(&mut one).expect_err("damaged");
    }

    #[test]
    fn a_protected_workbook_is_refused_as_such() {
        let protected = [record(PASSWORD, &[1, 0, 1, 0]), workbook(0, 0)].concat();
        let error = check_sheets(&mut protected.clone()).expect_err("protected");
        assert!(error.contains("password"), "{error}");
    }

    #[test]
    fn numbers_in_one_record_up_to_the_last_column_pass() {
        let row = [&[0_u8; 2][..], &[0; 2], &[0; 6 * 256], &255_u16.to_le_bytes()].concat();
        let data = record(SEVERAL_NUMBERS, &row);
        let extent = Extent::of(&data, &records(&data, 0).collect::<Vec<_>>()).expect("no declared size");
        assert_eq!(extent.size(), (1, 256));
    }

    #[test]
    fn a_workbook_has_the_same_cells_in_its_new_container_and_a_cut_file_is_refused() {
        let whole = include_bytes!("../../tests/foreign/machine.xls");
        let checked = checked(whole).expect("sound");
        let text = |bytes: &[u8]| super::super::spreadsheet::to_text(bytes, None).expect("a sheet");
        assert!(!text(whole).is_empty());
        assert_eq!(text(&checked), text(whole));
        let error = super::checked(&whole[..600]).expect_err("cut");
        assert!(error.ends_with(REMEDY), "{error}");
    }
}
