//! Varying-coefficient test: distinguishes a true effect from one that imitates an unmodelled effect.
//!
//! In the presence of an unmodelled effect, the search selects any effect that reproduces a part of it, for example presliding friction for
//! backlash of the clamp. The force of a true effect has no further dependence; that of an imitation gains if it may vary with depth,
//! speed, time or another feature (Hastie and Tibshirani 1993).

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::JacobianColumn;
use stylet_identify::likelihood::replay;
use stylet_identify::model::Model;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::order_statistics::quantile;
use stylet_tissue::effect::sgn;

/// Speed (m/s) below which the needle holds.
const HOLD_SPEED_MPS: f64 = 2e-4;

/// Features with which the force of an effect may vary.
pub const FEATURES: [&str; 8] =
    ["depth", "speed", "time", "retraction", "hold", "force", "acceleration", "travel_since_reversal"];
/// Travel (m) after a reversal at which the corresponding feature has decayed to one half.
const REVERSAL_TRAVEL_M: f64 = 1e-3;
/// Quantile at which features are clipped on both sides, because accelerations at velocity jumps grow with the sampling rate.
const CLIP_QUANTILE: f64 = 0.01;
/// Share of a column that must be linearly independent of the fitted parameters; less is rounding error.
const MIN_INDEPENDENT_SHARE: f64 = 1e-6;

/// Feature with which the force of an effect varies most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VaryingCoefficient {
    /// Name of the feature.
    pub feature: &'static str,
    /// Gain of the fit in nats.
    pub nats: f64,
    /// Gain as a share of the loss without the effect.
    pub share: f64,
}

/// First-order gain of a fit if the force of an effect may vary with a feature, for the feature with the largest gain; all fitted
/// parameters adapt. `loss_nats` is the loss (nats) without the effect. `None` when its force cannot be computed.
pub fn varying_coefficient_test(
    score_test: &ScoreTest<'_>,
    effect: usize,
    loss_nats: f64,
) -> Option<VaryingCoefficient> {
    let gain = |column: JacobianColumn| {
        let gain = score_test.gain(&[column]);
        if gain.unexplained_share > MIN_INDEPENDENT_SHARE { gain.nats } else { 0.0 }
    };
    let gains = FEATURES.iter().zip(columns(score_test, effect)?).map(|(name, c)| (*name, gain(c)));
    let (feature, nats) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(VaryingCoefficient { feature, nats, share: nats / loss_nats.max(1.0) })
}

/// The force of an effect times each feature, as columns of the linearised model.
fn columns(score_test: &ScoreTest<'_>, effect: usize) -> Option<Vec<JacobianColumn>> {
    let data = score_test.data;
    let (forces, total) = force(score_test, effect)?;
    let mut all: [Forces; FEATURES.len()] = Default::default();
    for (b, total) in data.recordings.iter().zip(&total) {
        for (w, x) in all.iter_mut().zip(features(b, total)) {
            w.push(x);
        }
    }
    Some(all.iter().map(|w| score_test.force_column(&interaction_column(&forces, w))).collect())
}

/// Features of every block of a recording; `predicted` is the predicted force (N), used instead of the measured one because noise would
/// correlate with the residual.
fn features(b: &BlockAverages, predicted: &[f64]) -> [Vec<f64>; FEATURES.len()] {
    let mut out: [Vec<f64>; FEATURES.len()] = Default::default();
    let (mut before, mut sign, mut since_m) = (None, 0.0, 0.0);
    for (k, f) in predicted.iter().enumerate() {
        let t = b.mid_s(k);
        let (z, v) = b.motion.at(t);
        let (z0, v0) = before.replace((z, v)).unwrap_or((z, v));
        if sgn(v) * sign < 0.0 {
            since_m = 0.0;
        }
        sign = if v == 0.0 { sign } else { sgn(v) };
        since_m += (z - z0).abs();
        let (retraction, hold) = (f64::from(v < -HOLD_SPEED_MPS), f64::from(v.abs() < HOLD_SPEED_MPS));
        let acceleration = (v - v0).abs() / (b.end_s[k] - b.start_s[k]);
        let all =
            [z, v.abs(), t, retraction, hold, *f, acceleration, 1.0 / (1.0 + since_m / REVERSAL_TRAVEL_M)];
        out.iter_mut().zip(all).for_each(|(o, x)| o.push(x));
    }
    out
}

/// Forces in N, by recording and block.
type Forces = Vec<Vec<f64>>;

/// Force (N) of an effect, and total force.
fn force(score_test: &ScoreTest<'_>, effect: usize) -> Option<(Forces, Forces)> {
    let (fit, data) = (score_test.fit, score_test.data);
    let of = |model: &Model| -> Option<Forces> {
        (0..data.recording_count()).map(|r| Some(replay(model, data, r)?.force_n)).collect()
    };
    let (total, reduced) = (of(&fit.model)?, of(&fit.model.without_effect(effect))?);
    let part = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    Some((total.iter().zip(&reduced).map(part).collect(), total))
}

/// Forces times the standardised feature, which is clipped at [`CLIP_QUANTILE`].
fn interaction_column(forces: &[Vec<f64>], feature: &[Vec<f64>]) -> Forces {
    let mut all: Vec<f64> = feature.iter().flatten().copied().collect();
    let (low, high) = (quantile(&mut all, CLIP_QUANTILE), quantile(&mut all, 1.0 - CLIP_QUANTILE));
    let cut = |x: f64| x.max(low).min(high);
    all.iter_mut().for_each(|x| *x = cut(*x));
    let (mean, sd) = (stylet_stats::mean(&all), stylet_stats::sd(&all));
    let standardised = |x: f64| if sd > 0.0 { (cut(x) - mean) / sd } else { 0.0 };
    forces
        .iter()
        .zip(feature)
        .map(|(f, x)| f.iter().zip(x).map(|(f, x)| f * standardised(*x)).collect())
        .collect()
}

#[cfg(test)]
mod tests;
