//! Recordings of any length in little memory: the CSV file is read once, its numbers wait on disk in the folder that is named.
//!
//! What is read, what is refused and what is said are those of [`read_csv`](crate::read_csv): rows, column map, repair, velocity and
//! checks are the same code, which goes through blocks of samples. Disk: 8 bytes per sample and column, twice for a moment when rows
//! are dropped; the files have no names and are gone with their owner.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::csv_header::{ColumnRole, CsvLayout, joint_torque_name, read_layout};
use crate::csv_reader::{
    ReadOptions, SourceFile, TextSource, Utf8Check, check_sample_count, header_start, read_rows,
};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, SlopeFilter};
use crate::disk_table::{BLOCK_ROWS, DiskTable, DiskTableWriter, ExternalSort};
use crate::error::RecordError;
use crate::file_formats::FileFormat;
use crate::quality::{QualityNote, assess_stream, repaired_rows};
use crate::recording::Sample;
use crate::sample_stream::{Quantity, SampleStream, SortedValues};
use crate::timestamp_repair::rows_to_drop;

/// The beginning of a file, in which its header has to end.
const HEAD: u64 = 1 << 16;
/// Rows whose time stamps may be out of order together: what `--repair` holds in memory.
const MOST_DISORDER: usize = 1 << 20;

/// A recording on disk. Values are finite and time increases, as in [`Recording`](crate::Recording).
#[derive(Debug)]
pub struct LongRecording {
    /// One column per role, then where each row begins in the file.
    table: DiskTable,
    roles: Vec<ColumnRole>,
    /// Differentiated, where none was measured.
    velocity: Option<DiskTable>,
    folder: PathBuf,
    /// Lines of rows whose time stamps did not increase.
    dropped_lines: Vec<u64>,
}

/// Reads a recording from a CSV file as [`read_csv`](crate::read_csv) does, into `folder` instead of memory. `None`: the file is not
/// one that can be read piece by piece (no plain file, of another program, a header beyond 64 KB), and nothing was done.
///
/// # Errors
/// Those of [`read_csv`](crate::read_csv), [`RecordError::Scratch`] when the folder does not take the numbers, and
/// [`RecordError::DisorderTooLong`] when over 2^20 rows were to be repaired together.
pub fn read_long_csv(
    path: &Path,
    options: &ReadOptions,
    folder: &Path,
) -> Result<Option<(LongRecording, Vec<QualityNote>)>, RecordError> {
    let Some(recording) = LongRecording::read(path, options, folder)? else { return Ok(None) };
    let notes = recording.assess()?;
    Ok(Some((recording, notes)))
}

/// Whether the header's line ends here and takes no following lines along.
fn is_whole(text: &[u8]) -> bool {
    let end = text.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
    end.is_some_and(|end| text[..end].iter().filter(|byte| **byte == b'"').count().is_multiple_of(2))
}

fn check_text_of(place: &SourceFile<'_>) -> Result<(), RecordError> {
    let mut text = place.text.reader_at(0).map_err(|source| place.unreadable(source))?;
    let mut check = Utf8Check::default();
    let mut chunk = vec![0; 1 << 18];
    loop {
        match text.read(&mut chunk).map_err(|source| place.unreadable(source))? {
            0 => return check.finish().map_err(|bad| bad.into_error(place)),
            count => check.push(&chunk[..count]).map_err(|bad| bad.into_error(place))?,
        }
    }
}

