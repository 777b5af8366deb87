//! Export of streams to a folder (`streams/NNNN.csv`, and `streams.csv` with their rates; the key with the truth next to the folder),
//! and reading of answers.

use super::event_matching::Event;
use super::measured_stream::{MeasuredReference, MeasuredRow, MeasuredStream};
use super::simulate_stream::{Stream, TruePuncture, simulate_stream};
use super::stream_id::{Split, StreamId};
use super::stream_scores::EntrantAnswers;
use crate::challenge_export::{ChallengeError, key_path};
use core::fmt::Write as _;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use stylet_record::RecordError;
use stylet_stats::parallel::*;

/// Version of the stream generator. Between versions the same identifier may denote different streams.
const STREAM_VERSION: u32 = 1;
/// Columns of the samples.
const COLUMNS: &str = "time_s,position_m,force_n";

/// Identifier of the stream of each number, and the reference of each recording.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct StreamKey {
    stream_version: u32,
    streams: BTreeMap<String, StreamId>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    measured: Option<MeasuredKey>,
}

/// References of the recordings by the numbers of their streams.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct MeasuredKey {
    derivation: String,
    streams: BTreeMap<String, MeasuredReference>,
}

/// Encodes samples of time in s, position in m and force in N; the path is for errors.
pub type EncodeSamples = fn(&[[f64; 3]], &Path) -> Result<Vec<u8>, RecordError>;

/// A file format of the streams in addition to CSV.
#[derive(Clone, Copy, Debug)]
pub struct StreamFormat {
    /// Ending of the file names.
    pub ending: &'static str,
    /// Encoder.
    pub encode: EncodeSamples,
}

/// Streams to be exported.
#[derive(Clone, Copy, Debug, Default)]
pub struct StreamExport<'a> {
    /// Simulated ones.
    pub simulated: &'a [StreamId],
    /// Recordings.
    pub measured: Option<&'a MeasuredRow>,
    /// Second format.
    pub format: Option<StreamFormat>,
}

/// Origin of a stream.
#[derive(Clone, Copy)]
enum Source<'a> {
    Simulated(StreamId),
    Measured(&'a MeasuredStream),
}

/// Numbers in the answers of a detector, apart from its events.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EntrantFile {
    /// Name of the detector.
    pub name: String,
    /// Time per sample in ns, including the pipe.
    pub ns_per_sample: Option<f64>,
}

/// One stream as exported.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedStream {
    /// Its number.
    pub number: String,
    /// Nominal rate in Hz.
    pub rate_hz: f64,
}

fn file_error(path: &Path) -> impl Fn(std::io::Error) -> ChallengeError {
    let path = path.display().to_string();
    move |why| ChallengeError::File { path: path.clone(), why }
}

fn content_error(path: &Path, why: impl Into<String>) -> ChallengeError {
    ChallengeError::Content { path: path.display().to_string(), why: why.into() }
}

/// Writes streams in random order into a new folder, and their key next to it.
///
/// # Errors [`ChallengeError`]; partial output is removed.
pub fn export_streams(export: &StreamExport, folder: &Path) -> Result<usize, ChallengeError> {
    if folder.exists() {
        return Err(ChallengeError::FolderExists(folder.display().to_string()));
    }
    let mut part = folder.as_os_str().to_owned();
    part.push(".part");
    let part = std::path::PathBuf::from(part);
    let _ = std::fs::remove_dir_all(&part);
    let result = write_folder(export, &part, folder);
    if result.is_err() {
        let _ = std::fs::remove_dir_all(&part);
    }
    result
}

