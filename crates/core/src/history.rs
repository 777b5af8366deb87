//! The recent past: a ring of raw samples in storage that the caller provides.

use crate::sample::Sample;

/// Ring of samples with running numbers. Old samples are overwritten; asking for one that is gone
/// gives `None`.
#[derive(Clone, Debug)]
pub(crate) struct History<B> {
    storage: B,
    next: u64,
}

impl<B: AsRef<[Sample]> + AsMut<[Sample]>> History<B> {
    pub(crate) fn new(storage: B) -> Self {
        Self { storage, next: 0 }
    }

    /// Number that the next sample will get.
    #[inline]
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// Number of the oldest sample that is still there.
    #[inline]
    pub(crate) fn oldest(&self) -> u64 {
        self.next.saturating_sub(self.storage.as_ref().len() as u64)
    }

    #[inline]
    pub(crate) fn push(&mut self, sample: Sample) {
        let storage = self.storage.as_mut();
        let length = storage.len() as u64;
        if length > 0 {
            storage[(self.next % length) as usize] = sample;
        }
        self.next += 1;
    }

    #[inline]
    pub(crate) fn get(&self, number: u64) -> Option<&Sample> {
        if number >= self.next || number < self.oldest() {
            return None;
        }
        let storage = self.storage.as_ref();
        storage.get((number % storage.len() as u64) as usize)
    }
}
