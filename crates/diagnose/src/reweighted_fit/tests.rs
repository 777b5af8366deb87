use super::*;
use crate::test_fixtures::fit_simulated;
use stylet_tissue::{AnyEffect, ForceDrift};

const RUNS: [[f64; 2]; 3] = [[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]];

/// A force of 0.1 N around 4 s.
fn lump(t: f64) -> f64 {
    0.1 * (-(4.0 * (t - 4.0)).powi(2)).exp()
}

#[test]
fn effect_keeps_its_strength_in_the_presence_of_a_local_force() {
    let drift: AnyEffect = ForceDrift { rate_n_per_s: 1e-4 }.into();
    let f = fit_simulated(&[drift], &[], &RUNS, |t| 0.02 * t + lump(t));
    let plain = fit(&f.fit.model, &f.data, Effort::FULL).expect("a fit");
    let (fitted, weighted) = fit_reweighted(&plain, &f.data).expect("a fit");
    let off = |f: &stylet_identify::fit::Fit| (f.model.effects[0].values[0] / 0.02 - 1.0).abs();
    assert!(off(&fitted) < 0.02 && off(&plain) > 5.0 * off(&fitted), "{} {}", off(&plain), off(&fitted));
    // The blocks around the lump are down-weighted, others are not.
    let b = &weighted.recordings[0];
    assert!(b.extra_sd_n[b.block_at(4.0)] > 0.1, "{}", b.extra_sd_n[b.block_at(4.0)]);
    assert_eq!(weighted.noise, f.data.noise);
}

#[test]
fn correlated_residual_is_counted_by_its_window_and_noise_is_not() {
    let f = fit_simulated(&[], &[], &RUNS[..1], |_| 0.0);
    let b = &f.data.recordings[0];
    let sd = f.data.noise.bins[0].sd_n;
    let half = (HALF_WINDOW_S / (b.sample_step_s * b.samples_per_block as f64)).round() as usize;
    let mut e = vec![1.4 * sd; b.len()];
    assert!(local_residual_sd(b, &e, &f.data).iter().all(|l| *l == 0.0));
    e.fill(3.0 * sd);
    let fitted = local_residual_sd(b, &e, &f.data);
    let k = (half..b.len() - half).find(|k| (k - half..=k + half).all(|j| b.used[j])).expect("a stretch");
    let wanted = 3.0 * sd * ((2 * half + 1) as f64).sqrt();
    assert!((fitted[k] / wanted - 1.0).abs() < 1e-9, "{} for {wanted}", fitted[k]);
}
