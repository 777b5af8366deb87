//! Phase coordinate of an insertion: advance by depth, hold by time, retraction by depth.
//!
//! It aligns curves of recordings with different speeds and holds for averaging and comparison. A place is an index into [`BINS`] bins,
//! with fractions between their centres.

use serde::{Deserialize, Serialize};
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::insertion_phases::detect_phases;
use stylet_record::Recording;
use stylet_stats::median_of;

/// Number of bins of the advance, and of the retraction: 0.25 mm of a stroke of 25 mm.
const DEPTH_BINS: usize = 100;
/// Number of bins of the hold.
const HOLD_BINS: usize = 25;
/// Number of bins of a course.
pub const BINS: usize = 2 * DEPTH_BINS + HOLD_BINS;
/// First bins of advance, hold and retraction, and the end of the course.
const SEGMENTS: [usize; 4] = [0, DEPTH_BINS, DEPTH_BINS + HOLD_BINS, BINS];
/// Half width (bins) of the window in which neighbouring bins are pooled: 1 mm of a stroke of 25 mm.
const POOLED_BINS: usize = 4;

/// Positions between which the bins of advance and retraction lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DepthRange {
    /// Lowest position in m.
    pub start_m: f64,
    /// Deepest position in m.
    pub deepest_m: f64,
}

/// A curve over the bins; `None` in phases without samples.
pub type Curve = Vec<Option<f64>>;

/// Phases and speed of one recording.
#[derive(Clone, Debug)]
pub struct InsertionCourse {
    /// Median speed of the advance in m/s.
    pub speed_mps: f64,
    /// Range of positions.
    pub range: DepthRange,
    /// End of the advance in s.
    deepest_s: f64,
    /// Begin of the retraction, or the end of a recording without one, in s.
    retraction_s: f64,
}

impl InsertionCourse {
    /// The course of a recording.
    pub fn new(recording: &Recording) -> Self {
        let (t, z) = (&recording.time_s, &recording.position_m);
        let phases = detect_phases(recording);
        let at = |i: usize| t.get(i).or(t.last()).copied().unwrap_or(0.0);
        let advance = recording.velocity_mps.get(phases.start..=phases.deepest).unwrap_or(&[]);
        let (start_m, deepest_m) = stylet_stats::extremes(z);
        Self {
            speed_mps: median_of(advance.iter().copied().filter(|v| *v > 0.0)),
            range: DepthRange { start_m, deepest_m },
            deepest_s: at(phases.deepest),
            retraction_s: at(phases.retraction),
        }
    }

    /// Place of every block, with the tissue shifted by `shift_m` along the axis.
    pub fn places(&self, blocks: &BlockAverages, range: DepthRange, shift_m: f64) -> Vec<f64> {
        let length_m = (range.deepest_m - range.start_m).max(1e-9);
        let within = |share: f64, segment: usize| {
            let bins = (SEGMENTS[segment + 1] - SEGMENTS[segment]) as f64;
            SEGMENTS[segment] as f64 + (share * bins - 0.5).clamp(0.0, bins - 1.0)
        };
        let (mut deepest_m, mut back_m) = (f64::NEG_INFINITY, f64::INFINITY);
        let times = blocks.start_s.iter().zip(&blocks.end_s).map(|(a, b)| 0.5 * (a + b));
        let place = |t: f64| {
            let z = blocks.motion.at(t).0 - shift_m;
            if t <= self.deepest_s {
                deepest_m = deepest_m.max(z);
                within((deepest_m - range.start_m) / length_m, 0)
            } else if t < self.retraction_s {
                within((t - self.deepest_s) / (self.retraction_s - self.deepest_s).max(1e-9), 1)
            } else {
                back_m = back_m.min(z);
                within((range.deepest_m - back_m) / length_m, 2)
            }
        };
        times.map(place).collect()
    }
}

/// Means of `values` per bin; bins without a value are interpolated within their phase.
pub fn curve_of(places: &[f64], used: &[bool], values: &[f64]) -> Curve {
    let mut sums = vec![(0.0, 0.0); BINS];
    for ((place, _), value) in places.iter().zip(used).zip(values).filter(|((_, used), _)| **used) {
        let sum: &mut (f64, f64) = &mut sums[(place.round() as usize).min(BINS - 1)];
        *sum = (sum.0 + value, sum.1 + 1.0);
    }
    let mut out = vec![None; BINS];
    for segment in SEGMENTS.windows(2) {
        let known: Vec<usize> = (segment[0]..segment[1]).filter(|k| sums[*k].1 > 0.0).collect();
        if known.is_empty() {
            continue;
        }
        let at: Vec<f64> = known.iter().map(|k| *k as f64).collect();
        let means: Vec<f64> = known.iter().map(|k| sums[*k].0 / sums[*k].1).collect();
        for (k, value) in out.iter_mut().enumerate().take(segment[1]).skip(segment[0]) {
            *value = Some(stylet_stats::interpolate(&at, &means, k as f64));
        }
    }
    out
}

