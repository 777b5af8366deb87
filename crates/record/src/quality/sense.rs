//! Recordings from which no cause may be named: a dead or reversed sensor, a needle that stays in the air or does not move,
//! too few samples.

use super::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::{extremes, median_of, quantile_of};

/// Fewest samples from which anything about a tissue can be told.
pub const LEAST_SAMPLES: usize = 50;

pub(super) fn too_short(samples: usize) -> Option<QualityNote> {
    (samples < LEAST_SAMPLES).then(|| {
        let message = format!("there are {samples} usable sample(s); a diagnosis needs at least {LEAST_SAMPLES}: record the whole insertion");
        QualityNote::forbidding(QualityKind::TooShort, message, [("samples", samples as f64), ("least", LEAST_SAMPLES as f64)])
    })
}

/// A force that varies by less than this share of itself (or than this many newtons) comes from no sensor that works.
const NOTHING: f64 = 1e-9;

pub(super) fn dead(recording: &Recording) -> Option<QualityNote> {
    let (low, high) = extremes(&recording.force_n);
    (high - low <= NOTHING * high.abs().max(low.abs()).max(1.0)).then(|| {
        let message = format!(
            "the force stands at {high} N in all {} samples, without any noise: the sensor was off or not connected, or this is \
             another column; check the cable and the column map, and record again",
            recording.len()
        );
        QualityNote::forbidding(QualityKind::Dead, message, [("value", high)])
    })
}

/// A needle that travels less than this (m) was not inserted.
const STILL_M: f64 = 1e-6;

pub(super) fn still(recording: &Recording) -> Option<QualityNote> {
    let (low, high) = extremes(&recording.position_m);
    (high - low < STILL_M).then(|| {
        let message = format!(
            "the position stands at {high} m: the needle does not move, or this is another column; check the encoder and the column map"
        );
        QualityNote::forbidding(QualityKind::Stuck, message, [("value", high), ("travel_m", high - low)])
    })
}

/// No sensor gives such a number, in any unit.
const UNMEASURABLE: f64 = 1e12;

/// Values like 1e300, which finite arithmetic does not survive.
pub(super) fn unmeasurable(recording: &Recording) -> Option<QualityNote> {
    let columns = [
        ("force_n", &recording.force_n),
        ("position_m", &recording.position_m),
        ("velocity_mps", &recording.velocity_mps),
    ];
    let first = |values: &[f64]| values.iter().position(|x| x.abs() > UNMEASURABLE);
    let (name, at, value) =
        columns.iter().find_map(|(name, values)| first(values).map(|at| (*name, at, values[at])))?;
    let message = format!(
        "{name} is {value:e} in sample {} (t = {} s): no sensor gives that; remove the row or correct the value",
        at + 1,
        recording.time_s[at]
    );
    Some(QualityNote::forbidding(
        QualityKind::UnitMixUp,
        message,
        [("value", value), ("limit", UNMEASURABLE)],
    ))
}

/// Longest run of equal forces that passes while the needle moves.
const LONGEST_RUN: usize = 20;
/// ... by this share of its whole travel.
const MOVED: f64 = 0.01;
/// Below this share of distinct values the force is coarse, and equal neighbours mean nothing.
const DISTINCT: f64 = 0.2;

/// A force that freezes at a value that is not its extreme (there it is saturation), and not zero (nothing touches the needle).
pub(super) fn stuck(recording: &Recording) -> Option<QualityNote> {
    let force_n = &recording.force_n;
    let mut distinct = force_n.clone();
    distinct.sort_unstable_by(f64::total_cmp);
    distinct.dedup();
    if (distinct.len() as f64) < DISTINCT * force_n.len() as f64 {
        return None;
    }
    let (least, most) = extremes(force_n);
    let (low_m, high_m) = extremes(&recording.position_m);
    let (mut runs, mut longest, mut at_s, mut value, mut start) = (0_u32, 0, 0.0, 0.0, 0);
    for run in force_n.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        if run.len() > LONGEST_RUN && run[0] != least && run[0] != most && run[0] != 0.0 {
            let (from_m, to_m) = extremes(&recording.position_m[start..end]);
            if to_m - from_m > MOVED * (high_m - low_m) {
                runs += 1;
                if run.len() > longest {
                    (longest, at_s, value) = (run.len(), recording.time_s[start], run[0]);
                }
            }
        }
        start = end;
    }
    (runs > 0).then(|| {
        let message = format!(
            "the force stands still at {value:.4} N for {longest} samples from t = {at_s:.4} s while the needle moves ({runs} such \
             stretch(es)): the logger probably repeated its last value; cut the stretch out or record again"
        );
        let numbers = [("runs", f64::from(runs)), ("longest", longest as f64), ("at_s", at_s), ("value", value)];
        QualityNote::new(QualityKind::Stuck, message, numbers)
    })
}

