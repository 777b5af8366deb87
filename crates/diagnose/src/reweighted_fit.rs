//! What is heard where the unknown is silent.
//!
//! Beside a force that no effect of the library explains a fit by the sensor's noise is drawn to wherever that force is large: effects that
//! are there come out wrong, others that imitate a part of it come in. But such a force is not alike everywhere: a lump has a depth, a force
//! of the tissue is none in air. Every block is taken to be uncertain by what is left around it, as often as it is correlated (iteratively
//! reweighted least squares, Beaton and Tukey 1974, with a scale that is local): what is left where the law fits tells of effects, and what
//! is there keeps its strength.

use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;

/// What is left is taken together over so long (s) to either side of a block.
const AROUND_S: f64 = 0.25;
/// It is unexplained from so many standard deviations of the noise on.
const LOUD: f64 = 1.5;
/// Weights and fit follow one another so often.
const ROUNDS: usize = 4;

/// A fit by what is left where it fits, and the data so weighted.
#[must_use]
pub fn fit_reweighted(best: &Fit, data: &FitData) -> Option<(Fit, FitData)> {
    let mut f = best.clone();
    let mut weighted = data.clone();
    for _ in 0..ROUNDS {
        weighted = weighed(&f, data);
        f = fit(&f.model, &weighted, Effort { max_iterations: 3, min_gain_nats: 0.1 })?;
    }
    Some((f, weighted))
}

/// The data in doubt by what a fit leaves around every block.
fn weighed(f: &Fit, data: &FitData) -> FitData {
    let of = |(b, e): (&BlockAverages, &Vec<f64>)| b.clone().with_unmodelled_sd(loud(b, e, data));
    data.with_recordings(data.recordings.iter().zip(&f.residuals.residual_n).map(of).collect())
}

/// Standard deviation (N) of what is left around every block, white as it would count; none where it is no more than noise.
fn loud(b: &BlockAverages, e: &[f64], data: &FitData) -> Vec<f64> {
    let half = (AROUND_S / (b.sample_step_s * b.samples_per_block as f64)).round().max(1.0) as usize;
    let square = |k: usize| if b.used[k] { (e[k] * e[k], 1.0) } else { (0.0, 0.0) };
    (0..b.len())
        .map(|k| {
            let around = k.saturating_sub(half)..(k + half + 1).min(b.len());
            let (sum, n) = around.map(square).fold((0.0, 0.0), |a, s| (a.0 + s.0, a.1 + s.1));
            let left = (sum / f64::max(n, 1.0)).sqrt();
            let sd = data.noise.bin_at(b.abs_force_n[k]).sd_n;
            if left > LOUD * sd { left * n.sqrt() } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{AROUND_S, fit_reweighted, loud};
    use crate::test_fixtures::{fit_from_truth, recordings_with_added_force};
    use stylet_identify::fit::{Effort, fit};
    use stylet_tissue::{AnyEffect, ForceDrift};

    const RUNS: [[f64; 2]; 3] = [[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]];

    /// A tenth of a newton around four seconds.
    fn lump(t: f64) -> f64 {
        0.1 * (-(4.0 * (t - 4.0)).powi(2)).exp()
    }

    #[test]
    fn an_effect_keeps_its_strength_beside_a_force_that_is_somewhere() {
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 1e-4 }.into();
        let runs = recordings_with_added_force(&[], &RUNS, |t| 0.02 * t + lump(t));
        let f = fit_from_truth(&[drift], &runs.iter().collect::<Vec<_>>());
        let plain = fit(&f.fit.model, &f.data, Effort::FULL).expect("a fit");
        let (told, weighted) = fit_reweighted(&plain, &f.data).expect("a fit");
        let off = |f: &stylet_identify::fit::Fit| (f.model.effects[0].values[0] / 0.02 - 1.0).abs();
        assert!(off(&told) < 0.02 && off(&plain) > 5.0 * off(&told), "{} {}", off(&plain), off(&told));
        // The blocks around the lump are in doubt, those far from it are not.
        let b = &weighted.recordings[0];
        assert!(b.extra_sd_n[b.block_at(4.0)] > 0.1, "{}", b.extra_sd_n[b.block_at(4.0)]);
        assert_eq!(weighted.noise, f.data.noise);
    }

    #[test]
    fn what_is_left_counts_as_often_as_it_is_correlated_and_noise_does_not() {
        let runs = recordings_with_added_force(&[], &RUNS[..1], |_| 0.0);
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        let b = &f.data.recordings[0];
        let sd = f.data.noise.bins[0].sd_n;
        let half = (AROUND_S / (b.sample_step_s * b.samples_per_block as f64)).round() as usize;
        let mut e = vec![1.4 * sd; b.len()];
        assert!(loud(b, &e, &f.data).iter().all(|l| *l == 0.0));
        e.fill(3.0 * sd);
        let told = loud(b, &e, &f.data);
        let k = (half..b.len() - half).find(|k| (k - half..=k + half).all(|j| b.used[j])).expect("a stretch");
        let wanted = 3.0 * sd * ((2 * half + 1) as f64).sqrt();
        assert!((told[k] / wanted - 1.0).abs() < 1e-9, "{} for {wanted}", told[k]);
    }
}