/// Value of a curve at a place, interpolated linearly.
pub fn value_at(curve: &[Option<f64>], place: f64) -> Option<f64> {
    let low = place.floor() as usize;
    let share = place - low as f64;
    let first = (*curve.get(low)?)?;
    let second = if share > 0.0 { (*curve.get(low + 1)?)? } else { first };
    Some(first + share * (second - first))
}

/// Mean of curves, where all of them have a value.
pub fn mean_curve(curves: &[&Curve]) -> Curve {
    let n = curves.len().max(1) as f64;
    let mean = |k: usize| {
        let values: Option<Vec<f64>> = curves.iter().map(|c| c[k]).collect();
        values.filter(|v| !v.is_empty()).map(|v| v.iter().sum::<f64>() / n)
    };
    (0..BINS).map(mean).collect()
}

/// Means over neighbouring bins of the same phase.
pub fn pooled(curve: &[Option<f64>]) -> Curve {
    let mut out = vec![None; BINS];
    for segment in SEGMENTS.windows(2) {
        for k in segment[0]..segment[1] {
            let (from, to) =
                (k.saturating_sub(POOLED_BINS).max(segment[0]), (k + POOLED_BINS + 1).min(segment[1]));
            let near: Vec<f64> = curve[from..to].iter().flatten().copied().collect();
            out[k] = (!near.is_empty()).then(|| stylet_stats::mean(&near));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{BINS, InsertionCourse, curve_of, mean_curve, value_at};
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_record::Recording;

    /// In by 20 mm, a hold of `hold_s`, and back; the force is 100 N/m times the position, and 1 N more on the way back.
    fn run(speed: f64, hold_s: f64) -> Recording {
        let advance_s = 0.02 / speed;
        let t: Vec<f64> =
            (0..((2.0 * advance_s + hold_s) * 100.0) as usize).map(|k| 0.01 * k as f64).collect();
        let z = |t: f64| match t {
            t if t < advance_s => speed * t,
            t if t < advance_s + hold_s => 0.02,
            t => 0.02 - speed * (t - advance_s - hold_s),
        };
        let back = |t: f64| if t < advance_s + hold_s { 0.0 } else { 1.0 };
        let f = t.iter().map(|t| 100.0 * z(*t) + back(*t)).collect();
        Recording::new(t.clone(), t.iter().map(|t| z(*t)).collect(), f).expect("a recording")
    }

    #[test]
    fn curves_of_other_speeds_and_holds_agree_place_by_place() {
        let (slow, fast) = (run(0.002, 2.0), run(0.008, 6.0));
        let range = InsertionCourse::new(&slow).range;
        let of = |r: &Recording| {
            let b = BlockAverages::new(r, &[], BLOCK_S);
            let course = InsertionCourse::new(r);
            let places = course.places(&b, range, 0.0);
            (curve_of(&places, &b.used, &b.force_n), places, b)
        };
        let ((a, ..), (b, places, blocks)) = (of(&slow), of(&fast));
        // Behind the first bins of the way back, where the two end differently.
        let apart = |k: usize| (a[k].expect("a value") - b[k].expect("a value")).abs();
        assert!(
            (0..120).chain(130..215).all(|k| apart(k) < 0.05),
            "{:?}",
            (0..BINS).map(apart).collect::<Vec<_>>()
        );
        let mean = mean_curve(&[&a, &b]);
        let error = |k: usize| (value_at(&mean, places[k]).expect("a value") - blocks.force_n[k]).abs();
        // A bin of the hold is 12 blocks long; the last one has the begin of the way back, where the force jumps.
        assert!((10..places.len() - 20).filter(|k| blocks.used[*k] && error(*k) > 0.1).count() < 20);
    }

    #[test]
    fn a_phase_without_samples_has_no_curve() {
        let mut recording = run(0.004, 1.0);
        let n = 500;
        recording.time_s.truncate(n);
        recording.position_m.truncate(n);
        recording.force_n.truncate(n);
        recording.velocity_mps.truncate(n);
        let b = BlockAverages::new(&recording, &[], BLOCK_S);
        let course = InsertionCourse::new(&recording);
        let curve = curve_of(&course.places(&b, course.range, 0.0), &b.used, &b.force_n);
        assert!(curve[50].is_some() && curve[200].is_none());
        assert_eq!((value_at(&curve, 200.0), mean_curve(&[&curve])[200]), (None, None));
    }
}
