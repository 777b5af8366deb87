//! File formats of other programs: MCAP, MATLAB v7.3, Parquet.
//!
//! A file is converted to the CSV table that its program would export, and then read like any CSV file: column map, repair,
//! checks. Line numbers in messages are those of that table, whose header is line 1.
//!
//! | file | names of columns |
//! |---|---|
//! | MCAP (messages in JSON, or ROS 2 `.msg` in CDR) | `topic.field.field`, arrays `topic.field.0`; `topic.log_time` is the time of logging in s |
//! | MATLAB v7.3, HDF5 | variables; fields of a struct, groups: `log.pz`; columns of a matrix: `log.wrench.3` (from 1) |
//! | Parquet | its columns; nested ones with dots |
//!
//! The rows of an MCAP file are the messages of the topic of the force; values of other topics are interpolated to their
//! times.

use crate::column_map::ColumnMap;
use crate::error::RecordError;
use std::path::Path;

#[cfg(feature = "formats")]
mod columns_to_csv;
#[cfg(feature = "formats")]
mod export;
#[cfg(feature = "formats")]
mod hdf5;
#[cfg(feature = "formats")]
mod mcap;
#[cfg(feature = "formats")]
mod parquet;
#[cfg(feature = "formats")]
mod ros_messages;

#[cfg(feature = "formats")]
pub use export::{to_mcap, to_parquet};

/// A file format other than CSV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileFormat {
    Mcap,
    Hdf5,
    Parquet,
    /// MATLAB before v7.3, which is not HDF5 and not supported.
    LegacyMat,
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
            b if b.starts_with(b"MATLAB 5.0 MAT-file") => Some(Self::LegacyMat),
            _ => None,
        }
    }

    /// Name for messages.
    fn name(self) -> &'static str {
        match self {
            Self::Mcap => "an MCAP file",
            Self::Hdf5 => "an HDF5 file (MATLAB v7.3)",
            Self::Parquet => "a Parquet file",
            Self::LegacyMat => "a MATLAB file of version 7 or older",
        }
    }
}

/// Converts the file to CSV.
pub(crate) fn to_csv(
    kind: FileFormat,
    bytes: &[u8],
    path: &Path,
    map: Option<&ColumnMap>,
) -> Result<Vec<u8>, RecordError> {
    let foreign = |what: String| RecordError::Foreign { path: path.to_owned(), kind: kind.name(), what };
    if kind == FileFormat::LegacyMat {
        return Err(foreign("save it with save(..., '-v7.3'), or export it as CSV".to_owned()));
    }
    #[cfg(not(feature = "formats"))]
    {
        let _ = (bytes, map);
        Err(foreign(
            "this build reads only CSV: install with `cargo install --path . --features formats`, or export the file as CSV".to_owned(),
        ))
    }
    #[cfg(feature = "formats")]
    {
        // The libraries panic on some damaged files.
        std::panic::catch_unwind(|| {
            let source: Box<dyn columns_to_csv::NumericColumns> = match kind {
                FileFormat::Mcap => Box::new(mcap::File::open(bytes).map_err(foreign)?),
                FileFormat::Hdf5 => Box::new(hdf5::File::open(bytes).map_err(foreign)?),
                FileFormat::Parquet => Box::new(parquet::File::open(bytes).map_err(foreign)?),
                FileFormat::LegacyMat => return Err(foreign(String::new())),
            };
            columns_to_csv::columns_to_csv(&*source, path, map, foreign)
        })
        .unwrap_or_else(|_| Err(foreign("it is damaged".to_owned())))
    }
}
