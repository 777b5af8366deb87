use super::*;

const DRIVES: [f64; 3] = [0.002, 0.003, 0.0015];

/// Noise of 1 mN with zero bias.
fn noise() -> NoiseEstimator {
    let mut noise = NoiseEstimator::new(1e-3);
    (0..2000).for_each(|_| noise.update_in_air(0.0));
    noise
}

/// Stiffness, friction per metre, end.
type Layer = (f64, f64, f64);
const FIRST: Layer = (60.0, 9000.0, 0.02);
const SECOND: Layer = (120.0, 5000.0, 0.045);
const FIRST_FRICTION: f64 = 9000.0 * 0.02;
const BOTH_FRICTION: f64 = FIRST_FRICTION + 5000.0 * 0.025;

/// Travel through a layer in steps of 50 um at changing speeds, with the friction `passed` of previous estimator.
fn travel(estimator: &mut LayerEstimator, start_m: f64, (k, b, end_m): Layer, passed: f64) {
    let steps = ((end_m - start_m) / 5e-5) as usize;
    for n in 1..steps {
        let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
        estimator.update(start_m + x, u, k * x + b * x * u + passed * u, 0.0);
    }
}

/// At the end of the second layer, before its rupture.
fn two() -> (LayerEstimator, PassedLayers, NoiseEstimator) {
    let (noise, mut passed_layers) = (noise(), PassedLayers::default());
    let mut estimator = LayerEstimator::at_contact(0.0, 0.0, 0.0, 2000.0, 0.002, &noise);
    travel(&mut estimator, 0.0, FIRST, 0.0);
    estimator.rupture(FIRST.2, 0.0, 0.002, &noise, &mut passed_layers);
    travel(&mut estimator, FIRST.2, SECOND, FIRST_FRICTION);
    (estimator, passed_layers, noise)
}

fn near(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found} for {expected}");
}

#[test]
fn stiffness_and_friction_of_both_layers_are_recovered() {
    let (estimator, _, noise) = two();
    near(estimator.state.x[K], SECOND.0, 0.01);
    near(estimator.state.x[B], SECOND.1, 0.01);
    near(estimator.state.x[K_PREV], FIRST.0, 0.01);
    near(estimator.state.x[B_PREV], FIRST.1, 0.01);
    near(estimator.shaft_friction(0.04, &noise).0, FIRST_FRICTION, 0.01);
    near(estimator.friction_at_rupture(&noise).0, FIRST_FRICTION, 0.01);
    near(estimator.previous_thickness_m, FIRST.2, 1e-9);
    near(estimator.slope(0.002), SECOND.0 + SECOND.1 * 0.002, 0.01);
    near(estimator.friction(0.03), FIRST_FRICTION + SECOND.1 * 0.01, 0.01);
    near(estimator.friction_growth(0.002), FIRST.1 * 0.002, 0.01);
    for (z, u) in [(0.025, 0.001), (0.04, 0.004)] {
        let x = z - FIRST.2;
        let force_n = SECOND.0 * x + SECOND.1 * x * u + FIRST_FRICTION * u;
        near(estimator.predict(z, u), force_n, 0.005);
    }
}

#[test]
fn in_a_gap_friction_keeps_growing_and_extends_the_previous_layer() {
    let (mut estimator, mut passed_layers, noise) = two();
    estimator.rupture(SECOND.2, 0.0, 0.002, &noise, &mut passed_layers);
    // The shaft enters the second layer for another 8 mm while the tip is free.
    estimator.tip_free = true;
    let gap = (0.0, SECOND.1, SECOND.2 + 0.008);
    travel(&mut estimator, SECOND.2, gap, BOTH_FRICTION);
    near(estimator.shaft_friction(SECOND.2 + 0.004, &noise).0, BOTH_FRICTION + SECOND.1 * 0.004, 0.01);
    estimator.start_after_bend(SECOND.2 + 0.008, 1e-4, true, 0.002, &noise, &mut passed_layers);
    assert!(!estimator.tip_free);
    near(estimator.gap_m, 0.008, 1e-9);
    near(estimator.shaft_friction(0.06, &noise).0, BOTH_FRICTION + SECOND.1 * 0.008, 0.01);
    near(estimator.friction_at_rupture(&noise).0, BOTH_FRICTION, 0.01);
    // Variance of the present friction less that of the gap.
    let g = &estimator.state;
    let h = [(D, 1.0), (B_PREV, -0.008)];
    let spread: f64 =
        h.iter().flat_map(|a| h.iter().map(|b| a.1 * g.cov(a.0, b.0) * b.1)).sum::<f64>() * noise.variance;
    let place = g.x[B_PREV] * 1e-4;
    near(estimator.friction_at_rupture(&noise).1, spread + place * place, 1e-6);
    near(passed_layers[1][1], SECOND.2 + 0.008, 1e-9);
    let back = estimator.friction_during_retraction(&passed_layers, SECOND.2 + 0.004, 0.06, &noise);
    near(back, BOTH_FRICTION + SECOND.1 * 0.004, 0.01);
}

