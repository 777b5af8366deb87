//! Estimates position and velocity from noisy or coarsely quantised positions.
//!
//! Samples are averaged over cells of 20 ms. A velocity jump is detected where parabolas on both sides of a gap between cells meet with
//! significantly different slopes. The interval between two jumps is a parametric `motion_segment` if its residuals are white. Otherwise
//! every cell uses the widest window whose parabola agrees with all narrower ones (intersection of confidence intervals: Goldenshluger and
//! Nemirovski 1997).

use super::acceleration_ramp::AccelerationRamp;
use super::interval_borders::{
    intersection_time, merge_neighbours, move_borders_to_intersections, refit_borders, split_unfitted,
};
use super::motion_segment::MotionSegment;
use super::smooth_interval::{Cells, SmoothInterval};
use super::velocity_estimate::{SlopeBreak, VelocityJump, encoder_step, position_noise, slope_breaks};
use stylet_stats::order_statistics::median;

/// Length of a cell (s), about that of a block.
const CELL_S: f64 = 0.02;
/// Cells of each parabola in the search for a jump.
const JUMP_SIDE_CELLS: usize = 15;

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
pub(crate) fn smooth_positions(t: &[f64], z: &[f64]) -> SmoothedMotion {
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
    // Standard error of the slope at the end of a parabola over `side` cells: noise sqrt(192/side^3)/dt. The threshold is six of the
    // difference of two such slopes.
    let jump_sd = 6.0 * 2.0_f64.sqrt() * 13.9 * noise_m / (dt * libm::pow(JUMP_SIDE_CELLS as f64, 1.5));
    let found = slope_breaks(&tc, &zc, JUMP_SIDE_CELLS, (1.8 * dt, 1.8 * dt), jump_sd);
    let mut edges: Vec<usize> = found.iter().map(|b| b.0).collect();
    edges.extend([0, cells]);
    edges.sort_unstable();
    edges.dedup();
    let rounded_m = step_m / core::f64::consts::PI;
    let cells = Cells { t: &tc, z: &zc, dt, noise_m, rounded_m };
    let first = edges.windows(2).map(|e| SmoothInterval::new(&cells, (e[0], e[1]), &[])).collect();
    let intervals = merge_neighbours(&cells, split_unfitted(&cells, merge_neighbours(&cells, first)));
    let intervals = move_borders_to_intersections(&cells, refit_borders(&cells, intervals));
    let jumps: Vec<VelocityJump> =
        intervals.windows(2).map(|p| jump_between(&p[0], &p[1], &found, &cells, t)).collect();
    let ramps: Vec<Option<AccelerationRamp>> = intervals
        .windows(2)
        .zip(&jumps)
        .map(|(p, k)| AccelerationRamp::between(&p[0], &p[1], k, &cells))
        .collect();
    let mut segment = 0;
    let (z, v): (Vec<f64>, Vec<f64>) = (0..n)
        .map(|i| {
            while jumps.get(segment).is_some_and(|k| k.time_s <= t[i]) {
                segment += 1;
            }
            let adjacent = ramps[segment.saturating_sub(1)..(segment + 1).min(ramps.len())].iter().flatten();
            let ramp = adjacent.filter_map(|r| r.at(t[i])).next();
            ramp.unwrap_or_else(|| intervals[segment.min(intervals.len() - 1)].at(&tc, t[i]))
        })
        .unzip();
    let jumps = jumps.into_iter().zip(&ramps).filter(|(_, r)| r.is_none()).map(|(k, _)| k).collect();
    let mut sds: Vec<f64> = intervals.iter().flat_map(|s| s.sds.iter().copied()).collect();
    SmoothedMotion { position_m: z, velocity_mps: v, jumps, sd_mps: median(&mut sds).max(1e-9) }
}

/// The velocity jump between two intervals.
fn jump_between(
    left: &SmoothInterval,
    right: &SmoothInterval,
    found: &[SlopeBreak],
    cells: &Cells,
    t: &[f64],
) -> VelocityJump {
    let jump = |at: f64, z: f64, v: [f64; 2], sd_m: f64| {
        let sample = t.partition_point(|t| *t < at).clamp(1, t.len() - 1);
        VelocityJump { next_sample: sample, time_s: at, position_m: z, velocity_mps: v, position_sd_m: sd_m }
    };
    if let (Some(a), Some(b), Some(at)) =
        (&left.segment, &right.segment, intersection_time(left, right, cells))
    {
        // Standard error of the position at the end of a curved segment.
        let end = |s: &SmoothInterval, c: &MotionSegment| 3.0 * c.sd_m / ((s.to - s.from) as f64).sqrt();
        let sd_m = libm::hypot(end(left, a), end(right, b));
        return jump(at, 0.5 * (a.at(at).0 + b.at(at).0), [a.at(at).1, b.at(at).1], sd_m);
    }
    match found.iter().find(|b| b.0 == right.from) {
        Some(&(_, (at, z, before), after)) => jump(at, z, [before, after], cells.noise_m),
        None => {
            let at = cells.t[right.from] - 0.5 * cells.dt;
            let (one, two) = (left.at(cells.t, at), right.at(cells.t, at));
            jump(at, 0.5 * (one.0 + two.0), [one.1, two.1], cells.noise_m)
        }
    }
}

#[cfg(test)]
mod tests;
