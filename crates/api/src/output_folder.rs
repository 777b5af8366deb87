//! An output folder while a command works in it: nobody else writes there, and a set of results appears as one.
//!
//! A set is written into a folder of its own inside the output folder, synced, and announced by one rename; then its files are
//! moved to their places, the manifest last. Whoever is killed before that rename leaves the old set, whoever is killed after it the
//! new one: the next command that looks at the folder ends what was begun ([`settle`]). Whoever is told that something cannot be
//! written puts the old set back.

use crate::error::Error;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// The file that says which files make the set; written last.
pub const MANIFEST: &str = "manifest.json";
/// Where a set is being written.
const NEW: &str = ".stylet-new";
/// A set that is whole, on its way to its places.
const WHOLE: &str = ".stylet-set";
/// What stood there before, while the new files come in.
const OLD: &str = ".stylet-old";

/// `manifest.json`: the files of a set with the SHA-256 of each.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
struct Manifest {
    stylet: String,
    sha256: BTreeMap<String, String>,
}

/// An output folder that this process alone writes to, until it is dropped.
#[derive(Debug)]
pub struct OutputLock {
    folder: PathBuf,
    /// Folders that were made for it; those that are still empty at the end go again.
    made: Vec<PathBuf>,
    /// Whether a file of a set was begun that is not announced.
    begun: AtomicBool,
    _lock: Option<File>,
}

/// A file of a set that is written piece by piece, where the set is being written.
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
    /// The file is whole.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn finish(self) -> Result<StagedFile, Error> {
        self.file.sync_all().map_err(|why| failed(&self.place, why))?;
        Ok(StagedFile { name: self.name, sha256: hex(&self.hash.finalize()) })
    }
}

/// A file of a set that lies where the set is being written.
#[derive(Debug)]
pub struct StagedFile {
    name: &'static str,
    sha256: String,
}

impl OutputLock {
    /// Makes the folder when it is not there and keeps others from writing to it.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be made, [`Error::Busy`] when another process works there.
    pub fn new(folder: &Path) -> Result<Self, Error> {
        let claim = Self::take(folder, File::try_lock)?;
        let begun = || {
            if folder.join(WHOLE).exists() {
                move_in(folder, &mut || false)?;
            }
            remove_scratch(folder)?;
            tidy(folder, &mut || false)
        };
        begun().map_err(|why| failed(folder, why))?;
        Ok(claim)
    }

    /// The same beside others that write files of their own there, as shards of a sweep.
    ///
    /// # Errors
    /// As [`Claim::new`].
    pub fn lock_shared(folder: &Path) -> Result<Self, Error> {
        Self::take(folder, File::try_lock_shared)
    }

    fn take(folder: &Path, lock: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Self, Error> {
        let made: Vec<PathBuf> = folder
            .ancestors()
            .take_while(|f| !f.as_os_str().is_empty() && !f.exists())
            .map(Path::to_path_buf)
            .collect();
        let mut claim =
            Self { folder: folder.to_path_buf(), made, begun: AtomicBool::new(false), _lock: None };
        fs::create_dir_all(folder).map_err(|why| failed(folder, why))?;
        // Where a folder cannot be locked (not on every system, not on every network disk) nothing keeps others away.
        if let Ok(file) = File::open(folder) {
            match lock(&file) {
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::Busy { path: folder.display().to_string() });
                }
                Ok(()) | Err(TryLockError::Error(_)) => claim._lock = Some(file),
            }
        }
        Ok(claim)
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Begins a file of a set whose other files come later, by [`Claim::write_with`]. Without those it goes with the claim.
    ///
    /// # Errors
    /// [`Error::Output`]; the folder then holds what it held before.
    pub fn stage_file(&self, name: &'static str) -> Result<StagedFileWriter, Error> {
        let new = self.folder.join(NEW);
        let made = fs::create_dir(&new).or_else(|why| match why.kind() {
            io::ErrorKind::AlreadyExists if self.begun.load(Ordering::Relaxed) => Ok(()),
            _ => Err(why),
        });
        made.map_err(|why| failed(&self.folder, why))?;
        self.begun.store(true, Ordering::Relaxed);
        let place = new.join(name);
        let file = File::create(&place).map_err(|why| failed(&place, why))?;
        Ok(StagedFileWriter { name, place, file, hash: Sha256::new() })
    }

