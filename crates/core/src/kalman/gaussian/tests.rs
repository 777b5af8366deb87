use super::*;

type Matrix = [[f64; 3]; 3];

/// Correlated unknowns: mean `map [1, -2, 0.5]`, covariance `map diag(1, 4, 0.25) map'`.
const MAP: Matrix = [[1.0, 0.5, -1.0], [0.3, 1.0, 2.0], [-0.7, 0.2, 1.5]];
const DIAGONAL: [f64; 3] = [1.0, 4.0, 0.25];
const MEAN: [f64; 3] = [1.0, -2.0, 0.5];

fn state() -> Gaussian<3> {
    Gaussian::new(MEAN, DIAGONAL).transformed(&MAP)
}

fn full(g: &Gaussian<3>) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| g.cov(i, j)))
}

fn assert_near(found: &Matrix, expected: &Matrix) {
    for (f, e) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((f - e).abs() < 1e-9, "{found:?} for {expected:?}");
    }
}

/// By Cramer's rule.
fn inverse(m: &Matrix) -> Matrix {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    core::array::from_fn(|i| core::array::from_fn(|j| cofactor(j, i) / determinant))
}

#[test]
fn a_linear_map_transforms_mean_and_covariance() {
    let g = state();
    let expected: Matrix = core::array::from_fn(|i| {
        core::array::from_fn(|j| (0..3).map(|k| MAP[i][k] * DIAGONAL[k] * MAP[j][k]).sum())
    });
    assert_near(&full(&g), &expected);
    for i in 0..3 {
        let mean: f64 = (0..3).map(|k| MAP[i][k] * MEAN[k]).sum();
        assert!((g.x[i] - mean).abs() < 1e-12);
    }
    // Again, with correlated unknowns.
    let twice = g.transformed(&MAP);
    let expected: Matrix = core::array::from_fn(|i| {
        core::array::from_fn(|j| (0..9).map(|n| MAP[i][n / 3] * expected[n / 3][n % 3] * MAP[j][n % 3]).sum())
    });
    assert_near(&full(&twice), &expected);
}

/// In the information form `P⁻¹` grows by `h h'/r`, and `P⁻¹ x` by `h y/r`.
#[test]
fn a_measurement_adds_its_information() {
    let (h, y, r) = ([2.0, 0.0, -0.5], 1.7, 0.3);
    let before = state();
    let innovation = before.innovation([0, 2], [h[0], h[2]], y, r);
    let spread: f64 = (0..9).map(|n| h[n / 3] * before.cov(n / 3, n % 3) * h[n % 3]).sum();
    assert!((innovation.s - (spread + r)).abs() < 1e-12);
    let mut after = before;
    after.update(&innovation);
    let information = inverse(&full(&before));
    let grown: Matrix =
        core::array::from_fn(|i| core::array::from_fn(|j| information[i][j] + h[i] * h[j] / r));
    assert_near(&full(&after), &inverse(&grown));
    for i in 0..3 {
        let was: f64 = (0..3).map(|j| information[i][j] * before.x[j]).sum();
        let is: f64 = (0..3).map(|j| grown[i][j] * after.x[j]).sum();
        assert!((is - (was + h[i] * y / r)).abs() < 1e-9, "{i}");
    }
}

