//! Locking of an output folder, and atomic replacement of the set of result files in it.
//!
//! A set is written to a subfolder, synced and committed by one rename; then its files are moved to their places, the manifest last. A
//! process killed before that rename leaves the old set, one killed after it the new set: the next command that uses the folder completes
//! the move ([`recover`]). After a write error the old set is restored.

mod manifest;
mod replaceable;
mod superseded;

use crate::error::Error;
pub use manifest::MANIFEST;
use manifest::{Manifest, hex, sha256, sha256_of_file};
use replaceable::{Content, check_files, check_same_input, comparable, is_same};
pub use replaceable::{Inputs, check_folder, check_own_file};
use sha2::{Digest, Sha256};
use std::fs::{self, File, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use superseded::{kept_inputs, superseded_files};

/// Subfolder in which a set is staged.
const STAGING_FOLDER: &str = ".stylet-new";
/// Subfolder of a complete set whose files are being moved to their places.
const COMPLETE_FOLDER: &str = ".stylet-set";
/// Subfolder of the former files until the new ones are in place.
const OLD_FOLDER: &str = ".stylet-old";

/// The file by which the results of a command are recognised, and the command.
const RESULT_FILES: [(&str, &str); 12] = [
    ("score.json", "run"),
    ("enhance.json", "enhance"),
    ("check.json", "check"),
    ("consistency.json", "compare-models"),
    ("diagnosis.json", "diagnose"),
    ("predict.json", "predict"),
    ("transfer.json", "diagnose --transfer"),
    ("identifiability.json", "identifiability"),
    ("summary.json", "sweep"),
    ("compare.json", "compare"),
    ("claims.json", "reproduce"),
    ("cases.json", "benchmark plan"),
];

/// Exclusive lock of an output folder, released on drop.
#[derive(Debug)]
pub struct OutputLock {
    folder: PathBuf,
    /// Folders created for it; the empty ones are removed on drop.
    created_folders: Vec<PathBuf>,
    /// Whether files are staged that are not committed.
    staging: AtomicBool,
    _lock: Option<File>,
}

/// Writer of a staged file.
#[derive(Debug)]
pub struct StagedFileWriter {
    name: &'static str,
    place: PathBuf,
    file: File,
    hash: Sha256,
}

impl io::Write for StagedFileWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.hash.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl StagedFileWriter {
    /// Syncs the complete file.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn finish(self) -> Result<StagedFile, Error> {
        self.file.sync_all().map_err(|why| failed(&self.place, why))?;
        Ok(StagedFile { name: self.name, sha256: hex(&self.hash.finalize()) })
    }
}

/// A complete staged file.
#[derive(Debug)]
pub struct StagedFile {
    name: &'static str,
    sha256: String,
}

impl OutputLock {
    /// Creates the folder if missing, locks it, and completes an interrupted write.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be created, [`Error::Busy`] when another process holds it.
    pub fn new(folder: &Path) -> Result<Self, Error> {
        let lock = Self::acquire(folder, File::try_lock)?;
        let recovered = || {
            if folder.join(COMPLETE_FOLDER).exists() {
                move_into_place(folder, &mut || false)?;
            }
            remove_scratch(folder)?;
            remove_staging(folder, &mut || false)
        };
        recovered().map_err(|why| failed(folder, why))?;
        Ok(lock)
    }

    /// Shared lock for processes that write different files, such as the shards of a sweep.
    ///
    /// # Errors
    /// As [`OutputLock::new`].
    pub fn lock_shared(folder: &Path) -> Result<Self, Error> {
        Self::acquire(folder, File::try_lock_shared)
    }

