use super::super::AfterBreak;
use super::super::tests::still;
use super::*;
use crate::test_support::{assert_close, normal};
use stylet_stats::linear_algebra::SymmetricMatrix;

/// Autocovariance of the process with these partial autocorrelations (Levinson and Durbin).
fn autocovariance(reflection: &[f64], sd: f64) -> Vec<f64> {
    let (mut c, mut a, mut left) = (vec![sd * sd], Vec::<f64>::new(), sd * sd);
    for lag in 1..12 {
        let k = reflection.get(lag - 1).copied().unwrap_or(0.0);
        c.push(a.iter().zip(c.iter().rev()).map(|(a, c)| a * c).sum::<f64>() + k * left);
        a = a.iter().zip(a.iter().rev()).map(|(x, y)| x - k * y).chain([k]).collect();
        left *= 1.0 - k * k;
    }
    c
}

/// Noise with the exact predictors of an autoregressive process, and its autocovariance.
fn of_process(reflection: &[f64], sd: f64) -> (ForceBinNoise, Vec<f64>) {
    let c = autocovariance(reflection, sd);
    let mut bin = ForceBinNoise::white(c[0].sqrt());
    for run in 0..=AR_ORDER {
        let mut h = SymmetricMatrix::zeros(run);
        for i in 0..run {
            for j in 0..=i {
                h.add(i, j, c[i - j]);
            }
        }
        let a = h.cholesky().solve(&c[1..=run]);
        let left = c[0] - a.iter().zip(&c[1..]).map(|(a, c)| a * c).sum::<f64>();
        let mut padded = [0.0; AR_ORDER];
        padded[..run].copy_from_slice(&a);
        if run == AR_ORDER {
            (bin.ar, bin.innovation_sd_n) = (padded, left.sqrt());
        } else {
            bin.after_break[run] =
                AfterBreak { ar: padded, long_memory: [0.0; STRETCHES.len()], sd_n: left.sqrt() };
        }
    }
    (bin, c)
}

/// Log density of a normal vector with this covariance, by a naive Cholesky factorisation.
fn ln_density(e: &[f64], covariance: impl Fn(usize, usize) -> f64) -> f64 {
    let n = e.len();
    let mut l = vec![vec![0.0; n]; n];
    let (mut y, mut sum) = (vec![0.0; n], -0.5 * n as f64 * libm::log(core::f64::consts::TAU));
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let left = covariance(i, j) - known;
            l[i][j] = if i == j { left.sqrt() } else { left / l[j][j] };
        }
        let known: f64 = (0..i).map(|k| l[i][k] * y[k]).sum();
        y[i] = (e[i] - known) / l[i][i];
        sum -= 0.5 * y[i] * y[i] + libm::log(l[i][i]);
    }
    sum
}

#[test]
fn whitening_gives_the_likelihood_of_the_dense_covariance() {
    let (bin, c) = of_process(&[0.6, -0.35, 0.2, 0.1], 0.03);
    let mut b = still(12);
    // A block that is not compared ends the memory.
    b.used[7] = false;
    b.memory_reset[8] = true;
    let noise = Noise { edges_n: Vec::new(), bins: vec![bin], long_memory: false };
    let e: Vec<f64> = normal(5, 12).into_iter().map(|x| 0.03 * x).collect();
    let w = noise.whiten(&noise.whitening_plan(&b), &e);
    let actual: f64 = -w.iter().map(|w| 0.5 * w * w).sum::<f64>()
        - sum_ln_sd(&noise, &b)
        - 0.5 * 11.0 * libm::log(core::f64::consts::TAU);
    let toeplitz = |i: usize, j: usize| c[i.abs_diff(j)];
    assert_close(actual, ln_density(&e[..7], toeplitz) + ln_density(&e[8..], toeplitz));
    assert_eq!(w[7], 0.0);
    // Timing uncertainty adds to the block's own innovation only.
    b.extra_sd_n[4] = 0.05;
    let doubted = noise.whiten(&noise.whitening_plan(&b), &e);
    assert_close(
        doubted[4],
        w[4] * bin.innovation_sd_n / (bin.innovation_sd_n * bin.innovation_sd_n + 0.0025).sqrt(),
    );
    assert_eq!([doubted[3], doubted[5]], [w[3], w[5]]);
}

/// Sum of the logarithms of the innovations' standard deviations.
fn sum_ln_sd(noise: &Noise, b: &BlockAverages) -> f64 {
    let rows = noise.whitening_plan(b).rows;
    rows.iter().filter(|r| r.sd_n.is_finite()).map(|r| libm::log(r.sd_n)).sum()
}