#[test]
fn adding_a_multiple_is_the_corresponding_linear_map() {
    for (i, j) in [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)] {
        let mut sheared = state();
        sheared.add_multiple(i, j, 0.8);
        let mut map: Matrix = core::array::from_fn(|a| core::array::from_fn(|b| f64::from(u8::from(a == b))));
        map[i][j] = 0.8;
        let expected = state().transformed(&map);
        assert_near(&full(&sheared), &full(&expected));
        assert!(sheared.x.iter().zip(expected.x).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

#[test]
fn resetting_a_component_keeps_the_others() {
    let mut g = state();
    g.reset_component(1, 7.0, 9.0);
    let expected = full(&state());
    let (x, was) = (g.x, state().x);
    assert_eq!((x[0], x[1], x[2]), (was[0], 7.0, was[2]));
    for i in 0..3 {
        for j in 0..3 {
            let is = match (i == 1, j == 1) {
                (true, true) => 9.0,
                (false, false) => expected[i][j],
                _ => 0.0,
            };
            assert_eq!(g.cov(i, j), is);
        }
    }
}

#[test]
fn an_impossible_covariance_is_not_positive_definite() {
    assert!(state().is_positive_definite() && state().is_finite());
    // Correlations above one; pairwise possible but jointly impossible ones; a negative variance; NaN and infinity.
    let mut g = Gaussian::new([0.0; 3], [1.0, 4.0, 9.0]);
    g.p[1][0] = 1.9;
    assert!(g.is_positive_definite(), "a correlation of 0.95");
    g.p[1][0] = -2.1;
    assert!(!g.is_positive_definite(), "a correlation of -1.05");
    let mut g = Gaussian::new([0.0; 3], [1.0; 3]);
    (g.p[1][0], g.p[2][0], g.p[2][1]) = (0.9, 0.9, 0.9);
    assert!(g.is_positive_definite());
    g.p[2][1] = -0.9;
    assert!(!g.is_positive_definite());
    let mut g = state();
    g.p[2][2] = -1.0;
    assert!(!g.is_positive_definite());
    for spoil in [f64::NAN, f64::INFINITY] {
        let mut g = state();
        g.x[1] = spoil;
        assert!(!g.is_positive_definite() && !g.is_finite());
        let mut g = state();
        g.p[1][1] = spoil;
        assert!(!g.is_positive_definite() && !g.is_finite());
    }
}

#[test]
fn an_update_beyond_double_precision_leaves_a_definite_covariance() {
    // Rounding leaves 1e-15 of 1e14, with correlations of the size before.
    let (wide, column) = (1e14, 0.98e14);
    let mut g = Gaussian::<3>::new([0.0; 3], [wide, wide, 1.0]);
    g.p[1][0] = column;
    for h in [[1.0, 0.0, 0.0], [1.0 / 3.0, 1.0, 1e-9], [7.3, 0.1, 1.0]] {
        let innovation = g.innovation([0, 1, 2], h, 1.0, 1e-3);
        g.update(&innovation);
        assert!(g.is_positive_definite(), "{:?}", g.p);
    }
    // Cancellation in a time update.
    let mut g = Gaussian::<2>::new([0.0; 2], [1.0, 1e18]);
    g.p[1][0] = -1e9;
    g.add_multiple(0, 1, 1e-9);
    assert!(g.is_positive_definite(), "{:?}", g.p);
}

#[test]
fn variances_keep_their_lower_bounds() {
    // An indefinite covariance, as rounding may leave it.
    let mut g = Gaussian::new([1.0, 2.0, 3.0], [1.0; 3]);
    g.p[1][0] = -3.0;
    let found = g.innovation([0, 1], [0.7, 0.9], 5.0, 0.3);
    assert_eq!(found.s, 0.3);
    assert!((found.e - (5.0 - 0.7 - 1.8)).abs() < 1e-12);
    let mut g = Gaussian::new([1.0, 2.0, 3.0], [0.0, 4.0, 9.0]);
    assert_eq!(g.p[0][0], 1e-15);
    let known = g.innovation([1], [1.0], 5.0, 1e-30);
    g.update(&known);
    assert_eq!((g.p[1][1], g.x[1]), (1e-15, 5.0));
    g.reset_component(2, 7.0, -1.0);
    assert_eq!((g.p[2][2], g.x[2]), (1e-15, 7.0));
}

#[test]
fn large_numbers_are_finite_and_a_zero_variance_is_not_positive_definite() {
    let large = Gaussian::new([1e200; 3], [1e200; 3]);
    assert!(large.is_finite() && large.is_positive_definite());
    let mut g = state();
    (g.p[1][0], g.p[1][1], g.p[2][1]) = (0.0, 0.0, 0.0);
    assert!(!g.is_positive_definite());
    // A correlation of one within rounding is accepted.
    let mut g = Gaussian::new([0.0; 3], [4.0, 9.0, 1.0]);
    g.p[1][0] = 6.0 * (1.0 + 4e-7);
    assert!(g.is_positive_definite());
    g.p[1][0] = 6.0 * (1.0 + 6e-7);
    assert!(!g.is_positive_definite());
}
