//! Position and velocity from noisy or coarsely quantised positions.
//!
//! Samples are averaged in cells of about 20 ms. Velocity jumps are where parabolas on both sides of a gap
//! between cells meet with clearly different slopes. The interval between two jumps is a parametric
//! `motion_segment` when that leaves white residuals. Otherwise every cell takes the widest window whose local
//! parabola agrees with all narrower ones (intersection of confidence intervals: Goldenshluger and Nemirovski
//! 1997).

use super::acceleration_ramp::AccelerationRamp;
use super::motion_segment::{MIN_CELLS, MotionSegment, cheaper};
use super::velocity_estimate::{
    SlopeBreak, VelocityJump, encoder_step, fit_parabola, position_noise, slope_breaks,
};
use stylet_stats::order_statistics::median;

/// Length of a cell in s.
const CELL_S: f64 = 0.02;
/// Cells on each side in the search for a jump.
const JUMP_SIDE_CELLS: usize = 15;
/// Half windows in cells.
const HALF_WINDOWS: [usize; 8] = [3, 5, 8, 12, 18, 27, 40, 60];
/// Half width of the confidence intervals in standard deviations.
const INTERVAL_SDS: f64 = 2.2;
/// A segment must not leave more than this multiple of the position noise.
const MAX_NOISE_RATIO: f64 = 2.0;
/// Placeholder frequency (1/s) for the union of intervals without any: too low to matter.
const NO_FREQUENCY_HINT: f64 = 1e-3;
/// Cells within which a jump is moved to the intersection of both sides.
const JUMP_REACH_CELLS: usize = 25;
/// Cells excluded at either end of a constant-velocity interval: a drive needs up to half a second for a
/// velocity change.
const RAMP_CELLS: [usize; 4] = [1, 3, 6, 12];
/// Cost of a ramp in nats per cell: most drives reach their velocity within a few cells.
const RAMP_NATS_PER_CELL: f64 = 0.5;

/// Smoothed motion at the sample times.
#[derive(Clone, Debug, Default)]
pub struct SmoothedMotion {
    /// Position in m.
    pub position_m: Vec<f64>,
    /// Velocity in m/s.
    pub velocity_mps: Vec<f64>,
    /// Velocity jumps.
    pub jumps: Vec<VelocityJump>,
    /// Typical standard deviation of the velocity in m/s.
    pub sd_mps: f64,
}

/// Smooths positions `z` (m) at times `t` (s).
#[must_use]
pub fn smooth_positions(t: &[f64], z: &[f64]) -> SmoothedMotion {
    let n = t.len().min(z.len());
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let step = median(&mut steps).max(1e-9);
    let q = ((CELL_S / step).round() as usize).max(1);
    let mean =
        |x: &[f64]| -> Vec<f64> { x.chunks(q).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect() };
    let (tc, zc) = (mean(&t[..n]), mean(&z[..n]));
    let cells = tc.len();
    if cells < 2 * JUMP_SIDE_CELLS + 2 {
        let v = stylet_record::differentiate(t, z, 0.1);
        return SmoothedMotion {
            position_m: z.to_vec(),
            velocity_mps: v,
            jumps: Vec::new(),
            sd_mps: f64::INFINITY,
        };
    }
    let step_m = encoder_step(z);
    let noise_m = position_noise(t, z) / (q as f64).sqrt();
    let dt = step * q as f64;
    // Slope at the end of a parabola over `side` cells: sd = noise sqrt(192/side^3)/dt; six of the difference
    // of two.
    let doubt = 6.0 * 2.0_f64.sqrt() * 13.9 * noise_m / (dt * (JUMP_SIDE_CELLS as f64).powf(1.5));
    let found = slope_breaks(&tc, &zc, JUMP_SIDE_CELLS, (1.8 * dt, 1.8 * dt), doubt);
    let mut edges: Vec<usize> = found.iter().map(|b| b.0).collect();
    edges.extend([0, cells]);
    edges.sort_unstable();
    edges.dedup();
    let rounded_m = step_m / core::f64::consts::PI;
    let cells = Cells { t: &tc, z: &zc, dt, noise_m, rounded_m };
    let first = edges.windows(2).map(|e| SmoothInterval::new(&cells, (e[0], e[1]), &[])).collect();
    let stretches = merge_neighbours(&cells, split_unfitted(&cells, merge_neighbours(&cells, first)));
    let stretches = move_borders_to_intersections(&cells, refit_borders(&cells, stretches));
    let kinks: Vec<VelocityJump> =
        stretches.windows(2).map(|p| jump_between(&p[0], &p[1], &found, &cells, t)).collect();
    let ramps: Vec<Option<AccelerationRamp>> = stretches
        .windows(2)
        .zip(&kinks)
        .map(|(p, k)| AccelerationRamp::between(&p[0], &p[1], k, &cells))
        .collect();
    let mut course = 0;
    let (z, v): (Vec<f64>, Vec<f64>) = (0..n)
        .map(|i| {
            while kinks.get(course).is_some_and(|k| k.time_s <= t[i]) {
                course += 1;
            }
            let beside = ramps[course.saturating_sub(1)..(course + 1).min(ramps.len())].iter().flatten();
            let ramp = beside.filter_map(|r| r.at(t[i])).next();
            ramp.unwrap_or_else(|| stretches[course.min(stretches.len() - 1)].at(&tc, t[i]))
        })
        .unzip();
    let kinks = kinks.into_iter().zip(&ramps).filter(|(_, r)| r.is_none()).map(|(k, _)| k).collect();
    let mut sds: Vec<f64> = stretches.iter().flat_map(|s| s.sds.iter().copied()).collect();
    SmoothedMotion { position_m: z, velocity_mps: v, jumps: kinks, sd_mps: median(&mut sds).max(1e-9) }
}

