use super::*;

const STIFFNESS: f64 = 40.0;
const FRICTION: f64 = 9000.0;
const PASSED: f64 = 150.0;

/// `K x + b x v + D v` and a relaxation of 0.2 N/s.
fn force_n(t: f64, x: f64, v: f64) -> f64 {
    STIFFNESS * x + FRICTION * x * v + PASSED * v - 0.2 * t
}

/// The state for that law at a depth and a speed, with correlated errors.
fn state_at(x: f64, v: f64) -> ForcePredictor {
    let mut predictor = ForcePredictor::new(0.0);
    let mean = [force_n(0.0, x, v), -0.2, STIFFNESS + FRICTION * v, PASSED + FRICTION * x, FRICTION];
    let map = core::array::from_fn(|i| {
        core::array::from_fn(|j| if i == j { 1.0 } else { 0.1 * (i as f64 - 0.5 * j as f64) })
    });
    predictor.state = Gaussian::new([0.0; 5], [1.0, 4.0, 0.25, 2.0, 0.5]).transformed(&map);
    predictor.state.x = mean;
    predictor
}

fn noise(rho: f64) -> NoiseEstimator {
    NoiseEstimator::known(rho, 1e-4, 0.0, 1e6)
}

fn step(dt_s: f64, dz_m: f64, dv_mps: f64, rho: f64) -> MotionStep {
    MotionStep { dt_s, dz_m, dv_mps, rho, sudden: false, speed_mps: 0.002 }
}

#[test]
fn the_prediction_is_exact_for_the_base_law() {
    for (dz, dv) in [(1e-5, 0.0), (0.0, 1e-4), (1e-5, 1e-5), (2e-5, -1e-4), (-1e-5, 1e-4)] {
        let (mut predictor, mut x, mut v) = (state_at(0.01, 0.002), 0.01, 0.002);
        for k in 1..=20 {
            predictor.advance(&step(0.005, dz, dv, 0.0), &noise(0.0));
            (x, v) = (x + dz, v + dv);
            // A step neglects b dz dv.
            let off = predictor.level_n() - force_n(0.005 * f64::from(k), x, v);
            assert!(off.abs() <= 1.001 * f64::from(k) * FRICTION * (dz * dv).abs() + 1e-9, "{off} N");
        }
        assert!((predictor.state.x[S] - (STIFFNESS + FRICTION * v)).abs() < 1e-9);
        assert!((predictor.state.x[B] - (PASSED + FRICTION * x)).abs() < 1e-9);
    }
}

#[test]
fn the_rate_is_the_sum_of_its_terms_with_their_joint_variance() {
    let predictor = state_at(0.01, 0.002);
    let (v, a, known) = (0.7, -0.4, 30.0);
    let (rate, variance) = predictor.rate(v, a, known);
    let x = &predictor.state.x;
    assert!((rate - (x[R] + v * x[S] + a * (x[B] - known))).abs() < 1e-9);
    // h' P h; the known friction is no unknown.
    let h = [0.0, 1.0, v, a, 0.0];
    let expected: f64 = (0..25).map(|n| h[n / 5] * predictor.state.cov(n / 5, n % 5) * h[n % 5]).sum();
    assert!((variance - expected).abs() < 1e-9 * expected, "{variance} {expected}");
}

#[test]
fn a_restart_scales_the_slopes_by_a_force_per_memory_and_keeps_known_friction() {
    let (noise, speed, force_n) = (noise(0.6), 0.002, 0.5);
    let sd_n = |predictor: &ForcePredictor, i: usize, by: f64| {
        (predictor.state.p[i][i] * noise.variance).sqrt() * by
    };
    for all in [false, true] {
        let mut predictor = state_at(0.01, 0.002);
        let was = (predictor.state.x[B], predictor.state.p[B][B]);
        predictor.restart(1.7, force_n, &noise, speed, all);
        assert_eq!(predictor.level_n(), 1.7);
        // The level has the variance of one sample.
        assert!((sd_n(&predictor, L, 1.0) / (noise.variance / (1.0 - 0.36)).sqrt() - 1.0).abs() < 1e-9);
        // The whole force over the memory's travel, or over its duration at the usual speed.
        assert!((sd_n(&predictor, S, MEMORY_M) / force_n - 1.0).abs() < 1e-9);
        assert!((sd_n(&predictor, R, MEMORY_M / speed) / force_n - 1.0).abs() < 1e-9);
        assert!((sd_n(&predictor, C, MEMORY_M * speed) / force_n - 1.0).abs() < 1e-9);
        assert_eq!([predictor.state.x[R], predictor.state.x[S], predictor.state.x[C]], [0.0; 3]);
        if all {
            assert!((sd_n(&predictor, B, speed) / force_n - 1.0).abs() < 1e-9);
            assert_eq!(predictor.state.x[B], 0.0);
        } else {
            assert_eq!(
                (predictor.state.x[B], predictor.state.p[B][B]),
                was,
                "friction is better known than that"
            );
        }
    }
    // A larger friction variance is limited to the whole force.
    let mut predictor = state_at(0.01, 0.002);
    predictor.state.p[B][B] = 1e14;
    predictor.restart(1.7, force_n, &noise, speed, false);
    assert!((sd_n(&predictor, B, speed) / force_n - 1.0).abs() < 1e-9);
}

