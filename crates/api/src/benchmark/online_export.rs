//! Export of streams for online detection: simulated ones, and the recordings of a data set.

use crate::error::Error;
use std::path::Path;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, DatasetError, find_files};
use stylet_examine::World;
use stylet_examine::online::measured_stream::{MeasuredReference, MeasuredRow, MeasuredStream};
use stylet_examine::online::simulate_stream::TruePuncture;
use stylet_examine::online::stream_folder::{StreamExport, StreamFormat, export_streams};
use stylet_examine::online::stream_id::{Row, Split, StreamId, stream_ids};
use stylet_record::Recording;
use stylet_score::{ForceFall, describe_reference_falls, reference_falls};

/// Streams to be exported.
#[derive(Clone, Copy, Debug)]
pub struct OnlineExport<'a> {
    /// Tissue model: `plain` or `rich`.
    pub world: &'a str,
    /// Rows of the table; `all` for every one.
    pub rows: &'a [String],
    /// `make` or `judge`.
    pub split: &'a str,
    /// Streams per row.
    pub cases: u64,
    /// Seed.
    pub seed: u64,
    /// Data set whose insertions form the row `measured`.
    pub measured: Option<&'a Path>,
    /// Whether to write the streams as Parquet, too.
    pub parquet: bool,
}

impl OnlineExport<'_> {
    /// Writes the streams into a new folder and the key next to it; the number of streams.
    ///
    /// # Errors
    /// [`Error::Request`] for an unknown word, with the known ones; for files that are missing or cannot be written; [`Error::Recording`]
    /// for a wrong recording.
    pub fn write(&self, folder: &Path) -> Result<usize, Error> {
        let simulated = online_streams(self.world, self.rows, self.split, self.cases, self.seed)?;
        let measured = match self.measured {
            Some(_) if self.split == Split::Make.as_str() => {
                return Err(Error::Request(
                    "--measured: recordings are for judging alone, since there are none to choose settings on: leave out --split make"
                        .to_owned(),
                ));
            }
            data_set => data_set.map(measured_row).transpose()?,
        };
        let format = self.parquet.then(parquet_format).transpose()?;
        let export = StreamExport { simulated: &simulated, measured: measured.as_ref(), format };
        export_streams(&export, folder).map_err(|why| Error::Request(why.to_string()))
    }
}

/// The streams of the rows named by these words; `all` selects every row.
///
/// # Errors
/// [`Error::Request`] for an unknown word, with the known ones.
fn online_streams(
    world: &str,
    rows: &[String],
    split: &str,
    cases: u64,
    seed: u64,
) -> Result<Vec<StreamId>, Error> {
    let world = super::parse_word("--world", world, World::ALL, World::parse, World::as_str)?;
    let split = super::parse_word("--split", split, Split::ALL, Split::parse, Split::as_str)?;
    let rows = if rows.iter().any(|r| r == "all") {
        Row::ALL.to_vec()
    } else {
        rows.iter()
            .map(|r| super::parse_word("--rows", r, Row::ALL, Row::parse, Row::as_str))
            .collect::<Result<_, _>>()?
    };
    Ok(stream_ids(world, &rows, split, cases, seed))
}

#[cfg(feature = "formats")]
fn parquet_format() -> Result<StreamFormat, Error> {
    let encode = |samples: &[[f64; 3]], path: &Path| {
        let column = |name: &str, k: usize| (name.to_owned(), samples.iter().map(|s| s[k]).collect());
        let columns = [column("time_s", 0), column("position_m", 1), column("force_n", 2)];
        stylet_record::file_formats::columns_to_parquet(&columns, path)
    };
    Ok(StreamFormat { ending: "parquet", encode })
}

#[cfg(not(feature = "formats"))]
fn parquet_format() -> Result<StreamFormat, Error> {
    Err(Error::Request(
        "--parquet: this build writes only CSV: install with `cargo install --path . --features formats`"
            .to_owned(),
    ))
}

/// The insertions of a data set with the falls of their force. Rows with wrong time stamps are left out.
fn measured_row(data_set: &Path) -> Result<MeasuredRow, Error> {
    let set = Dataset { repair: true, ..Dataset::load(data_set)? };
    let patterns = set.recordings.iter().chain(set.parts.iter().flat_map(|part| &part.recordings));
    let mut streams = Vec::new();
    for pattern in patterns {
        for file in find_files(pattern).map_err(|why| missing(data_set, why))? {
            let read = set.read(&file).map_err(|why| Error::Dataset(Box::new(why)))?;
            streams.extend(read.into_iter().map(|(name, recording, _)| measured_stream(name, &recording)));
        }
    }
    if streams.is_empty() {
        return Err(Error::Request(format!(
            "{}: it has no insertions for the row `measured`: list their files in `recordings`",
            data_set.display()
        )));
    }
    Ok(MeasuredRow { derivation: describe_reference_falls(), streams })
}

fn missing(data_set: &Path, why: DatasetError) -> Error {
    match why {
        DatasetError::NoFile { pattern, folder } => Error::Request(format!(
            "{}: no file matches {pattern} in {folder}; set STYLET_MEASURED to the folder that holds the recordings",
            data_set.display()
        )),
        why => Error::Dataset(Box::new(why)),
    }
}

fn measured_stream(name: String, recording: &Recording) -> MeasuredStream {
    let falls = reference_falls(recording);
    let punctures = |falls: &[ForceFall]| -> Vec<TruePuncture> {
        let puncture = |fall: &ForceFall| TruePuncture {
            time_s: recording.time_s[fall.at],
            position_m: recording.position_m[fall.at],
            drop_n: fall.size_n,
            released_s: recording.time_s[fall.lowest],
        };
        falls.iter().map(puncture).collect()
    };
    let samples = recording
        .time_s
        .iter()
        .zip(&recording.position_m)
        .zip(&recording.force_n)
        .map(|((t, z), f)| [*t, *z, *f])
        .collect();
    let reference = MeasuredReference {
        recording: name,
        rate_hz: 1.0 / recording.median_interval_s(),
        punctures: punctures(&falls.clear),
        minor: punctures(&falls.minor),
    };
    MeasuredStream { samples, reference }
}
