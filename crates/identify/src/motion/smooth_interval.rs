//! Motion between two velocity jumps: a parametric segment, or local windows.

use super::motion_segment::{MIN_CELLS, MotionSegment, cheaper};
use super::velocity_estimate::fit_parabola;

/// Half widths of the local windows, in cells; they grow by half each.
const HALF_WINDOWS: [usize; 8] = [3, 5, 8, 12, 18, 27, 40, 60];
/// Half width of the confidence intervals of the window selection, in standard deviations.
const INTERVAL_SDS: f64 = 2.2;
/// Largest residual of a segment, as a multiple of the position noise.
const MAX_NOISE_RATIO: f64 = 2.0;
/// Cells that may be excluded at either end of a constant-velocity interval: a drive needs up to half a second for a velocity change, half
/// of it on either side of the jump.
const RAMP_CELLS: [usize; 4] = [1, 3, 6, 12];
/// Penalty of an excluded ramp in nats per cell: most drives reach their velocity within a few cells.
const RAMP_NATS_PER_CELL: f64 = 0.5;

/// Positions averaged over cells: midpoint `t` (s), mean `z` (m), length `dt` (s), standard deviation of the noise (m), and amplitude (m)
/// of the first harmonic of the quantisation error at constant velocity.
#[derive(Clone, Copy)]
pub(super) struct Cells<'a> {
    pub t: &'a [f64],
    pub z: &'a [f64],
    pub dt: f64,
    pub noise_m: f64,
    pub rounded_m: f64,
}

/// Motion of the cells `from..to` between two velocity jumps.
pub(super) struct SmoothInterval {
    pub from: usize,
    pub to: usize,
    /// Parametric segment, if one has white residuals.
    pub segment: Option<MotionSegment>,
    /// Position and velocity per cell from local windows, without a segment.
    pub local: Vec<(f64, f64)>,
    /// Standard deviation of the velocity in m/s per cell.
    pub sds: Vec<f64>,
    /// Bayesian information criterion in nats; infinite without a segment.
    pub cost: f64,
}

impl SmoothInterval {
    pub fn new(cells: &Cells, (from, to): (usize, usize), hints: &[f64]) -> Self {
        let Cells { t: tc, z: zc, dt, noise_m, rounded_m } = *cells;
        // A cell at a jump averages both velocities.
        let (lo, hi) = trimmed((from, to), 1, tc.len());
        let segment = if hi > lo + MIN_CELLS {
            MotionSegment::fit_best(&tc[lo..hi], &zc[lo..hi], dt, hints, rounded_m)
        } else {
            None
        };
        let segment = segment.filter(|c| c.white && c.sd_m < MAX_NOISE_RATIO * noise_m);
        let segment = match segment {
            Some(c) if c.is_constant_velocity() => Some(c),
            other => cheaper_of(other, Self::even(cells, (from, to))),
        };
        if let Some(segment) = segment {
            let cells = (hi - lo) as f64;
            // Slope of a line, doubled for a curved segment.
            let slope = 2.0 * segment.sd_m * (12.0 / cells).sqrt() / (cells * dt);
            let sd = if segment.is_at_rest() { 0.0 } else { slope };
            let cost = segment.cost;
            return Self {
                from,
                to,
                segment: Some(segment),
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

    /// Best rest or line between two velocity ramps, which take up at most a third of the interval.
    fn even(cells: &Cells, (from, to): (usize, usize)) -> Option<MotionSegment> {
        let mut best = None;
        for cut in RAMP_CELLS {
            let (lo, hi) = trimmed((from, to), cut, cells.t.len());
            if hi <= lo + MIN_CELLS || 3 * (hi - lo) < 2 * (to - from) {
                break;
            }
            let segment = MotionSegment::fit_constant_velocity(&cells.t[lo..hi], &cells.z[lo..hi], cells.dt);
            let mut segment = segment.filter(|c| c.white && c.sd_m < MAX_NOISE_RATIO * cells.noise_m);
            if let Some(c) = segment.as_mut() {
                // The excluded cells are assumed to fit as well as the others, with one more parameter and a penalty on their number.
                let (all, n) = ((to - from) as f64, (hi - lo) as f64);
                c.cost += (all - n) * libm::log(c.sd_m);
                if cut > 1 {
                    c.cost += libm::log(all) + RAMP_NATS_PER_CELL * (cut - 1) as f64;
                }
            }
            best = cheaper_of(best, segment);
        }
        best
    }

    /// Angular frequencies of the segment in 1/s.
    pub fn frequencies(&self) -> Vec<f64> {
        self.segment.iter().flat_map(MotionSegment::frequencies).collect()
    }

    /// Position (m) and velocity (m/s) at a time within the interval.
    pub fn at(&self, tc: &[f64], t: f64) -> (f64, f64) {
        if let Some(segment) = &self.segment {
            return segment.at(t);
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

/// The interval without `cut` cells at each border that is inside the recording.
fn trimmed((from, to): (usize, usize), cut: usize, cells: usize) -> (usize, usize) {
    (if from > 0 { from + cut } else { 0 }, if to < cells { to.saturating_sub(cut) } else { to })
}

/// The segment with the lower cost, of those that exist.
fn cheaper_of(a: Option<MotionSegment>, b: Option<MotionSegment>) -> Option<MotionSegment> {
    match a {
        Some(a) => Some(cheaper(a, b)),
        None => b,
    }
}

/// Position, velocity and its standard deviation at cell `i`, from a parabola over the widest window whose slope agrees with all narrower
/// ones (intersection of confidence intervals).
pub(super) fn adaptive_window_fit(
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
        // Standard error of the slope of a parabola over n cells: in the middle that of a line, at the end four times as much.
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