fn write_folder(export: &StreamExport, part: &Path, folder: &Path) -> Result<usize, ChallengeError> {
    let ids = export.simulated;
    let measured = export.measured.map_or(&[][..], |row| &row.streams);
    let mut sources: Vec<Source> = ids.iter().copied().map(Source::Simulated).collect();
    sources.extend(measured.iter().map(Source::Measured));
    let mut rng = ChaCha8Rng::seed_from_u64(ids.first().map_or(0, StreamId::stream_seed));
    for k in (1..sources.len()).rev() {
        sources.swap(k, rng.random_range(0..=k));
    }
    let numbered: Vec<(String, Source)> =
        sources.into_iter().enumerate().map(|(k, source)| (format!("{:04}", k + 1), source)).collect();
    let folder_of_streams = part.join("streams");
    std::fs::create_dir_all(&folder_of_streams).map_err(file_error(&folder_of_streams))?;
    let lines: Vec<(String, String)> = numbered
        .par_iter()
        .map(|(number, source)| {
            let stream = match source {
                Source::Simulated(id) => simulate_stream(id),
                Source::Measured(stream) => (*stream).clone().into_stream(),
            };
            write_stream(part, number, &stream, export.format)?;
            Ok((format!("{number},{:?}\n", stream.rate_hz), truth_lines(number, &stream.punctures)))
        })
        .collect::<Result<_, ChallengeError>>()?;
    let list: String = lines.iter().map(|l| l.0.as_str()).collect();
    let write = |name: &str, text: String| {
        let path = part.join(name);
        std::fs::write(&path, text).map_err(file_error(&path))
    };
    write("streams.csv", format!("stream,rate_hz\n{list}"))?;
    write("README.md", readme(numbered.len(), export))?;
    if ids.iter().all(|id| id.split == Split::Make) && measured.is_empty() {
        let truth: String = lines.iter().map(|l| l.1.as_str()).collect();
        write("truth.csv", format!("stream,time_s,position_m,drop_n\n{truth}"))?;
    }
    let count = numbered.len();
    let key_file = key_path(folder);
    let text = serde_json::to_vec_pretty(&stream_key(numbered, export.measured))
        .map_err(|e| file_error(&key_file)(e.into()))?;
    std::fs::write(&key_file, text).map_err(file_error(&key_file))?;
    std::fs::rename(part, folder).map_err(file_error(folder))?;
    Ok(count)
}

/// Writes the samples as CSV, and these same numbers in a second format.
fn write_stream(
    folder: &Path,
    number: &str,
    stream: &Stream,
    format: Option<StreamFormat>,
) -> Result<(), ChallengeError> {
    let path = folder.join("streams").join(format!("{number}.csv"));
    let mut text = format!("{COLUMNS}\n");
    for ((t, z), f) in stream.time_s.iter().zip(&stream.position_m).zip(&stream.force_n) {
        let _ = writeln!(text, "{t:.6},{z:.6},{f:.6}");
    }
    std::fs::write(&path, text).map_err(file_error(&path))?;
    if let Some(format) = format {
        let path = path.with_extension(format.ending);
        let bytes = (format.encode)(&stream_samples(folder, number)?, &path)?;
        std::fs::write(&path, bytes).map_err(file_error(&path))?;
    }
    Ok(())
}

fn truth_lines(number: &str, punctures: &[TruePuncture]) -> String {
    punctures.iter().fold(String::new(), |mut out, p| {
        let _ = writeln!(out, "{number},{:.6},{:.6},{:.4}", p.time_s, p.position_m, p.drop_n);
        out
    })
}

fn stream_key(numbered: Vec<(String, Source)>, row: Option<&MeasuredRow>) -> StreamKey {
    let (mut streams, mut measured) = (BTreeMap::new(), BTreeMap::new());
    for (number, source) in numbered {
        match source {
            Source::Simulated(id) => {
                streams.insert(number, id);
            }
            Source::Measured(stream) => {
                measured.insert(number, stream.reference.clone());
            }
        }
    }
    let measured = row.map(|row| MeasuredKey { derivation: row.derivation.clone(), streams: measured });
    StreamKey { stream_version: STREAM_VERSION, streams, measured }
}

