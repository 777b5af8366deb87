//! The studio: state of one workspace and the messages that change it. It knows nothing of HTTP: [`Studio::call`] maps the name and JSON body
//! of a request to the JSON of the answer, so that another transport can serve the same page.

use crate::explain::Explained;
use crate::job::Job;
use crate::messages::*;
use crate::workspace::{MAP, PHANTOM, Workspace};
use crate::{explain, look, open, phantom};
use serde::Serialize;
use serde::de::DeserializeOwned;
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

/// What undo restores.
#[derive(Clone, PartialEq)]
pub struct Snapshot {
    pub phantom: Scenario,
    pub map: Option<ColumnMap>,
}

/// One workspace and what is kept in memory of it.
pub struct Studio {
    pub(crate) workspace: Workspace,
    pub(crate) now: Snapshot,
    undo: Vec<Snapshot>,
    redo: Vec<Snapshot>,
    /// Movement of the mouse that the last edit belonged to.
    stroke: Option<u64>,
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
            Some(text) => phantom::parse(PHANTOM, &text)?,
            None => phantom::first()?,
        };
        let map = workspace.read(MAP).map(|text| stylet_scenario::parse(MAP, &text)).transpose();
        let map = map.map_err(|why| Problem::new(why.to_string()))?;
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

    /// Answers a message.
    ///
    /// # Errors
    /// [`Problem`] with reason and remedy; the state is then unchanged.
    pub fn call(&mut self, name: &str, body: &[u8]) -> Result<Vec<u8>, Problem> {
        self.collect_job();
        match name {
            "state" => json(&self.state()?),
            "library" => json(&phantom::library()),
            "inspect" => json(&open::inspect(self, &required(body)?)?),
            "column" => json(&open::set_column(self, parse(body)?)?),
            "forget_map" => json(&open::forget_map(self)?),
            "remove" => {
                let file = required(body)?;
                self.workspace.remove(&file)?;
                self.forget_recordings();
                json(&self.state()?)
            }
            "look" => json(&look::look(self, parse(body)?)?),
            "enhance" => json(&look::write_enhancement(self, parse(body)?)?),
            "preview" => {
                let request: FileRequest = parse(body)?;
                json(&phantom::preview(self, request.file.as_deref())?)
            }
            "edit" => json(&self.edit(parse(body)?)?),
            "undo" => json(&self.step_back(true)?),
            "redo" => json(&self.step_back(false)?),
            "save" => json(&phantom::save(self)?),
            "run" => json(&phantom::run(self)?),
            "diagnose" => json(&explain::start_diagnosis(self, parse(body)?)?),
            "plan" => json(&explain::start_plan(self, parse(body)?)?),
            "predict" => json(&explain::start_prediction(self, parse(body)?)?),
            "job" => json(&self.job.as_ref().map(|job| job.view())),
            "cancel" => {
                if let Some(job) = &mut self.job {
                    job.cancel();
                }
                json(&self.job.as_ref().map(|job| job.view()))
            }
            "causes" => json(&explain::without_causes(self, parse(body)?)?),
            _ => Err(Problem::new(format!("there is no message {name:?}"))),
        }
    }

    /// Adds a recording to the workspace and inspects it.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub fn add_file(&mut self, name: &str, from: &Path) -> Result<Vec<u8>, Problem> {
        let name = self.workspace.add(name, from)?;
        self.forget_recordings();
        open::adopt_proposal(self, &name)?;
        let found = open::inspect(self, &name);
        if found.is_err() {
            // Nothing that the page could show.
            self.workspace.remove(&name)?;
        }
        json(&found?)
    }

    /// Content of a result file.
    ///
    /// # Errors
    /// When the workspace has no such file.
    pub fn result_file(&self, folder: &str, name: &str) -> Result<Vec<u8>, Problem> {
        self.workspace.result_file(folder, name)
    }

    pub(crate) fn state(&self) -> Result<StateView, Problem> {
        Ok(StateView {
            version: env!("CARGO_PKG_VERSION"),
            folder: self.workspace.root().display().to_string(),
            files: self.workspace.files().to_vec(),
            map: self.now.map.as_ref().map(ColumnMap::to_ron),
            phantom: phantom::view(&self.now.phantom)?,
            commands: self.workspace.commands().to_vec(),
            undo: self.undo.len(),
            redo: self.redo.len(),
            job: self.job.as_ref().map(|job| job.view()),
            diagnosis: self.explained.diagnosis.as_ref().map(|d| d.view.clone()),
            plan: self.explained.plan.as_ref().map(|p| p.view.clone()),
            prediction: self.explained.prediction.clone(),
            limits: explain::limits(self),
        })
    }

    fn edit(&mut self, request: EditRequest) -> Result<EditView, Problem> {
        let changed = phantom::edited(self, &request.edit)?;
        let same_stroke = request.stroke.is_some() && request.stroke == self.stroke;
        let moved = changed != self.now.phantom;
        let stroke = if moved || same_stroke { request.stroke } else { None };
        self.change(Snapshot { phantom: changed, ..self.now.clone() }, !same_stroke, !request.transient)?;
        self.stroke = stroke;
        self.edit_view(request.along.as_deref())
    }

    fn edit_view(&mut self, along: Option<&str>) -> Result<EditView, Problem> {
        Ok(EditView {
            preview: phantom::preview(self, along)?,
            phantom: phantom::view(&self.now.phantom)?,
            undo: self.undo.len(),
            redo: self.redo.len(),
        })
    }

    /// Makes a change that undo takes back. A workspace that has a folder is kept up to date.
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

    fn set(&mut self, to: Snapshot, keep: bool) -> Result<(), Problem> {
        if to.map != self.now.map {
            self.forget_recordings();
        }
        self.now = to;
        if keep && self.workspace.exists() { self.keep() } else { Ok(()) }
    }

    /// Writes phantom and map.
    pub(crate) fn keep(&self) -> Result<(), Problem> {
        self.workspace.write(PHANTOM, phantom::ron(&self.now.phantom)?.as_bytes())?;
        match &self.now.map {
            Some(map) => self.workspace.write(MAP, map.to_ron().as_bytes()),
            None => {
                // There may be none.
                let _ = std::fs::remove_file(self.workspace.path(MAP));
                Ok(())
            }
        }
    }

    fn step_back(&mut self, back: bool) -> Result<StateView, Problem> {
        let (from, to) =
            if back { (&mut self.undo, &mut self.redo) } else { (&mut self.redo, &mut self.undo) };
        if let Some(snapshot) = from.pop() {
            to.push(self.now.clone());
            self.set(snapshot, true)?;
        }
        self.stroke = None;
        self.state()
    }

    fn forget_recordings(&mut self) {
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
        let read = stylet_api::read_recordings(&[self.workspace.data(file)?], &self.read_options())
            .map_err(|why| Problem::new(why.to_string()))?;
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

    fn collect_job(&mut self) {
        if let Some(result) = self.job.as_mut().and_then(|job| job.take_result()) {
            explain::collect(self, result);
        }
    }
}

fn json(value: &impl Serialize) -> Result<Vec<u8>, Problem> {
    serde_json::to_vec(value).map_err(|why| Problem::new(format!("internal error: {why}; please report it")))
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(body).map_err(|why| Problem::new(format!("the message is invalid: {why}")))
}

/// The recording that a message must name.
fn required(body: &[u8]) -> Result<String, Problem> {
    let request: FileRequest = parse(body)?;
    request.file.ok_or_else(|| Problem::new("the message names no recording"))
}