/// Two ranges with long memory, breaks, and blocks that are not compared.
fn wandering(lasting: bool) -> (Noise, BlockAverages) {
    let mut b = still(900);
    for k in 0..900 {
        b.abs_force_n[k] = if k % 7 < 3 { 0.4 } else { 1.1 };
        b.used[k] = k % 53 != 0;
        b.memory_reset[k] = k % 53 == 1 || k == 300;
    }
    let bin = |x: f64| {
        let mut bin = ForceBinNoise::white(0.02 * x);
        bin.ar = [0.3 * x, 0.1, -0.05 * x, 0.02];
        bin.long_memory = [0.2, 0.1 * x, 0.15];
        bin.innovation_sd_n = 0.015 * x;
        for (k, first) in bin.after_break.iter_mut().enumerate() {
            first.ar[..k].copy_from_slice(&[0.31 * x, 0.11, 0.05][..k]);
            first.long_memory = [0.25, 0.11, 0.05 * x];
            first.sd_n = 0.03 - 0.002 * k as f64;
        }
        bin
    };
    (Noise { edges_n: vec![0.9], bins: vec![bin(1.0), bin(1.3)], long_memory: lasting }, b)
}

/// Innovation of one block by the definition.
fn innovation_of(noise: &Noise, b: &BlockAverages, e: &[f64], k: usize) -> f64 {
    let since = (0..=k).rev().find(|j| b.memory_reset[*j]).unwrap_or(0);
    let bin = &noise.bins[usize::from(b.abs_force_n[k] >= 0.9)];
    let run = k - since;
    let (a, slow, sd) = match bin.after_break.get(run) {
        Some(f) => (f.ar, f.long_memory, f.sd_n),
        None => (bin.ar, bin.long_memory, bin.innovation_sd_n),
    };
    let mut w = e[k];
    for i in 1..=run.min(4) {
        w -= a[i - 1] * e[k - i];
    }
    let begin = if noise.long_memory { 0 } else { since };
    for (slow, (from, to)) in slow.iter().zip([(4, 24), (24, 124), (124, 624)]) {
        let counts = |j: &usize| *j >= begin && (!noise.long_memory || b.used[*j]);
        let stretch = (k.saturating_sub(to)..k.saturating_sub(from)).filter(counts);
        w -= slow * stretch.map(|j| e[j]).sum::<f64>() / (to - from) as f64;
    }
    w / sd
}

/// By the definition, for residuals with leading and trailing zeros.
#[test]
fn zero_residuals_have_zero_innovations_beyond_the_memory() {
    let normals = normal(9, 900);
    for wanders in [false, true] {
        let (mut noise, b) = wandering(false);
        for bin in noise.bins.iter_mut().filter(|_| !wanders) {
            bin.long_memory = [0.0; STRETCHES.len()];
            bin.after_break.iter_mut().for_each(|f| f.long_memory = bin.long_memory);
        }
        let plan = noise.whitening_plan(&b);
        assert_eq!(plan.has_long_memory, wanders);
        for something in [0..900, 0..1, 299..303, 411..640, 898..900, 500..500] {
            let e: Vec<f64> =
                (0..900).map(|k| if something.contains(&k) { normals[k] } else { 0.0 }).collect();
            let w = noise.whiten(&plan, &e);
            for k in 0..900 {
                let expected = if b.used[k] { innovation_of(&noise, &b, &e, k) } else { 0.0 };
                assert!((w[k] - expected).abs() < 1e-9, "{} for {expected} at {k}", w[k]);
            }
        }
    }
}

#[test]
fn slow_drift_is_predicted_from_stretch_means() {
    for lasting in [false, true] {
        let (noise, b) = wandering(lasting);
        let e = normal(7, b.len());
        let plan = noise.whitening_plan(&b);
        let w = noise.whiten(&plan, &e);
        for k in 0..b.len() {
            assert_close(w[k], if b.used[k] { innovation_of(&noise, &b, &e, k) } else { 0.0 });
        }
        let sizes = |k: usize| {
            let since = (0..=k).rev().find(|j| b.memory_reset[*j]).unwrap_or(0);
            let bin = &noise.bins[usize::from(b.abs_force_n[k] >= 0.9)];
            libm::log(bin.after_break.get(k - since).map_or(bin.innovation_sd_n, |f| f.sd_n))
        };
        assert_close(sum_ln_sd(&noise, &b), (0..b.len()).filter(|k| b.used[*k]).map(sizes).sum::<f64>());
        // Unwhitening the innovations gives the residuals back; zero where not compared.
        let bare: Vec<f64> = e.iter().zip(&b.used).map(|(e, used)| if *used { *e } else { 0.0 }).collect();
        let again = noise.unwhiten(&plan, &noise.whiten(&plan, &bare));
        for (actual, expected) in again.iter().zip(&bare) {
            assert!((actual - expected).abs() < 1e-9, "{actual} for {expected}");
        }
    }
}
