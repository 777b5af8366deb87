//! Prediction of one recording.

use super::group_deviation::{Factor, deviating_model};
use super::group_update::GroupEstimate;
use super::insertion_course::{Curve, value_at};
use super::prepared::Prepared;
use super::refit::RefittedGroup;
use super::target::Target;
use crate::held_out::predict_free_run;
use serde::{Deserialize, Serialize};
use stylet_identify::model::{Model, NO_RUPTURE};

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
    /// Whether it is a training recording.
    #[serde(rename = "made_the_law")]
    pub is_training_recording: bool,
    /// Offset of the sensor's zero in N, which was subtracted; `None` if it is negligible.
    #[serde(default)]
    pub zero_offset_n: Option<f64>,
    /// Surface relative to the model's in m, if it was refitted.
    pub surface_shift_m: Option<f64>,
    /// Force relative to the model's, if it was refitted.
    pub force_factor: Option<f64>,
    /// Friction relative to the model's, if it was refitted.
    pub friction_factor: Option<f64>,
    /// Puncture force relative to the model's, if it was refitted.
    pub puncture_factor: Option<f64>,
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
    /// Edges (N) of the other band: of an unseen group if the band is that of the training group, and the reverse.
    pub other_band_n: Option<(Vec<f64>, Vec<f64>)>,
    /// Whether the band is that of an unseen group.
    pub is_unseen_group: bool,
    /// Whether the block is compared.
    pub used: Vec<bool>,
    /// Rupture times of the model in s.
    pub ruptures_s: Vec<f64>,
}

/// Sums over compared blocks.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorSums {
    pub blocks: f64,
    pub after: f64,
    pub before: f64,
    pub inside: f64,
    pub inside_same: f64,
    pub inside_unseen: f64,
    pub mean_curve: Option<f64>,
    pub stretched_mean: Option<f64>,
}

impl ErrorSums {
    /// Sum of both, without the baselines.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            blocks: self.blocks + other.blocks,
            after: self.after + other.after,
            before: self.before + other.before,
            inside: self.inside + other.inside,
            inside_same: self.inside_same + other.inside_same,
            inside_unseen: self.inside_unseen + other.inside_unseen,
            mean_curve: None,
            stretched_mean: None,
        }
    }
}

/// Predicts one recording; `group` is its refitted group, if any.
pub fn predict_one(
    prepared: &Prepared,
    target: &Target,
    before: Option<&Model>,
    group: Option<RefittedGroup>,
    varying: &[Factor],
) -> Option<(RecordingPrediction, PredictionCurves, ErrorSums)> {
    let r = target.r;
    let data = &prepared.data;
    let b = &data.recordings[r];
    let deviation = group.as_ref().map_or([0.0; 4], |g| g.deviation);
    let law = predict_free_run(&deviating_model(&prepared.model, r, &deviation), data, r)?;
    let was = match before {
        Some(model) => Some(predict_free_run(model, data, r)?),
        None => None,
    };
    let less = |e: &[f64]| -> Vec<f64> { b.force_n.iter().zip(e).map(|(f, e)| f - e).collect() };
    let mut predicted_n = less(&law.residual_n);
    prepared.add_mean_residual(r, &deviation, &target.mean_residual, &mut predicted_n);
    let within_n2 = b.within_block_sd_n().powi(2);
    let blocks = b.compared_block_count() as f64;
    let square = |f: &dyn Fn(usize) -> f64| {
        let errors = (0..b.len()).filter(|k| b.used[*k]).map(|k| (b.force_n[k] - f(k)).powi(2));
        errors.sum::<f64>() + within_n2 * blocks
    };
    let inside = |(low, high): &(Vec<f64>, Vec<f64>)| {
        (0..b.len()).filter(|k| b.used[*k] && (low[*k]..=high[*k]).contains(&b.force_n[*k])).count() as f64
    };
    let of_group = |varying: &[Factor]| {
        let group = GroupEstimate::new(&[], prepared.group_sd(varying, r), [0.0; 4]);
        prepared.band(target, &group, [0.0; 4], !varying.is_empty(), 0.0)
    };
    let mut sums = ErrorSums { blocks, after: square(&|k| predicted_n[k]), ..ErrorSums::default() };
    let (edges, other_band_n) = if let Some(g) = &group {
        (prepared.band(target, &g.estimate, deviation, !varying.is_empty(), g.extra_misfit_n), None)
    } else {
        let assumed = of_group(varying);
        let other = of_group(if varying.is_empty() { &Factor::ALL } else { &[] });
        let (a, o) = (inside(&assumed), inside(&other));
        (sums.inside_same, sums.inside_unseen) = if varying.is_empty() { (a, o) } else { (o, a) };
        (assumed, Some(other))
    };
    sums.inside = inside(&edges);
    if let Some(w) = &was {
        sums.before = square(&|k| b.force_n[k] - w.residual_n[k]);
    }
    let baseline = |curve: &Option<Curve>| {
        let curve = curve.as_ref()?;
        let values: Vec<f64> = target.places.iter().map(|p| value_at(curve, *p)).collect::<Option<_>>()?;
        Some(square(&|k| values[k]))
    };
    sums.mean_curve = baseline(&target.baselines.mean);
    sums.stretched_mean = baseline(&target.baselines.stretched);
    let peak =
        |f: &[f64]| f.iter().zip(&b.used).filter(|(_, u)| **u).fold(f64::NEG_INFINITY, |m, (f, _)| m.max(*f));
    let count = blocks.max(1.0);
    let is_fitted = |k: usize| group.as_ref().is_some_and(|g| g.estimate.is_free(k));
    let factor = |k: usize| is_fitted(k).then(|| libm::exp(deviation[k]));
    let predicted = RecordingPrediction {
        name: prepared.names[r].clone(),
        rmse_n: (sums.after / count).sqrt(),
        assumed_rmse_n: was.as_ref().map(|_| (sums.before / count).sqrt()),
        band_coverage: sums.inside / count,
        peak_error_n: peak(&b.force_n) - peak(&predicted_n),
        is_training_recording: target.training_index.is_some(),
        zero_offset_n: prepared.zero_offset_n[r],
        surface_shift_m: is_fitted(0).then_some(deviation[0]),
        force_factor: factor(1),
        friction_factor: factor(2),
        puncture_factor: factor(3),
    };
    let time_s: Vec<f64> = b.start_s.iter().zip(&b.end_s).map(|(a, b)| 0.5 * (a + b)).collect();
    let (low_n, high_n) = edges;
    let curves = PredictionCurves {
        position_m: time_s.iter().map(|t| b.motion.at(*t).0).collect(),
        time_s,
        measured_n: b.force_n.clone(),
        assumed_n: was.map(|w| less(&w.residual_n)),
        predicted_n,
        low_n,
        high_n,
        other_band_n,
        is_unseen_group: !varying.is_empty(),
        used: b.used.clone(),
        ruptures_s: law.rupture_times_s.iter().copied().filter(|t| *t < NO_RUPTURE).collect(),
    };
    Some((predicted, curves, sums))
}