/// The table without the rows whose time stamps do not increase, and their lines.
fn repaired(
    table: DiskTable,
    place: &SourceFile<'_>,
    folder: &Path,
) -> Result<(DiskTable, Vec<u64>), RecordError> {
    let scratch = |source| RecordError::TemporaryFile { path: folder.to_owned(), source };
    let offset_column = table.columns() - 1;
    let times = |take: &mut dyn FnMut(&[f64])| {
        let (mut block, mut bytes) = (Vec::new(), Vec::new());
        for number in 0..table.block_count() {
            table.read_block(number, 0, &mut block, &mut bytes)?;
            take(&block);
        }
        Ok(())
    };
    let dropped = match rows_to_drop(times, MOST_DISORDER).map_err(scratch)? {
        Ok(dropped) if dropped.is_empty() => return Ok((table, Vec::new())),
        Ok(dropped) => dropped,
        Err(row) => {
            let line = place.line_of_row(table.value(offset_column, row).map_err(scratch)? as usize)?;
            return Err(RecordError::DisorderTooLong { path: place.path(), line, rows: MOST_DISORDER });
        }
    };
    let mut left = DiskTableWriter::new(folder, table.columns()).map_err(scratch)?;
    let (mut row, mut next, mut offsets) = (0, dropped.iter().peekable(), Vec::new());
    let moved = table.for_each_row(|numbers| -> io::Result<()> {
        let drop = next.next_if(|dropped| **dropped == row).is_some();
        row += 1;
        if drop {
            offsets.push(numbers[offset_column] as usize);
            return Ok(());
        }
        left.push(numbers)
    });
    moved.map_err(scratch)?;
    let lines = place.lines_of_offsets(offsets.into_iter())?;
    Ok((left.finish().map_err(scratch)?, lines))
}

impl LongRecording {
    /// The reading alone; [`LongRecording::assess`] tells what is remarkable.
    ///
    /// # Errors
    /// Those of [`read_long_csv`].
    pub fn read(path: &Path, options: &ReadOptions, folder: &Path) -> Result<Option<Self>, RecordError> {
        let unreadable = |source: io::Error| match source.kind() {
            io::ErrorKind::NotFound => RecordError::NoSuchFile { path: path.to_owned() },
            _ => RecordError::Unreadable { path: path.to_owned(), source },
        };
        let file = File::open(path).map_err(unreadable)?;
        if !file.metadata().map_err(unreadable)?.is_file() {
            return Ok(None);
        }
        let mut head = Vec::new();
        (&file).take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
        let Some(header) = header_start(&head).filter(|header| is_whole(&head[*header..])) else {
            return Ok(None);
        };
        if FileFormat::detect(&head).is_some() {
            return Ok(None);
        }
        if let Some(map) = &options.columns {
            map.check()?;
        }
        let place = SourceFile { text: TextSource::File(&file), path, header };
        check_text_of(&place)?;
        let layout =
            read_layout(&head[header..], path, place.line_of_row(header)?, options.columns.as_ref())?;
        drop(head);
        let scratch = |source| RecordError::TemporaryFile { path: folder.to_owned(), source };
        let mut writer = DiskTableWriter::new(folder, layout.columns.len() + 1).map_err(scratch)?;
        let mut row = Vec::new();
        read_rows(&place, &layout, !options.repair, |offset, numbers| {
            row.clear();
            row.extend_from_slice(numbers);
            // A double holds every offset below 2^53.
            row.push(offset as f64);
            writer.push(&row).map_err(scratch)
        })?;
        let table = writer.finish().map_err(scratch)?;
        let (table, dropped_lines) = match options.repair {
            true => repaired(table, &place, folder)?,
            false => (table, Vec::new()),
        };
        Ok(Some(Self { dropped_lines, ..Self::new(table, &place, &layout, folder)? }))
    }

    /// What is remarkable about the recording, as [`assess`](crate::assess) tells it, preceded by the repaired rows.
    ///
    /// # Errors
    /// [`RecordError::Scratch`].
    pub fn assess(&self) -> Result<Vec<QualityNote>, RecordError> {
        let mut notes = assess_stream(self)?;
        if !self.dropped_lines.is_empty() {
            notes.insert(0, repaired_rows(self.dropped_lines.clone(), self.len()));
        }
        Ok(notes)
    }

    fn new(
        table: DiskTable,
        place: &SourceFile<'_>,
        layout: &CsvLayout,
        folder: &Path,
    ) -> Result<Self, RecordError> {
        let roles: Vec<ColumnRole> = layout.columns.iter().map(|source| source.role).collect();
        let offset_column = roles.len();
        let mut recording =
            Self { table, roles, velocity: None, folder: folder.to_owned(), dropped_lines: Vec::new() };
        let last = match recording.table.rows().checked_sub(1) {
            Some(last) => {
                Some(recording.table.value(offset_column, last).map_err(|e| recording.scratch(e))? as usize)
            }
            None => None,
        };
        check_sample_count(place, recording.len(), last)?;
        if !recording.velocity_measured() {
            let (velocity, bad) = recording.differentiated()?;
            if let Some(row) = bad {
                let offset = recording.table.value(offset_column, row).map_err(|e| recording.scratch(e))?;
                return Err(RecordError::VelocityNotFinite {
                    path: place.path(),
                    line: place.line_of_row(offset as usize)?,
                });
            }
            recording.velocity = Some(velocity);
        }
        Ok(recording)
    }

