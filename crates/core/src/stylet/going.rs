//! How fast the needle goes: what the log says, or what its positions say where the two cannot both be right.
//!
//! Velocities in logs are often smoothed or late: at a stop within one sample they go down over twenty, while friction, and with it the
//! force, is gone at once. The mean speed `w` of a step, from the positions, does not lag; but it carries the encoder's noise,
//! `sqrt(2) sigma/dt`. So what is said is taken as long as it agrees with `w` within four times their usual difference.

use super::gaussian::{at_least, at_most};
use crate::sample::Sample;

/// Squared number of standard deviations that count as a disagreement: 4.
const DISAGREEMENT: f64 = 16.0;
/// Least standard deviation of the difference as a share of the speed: what resolution and synchronisation of a good log leave.
const LEAST_SHARE: f64 = 0.005;
/// Time over which the usual difference is learned, in s: much longer than smoothing or a lag, so that these do not become usual.
pub(crate) const LEARNED_S: f64 = 2.0;

/// What is said to be below this in m/s is rest (SPEC section 6).
pub(crate) const DEAD_MPS: f64 = 1e-5;

/// Samples in a row that have to agree.
const AGREEING: u8 = 2;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Going {
    /// Mean square of the usual difference in (m/s)².
    usual: f64,
    said_mps: f64,
    /// The needle stands: it has not moved, and was not said to.
    standing: bool,
    /// They disagree for at least this many samples more: where the positions' speed jumps it may cross a smoothed one.
    apart: u8,
}

impl Going {
    /// Velocity in m/s at a sample, and whether log and positions are apart: then friction changes within the step, nobody knows
    /// when. `share` is that of a step in what is usual.
    #[inline(always)]
    pub(crate) fn speed(
        &mut self,
        last: &Sample,
        sample: &Sample,
        speed_mps: f64,
        share: f64,
    ) -> (f64, bool) {
        let said = sample.velocity_mps;
        let dt_s = sample.time_s - last.time_s;
        let stepped_m = sample.position_m - last.position_m;
        if stepped_m == 0.0 && (self.standing || said.abs() <= DEAD_MPS) {
            // A velocity that was smoothed in both directions of time rises before the needle has moved.
            (self.standing, self.said_mps) = (true, said);
            return (0.0, false);
        }
        let starts = core::mem::take(&mut self.standing);
        let before = self.said_mps;
        self.said_mps = said;
        if starts {
            return (said, true);
        }
        let off_m = stepped_m - 0.5 * (said + before) * dt_s;
        let least = LEAST_SHARE * speed_mps;
        let limit = DISAGREEMENT * at_least(least * least, self.usual);
        let off2_m2 = off_m * off_m;
        if off2_m2 > limit * (dt_s * dt_s) || self.apart > 0 {
            let off2 = off2_m2 / (dt_s * dt_s);
            self.usual += share * (at_most(limit, off2) - self.usual);
            return if dt_s > 0.0 {
                self.disagree(before, said, stepped_m / dt_s, limit)
            } else {
                (said, false)
            };
        }
        if off_m != 0.0 {
            self.usual += share * (off2_m2 / (dt_s * dt_s) - self.usual);
        } else if said != 0.0 {
            self.usual -= share * self.usual;
        }
        (said, false)
    }