/// Cell means: middle (s), position (m), length (s), standard deviation of the noise (m), amplitude of the
/// first harmonic of the quantisation at constant velocity (m).
#[derive(Clone, Copy)]
pub(super) struct Cells<'a> {
    pub t: &'a [f64],
    pub z: &'a [f64],
    pub dt: f64,
    pub noise_m: f64,
    rounded_m: f64,
}

/// Motion between two velocity jumps.
pub(super) struct SmoothInterval {
    pub from: usize,
    pub to: usize,
    /// A parametric segment with white residuals.
    pub segment: Option<MotionSegment>,
    /// Otherwise position and velocity per cell.
    local: Vec<(f64, f64)>,
    /// Standard deviation of the velocity in m/s per cell.
    sds: Vec<f64>,
    /// Nats of residuals and parameters; infinite without a segment.
    cost: f64,
}

impl SmoothInterval {
    fn new(cells: &Cells, (from, to): (usize, usize), hints: &[f64]) -> Self {
        let Cells { t: tc, z: zc, dt, noise_m, rounded_m } = *cells;
        // Cells next to a jump have both velocities.
        let (lo, hi) = trimmed((from, to), 1, tc.len());
        let course = if hi > lo + MIN_CELLS {
            MotionSegment::fit_best(&tc[lo..hi], &zc[lo..hi], dt, hints, rounded_m)
        } else {
            None
        };
        let course = course.filter(|c| c.white && c.sd_m < MAX_NOISE_RATIO * noise_m);
        let course = match course {
            Some(c) if c.is_constant_velocity() => Some(c),
            other => cheaper_of(other, Self::even(cells, (from, to))),
        };
        if let Some(course) = course {
            let cells = (hi - lo) as f64;
            // Slope of a line, doubled for a curved segment.
            let slope = 2.0 * course.sd_m * (12.0 / cells).sqrt() / (cells * dt);
            let sd = if course.is_at_rest() { 0.0 } else { slope };
            let cost = course.cost;
            return Self {
                from,
                to,
                segment: Some(course),
                local: Vec::new(),
                sds: vec![sd; to - from],
                cost,
            };
        }
        let (mut local, mut sds) = (Vec::new(), Vec::new());
        for i in from..to {
            let (z, v, sd) = adaptive_window_fit(tc, zc, i, (from, to), noise_m);
            local.push((z, v));
            sds.push(sd);
        }
        Self { from, to, segment: None, local, sds, cost: f64::INFINITY }
    }

    /// A rest or a line between two velocity ramps of at most a third of the interval.
    fn even(cells: &Cells, (from, to): (usize, usize)) -> Option<MotionSegment> {
        let mut best = None;
        for cut in RAMP_CELLS {
            let (lo, hi) = trimmed((from, to), cut, cells.t.len());
            if hi <= lo + MIN_CELLS || 3 * (hi - lo) < 2 * (to - from) {
                break;
            }
            let course = MotionSegment::fit_constant_velocity(&cells.t[lo..hi], &cells.z[lo..hi], cells.dt);
            let mut course = course.filter(|c| c.white && c.sd_m < MAX_NOISE_RATIO * cells.noise_m);
            if let Some(c) = course.as_mut() {
                // The ramps are described as well as the rest, with one more parameter, and are less likely the
                // longer they are.
                let (all, n) = ((to - from) as f64, (hi - lo) as f64);
                c.cost += (all - n) * libm::log(c.sd_m);
                if cut > 1 {
                    c.cost += libm::log(all) + RAMP_NATS_PER_CELL * (cut - 1) as f64;
                }
            }
            best = cheaper_of(best, course);
        }
        best
    }

    /// Angular frequencies of the segment in 1/s.
    fn frequencies(&self) -> Vec<f64> {
        self.segment.iter().flat_map(MotionSegment::frequencies).collect()
    }

    /// Position and velocity at a time within.
    fn at(&self, tc: &[f64], t: f64) -> (f64, f64) {
        if let Some(course) = &self.segment {
            return course.at(t);
        }
        let after = tc[self.from..self.to].partition_point(|c| *c < t);
        let (z1, v1) = self.local[after.min(self.local.len() - 1)];
        let t1 = tc[self.from + after.min(self.local.len() - 1)];
        if after == 0 || after == self.local.len() {
            return (z1 + v1 * (t - t1), v1);
        }
        let (z0, v0) = self.local[after - 1];
        let t0 = tc[self.from + after - 1];
        let share = (t - t0) / (t1 - t0);
        (z0 + share * (z1 - z0), v0 + share * (v1 - v0))
    }
}

/// An interval without `cut` cells at borders inside the recording.
fn trimmed((from, to): (usize, usize), cut: usize, cells: usize) -> (usize, usize) {
    (if from > 0 { from + cut } else { 0 }, if to < cells { to.saturating_sub(cut) } else { to })
}

/// The cheaper of the available segments.
fn cheaper_of(a: Option<MotionSegment>, b: Option<MotionSegment>) -> Option<MotionSegment> {
    match a {
        Some(a) => Some(cheaper(a, b)),
        None => b,
    }
}