/// Friction is part of the uncertainty of `D` already; counting it twice widened the intervals of fast insertions to
/// 99 % coverage instead of 95.
#[test]
fn an_uncertain_rupture_place_opens_the_bias_by_the_stiffness_alone() {
    let (mut estimator, mut passed_layers, noise) = two();
    let before = estimator.state.p[BIAS][BIAS];
    // At 0.3 m/s friction is 1500 N/m of the slope of 1620 N/m.
    estimator.rupture(SECOND.2, 1e-5, 0.3, &noise, &mut passed_layers);
    let open_n = ((estimator.state.p[BIAS][BIAS] - before) * noise.variance).sqrt();
    near(open_n, SECOND.0 * 1e-5, 0.01);
}

#[test]
fn friction_at_rupture_includes_the_next_layer_over_the_uncertain_place() {
    let known = |sd_m: f64| {
        let (mut estimator, mut passed_layers, noise) = two();
        estimator.rupture(SECOND.2, sd_m, 0.002, &noise, &mut passed_layers);
        estimator.state.p[D][D] = 0.0;
        (estimator.state.p[B_PREV][D], estimator.state.x[B]) = (0.0, 7000.0);
        estimator.friction_at_rupture(&noise).1.sqrt()
    };
    near(known(3e-5), 7000.0 * 3e-5, 1e-9);
    assert_eq!(known(0.0), 0.0);
}

#[test]
fn a_late_layer_start_shows_in_the_bias() {
    let (mut estimator, mut passed_layers, noise) = two();
    estimator.rupture(SECOND.2, 0.0, 0.002, &noise, &mut passed_layers);
    estimator.tip_free = true;
    travel(&mut estimator, SECOND.2, (0.0, SECOND.1, SECOND.2 + 0.008), BOTH_FRICTION);
    // Estimated start a millimetre before the face.
    let (face_m, k, b) = (SECOND.2 + 0.008, 100.0, 20_000.0);
    estimator.start_after_bend(face_m - 1e-3, 8e-4, true, 0.002, &noise, &mut passed_layers);
    let at_face = BOTH_FRICTION + SECOND.1 * 0.008;
    for n in 1..400 {
        let (x, u) = (5e-5 * n as f64, DRIVES[n / 40 % 3]);
        estimator.update(face_m + x, u, k * x + b * x * u + at_face * u, 0.0);
    }
    near(estimator.shaft_friction(0.07, &noise).0, at_face, 2e-3);
    // The state itself is off by b times a millimetre, 20 N s/m.
    near(estimator.state.x[D], at_face - b * 1e-3, 0.01);
    let g = &estimator.state;
    let by = g.x[B] / g.x[K];
    let spread = g.p[D][D] + by * by * g.p[BIAS][BIAS] - 2.0 * by * g.cov(BIAS, D);
    near(estimator.shaft_friction(0.07, &noise).1, spread * noise.variance, 1e-9);
    // Limited to two standard deviations of the start, and only where the stiffness exceeds two of its own.
    let mut far = estimator;
    far.state.x[BIAS] -= 1.0;
    near(far.shaft_friction(0.07, &noise).0, far.state.x[D] + far.state.x[B] * 1.6e-3, 1e-9);
    let mut vague = estimator;
    vague.state.p[K][K] = 1.1 * 0.25 * vague.state.x[K] * vague.state.x[K] / noise.variance;
    near(vague.shaft_friction(0.07, &noise).0, vague.state.x[D], 1e-12);
    near(vague.shaft_friction(0.07, &noise).1, vague.state.p[D][D] * noise.variance, 1e-12);
}

