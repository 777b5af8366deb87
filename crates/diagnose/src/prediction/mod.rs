//! A model against recordings that took no part in making it: the next day, another needle.
//!
//! The law ruptures its layers by itself. What the model leaves is set beside the noise, and the share of the recorded
//! force inside a 90 % band beside 90 %: a model that is right for these recordings has both.

mod prediction_band;
mod surface_friction_refit;

use crate::diagnose::assumptions_of;
use crate::diagnosis_json::Diagnosis;
use crate::error::DiagnoseError;
use crate::held_out::predict_free_run;
use crate::input_checks::{NamedRecording, clean_recordings};
use prediction_band::{Band, Uncertainty};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::likelihood::{FitData, replay};
use stylet_identify::model::{Model, NO_RUPTURE};
use stylet_identify::noise::Noise;
use stylet_scenario::Scenario;
pub use surface_friction_refit::Refit;

/// Share of the recorded force that a right band holds.
pub const BAND_LEVEL: f64 = 0.9;

/// How one recording is predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingPrediction {
    /// Recording.
    pub name: String,
    /// Root mean square of measured less predicted force in N; a rupture may be early or late by two samples.
    pub rmse_n: f64,
    /// The same of the believed scenario, if one was given.
    pub assumed_rmse_n: Option<f64>,
    /// Share of the recorded force (means over 20 ms) inside the 90 % band, 0 to 1.
    pub band_coverage: f64,
    /// Largest force measured less largest force predicted, in N.
    pub peak_error_n: f64,
    /// Position of the surface beyond the model's, in m, where it was re-fitted.
    pub surface_shift_m: Option<f64>,
    /// Friction over the model's, where it was re-fitted.
    pub friction_factor: Option<f64>,
}

/// How well a model predicts: `predict.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Each recording.
    pub recordings: Vec<RecordingPrediction>,
    /// Root mean square over all in N.
    pub rmse_n: f64,
    /// The same of the believed scenario.
    pub assumed_rmse_n: Option<f64>,
    /// Standard deviation of the sensor's noise in N: no model can be better.
    pub floor_n: f64,
    /// Share of the recorded force inside the 90 % band, 0 to 1.
    pub band_coverage: f64,
    /// What the band holds: noise, scatter from insertion to insertion, intervals of the numbers.
    pub band_includes: Vec<String>,
    /// Numbers re-fitted, and whether each recording was predicted by those of the others.
    pub refitted: Vec<Refit>,
    /// Whether no number was fitted to the recording that it predicts.
    pub held_out: bool,
}

/// Curves of one recording, one value per block of 20 ms.
#[derive(Clone, Debug, Default)]
pub struct PredictionCurves {
    /// Time in s.
    pub time_s: Vec<f64>,
    /// Position in m.
    pub position_m: Vec<f64>,
    /// Measured force in N.
    pub measured_n: Vec<f64>,
    /// Predicted force in N.
    pub predicted_n: Vec<f64>,
    /// What the believed scenario predicts, in N.
    pub assumed_n: Option<Vec<f64>>,
    /// Lower edge of the band in N.
    pub low_n: Vec<f64>,
    /// Upper edge.
    pub high_n: Vec<f64>,
    /// Whether the block was compared.
    pub used: Vec<bool>,
    /// Instants in s at which the law ruptures its layers.
    pub ruptures_s: Vec<f64>,
}

/// A prediction with what its report draws.
#[derive(Clone, Debug)]
pub struct PredictionResult {
    /// What is said.
    pub prediction: Prediction,
    /// Curves of every recording.
    pub curves: Vec<PredictionCurves>,
}