/// Merges neighbours that are one segment together: a fast ripple looks like a chain of jumps.
fn merge_neighbours(cells: &Cells, mut stretches: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    loop {
        let before = stretches.len();
        let mut out: Vec<SmoothInterval> = Vec::new();
        for next in stretches {
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
        stretches = out;
    }
}

/// Splits an interval without a segment where its beginning ceases to be one: a small velocity jump is not
/// visible in a short window.
fn split_unfitted(cells: &Cells, stretches: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    let mut out = Vec::new();
    let mut todo: Vec<SmoothInterval> = stretches.into_iter().rev().collect();
    while let Some(stretch) = todo.pop() {
        let (from, to) = (stretch.from, stretch.to);
        let (mut good, mut bad) = (from + 2 * MIN_CELLS, to);
        let part = |end: usize| SmoothInterval::new(cells, (from, end), &[]);
        if stretch.segment.is_some() || good + 2 * MIN_CELLS > to || part(good).segment.is_none() {
            out.push(stretch);
            continue;
        }
        while bad - good > 2 {
            let middle = usize::midpoint(good, bad);
            if part(middle).segment.is_some() { good = middle } else { bad = middle }
        }
        // A segment extends beyond its true end before noise shows the misfit, and bends on the way.
        let until = |beyond: usize| (good + beyond).min(to);
        let within = (from + MIN_CELLS, good.min(to - MIN_CELLS));
        let end = [2 * JUMP_REACH_CELLS, 2 * MIN_CELLS]
            .iter()
            .find_map(|beyond| best_border(cells, (from, until(*beyond)), within));
        let Some(good) = end.or(Some(good)).filter(|g| g + MIN_CELLS <= to) else {
            out.push(stretch);
            continue;
        };
        out.push(part(good));
        todo.push(SmoothInterval::new(cells, (good, to), &[]));
    }
    out
}

/// The border between `low` and `high` with the lowest total cost on both sides; `None` where they are never
/// two segments.
fn best_border(cells: &Cells, (from, to): (usize, usize), (low, high): (usize, usize)) -> Option<usize> {
    let cost = |at: usize| {
        SmoothInterval::new(cells, (from, at), &[]).cost + SmoothInterval::new(cells, (at, to), &[]).cost
    };
    let (mut begin, mut end) = (low, high);
    let mut best = (f64::INFINITY, high);
    let mut apart = ((high - low) / MIN_CELLS).max(1);
    loop {
        for at in (begin..=end).step_by(apart) {
            let told = cost(at);
            if told < best.0 {
                best = (told, at);
            }
        }
        if apart == 1 {
            return best.0.is_finite().then_some(best.1);
        }
        (begin, end) = (best.1.saturating_sub(apart).max(low), (best.1 + apart).min(high));
        apart = (apart / 4).max(1);
    }
}

/// Moves borders next to curved or missing segments to the lowest total cost: a jump found a few tenths of a
/// second early or late leaves an end of one segment in the other.
fn refit_borders(cells: &Cells, mut stretches: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    for k in 1..stretches.len() {
        let (left, right) = (&stretches[k - 1], &stretches[k]);
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
            stretches[k - 1] = one;
            stretches[k] = two;
        }
    }
    stretches
}

/// Moves borders to the intersections of both segments.
fn move_borders_to_intersections(cells: &Cells, mut stretches: Vec<SmoothInterval>) -> Vec<SmoothInterval> {
    for _ in 0..2 {
        for k in 1..stretches.len() {
            let (left, right) = (&stretches[k - 1], &stretches[k]);
            let Some(at) = intersection_time(left, right, cells) else { continue };
            let edge = cells.t.partition_point(|t| *t < at);
            let apart = edge.abs_diff(right.from);
            if apart == 0 || edge < left.from + MIN_CELLS || edge + MIN_CELLS > right.to {
                continue;
            }
            let one = SmoothInterval::new(cells, (left.from, edge), &left.frequencies());
            let two = SmoothInterval::new(cells, (edge, right.to), &right.frequencies());
            if one.segment.is_some() && two.segment.is_some() {
                stretches[k - 1] = one;
                stretches[k] = two;
            }
        }
    }
    stretches
}

/// Time near their border at which two segments intersect; of several intersections (a ripple crosses a line
/// repeatedly) the one with the smallest misfit of the surrounding cells.
fn intersection_time(left: &SmoothInterval, right: &SmoothInterval, cells: &Cells) -> Option<f64> {
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
    let told = crossings.chain([newton(near)]).map(|at| (misfit(at), at));
    told.min_by(|x, y| x.0.total_cmp(&y.0)).map(|t| t.1)
}

/// The velocity jump between two intervals.
fn jump_between(
    left: &SmoothInterval,
    right: &SmoothInterval,
    found: &[SlopeBreak],
    cells: &Cells,
    t: &[f64],
) -> VelocityJump {
    let kink = |at: f64, z: f64, v: [f64; 2], sd_m: f64| {
        let sample = t.partition_point(|t| *t < at).clamp(1, t.len() - 1);
        VelocityJump { next_sample: sample, time_s: at, position_m: z, velocity_mps: v, position_sd_m: sd_m }
    };
    if let (Some(a), Some(b), Some(at)) =
        (&left.segment, &right.segment, intersection_time(left, right, cells))
    {
        // Standard error at the end of a curved segment over that many cells.
        let end = |s: &SmoothInterval, c: &MotionSegment| 3.0 * c.sd_m / ((s.to - s.from) as f64).sqrt();
        let sd_m = end(left, a).hypot(end(right, b));
        return kink(at, 0.5 * (a.at(at).0 + b.at(at).0), [a.at(at).1, b.at(at).1], sd_m);
    }
    match found.iter().find(|b| b.0 == right.from) {
        Some(&(_, (at, z, before), after)) => kink(at, z, [before, after], cells.noise_m),
        None => {
            let at = cells.t[right.from] - 0.5 * cells.dt;
            let (one, two) = (left.at(cells.t, at), right.at(cells.t, at));
            kink(at, 0.5 * (one.0 + two.0), [one.1, two.1], cells.noise_m)
        }
    }
}

