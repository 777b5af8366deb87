//! Order of the time stamps: check and repair; dropped rows are always reported.

use crate::error::RecordError;
use crate::quality::{QualityKind, QualityNote, repaired_rows};
use crate::text::source::SourceFile;

/// Least length of a gap in median intervals.
pub(crate) const GAP_INTERVALS: f64 = 5.0;
/// Consecutive integers from which a time column counts as a sample number.
pub(crate) const MIN_SAMPLE_NUMBERS: usize = 100;
/// Share of the rows that a repair may drop.
pub(crate) const MAX_DROPPED_SHARE: f64 = 0.01;
/// Share of rows with a repeated time stamp above which the samples arrive in bursts and their stamps are spread.
const BURST_SHARE: f64 = 0.01;
/// Time to the next burst, in medians, above which there is a gap and the median is used instead.
const GAP_BURSTS: f64 = 3.0;
/// Rows after a step back from which they count as a second recording.
const MIN_SECOND_RUN: usize = 50;
/// Step back, as a share of the time before it, from which a second recording begins.
const SECOND_RUN_SHARE: f64 = 0.1;

/// Error of the first time stamp that does not increase.
///
/// # Errors
/// [`RecordError::SecondRun`], [`RecordError::Bursts`], [`RecordError::BackwardTime`] or [`RecordError::RepeatedTime`].
pub(crate) fn check(file: &SourceFile<'_>, time_s: &[f64], offsets: &[usize]) -> Result<(), RecordError> {
    let Some(row) = time_s.windows(2).position(|pair| pair[1] <= pair[0]).map(|before| before + 1) else {
        return Ok(());
    };
    if let Some(error) = second_run(file, time_s, offsets)? {
        return Err(error);
    }
    let lines = |at: usize| file.line_of_row(offsets.get(at).copied().unwrap_or(file.header));
    let (path, line, previous_line) = (file.path(), lines(row)?, lines(row - 1)?);
    if is_in_bursts(time_s) {
        return Err(RecordError::Bursts { path, line, rows: time_s.len(), stamps: distinct(time_s) });
    }
    if time_s[row] == time_s[row - 1] {
        return Err(RecordError::RepeatedTime { path, line, time_s: time_s[row], previous_line });
    }
    Err(RecordError::BackwardTime {
        path,
        line,
        time_s: time_s[row],
        previous_s: time_s[row - 1],
        previous_line,
    })
}

/// Whether more than [`BURST_SHARE`] of the rows repeat the stamp before them.
pub(crate) fn is_in_bursts(time_s: &[f64]) -> bool {
    let repeated = time_s.windows(2).filter(|pair| pair[1] == pair[0]).count();
    repeated as f64 > BURST_SHARE * time_s.len() as f64
}

fn distinct(time_s: &[f64]) -> usize {
    time_s.windows(2).filter(|pair| pair[1] != pair[0]).count() + usize::from(!time_s.is_empty())
}

/// The row where a second recording begins.
pub(crate) fn second_run_row(time_s: &[f64]) -> Option<usize> {
    let (mut latest, first) = (f64::NEG_INFINITY, time_s.first().copied()?);
    for (row, time) in time_s.iter().enumerate() {
        if latest - time > SECOND_RUN_SHARE * (latest - first) && row > 0 {
            // A single stamp far ahead does not count: the rows after the step must be earlier than many rows before it.
            let overtaken = time_s[..row].iter().rev().take(MIN_SECOND_RUN).filter(|t| *t > time).count();
            let follow = &time_s[row..];
            let below = follow.iter().take(MIN_SECOND_RUN).filter(|t| **t < latest).count();
            if overtaken.min(below) >= MIN_SECOND_RUN.min(row) && follow.len() >= MIN_SECOND_RUN {
                return Some(row);
            }
        }
        latest = latest.max(*time);
    }
    None
}

fn second_run(
    file: &SourceFile<'_>,
    time_s: &[f64],
    offsets: &[usize],
) -> Result<Option<RecordError>, RecordError> {
    let Some(row) = second_run_row(time_s) else { return Ok(None) };
    let line = file.line_of_row(offsets.get(row).copied().unwrap_or(file.header))?;
    Ok(Some(RecordError::SecondRun {
        path: file.path(),
        line,
        time_s: time_s[row],
        previous_s: time_s[row - 1],
    }))
}

/// Changes made by a repair.
#[derive(Debug, Default)]
pub(crate) struct Repaired {
    /// New time stamps of all rows.
    pub time_s: Option<Vec<f64>>,
    /// Rows that are kept.
    pub keep: Option<Vec<bool>>,
    pub notes: Vec<QualityNote>,
}

