//! Whether an effect acts by its own law, or only somewhat like what is really there.
//!
//! Beside something that no effect of the library explains, the search takes whatever imitates a part of it: friction that builds up over
//! the travel since a reversal for a slack of the clamp, a bias for a force that goes with the square of the acceleration. An effect that
//! is there needs no change where its force is let vary; one that imitates would rather act otherwise.

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::JacobianColumn;
use stylet_identify::likelihood::replay;
use stylet_identify::model::Model;
use stylet_identify::score_test::ScoreTest;
use stylet_stats::order_statistics::quantile;
use stylet_tissue::effect::sgn;

/// Slower than this (m/s) is rest.
const REST_MPS: f64 = 2e-4;

/// By what the force of an effect may vary.
pub const FEATURES: [&str; 8] =
    ["depth", "speed", "time", "retraction", "rest", "force", "acceleration", "travel_since_reversal"];
/// What follows a reversal has gone down to half after so much travel, in m.
const SINCE_M: f64 = 1e-3;
/// Accelerations at jumps of the speed are as large as blocks are short: the last so many of either side count as the next ones.
const RARELY: f64 = 0.01;
/// What is left of a column after everything fitted has imitated it is rounding below this share.
const ROUNDING: f64 = 1e-6;

/// How an effect would rather act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VaryingCoefficient {
    /// By what its force would vary most.
    pub feature: &'static str,
    /// What the fit would gain by that, in nats.
    pub nats: f64,
    /// As a share of what it loses without the effect.
    pub share: f64,
}

/// What a fit of an effect would gain if its force could also grow with depth, speed, acceleration, time or force, after a reversal, on the
/// way back or at rest, whichever gains most: to first order beside everything that is fitted. `lost` is what the fit loses without the
/// effect, in nats. None where its force cannot be told.
#[must_use]
pub fn varying_coefficient_test(
    look: &ScoreTest<'_>,
    effect: usize,
    lost: f64,
) -> Option<VaryingCoefficient> {
    let gain = |column: JacobianColumn| {
        let gain = look.gain(&[column]);
        if gain.unexplained_share > ROUNDING { gain.nats } else { 0.0 }
    };
    let gains = FEATURES.iter().zip(columns(look, effect)?).map(|(with, c)| (*with, gain(c)));
    let (with, nats) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(VaryingCoefficient { feature: with, nats, share: nats / lost.max(1.0) })
}

fn columns(look: &ScoreTest<'_>, effect: usize) -> Option<Vec<JacobianColumn>> {
    let data = look.data;
    let (forces, whole) = force(look, effect)?;
    let mut with: [Forces; FEATURES.len()] = Default::default();
    for (b, whole) in data.recordings.iter().zip(&whole) {
        for (w, x) in with.iter_mut().zip(features(b, whole)) {
            w.push(x);
        }
    }
    Some(with.iter().map(|w| look.force_column(&grown(&forces, w))).collect())
}

/// What the force of an effect may vary with, in every block of a recording that is predicted so (N): what is measured has the noise in
/// it, and with that anything would go.
fn features(b: &BlockAverages, predicted: &[f64]) -> [Vec<f64>; FEATURES.len()] {
    let mut out: [Vec<f64>; FEATURES.len()] = Default::default();
    let (mut before, mut sign, mut since_m) = (None, 0.0, 0.0);
    for (k, f) in predicted.iter().enumerate() {
        let t = 0.5 * (b.start_s[k] + b.end_s[k]);
        let (z, v) = b.motion.at(t);
        let (z0, v0) = before.replace((z, v)).unwrap_or((z, v));
        if sgn(v) * sign < 0.0 {
            since_m = 0.0;
        }
        sign = if v == 0.0 { sign } else { sgn(v) };
        since_m += (z - z0).abs();
        let (back, rest) = (f64::from(v < -REST_MPS), f64::from(v.abs() < REST_MPS));
        let bent = (v - v0).abs() / (b.end_s[k] - b.start_s[k]);
        let all = [z, v.abs(), t, back, rest, *f, bent, 1.0 / (1.0 + since_m / SINCE_M)];
        out.iter_mut().zip(all).for_each(|(o, x)| o.push(x));
    }
    out
}

/// Forces in N, block by block and recording by recording.
type Forces = Vec<Vec<f64>>;

/// The force of an effect, and of everything.
fn force(look: &ScoreTest<'_>, effect: usize) -> Option<(Forces, Forces)> {
    let (fit, data) = (look.fit, look.data);
    let of = |model: &Model| -> Option<Forces> {
        (0..data.recording_count()).map(|r| Some(replay(model, data, r)?.force_n)).collect()
    };
    let (whole, less) = (of(&fit.model)?, of(&fit.model.without_effect(effect))?);
    let part = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    Some((whole.iter().zip(&less).map(part).collect(), whole))
}

