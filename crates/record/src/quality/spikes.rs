//! Isolated outlying samples of force or position.

use super::note::{QualityKind, QualityNote};
use crate::sample_stream::{Quantity, SampleStream};
use stylet_stats::{MAD_TO_SD, median_of, quantiles_of_stream};

/// Neighbouring samples on each side.
const SIDE: usize = 5;
/// Least distance from the local median in robust standard deviations.
const SPIKE_SD: f64 = 8.0;
/// Floor of the robust standard deviation as a share of the range, so that corners of noiseless data do not count as spikes.
const MIN_SD_SHARE: f64 = 1e-3;
/// Least size of a spike in median steps around it.
const MIN_SIZE_STEPS: f64 = 4.0;
/// Most samples of a spike.
const MAX_SPIKE_SAMPLES: usize = 2;

pub(super) fn spikes<A: SampleStream>(
    recording: &A,
    what: &str,
    unit: &str,
    which: Quantity,
) -> Result<Option<QualityNote>, A::Error> {
    if recording.len() < WINDOW {
        return Ok(None);
    }
    let off = quantiles_of_stream(&[0.5], |take| {
        for_each_deviation(recording, which, |_, deviation| take(deviation.abs()))
    })?;
    let ends = quantiles_of_stream(&[0.05, 0.95], |take| recording.for_each_value(which, take))?;
    let ([off], [low, high]) = (&off[..], &ends[..]) else { return Ok(None) };
    let robust_sd = (off * MAD_TO_SD).max(MIN_SD_SHARE * (high - low));
    let limit = SPIKE_SD * robust_sd;
    let mut found = SpikesFound::default();
    let mut recent = Recent { limit, samples: recording.len(), ring: [(0.0, 0.0); RING_SIZE] };
    let mut sample = 0;
    for_each_deviation(recording, which, |value, deviation| {
        recent.ring[sample % RING_SIZE] = (value, deviation);
        if sample >= LOOKAHEAD {
            recent.add_spike_starting_at(sample - LOOKAHEAD, &mut found);
        }
        sample += 1;
    })?;
    (sample.saturating_sub(LOOKAHEAD)..sample)
        .for_each(|sample| recent.add_spike_starting_at(sample, &mut found));
    let SpikesFound { count, largest, at } = found;
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

/// Samples after the start of a spike that its test needs.
const LOOKAHEAD: usize = MAX_SPIKE_SAMPLES + SIDE;
/// Size of the ring buffer: the samples before, of and after a spike.
const RING_SIZE: usize = 16;

/// Spikes found so far.
#[derive(Debug, Default)]
struct SpikesFound {
    count: u32,
    largest: f64,
    at: usize,
}

/// The latest samples, each with its distance from the local median.
struct Recent {
    limit: f64,
    /// Number of samples of the recording.
    samples: usize,
    ring: [(f64, f64); RING_SIZE],
}

impl Recent {
    fn deviation(&self, sample: usize) -> f64 {
        self.ring[sample % RING_SIZE].1
    }

    /// Whether two samples are on the same side: near the median, far above or far below.
    fn same_side(&self, a: usize, b: usize) -> bool {
        let (a, b) = (self.deviation(a), self.deviation(b));
        (a.abs() > self.limit) == (b.abs() > self.limit) && (a > 0.0) == (b > 0.0)
    }

    /// Adds the spike that starts at the sample, if there is one.
    #[inline]
    fn add_spike_starting_at(&self, start: usize, found: &mut SpikesFound) {
        if self.deviation(start).abs() <= self.limit || start < SIDE || self.same_side(start - 1, start) {
            return;
        }
        let mut end = start + 1;
        while end < self.samples && end - start <= MAX_SPIKE_SAMPLES && self.same_side(start, end) {
            end += 1;
        }
        if end - start > MAX_SPIKE_SAMPLES || end + SIDE > self.samples {
            return;
        }
        let around: Vec<f64> = (start - SIDE..end + SIDE).map(|at| self.ring[at % RING_SIZE].0).collect();
        if !stands_out(&around, self.limit) {
            return;
        }
        for at in start..end {
            found.count += 1;
            if self.deviation(at).abs() > found.largest.abs() {
                (found.largest, found.at) = (self.deviation(at), at);
            }
        }
    }
}

/// Whether the samples between [`SIDE`] neighbours on both sides differ from both sides in the same direction, by more than
/// the limit, the typical steps around them and the change of level across them. Neither the peak before a rupture nor the
/// overshoot after it is then a spike.
fn stands_out(around: &[f64], limit: f64) -> bool {
    let (before, rest) = around.split_at(SIDE);
    let (run, after) = rest.split_at(rest.len() - SIDE);
    let step = median_of(before.windows(2).chain(after.windows(2)).map(|pair| (pair[1] - pair[0]).abs()));
    let (before, after) =
        (median_of(before[SIDE - 3..].iter().copied()), median_of(after[..3].iter().copied()));
    let limit = limit.max(MIN_SIZE_STEPS * step).max((after - before).abs());
    run.iter().all(|value| value - before > limit && value - after > limit)
        || run.iter().all(|value| before - value > limit && after - value > limit)
}

/// Samples of the local median.
const WINDOW: usize = 2 * SIDE + 1;

/// Calls `each` with every value and its distance from the median of the eleven samples around it (at the ends: of the
/// first or last eleven).
fn for_each_deviation<A: SampleStream>(
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
        replace_in_sorted(&mut sorted, old, x);
        let centre = window[(next + SIDE) % WINDOW];
        each(centre, centre - sorted[SIDE]);
    })?;
    if filled == WINDOW {
        (SIDE + 1..WINDOW).map(|k| window[(next + k) % WINDOW]).for_each(|x| each(x, x - sorted[SIDE]));
    }
    Ok(())
}

/// Replaces a value in an ascending window.
#[inline]
fn replace_in_sorted(sorted: &mut [f64; WINDOW], old: f64, new: f64) {
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