/// How far above its noise a force must go the wrong way.
const ABOVE_NOISE: f64 = 8.0;
/// ... and how far beyond what goes the right way.
const BEYOND: f64 = 3.0;
/// Correlation of force and depth on the way in below which the force runs the other way.
const CORRELATED: f64 = -0.3;
/// Share of the samples at the beginning whose median is the force in air.
const BEGIN: f64 = 0.02;

/// A force that grows in the negative direction while the needle goes in.
pub(super) fn reversed(recording: &Recording) -> Option<QualityNote> {
    let force_n = &recording.force_n;
    let first = ((BEGIN * force_n.len() as f64) as usize).clamp(5, force_n.len());
    let rest_n = median_of(force_n[..first].iter().copied());
    let in_m = |pair: &[f64]| pair[1] > pair[0];
    let way_in: Vec<usize> =
        (1..recording.len()).filter(|&i| in_m(&recording.position_m[i - 1..=i])).collect();
    if way_in.len() < LEAST_SAMPLES {
        return None;
    }
    let of = |share: f64| quantile_of(way_in.iter().map(|&i| force_n[i] - rest_n), share);
    let (right_n, wrong_n) = (of(0.98).max(0.0), -of(0.02));
    let middle_n = median_of(way_in.iter().map(|&i| force_n[i]));
    let least_n = ABOVE_NOISE * noise_n(force_n);
    let other_way = wrong_n > least_n && wrong_n > BEYOND * right_n && middle_n < 0.0;
    (other_way && correlation(recording, &way_in) < CORRELATED).then(|| {
        let message = format!(
            "the force runs the other way: it falls by {wrong_n:.4} N while the needle goes in, and should be positive when it resists \
             the insertion; give a column map with force: (name: \"force_n\", scale: -1)"
        );
        QualityNote::forbidding(QualityKind::Reversed, message, [("wrong_n", wrong_n), ("right_n", right_n)])
    })
}

/// Standard deviation of the noise from the differences of neighbours: motion and ruptures hardly show in their median.
fn noise_n(force_n: &[f64]) -> f64 {
    median_of(force_n.windows(2).map(|pair| (pair[1] - pair[0]).abs())) * stylet_stats::MAD_TO_SD
        / core::f64::consts::SQRT_2
}

fn correlation(recording: &Recording, at: &[usize]) -> f64 {
    let n = at.len() as f64;
    let mean = |x: &[f64]| at.iter().map(|&i| x[i]).sum::<f64>() / n;
    let (z, f) = (&recording.position_m, &recording.force_n);
    let (mean_z, mean_f) = (mean(z), mean(f));
    let (mut zz, mut ff, mut zf) = (0.0, 0.0, 0.0);
    for &i in at {
        let (dz, df) = (z[i] - mean_z, f[i] - mean_f);
        zz += dz * dz;
        ff += df * df;
        zf += dz * df;
    }
    zf / (zz * ff).sqrt().max(f64::MIN_POSITIVE)
}

/// Shortest stretch (s) whose mean is looked at: slower noise is no contact.
const STRETCH_S: f64 = 0.1;
/// Fewest stretches that tell.
const STRETCHES: usize = 24;
/// Squared differences of neighbouring means over squared deviations from their mean: 2 for noise, near 0 for a force that goes
/// up and down with the insertion; noise of 24 stretches comes below this once in a thousand recordings.
const LIKE_NOISE: f64 = 1.0;

/// A force that is noise at every time scale: the needle touches nothing.
pub(super) fn in_air(recording: &Recording) -> Option<QualityNote> {
    let step_s = recording.median_interval_s();
    let least = ((STRETCH_S / step_s).ceil().max(1.0) as usize).max(1);
    let mut means: Vec<f64> = recording.force_n.chunks_exact(least).map(stylet_stats::mean).collect();
    if means.len() < STRETCHES || recording.duration_s() < STRETCH_S * STRETCHES as f64 {
        return None;
    }
    while means.len() >= STRETCHES {
        if neumann(&means) < LIKE_NOISE {
            return None;
        }
        means = means.chunks_exact(2).map(stylet_stats::mean).collect();
    }
    let (low, high) = (
        quantile_of(recording.force_n.iter().copied(), 0.05),
        quantile_of(recording.force_n.iter().copied(), 0.95),
    );
    let message = format!(
        "the force stays within {low:.4} N and {high:.4} N and is nothing but noise, as in air: the needle touches nothing, or the \
         sensor does not feel it; check that this is an insertion and that the force comes from its sensor"
    );
    Some(QualityNote::forbidding(QualityKind::InAir, message, [("low_n", low), ("high_n", high)]))
}