    /// Writes a set of files. Files of the same names are replaced, others are left alone.
    ///
    /// # Errors
    /// [`Error::Output`]; the folder then holds what it held before. [`Error::Begun`] where the disk does not even let what it held be
    /// put back.
    pub fn write_all_files(&self, files: &[(&'static str, Vec<u8>)]) -> Result<(), Error> {
        self.write_staged(&[], files)
    }

    /// The same with files that were written piece by piece.
    ///
    /// # Errors
    /// As [`Claim::write`].
    pub fn write_staged(&self, parts: &[StagedFile], files: &[(&'static str, Vec<u8>)]) -> Result<(), Error> {
        let Err(why) = self.write_until(parts, files, &mut || false) else { return Ok(()) };
        let names = files.iter().map(|(name, _)| *name);
        let names = names.chain(parts.iter().map(|part| part.name)).chain([MANIFEST]);
        if self.folder.join(WHOLE).exists() && take_back(&self.folder, names).is_err() {
            return Err(Error::Unfinished { path: self.folder.display().to_string(), why });
        }
        let _ = tidy(&self.folder, &mut || false);
        Err(failed(&self.folder, why))
    }

    /// `killed` is asked before every change of the disk; tests end the work there as a kill would.
    fn write_until(
        &self,
        parts: &[StagedFile],
        files: &[(&'static str, Vec<u8>)],
        killed: &mut dyn FnMut() -> bool,
    ) -> io::Result<()> {
        let folder = &self.folder;
        // A file cannot take the place of a folder of the same name.
        let names = files.iter().map(|(name, _)| *name);
        let names = names.chain(parts.iter().map(|part| part.name)).chain([MANIFEST]);
        if let Some(place) = names.map(|name| folder.join(name)).find(|place| place.is_dir()) {
            return Err(io::Error::other(format!("{} is a folder", place.display())));
        }
        let new = folder.join(NEW);
        if parts.is_empty() {
            go_on(killed)?;
            fs::create_dir(&new)?;
        }
        let mut manifest = Manifest { stylet: env!("CARGO_PKG_VERSION").to_owned(), ..Manifest::default() };
        for (name, content) in files {
            go_on(killed)?;
            synced(&new.join(name), content)?;
            manifest.sha256.insert((*name).to_owned(), sum(content));
        }
        for part in parts {
            manifest.sha256.insert(part.name.to_owned(), part.sha256.clone());
        }
        let mut text = serde_json::to_vec_pretty(&manifest).map_err(io::Error::other)?;
        text.push(b'\n');
        go_on(killed)?;
        synced(&new.join(MANIFEST), &text)?;
        sync_names(&new)?;
        go_on(killed)?;
        // From here on it is the new set.
        fs::rename(&new, folder.join(WHOLE))?;
        sync_names(folder)?;
        move_in(folder, killed)?;
        // The new set is in its places. What cannot be tidied now is tidied by the next command, or stops it.
        tidy(folder, killed).or_else(|why| if is_kill(&why) { Err(why) } else { Ok(()) })
    }
}

impl Drop for OutputLock {
    fn drop(&mut self) {
        if self.begun.load(Ordering::Relaxed) {
            let _ = fs::remove_dir_all(self.folder.join(NEW));
        }
        for folder in &self.made {
            // Only empty folders go.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Ends what a killed command had begun in a folder: afterwards it holds one set. Does nothing in a folder where nothing is begun.
///
/// # Errors
/// [`Error::Output`], [`Error::Busy`] when the other command is still at it.
pub fn recover(folder: &Path) -> Result<(), Error> {
    if folder.join(WHOLE).exists() {
        OutputLock::new(folder)?;
    }
    Ok(())
}

/// The same for the folder that a file lies in, before the file is read.
///
/// # Errors
/// As [`settle`].
pub fn recover_parent(file: &Path) -> Result<(), Error> {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    recover(folder.unwrap_or(Path::new(".")))
}

/// Whether the files are those that the folder's manifest tells of; a folder without manifest is not judged.
///
/// # Errors
/// [`Error::NotOneSet`] naming the first file that is not, or a manifest that cannot be read.
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
        let found = sum_of_file(&path).ok();
        if manifest.sha256.get(*name) != found.as_ref() {
            return Err(Error::InconsistentSet { path: path.display().to_string() });
        }
    }
    Ok(())
}

/// Writes one file: beside its place, synced, then renamed.
///
/// # Errors
/// [`Error::Output`]; what stood there before still does.
pub fn write_file_atomically(path: &Path, content: &[u8]) -> Result<(), Error> {
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

/// A set that is whole goes to its places; what it replaces waits aside until all are there.
fn move_in(folder: &Path, killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    let (whole, old) = (folder.join(WHOLE), folder.join(OLD));
    let names = names_in(&whole)?;
    go_on(killed)?;
    fs::create_dir(&old)
        .or_else(|e| if e.kind() == io::ErrorKind::AlreadyExists { Ok(()) } else { Err(e) })?;
    // The old manifest goes first: it does not speak of a folder in between.
    for name in names.iter().rev() {
        let place = folder.join(name);
        // What was put aside before a kill is the older one.
        if place.exists() && !old.join(name).exists() {
            go_on(killed)?;
            fs::rename(&place, old.join(name))?;
        }
    }
    for name in &names {
        go_on(killed)?;
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

/// As it was before [`move_in`] began, with a set of these names. Until the last rename a kill leaves the new set.
fn take_back<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> io::Result<()> {
    let (whole, old) = (folder.join(WHOLE), folder.join(OLD));
    for name in names {
        let (place, new, aside) = (folder.join(name), whole.join(name), old.join(name));
        if !new.exists() && place.exists() {
            fs::rename(&place, &new)?;
        }
        if aside.exists() {
            fs::rename(&aside, &place)?;
        }
    }
    fs::rename(&whole, folder.join(NEW))
}

/// What is left of a set that was written or given up: nothing of it is needed any more.
fn tidy(folder: &Path, killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    for left in [NEW, WHOLE, OLD] {
        go_on(killed)?;
        fs::remove_dir_all(folder.join(left)).or_else(absent)?;
    }
    Ok(())
}

fn go_on(killed: &mut dyn FnMut() -> bool) -> io::Result<()> {
    if killed() { Err(io::ErrorKind::Interrupted.into()) } else { Ok(()) }
}

/// Whether an error is that of [`go_on`] rather than the system's.
fn is_kill(why: &io::Error) -> bool {
    why.kind() == io::ErrorKind::Interrupted && why.raw_os_error().is_none()
}

fn absent(why: io::Error) -> io::Result<()> {
    if why.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(why) }
}

fn synced(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(content)?;
    file.sync_all()
}

/// Names survive a power cut too, where the system can sync a folder; not all can.
fn sync_names(folder: &Path) -> io::Result<()> {
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    synced.or_else(|why| if is_of_the_disk(&why) { Err(why) } else { Ok(()) })
}

/// Whether the disk is full or broken, rather than asked for what it cannot do.
fn is_of_the_disk(why: &io::Error) -> bool {
    /// `EIO` on every Unix.
    const INPUT_OUTPUT: i32 = 5;
    let full = matches!(why.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
    full || (cfg!(unix) && why.raw_os_error() == Some(INPUT_OUTPUT))
}

/// Where a system keeps the names of scratch files, a kill leaves them behind.
fn remove_scratch(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(stylet_record::disk_table::TEMP_FILE_PREFIX) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

fn sum(content: &[u8]) -> String {
    hex(&Sha256::digest(content))
}

fn sum_of_file(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut File::open(path)?, &mut hash)?;
    Ok(hex(&hash.finalize()))
}

fn hex(hash: &[u8]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("stylet-folder-{}-{name}", std::process::id()));
            let _ = fs::remove_dir_all(&path);
            Self(path)
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const NAMES: [&str; 3] = ["a.csv", "b.json", "c.html"];

    fn set(of: &str) -> Vec<(&'static str, Vec<u8>)> {
        NAMES.iter().map(|name| (*name, format!("{of} {name}").into_bytes())).collect()
    }

    /// Which set the folder holds; `None` for a mixture.
    fn held(folder: &Path) -> Option<String> {
        let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap_or_default();
        let of = read(NAMES[0]).split(' ').next().unwrap_or_default().to_owned();
        let all = NAMES
            .iter()
            .all(|name| read(name) == format!("{of} {name}") || (of.is_empty() && read(name).is_empty()));
        (all && verify_manifest(folder, &NAMES).is_ok()).then_some(of)
    }

    fn leftovers(folder: &Path) -> Vec<String> {
        let all = fs::read_dir(folder)
            .map(|all| all.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect());
        all.map(|all: Vec<String>| all.into_iter().filter(|name| name.starts_with('.')).collect())
            .unwrap_or_default()
    }

    #[test]
    fn killed_at_any_change_of_the_disk_the_folder_holds_the_old_set_or_the_new_one() -> Result<(), Error> {
        let scratch = Scratch::new("kills");
        let (mut olds, mut news, mut at) = (0, 0, 0);
        loop {
            let folder = scratch.0.join(format!("{at}"));
            OutputLock::new(&folder)?.write_all_files(&set("old"))?;
            fs::write(folder.join("notes.txt"), "mine").map_err(|e| failed(&folder, e))?;
            let claim = OutputLock::new(&folder)?;
            let mut left = at;
            // Every other time the first file comes piece by piece.
            let (parts, files) = if at % 2 == 0 {
                let (name, content) = &set("new")[0];
                let mut part = claim.stage_file(name)?;
                content
                    .chunks(3)
                    .try_for_each(|piece| part.write_all(piece))
                    .map_err(|e| failed(&folder, e))?;
                (vec![part.finish()?], set("new").split_off(1))
            } else {
                (Vec::new(), set("new"))
            };
            let done = claim.write_until(&parts, &files, &mut || {
                left -= 1;
                left < 0
            });
            drop(claim);
            recover(&folder)?;
            let now = held(&folder);
            assert!(matches!(now.as_deref(), Some("old" | "new")), "killed at change {at}: {now:?}");
            if now.as_deref() == Some("old") {
                olds += 1;
            } else {
                news += 1;
            }
            // What a kill leaves behind goes with the next set, and that is whole.
            OutputLock::new(&folder)?.write_all_files(&set("next"))?;
            assert_eq!(
                (held(&folder).as_deref(), leftovers(&folder)),
                (Some("next"), vec![]),
                "killed at change {at}"
            );
            assert_eq!(fs::read_to_string(folder.join("notes.txt")).unwrap_or_default(), "mine");
            if done.is_ok() {
                break;
            }
            at += 1;
        }
        assert!(olds >= 5 && news >= 8, "the kills fell on both sides: {olds} old, {news} new");
        Ok(())
    }

    #[test]
    fn a_move_that_fails_anywhere_gives_everything_back() -> Result<(), Error> {
        let scratch = Scratch::new("back");
        let mut taken_back = 0;
        for at in 0..40 {
            let folder = scratch.0.join(format!("{at}"));
            OutputLock::new(&folder)?.write_all_files(&set("old"))?;
            let mut left = at;
            let new = [set("new"), vec![("only-new.svg", b"new".to_vec())]].concat();
            let claim = OutputLock::new(&folder)?;
            let _ = claim.write_until(&[], &new, &mut || {
                left -= 1;
                left < 0
            });
            // What is announced and not yet in its places.
            if !folder.join(WHOLE).join(MANIFEST).exists() {
                continue;
            }
            taken_back += 1;
            let names = new.iter().map(|(name, _)| *name).chain([MANIFEST]);
            take_back(&folder, names)
                .and_then(|()| tidy(&folder, &mut || false))
                .map_err(|e| failed(&folder, e))?;
            assert_eq!((held(&folder).as_deref(), leftovers(&folder)), (Some("old"), vec![]), "at {at}");
            assert!(!folder.join("only-new.svg").exists(), "at {at}: a file of the set that was given up");
        }
        assert!(taken_back > 8, "{taken_back}");
        Ok(())
    }

    #[test]
    fn two_commands_do_not_write_to_one_folder_and_shards_do() -> Result<(), Error> {
        let scratch = Scratch::new("lock");
        let first = OutputLock::new(&scratch.0)?;
        for second in [OutputLock::new(&scratch.0), OutputLock::lock_shared(&scratch.0)] {
            let said = second.map(|_| ()).expect_err("it is taken").to_string();
            assert!(said.contains("another stylet") && said.contains("--out"), "{said}");
        }
        drop(first);
        let (one, two) = (OutputLock::lock_shared(&scratch.0)?, OutputLock::lock_shared(&scratch.0)?);
        assert!(OutputLock::new(&scratch.0).is_err(), "shards are being written");
        drop((one, two));
        assert!(!scratch.0.exists(), "a folder that was made and stayed empty goes again");
        Ok(())
    }

    #[test]
    fn a_file_that_was_begun_and_not_ended_goes_with_the_claim() -> Result<(), Error> {
        let scratch = Scratch::new("begun");
        OutputLock::new(&scratch.0)?.write_all_files(&set("old"))?;
        let claim = OutputLock::new(&scratch.0)?;
        claim.stage_file(NAMES[0])?.write_all(b"half").map_err(|e| failed(&scratch.0, e))?;
        assert_eq!(leftovers(&scratch.0), [NEW]);
        drop(claim);
        assert_eq!((held(&scratch.0).as_deref(), leftovers(&scratch.0)), (Some("old"), vec![]));
        Ok(())
    }

    #[test]
    fn a_set_with_a_changed_file_is_told() -> Result<(), Error> {
        let scratch = Scratch::new("changed");
        OutputLock::new(&scratch.0)?.write_all_files(&set("old"))?;
        assert!(verify_manifest(&scratch.0, &NAMES).is_ok());
        fs::write(scratch.0.join(NAMES[1]), "other").map_err(|e| failed(&scratch.0, e))?;
        let said = verify_manifest(&scratch.0, &NAMES).expect_err("b.json is another").to_string();
        assert!(said.contains("b.json") && said.contains("same set"), "{said}");
        Ok(())
    }
}