/// Position, velocity and its standard deviation at cell `i` from the widest window that agrees with all
/// narrower ones.
fn adaptive_window_fit(
    t: &[f64],
    z: &[f64],
    i: usize,
    (from, to): (usize, usize),
    noise_m: f64,
) -> (f64, f64, f64) {
    let mut best = (z[i], 0.0, f64::INFINITY);
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for half in HALF_WINDOWS {
        let (lo, hi) = (i.saturating_sub(half).max(from), (i + half + 1).min(to));
        let n = hi - lo;
        if n < 4 {
            continue;
        }
        let span = (t[hi - 1] - t[lo]).max(1e-9);
        // Slope of a parabola over n cells: in the middle as for a line, at the end four times as uncertain.
        let off = ((2.0 * t[i] - t[lo] - t[hi - 1]) / span).abs().min(1.0);
        let sd = noise_m * (12.0 / n as f64).sqrt() / span * (1.0 + 15.0 * off * off).sqrt();
        let [value, slope, _] = fit_parabola(&t[lo..hi], &z[lo..hi], t[i]).0;
        low = low.max(slope - INTERVAL_SDS * sd);
        high = high.min(slope + INTERVAL_SDS * sd);
        if low > high {
            break;
        }
        best = (value, slope, sd);
        if lo == from && hi == to {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells every 20 ms with 10 µm of noise.
    struct Given {
        t: Vec<f64>,
        z: Vec<f64>,
    }

    impl Given {
        fn new(n: usize, course: impl Fn(f64) -> f64) -> Self {
            let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
            let z = t.iter().enumerate().map(|(k, t)| course(*t) + 1e-5 * rough(k)).collect();
            Self { t, z }
        }

        fn cells(&self) -> Cells<'_> {
            Cells { t: &self.t, z: &self.z, dt: 0.02, noise_m: 1e-5, rounded_m: 0.0 }
        }

        fn stretches(&self, edges: &[usize]) -> Vec<SmoothInterval> {
            edges.windows(2).map(|e| SmoothInterval::new(&self.cells(), (e[0], e[1]), &[])).collect()
        }
    }

    fn borders(stretches: &[SmoothInterval]) -> Vec<(usize, usize)> {
        stretches.iter().map(|s| (s.from, s.to)).collect()
    }

    /// A line with a bend.
    fn bent(at_s: f64, before: f64, after: f64) -> impl Fn(f64) -> f64 {
        move |t| if t < at_s { before * (t - at_s) } else { after * (t - at_s) }
    }

    /// Samples every 5 ms of positions with noise (m) for a given velocity.
    fn driven(
        speed: impl Fn(f64) -> f64,
        lasts_s: f64,
        noise_m: f64,
        seed: usize,
    ) -> (Vec<f64>, SmoothedMotion) {
        let t: Vec<f64> = (0..(lasts_s / 0.005) as usize).map(|k| 0.005 * k as f64).collect();
        let mut at = 0.0;
        let z: Vec<f64> = t
            .iter()
            .enumerate()
            .map(|(k, t)| {
                let here = at + noise_m * rough(k + 10_000 * seed);
                at += (0..50).map(|j| 1e-4 * speed(t + 1e-4 * (f64::from(j) + 0.5))).sum::<f64>();
                here
            })
            .collect();
        let told = smooth_positions(&t, &z);
        (t, told)
    }

    /// 20 µm of noise hide jumps of 1 mm/s from a window of 0.3 s, and half a second of a sinusoid resembles a
    /// rest with the start of a move.
    #[test]
    fn a_hold_is_recognised_before_slow_motion() {
        for ([before, after], rest_s) in [
            ([5.27e-3, 0.98e-3], 0.95),
            ([5.27e-3, 0.98e-3], 0.6),
            ([2e-3, 0.8e-3], 1.5),
            ([5e-3, -0.7e-3], 1.0),
            ([2e-3, 2e-3], 1.0),
            ([5e-3, 0.98e-3], 2.5),
        ] {
            let speed = |t: f64| match t {
                ..1.5 => before,
                _ if t < 1.5 + rest_s => 0.0,
                _ => after,
            };
            for seed in 0..12 {
                let (t, told) = driven(speed, 8.5 + rest_s, 2e-5, seed);
                let rests = |t: f64| t > 1.55 && t < 1.45 + rest_s;
                let worst = t
                    .iter()
                    .zip(&told.velocity_mps)
                    .filter(|(t, _)| rests(**t))
                    .fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
                assert!(worst < 5e-5, "{before} m/s, {rest_s} s, {after} m/s, seed {seed}: {worst} m/s");
            }
        }
    }

    /// 5 mm/s from 1 s, rest from 6 s, 1 mm/s from 7.5 s, rest from 12 s, back at 3 mm/s from 13 s; every
    /// change has a finite duration.
    #[test]
    fn finite_accelerations_are_recovered() {
        for (ramp_s, noise_m, all_mps) in
            [(0.05, 5e-6, 5e-5), (0.1, 2e-5, 1e-4), (0.2, 2e-5, 1e-4), (0.3, 2e-5, 1e-4)]
        {
            let changes = [(1.0, 5e-3), (6.0, -5e-3), (7.5, 1e-3), (12.0, -1e-3), (13.0, -3e-3)];
            let speed =
                |t: f64| changes.iter().map(|(at, by)| by * ((t - at) / ramp_s).clamp(0.0, 1.0)).sum::<f64>();
            let (mut squares, mut n) = (0.0, 0.0);
            for seed in 0..8 {
                let (t, told) = driven(speed, 18.0, noise_m, seed);
                for (t, v) in t.iter().zip(&told.velocity_mps) {
                    squares += (v - speed(*t)).powi(2);
                    n += 1.0;
                }
            }
            let rms = f64::sqrt(squares / n);
            assert!(rms < all_mps, "{ramp_s} s, {noise_m} m: {rms} m/s");
        }
    }

    #[test]
    fn an_interval_is_fitted_without_cells_next_to_jumps() {
        let mut given = Given::new(100, |t| 0.003 * t);
        // Cells next to jumps have both velocities.
        for k in [20, 79] {
            given.z[k] += 0.01;
        }
        let s = SmoothInterval::new(&given.cells(), (20, 80), &[]);
        let course = s.segment.as_ref().expect("a form");
        assert!((s.at(&given.t, 1.0).1 - 0.003).abs() < 1e-5 && s.local.is_empty());
        assert_eq!(s.cost, course.cost);
        // Slope of a line over 58 cells of 20 ms, doubled.
        let sd = 2.0 * course.sd_m * (12.0 / 58.0_f64).sqrt() / (58.0 * 0.02);
        assert_eq!(s.sds.len(), 60);
        assert!(s.sds.iter().all(|x| (x / sd - 1.0).abs() < 1e-12));
        // At the ends of the recording all cells count.
        given.z[20] -= 0.01;
        given.z[79] -= 0.01;
        for k in [0, 99] {
            given.z[k] += 0.01;
        }
        let form =
            |from: usize, to: usize| SmoothInterval::new(&given.cells(), (from, to), &[]).segment.is_some();
        assert!(form(20, 80) && !form(0, 80) && !form(20, 100));
        // At rest the velocity is known.
        let rest = Given::new(100, |_| 0.07);
        assert_eq!(SmoothInterval::new(&rest.cells(), (0, 100), &[]).sds, [0.0; 100]);
        // Twice the position noise is too large a residual.
        let course = SmoothInterval::new(&rest.cells(), (0, 100), &[]).segment.expect("a form");
        let quieter = |share: f64| Cells { noise_m: course.sd_m * share, ..rest.cells() };
        assert!(SmoothInterval::new(&quieter(0.51), (0, 100), &[]).segment.is_some());
        assert!(SmoothInterval::new(&quieter(0.49), (0, 100), &[]).segment.is_none());
        // Thirteen cells between jumps, next to one, or in all.
        let few =
            |from: usize, to: usize| SmoothInterval::new(&rest.cells(), (from, to), &[]).segment.is_some();
        assert!(few(20, 35) && !few(20, 34));
        let short = Given::new(13, |_| 0.07);
        assert!(SmoothInterval::new(&short.cells(), (0, 13), &[]).segment.is_some());
        let short = Given::new(12, |_| 0.07);
        assert!(SmoothInterval::new(&short.cells(), (0, 12), &[]).segment.is_none());
    }

    #[test]
    fn without_a_segment_motion_is_interpolated_between_cells() {
        let s = SmoothInterval {
            from: 2,
            to: 5,
            segment: None,
            local: vec![(1.0, 3.0), (2.0, 5.0), (6.0, -1.0)],
            sds: vec![1.0; 3],
            cost: f64::INFINITY,
        };
        let t = [0.0, 1.0, 2.0, 3.0, 5.0, 6.0];
        let wanted = [
            (1.5, -0.5, 3.0),
            (2.0, 1.0, 3.0),
            (2.25, 1.25, 3.5),
            (3.0, 2.0, 5.0),
            (4.5, 5.0, 0.5),
            (7.0, 4.0, -1.0),
        ];
        for (at, z, v) in wanted {
            let told = s.at(&t, at);
            assert!((told.0 - z).abs() < 1e-12 && (told.1 - v).abs() < 1e-12, "{told:?} at {at}");
        }
    }

    #[test]
    fn intervals_of_one_segment_are_merged() {
        let line = Given::new(200, |t| 0.003 * t);
        assert_eq!(borders(&merge_neighbours(&line.cells(), line.stretches(&[0, 60, 110, 200]))), [(0, 200)]);
        let bend = Given::new(200, bent(2.2, 0.003, 0.004));
        assert_eq!(
            borders(&merge_neighbours(&bend.cells(), bend.stretches(&[0, 60, 110, 200]))),
            [(0, 110), (110, 200)]
        );
        // Parts of a ripple resemble cubics; together they are a sinusoid.
        let ripple = Given::new(200, |t| 0.003 * t + 4e-4 * (3.0 * t).sin());
        let told = merge_neighbours(&ripple.cells(), ripple.stretches(&[0, 35, 70, 105, 200]));
        assert_eq!(borders(&told), [(0, 200)]);
        let hz: Vec<f64> = told[0].segment.iter().flat_map(MotionSegment::frequencies).collect();
        assert!(hz.len() == 1 && (hz[0] - 3.0).abs() < 0.02, "{hz:?}");
    }

    #[test]
    fn an_interval_without_a_segment_is_split() {
        for bend in [60_usize, 130, 170] {
            let given = Given::new(260, bent(0.02 * bend as f64, 0.003, 0.009));
            let told = split_unfitted(&given.cells(), given.stretches(&[0, 260]));
            assert_eq!(told.len(), 2, "{:?}", borders(&told));
            assert_eq!((told[0].from, told[0].to, told[1].to), (0, told[1].from, 260));
            assert!(told[1].from.abs_diff(bend) <= 16, "{:?}", borders(&told));
            assert!(told[0].segment.is_some() && told[1].segment.is_some());
        }
        // Two bends, and an interval that remains one segment.
        let given = Given::new(400, |t| {
            if t < 2.0 {
                0.003 * t
            } else if t < 4.0 {
                0.006 + 0.005 * (t - 2.0)
            } else {
                0.016 + 0.002 * (t - 4.0)
            }
        });
        let told = split_unfitted(&given.cells(), given.stretches(&[0, 300, 400]));
        let b = borders(&told);
        assert_eq!(b.len(), 4, "{b:?}");
        assert!(b.windows(2).all(|p| p[0].1 == p[1].0) && b[3] == (300, 400), "{b:?}");
        assert!(b[0].1.abs_diff(100) <= 12 && b[1].1.abs_diff(200) <= 12, "{b:?}");
        // Left whole where not even the beginning is a segment, or there is no room for two.
        let wild = Given {
            t: given.t.clone(),
            z: (0..400).map(|k| 1e-3 * (0.9 * f64::from(k * k)).sin() * f64::from(k)).collect(),
        };
        assert_eq!(borders(&split_unfitted(&wild.cells(), wild.stretches(&[0, 400]))), [(0, 400)]);
        let room = |n: usize| {
            let given = Given::new(n, bent(0.02 * 24.0, 0.003, 0.03));
            split_unfitted(&given.cells(), given.stretches(&[0, n])).len()
        };
        assert_eq!((room(47), room(48)), (1, 2));
    }

    #[test]
    fn borders_move_to_intersections() {
        let given = Given::new(240, bent(2.4, 0.002, 0.006));
        let lines = [0.002, 0.006].map(|v| Given::new(240, move |t| v * (t - 2.4)));
        for border in [100, 110, 119, 120, 121, 132, 140] {
            let one = SmoothInterval::new(&lines[0].cells(), (0, border), &[]);
            let two = SmoothInterval::new(&lines[1].cells(), (border, 240), &[]);
            let told = move_borders_to_intersections(&given.cells(), vec![one, two]);
            let b = borders(&told);
            assert!(b[0].1 == b[1].0 && b[0].1.abs_diff(120) <= 1, "{b:?} from {border}");
            for (s, v) in told.iter().zip([0.002, 0.006]) {
                assert!((s.at(&given.t, 2.4).1 - v).abs() < 2e-5);
            }
        }
        // At least the minimum number of cells stays on either side.
        let short = Given::new(240, bent(0.2, 0.002, 0.006));
        let mut both = short.stretches(&[0, 14, 240]);
        both[0] = SmoothInterval::new(&Given::new(240, |t| 0.002 * (t - 0.2)).cells(), (0, 14), &[]);
        assert_eq!(borders(&move_borders_to_intersections(&short.cells(), both)), [(0, 14), (14, 240)]);
        // Nothing moves without a segment on both sides.
        let mut half = given.stretches(&[0, 110, 240]);
        half[1].segment = None;
        assert_eq!(borders(&move_borders_to_intersections(&given.cells(), half)), [(0, 110), (110, 240)]);
    }

    #[test]
    fn the_intersection_is_near_the_border() {
        // Lines of 2 and 6 mm/s that intersect at 2.4 s; the border is at cell 114, half a cell before 2.28 s.
        let (one, two) = (Given::new(240, |t| 0.002 * (t - 2.4)), Given::new(240, |t| 0.006 * (t - 2.4)));
        let of = |given: &Given, from: usize, to: usize| SmoothInterval::new(&given.cells(), (from, to), &[]);
        let whole = Given::new(240, bent(2.4, 0.002, 0.006));
        let at =
            intersection_time(&of(&one, 0, 114), &of(&two, 114, 240), &whole.cells()).expect("an instant");
        assert!((at - 2.4).abs() < 2e-3, "{at}");
        // The search is limited to half a second around the border.
        let at = intersection_time(&of(&one, 0, 60), &of(&two, 60, 240), &whole.cells()).expect("an instant");
        assert!((at - (1.19 + 0.5)).abs() < 1e-9, "{at}");
        let at =
            intersection_time(&of(&one, 0, 180), &of(&two, 180, 240), &whole.cells()).expect("an instant");
        assert!((at - (3.59 - 0.5)).abs() < 1e-9, "{at}");
        // Parallel segments meet at their border.
        let beside = Given::new(240, |t| 0.002 * (t - 2.4) + 1e-4);
        let mut pair = [of(&one, 0, 100), of(&beside, 100, 240)];
        pair[1].segment = pair[0].segment.clone();
        let at = intersection_time(&pair[0], &pair[1], &one.cells()).expect("an instant");
        assert!((at - 1.99).abs() < 1e-9, "{at}");
        pair[0].segment = None;
        assert_eq!(intersection_time(&pair[0], &pair[1], &one.cells()), None);
    }

    #[test]
    fn a_jump_is_at_the_intersection_the_break_or_the_border() {
        let given = Given::new(240, bent(2.4, 0.002, 0.006));
        let samples: Vec<f64> = (0..960).map(|k| 0.005 * f64::from(k)).collect();
        let mut both = given.stretches(&[0, 120, 240]);
        let of = |both: &[SmoothInterval], found: &[SlopeBreak]| {
            jump_between(&both[0], &both[1], found, &given.cells(), &samples)
        };
        let kink = of(&both, &[]);
        assert!((kink.time_s - 2.4).abs() < 2e-3 && kink.position_m.abs() < 1e-5, "{kink:?}");
        assert!(
            (kink.velocity_mps[0] - 0.002).abs() < 2e-5 && (kink.velocity_mps[1] - 0.006).abs() < 2e-5,
            "{kink:?}"
        );
        assert!(samples[kink.next_sample] >= kink.time_s && samples[kink.next_sample - 1] < kink.time_s);
        let sd = |s: &SmoothInterval| s.segment.as_ref().map_or(0.0, |c| 3.0 * c.sd_m / 120.0_f64.sqrt());
        assert!((kink.position_sd_m - sd(&both[0]).hypot(sd(&both[1]))).abs() < 1e-12);
        // Without a segment: the break found at that cell.
        both[0].segment = None;
        both[0].local = (0..120).map(|k| (given.z[k], 0.002)).collect();
        let found = [(90, (1.7, 5.0, 6.0), 7.0), (120, (2.3931, 0.1, 0.2), 0.3)];
        let kink = of(&both, &found);
        assert_eq!(
            (kink.time_s, kink.position_m, kink.velocity_mps, kink.position_sd_m),
            (2.3931, 0.1, [0.2, 0.3], 1e-5)
        );
        assert_eq!(kink.next_sample, 479);
        // Or half a cell before the border, midway between both sides.
        let kink = of(&both, &found[..1]);
        assert!((kink.time_s - 2.39).abs() < 1e-12);
        let sides = [both[0].at(&given.t, kink.time_s), both[1].at(&given.t, kink.time_s)];
        assert!((kink.position_m - 0.5 * (sides[0].0 + sides[1].0)).abs() < 1e-15);
        assert_eq!(kink.velocity_mps, [sides[0].1, sides[1].1]);
    }

    #[test]
    fn the_widest_consistent_window_is_used() {
        // A parabola fits at any window.
        let t: Vec<f64> = (0..200).map(|k| 0.02 * f64::from(k)).collect();
        let z: Vec<f64> = t.iter().map(|t| 0.01 + 0.003 * t + 0.002 * t * t).collect();
        // Slope of a line over n cells: sd = noise sqrt(12/n) over the span; at the end of a parabola four
        // times that.
        let sd = |n: f64, off: f64| {
            1e-5 * (12.0 / n).sqrt() / (0.02 * (n - 1.0)) * (1.0 + 15.0 * off * off).sqrt()
        };
        // Cell, limits, number of cells of the widest window, relative offset from its middle.
        let cases = [
            (100, (0, 200), 121.0, 0.0),
            (80, (0, 200), 121.0, 0.0),
            (0, (0, 200), 61.0, 1.0),
            (199, (0, 200), 61.0, 1.0),
            (20, (0, 200), 81.0, 20.0 / 40.0),
            (100, (90, 140), 50.0, 14.5 / 24.5),
            (100, (97, 105), 8.0, 0.5 / 3.5),
        ];
        for (i, (from, to), n, off) in cases {
            let told = adaptive_window_fit(&t, &z, i, (from, to), 1e-5);
            assert!(
                (told.0 - z[i]).abs() < 1e-9 && (told.1 - 0.003 - 0.004 * t[i]).abs() < 1e-8,
                "{told:?} at {i}"
            );
            assert!((told.2 / sd(n, off) - 1.0).abs() < 1e-9, "{told:?} at {i}: {}", sd(n, off));
        }
        // Near a velocity change within twelve cells the window is narrower.
        let kink: Vec<f64> =
            t.iter().map(|t| 0.003 * t + if *t > 2.2 { 0.02 * (t - 2.2) } else { 0.0 }).collect();
        let told = adaptive_window_fit(&t, &kink, 100, (0, 200), 1e-5);
        assert!((told.1 - 0.003).abs() < 1e-5, "{told:?}");
        assert!(told.2 >= sd(25.0, 0.0) * 0.999 && told.2 < sd(7.0, 0.0), "{told:?}");
        // Three cells give a position and no velocity.
        assert_eq!(adaptive_window_fit(&t, &z, 100, (99, 102), 1e-5), (z[100], 0.0, f64::INFINITY));
        assert!(adaptive_window_fit(&t, &z, 100, (99, 103), 1e-5).2.is_finite());
    }

    #[test]
    fn a_short_recording_is_differentiated() {
        let of = |n: usize| {
            let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
            let z: Vec<f64> = t.iter().enumerate().map(|(k, t)| 0.003 * t + 1e-5 * rough(k)).collect();
            (smooth_positions(&t, &z), stylet_record::differentiate(&t, &z, 0.1), z)
        };
        let (told, v, z) = of(31);
        assert_eq!((told.position_m, told.velocity_mps, told.sd_mps), (z, v, f64::INFINITY));
        assert!(told.jumps.is_empty());
        let (told, _, _) = of(32);
        assert!(told.sd_mps < 1e-3 && told.velocity_mps.iter().all(|v| (v - 0.003).abs() < 1e-4));
    }

    /// Insertion with ripple, a hold, a retraction.
    fn course(t: f64) -> (f64, f64) {
        let w = core::f64::consts::TAU * 0.4;
        let a = 0.001;
        if t < 6.0 {
            (0.003 * t + a / w * (1.0 - (w * t).cos()), 0.003 + a * (w * t).sin())
        } else if t < 9.0 {
            (course(6.0 - 1e-9).0, 0.0)
        } else {
            (course(7.0).0 - 0.004 * (t - 9.0), -0.004)
        }
    }

    fn error(course: impl Fn(f64) -> (f64, f64), noise: impl Fn(usize) -> f64, round_m: f64) -> (f64, usize) {
        let t: Vec<f64> = (0..2400).map(|k| k as f64 / 200.0).collect();
        let round = |z: f64| if round_m > 0.0 { (z / round_m).round() * round_m } else { z };
        let z: Vec<f64> = t.iter().enumerate().map(|(k, t)| round(course(*t).0 + noise(k))).collect();
        let found = smooth_positions(&t, &z);
        let mut off: Vec<f64> =
            found.velocity_mps.iter().zip(&t).map(|(v, t)| (v - course(*t).1).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        (off[off.len() * 9 / 10], found.jumps.len())
    }

    /// A fixed sequence that resembles noise of unit variance.
    fn rough(k: usize) -> f64 {
        let mut h = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut sum = 0.0;
        for _ in 0..12 {
            h ^= h >> 29;
            h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
            sum += (h >> 40) as f64 / (1u64 << 24) as f64;
        }
        sum - 6.0
    }

    #[test]
    fn noise_of_20_um_gives_velocity_to_10_um_per_second() {
        let (off, kinks) = error(course, |k| 2e-5 * rough(k), 0.0);
        assert!(off < 1e-5, "{off}");
        assert_eq!(kinks, 2);
    }

    #[test]
    fn quantisation_of_50_um_gives_velocity_to_10_um_per_second() {
        let (off, kinks) = error(course, |_| 0.0, 5e-5);
        assert!(off < 1e-5, "{off}");
        assert_eq!(kinks, 2);
    }

    /// 4.93 mm/s are 98.6 quantisation steps of 50 µm per second, nearly one in two samples at 200 Hz: a beat
    /// of 3 Hz and 0.1 mm/s.
    #[test]
    fn quantisation_beating_with_the_sampling_is_not_a_ripple() {
        for speed_mps in [0.00493, 0.00494, 0.00495, 0.00506, 0.00507] {
            let line = |t: f64| if t < 2.0 { (0.0, 0.0) } else { (speed_mps * (t - 2.0), speed_mps) };
            let (off, kinks) = error(line, |_| 0.0, 5e-5);
            assert!(off < 1e-5, "{speed_mps}: {off}");
            assert_eq!(kinks, 1, "{speed_mps}");
        }
    }

    #[test]
    fn a_fast_ripple_is_not_a_chain_of_jumps() {
        let w = core::f64::consts::TAU * 1.4;
        let rippled = move |t: f64| {
            let s = (t - 5.0).max(0.0);
            (0.003 * t + 0.002 / w * (1.0 - (w * s).cos()), 0.003 + 0.002 * (w * s).sin())
        };
        let (off, kinks) = error(rippled, |k| 2e-5 * rough(k), 0.0);
        assert!(off < 2e-5, "{off}");
        assert!(kinks <= 1, "{kinks}");
    }

    #[test]
    fn a_jump_of_300_um_per_second_is_detected() {
        let bent = |t: f64| {
            if t < 6.0 { (0.003 * t, 0.003) } else { (0.018 + 0.0033 * (t - 6.0), 0.0033) }
        };
        let (off, kinks) = error(bent, |k| 2e-5 * rough(k), 0.0);
        assert!(off < 1e-5, "{off}");
        assert_eq!(kinks, 1);
    }

    /// A ripple that starts at a line returns to it: they intersect more than once.
    #[test]
    fn of_several_intersections_the_best_fitting_one_is_used() {
        let w = core::f64::consts::TAU * 1.22;
        let ripple =
            move |s: f64| (0.0069 * s + 0.0055 / w * (1.0 - (w * s).cos()), 0.0069 + 0.0055 * (w * s).sin());
        let told = move |begin: f64| {
            move |t: f64| {
                let s = t - begin;
                let at = 0.0039 * begin;
                if s < 0.0 {
                    (0.0039 * t, 0.0039)
                } else if s < 3.86 {
                    (at + ripple(s).0, ripple(s).1)
                } else {
                    (at + ripple(3.86).0 + 0.0056 * (s - 3.86), 0.0056)
                }
            }
        };
        let t: Vec<f64> = (0..1800).map(|k| f64::from(k) / 200.0).collect();
        for k in 0..12 {
            let begin = 4.0 + 0.0137 * f64::from(k);
            let z: Vec<f64> = t.iter().map(|t| (told(begin)(*t).0 / 5e-5).round() * 5e-5).collect();
            let found = smooth_positions(&t, &z);
            let calm = |t: f64| t < begin + 3.5 && (t - begin).abs() > 0.03;
            let off = |(t, v): (&f64, &f64)| if calm(*t) { (v - told(begin)(*t).1).abs() } else { 0.0 };
            let most = t.iter().zip(&found.velocity_mps).map(off).fold(0.0, f64::max);
            assert!(most < 5e-4, "begin {begin}: {most}");
        }
    }

    #[test]
    fn a_chirp_is_followed_by_local_windows() {
        // A chirp: neither a low-order polynomial nor a sinusoid.
        let drawn = |t: f64| {
            (0.002 * t + 4e-4 * (1.0 + (0.3 * t * t).sin()), 0.002 + 2.4e-4 * t * (0.3 * t * t).cos())
        };
        let (off, _) = error(drawn, |k| 2e-5 * rough(k), 0.0);
        assert!(off < 8e-4, "{off}");
    }
}
