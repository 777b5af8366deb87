//! Implausible recordings: a dead or reversed sensor, no contact, no motion, too few samples, values out of range.

use super::constant_runs::for_each_constant_run;
use super::extent::Extent;
use super::note::{QualityKind, QualityNote};
use crate::sample_stream::{Quantity, SampleStream, SortedValues};
use stylet_stats::quantiles_of_stream;

/// Least number of samples of a usable recording.
pub const MIN_SAMPLES: usize = 50;

pub(super) fn too_short(samples: usize) -> Option<QualityNote> {
    (samples < MIN_SAMPLES).then(|| {
        let message = format!("there are {samples} usable sample(s); a diagnosis needs at least {MIN_SAMPLES}: record the whole insertion");
        QualityNote::blocking(QualityKind::TooShort, message, [("samples", samples as f64), ("least", MIN_SAMPLES as f64)])
    })
}

/// Relative range (or range in N, if the force is below 1 N) below which the force is constant.
const CONSTANT_TOLERANCE: f64 = 1e-9;

pub(super) fn dead_sensor(samples: usize, extent: &Extent) -> Option<QualityNote> {
    let (low, high) = extent.force_n;
    (high - low <= CONSTANT_TOLERANCE * high.abs().max(low.abs()).max(1.0)).then(|| {
        let message = format!(
            "the force is {high} N in all {samples} samples, without any noise: the sensor was off or not connected, or this is \
             another column; check the cable and the column map, and record again"
        );
        QualityNote::blocking(QualityKind::Dead, message, [("value", high)])
    })
}

/// Position range in m below which the needle does not move.
const MIN_TRAVEL_M: f64 = 1e-6;

pub(super) fn no_motion(extent: &Extent) -> Option<QualityNote> {
    let (low, high) = extent.position_m;
    (high - low < MIN_TRAVEL_M).then(|| {
        let message = format!(
            "the position is {high} m in all samples: the needle does not move, or this is another column; check the encoder and the column map"
        );
        QualityNote::blocking(QualityKind::Stuck, message, [("value", high), ("travel_m", high - low)])
    })
}

/// Largest plausible value in any unit.
const MAX_VALUE: f64 = 1e12;

/// Values such as 1e300, which would overflow in computations.
pub(super) fn implausible_value<A: SampleStream>(recording: &A) -> Result<Option<QualityNote>, A::Error> {
    let columns = [
        ("force_n", Quantity::Force),
        ("position_m", Quantity::Position),
        ("velocity_mps", Quantity::Velocity),
    ];
    for (name, which) in columns {
        let (mut sample, mut first) = (0, None);
        recording.for_each_value(which, |x| {
            if x.abs() > MAX_VALUE && first.is_none() {
                first = Some((sample, x));
            }
            sample += 1;
        })?;
        if let Some((at, value)) = first {
            return Ok(Some(implausible_note(name, value, at, recording.at(Quantity::Time, at)?)));
        }
    }
    Ok(None)
}

fn implausible_note(name: &str, value: f64, at: usize, time_s: f64) -> QualityNote {
    let message = format!(
        "{name} is {value:e} in sample {} (t = {} s): no sensor gives such a value; remove the row or correct the value",
        at + 1,
        time_s
    );
    QualityNote::blocking(QualityKind::UnitMixUp, message, [("value", value), ("limit", MAX_VALUE)])
}

/// Longest run of equal forces that is accepted while the needle moves.
const MAX_RUN_SAMPLES: usize = 20;
/// Least motion during such a run, as a share of the total travel.
const MIN_MOTION_SHARE: f64 = 0.01;
/// Share of distinct values below which the force is quantised, so that equal neighbours are normal.
const MIN_DISTINCT_SHARE: f64 = 0.2;

