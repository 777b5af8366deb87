use super::*;
use crate::test_support::normal;

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1e-6), "{actual} for {expected}");
}

const CELL_S: f64 = 0.02;

/// Cell midpoints from 3 s on.
fn cells(n: usize) -> Vec<f64> {
    (0..n).map(|k| 3.0 + CELL_S * k as f64).collect()
}

/// Positions with 10 µm of noise.
fn noisy(t: &[f64], trajectory: impl Fn(f64) -> f64) -> Vec<f64> {
    t.iter().zip(normal(11, t.len())).map(|(t, n)| trajectory(*t) + 1e-5 * n).collect()
}

fn frame<'a>(t: &'a [f64], z: &'a [f64]) -> SegmentFit<'a> {
    SegmentFit::new(t, z, CELL_S).expect("cells")
}

fn plain(poly: [f64; 4], sinusoids: &[[f64; 3]], sd_m: f64) -> MotionSegment {
    MotionSegment {
        middle: 4.0,
        half: 2.0,
        poly,
        sinusoids: sinusoids.to_vec(),
        sd_m,
        cost: 0.0,
        white: false,
    }
}

#[test]
fn a_segment_is_a_cubic_plus_sinusoids() {
    let c = plain([0.3, 0.5, -0.7, 0.11], &[[5.0, 0.2, -0.4], [9.0, 0.05, 0.01]], 1.0);
    for t in [2.0_f64, 3.1, 4.0, 5.7] {
        let s = (t - 4.0) / 2.0;
        let cubic = 0.3 + 0.5 * s - 0.7 * s.powi(2) + 0.11 * s.powi(3);
        let sinusoid = |w: f64, x: f64, y: f64| x * (w * (t - 4.0)).cos() + y * (w * (t - 4.0)).sin();
        assert_close(c.at(t).0, cubic + sinusoid(5.0, 0.2, -0.4) + sinusoid(9.0, 0.05, 0.01));
        // The derivative of a sinusoid leads by a quarter period, scaled by its frequency.
        let slope = 0.5 - 1.4 * s + 0.33 * s.powi(2);
        assert_close(
            c.at(t).1,
            slope / 2.0 + sinusoid(5.0, 5.0 * -0.4, -5.0 * 0.2) + sinusoid(9.0, 0.09, -0.45),
        );
    }
    assert_eq!(c.frequencies().collect::<Vec<_>>(), [5.0, 9.0]);
}

#[test]
fn a_rest_has_neither_slope_nor_sinusoid() {
    assert!(plain([0.3, 0.0, 0.0, 0.0], &[], 1.0).is_at_rest());
    for k in 1..4 {
        let mut poly = [0.3, 0.0, 0.0, 0.0];
        poly[k] = 1e-9;
        assert!(!plain(poly, &[], 1.0).is_at_rest());
    }
    assert!(!plain([0.3, 0.0, 0.0, 0.0], &[[1.0, 0.0, 0.1]], 1.0).is_at_rest());
}

#[test]
fn amplitudes_combine_cosine_and_sine() {
    let c = plain([0.0; 4], &[[1.0, 0.3, -0.4], [2.0, 5.0, 12.0]], 1.0);
    assert!(c.sinusoids_exceed(0.499) && !c.sinusoids_exceed(0.501));
    assert!(plain([0.0; 4], &[], 1.0).sinusoids_exceed(9.0));
}

#[test]
fn design_columns_are_cell_means() {
    let t = cells(50);
    let f = frame(&t, &t);
    for (w, cell_s) in [(3.0, 0.3), (40.0, 0.05), (1e-5, 0.02)] {
        let mut row = [7.0; MAX_COEFFICIENTS];
        f.design_row(&mut row, 3.4, 1, &[w, 2.0 * w], cell_s);
        assert_close(row[0], 1.0);
        assert_close(row[1], (3.4 - f.middle) / f.half);
        let mean = |g: &dyn Fn(f64) -> f64| {
            let n = 20_000;
            (0..n)
                .map(|k| g(3.4 - f.middle + cell_s * ((f64::from(k) + 0.5) / f64::from(n) - 0.5)))
                .sum::<f64>()
                / f64::from(n)
        };
        let expected = [
            mean(&|s| (w * s).cos()),
            mean(&|s| (w * s).sin()),
            mean(&|s| (2.0 * w * s).cos()),
            mean(&|s| (2.0 * w * s).sin()),
        ];
        for (actual, expected) in row[2..].iter().zip(expected) {
            assert!((actual - expected).abs() < 1e-7, "{actual} for {expected}");
        }
    }
    let mut row = [7.0; MAX_COEFFICIENTS];
    f.design_row(&mut row, 4.2, 3, &[], CELL_S);
    let s = (4.2 - f.middle) / f.half;
    assert_close(row[2], s * s);
    assert_close(row[3], s * s * s);
    assert_eq!(row[4..], [7.0; 2]);
}

