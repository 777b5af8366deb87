use super::*;

/// Normal numbers by the quantile of a small counter-based generator (SplitMix64).
fn normals(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed;
    (0..n)
        .map(|_| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            crate::normal::quantile(((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 2f64.powi(-54))
        })
        .collect()
}

fn coloured(seed: u64, n: usize, a: &[f64], sd: f64) -> Vec<f64> {
    let mut e = vec![0.0; n + 500];
    for (t, w) in normals(seed, n + 500).into_iter().enumerate() {
        let predicted: f64 =
            a.iter().enumerate().filter(|(j, _)| *j < t).map(|(j, a)| a * e[t - 1 - j]).sum();
        e[t] = predicted + sd * w;
    }
    e.split_off(500)
}

#[test]
fn whitened_noise_of_the_fitted_model_is_white_with_unit_variance() {
    let e = coloured(1, 20_000, &[1.2, -0.5, 0.1], 0.02);
    let ar = Ar::fit(&[&e], 10, Criterion::Bic);
    assert!((2..=4).contains(&ar.order()), "{}", ar.order());
    assert!((ar.innovations_sd() / 0.02 - 1.0).abs() < 0.02, "{}", ar.innovations_sd());
    let mut w = vec![0.0; e.len()];
    ar.whiten(&e, &mut w);
    assert!((crate::rms(&w) - 1.0).abs() < 0.01);
    for lag in 1..20 {
        let r = w.iter().zip(&w[lag..]).map(|(x, y)| x * y).sum::<f64>() / w.len() as f64;
        assert!(r.abs() < 4.0 / (w.len() as f64).sqrt(), "lag {lag}: {r}");
    }
}

#[test]
fn bic_selects_order_zero_for_white_noise() {
    let wrong =
        (0..200).filter(|seed| Ar::fit(&[&normals(*seed, 2000)], 8, Criterion::Bic).order() > 0).count();
    assert!(wrong <= 6, "{wrong} of 200");
}

#[test]
fn seams_between_segments_do_not_enter_the_fit() {
    // Many short segments with a step between them, which a fit across the seams would take for autocorrelation.
    let noise = normals(9, 5000);
    let segments: Vec<Vec<f64>> = noise.chunks(50).map(<[f64]>::to_vec).collect();
    let parts: Vec<&[f64]> = segments.iter().map(Vec::as_slice).collect();
    let ar = Ar::burg(&parts, 1);
    assert!(ar.coefficients()[0].abs() < 0.05);
    let e = coloured(4, 8000, &[0.9], 1.0);
    let whole = Ar::burg(&[&e], 1).coefficients()[0];
    let split: Vec<&[f64]> = e.chunks(200).collect();
    assert!((Ar::burg(&split, 1).coefficients()[0] - whole).abs() < 0.005);
}

#[test]
fn autocovariance_round_trip() {
    let ar = Ar::from_reflection(&[0.9, -0.4, 0.2], 0.3);
    let mut lags = [0.0; 12];
    ar.autocovariance(&mut lags);
    let back = Ar::from_autocovariance(&lags[..4]);
    for (a, b) in ar.coefficients().iter().zip(back.coefficients()) {
        assert!((a - b).abs() < 1e-12);
    }
    assert!((back.innovations_sd() / ar.innovations_sd() - 1.0).abs() < 1e-12);
    // From more lags than the order, the further reflection coefficients are zero.
    let longer = Ar::from_autocovariance(&lags);
    assert!(longer.reflection()[3..].iter().all(|k| k.abs() < 1e-10));
}

#[test]
fn degenerate_data_give_finite_models() {
    assert!(Ar::burg(&[], 3).sd().is_nan());
    assert_eq!(Ar::burg(&[&[0.0; 100]], 3).sd(), 0.0);
    assert_eq!(Ar::burg(&[&[1.0, 2.0]], 3).order(), 0);
    let constant = Ar::burg(&[&[1.0; 100]], 3);
    assert!(constant.reflection().iter().all(|k| k.abs() < 1.0) && constant.innovations_sd() > 0.0);
    let tone: Vec<f64> = (0..1000).map(|i| libm::sin(0.1 * f64::from(i))).collect();
    assert!(Ar::fit(&[&tone], 8, Criterion::Aic).innovations_sd().is_finite());
}

#[test]
fn whitening_subtracts_the_prediction() {
    let ar = Ar::from_reflection(&[0.8, -0.5, 0.3], 2.0);
    let e = [1.0, -0.5, 2.0, 0.25, -3.0, 1.5];
    let mut w = [0.0; 6];
    ar.whiten(&e, &mut w);
    for t in 0..6 {
        let (mean, sd) = ar.predict(&e[..t]);
        assert!(((e[t] - mean) / sd - w[t]).abs() < 1e-14, "{t}");
    }
    // The first sample is predicted by the process; at order three only three samples matter.
    assert_eq!(ar.predict(&[]), (0.0, 2.0));
    assert_eq!(ar.predict(&[9.0, 1.0, 2.0, 3.0]), ar.predict(&[1.0, 2.0, 3.0]));
    // From one sample: correlation 0.8, conditional variance 4 (1 - 0.64).
    let (mean, sd) = ar.predict(&[1.5]);
    assert!((mean - 1.2).abs() < 1e-15 && (sd - 2.0 * 0.6).abs() < 1e-15);
    assert_eq!(
        (Ar::white(3.0).predict(&[1.0]), Ar::first_order(0.5, 1.0).coefficients()),
        ((0.0, 3.0), &[0.5][..])
    );
}

#[test]
fn the_selected_order_minimises_the_criterion() {
    for seed in 0..20 {
        let e = coloured(seed, 120, &[0.5, -0.2, 0.15], 1.0);
        let halves = [&e[..50], &e[50..]];
        for (criterion, penalty) in [(Criterion::Aic, 2.0), (Criterion::Bic, 120f64.ln())] {
            let cost = |p: usize| 240.0 * Ar::burg(&halves, p).innovations_sd().ln() + penalty * p as f64;
            let best = (0..=6).min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
            assert_eq!(Some(Ar::fit(&halves, 6, criterion).order()), best, "{seed} {criterion:?}");
        }
    }
}

#[test]
fn the_first_coefficient_of_burg_s_method_agrees_with_a_hand_calculation() {
    // 2 sum f b / sum (f^2 + b^2) over neighbours inside the segments: 2 (2 + 2 + 12 - 2)/(5 + 5 + 25 + 5).
    let ar = Ar::burg(&[&[1.0, 2.0, 1.0], &[3.0, 4.0], &[-1.0, 2.0]], 1);
    assert!((ar.coefficients()[0] - 0.7).abs() < 1e-15);
    assert!((ar.sd() - (36.0_f64 / 7.0).sqrt()).abs() < 1e-15);
    assert!((ar.innovations_sd() - ar.sd() * (1.0 - 0.49_f64).sqrt()).abs() < 1e-15);
    // A segment of three samples identifies one coefficient, of two samples none.
    assert_eq!(Ar::burg(&[&[1.0, 2.0, 1.0]], 9).order(), 1);
    assert_eq!(Ar::burg(&[&normals(3, 200)], 40).order(), MAX_ORDER);
}

#[test]
fn repeating_a_recording_does_not_change_the_fit() {
    let e = coloured(11, 90, &[0.9, -0.4, 0.2], 1.0);
    let (once, thrice) = (Ar::burg(&[&e], 4), Ar::burg(&[&e, &e, &e], 4));
    assert_eq!((once.order(), thrice.order()), (4, 4));
    for (a, b) in once.reflection().iter().zip(thrice.reflection()) {
        assert!((a - b).abs() < 1e-13, "{once:?} {thrice:?}");
    }
    // Nor does the order of two recordings.
    let (short, long) = (&e[..30], &e[30..]);
    let (ab, ba) = (Ar::burg(&[short, long], 4), Ar::burg(&[long, short], 4));
    assert!(ab.reflection().iter().zip(ba.reflection()).all(|(a, b)| (a - b).abs() < 1e-13), "{ab:?} {ba:?}");
}

#[test]
fn models_are_stationary_and_of_limited_order() {
    assert_eq!(Ar::from_reflection(&[0.1; 40], 1.0).order(), MAX_ORDER);
    let clipped = Ar::from_reflection(&[2.0, -2.0, f64::NAN], 1.0);
    assert!(clipped.reflection().iter().all(|k| k.abs() < 1.0) && clipped.innovations_sd() > 0.0);
    assert_eq!(clipped.reflection()[2], 0.0);
    for (lags, order) in [(&[][..], 0), (&[-1.0, 0.5], 0), (&[0.0, 0.0], 0), (&[1.0, 0.5], 1)] {
        assert_eq!(Ar::from_autocovariance(lags).order(), order, "{lags:?}");
    }
    assert_eq!(Ar::from_autocovariance(&[0.1; 50]).order(), MAX_ORDER);
    assert_eq!(Ar::from_reflection(&[0.5], 1.0).with_sd(3.0), Ar::from_reflection(&[0.5], 3.0));
}

#[test]
fn the_likelihood_of_short_segments_is_the_multivariate_normal() {
    let ar = Ar::from_reflection(&[0.6, -0.3], 2.0);
    let mut lags = [0.0; 3];
    ar.autocovariance(&mut lags);
    assert!((lags[0] - 4.0).abs() < 1e-15 && (lags[1] - 2.4).abs() < 1e-15);
    // One sample: variance 4. Two: a bivariate normal with correlation 0.6.
    let one = -0.5 * (1.5 * 1.5 / 4.0 + (TAU * 4.0).ln());
    assert!((ar.ln_likelihood(&[1.5], &mut [0.0]) - one).abs() < 1e-14);
    let (x, y, r) = (1.5_f64, -1.0_f64, 0.6_f64);
    let rest: f64 = 1.0 - r * r;
    let two = -0.5 * (x * x - 2.0 * r * x * y + y * y) / (4.0 * rest) - (TAU * 4.0 * rest.sqrt()).ln();
    assert!((ar.ln_likelihood(&[x, y], &mut [0.0; 2]) - two).abs() < 1e-14);
    assert!((ar.ln_sd_sum(2) - (2.0_f64 * 2.0 * 0.8).ln()).abs() < 1e-14);
    assert_eq!(ar.ln_likelihood(&[], &mut []), 0.0);
}

/// The roots of the characteristic polynomial all lie inside the unit circle.
#[test]
fn a_process_is_stationary_when_its_roots_are_inside_the_unit_circle() {
    // Coefficients of `(1 - p z)(1 - q z)(1 - r z)`.
    let product = |p: f64, q: f64, r: f64| [p + q + r, -(p * q + p * r + q * r), p * q * r];
    for (p, q, r, wanted) in [
        (0.5, 0.3, -0.4, true),
        (0.95, 0.9, 0.85, true),
        (0.95, -0.97, 0.3, true),
        (1.05, 0.4, 0.2, false),
        (0.5, -1.02, 0.1, false),
        (0.2, 1.2, 0.9, false),
        (0.2, 1.2, 0.7, false),
    ] {
        assert_eq!(stationary(&product(p, q, r)), wanted, "{p} {q} {r}");
    }
    // The triangle of two coefficients.
    for (a, b, wanted) in [
        (0.5, 0.45, true),
        (0.5, 0.55, false),
        (-1.4, -0.6, true),
        (-1.7, -0.6, false),
        (0.2, -0.998, true),
        (0.2, -0.9995, false),
        (1.5, -0.6, true),
    ] {
        assert_eq!(stationary(&[a, b]), wanted, "{a} {b}");
    }
    assert!(stationary(&[]) && stationary(&[0.998]) && !stationary(&[0.999]) && !stationary(&[-1.0]));
}
