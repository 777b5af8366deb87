//! Borders between the intervals of a motion: merges, splits and refits neighbouring intervals.

use super::motion_segment::{MIN_CELLS, MotionSegment};
use super::smooth_interval::{Cells, SmoothInterval};

/// Placeholder frequency (1/s) for a union of intervals without frequencies: too low to change the fit.
const NO_FREQUENCY_HINT: f64 = 1e-3;
/// Distance (cells) by which a border may move to the intersection of both segments.
const JUMP_REACH_CELLS: usize = 25;

/// Merges neighbours that a single segment fits at lower cost: a fast ripple is first detected as a chain of jumps.
pub(super) fn merge_neighbours(cells: &Cells, mut intervals: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    loop {
        let before = intervals.len();
        let mut out: Vec<SmoothInterval> = Vec::new();
        for next in intervals {
            if let Some(last) = out.last_mut() {
                let hints = [last.frequencies(), next.frequencies()].concat();
                let hints = if hints.is_empty() { vec![NO_FREQUENCY_HINT] } else { hints };
                let both = SmoothInterval::new(cells, (last.from, next.to), &hints);
                if both.segment.is_some() && both.cost < last.cost + next.cost {
                    *last = both;
                    continue;
                }
            }
            out.push(next);
        }
        if out.len() == before {
            return out;
        }
        intervals = out;
    }
}

/// Splits an interval without a segment at the end of its longest beginning that has one: a small velocity jump is not significant in a
/// short window.
pub(super) fn split_unfitted(cells: &Cells, intervals: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    let mut out = Vec::new();
    let mut todo: Vec<SmoothInterval> = intervals.into_iter().rev().collect();
    while let Some(interval) = todo.pop() {
        let (from, to) = (interval.from, interval.to);
        let (mut good, mut bad) = (from + 2 * MIN_CELLS, to);
        let part = |end: usize| SmoothInterval::new(cells, (from, end), &[]);
        if interval.segment.is_some() || good + 2 * MIN_CELLS > to || part(good).segment.is_none() {
            out.push(interval);
            continue;
        }
        while bad - good > 2 {
            let middle = usize::midpoint(good, bad);
            if part(middle).segment.is_some() { good = middle } else { bad = middle }
        }
        // A segment can bend beyond its true end before the misfit is significant, so the border is searched again.
        let until = |beyond: usize| (good + beyond).min(to);
        let within = (from + MIN_CELLS, good.min(to - MIN_CELLS));
        let end = [2 * JUMP_REACH_CELLS, 2 * MIN_CELLS]
            .iter()
            .find_map(|beyond| best_border(cells, (from, until(*beyond)), within));
        let Some(good) = end.or(Some(good)).filter(|g| g + MIN_CELLS <= to) else {
            out.push(interval);
            continue;
        };
        out.push(part(good));
        todo.push(SmoothInterval::new(cells, (good, to), &[]));
    }
    out
}

/// Border between `low` and `high` with the lowest total cost of both sides; `None` if no border gives two segments.
fn best_border(cells: &Cells, (from, to): (usize, usize), (low, high): (usize, usize)) -> Option<usize> {
    let cost = |at: usize| {
        SmoothInterval::new(cells, (from, at), &[]).cost + SmoothInterval::new(cells, (at, to), &[]).cost
    };
    let (mut begin, mut end) = (low, high);
    let mut best = (f64::INFINITY, high);
    let mut apart = ((high - low) / MIN_CELLS).max(1);
    loop {
        for at in (begin..=end).step_by(apart) {
            let candidate_cost = cost(at);
            if candidate_cost < best.0 {
                best = (candidate_cost, at);
            }
        }
        if apart == 1 {
            return best.0.is_finite().then_some(best.1);
        }
        (begin, end) = (best.1.saturating_sub(apart).max(low), (best.1 + apart).min(high));
        apart = (apart / 4).max(1);
    }
}

