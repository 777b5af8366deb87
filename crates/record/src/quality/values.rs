//! Saturation, spikes and quantisation of the measured values.

use super::constant_runs::for_each_constant_run;
use super::{Extent, QualityKind, QualityNote};
use crate::sample_stream::{Quantity, SampleStream, SortedValues};
use stylet_stats::{MAD_TO_SD, median_of, quantiles_of_stream};

/// Shortest run of equal extremes that counts towards saturation.
const SHORT_RUN: usize = 5;
/// A single run needs so many samples.
const LONG_RUN: usize = 20;
/// ... while the needle moves by this share of its whole travel.
const MOVED: f64 = 0.01;

pub(super) fn saturation<A: SampleStream>(
    recording: &A,
    facts: &Extent,
) -> Result<Vec<QualityNote>, A::Error> {
    let (low, high) = facts.force_n;
    let mut notes = Vec::new();
    if low == high {
        return Ok(notes);
    }
    for (which, value) in [("largest", high), ("smallest", low)] {
        if value != 0.0 {
            notes.extend(saturated_at(recording, which, value, facts)?);
        }
    }
    Ok(notes)
}

fn saturated_at<A: SampleStream>(
    recording: &A,
    which: &str,
    value: f64,
    facts: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let travel_m = facts.position_m.1 - facts.position_m.0;
    let (mut stretches, mut samples, mut all, mut longest, mut at_s, mut moved) =
        (0_u32, 0, 0, 0, 0.0, false);
    for_each_constant_run(recording, |run| {
        if run.force_n != value {
            return;
        }
        all += run.samples;
        if run.samples >= SHORT_RUN {
            stretches += 1;
            samples += run.samples;
        }
        if run.samples >= LONG_RUN {
            moved |= run.position_range_m.1 - run.position_range_m.0 > MOVED * travel_m;
        }
        if run.samples > longest {
            (longest, at_s) = (run.samples, run.start_s);
        }
    })?;
    let several = stretches >= 2 && 2 * samples > all;
    Ok((several || moved).then(|| {
        let message = format!(
            "the force stays at its {which} value {value:.4} N in {stretches} run(s) of five or more samples (the longest: \
             {longest}, from t = {at_s:.4} s): the sensor is probably saturated there"
        );
        let numbers = [
            ("value", value),
            ("runs", f64::from(stretches)),
            ("samples", samples as f64),
            ("longest", longest as f64),
            ("at_s", at_s),
        ];
        QualityNote::new(QualityKind::Saturation, message, numbers)
    }))
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

pub(super) fn spikes<A: SampleStream>(
    recording: &A,
    what: &str,
    unit: &str,
    which: Quantity,
) -> Result<Option<QualityNote>, A::Error> {
    if recording.len() < WINDOW {
        return Ok(None);
    }
    let off =
        quantiles_of_stream(&[0.5], |take| from_neighbours(recording, which, |_, away| take(away.abs())))?;
    let ends = quantiles_of_stream(&[0.05, 0.95], |take| recording.for_each_value(which, take))?;
    let ([off], [low, high]) = (&off[..], &ends[..]) else { return Ok(None) };
    let robust_sd = (off * MAD_TO_SD).max(LEAST_SD * (high - low));
    let limit = SPIKE_SD * robust_sd;
    let mut found = Found::default();
    let mut recent = Recent { limit, samples: recording.len(), ring: [(0.0, 0.0); RECENT] };
    let mut sample = 0;
    from_neighbours(recording, which, |value, away| {
        recent.ring[sample % RECENT] = (value, away);
        if sample >= AHEAD {
            recent.judge(sample - AHEAD, &mut found);
        }
        sample += 1;
    })?;
    (sample.saturating_sub(AHEAD)..sample).for_each(|sample| recent.judge(sample, &mut found));
    let Found { count, largest, at } = found;
    if count == 0 {
        return Ok(None);
    }
    let at_s = recording.at(Quantity::Time, at)?;
    let message = format!(
        "{what}: {count} isolated sample(s) stand out from their neighbours, the farthest by {largest:.4e} {unit} at \
         t = {at_s:.4} s ({:.0} times the noise); electric disturbance or lost bits?",
        largest.abs() / robust_sd
    );
    let numbers =
        [("count", f64::from(count)), ("largest", largest), ("at_s", at_s), ("robust_sd", robust_sd)];
    Ok(Some(QualityNote::new(QualityKind::Spikes, message, numbers)))
}

/// Samples that a spike is judged by behind its first.
const AHEAD: usize = LONGEST_SPIKE + SIDE;
/// Samples at hand: those, the spike and those before.
const RECENT: usize = 16;

/// Spikes found so far.
#[derive(Debug, Default)]
struct Found {
    count: u32,
    largest: f64,
    at: usize,
}

/// The newest samples, each with its distance from the median around it.
struct Recent {
    limit: f64,
    /// Samples of the whole recording.
    samples: usize,
    ring: [(f64, f64); RECENT],
}

impl Recent {
    fn away(&self, sample: usize) -> f64 {
        self.ring[sample % RECENT].1
    }

    /// Samples of one kind lie together: near, far above or far below.
    fn alike(&self, a: usize, b: usize) -> bool {
        let (a, b) = (self.away(a), self.away(b));
        (a.abs() > self.limit) == (b.abs() > self.limit) && (a > 0.0) == (b > 0.0)
    }

    /// Whether a spike begins at the sample.
    #[inline]
    fn judge(&self, start: usize, found: &mut Found) {
        if self.away(start).abs() <= self.limit || start < SIDE || self.alike(start - 1, start) {
            return;
        }
        let mut end = start + 1;
        while end < self.samples && end - start <= LONGEST_SPIKE && self.alike(start, end) {
            end += 1;
        }
        if end - start > LONGEST_SPIKE || end + SIDE > self.samples {
            return;
        }
        let around: Vec<f64> = (start - SIDE..end + SIDE).map(|at| self.ring[at % RECENT].0).collect();
        if !stands_out(&around, self.limit) {
            return;
        }
        for at in start..end {
            found.count += 1;
            if self.away(at).abs() > found.largest.abs() {
                (found.largest, found.at) = (self.away(at), at);
            }
        }
    }
}

/// Whether samples, given with [`SIDE`] neighbours on both sides, lie beyond the limit from both sides, in the same direction, by
/// more than the surroundings move in a few samples and by more than the level changes from one side to the other: neither
/// the peak before a rupture's drop nor the overshoot after it is a spike.
fn stands_out(around: &[f64], limit: f64) -> bool {
    let (before, rest) = around.split_at(SIDE);
    let (run, after) = rest.split_at(rest.len() - SIDE);
    let step = median_of(before.windows(2).chain(after.windows(2)).map(|pair| (pair[1] - pair[0]).abs()));
    let (before, after) =
        (median_of(before[SIDE - 3..].iter().copied()), median_of(after[..3].iter().copied()));
    let limit = limit.max(STEPS * step).max((after - before).abs());
    run.iter().all(|value| value - before > limit && value - after > limit)
        || run.iter().all(|value| before - value > limit && after - value > limit)
}

/// Samples whose median a sample is held against.
const WINDOW: usize = 2 * SIDE + 1;

/// Hands over every value with its distance from the median of the eleven samples around it (at the ends: of the eleven nearest the
/// end).
fn from_neighbours<A: SampleStream>(
    recording: &A,
    which: Quantity,
    mut each: impl FnMut(f64, f64),
) -> Result<(), A::Error> {
    // The window in the order of time, from `next` on, and in ascending order.
    let (mut window, mut sorted, mut next, mut filled) = ([0.0_f64; WINDOW], [0.0_f64; WINDOW], 0, 0);
    recording.for_each_value(which, |x| {
        if filled < WINDOW {
            window[filled] = x;
            filled += 1;
            if filled == WINDOW {
                sorted = window;
                sorted.sort_unstable_by(f64::total_cmp);
                window[..=SIDE].iter().for_each(|x| each(*x, x - sorted[SIDE]));
            }
            return;
        }
        let old = std::mem::replace(&mut window[next], x);
        next = (next + 1) % WINDOW;
        exchange(&mut sorted, old, x);
        let centre = window[(next + SIDE) % WINDOW];
        each(centre, centre - sorted[SIDE]);
    })?;
    if filled == WINDOW {
        (SIDE + 1..WINDOW).map(|k| window[(next + k) % WINDOW]).for_each(|x| each(x, x - sorted[SIDE]));
    }
    Ok(())
}

/// Puts a number in the place of another, in ascending order.
#[inline]
fn exchange(sorted: &mut [f64; WINDOW], old: f64, new: f64) {
    let mut at = sorted.iter().position(|x| x.to_bits() == old.to_bits()).unwrap_or(0);
    while at + 1 < WINDOW && sorted[at + 1].total_cmp(&new).is_lt() {
        sorted[at] = sorted[at + 1];
        at += 1;
    }
    while at > 0 && sorted[at - 1].total_cmp(&new).is_gt() {
        sorted[at] = sorted[at - 1];
        at -= 1;
    }
    sorted[at] = new;
}

/// Fewest samples from which a grid of values means anything.
const LEAST_SAMPLES: usize = 100;
/// Share of distinct values below which a column is suspected.
const DISTINCT: f64 = 0.2;
/// Share of the steps that must be multiples of the smallest one (to 2 % of it).
const ON_GRID: f64 = 0.9;

/// `sorted` are the values in ascending order.
pub(super) fn quantisation<K: SortedValues>(
    sorted: &K,
    what: &str,
    unit: &str,
) -> Result<Option<QualityNote>, K::Error> {
    let samples = sorted.len();
    if samples < LEAST_SAMPLES {
        return Ok(None);
    }
    let (mut low, mut high) = (None, f64::NAN);
    sorted.for_each(|x| {
        low.get_or_insert(x);
        high = x;
    })?;
    let whole = high - low.unwrap_or(f64::NAN);
    let steps = |each: &mut dyn FnMut(f64)| {
        let mut kept: Option<f64> = None;
        sorted.for_each(|x| match kept {
            // Values that rounding alone tells apart are one value.
            Some(before) if x - before <= 1e-9 * whole => {}
            before => {
                if let Some(before) = before {
                    each(x - before);
                }
                kept = Some(x);
            }
        })
    };
    let (mut distinct, mut step) = (1_usize, f64::NAN);
    steps(&mut |wide| {
        distinct += 1;
        step = step.min(wide);
    })?;
    let ratio = distinct as f64 / samples as f64;
    if distinct < 2 || ratio >= DISTINCT {
        return Ok(None);
    }
    let mut on_grid = 0_usize;
    steps(&mut |wide| on_grid += usize::from((wide / step - (wide / step).round()).abs() < 0.02))?;
    Ok((on_grid as f64 >= ON_GRID * (distinct - 1) as f64).then(|| {
        let message = format!(
            "{what}: the values come in steps of {step:.4e} {unit} ({distinct} different ones in {samples} samples); smaller \
             changes do not show"
        );
        let numbers = [("smallest_step", step), ("distinct", distinct as f64), ("distinct_ratio", ratio)];
        QualityNote::new(QualityKind::Quantisation, message, numbers)
    }))
}

#[cfg(test)]
mod tests {
    use super::super::assess;
    use super::*;
    use crate::error::RecordError;
    use crate::recording::Recording;

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

    fn of_kind(kind: QualityKind, force_n: Vec<f64>) -> Result<Vec<QualityNote>, RecordError> {
        Ok(assess(&recording(force_n)?).into_iter().filter(|note| note.kind == kind).collect())
    }

    #[test]
    fn a_noisy_insertion_with_a_rupture_raises_no_doubt() -> Result<(), RecordError> {
        assert_eq!(of_kind(QualityKind::Saturation, force_n())?, []);
        assert_eq!(of_kind(QualityKind::Spikes, force_n())?, []);
        assert_eq!(
            of_kind(QualityKind::Quantisation, force_n())?
                .iter()
                .filter(|n| n.message.starts_with("force_n"))
                .count(),
            0
        );
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
        assert_eq!(of_kind(QualityKind::Spikes, force_n.clone())?, []);
        assert_eq!(of_kind(QualityKind::Saturation, force_n)?, []);
        Ok(())
    }

    #[test]
    fn a_clipped_force_is_called_saturated_with_its_value() -> Result<(), RecordError> {
        let clipped = force_n().into_iter().map(|f| f.min(3.0)).collect();
        let notes = of_kind(QualityKind::Saturation, clipped)?;
        assert_eq!(notes.len(), 1);
        assert_eq!(notes[0].numbers["value"], 3.0);
        assert!(notes[0].message.contains("largest value 3.0000 N"), "{}", notes[0].message);
        Ok(())
    }

    #[test]
    fn lost_bits_show_as_spikes_with_their_number_and_place() -> Result<(), RecordError> {
        let mut force_n = force_n();
        force_n[300] += 1.5;
        force_n[700] -= 1.0;
        force_n[701] -= 1.0;
        let notes = of_kind(QualityKind::Spikes, force_n)?;
        let note = notes.first().expect("three spiked samples");
        assert_eq!(note.numbers["count"], 3.0);
        assert!((note.numbers["at_s"] - 3.0).abs() < 1e-9, "{}", note.message);
        Ok(())
    }

    #[test]
    fn a_coarse_converter_shows_its_step() -> Result<(), RecordError> {
        let coarse: Vec<f64> = force_n().iter().map(|f| (f / 0.05).round() * 0.05).collect();
        let notes = of_kind(QualityKind::Quantisation, coarse)?;
        let note = notes.first().expect("steps of 0.05 N");
        assert!((note.numbers["smallest_step"] - 0.05).abs() < 1e-9, "{}", note.message);
        Ok(())
    }
}