/// Predicts recordings by a scenario. `diagnosis` is the one that the scenario came from, if there is one: it tells noise,
/// scatter and intervals. `believed` is what was believed before it. What is in `refit` is fitted to the recordings first;
/// with two or more of them each is predicted by what the others say.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn predict(
    scenario: &Scenario,
    diagnosis: Option<&Diagnosis>,
    believed: Option<&Scenario>,
    refit: &[Refit],
    evidence: &[NamedRecording],
) -> Result<PredictionResult, DiagnoseError> {
    crate::input_checks::check_recordings(scenario, evidence)?;
    let ready = clean_recordings(evidence);
    let blocks: Vec<BlockAverages> = ready
        .recordings
        .par_iter()
        .zip(&ready.raw.exclude)
        .map(|(r, x)| BlockAverages::new(r, x, BLOCK_S))
        .collect();
    let known = Uncertainty::new(diagnosis, &blocks);
    let n = blocks.len();
    let data = FitData::new(Arc::new(blocks), Noise::white(known.block_n), 0.0);
    let mut model = Model::base(Arc::new(assumptions_of(scenario)), n);
    let own =
        surface_friction_refit::fit_recording_offsets(&model, &data, refit).ok_or(DiagnoseError::NoFit)?;
    let held_out = refit.is_empty() || n > 1;
    model.per_recording = (0..n).map(|r| surface_friction_refit::held_out_mean(&own, r)).collect();
    let before = believed.map(|b| Model::base(Arc::new(assumptions_of(b)), n));
    let band = Band { known: &known, model: &model, data: &data };
    let each: Vec<Option<(RecordingPrediction, PredictionCurves, Square)>> = (0..n)
        .into_par_iter()
        .map(|r| one(&model, before.as_ref(), &band, refit, &data, r, &evidence[r].name))
        .collect();
    let mut foretold = PredictionResult {
        prediction: Prediction {
            recordings: Vec::with_capacity(n),
            rmse_n: 0.0,
            assumed_rmse_n: None,
            floor_n: known.floor_n,
            band_coverage: 0.0,
            band_includes: known.components(),
            refitted: refit.to_vec(),
            held_out,
        },
        curves: Vec::with_capacity(n),
    };
    let mut all = Square::default();
    for found in each {
        let (predicted, shown, square) = found.ok_or(DiagnoseError::NoFit)?;
        all.add(&square);
        foretold.prediction.recordings.push(predicted);
        foretold.curves.push(shown);
    }
    foretold.prediction.rmse_n = (all.after / all.blocks.max(1.0)).sqrt();
    foretold.prediction.assumed_rmse_n = believed.map(|_| (all.before / all.blocks.max(1.0)).sqrt());
    foretold.prediction.band_coverage = all.inside / all.blocks.max(1.0);
    Ok(foretold)
}

/// Sums over blocks compared.
#[derive(Clone, Copy, Debug, Default)]
struct Square {
    blocks: f64,
    after: f64,
    before: f64,
    inside: f64,
}

impl Square {
    fn add(&mut self, other: &Self) {
        self.blocks += other.blocks;
        self.after += other.after;
        self.before += other.before;
        self.inside += other.inside;
    }
}

fn one(
    model: &Model,
    before: Option<&Model>,
    band: &Band,
    refit: &[Refit],
    data: &FitData,
    r: usize,
    name: &str,
) -> Option<(RecordingPrediction, PredictionCurves, Square)> {
    let b = &data.recordings[r];
    let left = predict_free_run(model, data, r)?;
    let was = match before {
        Some(model) => Some(predict_free_run(model, data, r)?),
        None => None,
    };
    let time_s: Vec<f64> = b.start_s.iter().zip(&b.end_s).map(|(a, b)| 0.5 * (a + b)).collect();
    let less = |e: &[f64]| -> Vec<f64> { b.force_n.iter().zip(e).map(|(f, e)| f - e).collect() };
    let (low_n, high_n) = band.edges(r);
    let within =
        (0..b.len()).filter(|k| b.used[*k] && (low_n[*k]..=high_n[*k]).contains(&b.force_n[*k])).count();
    let own = model.per_recording[r];
    let square = |mean_n2: f64| (mean_n2 + b.within_block_sd_n().powi(2)) * left.compared_blocks as f64;
    let sums = Square {
        blocks: left.compared_blocks as f64,
        after: square(left.mean_square_n2),
        before: was.as_ref().map_or(0.0, |w| square(w.mean_square_n2)),
        inside: within as f64,
    };
    let predicted_n = less(&left.residual_n);
    let peak =
        |f: &[f64]| f.iter().zip(&b.used).filter(|(_, u)| **u).fold(f64::NEG_INFINITY, |m, (f, _)| m.max(*f));
    let count = sums.blocks.max(1.0);
    let predicted = RecordingPrediction {
        name: name.to_owned(),
        rmse_n: (sums.after / count).sqrt(),
        assumed_rmse_n: was.as_ref().map(|_| (sums.before / count).sqrt()),
        band_coverage: sums.inside / count,
        peak_error_n: peak(&b.force_n) - peak(&predicted_n),
        surface_shift_m: refit.contains(&Refit::Surface).then_some(own.surface_m),
        friction_factor: refit.contains(&Refit::Friction).then(|| libm::exp(own.ln_friction)),
    };
    let shown = PredictionCurves {
        position_m: time_s.iter().map(|t| b.motion.at(*t).0).collect(),
        time_s,
        measured_n: b.force_n.clone(),
        assumed_n: was.map(|w| less(&w.residual_n)),
        predicted_n,
        low_n,
        high_n,
        used: b.used.clone(),
        ruptures_s: left.rupture_times_s.iter().copied().filter(|t| *t < NO_RUPTURE).collect(),
    };
    Some((predicted, shown, sums))
}

/// The force (N) of a model over one recording with the law's own ruptures.
fn by_itself(model: &Model, data: &FitData, r: usize) -> Option<Vec<f64>> {
    let trail = stylet_identify::likelihood::ReplayCache::new(model, data, r)?;
    let mut at = model.clone();
    at.rupture_times_s[r] = trail.free_rupture_times();
    Some(replay(&at, data, r)?.force_n)
}