/// A force that is constant at a value other than its extremes (saturation) and zero (no contact).
pub(super) fn stuck_force<A: SampleStream>(
    recording: &A,
    sorted: &A::Sorted,
    extent: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let (mut distinct, mut last) = (0_usize, None);
    sorted.for_each(|x| distinct += usize::from(last.replace(x) != Some(x)))?;
    if (distinct as f64) < MIN_DISTINCT_SHARE * recording.len() as f64 {
        return Ok(None);
    }
    let (least, most) = extent.force_n;
    let travel_m = extent.position_m.1 - extent.position_m.0;
    let (mut intervals, mut longest, mut at_s, mut value) = (0_u32, 0, 0.0, 0.0);
    for_each_constant_run(recording, |run| {
        let inside = run.force_n != least && run.force_n != most && run.force_n != 0.0;
        let moved_m = run.position_range_m.1 - run.position_range_m.0;
        if run.samples > MAX_RUN_SAMPLES && inside && moved_m > MIN_MOTION_SHARE * travel_m {
            intervals += 1;
            if run.samples > longest {
                (longest, at_s, value) = (run.samples, run.start_s, run.force_n);
            }
        }
    })?;
    Ok((intervals > 0).then(|| {
        let message = format!(
            "the force stays at {value:.4} N for {longest} samples from t = {at_s:.4} s while the needle moves ({intervals} such \
             interval(s)): the logger probably repeated its last value; cut the interval out or record again"
        );
        let numbers =
            [("runs", f64::from(intervals)), ("longest", longest as f64), ("at_s", at_s), ("value", value)];
        QualityNote::new(QualityKind::Stuck, message, numbers)
    }))
}

/// Least decrease of a reversed force in units of its noise.
const MIN_DECREASE_SD: f64 = 8.0;
/// Least decrease in units of the increase.
const MIN_DECREASE_RATIO: f64 = 3.0;
/// Most correlation of force and depth during advance.
const MAX_CORRELATION: f64 = -0.3;
/// Share of the samples at the beginning whose median is the force in air.
const AIR_SHARE: f64 = 0.02;

/// A force that decreases while the needle advances.
pub(super) fn reversed_force<A: SampleStream>(recording: &A) -> Result<Option<QualityNote>, A::Error> {
    let rest_n = rest_n(recording)?;
    let mut count = 0_usize;
    for_each_advancing(recording, |_, _| count += 1)?;
    if count < MIN_SAMPLES {
        return Ok(None);
    }
    let of = quantiles_of_stream(&[0.98, 0.02], |take| {
        for_each_advancing(recording, |_, force_n| take(force_n - rest_n))
    })?;
    let (right_n, wrong_n) = match of[..] {
        [most, least] => (most.max(0.0), -least),
        _ => return Ok(None),
    };
    let middle_n = median(|take| for_each_advancing(recording, |_, force_n| take(force_n)))?;
    let least_n = MIN_DECREASE_SD * noise_n(recording)?;
    let is_reversed = wrong_n > least_n && wrong_n > MIN_DECREASE_RATIO * right_n && middle_n < 0.0;
    if !(is_reversed && correlation(recording, count as f64)? < MAX_CORRELATION) {
        return Ok(None);
    }
    let message = format!(
        "the force has the wrong sign: it falls by {wrong_n:.4} N while the needle advances, and should be positive when it resists \
         the insertion; reverse the sign of the scale of its `force` in a column map (`scale: -1` for newtons, `scale: -1000` for kilonewtons)"
    );
    let numbers = [("wrong_n", wrong_n), ("right_n", right_n)];
    Ok(Some(QualityNote::blocking(QualityKind::Reversed, message, numbers)))
}

/// Median force of the first samples.
pub(super) fn rest_n<A: SampleStream>(recording: &A) -> Result<f64, A::Error> {
    let samples = recording.len();
    let first = ((AIR_SHARE * samples as f64) as usize).clamp(5, samples.max(5));
    median(|take| {
        let mut left = first;
        recording.for_each_value(Quantity::Force, |force_n| {
            if left > 0 {
                left -= 1;
                take(force_n);
            }
        })
    })
}

