//! Prediction of recordings that were not used for the model: another day, another needle.
//!
//! The model computes its ruptures from its own puncture forces (free run). A correct model has residuals
//! at the noise level and a 90 % band that contains 90 % of the measured force.

mod prediction_band;
mod surface_friction_refit;

use crate::base_law_fit::assumptions_of;
use crate::diagnosis_json::Diagnosis;
use crate::error::DiagnoseError;
use crate::held_out::predict_free_run;
use crate::input_checks::{NamedRecording, clean_recordings};
pub use prediction_band::BAND_LEVEL;
use prediction_band::{Band, Uncertainty};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Model, NO_RUPTURE};
use stylet_identify::noise::Noise;
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;
pub use surface_friction_refit::Refit;

/// Prediction of one recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingPrediction {
    /// Name.
    pub name: String,
    /// RMS error in N; ruptures may differ by two samples.
    pub rmse_n: f64,
    /// RMS error of the assumed scenario in N, if given.
    pub assumed_rmse_n: Option<f64>,
    /// Share of the measured force (means over 20 ms) inside the 90 % band, 0 to 1.
    pub band_coverage: f64,
    /// Largest measured minus largest predicted force, in N.
    pub peak_error_n: f64,
    /// Surface relative to the model's in m, if it was refitted.
    pub surface_shift_m: Option<f64>,
    /// Friction relative to the model's, if it was refitted.
    pub friction_factor: Option<f64>,
}

/// Prediction of all recordings: `predict.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Per recording.
    pub recordings: Vec<RecordingPrediction>,
    /// RMS error over all recordings in N.
    pub rmse_n: f64,
    /// RMS error of the assumed scenario in N.
    pub assumed_rmse_n: Option<f64>,
    /// Standard deviation of the sensor noise in N: lower limit of the error.
    pub floor_n: f64,
    /// Share of the measured force inside the 90 % band, 0 to 1.
    pub band_coverage: f64,
    /// Components of the band: noise, scatter between recordings, parameter intervals.
    pub band_includes: Vec<String>,
    /// Refitted parameters.
    pub refitted: Vec<Refit>,
    /// Whether no parameter was fitted to the recording that it predicts.
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
    /// Force predicted by the assumed scenario in N.
    pub assumed_n: Option<Vec<f64>>,
    /// Lower edge of the band in N.
    pub low_n: Vec<f64>,
    /// Upper edge in N.
    pub high_n: Vec<f64>,
    /// Whether the block is compared.
    pub used: Vec<bool>,
    /// Rupture times of the model in s.
    pub ruptures_s: Vec<f64>,
}

/// A prediction with the curves of its report.
#[derive(Clone, Debug)]
pub struct PredictionResult {
    /// Summary.
    pub prediction: Prediction,
    /// Curves of every recording.
    pub curves: Vec<PredictionCurves>,
}

/// Predicts recordings with a scenario. `diagnosis` is the one that the scenario came from, if any: it
/// gives noise, scatter and intervals. `assumed` is the scenario before the diagnosis. Parameters in
/// `refit` are fitted to the recordings first; with two or more of them, each is predicted with the values
/// of the others.
///
/// # Errors
///
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn predict(
    scenario: &Scenario,
    diagnosis: Option<&Diagnosis>,
    assumed: Option<&Scenario>,
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
    let offsets =
        surface_friction_refit::fit_recording_offsets(&model, &data, refit).ok_or(DiagnoseError::NoFit)?;
    let held_out = refit.is_empty() || n > 1;
    model.per_recording = (0..n).map(|r| surface_friction_refit::held_out_mean(&offsets, r)).collect();
    let before = assumed.map(|b| Model::base(Arc::new(assumptions_of(b)), n));
    let band = Band { known: &known, model: &model, data: &data };
    let each: Vec<Option<(RecordingPrediction, PredictionCurves, ErrorSums)>> = (0..n)
        .into_par_iter()
        .map(|r| predict_one(&model, before.as_ref(), &band, refit, &data, r, &evidence[r].name))
        .collect();
    let mut result = PredictionResult {
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
    let mut all = ErrorSums::default();
    for found in each {
        let (predicted, curves, square) = found.ok_or(DiagnoseError::NoFit)?;
        all.add(&square);
        result.prediction.recordings.push(predicted);
        result.curves.push(curves);
    }
    result.prediction.rmse_n = (all.after / all.blocks.max(1.0)).sqrt();
    result.prediction.assumed_rmse_n = assumed.map(|_| (all.before / all.blocks.max(1.0)).sqrt());
    result.prediction.band_coverage = all.inside / all.blocks.max(1.0);
    Ok(result)
}

/// Sums over compared blocks.
#[derive(Clone, Copy, Debug, Default)]
struct ErrorSums {
    blocks: f64,
    after: f64,
    before: f64,
    inside: f64,
}

impl ErrorSums {
    fn add(&mut self, other: &Self) {
        self.blocks += other.blocks;
        self.after += other.after;
        self.before += other.before;
        self.inside += other.inside;
    }
}

fn predict_one(
    model: &Model,
    before: Option<&Model>,
    band: &Band,
    refit: &[Refit],
    data: &FitData,
    r: usize,
    name: &str,
) -> Option<(RecordingPrediction, PredictionCurves, ErrorSums)> {
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
    let offsets = model.per_recording[r];
    let square = |mean_n2: f64| (mean_n2 + b.within_block_sd_n().powi(2)) * left.compared_blocks as f64;
    let sums = ErrorSums {
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
        surface_shift_m: refit.contains(&Refit::Surface).then_some(offsets.surface_m),
        friction_factor: refit.contains(&Refit::Friction).then(|| libm::exp(offsets.ln_friction)),
    };
    let curves = PredictionCurves {
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
    Some((predicted, curves, sums))
}
