//! Shards: files with the rows of a range of trials, each a function of its inputs. A file is written under a temporary name, synced
//! and renamed, so that an existing file is complete; it is checked when read.
//!
//! Format: one line of JSON (the header), then the rows as little-endian 64-bit numbers.

use crate::sweep_file::{Sweep, hex};
use crate::trial_row::{Columns, TrialRow};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Folder of the shards within a sweep's output.
pub const SHARD_FOLDER: &str = "shards";

/// Header of a shard file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Header {
    stylet_shard: u32,
    version: String,
    identity: String,
    sweep: String,
    seed: u64,
    trials: u64,
    shard: u64,
    of: u64,
    from: u64,
    to: u64,
    width: usize,
    sha256: String,
}

/// Error of a shard file.
#[derive(Debug, thiserror::Error)]
pub enum ShardError {
    /// It cannot be written.
    #[error("{path}: cannot be written: {why}; finished shards are kept, repeat with --resume")]
    Write {
        /// File or folder.
        path: String,
        /// The I/O error.
        why: io::Error,
    },
    /// It does not exist.
    #[error(
        "{path}: shard {shard} of {of} is missing; make it with: stylet sweep run-shard {shard}/{of} ..."
    )]
    Missing {
        /// File.
        path: String,
        /// Its number, from 1.
        shard: u64,
        /// Number of shards.
        of: u64,
    },
    /// There are none.
    #[error("{path}: holds no shards; make them with: stylet sweep run-shard 1/N ...")]
    None {
        /// Folder.
        path: String,
    },
    /// It belongs to another sweep or version.
    #[error(
        "{path}: belongs to another {what}: {found} instead of {expected}; remove it and run the shard again"
    )]
    Mismatch {
        /// File.
        path: String,
        /// Property that differs: sweep, version, seed, number of trials, range.
        what: &'static str,
        /// Its value.
        found: String,
        /// The expected value.
        expected: String,
    },
    /// It is damaged.
    #[error("{path}: is damaged: {why}; remove it and run the shard again")]
    Damaged {
        /// File.
        path: String,
        /// Cause.
        why: String,
    },
}

/// Shard `shard` of `of`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardNumber {
    /// From 1.
    pub shard: u64,
    /// Number of shards.
    pub of: u64,
}

/// Largest number of shards: file names have six digits.
const MAX_SHARDS: u64 = 999_999;

impl std::str::FromStr for ShardNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a shard; write one like 3/8, counted from 1");
        let (shard, of) = text.split_once('/').ok_or_else(wrong)?;
        let (shard, of) =
            (shard.trim().parse().map_err(|_| wrong())?, of.trim().parse().map_err(|_| wrong())?);
        if of > MAX_SHARDS {
            return Err(format!("`{text}` is one of too many shards; a sweep has at most {MAX_SHARDS}"));
        }
        if shard == 0 || shard > of { Err(wrong()) } else { Ok(Self { shard, of }) }
    }
}

impl ShardNumber {
    /// Trials of the shard; sizes differ by at most one.
    #[must_use]
    pub fn range(&self, trials: u64) -> Range<u64> {
        let edge = |i: u64| (u128::from(trials) * u128::from(i) / u128::from(self.of.max(1))) as u64;
        edge(self.shard - 1)..edge(self.shard)
    }

    /// Path of the shard in a sweep's output folder.
    #[must_use]
    pub fn path(&self, out: &Path) -> PathBuf {
        out.join(SHARD_FOLDER).join(format!("{:06}-of-{:06}.shard", self.shard, self.of))
    }
}

fn header(sweep: &Sweep, columns: &Columns, number: ShardNumber, sha256: String) -> Header {
    let range = number.range(sweep.trials());
    Header {
        stylet_shard: 1,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        identity: sweep.identity(),
        sweep: sweep.name.clone(),
        seed: sweep.file.seed,
        trials: sweep.trials(),
        shard: number.shard,
        of: number.of,
        from: range.start,
        to: range.end,
        width: columns.width(),
        sha256,
    }
}

/// Writes a shard to a temporary file, syncs it and renames it.
///
/// # Errors
/// [`ShardError::Write`]; an existing file is kept.
pub fn write(
    sweep: &Sweep,
    columns: &Columns,
    number: ShardNumber,
    rows: &[TrialRow],
    out: &Path,
) -> Result<(), ShardError> {
    let mut body = Vec::with_capacity(rows.len() * (columns.width() + 3) * 8);
    for row in rows {
        for whole in [row.trial, row.seed, row.redrawn] {
            body.extend(whole.to_le_bytes());
        }
        row.values.iter().for_each(|value| body.extend(value.to_le_bytes()));
    }
    let header = header(sweep, columns, number, hex(&Sha256::digest(&body)));
    let mut bytes = serde_json::to_vec(&header).unwrap_or_default();
    bytes.push(b'\n');
    bytes.extend(body);
    let path = number.path(out);
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let failed = |why| ShardError::Write { path: path.display().to_string(), why };
    let folder = out.join(SHARD_FOLDER);
    fs::create_dir_all(&folder).map_err(failed)?;
    let written = fs::File::create(&part).and_then(|mut file| {
        file.write_all(&bytes)?;
        file.sync_all()
    });
    let moved = written.and_then(|()| fs::rename(&part, &path)).and_then(|()| {
        // Syncing the folder makes the rename durable.
        fs::File::open(&folder)?.sync_all()
    });
    moved.map_err(|why| {
        let _ = fs::remove_file(&part);
        failed(why)
    })
}

