//! State of one workspace, independent of HTTP: `Studio::call` maps the name and JSON body of a request to the JSON of the answer, so
//! that another transport can serve the same page.

use crate::messages::*;
use crate::phantom_view::{self, view};
use crate::results::{Explained, Job, limits};
use crate::workspace::{MAP, PHANTOM, Workspace};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_api::{AlgorithmRun, ColumnMap, NamedRecording, ReadOptions, Recording, Scenario};
use stylet_record::QualityNote;

/// Steps that can be undone.
const MAX_UNDO: usize = 100;
/// Recordings kept in memory.
const MAX_LOADED: usize = 4;

/// A recording in memory.
pub struct Loaded {
    pub recording: Recording,
    pub notes: Vec<QualityNote>,
}

/// State restored by undo.
#[derive(Clone, PartialEq)]
pub struct Snapshot {
    pub phantom: Scenario,
    pub map: Option<ColumnMap>,
}

/// One workspace with its data in memory.
pub struct Studio {
    pub(crate) workspace: Workspace,
    pub(crate) now: Snapshot,
    pub(crate) undo: Vec<Snapshot>,
    pub(crate) redo: Vec<Snapshot>,
    /// Mouse drag of the last edit.
    pub(crate) stroke: Option<u64>,
    loaded: Vec<(String, Arc<Loaded>)>,
    /// Outputs of the online algorithm for the recording shown last.
    pub(crate) enhanced: Vec<(String, Arc<AlgorithmRun>)>,
    pub(crate) job: Option<Job>,
    pub(crate) explained: Explained,
}

impl Studio {
    /// Opens the workspace in a folder, which may be new, and adds recordings to it.
    ///
    /// # Errors
    /// When the folder holds an invalid workspace, or a recording cannot be read.
    pub fn open(folder: &Path, files: &[impl AsRef<Path>]) -> Result<Self, Problem> {
        let workspace = Workspace::open(folder)?;
        let phantom = match workspace.read(PHANTOM) {
            Some(text) => phantom_view::parse(PHANTOM, &text)?,
            None => phantom_view::first()?,
        };
        let map = workspace.read(MAP).map(|text| stylet_scenario::parse(MAP, &text)).transpose()?;
        let explained = Explained::read(&workspace);
        let mut studio = Self {
            workspace,
            now: Snapshot { phantom, map },
            undo: Vec::new(),
            redo: Vec::new(),
            stroke: None,
            loaded: Vec::new(),
            enhanced: Vec::new(),
            job: None,
            explained,
        };
        for file in files {
            let file = file.as_ref();
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            if !file.is_file() {
                return Err(Problem::new(format!("{}: there is no such file", file.display())));
            }
            studio.add_file(&name, file)?;
        }
        Ok(studio)
    }

    /// Folder of the workspace.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.workspace.root()
    }

    /// Content of a result file.
    ///
    /// # Errors
    /// When the workspace has no such file.
    pub fn result_file(&self, folder: &str, name: &str) -> Result<Vec<u8>, Problem> {
        self.workspace.result_file(folder, name)
    }

    /// State of the page, without curves.
    pub(crate) fn state(&self) -> Result<Value, Problem> {
        Ok(json!({
            "version": env!("CARGO_PKG_VERSION"),
            "folder": self.workspace.root(),
            "files": self.workspace.files(),
            "map": self.now.map.as_ref().map(ColumnMap::to_ron),
            "phantom": view(&self.now.phantom)?,
            "commands": self.workspace.commands(),
            "undo": self.undo.len(),
            "redo": self.redo.len(),
            "job": self.job.as_ref().map(|job| job.view()),
            "diagnosis": self.explained.diagnosis.as_ref().map(|d| &d.view),
            "plan": self.explained.plan.as_ref().map(|p| &p.view),
            "prediction": self.explained.prediction,
            "limits": limits(&self.workspace, &self.now.phantom),
        }))
    }

    /// Makes an undoable change. A workspace with a folder is updated on disk.
    pub(crate) fn change(&mut self, to: Snapshot, step: bool, keep: bool) -> Result<(), Problem> {
        if step && to != self.now {
            self.undo.push(self.now.clone());
            let surplus = self.undo.len().saturating_sub(MAX_UNDO);
            self.undo.drain(..surplus);
            self.redo.clear();
        }
        self.stroke = None;
        self.set(to, keep)
    }

    pub(crate) fn set(&mut self, to: Snapshot, keep: bool) -> Result<(), Problem> {
        if to.map != self.now.map {
            self.forget_recordings();
        }
        self.now = to;
        if keep && self.workspace.exists() { self.keep() } else { Ok(()) }
    }

    /// Writes phantom and map.
    pub(crate) fn keep(&self) -> Result<(), Problem> {
        self.workspace.write(PHANTOM, phantom_view::ron(&self.now.phantom)?.as_bytes())?;
        match &self.now.map {
            Some(map) => self.workspace.write(MAP, map.to_ron().as_bytes()),
            None => {
                // The file may not exist.
                let _ = std::fs::remove_file(self.workspace.path(MAP));
                Ok(())
            }
        }
    }

    pub(crate) fn step_back(&mut self, back: bool) -> Result<Value, Problem> {
        let (from, to) =
            if back { (&mut self.undo, &mut self.redo) } else { (&mut self.redo, &mut self.undo) };
        if let Some(snapshot) = from.pop() {
            to.push(self.now.clone());
            self.set(snapshot, true)?;
        }
        self.stroke = None;
        self.state()
    }

    pub(crate) fn forget_recordings(&mut self) {
        self.loaded.clear();
        self.enhanced.clear();
    }

    /// File of the column map, when there is one.
    pub(crate) fn map_file(&self) -> Option<PathBuf> {
        self.now.map.as_ref().map(|_| self.workspace.path(MAP))
    }

    pub(crate) fn read_options(&self) -> ReadOptions {
        ReadOptions { columns: self.now.map.clone(), repair: false }
    }

    /// A recording of the workspace.
    pub(crate) fn recording(&mut self, file: &str) -> Result<Arc<Loaded>, Problem> {
        if let Some((_, loaded)) = self.loaded.iter().find(|(name, _)| name == file) {
            return Ok(loaded.clone());
        }
        let read = stylet_api::read_recordings(&[self.workspace.data(file)?], &self.read_options())?;
        let Some(NamedRecording { recording, notes, .. }) = read.into_iter().next() else {
            return Err(Problem::new("internal error: nothing was read; please report it"));
        };
        let loaded = Arc::new(Loaded { recording, notes });
        if self.loaded.len() >= MAX_LOADED {
            self.loaded.remove(0);
        }
        self.loaded.push((file.to_owned(), loaded.clone()));
        Ok(loaded)
    }
}