#[test]
fn every_form_is_recovered() {
    let t = cells(400);
    let sinusoid = |t: f64, hz: f64, a: f64| a * (TAU * hz * t + 0.4).sin();
    type Form<'a> = (&'a dyn Fn(f64) -> f64, usize, &'a [f64]);
    let forms: [Form; 6] = [
        (&|_| 0.05, 0, &[]),
        (&|t| 0.05 - 0.003 * t, 1, &[]),
        (&|t| 0.004 * t + 0.0005 * t * t, 2, &[]),
        (&|t| 0.004 * t - 0.0003 * (t - 6.0).powi(3), 3, &[]),
        (&|t| 0.003 * t + sinusoid(t, 0.77, 0.0004), 1, &[0.77]),
        (&|t| 0.003 * t + sinusoid(t, 0.9, 0.0004) + sinusoid(t, 2.3, 0.0002), 1, &[0.9, 2.3]),
    ];
    for (form, degree, hz) in forms {
        let z = noisy(&t, form);
        let c = MotionSegment::fit_best(&t, &z, CELL_S, &[], 0.0).expect("a form");
        assert!(c.white);
        assert_eq!(c.poly.iter().rposition(|x| *x != 0.0), Some(degree));
        assert_eq!(c.is_at_rest(), degree == 0);
        assert_eq!(c.sinusoids.len(), hz.len());
        for (actual, hz) in c.frequencies().zip(hz) {
            assert!((actual / TAU - hz).abs() < 2e-3, "{} for {hz}", actual / TAU);
        }
        assert!((c.sd_m / 1e-5 - 1.0).abs() < 0.1, "{}", c.sd_m);
        // Means over 20 ms hardly attenuate the sinusoids.
        for t in &t[20..380] {
            let (z, v) = c.at(*t);
            let slope = (form(t + 1e-5) - form(t - 1e-5)) / 2e-5;
            assert!((z - form(*t)).abs() < 8e-6 && (v - slope).abs() < 6e-5, "{z} {v} at {t}");
        }
    }
}

#[test]
fn the_cost_of_a_segment_is_residual_plus_parameters() {
    let t = cells(60);
    let z = noisy(&t, |t| 0.002 * t + 0.0004 * (TAU * 0.9 * t).sin());
    let f = frame(&t, &z);
    for (degree, sinusoids) in [(0, &[][..]), (1, &[]), (3, &[]), (1, &[5.0]), (0, &[5.0, 9.0])] {
        let c = f.fit(degree, sinusoids).expect("a form");
        // A frequency is a parameter, too.
        let parameters = (degree + 1 + 3 * sinusoids.len()) as f64;
        let mut x = [0.0; MAX_COEFFICIENTS];
        let count = degree + 1 + 2 * sinusoids.len();
        x[..=degree].copy_from_slice(&c.poly[..=degree]);
        for (k, sinusoid) in c.sinusoids.iter().enumerate() {
            assert_eq!(sinusoid[0], sinusoids[k]);
            x[degree + 1 + 2 * k..degree + 3 + 2 * k].copy_from_slice(&sinusoid[1..]);
        }
        let left = |t: f64, z: f64| {
            let mut row = [0.0; MAX_COEFFICIENTS];
            f.design_row(&mut row, t, degree, sinusoids, CELL_S);
            z - (0..count).map(|k| row[k] * x[k]).sum::<f64>()
        };
        let squares: f64 = t.iter().zip(&z).map(|(t, z)| left(*t, *z).powi(2)).sum();
        let variance = squares / (60.0 - parameters);
        assert_close(c.sd_m, variance.sqrt());
        assert_close(c.cost, 30.0 * variance.ln() + parameters * 60.0_f64.ln());
        // The residual is orthogonal to the columns.
        for k in 0..count {
            let with = |t: f64| {
                let mut row = [0.0; MAX_COEFFICIENTS];
                f.design_row(&mut row, t, degree, sinusoids, CELL_S);
                row[k]
            };
            let together: f64 = t.iter().zip(&z).map(|(t, z)| left(*t, *z) * with(*t)).sum();
            assert!(together.abs() < 1e-8 * (squares * 60.0).sqrt(), "{together}");
        }
        if degree == 1 && !sinusoids.is_empty() {
            assert_close(f.sum_of_squares(&[], 5.0 / TAU, &t, &z, CELL_S), squares);
        }
    }
    // The choice does not depend on the unit: costs differ by a constant.
    let exact: Vec<f64> = t.iter().map(|t| 0.002 * t).collect();
    assert_close(frame(&t, &exact).fit(1, &[]).expect("a form").sd_m, 1e-10);
}

