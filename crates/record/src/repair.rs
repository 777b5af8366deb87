//! Time stamps that do not increase: the fewest rows to drop.

/// Which rows to keep so that time strictly increases and the fewest rows are lost; `None` when nothing is wrong.
///
/// Of several equally short sets of losses the earlier rows stay: the second of two equal time stamps goes, and so does
/// a row that falls back behind its predecessor; but a single stamp that jumps far ahead goes alone instead of taking all
/// rows after it along. (A longest strictly increasing subsequence, the earliest one; `O(n log n)`.)
pub(crate) fn rows_to_keep(time_s: &[f64]) -> Option<Vec<bool>> {
    if time_s.windows(2).all(|pair| pair[1] > pair[0]) {
        return None;
    }
    // From the back: `reach[i]` rows can be kept from row i on; `latest[k]` is the latest start of k + 1 rows.
    let mut latest: Vec<f64> = Vec::new();
    let mut reach = vec![0; time_s.len()];
    for (row, &time) in time_s.iter().enumerate().rev() {
        let length = latest.partition_point(|&start| start > time);
        if length == latest.len() {
            latest.push(time);
        } else {
            latest[length] = time;
        }
        reach[row] = length + 1;
    }
    let mut still_to_keep = latest.len();
    let mut last = f64::NEG_INFINITY;
    let keep = time_s.iter().zip(&reach).map(|(&time, &reach)| {
        let keep = still_to_keep > 0 && reach >= still_to_keep && time > last;
        if keep {
            still_to_keep -= 1;
            last = time;
        }
        keep
    });
    Some(keep.collect())
}

/// The values of the rows that are kept.
pub(crate) fn kept<T: Copy>(values: &[T], keep: &[bool]) -> Vec<T> {
    values.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn repaired(time_s: &[f64]) -> Vec<f64> {
        rows_to_keep(time_s).map_or(time_s.to_vec(), |keep| kept(time_s, &keep))
    }

    #[test]
    fn a_repeated_stamp_and_a_step_back_lose_the_later_row() {
        assert_eq!(rows_to_keep(&[0.0, 1.0, 1.0, 2.0]), Some(vec![true, true, false, true]));
        assert_eq!(rows_to_keep(&[0.0, 1.0, 2.0, 1.5, 3.0]), Some(vec![true, true, true, false, true]));
        assert_eq!(rows_to_keep(&[0.0, 1.0, 2.0]), None);
    }

    #[test]
    fn one_stamp_far_ahead_does_not_take_the_rest_of_the_run_along() {
        assert_eq!(repaired(&[0.0, 1.0, 1e12, 2.0, 3.0]), [0.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn of_two_runs_in_one_file_the_longer_stays_and_of_equal_ones_the_first() {
        assert_eq!(rows_to_keep(&[0.0, 1.0, 0.0, 1.0]), Some(vec![true, true, false, false]));
        assert_eq!(rows_to_keep(&[5.0, 6.0, 0.0, 1.0, 2.0]), Some(vec![false, false, true, true, true]));
    }

    proptest! {
        #[test]
        fn repaired_time_increases_and_no_other_choice_keeps_more(stamps in prop::collection::vec(0_u8..12, 1..11)) {
            let time_s: Vec<f64> = stamps.iter().map(|&stamp| f64::from(stamp)).collect();
            let result = repaired(&time_s);
            prop_assert!(result.windows(2).all(|pair| pair[1] > pair[0]));
            let best = (0_u32..1 << time_s.len())
                .filter(|choice| {
                    let chosen: Vec<f64> = (0..time_s.len()).filter(|i| choice >> i & 1 == 1).map(|i| time_s[i]).collect();
                    chosen.windows(2).all(|pair| pair[1] > pair[0])
                })
                .map(u32::count_ones)
                .max();
            prop_assert_eq!(Some(result.len() as u32), best);
        }
    }
}
