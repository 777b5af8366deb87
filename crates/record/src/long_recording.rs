//! Recordings longer than memory: the CSV file is read once into temporary files in a given folder.
//!
//! Results and errors are those of [`read_csv`](crate::read_csv): rows, column map, repair, velocity and checks are the same
//! code, on blocks of samples. Disk space: 8 bytes per sample and column, twice that while rows are dropped.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::assemble::{check_sample_count, missing_values_note, unit_notes};
use crate::columns::{ColumnRole, MappedColumns, Parts, joint_torque_name};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, SlopeFilter};
use crate::disk_table::{BLOCK_ROWS, DiskTable, DiskTableWriter, ExternalSort};
use crate::error::RecordError;
use crate::file_formats::FileFormat;
use crate::inspect::magnitude::epoch_unit;
use crate::inspect::{InspectOptions, inspect};
use crate::quality::{QualityNote, assess_stream, repaired_rows};
use crate::recording::Sample;
use crate::sample_stream::{Quantity, SampleStream, SortedValues};
use crate::table_source::{ReadOptions, wanted_fields};
use crate::text::encoding;
use crate::text::find::find_table;
use crate::text::rows::{Tolerance, read_rows};
use crate::text::source::{SourceFile, TextSource, Utf8Check, header_start};
use crate::time_order::{check_dropped, rows_to_drop};
use encoding_rs::{Encoding, UTF_8};

/// Bytes that decide about encoding and layout.
const HEAD_BYTES: u64 = 1 << 18;
/// Lines that a note lists.
const MAX_LINES: usize = 100;
/// Share of the rows with a missing value above which the file is read in memory, where rows of different topics are joined.
const MAX_HOLE_SHARE: f64 = 0.1;
/// Most consecutive rows out of time order that `--repair` handles, in memory.
const MAX_DISORDER_ROWS: usize = 1 << 20;

/// A recording on disk. Values are finite and time increases, as in [`Recording`](crate::Recording).
#[derive(Debug)]
pub struct LongRecording {
    /// One column per role, then the byte offset of each row in the file.
    table: DiskTable,
    roles: Vec<ColumnRole>,
    /// Differentiated velocity, when none was measured.
    velocity: Option<DiskTable>,
    folder: PathBuf,
    /// Lines of the rows dropped because their time stamps did not increase.
    dropped_lines: Vec<u64>,
    /// Notes of reading.
    notes: Vec<QualityNote>,
}

/// Reads a recording from a CSV file as [`read_csv`](crate::read_csv) does, into temporary files in `folder`. `None` when the
/// file must be read as a whole: no regular file, another format, a header beyond 256 KB, columns of several files or in
/// components, time stamps in bursts.
///
/// # Errors
/// Those of [`read_csv`](crate::read_csv), [`RecordError::TemporaryFile`] when the folder cannot be written, and
/// [`RecordError::DisorderTooLong`] when more than 2^20 rows are out of order together.
pub fn read_long_csv(
    path: &Path,
    options: &ReadOptions,
    folder: &Path,
) -> Result<Option<(LongRecording, Vec<QualityNote>)>, RecordError> {
    let read = LongRecording::read(path, options, folder).map_err(|error| {
        error.with_obstacles(|| inspect(path, &InspectOptions { columns: options.columns.clone() }), path)
    });
    let Some(recording) = read? else { return Ok(None) };
    let notes = recording.assess()?;
    Ok(Some((recording, notes)))
}

/// Whether the header line is complete and without an open quotation mark.
fn header_is_complete(text: &[u8]) -> bool {
    let end = text.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
    end.is_some_and(|end| text[..end].iter().filter(|byte| **byte == b'"').count().is_multiple_of(2))
}

/// Whether the whole file is UTF-8 without zero bytes.
fn is_utf8(file_source: &SourceFile<'_>) -> Result<bool, RecordError> {
    let mut text = file_source.text.reader_at(0).map_err(|source| file_source.unreadable(source))?;
    let mut check = Utf8Check::default();
    let mut chunk = vec![0; 1 << 18];
    loop {
        match text.read(&mut chunk).map_err(|source| file_source.unreadable(source))? {
            0 => return Ok(check.finish()),
            count if check.push(&chunk[..count]) => {}
            _ => return Ok(false),
        }
    }
}

