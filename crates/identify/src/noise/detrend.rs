//! Removes smooth trends from residuals, so that unmodelled smooth structure does not count as noise.

use crate::block_averages::BlockAverages;
use stylet_stats::least_squares::NormalEquations;
use stylet_stats::order_statistics::median;

/// Length (s) of the windows in which a parabola is removed: unmodelled structure is smooth over it.
const DETREND_WINDOW_S: f64 = 1.0;

/// Residuals (N) minus a least-squares parabola in windows of [`DETREND_WINDOW_S`]. Windows whose variance exceeds 2.5 times the median
/// over the eight windows on either side are set to NaN.
pub(super) fn detrended_residuals(b: &BlockAverages, e: &[f64]) -> Vec<f64> {
    let length = (DETREND_WINDOW_S / b.block_s()).round().max(8.0) as usize;
    let n = b.len();
    let mut out = vec![f64::NAN; n];
    let mut windows: Vec<(usize, usize, f64)> = Vec::new();
    let mut from = 0;
    while from < n {
        let to = (from + length).min(n);
        if 2 * (to - from) >= length {
            let m = to - from;
            let x = |k: usize| 2.0 * (k - from) as f64 / m as f64 - 1.0;
            let mut sums = NormalEquations::<3>::new(3);
            for k in (from..to).filter(|k| b.used[*k]) {
                sums.add(&[1.0, x(k), x(k) * x(k)], e[k]);
            }
            let c = sums.solve();
            let mut square = 0.0;
            for k in from..to {
                out[k] = e[k] - c[0] - x(k) * (c[1] + x(k) * c[2]);
                square += out[k] * out[k];
            }
            // Corrects for the three fitted parameters.
            let lost = (m as f64 / (m as f64 - 3.0)).sqrt();
            out[from..to].iter_mut().for_each(|o| *o *= lost);
            windows.push((from, to, square / m as f64));
        }
        from = to;
    }
    // Exclude windows that are rough compared with their neighbours.
    let variances: Vec<f64> = windows.iter().map(|w| w.2).collect();
    for (k, (from, to, variance)) in windows.iter().enumerate() {
        let (lo, hi) = (k.saturating_sub(8), (k + 9).min(windows.len()));
        let mut around: Vec<f64> = variances[lo..hi].to_vec();
        if *variance > 2.5 * median(&mut around) {
            out[*from..*to].fill(f64::NAN);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::still;
    use super::*;
    use crate::test_support::normal;

    /// A trend smooth over one second is removed, and a window rougher than its neighbours is excluded.
    #[test]
    fn detrending_removes_parabolas_and_rough_windows() {
        let mut b = still(1020);
        b.used[130] = false;
        let draw = normal(6, 1020);
        let bent = |k: usize| {
            let s = k as f64 / 50.0;
            0.3 + 0.5 * s - 0.7 * (s - 3.0) * (s - 3.0)
        };
        let rough = |k: usize| if k / 50 == 7 { 1.9 } else { 1.0 };
        let e: Vec<f64> = (0..1020).map(|k| bent(k) + 0.01 * rough(k) * draw[k]).collect();
        let actual = detrended_residuals(&b, &e);
        // Parabola by naive normal equations (Cramer's rule) in every second.
        for window in 0..20 {
            let (from, to) = (50 * window, 50 * window + 50);
            let inside: Vec<usize> = (from..to).filter(|k| b.used[*k]).collect();
            let x = |k: usize| (k - from) as f64;
            let sum = |f: &dyn Fn(usize) -> f64| inside.iter().map(|k| f(*k)).sum::<f64>();
            let s: Vec<f64> = (0..5).map(|p| sum(&|k| x(k).powi(p))).collect();
            let g: Vec<f64> = (0..3).map(|p| sum(&|k| x(k).powi(p) * (e[k] - bent(k)))).collect();
            let det = |m: [[f64; 3]; 3]| {
                m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
                    - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                    + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
            };
            let m = [[s[0], s[1], s[2]], [s[1], s[2], s[3]], [s[2], s[3], s[4]]];
            let c: Vec<f64> = (0..3)
                .map(|p| {
                    let mut with = m;
                    (0..3).for_each(|i| with[i][p] = g[i]);
                    det(with) / det(m)
                })
                .collect();
            for k in from..to {
                let left = e[k] - bent(k) - c[0] - c[1] * x(k) - c[2] * x(k) * x(k);
                if window == 7 {
                    assert!(actual[k].is_nan(), "{k}");
                } else {
                    let expected = left * (50.0 / 47.0_f64).sqrt();
                    assert!((actual[k] - expected).abs() < 1e-8, "{k}: {} for {expected}", actual[k]);
                }
            }
        }
        // Less than half a second is left at the end.
        assert!(actual[1000..].iter().all(|x| x.is_nan()));
        assert!(detrended_residuals(&still(1025), &vec![0.1; 1025])[1000..].iter().all(|x| x.abs() < 1e-12));
    }
}
