//! Ring buffer of raw samples in storage that the caller provides.

use crate::sample::Sample;

/// Memory for samples.
pub(crate) trait Storage: AsRef<[Sample]> + AsMut<[Sample]> {}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> Storage for B {}

/// Samples with consecutive indices; the oldest are overwritten.
#[derive(Clone, Debug)]
pub(crate) struct SampleRing<B> {
    storage: B,
    next: u64,
    /// Slot of the next sample: `next` modulo the length of the storage, kept to avoid a division per sample.
    slot: usize,
}

impl<B: Storage> SampleRing<B> {
    pub(crate) fn new(storage: B) -> Self {
        Self { storage, next: 0, slot: 0 }
    }

    /// Removes all samples.
    pub(crate) fn clear(&mut self) {
        self.next = 0;
        self.slot = 0;
    }

    #[inline]
    pub(crate) fn next_index(&self) -> u64 {
        self.next
    }

    /// Index of the oldest sample kept.
    #[inline]
    pub(crate) fn oldest_index(&self) -> u64 {
        self.next.saturating_sub(self.storage.as_ref().len() as u64)
    }

    #[inline]
    pub(crate) fn push(&mut self, sample: Sample) {
        let storage = self.storage.as_mut();
        if let Some(place) = storage.get_mut(self.slot) {
            *place = sample;
        }
        self.slot += 1;
        if self.slot >= storage.len() {
            self.slot = 0;
        }
        self.next += 1;
    }

    #[inline]
    pub(crate) fn get(&self, index: u64) -> Option<&Sample> {
        self.storage.as_ref().get(self.slot_of(index)?)
    }

    /// The samples `from..to` as far as they are contiguous in storage; empty when the first is not kept.
    #[inline]
    pub(crate) fn contiguous(&self, from: u64, to: u64) -> &[Sample] {
        let storage = self.storage.as_ref();
        let (Some(slot), true) = (self.slot_of(from), to > from) else { return &[] };
        let count = (to.min(self.next) - from) as usize;
        storage.get(slot..(slot + count).min(storage.len())).unwrap_or(&[])
    }

    #[inline]
    fn slot_of(&self, index: u64) -> Option<usize> {
        let length = self.storage.as_ref().len();
        // 1 for the newest sample.
        let age = self.next.checked_sub(index)?;
        if age == 0 || age > length as u64 {
            return None;
        }
        let age = age as usize;
        Some(if age <= self.slot { self.slot - age } else { self.slot + length - age })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contiguous_batch_equals_single_samples() {
        let mut history = SampleRing::new(alloc::vec![Sample::default(); 7]);
        for number in 0..30_u64 {
            history.push(Sample { time_s: number as f64, ..Sample::default() });
            for from in 0..=number + 1 {
                for to in from..=number + 2 {
                    let run = history.contiguous(from, to);
                    let held = history.get(from).is_some() && to > from;
                    assert_eq!(run.is_empty(), !held, "{from} to {to} of {number}");
                    for (k, sample) in run.iter().enumerate() {
                        assert_eq!(Some(sample), history.get(from + k as u64));
                        assert!(from + (k as u64) < to);
                    }
                }
            }
        }
    }

    #[test]
    fn the_ring_keeps_the_newest_samples_by_index() {
        for length in [0_usize, 1, 3, 7] {
            let mut history = SampleRing::new(alloc::vec![Sample::default(); length]);
            for number in 0..20_u64 {
                assert_eq!(history.get(number), None);
                history.push(Sample { time_s: number as f64, ..Sample::default() });
                for asked in 0..=number {
                    let held = number - asked < length as u64;
                    let found = history.get(asked).map(|s| s.time_s);
                    assert_eq!(found, held.then_some(asked as f64), "length {length}, {asked} of {number}");
                }
            }
        }
    }
}
