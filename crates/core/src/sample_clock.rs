//! Check of time stamps before the algorithm runs: ignores outliers and detects a new clock.

use crate::sample::UnusedReason;

/// Longest interval in s between consecutive samples that needs no confirmation by later ones.
const MAX_INTERVAL_S: f64 = 1.0;
/// The same limit for slow streams, as a multiple of their confirmed sampling interval.
const MAX_INTERVAL_FACTOR: f64 = 20.0;
/// Samples in a row with consistent time stamps that confirm a jump of the clock.
const CONFIRMING_SAMPLES: u32 = 5;
/// Longest pause in s within one insertion; a longer jump ahead is a new clock.
const MAX_PAUSE_S: f64 = 600.0;

/// What to do with a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Process it.
    Use,
    /// Re-initialise the algorithm, then process it.
    Restart,
    /// Ignore it.
    Ignore(UnusedReason),
}

/// Samples after a jump of the clock that wait for confirmation.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    count: u32,
    /// From the last used sample to the first of these, in s.
    jump_s: f64,
    /// Between the latest two of these, in s; infinite while there is one.
    interval_s: f64,
    last_s: f64,
}

/// Time stamps of the used samples.
///
/// A stamp up to [`MAX_INTERVAL_S`] after the previous one is used. Any other is ignored until [`CONFIRMING_SAMPLES`]
/// consecutive samples confirm it. A single outlier is therefore ignored, a pause of up to [`MAX_PAUSE_S`] continues the
/// insertion, and a clock set back or far ahead restarts the algorithm. Stamps set back by less than [`MAX_INTERVAL_S`] are
/// ignored until they catch up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleClock {
    /// Minus infinity before the first sample.
    last_s: f64,
    max_interval_s: f64,
    candidate: Candidate,
}

impl Default for SampleClock {
    fn default() -> Self {
        let candidate = Candidate { count: 0, jump_s: 0.0, interval_s: f64::INFINITY, last_s: 0.0 };
        Self { last_s: f64::NEG_INFINITY, max_interval_s: MAX_INTERVAL_S, candidate }
    }
}

impl SampleClock {
    /// Decides on a sample from its time stamp, which must be finite.
    #[inline(always)]
    pub(crate) fn check(&mut self, time_s: f64) -> Verdict {
        if self.continues(time_s) {
            self.last_s = time_s;
            self.candidate.count = 0;
            return Verdict::Use;
        }
        self.check_jump(time_s)
    }

    /// The time stamp follows the last one within the usual interval.
    #[inline(always)]
    pub(crate) fn continues(&self, time_s: f64) -> bool {
        let interval_s = time_s - self.last_s;
        interval_s > 0.0 && interval_s <= self.max_interval_s
    }

    /// Time of the last used sample.
    #[inline(always)]
    pub(crate) fn last_s(&self) -> f64 {
        self.last_s
    }

    /// Reverts an accepted time stamp when the algorithm rejects the sample; `last_s` is the time of the last used sample.
    pub(crate) fn revert_to(&mut self, last_s: f64) {
        self.last_s = last_s;
    }

    #[cold]
    #[inline(never)]
    fn check_jump(&mut self, time_s: f64) -> Verdict {
        if self.last_s == f64::NEG_INFINITY {
            self.last_s = time_s;
            return Verdict::Use;
        }
        self.extend_candidate(time_s);
        let Candidate { count, jump_s, interval_s, .. } = self.candidate;
        if jump_s <= 0.0 && jump_s > -self.max_interval_s {
            return Verdict::Ignore(UnusedReason::NotLater);
        }
        if count < CONFIRMING_SAMPLES {
            return Verdict::Ignore(UnusedReason::TimeJump);
        }
        self.last_s = time_s;
        self.candidate.count = 0;
        self.max_interval_s = (MAX_INTERVAL_FACTOR * interval_s).max(MAX_INTERVAL_S);
        if jump_s > 0.0 && jump_s <= MAX_PAUSE_S { Verdict::Use } else { Verdict::Restart }
    }