#[test]
fn a_segment_needs_four_more_cells_than_parameters() {
    let f = |n: usize, degree: usize, sinusoids: &[f64]| {
        let (t, z) = (cells(n), normal(11, n));
        frame(&t, &z).fit(degree, sinusoids).is_some()
    };
    assert!(f(5, 0, &[]) && !f(4, 0, &[]));
    assert!(f(8, 3, &[]) && !f(7, 3, &[]));
    assert!(f(9, 1, &[50.0]) && !f(8, 1, &[50.0]));
    assert!(f(12, 1, &[50.0, 90.0]) && !f(11, 1, &[50.0, 90.0]));
    let of = |n: usize| MotionSegment::fit_best(&cells(n), &normal(11, n), CELL_S, &[], 0.0);
    assert!(of(12).is_some() && of(11).is_none());
}

#[test]
fn the_whiteness_test_compares_group_means_with_single_cells() {
    // Eight cells with a common offset: their squared mean is eight times that of white noise of this size.
    let white = |n: usize, off: f64, sd_m: f64| {
        let t = cells(n);
        let (poly, sinusoids) = ([0.2, 0.1, -0.3, 0.05], [[6.0, 0.01, 0.02]]);
        let mut c = plain(poly, &sinusoids, sd_m);
        let f = frame(&t, &t);
        (c.middle, c.half) = (f.middle, f.half);
        // Alternating groups.
        let z: Vec<f64> = t
            .iter()
            .enumerate()
            .map(|(k, t)| {
                let mean = (6.0 * 0.5 * CELL_S).sin() / (6.0 * 0.5 * CELL_S);
                let cubic = plain(poly, &[], 1.0);
                let smooth = MotionSegment { middle: f.middle, half: f.half, ..cubic }.at(*t).0;
                let sinusoid = 0.01 * (6.0 * (t - f.middle)).cos() + 0.02 * (6.0 * (t - f.middle)).sin();
                let group = if k / 8 % 2 == 0 { off } else { -off };
                // Cells after the last whole group do not count.
                smooth + mean * sinusoid + if k >= n / 8 * 8 { 9.0 } else { group }
            })
            .collect();
        frame(&t, &z).is_white(&c)
    };
    for (groups, most) in
        [(10_usize, 1.0 + 5.0 * 0.2_f64.sqrt()), (100, 1.0 + 5.0 * 0.02_f64.sqrt()), (400, 1.5)]
    {
        for beyond in [0, 5] {
            let limit = (most / 8.0_f64).sqrt() * 3e-5;
            assert!(white(8 * groups + beyond, 0.999 * limit, 3e-5), "{groups}");
            assert!(!white(8 * groups + beyond, 1.001 * limit, 3e-5), "{groups}");
        }
    }
}

#[test]
fn least_squares_needs_more_cells_than_coefficients() {
    let row = |row: &mut [f64; MAX_COEFFICIENTS], t: f64| *row = core::array::from_fn(|k| t.powi(k as i32));
    let t = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    let z = t.map(|t| 1e4 + 2.0 * t - 0.5 * t * t);
    let (x, left) = least_squares(&t, &z, 3, &row).expect("a solution");
    for (actual, expected) in x.iter().zip([1e4, 2.0, -0.5, 0.0, 0.0, 0.0]) {
        assert!((actual - expected).abs() < 1e-9, "{x:?}");
    }
    assert!(left < 1e-20);
    // A mean leaves the deviations.
    let (x, left) = least_squares(&t[..4], &[1.0, 2.0, 3.0, 6.0], 1, &row).expect("a solution");
    assert_close(x[0], 3.0);
    assert_close(left, 14.0);
    assert!(
        least_squares(&t[..4], &z[..4], 3, &row).is_some()
            && least_squares(&t[..3], &z[..3], 3, &row).is_none()
    );
    assert!(least_squares(&t, &z, 6, &row).is_some() && least_squares(&t, &z, 7, &row).is_none());
}

#[test]
fn the_cheaper_of_two_is_taken() {
    let of = |cost: f64| MotionSegment { cost, ..plain([cost; 4], &[], 1.0) };
    assert_eq!(cheaper(of(1.0), Some(of(2.0))).cost, 1.0);
    assert_eq!(cheaper(of(3.0), Some(of(2.0))).cost, 2.0);
    assert_eq!(cheaper(of(3.0), None).cost, 3.0);
}

