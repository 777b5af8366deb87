//! Results of the workspace: diagnosis, plan, prediction, and how the page shows a diagnosis.

use crate::background_job::BackgroundJob;
use crate::messages::*;
use crate::phantom_view::{millimetres, title};
use crate::sliders::{named, rounded};
use crate::workspace::{LIMITS, Workspace};
use serde_json::{Value, json};
use stylet_api::{Diagnosis, Limits, Scenario};
use stylet_report::pages::diagnosis::{recording_differences, summary_sentence};
use stylet_report::significant;
use stylet_scenario::Motion;
use stylet_tissue::known_effect_info;

pub const DIAGNOSIS: &str = "diagnosis";
pub const EXTENDED: &str = "diagnosis/extended.ron";
/// Limits of the next insertion before the user changes them; the depth is that of the phantom.
const DEFAULT_LIMITS: Limits =
    Limits { depth_m: 0.0, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0 };

/// A job of the studio.
pub type Job = BackgroundJob<JobResult>;

/// A finished diagnosis.
pub struct FinishedDiagnosis {
    pub view: Value,
    /// Ids of the identified effects.
    pub causes: Vec<String>,
    pub extended: Scenario,
}

impl FinishedDiagnosis {
    pub fn new(diagnosis: &Diagnosis, extended: Scenario) -> Self {
        let causes = diagnosis.causes.iter().map(|cause| cause.effect.clone()).collect();
        Self { view: diagnosis_view(diagnosis), causes, extended }
    }
}

/// A plan.
pub struct FinishedPlan {
    pub view: Value,
    pub motion: Motion,
}

/// Result of a job: the command that reproduces it, and the change of the results.
pub type JobResult = (CommandView, Box<dyn FnOnce(&mut WorkspaceResults) + Send>);

/// The results in the workspace.
#[derive(Default)]
pub struct WorkspaceResults {
    pub diagnosis: Option<FinishedDiagnosis>,
    pub plan: Option<FinishedPlan>,
    pub prediction: Option<Value>,
}

impl WorkspaceResults {
    /// The diagnosis of a workspace.
    pub fn read(workspace: &Workspace) -> Self {
        let read = || {
            let diagnosis = serde_json::from_str(&workspace.read("diagnosis/diagnosis.json")?).ok()?;
            Some(FinishedDiagnosis::new(
                &diagnosis,
                Scenario::parse(EXTENDED, &workspace.read(EXTENDED)?).ok()?,
            ))
        };
        Self { diagnosis: read(), ..Self::default() }
    }

    pub fn extended(&self) -> Result<Scenario, Problem> {
        let missing = || Problem::new("there is no diagnosis yet");
        let mut scenario = self.diagnosis.as_ref().ok_or_else(missing)?.extended.clone();
        if scenario.name.trim().is_empty() {
            scenario.name = "extended".to_owned();
        }
        Ok(scenario)
    }

    pub fn planned_motion(&self) -> Result<Motion, Problem> {
        self.plan.as_ref().map(|p| p.motion.clone()).ok_or_else(|| Problem::new("there is no plan yet"))
    }
}

fn diagnosis_view(d: &Diagnosis) -> Value {
    let number = |x: f64| significant(x, 4);
    let interval = |low: f64, high: f64| format!("{} to {}", number(low), number(high));
    let causes = d.causes.iter().map(|c| {
        let mut lines = vec![format!("confidence {}", significant(c.confidence, 3))];
        let info = |path: &str| known_effect_info(&c.effect)?.parameters.iter().find(|p| p.path == path);
        lines.extend(c.parameters.iter().map(|(path, e)| {
            let (name, unit) = info(path).map_or((path.as_str(), ""), |p| (p.meaning, p.unit));
            format!("{name}: {} {unit} (95 %: {})", number(e.value), interval(e.low, e.high))
        }));
        if !c.equivalent.is_empty() {
            lines.push(format!("equivalent: {}", c.equivalent.join(", ")));
        }
        json!({ "id": c.effect, "title": title(&c.effect), "lines": lines })
    });
    let rows = d.base_parameters.iter().map(|p| {
        let whose = if p.layer == 0 { "tissue".to_owned() } else { format!("layer {}", p.layer) };
        let label =
            d.parameters.iter().find(|l| l.effect.is_none() && l.layer == p.layer && l.name == p.name);
        let open = label.map(|l| l.label_in_words()).filter(|words| words != "determined");
        let remark = match (open, p.at_bound, p.changed) {
            (Some(open), ..) => open,
            (None, true, _) => "at its bound".to_owned(),
            (None, _, true) => "changed".to_owned(),
            _ => String::new(),
        };
        let (label, unit, factor) = named(&p.name);
        let [assumed, value, low, high] = [p.assumed, p.value, p.low, p.high].map(|x| factor * x);
        json!([
            whose,
            format!("{label} ({unit})"),
            number(assumed),
            number(value),
            interval(low, high),
            remark
        ])
    });
    let g = &d.gain;
    let what = if g.held_out { "on held-out recordings" } else { "on the one recording, which was fitted" };
    let notes = d.data_quality.iter().map(|q| format!("{}: {}", q.recording, q.note.message));
    json!({
        "sentence": summary_sentence(d),
        "verdict": format!("{:?}", d.verdict).to_lowercase(),
        "files": g.recordings,
        "causes": causes.collect::<Value>(),
        "gain": format!(
            "Residual {what}: {} N before, {} N after; noise {} N. {}",
            significant(g.rmse_before_n, 3),
            significant(g.rmse_after_n, 3),
            significant(g.floor_n, 3),
            d.grade.as_ref().map_or_else(String::new, |grade| format!("Of the model: {}.", grade.sentence()))
        ),
        "parameters": {
            "head": ["", "parameter", "assumed", "fitted", "95 %", ""],
            "rows": rows.collect::<Value>(),
        },
        "notes": recording_differences(d).into_iter().chain(d.advice.iter().cloned()).chain(notes).collect::<Value>(),
        "not_identifiable": d.not_identifiable.iter().map(|id| title(id)).collect::<Value>(),
        "folder": DIAGNOSIS,
    })
}

/// The limits of the workspace, or those at first.
pub fn limits(workspace: &Workspace, phantom: &Scenario) -> LimitsView {
    let kept = workspace.read(LIMITS).and_then(|text| stylet_scenario::parse(LIMITS, &text).ok());
    let depth_m = rounded(phantom.tissue.end_m());
    let l: Limits = kept.unwrap_or(Limits { depth_m, ..DEFAULT_LIMITS });
    LimitsView {
        depth_mm: millimetres(l.depth_m),
        speed_mm_per_s: millimetres(l.speed_mps),
        acceleration_mm_per_s2: millimetres(l.acceleration_mps2),
        duration_s: l.duration_s,
        force_n: l.force_n,
    }
}
