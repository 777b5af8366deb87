use super::*;
use crate::test_fixtures::{blocks_of, data_of, search_result};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use stylet_identify::noise::Noise;

/// Recordings at constant speed, and one that stops, with given residuals in units of the noise.
#[test]
fn excess_is_the_normalised_mean_square_minus_one() {
    let data = |stops: bool| {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) / 100.0).collect();
        let z = t.iter().map(|t| if stops { (2e-3 * t).min(0.01) } else { 2e-3 * t }).collect();
        data_of(vec![blocks_of(t, z, vec![0.0; 1000])], 0.5)
    };
    let still = data(false);
    let n = still.recordings[0].len();
    let e: Vec<f64> = (0..n).map(|k| 0.5 * (0.7 + (k % 5) as f64 * 0.3)).collect();
    let used: Vec<usize> = (0..n).filter(|k| still.recordings[0].used[*k]).collect();
    let square =
        used.iter().map(|k| (0.7 + (k % 5) as f64 * 0.3_f64).powi(2)).sum::<f64>() / used.len() as f64;
    assert!((excess(&still, std::slice::from_ref(&e)) - (square - 1.0)).abs() < 1e-9);
    // Outliers count as six standard deviations.
    let mut far = e.clone();
    far[100] = 99.0;
    let more = (36.0 - (2.0 * e[100]).powi(2)) / used.len() as f64;
    assert!((excess(&still, &[far]) - (square - 1.0 + more)).abs() < 1e-9);
    // Four blocks on both sides of a velocity jump are excluded.
    let stopped = data(true);
    let b = &stopped.recordings[0];
    let jump = b.motion.jumps.first().expect("it stops");
    let (lo, hi) = (b.block_at(jump.time_s - jump.time_sd_s), b.block_at(jump.time_s + jump.time_sd_s));
    let with = |k: usize| {
        let mut e = vec![0.5; n];
        e[k] = 2.0;
        excess(&stopped, &[e])
    };
    for k in [lo - 4, lo, hi, hi + 4] {
        assert!(with(k).abs() < 1e-12, "{k}: {}", with(k));
    }
    for k in [lo - 5, hi + 5] {
        assert!(with(k) > 0.01, "{k}: {}", with(k));
    }
    assert_eq!(excess(&still, &[]), -1.0);
}

/// Slow noise (autocorrelation 0.99 between blocks) of the same size in all recordings: independent, or the same force in each.
#[test]
fn slow_noise_differs_between_recordings_and_a_missing_force_does_not() {
    const SD_N: f64 = 0.01;
    let search = search_result(&[], 3, |_| 0.0);
    let data = search.data.with_noise(Noise::white(SD_N));
    let normal = |rng: &mut ChaCha8Rng| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let leaves_noise = |independent: bool, seed: u64| {
        let mut f = search.best.clone();
        for (r, e) in f.residuals.residual_n.iter_mut().enumerate() {
            let mut slow = ChaCha8Rng::seed_from_u64(if independent { seed + r as u64 } else { seed });
            let mut fast = ChaCha8Rng::seed_from_u64(seed + 10 + r as u64);
            let mut x = 0.0;
            for e in e {
                x = 0.99 * x + 0.2 * normal(&mut slow);
                *e = SD_N * (x + normal(&mut fast));
            }
        }
        let normalised = |e: &Vec<f64>| e.iter().map(|e| e / SD_N).collect();
        f.residuals.innovations = f.residuals.residual_n.iter().map(normalised).collect();
        leaves_slow_noise(&f, &data)
    };
    let count = |independent| (0..20).filter(|seed| leaves_noise(independent, 100 * seed)).count();
    let (noise, force) = (count(true), count(false));
    assert!(noise >= 16 && force == 0, "{noise} {force}");
}