/// Reads a shard and checks that it belongs to this sweep and is complete.
///
/// # Errors
/// [`ShardError`] that names the file.
pub fn read(
    sweep: &Sweep,
    columns: &Columns,
    number: ShardNumber,
    out: &Path,
) -> Result<Vec<TrialRow>, ShardError> {
    let path = number.path(out);
    let shown = path.display().to_string();
    let damaged = |why: &str| ShardError::Damaged { path: shown.clone(), why: why.to_owned() };
    let bytes = fs::read(&path).map_err(|why| match why.kind() {
        io::ErrorKind::NotFound => {
            ShardError::Missing { path: shown.clone(), shard: number.shard, of: number.of }
        }
        _ => damaged(&why.to_string()),
    })?;
    let end = bytes.iter().position(|b| *b == b'\n').ok_or_else(|| damaged("it has no header"))?;
    let found: Header =
        serde_json::from_slice(&bytes[..end]).map_err(|_| damaged("its header is unreadable"))?;
    let body = &bytes[end + 1..];
    let expected = header(sweep, columns, number, found.sha256.clone());
    let foreign = |what, found: String, expected: String| {
        Err(ShardError::Mismatch { path: shown.clone(), what, found, expected })
    };
    if found.version != expected.version {
        return foreign("version of Stylet", found.version, expected.version);
    }
    if found.trials != expected.trials {
        return foreign("number of trials", found.trials.to_string(), expected.trials.to_string());
    }
    if found.seed != expected.seed {
        return foreign("seed", found.seed.to_string(), expected.seed.to_string());
    }
    if found.identity != expected.identity {
        let short = |id: &str| id.chars().take(12).collect::<String>();
        return foreign("sweep or scenario", short(&found.identity), short(&expected.identity));
    }
    if (found.from, found.to) != (expected.from, expected.to) {
        let range = |h: &Header| format!("trials {} to {}", h.from, h.to);
        return foreign("range", range(&found), range(&expected));
    }
    let record = (columns.width() + 3) * 8;
    if found != expected || body.len() as u64 != (found.to - found.from) * record as u64 {
        return Err(damaged("its length is not that of its rows"));
    }
    if hex(&Sha256::digest(body)) != found.sha256 {
        return Err(damaged("its checksum does not fit its rows"));
    }
    let eight = |bytes: &[u8]| bytes.try_into().map_or([0; 8], |b: [u8; 8]| b);
    Ok(body
        .chunks_exact(record)
        .map(|record| {
            let mut words = record.chunks_exact(8).map(eight);
            let mut whole = || words.next().map_or(0, u64::from_le_bytes);
            let (trial, seed, redrawn) = (whole(), whole(), whole());
            TrialRow { trial, seed, redrawn, values: words.map(f64::from_le_bytes).collect() }
        })
        .collect())
}

/// Removes the shards in the folder and partial files of interrupted writers; then the folder, unless it holds other files. Files that
/// cannot be removed are ignored: the results are complete without them.
pub fn remove_all(out: &Path) {
    let folder = out.join(SHARD_FOLDER);
    for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // An interrupted writer's file ends in its process number and `.part`.
        let unfinished =
            name.strip_suffix(".part").and_then(|rest| rest.rsplit_once('.')).map(|(stem, _)| stem);
        if split_of(&name).is_some()
            || unfinished.is_some_and(|stem| split_of(&format!("{stem}.shard")).is_some())
        {
            let _ = fs::remove_file(entry.path());
        }
    }
    // Fails for a folder that is not empty, as intended.
    let _ = fs::remove_dir(&folder);
}

/// Number of shards in the name of a shard, as [`ShardNumber::path`] makes it; `None` for other files.
fn split_of(name: &str) -> Option<u64> {
    let (shard, of) = name.strip_suffix(".shard")?.split_once("-of-")?;
    let six_digits = |text: &str| text.len() == 6 && text.bytes().all(|b| b.is_ascii_digit());
    if six_digits(shard) && six_digits(of) { of.parse().ok() } else { None }
}

/// Number of shards according to the file names in the folder.
///
/// # Errors
/// [`ShardError::None`] without shards, [`ShardError::Mismatch`] when files of different splits are mixed.
pub fn shard_count(out: &Path) -> Result<u64, ShardError> {
    let folder = out.join(SHARD_FOLDER);
    let mut found: Vec<(u64, String)> = fs::read_dir(&folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| {
            let name = entry.ok()?.file_name().into_string().ok()?;
            Some((split_of(&name)?, name))
        })
        .collect();
    found.sort();
    let (Some(first), Some(last)) = (found.first(), found.last()) else {
        return Err(ShardError::None { path: folder.display().to_string() });
    };
    if first.0 != last.0 {
        return Err(ShardError::Mismatch {
            path: folder.join(&first.1).display().to_string(),
            what: "split",
            found: format!("one of {}", first.0),
            expected: format!("one of {} like {}", last.0, last.1),
        });
    }
    Ok(first.0)
}
