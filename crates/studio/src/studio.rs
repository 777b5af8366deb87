//! State of one workspace, independent of HTTP: `Studio::call` maps the name and JSON body of a request to the JSON of the answer, so
//! that another transport can serve the same page.

use crate::messages::*;
use crate::phantom_view::{self, view};
use crate::workspace::{MAP, PHANTOM, Workspace};
use crate::workspace_results::{Job, WorkspaceResults, limits};
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
pub struct LoadedRecording {
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
    loaded: Vec<(String, Arc<LoadedRecording>)>,
    /// Outputs of the online algorithm for the recording shown last.
    pub(crate) enhanced: Vec<(String, Arc<AlgorithmRun>)>,
    pub(crate) job: Option<Job>,
    pub(crate) results: WorkspaceResults,
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
        let results = WorkspaceResults::read(&workspace);
        let mut studio = Self {
            workspace,
            now: Snapshot { phantom, map },
            undo: Vec::new(),
            redo: Vec::new(),
            stroke: None,
            loaded: Vec::new(),
            enhanced: Vec::new(),
            job: None,
            results,
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
            "diagnosis": self.results.diagnosis.as_ref().map(|d| &d.view),
            "plan": self.results.plan.as_ref().map(|p| &p.view),
            "prediction": self.results.prediction,
            "limits": limits(&self.workspace, &self.now.phantom),
        }))
    }

    /// Makes an undoable change. A workspace with a folder is updated on disk.
    pub(crate) fn change(&mut self, to: Snapshot, undoable: bool, write: bool) -> Result<(), Problem> {
        if undoable && to != self.now {
            self.undo.push(self.now.clone());
            let surplus = self.undo.len().saturating_sub(MAX_UNDO);
            self.undo.drain(..surplus);
            self.redo.clear();
        }
        self.stroke = None;
        self.restore(to, write)
    }

    pub(crate) fn restore(&mut self, to: Snapshot, write: bool) -> Result<(), Problem> {
        if to.map != self.now.map {
            self.unload_recordings();
        }
        self.now = to;
        if write && self.workspace.exists() { self.save_workspace() } else { Ok(()) }
    }

    /// Writes phantom and map.
    pub(crate) fn save_workspace(&self) -> Result<(), Problem> {
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

    pub(crate) fn undo_or_redo(&mut self, undo: bool) -> Result<Value, Problem> {
        let (from, to) =
            if undo { (&mut self.undo, &mut self.redo) } else { (&mut self.redo, &mut self.undo) };
        if let Some(snapshot) = from.pop() {
            to.push(self.now.clone());
            self.restore(snapshot, true)?;
        }
        self.stroke = None;
        self.state()
    }

    pub(crate) fn unload_recordings(&mut self) {
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
    pub(crate) fn recording(&mut self, file: &str) -> Result<Arc<LoadedRecording>, Problem> {
        if let Some((_, loaded)) = self.loaded.iter().find(|(name, _)| name == file) {
            return Ok(loaded.clone());
        }
        let read = stylet_api::read_recordings(&[self.workspace.data(file)?], &self.read_options())?;
        let Some(NamedRecording { recording, notes, .. }) = read.into_iter().next() else {
            return Err(Problem::new("internal error: nothing was read; please report it"));
        };
        let loaded = Arc::new(LoadedRecording { recording, notes });
        if self.loaded.len() >= MAX_LOADED {
            self.loaded.remove(0);
        }
        self.loaded.push((file.to_owned(), loaded.clone()));
        Ok(loaded)
    }
}