/// Von Neumann's ratio.
fn neumann(x: &[f64]) -> f64 {
    let middle = stylet_stats::mean(x);
    let steps: f64 = x.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    let all: f64 = x.iter().map(|x| (x - middle).powi(2)).sum();
    if all > 0.0 { steps / all * x.len() as f64 / (x.len() - 1) as f64 } else { 2.0 }
}

#[cfg(test)]
mod tests {
    use super::super::assess;
    use super::*;
    use crate::error::RecordError;

    /// Numbers spread as noise, the same every time.
    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
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
        assess(recording).iter().filter(|note| note.grave).map(|note| note.kind).collect()
    }

    #[test]
    fn a_good_insertion_is_grave_in_nothing_whatever_its_noise_bias_and_size() -> Result<(), RecordError> {
        for sd in [0.0, 0.001, 0.02, 0.2] {
            for (bias, gain) in [(0.0, 1.0), (-3.0, 1.0), (2.0, 0.01), (-0.1, 20.0)] {
                let recording = insertion(sd, |f| gain * f + bias)?;
                assert_eq!(kinds(&recording), [], "noise {sd}, bias {bias}, gain {gain}");
            }
        }
        Ok(())
    }

    #[test]
    fn a_dead_a_reversed_and_a_millimetre_recording_have_one_name_and_one_remedy_each()
    -> Result<(), RecordError> {
        let dead = insertion(0.02, |_| 0.0)?;
        assert_eq!(kinds(&dead), [QualityKind::Dead]);
        assert_eq!(
            kinds(&insertion(0.02, |_| 1.25)?),
            [QualityKind::Dead],
            "a level that never changes is as dead"
        );
        let reversed = insertion(0.02, |f| -f)?;
        assert_eq!(kinds(&reversed), [QualityKind::Reversed]);
        assert_eq!(kinds(&insertion(0.02, |f| -2.0 - f)?), [QualityKind::Reversed], "with a bias");
        for recording in [dead, reversed] {
            let note = assess(&recording).into_iter().find(|note| note.grave).expect("it is grave");
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
    fn noise_alone_is_air_be_it_white_coloured_or_coarse() -> Result<(), RecordError> {
        let still = insertion(0.0, |_| 0.0)?;
        let mut pole = 0.0;
        let coloured = noise(2000, 3).into_iter().map(|e| {
            pole = 0.6 * pole + 0.02 * e;
            pole
        });
        let coarse = noise(2000, 4).into_iter().map(|e| (e * 0.8).round() * 0.05);
        for (what, force_n) in [
            ("white", noise(2000, 2).into_iter().map(|e| 0.3 + 0.02 * e).collect::<Vec<f64>>()),
            ("coloured", coloured.collect()),
            ("coarse", coarse.collect()),
        ] {
            let air = Recording::new(still.time_s.clone(), still.position_m.clone(), force_n)?;
            assert_eq!(kinds(&air), [QualityKind::InAir], "{what}");
        }
        Ok(())
    }

    #[test]
    fn a_needle_at_rest_and_three_samples_are_told() -> Result<(), RecordError> {
        let good = insertion(0.02, |f| f)?;
        let rest = Recording::new(good.time_s.clone(), vec![0.01; good.len()], good.force_n.clone())?;
        assert_eq!(kinds(&rest), [QualityKind::Stuck]);
        let three = Recording::new(vec![0.0, 0.01, 0.02], vec![0.0, 0.001, 0.002], vec![0.0, 0.1, 0.2])?;
        assert_eq!(kinds(&three), [QualityKind::TooShort]);
        Ok(())
    }

    #[test]
    fn a_logger_that_repeats_its_last_value_is_told_and_stops_nothing() -> Result<(), RecordError> {
        let mut recording = insertion(0.02, |f| f)?;
        let frozen = recording.force_n[700];
        recording.force_n[700..800].fill(frozen);
        let notes = assess(&recording);
        let note =
            notes.iter().find(|note| note.kind == QualityKind::Stuck).expect("half a second stands still");
        assert!(!note.grave && note.numbers["longest"] == 100.0, "{}", note.message);
        assert_eq!(
            assess(&insertion(0.02, |f| f)?).iter().filter(|n| n.kind == QualityKind::Stuck).count(),
            0
        );
        Ok(())
    }

    #[test]
    fn a_recording_that_begins_in_the_tissue_and_lets_go_is_not_reversed() -> Result<(), RecordError> {
        // Under load from the start, one rupture after the other, no advance left at the end.
        let good = insertion(0.02, |f| f)?;
        let force_n =
            good.time_s.iter().zip(noise(2000, 9)).map(|(t, e)| 2.0 - 0.18 * t + 0.02 * e).collect();
        let falling = Recording::new(good.time_s, good.position_m, force_n)?;
        assert_eq!(kinds(&falling), []);
        Ok(())
    }
}
