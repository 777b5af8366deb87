//! The workspace: one folder with the recordings (`data/`), `columns.ron`, `phantom.ron`, a folder per result, and `workspace.json`, which
//! lists recordings and commands. The folder is made with its first file.

use crate::messages::{CommandView, Problem};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use stylet_api::output_files::to_json_bytes;
use stylet_api::output_folder::write_file_atomically;

/// Recordings that a workspace holds at most.
const MAX_FILES: usize = 64;
/// Commands that are kept.
const MAX_COMMANDS: usize = 200;
/// Longest name of a recording in characters.
const MAX_NAME: usize = 80;
const JOURNAL: &str = "workspace.json";
pub const MAP: &str = "columns.ron";
pub const PHANTOM: &str = "phantom.ron";
pub const LIMITS: &str = "limits.ron";

/// `workspace.json`.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Journal {
    files: Vec<String>,
    commands: Vec<CommandView>,
}

/// The folder and its journal.
#[derive(Debug)]
pub struct Workspace {
    root: PathBuf,
    journal: Journal,
}

impl Workspace {
    /// The workspace of a folder, which may be new.
    ///
    /// # Errors
    /// When its `workspace.json` is invalid.
    pub fn open(root: &Path) -> Result<Self, Problem> {
        let path = root.join(JOURNAL);
        let mut journal = match fs::read(&path) {
            Ok(text) => serde_json::from_slice(&text).map_err(|why| {
                Problem::new(format!("{}: {why}; name another folder with --out", path.display()))
            })?,
            Err(_) => Journal::default(),
        };
        // Names in a file are untrusted.
        journal
            .files
            .retain(|name| file_name(name).as_ref() == Some(name) && root.join("data").join(name).is_file());
        Ok(Self { root: root.to_owned(), journal })
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    pub fn exists(&self) -> bool {
        self.root.exists()
    }

    pub fn files(&self) -> &[String] {
        &self.journal.files
    }

    pub fn commands(&self) -> &[CommandView] {
        &self.journal.commands
    }

    /// Path of a file or folder of the workspace.
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Path of a recording.
    ///
    /// # Errors
    /// When there is no such recording.
    pub fn data(&self, file: &str) -> Result<PathBuf, Problem> {
        match self.journal.files.iter().any(|known| known == file) {
            true => Ok(self.root.join("data").join(file)),
            false => Err(Problem::new(format!("the workspace has no recording {file:?}; drop it again"))),
        }
    }

    pub fn read(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.path(name)).ok()
    }

    /// Writes a file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), Problem> {
        let path = self.path(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|why| cannot_write(folder, &why))?;
        }
        Ok(write_file_atomically(&path, content)?)
    }

    /// Adds a recording under a safe name, which is returned. Where another file has that name, the new one gets a number:
    /// `recording-2.csv`.
    ///
    /// # Errors
    /// When the name is unusable, or the file cannot be stored.
    pub fn add(&mut self, name: &str, from: &Path) -> Result<String, Problem> {
        let name = file_name(name)
            .ok_or_else(|| Problem::new("the file needs a name; rename it and drop it again"))?;
        let name = self.free_name(&name, from);
        if self.journal.files.len() >= MAX_FILES && !self.journal.files.contains(&name) {
            return Err(Problem::new(format!(
                "a workspace holds at most {MAX_FILES} recordings; remove one first"
            )));
        }
        let to = self.root.join("data").join(&name);
        let folder = self.root.join("data");
        fs::create_dir_all(&folder).map_err(|why| cannot_write(&folder, &why))?;
        fs::copy(from, &to).map_err(|why| cannot_write(&to, &why))?;
        if !self.journal.files.contains(&name) {
            self.journal.files.push(name.clone());
        }
        self.write_journal()?;
        Ok(name)
    }

    /// The name, with a number where another file than `from` has it.
    fn free_name(&self, name: &str, from: &Path) -> String {
        let is_taken = |name: &str| {
            self.journal.files.iter().any(|known| known == name)
                && fs::read(self.root.join("data").join(name)).ok() != fs::read(from).ok()
        };
        let (stem, ending) = name.rfind('.').map_or((name, ""), |dot| name.split_at(dot));
        let numbered = |k: usize| if k == 1 { name.to_owned() } else { format!("{stem}-{k}{ending}") };
        (1..=MAX_FILES + 1).map(numbered).find(|name| !is_taken(name)).unwrap_or_else(|| name.to_owned())
    }

    /// Removes a recording from the workspace.
    ///
    /// # Errors
    /// When there is no such recording.
    pub fn remove(&mut self, file: &str) -> Result<(), Problem> {
        let path = self.data(file)?;
        self.journal.files.retain(|known| known != file);
        fs::remove_file(&path).map_err(|why| cannot_write(&path, &why))?;
        self.write_journal()
    }

    /// Adds a command to the list.
    ///
    /// # Errors
    /// When the journal cannot be written.
    pub fn record(&mut self, command: CommandView) -> Result<(), Problem> {
        let commands = &mut self.journal.commands;
        if commands.last() != Some(&command) {
            commands.push(command);
            let surplus = commands.len().saturating_sub(MAX_COMMANDS);
            commands.drain(..surplus);
        }
        self.write_journal()
    }

    fn write_journal(&self) -> Result<(), Problem> {
        let json = to_json_bytes(&self.journal)?;
        self.write(JOURNAL, &json)
    }

    /// Content of a result file; `folder` and `name` are single names inside the workspace.
    ///
    /// # Errors
    /// When there is no such file.
    pub fn result_file(&self, folder: &str, name: &str) -> Result<Vec<u8>, Problem> {
        let none = || Problem::new("the workspace has no such file");
        let plain = |part: &str| file_name(part).is_some_and(|safe| safe == part);
        let path = self.root.join(folder).join(name);
        let inside = path.canonicalize().ok().zip(self.root.canonicalize().ok());
        if !(plain(folder) && plain(name) && inside.is_some_and(|(path, root)| path.starts_with(root))) {
            return Err(none());
        }
        fs::read(path).map_err(|_| none())
    }
}

fn cannot_write(path: &Path, why: &std::io::Error) -> Problem {
    Problem::new(format!(
        "{}: cannot be written: {why}; free space, or start with another --out",
        path.display()
    ))
}

/// The last part of a path as a safe file name: letters, digits, `.`, `-`, `_`, not hidden; `None` when nothing is left.
pub fn file_name(given: &str) -> Option<String> {
    let last = given.rsplit(['/', '\\']).next().unwrap_or_default();
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '.' | '-' | '_') { c } else { '_' };
    let name: String = last.chars().map(safe).collect();
    let name = name.trim_start_matches('.');
    let surplus = name.chars().count().saturating_sub(MAX_NAME);
    // Keep the extension.
    let name: String = name.chars().skip(surplus).collect();
    let name = name.trim_start_matches('.');
    (!name.is_empty()).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_recordings_of_one_name_are_both_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut workspace = Workspace::open(&folder.path().join("workspace")).expect("a workspace");
        let mut add = |folder_name: &str, text: &str| {
            let from = folder.path().join(folder_name);
            fs::create_dir_all(&from).expect("a folder");
            fs::write(from.join("recording.csv"), text).expect("a file");
            workspace.add("recording.csv", &from.join("recording.csv")).expect("added")
        };
        assert_eq!(add("a", "1"), "recording.csv");
        assert_eq!(add("b", "2"), "recording-2.csv");
        // The same file again is no other one.
        assert_eq!(add("a", "1"), "recording.csv");
        assert_eq!(workspace.files(), ["recording.csv", "recording-2.csv"]);
    }
}
