//! Regressors for slow drift: means over stretches further back than the autoregression (heterogeneous autoregression: Corsi 2009).

/// Largest autoregressive order, in blocks; slower correlation is covered by the stretch means.
pub const AR_ORDER: usize = 4;
/// Ranges of preceding blocks whose means are regressors: up to half a second, 2.5 s and 12 s back.
pub(super) const STRETCHES: [(usize, usize); 3] = [(AR_ORDER, 24), (24, 124), (124, 624)];
/// Number of stretches used during model selection; the longest would absorb effects that evolve over tens of seconds.
pub(super) const SEARCH_STRETCHES: usize = 2;
/// Length of a regression row: the residual, its predecessors, the stretch means.
pub(super) const ROW_LEN: usize = 1 + AR_ORDER + STRETCHES.len();

/// Running sums of a column; values that are not finite or not used count as zero.
pub(super) fn running_sums(e: &[f64], used: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut out = Vec::with_capacity(e.len() + 1);
    let mut sum = 0.0;
    out.push(sum);
    for (k, e) in e.iter().enumerate() {
        sum += if e.is_finite() && used(k) { *e } else { 0.0 };
        out.push(sum);
    }
    out
}

/// Means over the stretches before block `k`, limited to the last `reach` blocks.
pub(super) fn stretch_means(sums: &[f64], k: usize, reach: usize) -> [f64; STRETCHES.len()] {
    core::array::from_fn(|i| {
        let (from, to) = STRETCHES[i];
        let (lo, hi) = (k - to.min(reach), k - from.min(reach));
        (sums[hi] - sums[lo]) / (to - from) as f64
    })
}

/// Regression row of block `k`: its residual, its predecessors, the stretch means.
pub(super) fn regression_row(e: &[f64], sums: &[f64], k: usize, reach: usize) -> [f64; ROW_LEN] {
    let slow = stretch_means(sums, k, reach);
    core::array::from_fn(|i| if i <= AR_ORDER { e[k - i] } else { slow[i - AR_ORDER - 1] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{assert_close, normal};

    #[test]
    fn running_sums_and_stretch_means_agree_with_naive_ones() {
        let mut e = normal(2, 700);
        e[13] = f64::NAN;
        let of = running_sums(&e, |k| k % 5 != 2);
        let kept = |k: usize| if k % 5 != 2 && k != 13 { e[k] } else { 0.0 };
        assert_eq!(of.len(), 701);
        for k in [0, 1, 2, 3, 14, 650, 700] {
            assert_close(of[k], (0..k).map(kept).sum());
        }
        for (k, reach) in [(690, 690), (690, 130), (690, 60), (690, 17), (690, 3), (3, 3), (200, 200)] {
            let means = stretch_means(&of, k, reach);
            for (mean, (from, to)) in means.into_iter().zip([(4, 24), (24, 124), (124, 624)]) {
                let sum: f64 = (k - reach.min(to)..k - reach.min(from)).map(kept).sum();
                assert_close(mean, sum / (to - from) as f64);
            }
        }
        let e = normal(2, 700);
        let of = running_sums(&e, |_| true);
        let actual = regression_row(&e, &of, 650, 650);
        assert_eq!(actual[..5], [e[650], e[649], e[648], e[647], e[646]]);
        assert_eq!(actual[5..], stretch_means(&of, 650, 650));
    }
}