    /// The slope of the position, and the first sample where it is no number.
    fn differentiated(&self) -> Result<(DiskTable, Option<usize>), RecordError> {
        let mut writer = DiskTableWriter::new(&self.folder, 1).map_err(|e| self.scratch(e))?;
        let (mut sample, mut bad, mut written) = (0, None, Ok(()));
        let mut tell = |slope: f64| {
            if !slope.is_finite() {
                bad.get_or_insert(sample);
            }
            sample += 1;
            if written.is_ok() {
                written = writer.push(&[slope]);
            }
        };
        let mut slopes = SlopeFilter::new(DEFAULT_HALF_WIDTH_S);
        self.for_each_block([Quantity::Time, Quantity::Position], |[time_s, position_m]| {
            for (time_s, position_m) in time_s.iter().zip(position_m) {
                slopes.push(*time_s, *position_m, &mut tell);
            }
        })?;
        slopes.finish(tell);
        let finished = written.and_then(|()| writer.finish());
        Ok((finished.map_err(|e| self.scratch(e))?, bad))
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.table.rows()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// From the first to the last sample (s).
    ///
    /// # Errors
    /// [`RecordError::Scratch`].
    pub fn duration_s(&self) -> Result<f64, RecordError> {
        SampleStream::duration_s(self)
    }

    /// Typical sampling rate (Hz): the inverse of the median interval.
    ///
    /// # Errors
    /// [`RecordError::Scratch`].
    pub fn sample_hz(&self) -> Result<f64, RecordError> {
        Ok(1.0 / self.median_interval_s()?)
    }

    /// Names of the columns that [`write_csv`](crate::write_csv) would write.
    #[must_use]
    pub fn column_names(&self) -> Vec<String> {
        let name = |role| match role {
            ColumnRole::Time => "time_s".to_owned(),
            ColumnRole::Position => "position_m".to_owned(),
            ColumnRole::Force => "force_n".to_owned(),
            ColumnRole::Velocity => "velocity_mps".to_owned(),
            ColumnRole::ForceVirtual => "force_virtual_n".to_owned(),
            ColumnRole::JointTorque(joint) => joint_torque_name(joint),
        };
        self.in_order().into_iter().map(|column| name(self.roles[column])).collect()
    }

    /// The columns as they are written.
    fn in_order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.roles.len()).collect();
        order.sort_by_key(|column| match self.roles[*column] {
            ColumnRole::Time => 0,
            ColumnRole::Position => 1,
            ColumnRole::Force => 2,
            ColumnRole::Velocity => 3,
            ColumnRole::ForceVirtual => 4,
            ColumnRole::JointTorque(joint) => 5 + joint,
        });
        order
    }

    /// Hands over every sample, with its row under [`LongRecording::names`].
    ///
    /// # Errors
    /// [`RecordError::Scratch`], and what `each` says.
    pub fn for_each_sample<E: From<RecordError>>(
        &self,
        mut each: impl FnMut(Sample, &[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let columns = self.in_order();
        let mut held = vec![Vec::new(); columns.len()];
        let (mut row, mut velocity_mps, mut bytes) = (vec![0.0; columns.len()], Vec::new(), Vec::new());
        for block in 0..self.table.block_count() {
            for (held, column) in held.iter_mut().zip(&columns) {
                self.table.read_block(block, *column, held, &mut bytes).map_err(|e| self.scratch(e))?;
            }
            self.read_block(block, Quantity::Velocity, &mut velocity_mps, &mut bytes)?;
            for (at, velocity_mps) in velocity_mps.iter().enumerate() {
                row.iter_mut().zip(&held).for_each(|(x, held)| *x = held[at]);
                let [time_s, position_m, force_n, ..] = row[..] else { continue };
                each(Sample { time_s, position_m, velocity_mps: *velocity_mps, force_n }, &row)?;
            }
        }
        Ok(())
    }

    /// Time (s) of the first sample at this position or further in.
    ///
    /// # Errors
    /// [`RecordError::Scratch`].
    pub fn first_time_beyond_s(&self, position_m: f64) -> Result<Option<f64>, RecordError> {
        let mut found = None;
        self.for_each_block([Quantity::Time, Quantity::Position], |[time_s, at_m]| {
            if found.is_none() {
                found = at_m.iter().position(|z| *z >= position_m).map(|at| time_s[at]);
            }
        })?;
        Ok(found)
    }

    /// The folder that the numbers are in.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn scratch(&self, source: io::Error) -> RecordError {
        RecordError::TemporaryFile { path: self.folder.clone(), source }
    }

    fn place_of(&self, which: Quantity) -> (&DiskTable, usize) {
        let role = match which {
            Quantity::Time => ColumnRole::Time,
            Quantity::Position => ColumnRole::Position,
            Quantity::Force => ColumnRole::Force,
            Quantity::Velocity => ColumnRole::Velocity,
        };
        match (&self.velocity, which) {
            (Some(velocity), Quantity::Velocity) => (velocity, 0),
            // Time, position and force are always there.
            _ => (&self.table, self.roles.iter().position(|r| *r == role).unwrap_or(0)),
        }
    }

    fn read_block(
        &self,
        block: usize,
        which: Quantity,
        into: &mut Vec<f64>,
        bytes: &mut Vec<u8>,
    ) -> Result<(), RecordError> {
        let (table, column) = self.place_of(which);
        table.read_block(block, column, into, bytes).map_err(|e| self.scratch(e))
    }
}

