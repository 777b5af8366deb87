//! Whether an effect acts by its own law, or only somewhat like what is really there.
//!
//! Beside something that no effect of the library explains, the search takes whatever imitates a part of it: friction that builds up over
//! the travel since a reversal for a slack of the clamp, a bias for a force that goes with the square of the acceleration. An effect that
//! is there needs no change where its force is let vary; one that imitates would rather act otherwise.

use stylet_identify::fit::Column;
use stylet_identify::look::Look;
use stylet_identify::objective::replay;

/// Slower than this (m/s) is rest.
const REST_MPS: f64 = 2e-4;

/// By what the force of an effect may vary.
const WITH: usize = 6;

/// What a fit of an effect would gain if its force could also grow with depth, speed, time and force, on the way back and at rest: to
/// first order beside everything that is fitted, as a share of `lost`, the nats that the fit loses without the effect.
#[must_use]
pub fn otherwise(look: &Look<'_>, effect: usize, lost: f64) -> f64 {
    let Some(columns) = columns(look, effect) else { return f64::INFINITY };
    look.gain(&columns).nats / lost.max(1.0)
}

fn columns(look: &Look<'_>, effect: usize) -> Option<Vec<Column>> {
    let data = look.data;
    let forces = force(look, effect)?;
    let mut with: [Vec<Vec<f64>>; WITH] = std::array::from_fn(|_| Vec::new());
    for (r, b) in data.blocks.iter().enumerate() {
        with.iter_mut().for_each(|w| w.push(Vec::with_capacity(b.len())));
        for k in 0..b.len() {
            let t = 0.5 * (b.from_s[k] + b.to_s[k]);
            let (z, v) = b.motion.at(t);
            let (back, rest) = (f64::from(v < -REST_MPS), f64::from(v.abs() < REST_MPS));
            for (w, x) in with.iter_mut().zip([z, v.abs(), t, back, rest, b.f[k]]) {
                w[r].push(x);
            }
        }
    }
    Some(with.iter().map(|w| look.of_force(&grown(&forces, w))).collect())
}

/// The force of an effect in every block (N), by recording.
fn force(look: &Look<'_>, effect: usize) -> Option<Vec<Vec<f64>>> {
    let (fit, data) = (look.fit, look.data);
    let less = fit.model.without(effect);
    let of = |model, r| Some(replay(model, data, r)?.f);
    let part = |r| Some(of(&fit.model, r)?.iter().zip(of(&less, r)?).map(|(a, b)| a - b).collect());
    (0..data.recordings()).map(part).collect()
}

/// Forces times how far off its mean something is, in its standard deviations.
fn grown(forces: &[Vec<f64>], with: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let all: Vec<f64> = with.iter().flatten().copied().collect();
    let (mean, sd) = (stylet_stats::mean(&all), stylet_stats::sd(&all));
    let far = |x: f64| if sd > 0.0 { (x - mean) / sd } else { 0.0 };
    forces.iter().zip(with).map(|(f, x)| f.iter().zip(x).map(|(f, x)| f * far(*x)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::{grown, otherwise};
    use crate::made::{settled, showing};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::look::Look;
    use stylet_tissue::{AnyEffect, ForceBias, ForceDrift};

    #[test]
    fn a_force_grows_by_the_standard_deviations_of_what_it_goes_with() {
        let told = grown(&[vec![2.0, 2.0], vec![3.0, -1.0]], &[vec![1.0, 3.0], vec![1.0, 3.0]]);
        let sd = (4.0_f64 / 3.0).sqrt();
        assert_eq!(told, [vec![-2.0 / sd, 2.0 / sd], vec![-3.0 / sd, -1.0 / sd]]);
        assert_eq!(grown(&[vec![2.0]], &[vec![5.0]]), [[0.0]]);
    }

    /// The share that is told for an effect of insertions that show so much more at every instant.
    fn told(effect: AnyEffect, more_n: impl Fn(f64) -> f64) -> f64 {
        let runs = showing(&[], &[[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]], more_n);
        let f = settled(&[effect], &runs.iter().collect::<Vec<_>>());
        let less = fit(&f.fit.model.without(0), &f.data, Effort { turns: 3, enough: 1.0 }).expect("a fit");
        otherwise(&Look::new(&f.fit, &f.data), 0, less.nats() - f.fit.nats())
    }

    #[test]
    fn what_is_there_would_not_act_otherwise_and_what_imitates_would() {
        let drift = || ForceDrift { rate_n_per_s: 0.2 }.into();
        let bias = || ForceBias { force_n: 1.0 }.into();
        let (there, off) = (told(drift(), |t| 0.2 * t), told(bias(), |_| 1.0));
        assert!((0.0..0.01).contains(&there) && (0.0..0.01).contains(&off), "{there} {off}");
        // A zero that wanders and comes back is no drift, and a drift no bias.
        let (bent, drifts) = (told(drift(), |t| 1.0 * (0.3 * t).sin()), told(bias(), |t| 0.2 * t));
        assert!(bent > 0.2 && drifts > 0.2, "{bent} {drifts}");
        // Beside something of its own it still acts by its law.
        let beside = told(drift(), |t| 0.2 * t + 0.1 * (3.0 * t).sin());
        assert!((0.0..0.05).contains(&beside), "{beside}");
    }
}