/// Forces times how far off its mean something is, in its standard deviations; what is rarely so far off counts as the last hundredth does.
fn grown(forces: &[Vec<f64>], with: &[Vec<f64>]) -> Forces {
    let mut all: Vec<f64> = with.iter().flatten().copied().collect();
    let (low, high) = (quantile(&mut all, RARELY), quantile(&mut all, 1.0 - RARELY));
    all.iter_mut().for_each(|x| *x = x.clamp(low, high));
    let (mean, sd) = (stylet_stats::mean(&all), stylet_stats::sd(&all));
    let far = |x: f64| if sd > 0.0 { (x.clamp(low, high) - mean) / sd } else { 0.0 };
    forces.iter().zip(with).map(|(f, x)| f.iter().zip(x).map(|(f, x)| f * far(*x)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::{VaryingCoefficient, features, grown, varying_coefficient_test};
    use crate::test_fixtures::{fit_from_truth, recordings_with_added_force};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::score_test::ScoreTest;
    use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

    #[test]
    fn a_force_grows_by_the_standard_deviations_of_what_it_goes_with() {
        let told = grown(&[vec![2.0, 2.0], vec![3.0, -1.0]], &[vec![1.0, 3.0], vec![1.0, 3.0]]);
        let sd = (4.0_f64 / 3.0).sqrt();
        assert_eq!(told, [vec![-2.0 / sd, 2.0 / sd], vec![-3.0 / sd, -1.0 / sd]]);
        assert_eq!(grown(&[vec![2.0]], &[vec![5.0]]), [[0.0]]);
        // One in a thousand that is far off counts as the others do.
        let mut with: Vec<f64> = (0..1000).map(|k| f64::from(k % 2)).collect();
        let (ones, like) = (vec![vec![1.0; 1000]], with.clone());
        with[501] = 1e6;
        assert_eq!(grown(&ones, &[with])[0], grown(&ones, &[like])[0]);
    }

    #[test]
    fn travel_since_a_reversal_is_halved_in_a_millimetre_and_acceleration_has_no_sign() {
        let runs = recordings_with_added_force(&[], &[[4e-3, 0.0]], |_| 0.0);
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        let b = &f.data.recordings[0];
        let told = features(b, &vec![0.5; b.len()]);
        // In by 16 mm in 4 s, a second of rest, and back.
        let at = |t: f64| b.block_at(t);
        let (since, rest, back) = (&told[7], &told[4], &told[3]);
        assert!((since[at(2.0)] - 1.0 / 9.0).abs() < 0.01 && (since[at(4.5)] - 1.0 / 17.0).abs() < 0.01);
        assert!((since[at(5.25)] - 0.5).abs() < 0.03, "{}", since[at(5.25)]);
        assert_eq!((rest[at(4.5)], rest[at(2.0)], back[at(6.0)], back[at(2.0)]), (1.0, 0.0, 1.0, 0.0));
        assert!(told[6].iter().all(|a| *a >= 0.0) && told[5].iter().all(|f| *f == 0.5));
    }

    /// How an effect would rather act in insertions that show so much more at every instant.
    fn told(effect: AnyEffect, more_n: impl Fn(f64) -> f64) -> VaryingCoefficient {
        let runs = recordings_with_added_force(&[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], more_n);
        let f = fit_from_truth(&[effect], &runs.iter().collect::<Vec<_>>());
        let less =
            fit(&f.fit.model.without_effect(0), &f.data, Effort { max_iterations: 3, min_gain_nats: 1.0 })
                .expect("a fit");
        varying_coefficient_test(&ScoreTest::new(&f.fit, &f.data), 0, less.nats() - f.fit.nats())
            .expect("a force")
    }

    #[test]
    fn what_is_there_would_not_act_otherwise_and_what_imitates_would() {
        let drift = || ForceDrift { rate_n_per_s: 0.2 }.into();
        let bias = || ForceBias { force_n: 1.0 }.into();
        // By chance half a nat, and the largest of six. A bias times a force with noise in it would be that noise.
        for there in [told(drift(), |t| 0.2 * t), told(bias(), |_| 1.0)] {
            assert!((0.0..10.0).contains(&there.nats) && there.share < 1e-3, "{there:?}");
        }
        // A zero that wanders and comes back is no drift, and a drift no bias.
        for imitates in [told(drift(), |t| 1.0 * (0.3 * t).sin()), told(bias(), |t| 0.2 * t)] {
            assert!(imitates.share > 0.2 && imitates.feature == "time", "{imitates:?}");
        }
        // Beside something of its own it still acts by its law.
        let beside = told(drift(), |t| 0.2 * t + 0.1 * (3.0 * t).sin());
        assert!((0.0..0.05).contains(&beside.share), "{beside:?}");
    }
}