/// Whether the columns can be read row by row.
fn is_simple(columns: &MappedColumns, options: &ReadOptions) -> bool {
    let single = columns.columns.iter().all(|column| column.parts == Parts::Single);
    let time_first = columns.columns.first().is_some_and(|column| column.role == ColumnRole::Time);
    let map = options.columns.as_ref();
    let files = map.is_some_and(|map| {
        let optional = map.velocity.iter().chain(&map.force_virtual);
        [&map.time, &map.position, &map.force].into_iter().chain(optional).any(|column| column.file.is_some())
    });
    single && time_first && !files && map.is_none_or(|map| map.rate_hz.is_none())
}

/// The table without the rows whose time stamps do not increase, and the lines of these.
fn repaired(
    table: DiskTable,
    file_source: &SourceFile<'_>,
    folder: &Path,
) -> Result<(DiskTable, Vec<u64>), RecordError> {
    let temporary_file_error = |source| RecordError::TemporaryFile { path: folder.to_owned(), source };
    let offset_column = table.columns() - 1;
    let times = |take: &mut dyn FnMut(&[f64])| {
        let (mut block, mut bytes) = (Vec::new(), Vec::new());
        for number in 0..table.block_count() {
            table.read_block(number, 0, &mut block, &mut bytes)?;
            take(&block);
        }
        Ok(())
    };
    let dropped = match rows_to_drop(times, MAX_DISORDER_ROWS).map_err(temporary_file_error)? {
        Ok(dropped) if dropped.is_empty() => return Ok((table, Vec::new())),
        Ok(dropped) => dropped,
        Err(row) => {
            let line = file_source
                .line_of_row(table.value(offset_column, row).map_err(temporary_file_error)? as usize)?;
            return Err(RecordError::DisorderTooLong {
                path: file_source.path(),
                line,
                rows: MAX_DISORDER_ROWS,
            });
        }
    };
    let mut left = DiskTableWriter::new(folder, table.columns()).map_err(temporary_file_error)?;
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
    moved.map_err(temporary_file_error)?;
    check_dropped(file_source, &offsets, table.rows())?;
    let lines = file_source.lines_of_offsets(offsets.into_iter())?;
    Ok((left.finish().map_err(temporary_file_error)?, lines))
}

