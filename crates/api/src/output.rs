//! Writing results so that nothing half-written is ever left behind: every file is written beside
//! its place under another name and moved there when all are complete.

use crate::error::Error;
use std::io;
use std::path::{Path, PathBuf};

/// Files of one output folder, waiting to be written together.
#[derive(Debug, Default)]
pub struct Output {
    files: Vec<(&'static str, Vec<u8>)>,
}

impl Output {
    /// Adds a file.
    pub fn add(&mut self, name: &'static str, content: impl Into<Vec<u8>>) {
        self.files.push((name, content.into()));
    }

    /// Names and contents.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &[u8])> {
        self.files.iter().map(|(name, content)| (*name, content.as_slice()))
    }

    /// Writes all files into `folder`, which is made when it does not exist. Files of the same names
    /// are replaced, others are left alone.
    ///
    /// # Errors
    /// [`Error::Output`]; the folder is then as it was before.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        let failed = |why| Error::Output { path: folder.display().to_string(), why };
        // What is made here goes again when the writing fails.
        let made: Vec<&Path> =
            folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists()).collect();
        let result = self
            .no_folder_in_the_way(folder)
            .and_then(|()| std::fs::create_dir_all(folder))
            .and_then(|()| self.write_beside(folder));
        if result.is_err() {
            for folder in made {
                // Only empty folders go.
                let _ = std::fs::remove_dir(folder);
            }
        }
        result.map_err(failed)
    }

    /// A file cannot take the place of a folder of the same name.
    fn no_folder_in_the_way(&self, folder: &Path) -> io::Result<()> {
        match self.files.iter().map(|(name, _)| folder.join(name)).find(|place| place.is_dir()) {
            Some(place) => Err(io::Error::other(format!("{} is a folder", place.display()))),
            None => Ok(()),
        }
    }

    fn write_beside(&self, folder: &Path) -> io::Result<()> {
        let beside: Vec<(PathBuf, PathBuf)> = self
            .files
            .iter()
            .map(|(name, _)| (folder.join(format!(".{name}.{}.part", std::process::id())), folder.join(name)))
            .collect();
        let written = beside
            .iter()
            .zip(&self.files)
            .try_for_each(|((part, _), (_, content))| std::fs::write(part, content));
        let moved =
            written.and_then(|()| beside.iter().try_for_each(|(part, place)| std::fs::rename(part, place)));
        if moved.is_err() {
            for (part, _) in &beside {
                let _ = std::fs::remove_file(part);
            }
        }
        moved
    }
}
