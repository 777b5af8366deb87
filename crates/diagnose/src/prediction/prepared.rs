//! Recordings and a model, prepared for predictions.

use super::group_deviation::{Factor, RATE_EXPONENT_SD, Values, deviating_model, group_sd};
use super::insertion_course::{Curve, InsertionCourse, value_at};
use super::training_curves::TrainingSummary;
use super::uncertainty::{Uncertainty, free_run_force};
use super::zero_offset::zero_offset_n;
use crate::base_law_fit::assumptions_of;
use crate::diagnosis_json::Diagnosis;
use crate::input_checks::{NamedRecording, average_blocks, clean_recordings};
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::Model;
use stylet_identify::noise::Noise;
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;

/// Recordings and a model.
#[derive(Clone)]
pub struct Prepared<'a> {
    /// Names of the recordings.
    pub names: Vec<String>,
    /// The recordings in blocks.
    pub data: FitData,
    /// Their motions.
    pub courses: Vec<InsertionCourse>,
    /// The model.
    pub model: Model,
    /// Noise, scatter and intervals of the diagnosis.
    pub uncertainty: Uncertainty,
    /// Summary of the training recordings, if they are known.
    pub training: Option<&'a TrainingSummary>,
    /// Offset of the sensor's zero in N, per recording; it has been subtracted from `data`.
    pub zero_offset_n: Vec<Option<f64>>,
}

impl<'a> Prepared<'a> {
    /// Cleans and averages the recordings, and sets up the model of the scenario.
    pub fn new(scenario: &Scenario, diagnosis: Option<&'a Diagnosis>, evidence: &[NamedRecording]) -> Self {
        let ready = clean_recordings(evidence);
        let blocks = average_blocks(&ready.recordings, &ready.raw);
        let uncertainty = Uncertainty::new(diagnosis, &blocks);
        let model = Model::base(Arc::new(assumptions_of(scenario)), blocks.len());
        let data = FitData::new(Arc::new(blocks), Noise::white(uncertainty.block_n), 0.0);
        let zero_offset_n: Vec<Option<f64>> = (0..data.recording_count())
            .into_par_iter()
            .map(|r| {
                let predicted_n = free_run_force(&model, &data, r)?;
                let surface_m = scenario.tissue.surface_m;
                zero_offset_n(&data.recordings[r], &predicted_n, surface_m, uncertainty.floor_n)
            })
            .collect();
        let zeroed = |(b, offset_n): (&BlockAverages, &Option<f64>)| match offset_n {
            Some(offset_n) => b.without_offset(*offset_n),
            None => b.clone(),
        };
        Self {
            names: evidence.iter().map(|e| e.name.clone()).collect(),
            courses: ready.recordings.iter().map(InsertionCourse::new).collect(),
            data: data.with_recordings(data.recordings.iter().zip(&zero_offset_n).map(zeroed).collect()),
            model,
            uncertainty,
            training: diagnosis.and_then(|d| d.training.as_ref()),
            zero_offset_n,
        }
    }

    /// Free-run force (N) of the model per block.
    pub fn free_run(&self, r: usize) -> Option<Vec<f64>> {
        free_run_force(&self.model, &self.data, r)
    }

    /// Weight of a squared error of a block of recording `r`, in 1/N²; a block counts for less than one sample because the discrepancy is
    /// correlated.
    pub fn weight(&self, r: usize) -> f64 {
        let block_s = self.data.recordings[r].block_s();
        let correlation_s = self.training.map_or(0.0, |t| t.correlation_s);
        block_s / (block_s + 2.0 * correlation_s) / self.misfit_n().powi(2)
    }

    /// RMS error (N) of the model on the training recordings; the noise if these are unknown.
    pub fn misfit_n(&self) -> f64 {
        self.training.map_or(self.uncertainty.block_n, |t| t.residual_rms_n).max(1e-12)
    }

    /// Force (N) per block of recording `r` for a deviation, with the mean residual.
    pub fn force(&self, r: usize, deviation: &Values, mean_residual: &Curve) -> Option<Vec<f64>> {
        self.force_of(&self.model, r, deviation, mean_residual)
    }

    /// The same for another model.
    pub fn force_of(
        &self,
        model: &Model,
        r: usize,
        deviation: &Values,
        mean_residual: &Curve,
    ) -> Option<Vec<f64>> {
        let mut force = free_run_force(&deviating_model(model, r, deviation), &self.data, r)?;
        self.add_mean_residual(r, deviation, mean_residual, &mut force);
        Some(force)
    }

    /// Adds the mean residual, shifted with the surface, and applies the factor of all forces.
    pub fn add_mean_residual(
        &self,
        r: usize,
        deviation: &Values,
        mean_residual: &Curve,
        force_n: &mut [f64],
    ) {
        let factor = libm::exp(deviation[1]);
        if let Some(t) = self.training {
            let places = self.courses[r].places(&self.data.recordings[r], t.range, deviation[0]);
            for (f, place) in force_n.iter_mut().zip(&places) {
                *f += value_at(mean_residual, *place).unwrap_or(0.0);
            }
        }
        force_n.iter_mut().for_each(|f| *f *= factor);
    }

    /// Standard deviations between groups that differ in the factors `varying`, for recording `r`: wider at a speed without training
    /// recordings.
    pub fn group_sd(&self, varying: &[Factor], r: usize) -> Values {
        let mut sd = group_sd(varying);
        let ln_ratio = self.training.map_or(0.0, |t| t.ln_speed_ratio(self.courses[r].speed_mps));
        sd[1] = libm::hypot(sd[1], RATE_EXPONENT_SD * ln_ratio);
        sd
    }
}