/// Calls `each` with position and force of the samples at which the needle advances.
fn for_each_advancing<A: SampleStream>(
    recording: &A,
    mut each: impl FnMut(f64, f64),
) -> Result<(), A::Error> {
    let mut before_m = f64::NAN;
    recording.for_each_block([Quantity::Position, Quantity::Force], |[position_m, force_n]| {
        for (&position_m, &force_n) in position_m.iter().zip(force_n) {
            if position_m > before_m {
                each(position_m, force_n);
            }
            before_m = position_m;
        }
    })
}

fn median<E>(pass: impl FnMut(&mut dyn FnMut(f64)) -> Result<(), E>) -> Result<f64, E> {
    Ok(quantiles_of_stream(&[0.5], pass)?.first().copied().unwrap_or(f64::NAN))
}

/// Standard deviation of the noise from the median difference of consecutive samples, which motion and ruptures hardly affect.
pub(super) fn noise_n<A: SampleStream>(recording: &A) -> Result<f64, A::Error> {
    let step_n =
        median(|take| recording.for_each_pair(Quantity::Force, |before, now| take((now - before).abs())))?;
    Ok(step_n * stylet_stats::MAD_TO_SD / core::f64::consts::SQRT_2)
}

/// Correlation of position and force over the `n` advancing samples.
fn correlation<A: SampleStream>(recording: &A, n: f64) -> Result<f64, A::Error> {
    let (mut sum_z, mut sum_f) = (0.0, 0.0);
    for_each_advancing(recording, |z, f| {
        sum_z += z;
        sum_f += f;
    })?;
    let (mean_z, mean_f) = (sum_z / n, sum_f / n);
    let (mut zz, mut ff, mut zf) = (0.0, 0.0, 0.0);
    for_each_advancing(recording, |z, f| {
        let (dz, df) = (z - mean_z, f - mean_f);
        zz += dz * dz;
        ff += df * df;
        zf += dz * df;
    })?;
    Ok(zf / (zz * ff).sqrt().max(f64::MIN_POSITIVE))
}

/// Shortest averaging interval (s).
const MIN_INTERVAL_S: f64 = 0.1;
/// Least number of intervals.
const MIN_INTERVALS: usize = 24;
/// Von Neumann ratio, squared differences of consecutive means over squared deviations from their mean: 2 for noise, near 0 for a force that goes
/// up and down with the insertion; noise in 24 intervals is below this in one of a thousand recordings.
const MIN_NOISE_RATIO: f64 = 1.0;

/// A force that is noise at every time scale: no contact with tissue.
pub(super) fn only_in_air_note<A: SampleStream>(
    recording: &A,
    extent: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let least = ((MIN_INTERVAL_S / extent.median_interval_s).ceil().max(1.0) as usize).max(1);
    let mut intervals = recording.len() / least;
    if intervals < MIN_INTERVALS || recording.duration_s()? < MIN_INTERVAL_S * MIN_INTERVALS as f64 {
        return Ok(None);
    }
    // Intervals, pairs of intervals, pairs of pairs ...
    let mut levels = Vec::new();
    while intervals >= MIN_INTERVALS {
        levels.push(VonNeumannRatio::default());
        intervals /= 2;
    }
    interval_means(recording, least, levels.len(), |level, mean| levels[level].first(mean))?;
    interval_means(recording, least, levels.len(), |level, mean| levels[level].second(mean))?;
    if levels.iter().any(|level| level.ratio() < MIN_NOISE_RATIO) {
        return Ok(None);
    }
    let of = quantiles_of_stream(&[0.05, 0.95], |take| recording.for_each_value(Quantity::Force, take))?;
    let [low, high] = of[..] else { return Ok(None) };
    let message = format!(
        "the force stays within {low:.4} N and {high:.4} N and is only noise, as in air: there is no contact, or the sensor \
         does not measure it; check that this is an insertion and that the force comes from its sensor"
    );
    let numbers = [("low_n", low), ("high_n", high)];
    Ok(Some(QualityNote::blocking(QualityKind::InAir, message, numbers)))
}

