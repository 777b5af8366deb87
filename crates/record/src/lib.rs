//! Recordings of needle insertions: samples with units, their ground truth when they were simulated, CSV files
//! with column maps, and remarks on the quality of the data.
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
//! | module | what lives there |
//! |---|---|
//! | [`recording`] | [`Recording`] and its [`Sample`]s |
//! | [`truth`] | [`Truth`]: what a simulation knows and a sensor does not |
//! | [`columns`] | [`ColumnMap`]: names, units and signs of somebody else's log |
//! | [`read`], [`write`](mod@write) | CSV in and out, bit for bit |
//! | [`long`] | recordings of any length, on disk |
//! | [`foreign`] | MCAP, MATLAB v7.3 and Parquet (feature `formats`) |
//! | `quality` | [`QualityNote`]s: dead, reversed, in air, mixed-up units, stuck, gaps, jitter, saturation, spikes, quantisation, unlike its repeats |
//! | [`raw`] | samples that no law can be compared with: at the sensor's limit, spikes |
//! | [`scratch`] | columns of numbers on disk |
//! | [`thin`](mod@thin) | recordings of hours, thinned |
//! | [`differentiate`](mod@differentiate) | velocity from position on irregular time stamps |
//! | [`error`] | [`RecordError`]: what, where, and what would be right |

pub mod column_map;
mod csv_header;
pub mod csv_reader;
pub mod csv_writer;
pub mod differentiate;
pub mod disk_table;
pub mod downsample;
pub mod error;
pub mod file_formats;
pub mod ground_truth;
pub mod long_recording;
pub mod nonfinite_rows;
mod quality;
pub mod recording;
mod sample_stream;
mod timestamp_repair;

pub use column_map::{Column, ColumnMap};
pub use csv_reader::{ReadOptions, read_csv, read_csv_bytes};
pub use csv_writer::{RowWriter, write_csv};
pub use differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
pub use downsample::downsample;
pub use error::RecordError;
pub use ground_truth::{LayerTruth, TrueRupture, Truth};
pub use long_recording::{LongRecording, read_long_csv};
pub use nonfinite_rows::read_csv_skip_nonfinite;
pub use quality::{
    MIN_SAMPLES, QualityKind, QualityNote, assess, check_usable, find_outlier_recordings, sensor_artefacts,
};
pub use recording::{JOINTS, Recording, Sample};