#[test]
fn a_frequency_is_estimated_to_a_thousandth_of_the_resolution() {
    for (n, hz) in [(300, 0.31), (300, 2.9), (1500, 1.37), (60, 1.1)] {
        let t = cells(n);
        let z: Vec<f64> = t.iter().map(|t| 0.003 * t + 3e-4 * (TAU * hz * t + 1.0).sin()).collect();
        let f = frame(&t, &z);
        let resolved = 1.0 / (2.0 * f.half);
        let actual = f.add_sinusoid(&[]).expect("a wave").sinusoids[0][0] / TAU;
        assert!((actual - hz).abs() < 1e-3 * resolved, "{actual} for {hz}");
        // From a nearby frequency.
        for off in [-0.19, 0.12] {
            let actual =
                f.refine_frequency(&[], hz + off * resolved, 0.2 * resolved).expect("a wave").sinusoids[0][0]
                    / TAU;
            assert!((actual - hz).abs() < 1e-3 * resolved, "{actual} for {hz}");
        }
        // Not outside of the search interval.
        let actual = f.refine_frequency(&[], hz - 0.5 * resolved, 0.2 * resolved).expect("a wave").sinusoids
            [0][0]
            / TAU;
        assert!((actual - (hz - 0.3 * resolved)).abs() < 0.01 * resolved, "{actual} for {hz}");
    }
    // Frequencies above 3 Hz, or above the resolution of the cells, are not searched.
    let at_most = |n: usize, hz: f64| {
        let t = cells(n);
        let z: Vec<f64> = t.iter().map(|t| 3e-4 * (TAU * hz * t).sin()).collect();
        frame(&t, &z).add_sinusoid(&[]).expect("a wave").sinusoids[0][0] / TAU
    };
    assert!(at_most(300, 3.6) < 3.1 && at_most(300, 2.95) > 2.9);
}

#[test]
fn a_second_sinusoid_has_another_frequency() {
    let t = cells(500);
    let z: Vec<f64> = t.iter().map(|t| 4e-4 * (TAU * 0.8 * t).sin() + 1e-4 * (TAU * 1.9 * t).cos()).collect();
    let f = frame(&t, &z);
    // A known frequency is not found again.
    let actual = f.add_sinusoid(&[TAU * 0.8]).expect("two waves");
    assert_eq!(actual.sinusoids[0][0], TAU * 0.8);
    assert!((actual.sinusoids[1][0] / TAU - 1.9).abs() < 1e-3);
    // Cells are means, which attenuates the sinusoid.
    for (sinusoid, size) in actual.sinusoids.iter().zip([4e-4, 1e-4]) {
        let mean = (0.5 * CELL_S * sinusoid[0]).sin() / (0.5 * CELL_S * sinusoid[0]);
        assert!((sinusoid[1].hypot(sinusoid[2]) * mean / size - 1.0).abs() < 1e-5, "{sinusoid:?}");
    }
    assert!(actual.sd_m < 1e-9 && actual.poly[1].abs() < 1e-9);
}

#[test]
fn long_intervals_use_frequency_hints_only() {
    let (long, short) = (cells(400), cells(290));
    let of = |t: &[f64], hints: &[f64]| {
        let z = noisy(t, |t| 0.003 * t + 4e-4 * (TAU * 0.8 * t).sin());
        MotionSegment::fit_best(t, &z, CELL_S, hints, 0.0).expect("a form")
    };
    assert!(of(&long, &[TAU * 0.81]).white);
    assert_eq!(of(&long, &[TAU * 0.81]).sinusoids.len(), 1);
    assert!(!of(&long, &[TAU * 1.6]).white);
    // Near a hint the search covers a third of the resolution.
    assert!(of(&long, &[TAU * (0.8 + 0.28 / 8.0)]).white);
    assert!(!of(&long, &[TAU * (0.8 + 0.45 / 8.0)]).white);
    // Below six seconds all frequencies are searched.
    assert!(of(&short, &[TAU * 1.6]).white);
    // A short one resembles a cubic and is a sinusoid all the same.
    let t = cells(120);
    let z = noisy(&t, |t| 0.003 * t + 4e-4 * (TAU * 0.3 * t).sin());
    let cubic = MotionSegment::fit_best(&t, &z, CELL_S, &[], 0.0).expect("a form");
    let sinusoid = MotionSegment::fit_best(&t, &z, CELL_S, &[1e-3], 0.0).expect("a form");
    assert!(sinusoid.cost <= cubic.cost);
}

#[test]
fn a_quantisation_artefact_is_not_a_sinusoid() {
    let t = cells(400);
    let z = noisy(&t, |t| 0.003 * t + 2e-5 * (TAU * 0.8 * t).sin());
    let of = |rounded_m: f64| MotionSegment::fit_best(&t, &z, CELL_S, &[], rounded_m).expect("a form");
    let sinusoid = of(1.8e-5);
    assert!(sinusoid.white && sinusoid.sinusoids.len() == 1);
    let line = of(2.2e-5);
    assert!(line.white && line.sinusoids.is_empty() && !line.is_at_rest());
    assert!(line.sd_m > sinusoid.sd_m);
}