/// Calls `each` with the mean force of every interval of `samples` samples (level 0), of every two of them (level 1), and
/// so on.
fn interval_means<A: SampleStream>(
    recording: &A,
    samples: usize,
    levels: usize,
    mut each: impl FnMut(usize, f64),
) -> Result<(), A::Error> {
    let (mut count, mut sum) = (0, 0.0);
    // The first of two means, until the second is complete.
    let mut halves: Vec<Option<f64>> = vec![None; levels];
    recording.for_each_value(Quantity::Force, |force_n| {
        sum += force_n;
        count += 1;
        if count == samples {
            let mut mean = sum / samples as f64;
            (count, sum) = (0, 0.0);
            for (level, half) in halves.iter_mut().enumerate() {
                each(level, mean);
                match half.take() {
                    Some(first) => mean = (first + mean) / 2.0,
                    None => {
                        *half = Some(mean);
                        break;
                    }
                }
            }
        }
    })
}

/// Von Neumann ratio, computed in two passes.
#[derive(Clone, Debug, Default)]
struct VonNeumannRatio {
    count: usize,
    sum: f64,
    before: Option<f64>,
    steps: f64,
    all: f64,
}

impl VonNeumannRatio {
    fn first(&mut self, x: f64) {
        self.count += 1;
        self.sum += x;
    }

    fn second(&mut self, x: f64) {
        if let Some(before) = self.before.replace(x) {
            self.steps += (x - before).powi(2);
        }
        self.all += (x - self.sum / self.count as f64).powi(2);
    }

    fn ratio(&self) -> f64 {
        let n = self.count as f64;
        if self.all > 0.0 { self.steps / self.all * n / (n - 1.0) } else { 2.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::assess;
    use super::*;
    use crate::error::RecordError;
    use crate::recording::Recording;
    use crate::test_noise::uniform;

    /// Normal noise, the same every time.
    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut uniform = uniform(seed);
        (0..n).map(|_| (0..12).map(|_| uniform()).sum::<f64>()).collect()
    }

    /// Ten seconds at 200 Hz: 2 s in air, into the tissue with a rupture, back out; noise of `sd` N.
    fn insertion(sd: f64, change: impl Fn(f64) -> f64) -> Result<Recording, RecordError> {
        let time_s: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.005).collect();
        let position_m: Vec<f64> =
            time_s.iter().map(|t| if *t < 6.0 { 0.004 * t } else { 0.024 - 0.006 * (t - 6.0) }).collect();
        let load = |t: f64| match t {
            t if t < 2.0 => 0.0,
            t if t < 4.5 => 0.8 * (t - 2.0),
            t if t < 6.0 => 0.9 + 0.4 * (t - 4.5),
            t => -0.3 * (1.0 - (t - 6.0) / 4.0),
        };
        let force_n = time_s.iter().zip(noise(2000, 1)).map(|(t, e)| change(load(*t) + sd * e)).collect();
        Recording::new(time_s, position_m, force_n)
    }

    fn kinds(recording: &Recording) -> Vec<QualityKind> {
        assess(recording).iter().filter(|note| note.blocking).map(|note| note.kind).collect()
    }

    #[test]
    fn a_good_insertion_has_no_blocking_note_whatever_its_noise_bias_and_gain() -> Result<(), RecordError> {
        for sd in [0.0, 0.001, 0.02, 0.2] {
            for (bias, gain) in [(0.0, 1.0), (-3.0, 1.0), (2.0, 0.01), (-0.1, 20.0)] {
                let recording = insertion(sd, |f| gain * f + bias)?;
                assert_eq!(kinds(&recording), [], "noise {sd}, bias {bias}, gain {gain}");
            }
        }
        Ok(())
    }