fn readme(count: usize, export: &StreamExport) -> String {
    let format = export.format.map_or_else(String::new, |format| {
        format!("`streams/NNNN.{}` (`--{0}`) holds the same numbers. ", format.ending)
    });
    let measured = export.measured.map_or_else(String::new, |row| {
        format!(
            "\n{} streams are recordings of real insertions (`--measured`), without rows of repeated or backward time stamps: pass them on only as
their owner allows. Their true punctures are unknown. {}\n",
            row.streams.len(),
            row.derivation
        )
    });
    format!(
        "# When does the needle puncture a layer?

{count} streams, `streams/NNNN.csv`: `time_s,position_m,force_n` of a needle pushed through layered tissue (SI units; position positive
into the tissue, force at the needle's base, positive when it resists). {format}`streams.csv` has the rate of each. In the tissue the force
rises with depth; when a layer is punctured its elastic part is released, while friction along the needle stays. The position of the
surface and the number of layers are unknown.
{measured}
Report each puncture as soon as you can, at the sample at which you know it. Only causal detectors count:

    stylet benchmark replay FOLDER --out answers/mine -- python3 mine.py

starts your program and gives it the streams sample by sample:

    input      start 200                    a new stream, rate in Hz: reset; no reply
               0.005,-0.0061,0.0123         time_s,position_m,force_n; reply one line at once
    output     event,drop_n,confidence,tip_force_n

`event` is 1 when a puncture is reported at this sample. The other fields are optional numbers: size of the drop, confidence (any scale,
larger is more certain; a threshold on it is swept), force on the tip. Fields may be empty and trailing ones left out: an empty line
reports no puncture.

A detector that does not run in a pipe may write `answers/mine/events.csv` itself, `stream,time_s,drop_n,confidence`, and optionally
`answers/mine/enhanced/NNNN.csv`, `time_s,tip_force_n`.

With the key, `stylet benchmark judge-online FOLDER answers/*` prints: F1 with an event within 50 ms of the puncture, and before the
needle has moved by 0.5 mm; missed and false ones, an event counting from 50 ms before to 1 s after a puncture; delay; false
alarms per hour. A layer may tear in steps: the first event counts, and further ones while it still tears are no false alarms.
"
    )
}

/// The streams of a folder, from its `streams.csv`.
///
/// # Errors [`ChallengeError`] with the file and the expected content.
pub fn exported_streams(folder: &Path) -> Result<Vec<ExportedStream>, ChallengeError> {
    let path = folder.join("streams.csv");
    let text = std::fs::read_to_string(&path).map_err(file_error(&path))?;
    let mut lines = text.lines();
    if lines.next() != Some("stream,rate_hz") {
        return Err(content_error(
            &path,
            "line 1 should be `stream,rate_hz`, as `stylet benchmark export --online` writes it",
        ));
    }
    lines
        .enumerate()
        .map(|(k, line)| {
            let wrong = || {
                content_error(&path, format!("line {}: it should be `NUMBER,RATE_HZ`, not `{line}`", k + 2))
            };
            let (number, rate) = line.split_once(',').ok_or_else(wrong)?;
            let rate_hz = rate.parse().map_err(|_| wrong())?;
            Ok(ExportedStream { number: number.to_owned(), rate_hz })
        })
        .collect()
}

/// The samples `[time_s, position_m, force_n]` of an exported stream.
///
/// # Errors
/// [`ChallengeError`]: the file and the line.
pub fn stream_samples(folder: &Path, number: &str) -> Result<Vec<[f64; 3]>, ChallengeError> {
    let path = folder.join("streams").join(format!("{number}.csv"));
    table(&path, COLUMNS)?
        .into_iter()
        .map(|(line, fields)| {
            let number = |k: usize| fields.get(k).copied().flatten();
            match (number(0), number(1), number(2)) {
                (Some(t), Some(z), Some(f)) => Ok([t, z, f]),
                _ => Err(content_error(&path, format!("line {line}: three numbers should be here"))),
            }
        })
        .collect()
}

/// Line number and numbers of a line, empty fields as `None`.
type TableLine = (usize, Vec<Option<f64>>);

/// The lines of a table with these columns; the last ones may be missing.
fn table(path: &Path, header: &str) -> Result<Vec<TableLine>, ChallengeError> {
    let text = std::fs::read_to_string(path).map_err(file_error(path))?;
    let names: Vec<&str> = text.lines().next().unwrap_or("").trim().split(',').collect();
    let wanted: Vec<&str> = header.split(',').collect();
    if names.is_empty() || !wanted.starts_with(&names) {
        return Err(content_error(path, format!("line 1 should be `{header}`")));
    }
    text.lines()
        .enumerate()
        .skip(1)
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(k, line)| {
            let fields = line
                .trim()
                .split(',')
                .map(|field| match field.trim() {
                    "" => Ok(None),
                    field => field.parse().map(Some).map_err(|_| {
                        content_error(
                            path,
                            format!("line {}: `{field}` is no number; the columns are `{header}`", k + 1),
                        )
                    }),
                })
                .collect::<Result<_, _>>()?;
            Ok((k + 1, fields))
        })
        .collect()
}

