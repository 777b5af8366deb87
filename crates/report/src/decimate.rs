//! Thinning of long curves that keeps spikes: the extremes of each bucket are kept.

/// Curves longer than this are thinned; the thinned curve is about as long.
pub(crate) const MAX_POINTS: usize = 20_000;

/// Indices to keep so that about `max_points` remain of curves that share one abscissa: both ends and, in every bucket, the
/// smallest and largest value of each curve and one sample of each gap. `None` when the curves are short enough.
#[must_use]
pub fn kept_indices(columns: &[&[f64]], length: usize, max_points: usize) -> Option<Vec<usize>> {
    if length <= max_points || columns.is_empty() || length == 0 {
        return None;
    }
    let buckets = (max_points / (2 * columns.len())).max(1);
    let mut kept = vec![0, length - 1];
    for bucket in 0..buckets {
        let from = bucket * length / buckets;
        let to = (bucket + 1) * length / buckets;
        for column in columns {
            keep_extremes(column, from, to, &mut kept);
        }
    }
    kept.sort_unstable();
    kept.dedup();
    Some(kept)
}

fn keep_extremes(column: &[f64], from: usize, to: usize, kept: &mut Vec<usize>) {
    let mut lowest: Option<(usize, f64)> = None;
    let mut highest: Option<(usize, f64)> = None;
    let mut gap = None;
    for (offset, &value) in column.get(from..to.min(column.len())).unwrap_or_default().iter().enumerate() {
        let index = from + offset;
        if !value.is_finite() {
            gap.get_or_insert(index);
            continue;
        }
        if lowest.is_none_or(|(_, low)| value < low) {
            lowest = Some((index, value));
        }
        if highest.is_none_or(|(_, high)| value > high) {
            highest = Some((index, value));
        }
    }
    kept.extend([lowest.map(|l| l.0), highest.map(|h| h.0), gap].into_iter().flatten());
}

/// The values at the kept indices; a column too short for an index gives not-a-number there.
#[must_use]
pub fn values_at(column: &[f64], kept: &[usize]) -> Vec<f64> {
    kept.iter().map(|&index| column.get(index).copied().unwrap_or(f64::NAN)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_sample_spikes_and_gaps_are_kept_by_thinning() {
        let mut force: Vec<f64> = (0..1_000_000).map(|i| f64::from(i % 100)).collect();
        force[123_457] = 1e6;
        force[765_432] = -1e6;
        force[500_001] = f64::NAN;
        let quiet = vec![0.0; 1_000_000];
        let kept =
            kept_indices(&[&force, &quiet], force.len(), MAX_POINTS).expect("long enough to be thinned");
        assert!(kept.len() <= MAX_POINTS + 4, "{}", kept.len());
        let thinned = values_at(&force, &kept);
        assert!(thinned.contains(&1e6) && thinned.contains(&-1e6));
        assert!(thinned.iter().any(|v| v.is_nan()));
        assert_eq!((kept.first(), kept.last()), (Some(&0), Some(&999_999)));
        assert!(kept.is_sorted());
    }

    #[test]
    fn short_curves_are_left_alone() {
        assert_eq!(kept_indices(&[&[1.0, 2.0]], 2, MAX_POINTS), None);
    }
}