    #[test]
    fn dead_reversed_and_millimetre_recordings_are_reported_with_a_remedy() -> Result<(), RecordError> {
        let dead = insertion(0.02, |_| 0.0)?;
        assert_eq!(kinds(&dead), [QualityKind::Dead]);
        assert_eq!(kinds(&insertion(0.02, |_| 1.25)?), [QualityKind::Dead], "a constant level is dead, too");
        let reversed = insertion(0.02, |f| -f)?;
        assert_eq!(kinds(&reversed), [QualityKind::Reversed]);
        assert_eq!(kinds(&insertion(0.02, |f| -2.0 - f)?), [QualityKind::Reversed], "with a bias");
        for recording in [dead, reversed] {
            let note = assess(&recording).into_iter().find(|note| note.blocking).expect("a blocking note");
            assert!(note.message.contains("column map"), "{}", note.message);
        }
        let good = insertion(0.02, |f| f)?;
        let metres = good.position_m.iter().map(|z| z * 1e3).collect();
        let scaled = Recording::new(good.time_s, metres, good.force_n)?;
        assert!(kinds(&scaled).iter().all(|kind| *kind == QualityKind::UnitMixUp), "{:?}", kinds(&scaled));
        assert!(!kinds(&scaled).is_empty());
        Ok(())
    }

    #[test]
    fn noise_alone_is_in_air_be_it_white_autocorrelated_or_quantised() -> Result<(), RecordError> {
        let still = insertion(0.0, |_| 0.0)?;
        let mut pole = 0.0;
        let autocorrelated = noise(2000, 3).into_iter().map(|e| {
            pole = 0.6 * pole + 0.02 * e;
            pole
        });
        let coarse = noise(2000, 4).into_iter().map(|e| (e * 0.8).round() * 0.05);
        for (what, force_n) in [
            ("white", noise(2000, 2).into_iter().map(|e| 0.3 + 0.02 * e).collect::<Vec<f64>>()),
            ("autocorrelated", autocorrelated.collect()),
            ("coarse", coarse.collect()),
        ] {
            let air = Recording::new(still.time_s.clone(), still.position_m.clone(), force_n)?;
            assert_eq!(kinds(&air), [QualityKind::InAir], "{what}");
        }
        Ok(())
    }

    #[test]
    fn a_needle_at_rest_and_three_samples_are_refused() -> Result<(), RecordError> {
        let good = insertion(0.02, |f| f)?;
        let rest = Recording::new(good.time_s.clone(), vec![0.01; good.len()], good.force_n.clone())?;
        assert_eq!(kinds(&rest), [QualityKind::Stuck]);
        let three = Recording::new(vec![0.0, 0.01, 0.02], vec![0.0, 0.001, 0.002], vec![0.0, 0.1, 0.2])?;
        assert_eq!(kinds(&three), [QualityKind::TooShort]);
        Ok(())
    }

    #[test]
    fn a_logger_that_repeats_its_last_value_is_reported_and_not_refused() -> Result<(), RecordError> {
        let mut recording = insertion(0.02, |f| f)?;
        let frozen = recording.force_n[700];
        recording.force_n[700..800].fill(frozen);
        let notes = assess(&recording);
        let note =
            notes.iter().find(|note| note.kind == QualityKind::Stuck).expect("half a second stands still");
        assert!(!note.blocking && note.numbers["longest"] == 100.0, "{}", note.message);
        assert_eq!(
            assess(&insertion(0.02, |f| f)?).iter().filter(|n| n.kind == QualityKind::Stuck).count(),
            0
        );
        Ok(())
    }

    #[test]
    fn a_recording_that_starts_under_load_and_unloads_is_not_reversed() -> Result<(), RecordError> {
        // Under load from the start, one rupture after the other, no advance left at the end.
        let good = insertion(0.02, |f| f)?;
        let force_n =
            good.time_s.iter().zip(noise(2000, 9)).map(|(t, e)| 2.0 - 0.18 * t + 0.02 * e).collect();
        let falling = Recording::new(good.time_s, good.position_m, force_n)?;
        assert_eq!(kinds(&falling), []);
        Ok(())
    }
}