    fn acquire(folder: &Path, try_lock: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Self, Error> {
        let created_folders: Vec<PathBuf> = folder
            .ancestors()
            .take_while(|f| !f.as_os_str().is_empty() && !f.exists())
            .map(Path::to_path_buf)
            .collect();
        let mut lock = Self {
            folder: folder.to_path_buf(),
            created_folders,
            staging: AtomicBool::new(false),
            _lock: None,
        };
        fs::create_dir_all(folder).map_err(|why| failed(folder, why))?;
        // Not every system and network disk can lock a folder; there the lock has no effect.
        if let Ok(file) = File::open(folder) {
            match try_lock(&file) {
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::Busy { path: folder.display().to_string() });
                }
                Ok(()) | Err(TryLockError::Error(_)) => lock._lock = Some(file),
            }
        }
        Ok(lock)
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Opens a file of a set for writing in pieces; [`OutputLock::write_set`] commits it. Otherwise it is removed when the lock is dropped.
    ///
    /// # Errors
    /// [`Error::Output`]; the folder is then unchanged.
    pub fn stage_file(&self, name: &'static str) -> Result<StagedFileWriter, Error> {
        let new = self.folder.join(STAGING_FOLDER);
        let made = fs::create_dir(&new).or_else(|why| match why.kind() {
            io::ErrorKind::AlreadyExists if self.staging.load(Ordering::Relaxed) => Ok(()),
            _ => Err(why),
        });
        made.map_err(|why| failed(&self.folder, why))?;
        self.staging.store(true, Ordering::Relaxed);
        let place = new.join(name);
        let file = File::create(&place).map_err(|why| failed(&place, why))?;
        Ok(StagedFileWriter { name, place, file, hash: Sha256::new() })
    }