impl LongRecording {
    /// Reads without the quality checks of [`LongRecording::assess`].
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
        (&file).take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
        if FileFormat::detect(&head).is_some() {
            return Ok(None);
        }
        if let Some(map) = &options.columns {
            map.check()?;
        }
        let given =
            options.columns.as_ref().and_then(|map| Encoding::for_label(map.encoding.as_ref()?.as_bytes()));
        let Some(encoding) = given.or_else(|| encoding::detect(&head).ok()) else { return Ok(None) };
        let text =
            if encoding == UTF_8 { TextSource::File(&file) } else { TextSource::Encoded(&file, encoding) };
        let head = match encoding == UTF_8 {
            true => head,
            false => encoding::decode(&head, encoding),
        };
        let head = match std::str::from_utf8(&head) {
            Ok(head) => head,
            Err(error) => std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
        };
        let Some(header) =
            header_start(head.as_bytes()).filter(|header| header_is_complete(&head.as_bytes()[*header..]))
        else {
            return Ok(None);
        };
        let file_source = SourceFile { text, path, header };
        if !is_utf8(&file_source)? {
            return Ok(None);
        }
        let (layout, columns) = find_table(
            head,
            header,
            file_source.line_of_row(header)?,
            path,
            options.columns.as_ref(),
            &file_source.spread_lines()?,
        )?;
        if !is_simple(&columns, options) {
            return Ok(None);
        }
        let temporary_file_error = |source| RecordError::TemporaryFile { path: folder.to_owned(), source };
        let mut writer =
            DiskTableWriter::new(folder, columns.columns.len() + 1).map_err(temporary_file_error)?;
        let (mut row, mut holes, mut hole_offsets) = (Vec::new(), 0_usize, Vec::new());
        let (mut in_order, mut counts_samples, mut previous) = (true, true, None);
        let mut largest_s = 0.0_f64;
        let read = read_rows(
            &file_source,
            &layout,
            &wanted_fields(&layout, &columns),
            Tolerance::Strict,
            |offset, numbers| {
                row.clear();
                row.extend(numbers.iter().zip(&columns.columns).map(|(raw, column)| column.apply(*raw)));
                if row.iter().any(|x| !x.is_finite()) {
                    holes += 1;
                    if hole_offsets.len() < MAX_LINES {
                        hole_offsets.push(offset);
                    }
                    return Ok(());
                }
                let time_s = row[0];
                if let Some(previous) = previous.replace(time_s) {
                    in_order &= time_s > previous;
                    counts_samples &= time_s - previous == 1.0;
                }
                largest_s = largest_s.max(time_s.abs());
                // An f64 is exact for offsets below 2^53.
                row.push(offset as f64);
                writer.push(&row).map_err(temporary_file_error)
            },
        )?;
        // Files that need all rows at once, and errors about their order, are left to the reader in memory.
        let odd_clock = counts_samples
            || epoch_unit(largest_s).is_some()
            || read.origins.first().is_some_and(Option::is_some);
        if odd_clock
            || (!in_order && !options.repair)
            || holes as f64 > MAX_HOLE_SHARE * read.rows as f64
            || read.left_out.is_some()
        {
            return Ok(None);
        }
        let mut notes = unit_notes(&columns);
        if holes > 0 {
            notes.push(missing_values_note(&file_source, holes, hole_offsets)?);
        }
        let table = writer.finish().map_err(temporary_file_error)?;
        let (table, dropped_lines) = match options.repair && !in_order {
            true => match repaired(table, &file_source, folder) {
                // Bursts are spread in memory.
                Err(RecordError::RepairTooMuch { .. }) => return Ok(None),
                other => other?,
            },
            false => (table, Vec::new()),
        };
        Ok(Some(Self { dropped_lines, notes, ..Self::new(table, &file_source, &columns, folder)? }))
    }

    /// Quality notes as by [`assess`](crate::assess), preceded by the repaired rows.
    ///
    /// # Errors
    /// [`RecordError::TemporaryFile`].
    pub fn assess(&self) -> Result<Vec<QualityNote>, RecordError> {
        let mut notes = Vec::new();
        if !self.dropped_lines.is_empty() {
            notes.push(repaired_rows(self.dropped_lines.clone(), self.len()));
        }
        notes.extend(self.notes.iter().cloned());
        notes.extend(assess_stream(self)?);
        Ok(notes)
    }

    fn new(
        table: DiskTable,
        file_source: &SourceFile<'_>,
        columns: &MappedColumns,
        folder: &Path,
    ) -> Result<Self, RecordError> {
        let roles: Vec<ColumnRole> = columns.columns.iter().map(|source| source.role).collect();
        let offset_column = roles.len();
        let mut recording = Self {
            table,
            roles,
            velocity: None,
            folder: folder.to_owned(),
            dropped_lines: Vec::new(),
            notes: Vec::new(),
        };
        let last = match recording.table.rows().checked_sub(1) {
            Some(last) => Some(
                recording.table.value(offset_column, last).map_err(|e| recording.temporary_file_error(e))?
                    as usize,
            ),
            None => None,
        };
        check_sample_count(file_source, recording.len(), last)?;
        if !recording.velocity_measured() {
            let (velocity, bad) = recording.differentiated()?;
            if let Some(row) = bad {
                let offset = recording
                    .table
                    .value(offset_column, row)
                    .map_err(|e| recording.temporary_file_error(e))?;
                return Err(RecordError::VelocityNotFinite {
                    path: file_source.path(),
                    line: file_source.line_of_row(offset as usize)?,
                });
            }
            recording.velocity = Some(velocity);
        }
        Ok(recording)
    }

    /// The slope of the position, and the first sample where it is not finite.
    fn differentiated(&self) -> Result<(DiskTable, Option<usize>), RecordError> {
        let mut writer = DiskTableWriter::new(&self.folder, 1).map_err(|e| self.temporary_file_error(e))?;
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
        Ok((finished.map_err(|e| self.temporary_file_error(e))?, bad))
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

    /// Time from the first to the last sample (s).
    ///
    /// # Errors
    /// [`RecordError::TemporaryFile`].
    pub fn duration_s(&self) -> Result<f64, RecordError> {
        SampleStream::duration_s(self)
    }

    /// Typical sampling rate (Hz): the inverse of the median interval.
    ///
    /// # Errors
    /// [`RecordError::TemporaryFile`].
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
        self.written_order().into_iter().map(|column| name(self.roles[column])).collect()
    }

    /// Table columns in the order of [`LongRecording::column_names`].
    fn written_order(&self) -> Vec<usize> {
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

    /// Calls `each` with every sample and its row in the order of [`LongRecording::column_names`].
    ///
    /// # Errors
    /// [`RecordError::TemporaryFile`], and the error of `each`.
    pub fn for_each_sample<E: From<RecordError>>(
        &self,
        mut each: impl FnMut(Sample, &[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let columns = self.written_order();
        let mut buffers = vec![Vec::new(); columns.len()];
        let (mut row, mut velocity_mps, mut bytes) = (vec![0.0; columns.len()], Vec::new(), Vec::new());
        for block in 0..self.table.block_count() {
            for (buffers, column) in buffers.iter_mut().zip(&columns) {
                self.table
                    .read_block(block, *column, buffers, &mut bytes)
                    .map_err(|e| self.temporary_file_error(e))?;
            }
            self.read_block(block, Quantity::Velocity, &mut velocity_mps, &mut bytes)?;
            for (at, velocity_mps) in velocity_mps.iter().enumerate() {
                row.iter_mut().zip(&buffers).for_each(|(x, buffers)| *x = buffers[at]);
                let [time_s, position_m, force_n, ..] = row[..] else { continue };
                each(Sample { time_s, position_m, velocity_mps: *velocity_mps, force_n }, &row)?;
            }
        }
        Ok(())
    }

    /// Time (s) of the first sample at or beyond this position, from the sample with index `first` on.
    ///
    /// # Errors
    /// [`RecordError::TemporaryFile`].
    pub fn first_time_beyond_s(&self, first: usize, position_m: f64) -> Result<Option<f64>, RecordError> {
        let (mut found, mut left) = (None, first);
        self.for_each_block([Quantity::Time, Quantity::Position], |[time_s, at_m]| {
            if found.is_none() {
                let later = time_s.iter().zip(at_m).skip(left);
                found = later.filter(|(_, z)| **z >= position_m).map(|(t, _)| *t).next();
            }
            left = left.saturating_sub(time_s.len());
        })?;
        Ok(found)
    }

    /// Folder of the temporary files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn temporary_file_error(&self, source: io::Error) -> RecordError {
        RecordError::TemporaryFile { path: self.folder.clone(), source }
    }

    fn locate(&self, which: Quantity) -> (&DiskTable, usize) {
        let role = match which {
            Quantity::Time => ColumnRole::Time,
            Quantity::Position => ColumnRole::Position,
            Quantity::Force => ColumnRole::Force,
            Quantity::Velocity => ColumnRole::Velocity,
        };
        match (&self.velocity, which) {
            (Some(velocity), Quantity::Velocity) => (velocity, 0),
            // Time, position and force always exist.
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
        let (table, column) = self.locate(which);
        table.read_block(block, column, into, bytes).map_err(|e| self.temporary_file_error(e))
    }
}

impl SampleStream for LongRecording {
    type Error = RecordError;
    type Sorted = SortedOnDisk;

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
        let mut buffers: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(BLOCK_ROWS));
        let mut bytes = Vec::new();
        for block in 0..self.table.block_count() {
            for (buffers, which) in buffers.iter_mut().zip(which) {
                self.read_block(block, which, buffers, &mut bytes)?;
            }
            each(std::array::from_fn(|at| buffers[at].as_slice()));
        }
        Ok(())
    }

    fn at(&self, which: Quantity, sample: usize) -> Result<f64, RecordError> {
        let (table, column) = self.locate(which);
        table.value(column, sample).map_err(|e| self.temporary_file_error(e))
    }

    fn sorted_values(
        &self,
        fill: impl FnOnce(&mut dyn FnMut(f64)) -> Result<(), RecordError>,
    ) -> Result<SortedOnDisk, RecordError> {
        let mut sorting = ExternalSort::new(&self.folder).map_err(|e| self.temporary_file_error(e))?;
        let mut written = Ok(());
        fill(&mut |x| {
            if written.is_ok() {
                written = sorting.push(x);
            }
        })?;
        let table = written.and_then(|()| sorting.finish()).map_err(|e| self.temporary_file_error(e))?;
        Ok(SortedOnDisk { table, folder: self.folder.clone() })
    }
}

/// Sorted values in a table of one column.
pub(crate) struct SortedOnDisk {
    table: DiskTable,
    folder: PathBuf,
}

impl SortedValues for SortedOnDisk {
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
