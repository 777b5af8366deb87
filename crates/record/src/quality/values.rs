//! Saturation, spikes and quantisation of the measured values.

use super::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::{extremes, mad_scale, median, median_of, quantile_of};

/// Shortest run of equal extremes that counts towards saturation.
const SHORT_RUN: usize = 5;
/// A single run needs so many samples.
const LONG_RUN: usize = 20;
/// ... while the needle moves by this share of its whole travel.
const MOVED: f64 = 0.01;

pub(super) fn saturation(recording: &Recording) -> Vec<QualityNote> {
    let (low, high) = extremes(&recording.force_n);
    if low == high {
        return Vec::new();
    }
    [("largest", high), ("smallest", low)]
        .into_iter()
        .filter(|(_, value)| *value != 0.0)
        .filter_map(|(which, value)| saturated_at(recording, which, value))
        .collect()
}

fn saturated_at(recording: &Recording, which: &str, value: f64) -> Option<QualityNote> {
    let force_n = &recording.force_n;
    let (low_m, high_m) = extremes(&recording.position_m);
    let (mut runs, mut samples, mut all, mut longest, mut at_s, mut moved) = (0_u32, 0, 0, 0, 0.0, false);
    let mut start = 0;
    for run in force_n.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        if run[0] == value {
            all += run.len();
            if run.len() >= SHORT_RUN {
                runs += 1;
                samples += run.len();
            }
            if run.len() >= LONG_RUN {
                let (from_m, to_m) = extremes(&recording.position_m[start..end]);
                moved |= to_m - from_m > MOVED * (high_m - low_m);
            }
            if run.len() > longest {
                (longest, at_s) = (run.len(), recording.time_s[start]);
            }
        }
        start = end;
    }
    let several = runs >= 2 && 2 * samples > all;
    (several || moved).then(|| {
        let message = format!(
            "the force stays at its {which} value {value:.4} N in {runs} run(s) of five or more samples (the longest: \
             {longest}, from t = {at_s:.4} s): the sensor is probably saturated there"
        );
        let numbers = [
            ("value", value),
            ("runs", f64::from(runs)),
            ("samples", samples as f64),
            ("longest", longest as f64),
            ("at_s", at_s),
        ];
        QualityNote::new(QualityKind::Saturation, message, numbers)
    })
}

/// Samples on each side of the one that is judged.
const SIDE: usize = 5;
/// Distance from the local median in robust standard deviations.
const SPIKE_SD: f64 = 8.0;
/// Floor of the robust standard deviation, as a share of the range: data without noise have no spikes in their corners.
const LEAST_SD: f64 = 1e-3;
/// A spike is larger than so many typical steps around it.
const STEPS: f64 = 4.0;
/// A longer deviation is a movement, not a spike.
const LONGEST_SPIKE: usize = 2;

pub(super) fn spikes(what: &str, unit: &str, values: &[f64], time_s: &[f64]) -> Option<QualityNote> {
    if values.len() < 2 * SIDE + 1 {
        return None;
    }
    let away: Vec<f64> = (0..values.len()).map(|index| values[index] - local_median(values, index)).collect();
    let sd_of_noise = mad_scale(&mut away.clone());
    let range = quantile_of(values.iter().copied(), 0.95) - quantile_of(values.iter().copied(), 0.05);
    let robust_sd = sd_of_noise.max(LEAST_SD * range);
    let limit = SPIKE_SD * robust_sd;
    let (mut count, mut largest, mut at_s) = (0_u32, 0.0_f64, 0.0);
    let mut start = 0;
    for run in away.chunk_by(|a, b| (a.abs() > limit) == (b.abs() > limit) && (a > &0.0) == (b > &0.0)) {
        let end = start + run.len();
        if run[0].abs() > limit && run.len() <= LONGEST_SPIKE && stands_out(values, start, end, limit) {
            count += run.len() as u32;
            for (index, away) in (start..end).zip(run) {
                if away.abs() > largest.abs() {
                    (largest, at_s) = (*away, time_s[index]);
                }
            }
        }
        start = end;
    }
    (count > 0).then(|| {
        let message = format!(
            "{what}: {count} isolated sample(s) stand out from their neighbours, the farthest by {largest:.4e} {unit} at \
             t = {at_s:.4} s ({:.0} times the noise); electric disturbance or lost bits?",
            largest.abs() / robust_sd
        );
        let numbers = [("count", f64::from(count)), ("largest", largest), ("at_s", at_s), ("robust_sd", robust_sd)];
        QualityNote::new(QualityKind::Spikes, message, numbers)
    })
}

/// Whether the samples `start..end` lie beyond the limit from both sides of their surroundings, in the same direction, by
/// more than the surroundings move in a few samples and by more than the level changes from one side to the other: neither
/// the peak before a rupture's drop nor the overshoot after it is a spike.
fn stands_out(values: &[f64], start: usize, end: usize, limit: f64) -> bool {
    if start < SIDE || end + SIDE > values.len() {
        return false;
    }
    let (before, after) = (&values[start - SIDE..start], &values[end..end + SIDE]);
    let step = median_of(before.windows(2).chain(after.windows(2)).map(|pair| (pair[1] - pair[0]).abs()));
    let (before, after) =
        (median_of(before[SIDE - 3..].iter().copied()), median_of(after[..3].iter().copied()));
    let limit = limit.max(STEPS * step).max((after - before).abs());
    let run = &values[start..end];
    run.iter().all(|value| value - before > limit && value - after > limit)
        || run.iter().all(|value| before - value > limit && after - value > limit)
}