/// Repairs time stamps: those in bursts are spread evenly, then the fewest rows are dropped that leave time increasing.
///
/// # Errors
/// [`RecordError::SecondRun`]; [`RecordError::RepairTooMuch`] when more than [`MAX_DROPPED_SHARE`] would be dropped.
pub(crate) fn repair(
    file: &SourceFile<'_>,
    time_s: &[f64],
    offsets: &[usize],
) -> Result<Repaired, RecordError> {
    let mut repaired = Repaired::default();
    if let Some(error) = second_run(file, time_s, offsets)? {
        return Err(error);
    }
    if is_in_bursts(time_s) {
        let spread = spread_bursts(time_s);
        let (rows, stamps) = (time_s.len(), distinct(time_s));
        let message = format!(
            "the {rows} samples arrive in {stamps} bursts with one time stamp each: they are spread evenly up to the next burst, and none is dropped"
        );
        let numbers = [("samples", rows as f64), ("bursts", stamps as f64)];
        repaired.notes.push(QualityNote::new(QualityKind::Retimed, message, numbers));
        repaired.time_s = Some(spread);
    }
    let now = repaired.time_s.as_deref().unwrap_or(time_s);
    if let Some(keep) = rows_to_keep(now) {
        let dropped: Vec<bool> = keep.iter().map(|keep| !keep).collect();
        let offsets = retain_rows(offsets, &dropped);
        check_dropped(file, &offsets, keep.len())?;
        let lines = file.lines_of_offsets(offsets.into_iter())?;
        let kept = keep.len() - lines.len();
        repaired.notes.insert(0, repaired_rows(lines, kept));
        repaired.keep = Some(keep);
    }
    Ok(repaired)
}

/// Rejects dropping more than [`MAX_DROPPED_SHARE`] of the rows; `offsets` are those of the dropped ones.
pub(crate) fn check_dropped(
    file: &SourceFile<'_>,
    offsets: &[usize],
    rows: usize,
) -> Result<(), RecordError> {
    if offsets.len() as f64 <= MAX_DROPPED_SHARE * rows as f64 {
        return Ok(());
    }
    let line = file.line_of_row(offsets.first().copied().unwrap_or(file.header))?;
    Err(RecordError::RepairTooMuch { path: file.path(), line, dropped: offsets.len(), rows })
}

/// The time stamps with equal ones spread evenly up to the next one; at a gap and at the end, over the median burst.
fn spread_bursts(time_s: &[f64]) -> Vec<f64> {
    let mut bursts: Vec<(usize, usize)> = Vec::new();
    for (row, time) in time_s.iter().enumerate() {
        match bursts.last_mut() {
            Some((first, count)) if time_s[*first] == *time => *count += 1,
            _ => bursts.push((row, 1)),
        }
    }
    // Time per sample of each burst but the last.
    let steps = bursts.windows(2).map(|pair| (time_s[pair[1].0] - time_s[pair[0].0]) / pair[0].1 as f64);
    let typical = stylet_stats::median_of(steps.filter(|step| *step > 0.0));
    if typical.is_nan() {
        return time_s.to_vec();
    }
    let mut out = Vec::with_capacity(time_s.len());
    for (at, (first, count)) in bursts.iter().enumerate() {
        let next = bursts.get(at + 1).map(|(next, _)| (time_s[*next] - time_s[*first]) / *count as f64);
        let step = match next {
            Some(step) if step > 0.0 && step <= GAP_BURSTS * typical => step,
            _ => next.filter(|step| *step > 0.0).map_or(typical, |step| step.min(typical)),
        };
        out.extend((0..*count).map(|k| time_s[*first] + step * k as f64));
    }
    out
}

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

    #[test]
    fn bursts_are_spread_evenly_and_a_gap_stays() {
        let stamps = [0.0, 0.0, 0.02, 0.02, 0.04, 0.04, 1.0, 1.0];
        assert!(is_in_bursts(&stamps));
        let spread = spread_bursts(&stamps);
        let expected = [0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 1.0, 1.01];
        assert!(spread.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{spread:?}");
    }

    #[test]
    fn a_second_run_is_found_where_it_begins_and_one_bad_stamp_is_none() {
        let run: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let two: Vec<f64> = run.iter().chain(&run).copied().collect();
        assert_eq!(second_run_row(&two), Some(200));
        let mut glitch = run.clone();
        glitch[100] = 1e6;
        assert_eq!(second_run_row(&glitch), None);
        glitch[100] = 0.2;
        assert_eq!(second_run_row(&glitch), None);
        assert_eq!(second_run_row(&run), None);
    }

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