use crate::kalman::gaussian::Gaussian;

type Matrix = [[f64; N]; N];

/// A layer from 31 mm on after `passed` others, with correlated unknowns.
fn correlated(passed: usize) -> (LayerEstimator, NoiseEstimator) {
    let noise = NoiseEstimator::known(0.0, 1.6e-3, 0.07, 400.0);
    let mut estimator = LayerEstimator::at_contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
    let map = core::array::from_fn(|i| {
        core::array::from_fn(|j| match (i, j) {
            _ if i == j => 1.0,
            (..WITHOUT_BASELINE, ..WITHOUT_BASELINE) => 0.1 * (i as f64 - 0.7 * j as f64),
            _ => 0.0,
        })
    });
    estimator.state = Gaussian::new([0.0; N], [1.3, 4.0, 0.25, 2.0, 0.5, 0.7, 0.0, 0.0]).transformed(&map);
    estimator.state.x = [130.0, 57.0, 8300.0, 44.0, 7100.0, 0.06, 0.0, 0.0];
    (estimator.start_m, estimator.previous_thickness_m, estimator.passed_count) = (0.031, 0.018, passed);
    (estimator.gap_m, estimator.gap_sd_m, estimator.previous_start_sd_m) = (0.0037, 3e-4, 5e-4);
    (estimator.slope_scale, estimator.layer_confirmed) = (90.0, true);
    (estimator, noise)
}

fn full(g: &Gaussian<N>) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| g.cov(i, j)))
}

/// `h' P h`.
fn spread(p: &Matrix, h: &[f64; N]) -> f64 {
    (0..N * N).map(|n| h[n / N] * p[n / N][n % N] * h[n % N]).sum()
}

fn assert_belief(found: &Gaussian<N>, x: &[f64; N], p: &Matrix) {
    for i in 0..N {
        near(found.x[i], x[i], 1e-9);
        for j in 0..N {
            let scale = (p[i][i] * p[j][j]).sqrt();
            let off = (found.cov(i, j) - p[i][j]).abs();
            assert!(off <= 1e-9 * scale, "{i} {j}: {} for {}", found.cov(i, j), p[i][j]);
        }
    }
}

/// `map x` and `map P map'`.
fn carried(map: &Matrix, x: &[f64; N], p: &Matrix) -> ([f64; N], Matrix) {
    let mean = map.map(|row| (0..N).map(|k| row[k] * x[k]).sum());
    let of = |i: usize, j: usize| (0..N * N).map(|n| map[i][n / N] * p[n / N][n % N] * map[j][n % N]).sum();
    (mean, core::array::from_fn(|i| core::array::from_fn(|j| of(i, j))))
}

#[test]
fn at_contact_half_of_the_force_is_elastic_and_slopes_have_wide_priors() {
    let noise = NoiseEstimator::known(0.0, 1.6e-3, 0.07, 400.0);
    let estimator = LayerEstimator::at_contact(0.013, 0.7, 0.3, 1700.0, 0.0023, &noise);
    let g = &estimator.state;
    assert_eq!(g.x, [0.35, 850.0, 0.5 * (1700.0 / 0.0023), 0.35 / 0.0023, 0.0, 0.07, 0.0, 0.0]);
    let sds = [0.3, 1700.0, 1700.0 / 0.0023, 0.3 / 0.0023, 0.04, 0.002];
    for (i, sd) in sds.into_iter().enumerate() {
        near((g.p[i][i] * noise.variance).sqrt(), sd, 1e-12);
    }
    assert_eq!((estimator.start_m, estimator.contact_drive, estimator.slope_scale), (0.013, 0.0023, 1700.0));
    // Priors limited by a noise of 1 uN: 10 mN, and 10 mN per millimetre.
    let noise = NoiseEstimator::known(0.0, 1e-12, 0.0, 400.0);
    let estimator = LayerEstimator::at_contact(0.0, 0.7, 0.3, 1700.0, 0.0023, &noise);
    for (i, sd) in [(D, 0.01), (K, 10.0), (B, 10.0 / 0.0023), (K_PREV, 0.01 / 0.0023)] {
        near((estimator.state.p[i][i] * noise.variance).sqrt(), sd, 1e-12);
    }
    near(estimator.state.x[K], 5.0, 1e-12);
}

