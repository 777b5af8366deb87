//! Population of recordings: distribution of random effects and residuals, and draws of new recordings.

use super::insertion_phase::phase_at;
use super::instrument_faults::fit_trend;
use super::multistart_fit::{PRIOR_DAYS, SetFit};
use super::segmented_recording::SegmentedRecording;
use std::collections::BTreeSet;
use stylet_identify::fit::Linearization;
use stylet_identify::likelihood::residuals;
use stylet_identify::model::{DayParameters, EffectTerm, Model, NO_RUPTURE, Parameter, RecordingParameters};
use stylet_record::Recording;
use stylet_stats::linear_algebra::CholeskyFactor;
use stylet_stats::normal::quantile;
use stylet_stats::{median_of, quantile_of_sorted, sorted, student_t};
use stylet_tissue::Effect;

/// Number of equally likely values of a residual; the outermost of ten are the ends of a 90 % band.
pub const QUANTILES: usize = 10;
/// Predicted force (N) up to which the needle is in air: rounding errors and the tail of a lag, below the resolution of any sensor.
const MAX_AIR_FORCE_N: f64 = 1e-6;
/// Bases of the Halton sequence.
const PRIMES: [usize; 24] =
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89];
/// Samples per window in which the noise about a line is measured.
const NOISE_WINDOW: usize = 8;

/// Whether a force is predicted in air, where the residual is sensor noise.
pub(super) fn is_in_air(predicted_n: f64) -> bool {
    predicted_n.abs() <= MAX_AIR_FORCE_N
}

/// Fitted model with the distribution of random effects and residuals.
#[derive(Clone, Debug)]
pub struct Population {
    /// The model, without per-recording parameters.
    pub model: Model,
    /// RMS residual (N) in tissue by [`InsertionPhase`](super::insertion_phase::InsertionPhase), including the noise of single samples.
    pub residual_n: [f64; 4],
    /// Quantiles of the residual (N) by phase; its distribution has heavy tails near ruptures and releases.
    pub residual_quantiles_n: [[f64; QUANTILES]; 4],
    /// The same in air, where the residual is sensor noise.
    pub air_quantiles_n: [f64; QUANTILES],
    /// Number of fitted recordings.
    pub recordings: usize,
    /// Number of days of these recordings.
    pub days: usize,
    /// Shared parameters with the factor of their information matrix, if parameter uncertainty is included.
    pub parameter_information: Option<(Vec<Parameter>, CholeskyFactor)>,
}

