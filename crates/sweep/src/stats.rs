//! Intervals, rank correlation and first-order sensitivity.

/// Half width of the 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_984_540_054;

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Wilson's score interval of a rate: `hits` of `of`.
#[must_use]
pub fn wilson(hits: f64, of: f64) -> Interval {
    if of <= 0.0 {
        return Interval { value: f64::NAN, low: 0.0, high: 1.0 };
    }
    let (p, z2) = (hits / of, Z95 * Z95);
    let middle = (p + z2 / (2.0 * of)) / (1.0 + z2 / of);
    let half = Z95 / (1.0 + z2 / of) * (p * (1.0 - p) / of + z2 / (4.0 * of * of)).sqrt();
    // Exact at the ends, where rounding would leave a speck.
    let low = if hits <= 0.0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if hits >= of { 1.0 } else { (middle + half).min(1.0) };
    Interval { value: p, low, high }
}

/// The `q` quantile of sorted values with the distribution-free interval between order statistics:
/// the numbers of values below the quantile are binomial, taken as normal. With too few values for
/// an end, that end is the extreme of the sample.
#[must_use]
pub fn quantile(sorted: &[f64], q: f64) -> Option<Interval> {
    let last = sorted.len().checked_sub(1)?;
    let n = sorted.len() as f64;
    let at = q * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    let value = sorted[below] + (at - below as f64) * (sorted[above] - sorted[below]);
    let half = Z95 * (n * q * (1.0 - q)).sqrt();
    let index = |x: f64| (x.max(0.0) as usize).min(last);
    let low = sorted[index((n * q - half).floor() - 1.0)].min(value);
    let high = sorted[index((n * q + half).ceil())].max(value);
    Some(Interval { value, low, high })
}

/// The mean with its normal interval.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Interval> {
    if values.is_empty() {
        return None;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    let half = Z95 * (variance / n).sqrt();
    Some(Interval { value: mean, low: mean - half, high: mean + half })
}

/// Values that exist, in order.
#[must_use]
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.filter(|x| !x.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Ranks from 1, equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let mut to = from + 1;
        while to < order.len() && values[order[to]] == values[order[from]] {
            to += 1;
        }
        for index in &order[from..to] {
            ranks[*index] = (from + to + 1) as f64 / 2.0;
        }
        from = to;
    }
    ranks
}

/// Spearman's rank correlation and its two-sided p-value (Fisher's transform with the variance
/// 1.06/(n - 3) of Fieller et al. 1957). `None` when either does not vary.
#[must_use]
pub fn spearman(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let n = x.len().min(y.len());
    if n < 4 {
        return None;
    }
    let (a, b) = (ranks(&x[..n]), ranks(&y[..n]));
    let middle = (n as f64 + 1.0) / 2.0;
    let dot = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(s, t)| (s - middle) * (t - middle)).sum::<f64>();
    let (xx, yy) = (dot(&a, &a), dot(&b, &b));
    if xx <= 0.0 || yy <= 0.0 {
        return None;
    }
    let rho = (dot(&a, &b) / (xx * yy).sqrt()).clamp(-1.0, 1.0);
    let score = libm::atanh(rho.abs().min(1.0 - 1e-15)) * ((n as f64 - 3.0) / 1.06).sqrt();
    Some((rho, libm::erfc(score / core::f64::consts::SQRT_2)))
}

/// First-order Sobol index of `x` for `y`: the share of the variance of `y` that the mean of `y` given
/// `x` explains. The sample is cut into about `sqrt(n)/2` groups (4 to 40) of equal size along `x`,
/// equal values staying together; what groups of that size explain by chance is taken off (the
/// correlation ratio's epsilon squared), so that an idle quantity comes out around zero.
#[must_use]
pub fn first_order(x: &[f64], y: &[f64]) -> Option<f64> {
    let n = x.len().min(y.len());
    if n < 16 {
        return None;
    }
    let mean = y[..n].iter().sum::<f64>() / n as f64;
    let total: f64 = y[..n].iter().map(|v| (v - mean) * (v - mean)).sum();
    if total <= 0.0 {
        return None;
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]).then(a.cmp(b)));
    let groups = (((n as f64).sqrt() / 2.0) as usize).clamp(4, 40);
    let size = n.div_ceil(groups);
    let (mut between, mut used, mut from) = (0.0, 0usize, 0);
    while from < n {
        let mut to = (from + size).min(n);
        while to < n && x[order[to]] == x[order[to - 1]] {
            to += 1;
        }
        let group: f64 = order[from..to].iter().map(|i| y[*i] - mean).sum();
        between += group * group / (to - from) as f64;
        used += 1;
        from = to;
    }
    let (free, left) = (used as f64 - 1.0, (n - used) as f64);
    if free <= 0.0 || left <= 0.0 {
        return None;
    }
    let within = (total - between).max(0.0) / left;
    Some(((between - free * within) / total).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Sampling};

    #[test]
    fn wilson_agrees_with_published_values() {
        let none = wilson(0.0, 600.0);
        assert!((none.high - 0.006_361).abs() < 1e-5 && none.low == 0.0, "{none:?}");
        let some = wilson(81.0, 263.0);
        // Newcombe 1998, table I.
        assert!((some.low - 0.2553).abs() < 5e-5 && (some.high - 0.3662).abs() < 5e-5, "{some:?}");
    }

    #[test]
    fn the_median_lies_in_its_interval_and_the_interval_covers() {
        let mut covered = 0;
        let design = Design::new(Sampling::Random, 3, 1, 101);
        let mut point = vec![0.0; 101];
        for k in 0..1000 {
            design.point(k, 0, &mut point);
            let found = quantile(&sorted(point.iter().copied()), 0.5).expect("values");
            assert!(found.low <= found.value && found.value <= found.high);
            covered += usize::from(found.low <= 0.5 && 0.5 <= found.high);
        }
        assert!((940..=985).contains(&covered), "{covered} of 1000");
    }

    #[test]
    fn sensitivity_of_a_known_function_is_found() {
        // y = a + 2 b + noise-free interaction-free: indices 1/5 and 4/5, and an idle third quantity.
        let design = Design::new(Sampling::Random, 5, 1, 3);
        let mut point = [0.0; 3];
        let (mut x, mut y) = (vec![Vec::new(); 3], Vec::new());
        for k in 0..4000 {
            design.point(k, 0, &mut point);
            (0..3).for_each(|d| x[d].push(point[d]));
            y.push(point[0] + 2.0 * point[1]);
        }
        let index = |d: usize| first_order(&x[d], &y).expect("it varies");
        assert!((index(0) - 0.2).abs() < 0.03, "{}", index(0));
        assert!((index(1) - 0.8).abs() < 0.03, "{}", index(1));
        assert!(index(2) < 0.02, "{}", index(2));
        let (rho, p) = spearman(&x[1], &y).expect("it varies");
        assert!(rho > 0.85 && p < 1e-10);
        let (rho, p) = spearman(&x[2], &y).expect("it varies");
        assert!(rho.abs() < 0.05 && p > 0.001, "{rho} {p}");
    }
}
