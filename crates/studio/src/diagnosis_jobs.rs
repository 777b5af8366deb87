//! Diagnosis, plan and prediction, each in a separate thread.

use crate::commands;
use crate::messages::*;
use crate::phantom_view::{segment_text, title};
use crate::preview::{curves, rms_text};
use crate::studio::Studio;
use crate::workspace::{LIMITS, PHANTOM};
use crate::workspace_results::{
    DIAGNOSIS, EXTENDED, FinishedDiagnosis, FinishedPlan, Job, JobResult, WorkspaceResults,
};
use serde_json::{Value, json};
use stylet_api::plan_insertion::{self, PlanReport};
use stylet_api::prediction_files::{self, ModelOrigin};
use stylet_api::{DiagnoseOptions, DiagnosisInputs, Limits, Scenario, force_along_motion};
use stylet_report::pages::formatting::significant_or_dash;
use stylet_report::pages::prediction;
use stylet_report::{percent, significant};
use stylet_scenario::Motion;
use stylet_tissue::Effect as _;

const PLAN: &str = "plan";
const PREDICTION: &str = "prediction";
/// Points of the curves without some of the causes.
const MAX_POINTS: usize = 3000;
/// Pairs of candidates that are listed.
const MAX_PAIRS: usize = 8;

/// Phantom, recordings and map as files, for a job.
fn inputs(studio: &mut Studio, files: &[String]) -> Result<DiagnosisInputs, Problem> {
    if studio.job.as_ref().is_some_and(Job::is_running) {
        return Err(Problem::new("another computation is running; wait for it or cancel it"));
    }
    studio.save_workspace()?;
    Ok(DiagnosisInputs {
        scenario: studio.workspace.path(PHANTOM),
        effects: Vec::new(),
        data: files.iter().map(|file| studio.workspace.data(file)).collect::<Result<_, _>>()?,
        columns: studio.map_file(),
        repair: false,
    })
}

/// Starts a job; returns its state for the page.
fn start_job(
    studio: &mut Studio,
    kind: &'static str,
    work: impl FnOnce(&dyn Fn(&str)) -> Result<JobResult, Problem> + Send + 'static,
) -> Result<Value, Problem> {
    let job = Job::start(kind, work)?;
    let view = job.view();
    studio.job = Some(job);
    Ok(view)
}

/// Stores the result of a job in the state.
pub fn collect(studio: &mut Studio, (command, update): JobResult) {
    update(&mut studio.results);
    // The results are complete; an unwritable journal is reported at the next change.
    let _ = studio.workspace.record(command);
}

pub fn start_diagnosis(studio: &mut Studio, request: FilesRequest) -> Result<Value, Problem> {
    if request.files.is_empty() {
        return Err(Problem::new("choose at least one recording"));
    }
    let inputs = inputs(studio, &request.files)?;
    let folder = studio.workspace.path(DIAGNOSIS);
    start_job(studio, "diagnose", move |stage| {
        stage("reading the recordings");
        let assumed = inputs.load_scenario()?;
        let recordings = inputs.read_recordings()?;
        let found = stylet_api::diagnose(&assumed, &recordings, &DiagnoseOptions::default(), stage)?;
        let output = found.output(&assumed, &inputs)?;
        stage("writing the results");
        output.write(&folder)?;
        let diagnosed = FinishedDiagnosis::new(&found.diagnosis, found.extended);
        // Plan and prediction belong to the previous diagnosis.
        let update = |now: &mut WorkspaceResults| {
            *now = WorkspaceResults { diagnosis: Some(diagnosed), ..WorkspaceResults::default() }
        };
        Ok((commands::diagnose(&inputs, &folder, &output), Box::new(update)))
    })
}

pub fn start_plan(studio: &mut Studio, request: PlanRequest) -> Result<Value, Problem> {
    let l = &request.limits;
    let limits = Limits {
        depth_m: 1e-3 * l.depth_mm,
        speed_mps: 1e-3 * l.speed_mm_per_s,
        acceleration_mps2: 1e-3 * l.acceleration_mm_per_s2,
        duration_s: l.duration_s,
        force_n: l.force_n,
    };
    limits.check()?;
    let inputs = inputs(studio, &request.files)?;
    let ron = stylet_scenario::ron_options().to_string(&limits)?;
    studio.workspace.write(LIMITS, format!("Limits{ron}\n").as_bytes())?;
    let limits_file = studio.workspace.path(LIMITS);
    let motion_file = studio.workspace.path("plan/plan.ron");
    start_job(studio, "plan", move |stage| {
        let limits = plan_insertion::load_limits(&limits_file)?;
        let report = plan_insertion::plan(&inputs, (&limits_file, &limits), false, stage)?;
        stage("writing the plan");
        report.write(&motion_file)?;
        let planned = FinishedPlan { view: plan_view(&report), motion: report.plan.motion.clone() };
        let update = |now: &mut WorkspaceResults| now.plan = Some(planned);
        Ok((commands::plan(&inputs, &limits_file, &motion_file), Box::new(update)))
    })
}