impl SampleStream for LongRecording {
    type Error = RecordError;
    type Sorted = KeptOnDisk;

    fn len(&self) -> usize {
        self.table.rows()
    }

    fn velocity_measured(&self) -> bool {
        self.roles.contains(&ColumnRole::Velocity)
    }

    fn for_each_block<const N: usize>(
        &self,
        which: [Quantity; N],
        mut each: impl FnMut([&[f64]; N]),
    ) -> Result<(), RecordError> {
        let mut held: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(BLOCK_ROWS));
        let mut bytes = Vec::new();
        for block in 0..self.table.block_count() {
            for (held, which) in held.iter_mut().zip(which) {
                self.read_block(block, which, held, &mut bytes)?;
            }
            each(std::array::from_fn(|at| held[at].as_slice()));
        }
        Ok(())
    }

    fn at(&self, which: Quantity, sample: usize) -> Result<f64, RecordError> {
        let (table, column) = self.place_of(which);
        table.value(column, sample).map_err(|e| self.scratch(e))
    }

    fn sorted_values(
        &self,
        fill: impl FnOnce(&mut dyn FnMut(f64)) -> Result<(), RecordError>,
    ) -> Result<KeptOnDisk, RecordError> {
        let mut sorting = ExternalSort::new(&self.folder).map_err(|e| self.scratch(e))?;
        let mut written = Ok(());
        fill(&mut |x| {
            if written.is_ok() {
                written = sorting.push(x);
            }
        })?;
        let table = written.and_then(|()| sorting.finish()).map_err(|e| self.scratch(e))?;
        Ok(KeptOnDisk { table, folder: self.folder.clone() })
    }
}

/// Numbers in a table of one column.
pub(crate) struct KeptOnDisk {
    table: DiskTable,
    folder: PathBuf,
}

impl SortedValues for KeptOnDisk {
    type Error = RecordError;

    fn len(&self) -> usize {
        self.table.rows()
    }

    fn for_each(&self, mut each: impl FnMut(f64)) -> Result<(), RecordError> {
        let (mut block, mut bytes) = (Vec::new(), Vec::new());
        for number in 0..self.table.block_count() {
            let read = self.table.read_block(number, 0, &mut block, &mut bytes);
            read.map_err(|source| RecordError::TemporaryFile { path: self.folder.clone(), source })?;
            block.iter().for_each(|x| each(*x));
        }
        Ok(())
    }
}