    fn extend_candidate(&mut self, time_s: f64) {
        let candidate = &mut self.candidate;
        let interval_s = time_s - candidate.last_s;
        let regular = interval_s <= self.max_interval_s || interval_s <= 2.0 * candidate.interval_s;
        if candidate.count > 0 && interval_s > 0.0 && regular {
            candidate.count += 1;
            candidate.interval_s = interval_s;
        } else {
            candidate.count = 1;
            candidate.jump_s = time_s - self.last_s;
            candidate.interval_s = f64::INFINITY;
        }
        candidate.last_s = time_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const NOT_LATER: Verdict = Verdict::Ignore(UnusedReason::NotLater);
    const JUMP: Verdict = Verdict::Ignore(UnusedReason::TimeJump);

    /// Verdicts on these stamps after a second at 1 kHz that ends at 10 s.
    fn after_ten_seconds(times_s: impl IntoIterator<Item = f64>) -> Vec<Verdict> {
        let mut clock = SampleClock::default();
        for k in 0..=1000 {
            assert_eq!(clock.check(9.0 + 1e-3 * f64::from(k)), Verdict::Use);
        }
        times_s.into_iter().map(|t| clock.check(t)).collect()
    }

    fn at_1_khz(from_s: f64, count: u32) -> impl Iterator<Item = f64> {
        (0..count).map(move |k| from_s + 1e-3 * f64::from(k))
    }

    #[test]
    fn a_single_outlier_is_ignored_and_the_next_sample_used() {
        for outlier in [1e9, -1e9, f64::MAX, f64::MIN, 12.0, 0.0] {
            assert_eq!(after_ten_seconds([outlier, 10.001, 10.002]), [JUMP, Verdict::Use, Verdict::Use]);
        }
        assert_eq!(after_ten_seconds([10.0, 9.999, 10.001]), [NOT_LATER, NOT_LATER, Verdict::Use]);
    }

    #[test]
    fn outliers_without_a_common_clock_never_restart() {
        let wild = (0..100).map(|k| if k % 2 == 0 { 1e6 * f64::from(100 - k) } else { -1e3 * f64::from(k) });
        assert_eq!(after_ten_seconds(wild), [JUMP; 100]);
        // A second sender with a clock of its own, interleaved.
        let both = at_1_khz(10.001, 50).zip(at_1_khz(500.0, 50)).flat_map(|(a, b)| [a, b]);
        let verdicts = after_ten_seconds(both);
        assert_eq!(verdicts.iter().filter(|v| **v == Verdict::Use).count(), 50);
        assert_eq!(verdicts.iter().filter(|v| **v == JUMP).count(), 50);
    }

    #[test]
    fn five_samples_of_a_new_clock_restart_once() {
        for start_s in [0.0, -1e4, 8.9, 700.0, 1.7e9] {
            let verdicts = after_ten_seconds(at_1_khz(start_s, 20));
            assert_eq!(verdicts[..4], [JUMP; 4], "{start_s}");
            assert_eq!(verdicts[4], Verdict::Restart, "{start_s}");
            assert!(verdicts[5..].iter().all(|v| *v == Verdict::Use), "{start_s}");
        }
    }

    #[test]
    fn a_pause_continues_without_a_restart_and_a_dropout_loses_nothing() {
        let verdicts = after_ten_seconds(at_1_khz(70.0, 20));
        assert_eq!(verdicts[..5], [JUMP, JUMP, JUMP, JUMP, Verdict::Use]);
        assert!(!verdicts.contains(&Verdict::Restart));
        assert_eq!(after_ten_seconds([11.0]), [Verdict::Use]);
    }

    #[test]
    fn stamps_set_back_by_less_than_a_second_are_ignored_until_they_catch_up() {
        let verdicts = after_ten_seconds(at_1_khz(9.5005, 600));
        let ignored = verdicts.iter().take_while(|v| **v == NOT_LATER).count();
        assert_eq!(ignored, 500);
        assert!(verdicts[500..].iter().all(|v| *v == Verdict::Use));
    }

    #[test]
    fn a_slow_stream_is_used_once_its_interval_is_confirmed() {
        let mut clock = SampleClock::default();
        let verdicts: Vec<_> = (0..20).map(|k| clock.check(3.0 * f64::from(k))).collect();
        assert_eq!(verdicts[..6], [Verdict::Use, JUMP, JUMP, JUMP, JUMP, Verdict::Use]);
        assert!(verdicts[5..].iter().all(|v| *v == Verdict::Use));
    }

    #[test]
    fn a_stream_whose_first_stamp_is_the_outlier_restarts() {
        let mut clock = SampleClock::default();
        assert_eq!(clock.check(1e9), Verdict::Use);
        let verdicts: Vec<_> = at_1_khz(0.0, 10).map(|t| clock.check(t)).collect();
        assert_eq!(verdicts[4], Verdict::Restart);
    }
}