    /// Writes a set: files in memory and staged files. It replaces the set that the folder's manifest lists; inputs, changed files and files
    /// that no manifest lists are kept.
    ///
    /// # Errors
    /// [`Error::OtherCommand`], [`Error::NotReplaced`], [`Error::OtherInput`], [`Error::Output`]; the folder is then unchanged.
    /// [`Error::Unfinished`] when the old set cannot be restored.
    pub fn write_set(
        &self,
        parts: &[StagedFile],
        files: &[(&'static str, Vec<u8>)],
        inputs: &Inputs,
    ) -> Result<(), Error> {
        let names = files.iter().map(|(name, _)| *name).chain(parts.iter().map(|part| part.name));
        check_same_command(&self.folder, &names.collect::<Vec<_>>())?;
        let new = files.iter().map(|(name, content)| (*name, Content::Bytes(content)));
        let new = new.chain(parts.iter().map(|part| (part.name, Content::Sha256(&part.sha256))));
        check_files(&self.folder, &inputs.files, new)?;
        let input = inputs.names_folder.as_deref().map(comparable);
        if let Some(input) = &input {
            check_same_input(&self.folder, input)?;
        }
        let kept = kept_inputs(&self.folder, |path| inputs.files.iter().any(|input| is_same(path, input)));
        let old = Manifest { sha256: kept, input, ..Manifest::default() };
        let Err(why) = self.write_until(parts, files, old, &mut || false) else { return Ok(()) };
        let names = files.iter().map(|(name, _)| *name);
        let names = names.chain(parts.iter().map(|part| part.name)).chain([MANIFEST]);
        if self.folder.join(COMPLETE_FOLDER).exists() && restore_old(&self.folder, names).is_err() {
            return Err(Error::Unfinished { path: self.folder.display().to_string(), why });
        }
        let _ = remove_staging(&self.folder, &mut || false);
        Err(failed(&self.folder, why))
    }

    /// Adds the files to `manifest`, which may list kept ones, and writes both. `killed` is called before every change of the disk; tests
    /// abort there, as a kill would.
    fn write_until(
        &self,
        parts: &[StagedFile],
        files: &[(&'static str, Vec<u8>)],
        mut manifest: Manifest,
        killed: &mut dyn FnMut() -> bool,
    ) -> io::Result<()> {
        let folder = &self.folder;
        // A file cannot take the place of a folder of the same name.
        let names = files.iter().map(|(name, _)| *name);
        let names = names.chain(parts.iter().map(|part| part.name)).chain([MANIFEST]);
        if let Some(place) = names.map(|name| folder.join(name)).find(|place| place.is_dir()) {
            return Err(io::Error::other(format!("{} is a folder", place.display())));
        }
        let new = folder.join(STAGING_FOLDER);
        if parts.is_empty() {
            check_killed(killed)?;
            fs::create_dir(&new)?;
        }
        manifest.stylet = env!("CARGO_PKG_VERSION").to_owned();
        for (name, content) in files {
            check_killed(killed)?;
            synced(&new.join(name), content)?;
            manifest.sha256.insert((*name).to_owned(), sha256(content));
        }
        for part in parts {
            manifest.sha256.insert(part.name.to_owned(), part.sha256.clone());
        }
        let mut text = serde_json::to_vec_pretty(&manifest).map_err(io::Error::other)?;
        text.push(b'\n');
        check_killed(killed)?;
        synced(&new.join(MANIFEST), &text)?;
        sync_names(&new)?;
        check_killed(killed)?;
        // Commit.
        fs::rename(&new, folder.join(COMPLETE_FOLDER))?;
        sync_names(folder)?;
        move_into_place(folder, killed)?;
        // The new set is in place. Staging folders that cannot be removed now are left to the next command.
        remove_staging(folder, killed).or_else(|why| if is_kill(&why) { Err(why) } else { Ok(()) })
    }
}

impl Drop for OutputLock {
    fn drop(&mut self) {
        if self.staging.load(Ordering::Relaxed) {
            let _ = fs::remove_dir_all(self.folder.join(STAGING_FOLDER));
        }
        for folder in &self.created_folders {
            // Fails for folders that are not empty, as intended.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Completes the set of a killed command that was committed but not moved; otherwise does nothing.
///
/// # Errors
/// [`Error::Output`], [`Error::Busy`] when the other command still runs.
pub fn recover(folder: &Path) -> Result<(), Error> {
    if folder.join(COMPLETE_FOLDER).exists() {
        OutputLock::new(folder)?;
    }
    Ok(())
}

/// Rejects a folder with the results of another command, because files of both would remain there.
///
/// # Errors
/// [`Error::OtherCommand`].
pub fn check_same_command(folder: &Path, new_files: &[&str]) -> Result<(), Error> {
    let Ok(text) = fs::read(folder.join(MANIFEST)) else { return Ok(()) };
    let Ok(manifest) = serde_json::from_slice::<Manifest>(&text) else { return Ok(()) };
    for (file, command) in RESULT_FILES {
        if manifest.sha256.contains_key(file) && folder.join(file).exists() && !new_files.contains(&file) {
            return Err(Error::OtherCommand { path: folder.display().to_string(), command, file });
        }
    }
    Ok(())
}

/// As [`recover`], for the folder of a file that is about to be read.
///
/// # Errors
/// As [`recover`].
pub fn recover_parent(file: &Path) -> Result<(), Error> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    recover(folder.unwrap_or(Path::new(".")))
}

/// Checks files against the folder's manifest; a folder without manifest passes.
///
/// # Errors
/// [`Error::InconsistentSet`] naming the first file that is not, or a manifest that cannot be read.
pub fn verify_manifest(folder: &Path, names: &[&str]) -> Result<(), Error> {
    let path = folder.join(MANIFEST);
    let text = match fs::read(&path) {
        Err(why) if why.kind() == io::ErrorKind::NotFound => return Ok(()),
        text => text.ok(),
    };
    let Some(manifest) = text.and_then(|text| serde_json::from_slice::<Manifest>(&text).ok()) else {
        return Err(Error::InconsistentSet { path: path.display().to_string() });
    };
    for name in names {
        let path = folder.join(name);
        let found = sha256_of_file(&path).ok();
        if manifest.sha256.get(*name) != found.as_ref() {
            return Err(Error::InconsistentSet { path: path.display().to_string() });
        }
    }
    Ok(())
}

/// Writes one file atomically: to a temporary name, synced, then renamed. A path that is not a regular file, such as `/dev/stdout`, is
/// written to directly.
///
/// # Errors
/// [`Error::Output`]; the former file is then unchanged.
pub fn write_file_atomically(path: &Path, content: &[u8]) -> Result<(), Error> {
    let special = |found: fs::Metadata| !found.is_file() && !found.is_dir();
    if fs::metadata(path).is_ok_and(special) {
        let written =
            fs::OpenOptions::new().write(true).open(path).and_then(|mut file| file.write_all(content));
        return written.map_err(|why| failed(path, why));
    }
    let mut part = path.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let part = PathBuf::from(part);
    let written = synced(&part, content).and_then(|()| fs::rename(&part, path));
    if let Some(folder) = path.parent() {
        let _ = sync_names(folder);
    }
    written.map_err(|why| {
        let _ = fs::remove_file(&part);
        failed(path, why)
    })
}

fn failed(path: &Path, why: io::Error) -> Error {
    Error::Output { path: path.display().to_string(), why }
}

/// Moves a complete set to its places; replaced files are kept until all are there.
fn move_into_place(folder: &Path, killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    let (whole, old) = (folder.join(COMPLETE_FOLDER), folder.join(OLD_FOLDER));
    let names = names_in(&whole)?;
    check_killed(killed)?;
    fs::create_dir(&old)
        .or_else(|e| if e.kind() == io::ErrorKind::AlreadyExists { Ok(()) } else { Err(e) })?;
    // The old manifest first: it does not describe the intermediate state.
    let superseded = superseded_files(folder, &whole, &old);
    for name in names.iter().rev().chain(&superseded) {
        let place = folder.join(name);
        // A file already in the old folder was put there before a kill.
        if place.exists() && !old.join(name).exists() {
            check_killed(killed)?;
            fs::rename(&place, old.join(name))?;
        }
    }
    for name in &names {
        check_killed(killed)?;
        fs::rename(whole.join(name), folder.join(name))?;
    }
    sync_names(folder)
}

/// The files of a set, its manifest last.
fn names_in(whole: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(whole)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort_by_key(|name| (name == MANIFEST, name.clone()));
    Ok(names)
}

/// Undoes [`move_into_place`] for a set of these names. Until the last rename a kill leaves the new set.
fn restore_old<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> io::Result<()> {
    let whole = folder.join(COMPLETE_FOLDER);
    // Before the manifests are moved.
    let superseded = superseded_files(folder, &whole, &folder.join(OLD_FOLDER));
    for name in names {
        let (place, new) = (folder.join(name), whole.join(name));
        if !new.exists() && place.exists() {
            fs::rename(&place, &new)?;
        }
        restore_file(folder, name)?;
    }
    for name in &superseded {
        restore_file(folder, name)?;
    }
    fs::rename(&whole, folder.join(STAGING_FOLDER))
}

/// Moves a file of the old set back to its place.
fn restore_file(folder: &Path, name: &str) -> io::Result<()> {
    let aside = folder.join(OLD_FOLDER).join(name);
    if aside.exists() { fs::rename(&aside, folder.join(name)) } else { Ok(()) }
}

/// Removes the staging folders.
fn remove_staging(folder: &Path, killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    for name in [STAGING_FOLDER, COMPLETE_FOLDER, OLD_FOLDER] {
        check_killed(killed)?;
        fs::remove_dir_all(folder.join(name)).or_else(ignore_not_found)?;
    }
    Ok(())
}

fn check_killed(killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    if killed() { Err(io::ErrorKind::Interrupted.into()) } else { Ok(()) }
}

/// Whether an error comes from [`check_killed`] rather than from the system.
fn is_kill(why: &io::Error) -> bool {
    why.kind() == io::ErrorKind::Interrupted && why.raw_os_error().is_none()
}

fn ignore_not_found(why: io::Error) -> io::Result<()> {
    if why.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(why) }
}

fn synced(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(content)?;
    file.sync_all()
}

/// Syncs the directory entries, where the system can sync a folder.
fn sync_names(folder: &Path) -> io::Result<()> {
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    synced.or_else(|why| if is_disk_failure(&why) { Err(why) } else { Ok(()) })
}

/// Whether the disk is full or broken, as opposed to an unsupported operation.
fn is_disk_failure(why: &io::Error) -> bool {
    /// `EIO` on every Unix.
    const INPUT_OUTPUT: i32 = 5;
    let full = matches!(why.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
    full || (cfg!(unix) && why.raw_os_error() == Some(INPUT_OUTPUT))
}

/// Removes scratch files that a killed command left.
fn remove_scratch(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(stylet_record::disk_table::TEMP_FILE_PREFIX) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
