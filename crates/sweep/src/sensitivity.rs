//! First-order sensitivity.

/// First-order Sobol index of `x` for `y`: the share of the variance of `y` explained by the mean of `y` given `x`. Estimated by the
/// correlation ratio over about `sqrt(n)/2` groups (4 to 40) of equal size along `x`, ties in one group, corrected for chance (epsilon
/// squared), so that a quantity without influence gives about zero.
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
    use crate::sampling_design::SamplingDesign;
    use stylet_scenario::Sampling;

    #[test]
    fn the_median_lies_in_its_interval_and_the_interval_covers() {
        let mut covered = 0;
        let design = SamplingDesign::new(Sampling::Random, 3, 1, 101);
        let mut point = vec![0.0; 101];
        for k in 0..1000 {
            design.point(k, 0, &mut point);
            let found = stylet_stats::quantile_interval(&stylet_stats::sorted(point.iter().copied()), 0.5)
                .expect("values");
            assert!(found.low <= found.value && found.value <= found.high);
            covered += usize::from(found.low <= 0.5 && 0.5 <= found.high);
        }
        assert!((940..=985).contains(&covered), "{covered} of 1000");
    }

    #[test]
    fn sensitivity_of_a_known_function_is_found() {
        // y = a + 2 b + noise-free interaction-free: indices 1/5 and 4/5, and an idle third quantity.
        let design = SamplingDesign::new(Sampling::Random, 5, 1, 3);
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
        let (rho, p) = stylet_stats::spearman(&x[1], &y).expect("it varies");
        assert!(rho > 0.85 && p < 1e-10);
        let (rho, p) = stylet_stats::spearman(&x[2], &y).expect("it varies");
        assert!(rho.abs() < 0.05 && p > 0.001, "{rho} {p}");
    }
}
