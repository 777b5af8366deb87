//! Repair of time stamps that do not increase: which rows to drop.

/// Rows to keep so that time strictly increases and the fewest rows are dropped; `None` when time increases already.
///
/// Of several smallest sets the later rows are dropped: the second of two equal time stamps, and a row that falls back behind
/// its predecessor; but a single stamp that jumps far ahead is dropped alone. (The earliest longest strictly increasing
/// subsequence, in `O(n log n)`.)
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

/// Rows to drop, in ascending order: those that [`rows_to_keep`] would not keep, for any number of rows.
///
/// `pass` calls its argument with all time stamps, block by block, and is called twice. Memory holds one block and the
/// longest disorder, from a row that is later than a following one to the row where all are later than all before.
///
/// # Errors
/// The error of `pass`. `Err` within: the first row of a disorder of more than `most` rows.
pub(crate) fn rows_to_drop<E>(
    pass: impl Fn(&mut dyn FnMut(&[f64])) -> Result<(), E>,
    most: usize,
) -> Result<Result<Vec<usize>, usize>, E> {
    // The earliest time of each block, then of each block and all behind it.
    let (mut earliest, mut last, mut in_order) = (Vec::new(), f64::NEG_INFINITY, true);
    pass(&mut |block| {
        for &time in block {
            in_order &= time > last;
            last = time;
        }
        earliest.push(block.iter().copied().fold(f64::INFINITY, f64::min));
    })?;
    if in_order {
        return Ok(Ok(Vec::new()));
    }
    for at in (1..earliest.len()).rev() {
        earliest[at - 1] = earliest[at].min(earliest[at - 1]);
    }
    let (mut dropped, mut disorder, mut begins) = (Vec::new(), Vec::new(), 0);
    let (mut row, mut block_number, mut latest, mut too_long) = (0, 0, f64::NEG_INFINITY, None);
    let mut end_of_disorder = |disorder: &mut Vec<f64>, begins: usize| {
        let keep = rows_to_keep(disorder).into_iter().flatten();
        dropped.extend(keep.enumerate().filter(|(_, keep)| !keep).map(|(at, _)| begins + at));
        disorder.clear();
    };
    let mut still_to_come = Vec::new();
    pass(&mut |block| {
        block_number += 1;
        // The earliest time from each row on.
        let mut least = earliest.get(block_number).copied().unwrap_or(f64::INFINITY);
        still_to_come.clear();
        still_to_come.extend(block.iter().rev().map(|time| {
            least = least.min(*time);
            least
        }));
        for (&time, &least) in block.iter().zip(still_to_come.iter().rev()) {
            if latest < least {
                end_of_disorder(&mut disorder, begins);
                begins = row;
            }
            latest = latest.max(time);
            row += 1;
            if disorder.len() < most {
                disorder.push(time);
            } else {
                too_long.get_or_insert(begins);
            }
        }
    })?;
    end_of_disorder(&mut disorder, begins);
    Ok(too_long.map_or(Ok(dropped), Err))
}

/// The values of the rows to keep.
pub(crate) fn retain_rows<T: Copy>(values: &[T], keep: &[bool]) -> Vec<T> {
    values.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn repaired(time_s: &[f64]) -> Vec<f64> {
        rows_to_keep(time_s).map_or(time_s.to_vec(), |keep| retain_rows(time_s, &keep))
    }

    #[test]
    fn of_a_repeated_stamp_or_a_step_back_the_later_row_is_dropped() {
        assert_eq!(rows_to_keep(&[0.0, 1.0, 1.0, 2.0]), Some(vec![true, true, false, true]));
        assert_eq!(rows_to_keep(&[0.0, 1.0, 2.0, 1.5, 3.0]), Some(vec![true, true, true, false, true]));
        assert_eq!(rows_to_keep(&[0.0, 1.0, 2.0]), None);
    }

    #[test]
    fn one_stamp_far_ahead_is_dropped_alone() {
        assert_eq!(repaired(&[0.0, 1.0, 1e12, 2.0, 3.0]), [0.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn of_two_recordings_in_one_file_the_longer_stays_and_of_equal_ones_the_first() {
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

        #[test]
        fn the_blockwise_repair_drops_the_same_rows(
            steps in prop::collection::vec(-3_i8..6, 1..60),
            block in 1_usize..20,
        ) {
            let time_s: Vec<f64> = steps
                .iter()
                .scan(0.0, |time, step| {
                    *time += f64::from(*step);
                    Some(*time)
                })
                .collect();
            let pass = |take: &mut dyn FnMut(&[f64])| -> Result<(), std::convert::Infallible> {
                time_s.chunks(block).for_each(take);
                Ok(())
            };
            let Ok(dropped) = rows_to_drop(pass, 1000);
            let keep = rows_to_keep(&time_s).unwrap_or(vec![true; time_s.len()]);
            let expected: Vec<usize> = (0..keep.len()).filter(|row| !keep[*row]).collect();
            prop_assert_eq!(dropped, Ok(expected));
        }
    }
}