#[test]
fn an_update_uses_the_whitened_regressor() {
    for (passed, rho) in [(0, 0.0), (0, 0.6), (2, 0.0), (2, 0.6)] {
        let (mut estimator, _) = correlated(passed);
        let h = |z: f64, u: f64| {
            let x = z - 0.031;
            if passed == 0 {
                [1.0, x, x * u, u, 0.0, 1.0, 0.0, 0.0]
            } else {
                [u, x, x * u, 0.0, 0.0, 1.0, 0.0, 0.0]
            }
        };
        let samples = [(0.0347, 0.7, 3.1), (0.0391, 1.9, 2.7), (0.0402, 0.3, 9.9)];
        let mut before: Option<(f64, f64, f64)> = None;
        for (n, (z, u, force_n)) in samples.into_iter().enumerate() {
            let (mut h_now, mut y, mut r) = (h(z, u), force_n, 1.0);
            let predicted: f64 = (0..N).map(|i| h_now[i] * estimator.state.x[i]).sum();
            near(estimator.predict(z, u), predicted, 1e-12);
            if rho > 0.0 && n == 1 {
                let (z, u, force_n) = before.expect("a sample before");
                let h_before = h(z, u);
                (0..N).for_each(|i| h_now[i] -= rho * h_before[i]);
                y -= rho * force_n;
            } else {
                // Marginal noise variance of a single sample.
                r = 1.0 / (1.0 - rho * rho);
            }
            let (g, p) = (estimator.state, full(&estimator.state));
            let e = y - (0..N).map(|i| h_now[i] * g.x[i]).sum::<f64>();
            let s = r + spread(&p, &h_now);
            let gain: [f64; N] =
                core::array::from_fn(|i| (0..N).map(|j| p[i][j] * h_now[j]).sum::<f64>() / s);
            let (found_e, found_s) = estimator.update(z, u, force_n, rho);
            near(found_e, e, 1e-9);
            near(found_s, s, 1e-9);
            let x = core::array::from_fn(|i| g.x[i] + gain[i] * e);
            let left = core::array::from_fn(|i| core::array::from_fn(|j| p[i][j] - gain[i] * gain[j] * s));
            assert_belief(&estimator.state, &x, &left);
            before = Some((z, u, force_n));
            if n == 1 {
                // After a skipped sample nothing is whitened.
                estimator.skip_sample();
            }
        }
    }
}

#[test]
fn slope_and_friction_follow_from_state_drive_and_position() {
    let (estimator, noise) = correlated(2);
    near(estimator.slope(0.3), 57.0 + 0.3 * 8300.0, 1e-12);
    near(estimator.friction(0.0345), 130.0 + 8300.0 * 0.0035, 1e-12);
    near(estimator.friction_growth(0.3), 7100.0 * 0.3, 1e-12);
    near(correlated(0).0.friction(0.0345), 44.0 + 8300.0 * 0.0035, 1e-12);
    let p = full(&estimator.state);
    near(estimator.previous_variance(&noise)[0], p[K_PREV][K_PREV] * 1.6e-3, 1e-12);
    near(estimator.previous_variance(&noise)[1], p[B_PREV][B_PREV] * 1.6e-3, 1e-12);
    let (mut falling, _) = correlated(2);
    falling.state.x[B_PREV] = -7100.0;
    near(falling.friction_growth(0.3), 7100.0 * 0.3, 1e-12);
}