/// The streams of a folder with their truth, from its key.
///
/// # Errors
/// [`ChallengeError`].
pub fn streams_with_truth(folder: &Path) -> Result<Vec<(String, Stream)>, ChallengeError> {
    let path = key_path(folder);
    let text = std::fs::read_to_string(&path).map_err(|e| {
        content_error(
            &path,
            format!(
                "{e}; answers are judged with the key that the export wrote next to the folder of the streams"
            ),
        )
    })?;
    let key: StreamKey = serde_json::from_str(&text).map_err(|e| {
        content_error(
            &path,
            format!(
                "{e}; it should be the key that `stylet benchmark export --online` wrote next to the folder"
            ),
        )
    })?;
    if key.stream_version != STREAM_VERSION {
        let why = format!(
            "was made by version {} of the generator of streams, and this is version {STREAM_VERSION}: export the streams again",
            key.stream_version
        );
        return Err(content_error(&path, why));
    }
    let mut streams: Vec<(String, Stream)> =
        key.streams.into_par_iter().map(|(number, id)| (number, simulate_stream(&id))).collect();
    for (number, reference) in key.measured.map(|key| key.streams).unwrap_or_default() {
        let samples = stream_samples(folder, &number)?;
        streams.push((number, MeasuredStream { samples, reference }.into_stream()));
    }
    Ok(streams)
}

/// Reads the answers in a folder: `events.csv`, and if there are any `entrant.json` and, of streams with a known tip force,
/// `enhanced/NNNN.csv`.
///
/// # Errors
/// [`ChallengeError`]: the file and the line.
pub fn read_answers(answers: &Path, streams: &[(String, Stream)]) -> Result<EntrantAnswers, ChallengeError> {
    let described = answers.join("entrant.json");
    let described: EntrantFile = match std::fs::read_to_string(&described) {
        Ok(text) => serde_json::from_str(&text).map_err(|e| content_error(&described, e.to_string()))?,
        Err(_) => EntrantFile::default(),
    };
    let name = if described.name.is_empty() {
        answers.file_name().map_or_else(|| "entrant".to_owned(), |n| n.to_string_lossy().into_owned())
    } else {
        described.name
    };
    let path = answers.join("events.csv");
    let mut events: BTreeMap<String, Vec<Event>> = BTreeMap::new();
    for (line, fields) in table(&path, "stream,time_s,drop_n,confidence")? {
        let field = |k: usize| fields.get(k).copied().flatten();
        let (Some(number), Some(time_s)) = (field(0), field(1)) else {
            return Err(content_error(&path, format!("line {line}: stream and time_s should be here")));
        };
        let number = format!("{number:04}");
        if !streams.iter().any(|(n, _)| *n == number) {
            return Err(content_error(&path, format!("line {line}: there is no stream {number}")));
        }
        events.entry(number).or_default().push(Event { time_s, drop_n: field(2), confidence: field(3) });
    }
    for list in events.values_mut() {
        list.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    let enhancement = streams
        .par_iter()
        .filter_map(|(number, stream)| {
            let path = answers.join("enhanced").join(format!("{number}.csv"));
            (!stream.tip_n.is_empty() && path.exists())
                .then(|| Ok((number.clone(), enhancement_error(&path, stream)?)))
        })
        .collect::<Result<_, ChallengeError>>()?;
    Ok(EntrantAnswers { name, events, enhancement, ns_per_sample: described.ns_per_sample })
}

/// RMS error of the tip force in a file over the RMS of the true one, at the samples that it has.
fn enhancement_error(path: &Path, stream: &Stream) -> Result<f64, ChallengeError> {
    let (mut error, mut size) = (0.0, 0.0);
    for (line, fields) in table(path, "time_s,tip_force_n")? {
        let (Some(time_s), Some(tip_n)) = (fields[0], fields.get(1).copied().flatten()) else { continue };
        let k = stream.time_s.partition_point(|t| *t < time_s - 1e-6);
        let Some(true_n) = stream.tip_n.get(k) else {
            return Err(content_error(path, format!("line {line}: the stream ends before this time")));
        };
        error += (tip_n - true_n) * (tip_n - true_n);
        size += true_n * true_n;
    }
    Ok((error / size.max(f64::MIN_POSITIVE)).sqrt())
}
