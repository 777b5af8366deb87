//! Journal of completed cases, one JSON line each, from which an interrupted benchmark resumes.

use crate::error::Error;
use crate::output_folder::write_file_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, ErrorKind, Write as _};
use std::path::Path;
use std::sync::Mutex;

/// A journal, open for appending.
pub struct CaseJournal<T> {
    /// The cases read when it was opened.
    pub completed: Vec<T>,
    file: Mutex<File>,
}

impl<T: Serialize + DeserializeOwned> CaseJournal<T> {
    /// Opens or creates a journal. A line that was cut off by an interruption is dropped, so its case is run again.
    ///
    /// # Errors
    /// [`Error::Output`] when it cannot be read (it is then left unchanged) or written.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut done: Vec<T> = Vec::new();
        match File::open(path) {
            Ok(file) => {
                for line in BufReader::new(file).split(b'\n') {
                    let line = line.map_err(|why| Error::output(path, why))?;
                    done.extend(serde_json::from_slice::<T>(&line).ok());
                }
            }
            Err(why) if why.kind() == ErrorKind::NotFound => {}
            Err(why) => return Err(Error::output(path, why)),
        }
        let complete: String =
            done.iter().filter_map(|d| serde_json::to_string(d).ok()).map(|l| l + "\n").collect();
        write_file_atomically(path, complete.as_bytes())?;
        let folder = path.parent().unwrap_or(path);
        let file = OpenOptions::new().append(true).open(path).map_err(|why| Error::output(folder, why))?;
        Ok(Self { completed: done, file: Mutex::new(file) })
    }

    /// Appends a case. A case that cannot be written is run again by the next run.
    pub fn append(&self, case: &T) {
        if let (Ok(mut file), Ok(line)) = (self.file.lock(), serde_json::to_string(case)) {
            let _ = writeln!(file, "{line}");
        }
    }
}