fn whole_percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn plan_view(report: &PlanReport) -> Value {
    let plan = &report.plan;
    let mut pairs: Vec<_> = plan.pairs.iter().filter(|p| p.distinguishable).collect();
    pairs.sort_by(|a, b| a.nats_after.total_cmp(&b.nats_after));
    let decided = match pairs.is_empty() {
        true => "no remaining pair of candidates can be distinguished within these limits".to_owned(),
        false => format!(
            "the next diagnosis names the right cause with probability {}, now {}",
            whole_percent(plan.probability_decided),
            whole_percent(plan.probability_now)
        ),
    };
    let segments: Vec<_> = match &plan.motion {
        Motion::Program { segments, .. } => segments.iter().map(segment_text).collect(),
        _ => Vec::new(),
    };
    let rows = pairs.iter().take(MAX_PAIRS).map(|p| {
        json!([title(&p.a), title(&p.b), significant(p.nats_before, 2), significant(p.nats_after, 3)])
    });
    json!({
        "summary": format!(
            "{} s, to {} mm, at most {} N expected: {decided}.",
            significant(plan.duration_s, 3),
            significant(1e3 * plan.depth_m, 3),
            significant(plan.force_n, 3)
        ),
        "segments": segments,
        "pairs": rows.collect::<Value>(),
        "folder": PLAN,
    })
}

pub fn start_prediction(studio: &mut Studio, request: FilesRequest) -> Result<Value, Problem> {
    if request.files.is_empty() {
        return Err(Problem::new("choose the recording of the next insertion"));
    }
    let inputs = inputs(studio, &request.files)?;
    let model = match &studio.results.diagnosis {
        Some(_) => studio.workspace.path(EXTENDED),
        None => inputs.scenario.clone(),
    };
    let folder = studio.workspace.path(PREDICTION);
    start_job(studio, "predict", move |stage| {
        stage("reading the recordings");
        let scenario = Scenario::load(&model)?;
        let ModelOrigin { diagnosis, assumed } = ModelOrigin::of_model_file(&model, None)?;
        let recordings = inputs.read_recordings()?;
        stage("predicting");
        let options = stylet_api::PredictionOptions::default();
        let (diagnosis, assumed) = (diagnosis.as_ref(), assumed.as_ref());
        let found = stylet_api::predict_recordings(&scenario, diagnosis, assumed, &options, &recordings)?;
        let output = prediction_files::output_files(&scenario, &model, &found)?;
        stage("writing the results");
        output.write(&folder)?;
        let p = &found.prediction;
        let rows = p.recordings.iter().map(|r| {
            let assumed = significant_or_dash(r.assumed_rmse_n, 1.0, 3);
            json!([r.name, significant(r.rmse_n, 3), assumed, percent(r.band_coverage)])
        });
        let view = json!({
            "sentence": prediction::summary_sentence(p),
            "rows": rows.collect::<Value>(),
            "folder": PREDICTION,
        });
        let update = |now: &mut WorkspaceResults| now.prediction = Some(view);
        Ok((commands::predict(&model, &inputs, &folder, &output), Box::new(update)))
    })
}

/// Measured force, that of the phantom, and, after a diagnosis, that of its model with some of the causes.
pub fn without_causes(studio: &mut Studio, request: CausesRequest) -> Result<CausesView, Problem> {
    let loaded = studio.recording(&request.file)?;
    let measured_n = &loaded.recording.force_n;
    let assumed_n = force_along_motion(&studio.now.phantom, &loaded.recording)?;
    let mut forces =
        vec![("measured", "measured", measured_n.as_slice()), ("assumed", "phantom", &assumed_n)];
    let mut summary = format!(
        "error with the ruptures where the model has them: phantom {}",
        rms_text(measured_n, &assumed_n)
    );
    let model_n = match &studio.results.diagnosis {
        Some(diagnosed) => {
            let switched_off = |id: &str| {
                diagnosed.causes.iter().any(|cause| cause == id) && !request.causes.iter().any(|on| on == id)
            };
            let mut model = diagnosed.extended.clone();
            model.effects.retain(|e| !switched_off(e.info().id));
            force_along_motion(&model, &loaded.recording)?
        }
        None => Vec::new(),
    };
    if !model_n.is_empty() {
        forces.push(("extended", "diagnosed model", &model_n));
        summary += &format!(
            ", diagnosed model with the causes that are switched on {}",
            rms_text(measured_n, &model_n)
        );
    }
    Ok(CausesView { curves: curves(&loaded.recording, &forces, MAX_POINTS), summary })
}
