//! Period of the commanded motion: at its harmonics, and below one period per recording, a periodic cause is not distinguishable from a force
//! that depends on the motion.

use crate::selection_state::Search;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;
use stylet_stats::order_statistics::quantile;

/// Lower and upper quantile of the velocity that give the speeds of the two strokes.
const STROKE_QUANTILE: f64 = 0.05;
/// Hysteresis of the crossings of the mean speed, as a share of the difference of both speeds.
const CROSSING_SHARE: f64 = 0.1;
/// Smallest difference (m/s) of the speeds of a periodic motion.
const MIN_SPEED_RANGE_MPS: f64 = 2e-5;
/// Largest ratio of the longest to the shortest period of a periodic motion.
const MAX_PERIOD_RATIO: f64 = 1.15;
/// Share of the recording that the periods must cover; during the rest, a periodic cause would be visible.
const MIN_COVERAGE: f64 = 0.8;
/// Highest harmonic expected in a force that depends on the motion.
const MAX_HARMONIC: f64 = 20.0;
/// Order of the lowest subharmonic considered: one quarter of the frequency.
const MAX_SUBHARMONIC: u32 = 4;

/// Period (s) of a motion that is periodic over the recording; `None` otherwise.
pub(crate) fn motion_period_s(b: &BlockAverages) -> Option<f64> {
    let times: Vec<f64> = (0..b.len()).map(|k| b.mid_s(k)).collect();
    let v: Vec<f64> = times.iter().map(|t| b.motion.at(*t).1).collect();
    let (low, high) =
        (quantile(&mut v.clone(), STROKE_QUANTILE), quantile(&mut v.clone(), 1.0 - STROKE_QUANTILE));
    if high - low < MIN_SPEED_RANGE_MPS {
        return None;
    }
    let (middle, margin) = (0.5 * (low + high), CROSSING_SHARE * (high - low));
    let (mut above, mut crossings) = (None, [Vec::new(), Vec::new()]);
    for (t, v) in times.iter().zip(&v) {
        let now = if *v > middle + margin {
            true
        } else if *v < middle - margin {
            false
        } else {
            continue;
        };
        if above.is_some_and(|was| was != now) {
            crossings[usize::from(now)].push(*t);
        }
        above = Some(now);
    }
    let periods: Vec<f64> = crossings.iter().flat_map(|c| c.windows(2).map(|w| w[1] - w[0])).collect();
    let (shortest, longest) = range(&periods)?;
    let mean = stylet_stats::mean(&periods);
    let (first, last) = range(&crossings.concat())?;
    let covered = last - first + mean >= MIN_COVERAGE * length_s(b);
    (longest <= MAX_PERIOD_RATIO * shortest && covered).then_some(mean)
}

/// Smallest and largest value; `None` without any.
fn range(x: &[f64]) -> Option<(f64, f64)> {
    let smallest = x.iter().copied().reduce(f64::min)?;
    Some((smallest, x.iter().copied().fold(smallest, f64::max)))
}

fn length_s(b: &BlockAverages) -> f64 {
    let (first, last) = b.span_s();
    last - first
}

/// Whether a frequency is, within the resolution of the recording, zero, a harmonic or a low subharmonic of its motion.
fn is_multiple_of_motion(hz: f64, b: &BlockAverages) -> bool {
    motion_period_s(b).is_some_and(|period_s| {
        let (order, resolution) = (hz * period_s, period_s / length_s(b));
        // Order 0: less than one period in the recording.
        let harmonic = order.round().clamp(0.0, MAX_HARMONIC);
        (order - harmonic).abs() <= resolution
            || (2..=MAX_SUBHARMONIC).any(|m| (order - 1.0 / f64::from(m)).abs() <= resolution)
    })
}