#[test]
fn shaft_friction_grows_with_travel_while_the_tip_is_free() {
    let (mut estimator, noise) = correlated(2);
    let p = full(&estimator.state);
    let (found, variance) = estimator.shaft_friction(0.0345, &noise);
    near(found, 130.0, 1e-12);
    near(variance, p[D][D] * 1.6e-3, 1e-12);
    estimator.tip_free = true;
    let (found, variance) = estimator.shaft_friction(0.0345, &noise);
    near(found, 130.0 + 8300.0 * 0.0035, 1e-12);
    near(variance, spread(&p, &[1.0, 0.0, 0.0035, 0.0, 0.0, 0.0, 0.0, 0.0]) * 1.6e-3, 1e-12);
    // None before the start of the layer, and none in the first layer.
    near(estimator.shaft_friction(0.02, &noise).0, 130.0, 1e-12);
    assert_eq!(correlated(0).0.shaft_friction(0.0345, &noise), (0.0, 0.0));
    // At the rupture it was less by the growth over the gap of 3.7 mm.
    let (gave_way, variance) = estimator.friction_at_rupture(&noise);
    near(gave_way, 130.0 - 0.0037 * 7100.0, 1e-12);
    let place = 7100.0 * 3e-4;
    near(variance, spread(&p, &[1.0, 0.0, 0.0, 0.0, -0.0037, 0.0, 0.0, 0.0]) * 1.6e-3 + place * place, 1e-9);
}

#[test]
fn during_retraction_friction_is_shared_among_the_layers() {
    let (mut estimator, noise) = correlated(2);
    let mut passed_layers = PassedLayers::default();
    passed_layers[0] = [0.001, 0.021, 9000.0];
    passed_layers[1] = [0.021, 0.031, 1.0];
    passed_layers[2] = [0.031, 0.041, 5000.0];
    // 180 N s/m, and 71 N s/m of the previous layer, scaled to the estimated sum.
    for (z, inside) in [(0.05, 251.0), (0.031, 251.0), (0.027, 180.0 + 42.6), (0.011, 90.0), (0.0005, 0.0)] {
        near(
            estimator.friction_during_retraction(&passed_layers, z, 0.04, &noise),
            130.0 * inside / 251.0,
            1e-9,
        );
    }
    // With a free tip friction has grown to the deepest point.
    estimator.tip_free = true;
    near(
        estimator.friction_during_retraction(&passed_layers, 0.011, 0.0345, &noise),
        (130.0 + 29.05) * 90.0 / 251.0,
        1e-9,
    );
    // A rupture that is located before the start of its layer leaves a layer without length.
    let mut reversed = passed_layers;
    reversed[1] = [0.021, 0.020_997, 1.0];
    near(
        estimator.friction_during_retraction(&reversed, 0.011, 0.0345, &noise),
        (130.0 + 29.05) * 90.0 / 180.0,
        1e-9,
    );
    // Negative friction counts as zero; without any friction there is no scaling.
    estimator.tip_free = false;
    estimator.state.x[B_PREV] = -3.0;
    near(estimator.friction_during_retraction(&passed_layers, 0.027, 0.04, &noise), 130.0, 1e-12);
    near(estimator.friction_during_retraction(&passed_layers, 0.011, 0.04, &noise), 65.0, 1e-9);
    passed_layers[0][2] = 0.0;
    near(estimator.friction_during_retraction(&passed_layers, 0.011, 0.04, &noise), 130.0, 1e-12);
    estimator.state.x[D] = -4.0;
    assert_eq!(estimator.friction_during_retraction(&passed_layers, 0.011, 0.04, &noise), 0.0);
    // Layers beyond the maximum enter the sum only.
    let (estimator, _) = correlated(MAX_LAYERS + 1);
    let passed_layers: PassedLayers =
        core::array::from_fn(|i| [0.001 * i as f64, 0.001 * (i as f64 + 1.0), 40.0]);
    near(
        estimator.friction_during_retraction(&passed_layers, 0.004, 0.04, &noise),
        130.0 * 4.0 / MAX_LAYERS as f64,
        1e-9,
    );
}

/// RMS of the stiffness, limited by the slope `max`.
fn stiff(g: &Gaussian<N>, noise: &NoiseEstimator, max: f64) -> f64 {
    (g.x[K].powi(2) + g.p[K][K] * noise.variance).sqrt().min(max)
}

