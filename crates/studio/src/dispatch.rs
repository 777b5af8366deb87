//! Dispatch of messages: from name and JSON body of a request to the JSON of the answer.

use crate::messages::*;
use crate::phantom_view::view;
use crate::preview::preview;
use crate::studio::{Snapshot, Studio};
use crate::{column_assignment, diagnosis_jobs, online_algorithm, phantom};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

impl Studio {
    /// Answers a message.
    ///
    /// # Errors
    /// [`Problem`] with reason and remedy; the state is then unchanged.
    pub fn call(&mut self, name: &str, body: &[u8]) -> Result<Vec<u8>, Problem> {
        self.collect_job();
        match name {
            "state" => json(self.state()?),
            "library" => json(phantom::library()),
            "inspect" => json(column_assignment::inspect(self, &required(body)?)?),
            "column" => json(column_assignment::set_column(self, parse(body)?)?),
            "rate" => json(column_assignment::set_rate(self, parse(body)?)?),
            "forget_map" => json(column_assignment::reset_map(self)?),
            "remove" => {
                self.workspace.remove(&required(body)?)?;
                self.unload_recordings();
                json(self.state()?)
            }
            "look" => json(online_algorithm::recording_view(self, parse(body)?)?),
            "enhance" => json(online_algorithm::write_enhancement(self, parse(body)?)?),
            "preview" => json(preview(self, parse::<FileRequest>(body)?.file.as_deref(), false)?),
            "edit" => json(self.edit(parse(body)?)?),
            "undo" => json(self.undo_or_redo(true)?),
            "redo" => json(self.undo_or_redo(false)?),
            "save" => json(phantom::save(self)?),
            "run" => json(phantom::run(self)?),
            "diagnose" => json(diagnosis_jobs::start_diagnosis(self, parse(body)?)?),
            "plan" => json(diagnosis_jobs::start_plan(self, parse(body)?)?),
            "predict" => json(diagnosis_jobs::start_prediction(self, parse(body)?)?),
            "job" => json(self.job.as_ref().map(|job| job.view())),
            "cancel" => {
                self.job.iter_mut().for_each(|job| job.cancel());
                json(self.job.as_ref().map(|job| job.view()))
            }
            "causes" => json(diagnosis_jobs::without_causes(self, parse(body)?)?),
            _ => Err(Problem::new(format!("there is no message {name:?}"))),
        }
    }

    /// Adds a recording to the workspace and inspects it.
    ///
    /// # Errors
    /// When it cannot be stored.
    pub fn add_file(&mut self, name: &str, from: &Path) -> Result<Vec<u8>, Problem> {
        let name = self.workspace.add(name, from)?;
        self.unload_recordings();
        column_assignment::adopt_proposal(self, &name)?;
        let found = column_assignment::inspect(self, &name);
        if found.is_err() {
            // No data for the page.
            self.workspace.remove(&name)?;
        }
        json(found?)
    }

    fn edit(&mut self, request: EditRequest) -> Result<EditView, Problem> {
        let changed = phantom::edited(self, &request.edit)?;
        let same_stroke = request.stroke.is_some() && request.stroke == self.stroke;
        let moved = changed != self.now.phantom;
        let stroke = if moved || same_stroke { request.stroke } else { None };
        self.change(Snapshot { phantom: changed, ..self.now.clone() }, !same_stroke, !request.transient)?;
        self.stroke = stroke;
        Ok(EditView {
            preview: preview(self, request.along.as_deref(), request.transient)?,
            phantom: view(&self.now.phantom)?,
            undo: self.undo.len(),
            redo: self.redo.len(),
        })
    }

    fn collect_job(&mut self) {
        if let Some(result) = self.job.as_mut().and_then(|job| job.take_result()) {
            diagnosis_jobs::collect(self, result);
        }
    }
}

fn json(value: impl Serialize) -> Result<Vec<u8>, Problem> {
    Ok(serde_json::to_vec(&value)?)
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(body).map_err(|why| Problem::new(format!("the message is invalid: {why}")))
}

/// The recording that a message must name.
fn required(body: &[u8]) -> Result<String, Problem> {
    let request: FileRequest = parse(body)?;
    request.file.ok_or_else(|| Problem::new("the message names no recording"))
}