/// Median of the eleven samples around the index (at the ends: of the eleven nearest the end).
fn local_median(values: &[f64], index: usize) -> f64 {
    const WINDOW: usize = 2 * SIDE + 1;
    let first = index.saturating_sub(SIDE).min(values.len() - WINDOW);
    let mut window = [0.0; WINDOW];
    window.copy_from_slice(&values[first..first + WINDOW]);
    median(&mut window)
}

/// Fewest samples from which a grid of values means anything.
const LEAST_SAMPLES: usize = 100;
/// Share of distinct values below which a column is suspected.
const DISTINCT: f64 = 0.2;
/// Share of the steps that must be multiples of the smallest one (to 2 % of it).
const ON_GRID: f64 = 0.9;

pub(super) fn quantisation(what: &str, unit: &str, values: &[f64]) -> Option<QualityNote> {
    if values.len() < LEAST_SAMPLES {
        return None;
    }
    let mut distinct = values.to_vec();
    distinct.sort_unstable_by(f64::total_cmp);
    let whole = distinct[distinct.len() - 1] - distinct[0];
    // Values that rounding alone tells apart are one value.
    distinct.dedup_by(|next, kept| *next - *kept <= 1e-9 * whole);
    let ratio = distinct.len() as f64 / values.len() as f64;
    if distinct.len() < 2 || ratio >= DISTINCT {
        return None;
    }
    let steps: Vec<f64> = distinct.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let (step, _) = extremes(&steps);
    let on_grid = steps.iter().filter(|&&wide| (wide / step - (wide / step).round()).abs() < 0.02).count();
    (on_grid as f64 >= ON_GRID * steps.len() as f64).then(|| {
        let message = format!(
            "{what}: the values come in steps of {step:.4e} {unit} ({} different ones in {} samples); smaller changes \
             do not show",
            distinct.len(),
            values.len()
        );
        let numbers = [("smallest_step", step), ("distinct", distinct.len() as f64), ("distinct_ratio", ratio)];
        QualityNote::new(QualityKind::Quantisation, message, numbers)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;

    fn time_s() -> Vec<f64> {
        (0..1000).map(|i| f64::from(i) * 0.01).collect()
    }

    /// A load that rises to about 5 N, drops to half at rupture (t = 6 s), rises again; noise of 0.01 N sd.
    fn force_n() -> Vec<f64> {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let noise = |uniform: &mut dyn FnMut() -> f64| (0..12).map(|_| uniform()).sum::<f64>() * 0.01;
        let load = |t: f64| {
            if t < 6.0 { t * 0.8 } else { 2.4 + (t - 6.0) * 0.3 }
        };
        time_s().into_iter().map(|t| load(t) + noise(&mut uniform)).collect()
    }

    fn recording(force_n: Vec<f64>) -> Result<Recording, RecordError> {
        Recording::new(time_s(), time_s().iter().map(|t| t * 0.002).collect(), force_n)
    }

    #[test]
    fn a_noisy_insertion_with_a_rupture_raises_no_doubt() -> Result<(), RecordError> {
        assert_eq!(saturation(&recording(force_n())?), vec![]);
        assert_eq!(spikes("force_n", "N", &force_n(), &time_s()), None);
        assert_eq!(quantisation("force_n", "N", &force_n()), None);
        Ok(())
    }

    #[test]
    fn a_noiseless_insertion_with_hold_and_retraction_raises_no_doubt() -> Result<(), RecordError> {
        let profile = |t: f64| match t {
            t if t < 2.0 => 0.0,
            t if t < 6.0 => (t - 2.0) * 1.2,
            t if t < 8.0 => 0.6,
            _ => 0.0,
        };
        let force_n: Vec<f64> = time_s().into_iter().map(profile).collect();
        assert_eq!(spikes("force_n", "N", &force_n, &time_s()), None);
        assert_eq!(saturation(&recording(force_n)?), vec![]);
        Ok(())
    }

    #[test]
    fn a_clipped_force_is_called_saturated_with_its_value() -> Result<(), RecordError> {
        let clipped = force_n().into_iter().map(|f| f.min(3.0)).collect();
        let notes = saturation(&recording(clipped)?);
        assert_eq!(notes.len(), 1);
        assert_eq!(notes[0].numbers["value"], 3.0);
        assert!(notes[0].message.contains("largest value 3.0000 N"), "{}", notes[0].message);
        Ok(())
    }

    #[test]
    fn lost_bits_show_as_spikes_with_their_number_and_place() {
        let mut force_n = force_n();
        force_n[300] += 1.5;
        force_n[700] -= 1.0;
        force_n[701] -= 1.0;
        let note = spikes("force_n", "N", &force_n, &time_s()).expect("three spiked samples");
        assert_eq!(note.numbers["count"], 3.0);
        assert!((note.numbers["at_s"] - 3.0).abs() < 1e-9, "{}", note.message);
    }

    #[test]
    fn a_coarse_converter_shows_its_step() {
        let coarse: Vec<f64> = force_n().iter().map(|f| (f / 0.05).round() * 0.05).collect();
        let note = quantisation("force_n", "N", &coarse).expect("steps of 0.05 N");
        assert!((note.numbers["smallest_step"] - 0.05).abs() < 1e-9, "{}", note.message);
    }
}