/// State just after a rupture at 43.1 mm (standard deviation 0.6 mm) of a layer with slope `before`, RMS stiffness `stiff` and
/// friction `b`.
fn after_a_rupture(
    map: &Matrix,
    (g, noise): (&Gaussian<N>, &NoiseEstimator),
    [before, stiff]: [f64; 2],
    b: f64,
) -> ([f64; N], Matrix) {
    let (mut x, mut p) = carried(map, &g.x, &full(g));
    (x[K], x[B]) = (0.5 * before, 0.5 * before / 0.3);
    (p[K], p[B]) = ([0.0; N], [0.0; N]);
    p.iter_mut().for_each(|row| (row[K], row[B]) = (0.0, 0.0));
    let wide = (3.0 * before).min((1e8 * noise.variance).sqrt() / MEMORY_M);
    p[K][K] = wide * wide / noise.variance;
    p[B][B] = wide * wide / (0.3 * 0.3) / noise.variance;
    p[D][D] += (b * 6e-4).powi(2) / noise.variance;
    p[BIAS][BIAS] += (stiff * 6e-4).powi(2) / noise.variance;
    (x, p)
}

#[test]
fn a_rupture_transforms_the_state_and_starts_a_layer_with_a_wide_prior() {
    // K, b, prior slope, and friction limited by the slope.
    for (k, b, before, friction) in [
        (57.0, 83.0, 81.9, 83.0),
        (-30.0, 70.0, 9.0, 30.0),
        (57.0, -240.0, 15.0, -50.0),
        (-24.2, 80.0, 1.0, 1.0 / 0.3),
    ] {
        let (mut estimator, noise) = correlated(2);
        (estimator.state.x[K], estimator.state.x[B]) = (k, b);
        let (g, mut passed_layers) = (estimator.state, PassedLayers::default());
        passed_layers[1] = [0.013, 0.031, 5.0];
        let mut map = Matrix::default();
        for (i, row) in map.iter_mut().enumerate().skip(WITHOUT_BASELINE) {
            row[i] = 1.0;
        }
        (map[D][D], map[D][B]) = (1.0, 0.0121);
        (map[K_PREV][K], map[B_PREV][B], map[BIAS][BIAS]) = (1.0, 1.0, 1.0);
        let (x, p) = after_a_rupture(&map, (&g, &noise), [before, stiff(&g, &noise, before)], friction);
        estimator.rupture(0.0431, 6e-4, 0.3, &noise, &mut passed_layers);
        assert_belief(&estimator.state, &x, &p);
        assert_eq!(passed_layers[1], [0.013, 0.031, 7100.0], "its estimate at the next rupture");
        near(passed_layers[2][0], 0.031, 1e-12);
        assert_eq!((passed_layers[2][1], passed_layers[2][2], passed_layers[3]), (0.0431, 0.0, [0.0; 3]));
        near(estimator.previous_thickness_m, 0.0121, 1e-9);
        near(estimator.slope_scale, before, 1e-9);
        assert_eq!(
            (estimator.passed_count, estimator.start_m, estimator.layer_confirmed),
            (3, 0.0431, false)
        );
        assert_eq!((estimator.gap_m, estimator.gap_sd_m, estimator.previous_start_sd_m), (0.0, 0.0, 0.0));
        let densities = [true, false].map(|follows| estimator.log_density_of_free(follows, &noise));
        assert_eq!(estimator.initial_log_densities, densities);
    }
}