impl Population {
    /// Population of a fit.
    #[must_use]
    pub fn from_fit(fitted: &SetFit, recordings: &[&SegmentedRecording]) -> Self {
        let (mut left, mut air): ([Vec<f64>; 4], Vec<f64>) = Default::default();
        let model = &fitted.fit.model;
        for (r, (b, e)) in fitted.data.recordings.iter().zip(&fitted.fit.residuals.residual_n).enumerate() {
            let first = model.rupture_times_s[r].iter().copied().fold(NO_RUPTURE, f64::min);
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                if is_in_air(b.force_n[k] - e[k]) {
                    air.push(e[k]);
                } else {
                    left[phase_at(recordings[r], b.mid_s(k), first) as usize].push(e[k]);
                }
            }
        }
        // Adds the noise of single samples, which blocks average.
        let noise_n = median_of(recordings.iter().map(|r| sample_noise_n(&r.recording)));
        let square = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>() / f64::max(e.len() as f64, 1.0);
        let residual_n = std::array::from_fn(|p| (square(&left[p]) + noise_n * noise_n).sqrt());
        let quantiles_n = std::array::from_fn(|p| residual_quantiles(&left[p], noise_n));
        let days: BTreeSet<usize> = model.day_of.iter().copied().collect();
        let air_n = residual_quantiles(&air, noise_n);
        Self {
            model: model.subset(&[]),
            residual_n,
            residual_quantiles_n: quantiles_n,
            air_quantiles_n: air_n,
            recordings: recordings.len(),
            days: days.len(),
            parameter_information: None,
        }
    }

    /// Adds the uncertainty of the shared parameters, for predictions of a held-out speed.
    pub(crate) fn with_parameter_uncertainty(self, fitted: &SetFit) -> Self {
        let model = &fitted.fit.model;
        let open = residuals(model, &fitted.data).map(|at| {
            let linearization = Linearization::new(model, &fitted.data, &at);
            let factor = linearization.factor();
            (linearization.shared, factor)
        });
        Self { parameter_information: open, ..self }
    }

    /// Ratio of the scatter of a new recording to that of a fitted one about the mean of `n`: `sqrt((n + 1)/(n - 1))`. Residuals are not
    /// scaled, because many blocks determine their mean.
    pub(super) fn new_recording_factor(&self) -> f64 {
        let n = self.recordings.max(2) as f64;
        ((n + 1.0) / (n - 1.0)).sqrt()
    }

    /// Model of the `k`-th new recording (from 1), on a known day or a random one.
    pub(super) fn draw(&self, k: usize, day: Option<usize>) -> Model {
        let mut dimension = 0;
        let mut place = || {
            let base = PRIMES[dimension % PRIMES.len()];
            dimension += 1;
            halton(k, base)
        };
        // Student's t, because mean and standard deviation of few recordings are uncertain. The degrees of freedom of the sum follow
        // Satterthwaite (1946) with equal shares.
        let vary = 2 + self.model.layers() + self.model.varying_parameters().count();
        let dof = vary as f64 * (self.recordings.max(2) as f64 - 1.0);
        let mut normal = || student_t::quantile(place(), dof) * self.new_recording_factor();
        let mut model = self.model.clone();
        let s = &self.model.scatter;
        let (surface, friction) = (normal(), normal());
        let free = model.free;
        let mut recording_effects = RecordingParameters::default();
        if free.recording_surface {
            recording_effects.surface_m = s.surface_m * surface;
        }
        if free.recording_friction {
            recording_effects.ln_friction = s.ln_friction * friction;
        }
        for layer in 0..model.layers() {
            let factor = (1.0 + s.rupture_force * normal()).max(0.2);
            if let Some(f) = &mut model.tissue.layers[layer].puncture_n {
                *f *= factor;
            }
            for term in &mut model.effects {
                if let Some(mut effect) = term.effect() {
                    effect.scale_puncture(layer + 1, factor);
                    *term = EffectTerm::new(term.info, &effect.parameters());
                }
            }
        }
        if free.recording_effects {
            for k in 0..self.model.varying_parameters().count() {
                recording_effects.varying[k] = self.model.varying_sd(k) * normal();
            }
        }
        // Degrees of freedom: the number of days plus the weight of the prior.
        let days = self.days as f64;
        let wide = (1.0 + 1.0 / days.max(1.0)).sqrt();
        let mut of_day = || student_t::quantile(place(), days.max(1.0) + PRIOR_DAYS - 1.0) * wide;
        let drawn = DayParameters {
            surface_m: s.day_surface_m * of_day(),
            ln_friction: s.day_ln_friction * of_day(),
        };
        let day = day.unwrap_or_else(|| {
            model.days.push(DayParameters {
                surface_m: if free.day_surface { drawn.surface_m } else { 0.0 },
                ln_friction: if free.day_friction { drawn.ln_friction } else { 0.0 },
            });
            model.days.len() - 1
        });
        model.per_recording = vec![recording_effects];
        model.day_of = vec![day];
        model.rupture_times_s = vec![vec![NO_RUPTURE; model.layers()]];
        model
    }
}

/// Equally likely values of a normal distribution with standard deviation `sd_n` (N).
pub(crate) fn normal_quantiles(sd_n: f64) -> [f64; QUANTILES] {
    std::array::from_fn(|k| sd_n * quantile((k as f64 + 0.5) / QUANTILES as f64))
}

/// Equally likely values of a symmetric empirical distribution (N), combined with normal noise.
fn residual_quantiles(residuals_n: &[f64], noise_n: f64) -> [f64; QUANTILES] {
    let sizes = sorted(residuals_n.iter().map(|e| e.abs()));
    let noise = normal_quantiles(noise_n);
    std::array::from_fn(|k| {
        let share = ((2 * k + 1) as f64 / QUANTILES as f64 - 1.0).abs();
        let size = if sizes.is_empty() { 0.0 } else { quantile_of_sorted(&sizes, share) };
        libm::hypot(size, noise[k]).copysign(noise[k]) * f64::from(u8::from(2 * k + 1 != QUANTILES))
    })
}

/// Radical inverse of `k`: element of the Halton sequence.
fn halton(mut k: usize, base: usize) -> f64 {
    let (mut share, mut out) = (1.0, 0.0);
    while k > 0 {
        share /= base as f64;
        out += share * (k % base) as f64;
        k /= base;
    }
    out
}

/// Median standard deviation (N) of single samples about a local line.
fn sample_noise_n(recording: &Recording) -> f64 {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let of = |(t, f): (&[f64], &[f64])| {
        fit_trend(t, f).sd_n * (NOISE_WINDOW as f64 / (NOISE_WINDOW as f64 - 2.0)).sqrt()
    };
    median_of(t.chunks_exact(NOISE_WINDOW).zip(f.chunks_exact(NOISE_WINDOW)).map(of))
}

#[cfg(test)]
pub(crate) mod tests;