    /// Whether a jump within the step explains it, so that the mean speed lies between those at the ends; otherwise the positions are right.
    #[cold]
    fn disagree(&mut self, before: f64, said: f64, stepped: f64, limit: f64) -> (f64, bool) {
        let between = at_most(said.max(before), at_least(said.min(before), stepped));
        let off = stepped - between;
        // Once they disagree, agreement has to be twice as close.
        let far = off * off > if self.apart > 0 { 0.25 * limit } else { limit };
        self.apart = if far { AGREEING } else { self.apart.saturating_sub(1) };
        (if self.apart > 0 { stepped } else { said }, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const DT_S: f64 = 0.005;

    /// With the first sample, which has none before it.
    fn begun(velocity_mps: f64) -> (Going, Sample) {
        let (mut going, first) = (Going::default(), Sample { velocity_mps, ..Sample::default() });
        assert_eq!(going.speed(&first, &first, 0.0, 0.0), (velocity_mps, false));
        (going, first)
    }

    /// What is told of each sample of a motion whose log may differ from it.
    fn told(
        motion_mps: impl Fn(usize) -> f64,
        said_mps: impl Fn(usize) -> f64,
        count: usize,
    ) -> Vec<(f64, bool)> {
        let (mut going, mut last) = begun(said_mps(0));
        let mut found = Vec::new();
        for k in 1..count {
            let v = 0.5 * (motion_mps(k - 1) + motion_mps(k));
            let sample = Sample {
                time_s: DT_S * k as f64,
                position_m: last.position_m + v * DT_S,
                velocity_mps: said_mps(k),
                force_n: 0.0,
            };
            found.push(going.speed(&last, &sample, 0.002, DT_S / (DT_S + LEARNED_S)));
            last = sample;
        }
        found
    }

    #[test]
    fn a_velocity_that_agrees_with_the_positions_is_taken_as_it_is_said() {
        let v = |k: usize| 0.002 + 0.001 * (0.05 * k as f64).sin();
        for (k, (found, apart)) in told(v, v, 1000).into_iter().enumerate() {
            assert_eq!((found, apart), (v(k + 1), false));
        }
    }

    #[test]
    fn where_the_log_is_late_the_positions_are_right_until_both_agree_again() {
        // A step from 2 to 4 mm/s at sample 500, logged with a first-order lag of 10 samples.
        let v = |k: usize| if k < 500 { 0.002 } else { 0.004 };
        let said =
            |k: usize| if k < 500 { 0.002 } else { 0.004 - 0.002 * (-(k as f64 - 500.0) / 10.0).exp() };
        let found = told(v, said, 800);
        for (k, (mps, apart)) in found.iter().enumerate() {
            let sample = k + 1;
            if sample < 500 {
                assert_eq!((*mps, *apart), (0.002, false));
            } else if (502..520).contains(&sample) {
                assert!(*apart && (mps - 0.004).abs() < 1e-9, "{mps} m/s at sample {sample}");
            } else if sample > 600 {
                assert!(!apart && (mps - 0.004).abs() < 1e-6, "{mps} m/s at sample {sample}");
            }
        }
    }

    #[test]
    fn a_jump_within_a_step_is_told_and_the_log_believed() {
        // From 2 to 4 mm/s somewhere between two samples: the mean speed lies between those at the ends.
        let v = |k: usize| if k < 500 { 0.002 } else { 0.004 };
        let ((mut going, mut last), mut apart) = (begun(0.002), Vec::new());
        for k in 1..600 {
            let mean = if k == 500 { 0.0022 } else { v(k) };
            let sample = Sample {
                time_s: DT_S * k as f64,
                position_m: last.position_m + mean * DT_S,
                velocity_mps: v(k),
                force_n: 0.0,
            };
            let (mps, sudden) = going.speed(&last, &sample, 0.002, 0.0025);
            assert_eq!(mps, v(k), "at sample {k}");
            if sudden {
                apart.push(k);
            }
            last = sample;
        }
        assert_eq!(apart, [500]);
    }

    #[test]
    fn the_encoders_noise_becomes_usual() {
        // 5 um of noise on positions make 1.4 mm/s of mean speeds; the log says the 2 mm/s that it is.
        let ((mut going, mut last), mut late) = (begun(0.002), 0);
        for k in 1..4000_usize {
            let noise_m = 5e-6 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
            let sample = Sample {
                time_s: DT_S * k as f64,
                position_m: 0.002 * DT_S * k as f64 + noise_m,
                velocity_mps: 0.002,
                force_n: 0.0,
            };
            let (mps, apart) = going.speed(&last, &sample, 0.002, DT_S / (DT_S + LEARNED_S));
            if k >= 2000 {
                late += usize::from(apart);
                assert!(apart || mps == 0.002);
            }
            last = sample;
        }
        assert!(late < 20, "{late} of 2000 samples after ten seconds");
    }

    #[test]
    fn a_needle_that_has_not_moved_stands_until_it_has() {
        // The log begins to rise at sample 90, the needle moves from 100 on.
        let v = |k: usize| if k < 100 { 0.0 } else { 0.002 };
        let said = |k: usize| (0.0001 * (k as f64 - 90.0)).clamp(0.0, 0.002);
        let found = told(v, said, 200);
        assert!(found[..98].iter().all(|f| *f == (0.0, false)), "{:?}", &found[85..99]);
        assert!(found[99].1, "when it sets off, nobody knows when: {:?}", found[99]);
        let (mps, apart) = found[150];
        assert!(!apart && mps == 0.002);
    }

    /// Said before and now, in m/s, the mean speed of the positions over 5 ms, and what is usual.
    fn next(going: &mut Going, (before, said): (f64, f64), stepped: f64) -> (f64, bool) {
        let last = Sample { velocity_mps: before, ..Sample::default() };
        let sample =
            Sample { time_s: DT_S, position_m: stepped * DT_S, velocity_mps: said, ..Sample::default() };
        going.speed(&last, &sample, 0.002, 0.25)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn log_and_positions_agree_within_four_times_their_usual_difference() {
        // Nothing is usual: half a percent of 2 mm/s is, and four times that is 40 um/s. Or 60 um/s are usual: 240.
        for (usual, limit) in [(0.0, 4e-5), (6e-5, 2.4e-4), (1e-6, 4e-5)] {
            for (share, agree) in [(0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
                let mut going = Going { usual: usual * usual, said_mps: 0.002, ..Going::default() };
                let off = share * limit;
                // The mean of what is said before and now.
                let (mps, apart) = next(&mut going, (0.002, 0.0022), 0.0021 + off);
                assert_eq!(apart, !agree, "{share} of {limit} m/s");
                assert_eq!(mps, 0.0022, "a jump within the step explains it");
                let square = (off * off).min(limit * limit);
                near(going.usual, 0.75 * usual * usual + 0.25 * square);
                assert_eq!(going.said_mps, 0.0022);
            }
        }
        // What agrees to the last digit makes the usual less, unless nothing is said.
        let at_once = |before: f64, said: f64| {
            let mut going = Going { usual: 4e-10, said_mps: before, ..Going::default() };
            let last = Sample { velocity_mps: before, ..Sample::default() };
            let stepped_m = 0.5 * (said + before) * DT_S;
            let sample =
                Sample { time_s: DT_S, position_m: stepped_m, velocity_mps: said, ..Sample::default() };
            assert_eq!(going.speed(&last, &sample, 0.002, 0.25), (said, false));
            going.usual
        };
        near(at_once(0.002, 0.003), 3e-10);
        assert_eq!(at_once(0.002, 0.0), 4e-10);
    }

    #[test]
    fn positions_are_right_until_two_samples_agree_twice_as_closely() {
        // Within 40 um/s of what lies between those said before and now; within 20 once apart.
        let said = (0.002, 0.0022);
        let mut going = Going { said_mps: 0.002, ..Going::default() };
        let mut tell = |off_mps: f64, expected_mps: f64| {
            (going.usual, going.said_mps) = (0.0, 0.002);
            let (mps, apart) = next(&mut going, said, 0.0022 + off_mps);
            assert!(apart);
            near(mps, expected_mps);
            going.apart
        };
        assert_eq!(tell(3.9e-5, 0.0022), 0);
        assert_eq!(tell(4.1e-5, 0.0022 + 4.1e-5), 2);
        assert_eq!(tell(2.1e-5, 0.0022 + 2.1e-5), 2);
        assert_eq!(tell(1.9e-5, 0.0022 + 1.9e-5), 1);
        assert_eq!(tell(2.1e-5, 0.0022 + 2.1e-5), 2);
        assert_eq!(tell(1.9e-5, 0.0022 + 1.9e-5), 1);
        assert_eq!(tell(-1e-4, 0.0022), 0);
        // Below the smaller of the two as above the larger.
        assert_eq!(tell(-0.0002 - 3.9e-5, 0.0022), 0);
        assert_eq!(tell(-0.0002 - 4.1e-5, 0.002 - 4.1e-5), 2);
    }

    #[test]
    fn a_needle_stands_where_it_has_not_moved_and_is_not_said_to() {
        for (said, stands) in [(9e-6, true), (-9e-6, true), (1e-5, true), (1.1e-5, false), (-1.1e-5, false)] {
            let mut going = Going { said_mps: 1e-5, ..Going::default() };
            let (mps, apart) = next(&mut going, (1e-5, said), 0.0);
            assert_eq!(
                (mps, apart, going.standing),
                (if stands { 0.0 } else { said }, false, stands),
                "{said}"
            );
            assert_eq!(going.said_mps, said);
        }
        // Once it stands it does so until it moves, and then sets off whatever is said.
        let mut going = Going { standing: true, ..Going::default() };
        assert_eq!(next(&mut going, (0.0, 0.002), 0.0), (0.0, false));
        assert_eq!(next(&mut going, (0.002, 0.002), 1e-6), (0.002, true));
        assert!(!going.standing && going.usual == 0.0);
        // Two samples at one instant tell no speed.
        let mut going = Going { apart: 2, said_mps: 0.002, ..Going::default() };
        let last = Sample { velocity_mps: 0.002, ..Sample::default() };
        let jumped = Sample { position_m: 1e-5, ..last };
        assert_eq!(going.speed(&last, &jumped, 0.002, 0.25), (0.002, false));
    }
}