#[test]
fn a_rupture_after_a_gap_resets_the_bias() {
    let (mut estimator, noise) = correlated(2);
    (estimator.start_sd_m, estimator.tip_free) = (8e-4, true);
    (estimator.state.x[K], estimator.state.x[B]) = (0.0, 83.0);
    let (mut g, mut passed_layers) = (estimator.state, PassedLayers::default());
    passed_layers[1] = [0.013, 0.031, 5.0];
    let mut map = Matrix::default();
    for (i, row) in map.iter_mut().enumerate().skip(WITHOUT_BASELINE) {
        row[i] = 1.0;
    }
    (map[D][D], map[D][B], map[K_PREV][K], map[B_PREV][B]) = (1.0, 1e-6, 1.0, 1.0);
    // The tip was not free: any part of the slope of 24.9 N/m may have been elastic.
    (g.x[K], g.x[B]) = (12.45, 41.5);
    let variance = 12.45 * 12.45 / noise.variance;
    g.p[K][K] += variance;
    g.p[B][B] += variance / (0.3 * 0.3);
    g.p[B][K] -= variance / 0.3;
    // The slope of a free tip does not change the scale. The bias is reset.
    let (mut x, mut p) = after_a_rupture(&map, (&g, &noise), [90.0, stiff(&g, &noise, 90.0)], 41.5);
    x[BIAS] = 0.07;
    p[BIAS][BIAS] += 1.0 / 400.0;
    // A layer has a minimal thickness.
    estimator.rupture(0.03, 6e-4, 0.3, &noise, &mut passed_layers);
    assert_belief(&estimator.state, &x, &p);
    assert_eq!((estimator.previous_start_sd_m, estimator.start_sd_m, estimator.tip_free), (8e-4, 0.0, false));
    near(estimator.previous_thickness_m, 1e-6, 1e-9);
}

#[test]
fn reopening_the_split_is_limited_by_the_noise() {
    for (friction, half) in [(400.0, 60.0), (1e9, 1000.0), (-1e9, -1000.0)] {
        let (mut estimator, _) = correlated(2);
        estimator.state = Gaussian::new([130.0, 0.0, friction, 44.0, 7100.0, 0.06, 0.0, 0.0], [1.0; N]);
        estimator.reopen_split(0.3, 1e8);
        near(estimator.state.x[K], half, 1e-9);
        near(estimator.state.p[K][K], 1.0 + half * half * 1e8, 1e-9);
    }
}

#[test]
fn slope_priors_are_limited_by_the_noise() {
    let (mut estimator, _) = correlated(2);
    let noise = NoiseEstimator::known(0.0, 1e-12, 0.07, 400.0);
    estimator.rupture(0.0431, 0.0, 0.3, &noise, &mut PassedLayers::default());
    near(estimator.slope_scale, 10.0, 1e-9);
    near((estimator.state.p[K][K] * noise.variance).sqrt(), 10.0, 1e-9);
    near((estimator.state.p[B][B] * noise.variance).sqrt(), 10.0 / 0.3, 1e-9);
}

