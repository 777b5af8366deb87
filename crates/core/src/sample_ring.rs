//! The recent past: a ring of raw samples in storage that the caller provides.

use crate::sample::Sample;

/// Ring of samples with running numbers. Old samples are overwritten; asking for one that is gone
/// gives `None`.
#[derive(Clone, Debug)]
pub(crate) struct SampleRing<B> {
    storage: B,
    next: u64,
    /// Slot that the next sample will go to: `next` modulo the storage's length, kept so that no
    /// sample costs a division.
    slot: usize,
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> SampleRing<B> {
    pub(crate) fn new(storage: B) -> Self {
        Self { storage, next: 0, slot: 0 }
    }

    /// Number that the next sample will get.
    #[inline]
    pub(crate) fn next_index(&self) -> u64 {
        self.next
    }

    /// Number of the oldest sample that is still there.
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
    pub(crate) fn get(&self, number: u64) -> Option<&Sample> {
        let storage = self.storage.as_ref();
        // How long ago: 1 for the newest.
        let ago = self.next.checked_sub(number)?;
        if ago == 0 || ago > storage.len() as u64 {
            return None;
        }
        let ago = ago as usize;
        let index = if ago <= self.slot { self.slot - ago } else { self.slot + storage.len() - ago };
        storage.get(index)
    }
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> SampleRing<B> {
    /// The samples from number `from` up to, not including, `to`, as far as they follow one another in
    /// storage; empty when the first is gone or has not come yet.
    #[inline]
    pub(crate) fn contiguous(&self, from: u64, to: u64) -> &[Sample] {
        let storage = self.storage.as_ref();
        let (Some(ago), true) = (self.next.checked_sub(from), to > from) else { return &[] };
        if ago == 0 || ago > storage.len() as u64 {
            return &[];
        }
        let ago = ago as usize;
        let index = if ago <= self.slot { self.slot - ago } else { self.slot + storage.len() - ago };
        let count = (to.min(self.next) - from) as usize;
        storage.get(index..(index + count).min(storage.len())).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_of_samples_is_what_asking_one_by_one_gives() {
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
    fn the_ring_holds_the_newest_samples_by_their_numbers() {
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
