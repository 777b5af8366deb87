//! Files of other programs: spreadsheets, MATLAB, HDF5, Parquet, MCAP, ROS 2 bags.
//!
//! A spreadsheet is read like the text table that its program would export; the other formats have named columns. Column map,
//! repair and checks are the same as for text. Line numbers in messages are rows of the sheet or table.
//!
//! | file | names of columns |
//! |---|---|
//! | spreadsheet: xlsx, xls, ods | as in a text table |
//! | MATLAB v4 to v7 and v7.3, HDF5 | variables; fields of a struct, groups: `log.pz`; columns of a matrix: `log.wrench.3` (from 1), all three: `log.wrench` |
//! | Parquet | its columns; nested ones with dots |
//! | MCAP (messages in JSON, or ROS 2 `.msg` in CDR), ROS 2 bag (sqlite) | `topic.field.field`, arrays `topic.field.0`; `topic.log_time` is the time of logging in s |
//!
//! The rows of an MCAP file or a bag are the messages of the topic of the force; values of other topics are interpolated to
//! their times. All but MATLAB before v7.3 need the feature `formats`.

use crate::column_map::ColumnMap;
use crate::error::RecordError;
use numeric_columns::{ColumnsOfFile, NumericColumns};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

#[cfg(feature = "formats")]
mod export;
#[cfg(feature = "formats")]
mod hdf5;
mod matlab5;
#[cfg(feature = "formats")]
mod mcap;
pub(crate) mod numeric_columns;
#[cfg(feature = "formats")]
mod parquet;
#[cfg(feature = "formats")]
mod ros_bag;
#[cfg(feature = "formats")]
mod ros_definitions;
#[cfg(feature = "formats")]
mod ros_messages;
#[cfg(feature = "formats")]
mod spreadsheet;
#[cfg(feature = "formats")]
mod topics;
#[cfg(feature = "formats")]
mod xls;

#[cfg(feature = "formats")]
pub use export::{columns_to_parquet, to_mcap, to_parquet};

/// A file format other than text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileFormat {
    Mcap,
    Hdf5,
    Parquet,
    /// MATLAB before v7.3, which is not HDF5.
    Matlab5,
    Spreadsheet,
    RosBag,
}

impl FileFormat {
    /// The format by the first bytes of a file.
    pub(crate) fn detect(bytes: &[u8]) -> Option<Self> {
        const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
        // MATLAB writes a block before the HDF5 part.
        let hdf5 =
            [0, 512, 1024, 2048].iter().any(|at| bytes.get(*at..).is_some_and(|b| b.starts_with(HDF5)));
        match bytes {
            b if b.starts_with(b"\x89MCAP0\r\n") => Some(Self::Mcap),
            b if b.starts_with(b"PAR1") => Some(Self::Parquet),
            _ if hdf5 => Some(Self::Hdf5),
            b if b.starts_with(b"MATLAB 5.0 MAT-file") => Some(Self::Matlab5),
            b if b.starts_with(b"SQLite format 3\0") => Some(Self::RosBag),
            // A ZIP archive, or the container of old Office files.
            b if b.starts_with(b"PK\x03\x04") || b.starts_with(b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1") => {
                Some(Self::Spreadsheet)
            }
            _ => None,
        }
    }

    /// Name for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mcap => "an MCAP file",
            Self::Hdf5 => "an HDF5 file (MATLAB v7.3)",
            Self::Parquet => "a Parquet file",
            Self::Matlab5 => "a MATLAB file (v5 to v7)",
            Self::Spreadsheet => "a spreadsheet",
            Self::RosBag => "a ROS 2 bag (sqlite)",
        }
    }
}

/// An open file of another program.
pub(crate) enum OpenFile<'a> {
    /// A spreadsheet as a text table in UTF-8, with one line per row.
    #[cfg_attr(not(feature = "formats"), allow(dead_code, reason = "spreadsheets need the feature"))]
    Text(Vec<u8>),
    /// Named columns.
    Columns(ColumnsOfFile<'a>),
}

impl<'a> OpenFile<'a> {
    /// Opens a file.
    ///
    /// # Errors
    /// [`RecordError::Foreign`].
    pub(crate) fn open(
        kind: FileFormat,
        bytes: &'a [u8],
        path: &Path,
        map: Option<&ColumnMap>,
    ) -> Result<Self, RecordError> {
        let foreign = |what: String| RecordError::Foreign { path: path.to_owned(), kind: kind.name(), what };
        // The libraries panic on some damaged files.
        catch_unwind(AssertUnwindSafe(|| Self::open_unprotected(kind, bytes, path, map)))
            .unwrap_or_else(|_| Err("it is damaged".to_owned()))
            .map_err(foreign)
    }

    #[cfg_attr(not(feature = "formats"), allow(unused_variables))]
    fn open_unprotected(
        kind: FileFormat,
        bytes: &'a [u8],
        path: &Path,
        map: Option<&ColumnMap>,
    ) -> Result<Self, String> {
        let columns = |source: Box<dyn NumericColumns + 'a>| {
            Ok(Self::Columns(ColumnsOfFile { source, kind: kind.name(), path: path.to_owned() }))
        };
        match kind {
            FileFormat::Matlab5 => columns(Box::new(matlab5::File::open(bytes)?)),
            #[cfg(feature = "formats")]
            FileFormat::Spreadsheet => {
                Ok(Self::Text(spreadsheet::to_text(bytes, map.and_then(|map| map.sheet.as_deref()))?))
            }
            #[cfg(feature = "formats")]
            FileFormat::Mcap => columns(Box::new(mcap::open(bytes)?)),
            #[cfg(feature = "formats")]
            FileFormat::RosBag => columns(Box::new(ros_bag::open(bytes)?)),
            #[cfg(feature = "formats")]
            FileFormat::Hdf5 => columns(Box::new(hdf5::File::open(bytes)?)),
            #[cfg(feature = "formats")]
            FileFormat::Parquet => columns(Box::new(parquet::File::open(bytes)?)),
            #[cfg(not(feature = "formats"))]
            _ => Err("this build reads only text tables and MATLAB before v7.3: install with `cargo install --path . --features formats`, or \
                      export the file as CSV"
                .to_owned()),
        }
    }
}