fn full(predictor: &ForcePredictor) -> [[f64; 5]; 5] {
    core::array::from_fn(|i| core::array::from_fn(|j| predictor.state.cov(i, j)))
}

fn near(found: f64, expected: f64, scale: f64) {
    assert!((found - expected).abs() <= 1e-12 * scale, "{found} for {expected}");
}

#[test]
fn a_step_is_a_linear_map_with_process_noise_on_the_slopes() {
    let noise = noise(0.6);
    for (dz, dv) in [(0.3, 0.7), (0.3, 0.0), (0.0, 0.7), (0.0, 0.0)] {
        let (mut predictor, dt) = (state_at(0.01, 0.002), 0.2);
        predictor.state.x = [1.3, -0.7, 2.9, 5.3, -3.1];
        let (x, p) = (predictor.state.x, full(&predictor));
        predictor.advance(&step(dt, dz, dv, 0.6), &noise);
        let map = [
            [1.0, dt, dz, dv, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, dv],
            [0.0, 0.0, 0.0, 1.0, dz],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ];
        // Long-run factor 1/0.16 for a correlation of 0.6; memories of 0.5 s and 1 mm.
        let process_noise = [0.0, (dt / 0.25).powi(2) / 0.16, (dz / 1e-6).powi(2) / 0.16, 0.0, 0.0];
        for i in 0..5 {
            near(predictor.state.x[i], (0..5).map(|k| map[i][k] * x[k]).sum(), 10.0);
            for j in 0..5 {
                let mut expected: f64 =
                    (0..25).map(|n| map[i][n / 5] * p[n / 5][n % 5] * map[j][n % 5]).sum();
                if i == j {
                    expected += process_noise[i];
                }
                near(predictor.state.cov(i, j), expected, expected.abs().max(1.0));
            }
        }
    }
}

#[test]
fn an_innovation_is_whitened_by_the_previous_sample() {
    let (mut predictor, noise) = (state_at(0.01, 0.002), noise(0.6));
    predictor.state.x = [1.3, -0.7, 2.9, 5.3, -3.1];
    (predictor.last_n, predictor.unpaired) = (1.1, false);
    let (x, p) = (predictor.state.x, full(&predictor));
    for (rho, h) in [(0.5, [0.5, 0.1, 0.15, 0.35, 0.0]), (0.0, [1.0, 0.0, 0.0, 0.0, 0.0])] {
        let found = predictor.innovation(2.3, &step(0.2, 0.3, 0.7, rho), &noise);
        near(found.e, 2.3 - rho * 1.1 - (0..5).map(|i| h[i] * x[i]).sum::<f64>(), 1.0);
        near(found.s, 1.0 + (0..25).map(|n| h[n / 5] * p[n / 5][n % 5] * h[n % 5]).sum::<f64>(), 10.0);
        let mut taken = predictor;
        taken.update(&found, 2.3);
        let mut expected = predictor.state;
        expected.update(&found);
        assert_eq!((taken.state.x, taken.state.p), (expected.x, expected.p));
        assert_eq!((taken.last_n, taken.unpaired), (2.3, false));
        // Without a previous sample the step has no effect.
        taken = predictor;
        taken.skip_sample();
        let alone = taken.innovation(2.3, &step(0.2, 0.3, 0.7, rho), &noise);
        near(alone.e, 1.0, 1.0);
        near(alone.s, p[0][0] + 1.0 / 0.64, 10.0);
    }
}

#[test]
fn resetting_the_level_keeps_the_slopes_and_scales_are_limited() {
    let mut predictor = state_at(0.01, 0.002);
    let (x, p) = (predictor.state.x, full(&predictor));
    predictor.unpaired = false;
    predictor.reset_level(1.7, &noise(0.6));
    assert_eq!((predictor.level_n(), predictor.last_n, predictor.unpaired), (1.7, 1.7, true));
    assert_eq!(predictor.state.x[1..], x[1..]);
    near(predictor.state.p[0][0], 1.0 / 0.64, 1.0);
    for (i, row) in p.iter().enumerate().skip(1) {
        assert_eq!(predictor.state.cov(0, i), 0.0);
        (1..5).for_each(|j| assert_eq!(predictor.state.cov(i, j), row[j]));
    }
    // Noise of 1 uN limits slopes to 10 mN per millimetre.
    let noise = NoiseEstimator::known(0.0, 1e-12, 0.0, 1e6);
    predictor.restart(1.7, 0.5, &noise, 0.002, true);
    near((predictor.state.p[S][S] * 1e-12).sqrt(), 10.0, 10.0);
    assert_eq!((predictor.last_n, predictor.unpaired), (1.7, true));
    // In air the level is constant.
    let air = ForcePredictor::new(0.3);
    assert_eq!((air.state.x, air.last_n, air.unpaired), ([0.3, 0.0, 0.0, 0.0, 0.0], 0.3, true));
    assert_eq!(core::array::from_fn(|i| air.state.p[i][i]), [1.0, 1e-12, 1e-12, 1e-12, 1e-12]);
}