/// Moves borders next to curved or missing segments to the lowest total cost: a border that is a few tenths of a second off assigns the end
/// of one segment to the other.
pub(super) fn refit_borders(cells: &Cells, mut intervals: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    for k in 1..intervals.len() {
        let (left, right) = (&intervals[k - 1], &intervals[k]);
        if [left, right].iter().all(|s| s.segment.as_ref().is_some_and(MotionSegment::is_constant_velocity)) {
            continue;
        }
        let edge = right.from;
        let around = (
            left.from.max(edge.saturating_sub(2 * JUMP_REACH_CELLS)),
            right.to.min(edge + 2 * JUMP_REACH_CELLS),
        );
        let within =
            (around.0.max(edge.saturating_sub(JUMP_REACH_CELLS)), around.1.min(edge + JUMP_REACH_CELLS));
        let Some(at) = best_border(cells, around, within) else { continue };
        let one = SmoothInterval::new(cells, (left.from, at), &left.frequencies());
        let two = SmoothInterval::new(cells, (at, right.to), &right.frequencies());
        if one.cost + two.cost < left.cost + right.cost {
            intervals[k - 1] = one;
            intervals[k] = two;
        }
    }
    intervals
}

/// Moves borders to the intersections of neighbouring segments.
pub(super) fn move_borders_to_intersections(
    cells: &Cells,
    mut intervals: Vec<SmoothInterval>,
) -> Vec<SmoothInterval> {
    for _ in 0..2 {
        for k in 1..intervals.len() {
            let (left, right) = (&intervals[k - 1], &intervals[k]);
            let Some(at) = intersection_time(left, right, cells) else { continue };
            let edge = cells.t.partition_point(|t| *t < at);
            let apart = edge.abs_diff(right.from);
            if apart == 0 || edge < left.from + MIN_CELLS || edge + MIN_CELLS > right.to {
                continue;
            }
            let one = SmoothInterval::new(cells, (left.from, edge), &left.frequencies());
            let two = SmoothInterval::new(cells, (edge, right.to), &right.frequencies());
            if one.segment.is_some() && two.segment.is_some() {
                intervals[k - 1] = one;
                intervals[k] = two;
            }
        }
    }
    intervals
}

/// Time (s) near their border at which two segments intersect. A ripple can cross a line repeatedly; the intersection with the smallest
/// misfit of the surrounding cells is chosen.
pub(super) fn intersection_time(left: &SmoothInterval, right: &SmoothInterval, cells: &Cells) -> Option<f64> {
    let (Some(a), Some(b)) = (&left.segment, &right.segment) else { return None };
    let near = cells.t[right.from] - 0.5 * cells.dt;
    let reach = JUMP_REACH_CELLS as f64 * cells.dt;
    let apart = |t: f64| a.at(t).0 - b.at(t).0;
    let newton = |from: f64| {
        let mut at = from;
        for _ in 0..12 {
            let slope = a.at(at).1 - b.at(at).1;
            if slope.abs() > 1e-7 {
                at = (at - apart(at) / slope).clamp(near - reach, near + reach);
            }
        }
        at
    };
    let grid = || (0..=2 * JUMP_REACH_CELLS).map(|k| near - reach + k as f64 * cells.dt);
    let crosses = |(s, t): (f64, f64)| apart(s) * apart(t) < 0.0;
    let crossings = grid().zip(grid().skip(1)).filter(|p| crosses(*p)).map(|(s, t)| newton(0.5 * (s + t)));
    let (lo, hi) = (
        right.from.saturating_sub(JUMP_REACH_CELLS).max(left.from),
        (right.from + JUMP_REACH_CELLS).min(right.to),
    );
    let misfit = |at: f64| {
        let off = |k: usize| cells.z[k] - if cells.t[k] < at { a } else { b }.at(cells.t[k]).0;
        (lo..hi).map(|k| off(k).powi(2)).sum::<f64>()
    };
    let candidate_cost = crossings.chain([newton(near)]).map(|at| (misfit(at), at));
    candidate_cost.min_by(|x, y| x.0.total_cmp(&y.0)).map(|t| t.1)
}
