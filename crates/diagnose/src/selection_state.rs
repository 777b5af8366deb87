//! State of the effect selection: the current model with its noise, and the steps so far.

use crate::base_law_fit::{COARSENING_FACTOR, leaves_noise};
use crate::tone_detection::{detect_tones, with_noise_without_tones};
use stylet_identify::delay_refinement::refine_delay;
use stylet_identify::fit::{Effort, Fit, fit, fit_from_zero_scatter};
use stylet_identify::likelihood::{FitData, residuals, with_break_uncertainty};
use stylet_identify::model::EffectTerm;
use stylet_identify::noise::NoiseSource;

/// One step of the selection.
#[derive(Clone, Debug)]
pub struct SearchStage {
    /// Effects in the model before this step.
    pub included: Vec<&'static str>,
    /// Candidates: identifier, gain in nats under the noise of the search, number of parameters.
    pub candidates: Vec<(&'static str, f64, usize)>,
    /// The selected effect and its gain in nats.
    pub selected: Option<(&'static str, f64)>,
    /// Gain in nats required of it.
    pub required_nats: f64,
    /// The candidates with their fitted values.
    pub choices: Vec<EffectTerm>,
}

/// State of the selection.
#[derive(Clone)]
pub struct Search {
    /// Fit of the base law.
    pub base: Fit,
    /// Best fit so far.
    pub best: Fit,
    /// The data with the noise estimated from the best fit.
    pub data: FitData,
    /// Steps so far.
    pub stages: Vec<SearchStage>,
    /// Remaining restarts.
    pub(crate) restarts: usize,
    /// Remaining refits from the prior.
    pub(crate) prior_refits: usize,
    /// Frequencies (Hz) of tones in the residual.
    pub(crate) tones_hz: Vec<f64>,
    /// Whether the last step found no effect to add to the best fit.
    pub(crate) is_exhausted: bool,
}

impl Search {
    /// A search that starts from a fit, without restarts.
    pub(crate) fn from_fit(fit: Fit, data: FitData) -> Self {
        Self {
            base: fit.clone(),
            best: fit,
            data,
            stages: Vec::new(),
            restarts: 0,
            prior_refits: 0,
            tones_hz: Vec::new(),
            is_exhausted: false,
        }
    }

    /// A search with another best fit and its data, without restarts.
    pub(crate) fn with_best(&self, best: Fit, data: FitData) -> Self {
        Self { base: self.base.clone(), stages: self.stages.clone(), ..Self::from_fit(best, data) }
    }

    /// Whether a fit leaves only noise.
    pub(crate) fn leaves_noise(&self, f: &Fit) -> bool {
        leaves_noise(f, &self.data)
    }

    /// Detects tones in the residual and estimates the noise without them.
    pub(crate) fn update_tones(&mut self) {
        let found = detect_tones(&self.best, &self.data);
        if !found.is_empty() {
            let data = with_noise_without_tones(&self.best, &self.data, &found);
            if let Some(residuals) = residuals(&self.best.model, &data) {
                self.best.residuals = residuals;
                self.data = data;
            }
        }
        self.tones_hz = found;
    }

    /// The data on coarser blocks with the noise of the best fit, for ranking candidates.
    pub(crate) fn coarse(&self) -> FitData {
        let coarse = self.data.coarsened(COARSENING_FACTOR);
        let model = self.best.model.clone();
        let Some(residuals) = residuals(&model, &coarse) else { return coarse };
        with_noise_without_tones(&Fit { model, residuals }, &coarse, &self.tones_hz)
    }

    /// Sets the best fit, and estimates the noise from its residual.
    pub fn accept(&mut self, f: Fit) {
        self.is_exhausted = false;
        self.data = with_break_uncertainty(&f.model, &self.data)
            .with_estimated_noise(&f.residuals.residual_n, NoiseSource::Detrended);
        let best = fit_from_zero_scatter(&f.model, &self.data, Effort::FULL).unwrap_or(f);
        self.best = match refine_delay(&best, &self.data) {
            Some((late, data)) => {
                self.data = data.with_estimated_noise(&late.residuals.residual_n, NoiseSource::Detrended);
                fit(&late.model, &self.data, Effort::FULL).unwrap_or(late)
            }
            None => best,
        };
    }

    /// Sets the best fit to one in which a competing effect replaces effect `k`, and updates the stage that selected it.
    pub fn replace_effect(&mut self, k: usize, f: Fit) {
        let (Some(old), Some(new)) = (self.best.model.effects.get(k), f.model.effects.get(k)) else { return };
        let (old, new, more) = (old.info.id, new.info.id, self.best.nats() - f.nats());
        let stage = self.stages.iter_mut().rev().find_map(|s| s.selected.as_mut().filter(|t| t.0 == old));
        if let Some(selected) = stage {
            *selected = (new, selected.1 + more);
        }
        self.accept(f);
    }
}
