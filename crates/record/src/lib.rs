//! Recordings of needle insertions: samples with units, ground truth of simulated ones, readers and writers for CSV and
//! other formats with column maps, data quality checks.
//!
//! SI units everywhere; a public field carries its unit as a suffix. Signs: position is positive into the tissue, force
//! is positive when it resists the insertion.
//!
//! ```
//! use std::path::Path;
//! use stylet_record::{ReadOptions, read_csv_bytes};
//!
//! let text = b"time_s,position_m,force_n\n0.00,0.000,0.0\n0.01,0.002,0.1\n0.02,0.004,0.2\n";
//! let (recording, notes) = read_csv_bytes(text, Path::new("insertion.csv"), &ReadOptions::default())?;
//! assert_eq!(recording.len(), 3);
//! assert!((recording.velocity_mps[1] - 0.2).abs() < 1e-12);
//! assert!(!recording.velocity_measured);
//! assert!(notes[0].message.contains("3 usable sample(s)"));
//! # Ok::<(), stylet_record::RecordError>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`recording`] | [`Recording`] and its [`Sample`]s |
//! | [`ground_truth`] | [`Truth`]: ground truth of a simulated recording |
//! | [`column_map`] | [`ColumnMap`]: names, units and signs of the columns of another program's log |
//! | [`csv_reader`], [`csv_writer`] | CSV in and out, bit for bit |
//! | [`mod@inspect`] | inspection of a file: layout, columns, sampling, units, a proposed column map |
//! | [`units`] | units in names and rows of units |
//! | [`long_recording`], [`disk_table`] | recordings longer than memory, on disk |
//! | [`file_formats`] | spreadsheets, MATLAB, HDF5, Parquet, MCAP, ROS 2 bags (most with the feature `formats`) |
//! | [`memory_limit`] | limit on the memory that reading a file may take |
//! | `quality` | [`QualityNote`]s on implausible, saturated, irregular or outlying data |
//! | [`sensor_artefacts`] | samples that a force law cannot explain: sensor range, resolution, spikes |
//! | [`mod@downsample`] | averaging of recordings that are too long for a diagnosis |
//! | [`mod@differentiate`] | velocity from position on irregular time stamps |
//! | [`error`] | [`RecordError`]: error, location and remedy |

mod assemble;
pub mod column_map;
mod columns;
pub mod csv_reader;
pub mod csv_writer;
pub mod differentiate;
pub mod disk_table;
pub mod downsample;
pub mod error;
pub mod file_formats;
pub mod ground_truth;
mod insertion_axis;
pub mod inspect;
pub mod long_recording;
pub mod memory_limit;
mod proposed_map;
mod quality;
pub mod recording;
mod row_groups;
mod sample_stream;
mod table_source;
#[cfg(test)]
mod test_noise;
mod text;
mod time_order;
pub mod units;

pub use column_map::{Column, ColumnMap};
pub use csv_reader::{read_csv, read_csv_bytes};
pub use csv_writer::{RowWriter, write_csv};
pub use differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
pub use downsample::downsample;
pub use error::RecordError;
pub use ground_truth::{LayerTruth, TrueRupture, Truth};
pub use long_recording::{LongRecording, read_long_csv};
pub use proposed_map::inspect_and_read;
pub use quality::{
    MIN_SAMPLES, QualityKind, QualityNote, assess, check_distinct, check_usable, find_outlier_recordings,
    sensor_artefacts,
};
pub use recording::{JOINTS, Recording, Sample};
pub use row_groups::read_csv_groups;
pub use table_source::ReadOptions;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