#[test]
fn the_first_layer_began_before_contact_by_force_over_slope() {
    // p, q, K, b at contact, and the depth at contact in m.
    for (p_n, q, k, b, inside_m) in [
        (0.13, 0.9, 57.0, 83.0, Some((0.13 + 0.9 * 0.0023) / (57.0 + 83.0 * 0.0023))),
        // Limited to the travel since.
        (1.9, 0.9, 57.0, 83.0, Some(0.0121)),
        (-0.13, 0.9, 57.0, 83.0, None),
        (-0.0023 * 0.9, 0.9, 57.0, 83.0, None),
        (0.13, 0.9, -57.0, 83.0, None),
        (-0.13, 0.9, -57.0, 83.0, None),
        (0.13, 0.9, -0.0023 * 83.0, 83.0, None),
    ] {
        let (mut estimator, noise) = correlated(0);
        let x = &mut estimator.state.x;
        (x[D], x[K_PREV], x[K], x[B]) = (p_n, q, k, b);
        let (mut g, mut passed_layers) = (estimator.state, PassedLayers::default());
        let delta = inside_m.unwrap_or(0.0);
        if inside_m.is_some() {
            // Constraint p = K delta with the variance of the force.
            let r = spread(&full(&g), &[1.0, 0.0, 0.0, 0.0023, 0.0, 0.0, 0.0, 0.0]);
            let p_is_k_delta = g.innovation([D, K], [1.0, -delta], 0.0, r);
            g.update(&p_is_k_delta);
        }
        let mut map = Matrix::default();
        for (i, row) in map.iter_mut().enumerate().skip(WITHOUT_BASELINE) {
            row[i] = 1.0;
        }
        (map[D][K_PREV], map[D][B], map[K_PREV][K], map[B_PREV][B], map[BIAS][BIAS]) =
            (1.0, 0.0121, 1.0, 1.0, 1.0);
        let before = (g.x[K] + g.x[B] * 0.3).abs().max(1.0);
        let (x, p) = after_a_rupture(
            &map,
            (&g, &noise),
            [before, stiff(&g, &noise, before)],
            g.x[B].clamp(-before / 0.3, before / 0.3),
        );
        estimator.rupture(0.0431, 6e-4, 0.3, &noise, &mut passed_layers);
        assert_belief(&estimator.state, &x, &p);
        near(estimator.previous_thickness_m, 0.0121 + delta, 1e-9);
        near(passed_layers[0][0], 0.031 - delta, 1e-9);
        assert_eq!((passed_layers[0][1], estimator.passed_count), (0.0431, 1));
    }
    // The constraint has a minimal variance.
    let (mut estimator, noise) = correlated(0);
    estimator.state = Gaussian::new(
        [0.13, 57.0, 83.0, 0.9, 0.0, 0.0, 0.0, 0.0],
        [1e-9, 1e-9, 0.1, 1e-9, 0.1, 0.1, 0.0, 0.0],
    );
    let inside_m = (0.13 + 0.9 * 0.0023) / (57.0 + 83.0 * 0.0023);
    estimator.rupture(0.0431, 6e-4, 0.3, &noise, &mut PassedLayers::default());
    let kept = 57.0 + 1e-9 * inside_m * (0.13 - 57.0 * inside_m) / (1e-6 + 1e-9 + 1e-9 * inside_m * inside_m);
    assert!((estimator.state.x[K_PREV] - kept).abs() < 1e-13, "{} for {kept}", estimator.state.x[K_PREV]);
}

#[test]
fn an_upward_bend_starts_a_layer_and_a_downward_bend_ends_friction_growth() {
    for (up, b, grows) in [(true, 83.0, true), (false, 83.0, true), (true, 30.0, false), (false, 30.0, false)]
    {
        let (mut estimator, noise) = correlated(2);
        (estimator.tip_free, estimator.gap_sd_m) = (true, 3e-4);
        (estimator.state.x[B], estimator.state.x[B_PREV]) = (b, 61.0);
        let (g, mut passed_layers) = (estimator.state, PassedLayers::default());
        passed_layers[1] = [0.013, 0.031, 61.0];
        let mut map: Matrix = core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
        map[D][B] = 0.0121;
        estimator.start_after_bend(0.0431, 6e-4, up, 0.3, &noise, &mut passed_layers);
        let (x, p) = if up {
            after_a_rupture(&map, (&g, &noise), [90.0; 2], b)
        } else {
            let (mut x, mut p) = carried(&map, &g.x, &full(&g));
            x[B] = 0.0;
            (0..N).for_each(|i| (p[i][B], p[B][i]) = (0.0, 0.0));
            p[B][B] = b * b / noise.variance;
            p[D][D] += (b * 6e-4).powi(2) / noise.variance;
            (x, p)
        };
        assert_belief(&estimator.state, &x, &p);
        assert_eq!((estimator.tip_free, estimator.start_m), (!up, 0.0431));
        assert_eq!(estimator.start_sd_m, if up { 6e-4 } else { 0.0 });
        // The previous layer is extended if its friction grew at more than half its rate.
        let gap = estimator.gap_m - 0.0037;
        if grows {
            near(gap, 0.0121, 1e-9);
            assert_eq!((passed_layers[1], estimator.gap_sd_m), ([0.013, 0.0431, 61.0], 6e-4));
        } else {
            assert_eq!((gap, passed_layers[1], estimator.gap_sd_m), (0.0, [0.013, 0.031, 61.0], 3e-4));
        }
    }
    // A bend before the start of the layer extends nothing.
    let (mut estimator, noise) = correlated(2);
    let before = estimator.state.x[D];
    estimator.start_after_bend(0.03, 6e-4, false, 0.3, &noise, &mut PassedLayers::default());
    assert_eq!((estimator.gap_m, estimator.state.x[D]), (0.0037, before));
}