/// Index of the first periodic effect that no recording distinguishes from the commanded motion.
fn confounded_clock(f: &Fit, data: &FitData) -> Option<usize> {
    let confounded = |hz: &f64| data.recordings.iter().all(|b| is_multiple_of_motion(*hz, b));
    f.model
        .effects
        .iter()
        .position(|e| e.info.parameters.iter().zip(&e.values).any(|(p, value)| p.clock && confounded(value)))
}

/// Whether a fit has such an effect.
pub(crate) fn has_confounded_clock(f: &Fit, data: &FitData) -> bool {
    confounded_clock(f, data).is_some()
}

impl Search {
    /// Removes periodic effects whose frequency converged to a multiple of the commanded motion.
    pub(crate) fn drop_confounded_clocks(&mut self) {
        while let Some(k) = confounded_clock(&self.best, &self.data) {
            let Some(f) = fit(&self.best.model.without_effect(k), &self.data, Effort::FULL) else { return };
            self.accept(f);
        }
    }
}

/// Shortest period (s) of the commanded motions; `None` unless all are periodic.
pub(crate) fn common_motion_period_s(data: &FitData) -> Option<f64> {
    let periods: Option<Vec<f64>> = data.recordings.iter().map(motion_period_s).collect();
    range(&periods?).map(|p| p.0)
}

#[cfg(test)]
mod tests {
    use super::{is_multiple_of_motion, motion_period_s};
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_record::Recording;

    fn blocks(position_m: impl Fn(f64) -> f64, seconds: f64) -> BlockAverages {
        let t: Vec<f64> = (0..(seconds * 200.0) as usize).map(|k| k as f64 * 0.005).collect();
        let z = t.iter().map(|t| position_m(*t)).collect();
        let force = t.iter().map(|t| libm::sin(37.0 * t)).collect();
        BlockAverages::new(&Recording::new(t, z, force).expect("a recording"), &[], BLOCK_S)
    }

    fn triangle(period_s: f64) -> impl Fn(f64) -> f64 {
        move |t| 0.006 * (1.0 - ((2.0 * t / period_s) % 2.0 - 1.0).abs())
    }

    #[test]
    fn triangles_sines_and_rippled_insertions_have_their_period() {
        let tau = core::f64::consts::TAU;
        for (b, expected) in [
            (blocks(triangle(8.0), 32.0), 8.0),
            (blocks(triangle(20.0), 35.0), 20.0),
            (blocks(move |t| 0.004 * (1.0 - (tau * 0.7 * t).cos()), 20.0), 1.0 / 0.7),
            (blocks(move |t| 0.002 * t + 3e-4 * (tau * 0.5 * t).sin(), 30.0), 2.0),
        ] {
            let found = motion_period_s(&b).expect("periodic");
            assert!((found / expected - 1.0).abs() < 0.02, "{found} s, expected {expected} s");
        }
    }

    #[test]
    fn insertions_with_holds_and_one_reversal_are_not_periodic() {
        let tau = core::f64::consts::TAU;
        let program = move |t: f64| match t {
            t if t < 15.0 => 0.002 * t,
            t if t < 18.0 => 0.03,
            t if t < 33.0 => 0.03 + 0.003 * (t - 18.0) + 3e-4 * (tau * 0.5 * (t - 18.0)).sin(),
            t => 0.075 - 0.004 * (t - 33.0),
        };
        assert_eq!(motion_period_s(&blocks(program, 38.0)), None);
        assert_eq!(motion_period_s(&blocks(|t| 0.002 * t, 30.0)), None);
        assert_eq!(motion_period_s(&blocks(triangle(30.0), 30.0)), None);
    }

    #[test]
    fn harmonics_and_low_subharmonics_within_the_resolution_are_multiples() {
        let b = blocks(triangle(4.0), 40.0);
        for hz in [0.25, 0.5, 0.26, 0.125, 5.0, 0.02] {
            assert!(is_multiple_of_motion(hz, &b), "{hz} Hz");
        }
        for hz in [0.33, 0.625, 5.38] {
            assert!(!is_multiple_of_motion(hz, &b), "{hz} Hz");
        }
    }
}
