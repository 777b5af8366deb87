//! How fast the needle goes: what the log says, or what its positions say where the two cannot both be right.
//!
//! Velocities in logs are often smoothed or late: at a stop within one sample they go down over twenty, while friction, and with it the
//! force, is gone at once. The mean speed `w` of a step, from the positions, does not lag; but it carries the encoder's noise,
//! `sqrt(2) sigma/dt`. So what is said is taken as long as it agrees with `w` within four times their usual difference.
//!
//! The second difference of `w` is free of smooth motion, and of `sigma` it has the variance `20 sigma^2/dt^2`: a tenth of its mean square
//! is what noise there is in `w`. The speed at a sample is `w` carried on by half a step, with `6.5 sigma^2/dt^2`. Where that is as exact as a good log,
//! and the log has once been seen to smooth, the positions alone are believed; the speed has jumped where `w` changes otherwise than before.

use super::gaussian::{at_least, at_most};
use crate::sample::Sample;

/// Squared number of standard deviations that count as a disagreement: 4.
const DISAGREEMENT: f64 = 16.0;
/// Least standard deviation of the difference as a share of the speed: what resolution and synchronisation of a good log leave.
const LEAST_SHARE: f64 = 0.005;
/// Time over which the usual difference is learned, in s: much longer than smoothing or a lag, so that these do not become usual.
pub(crate) const DISAGREEMENT_MEMORY_S: f64 = 2.0;

/// What is said to be below this in m/s is rest (SPEC section 6).
pub(crate) const REST_SPEED_MPS: f64 = 1e-5;

/// White noise of the positions has in the mean speeds this share of the variance that it has in their second differences (2 of 20), and in the speed that is
/// carried on from them so many times as much (6.5 of 2).
const NOISE_OF_BENDS: f64 = 0.1;
const SPEED_PER_NOISE: f64 = 3.25;

/// Samples in a row that have to agree.
const AGREEING: u8 = 2;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VelocityEstimator {
    /// Mean square of the usual difference, and what of it is the positions' own noise, in (m/s)².
    usual: f64,
    noise: f64,
    said_mps: f64,
    /// Mean speeds of the last three steps in m/s, the newest first, and whether they have jumped.
    stepped_mps: [f64; 3],
    jumped: bool,
    /// The needle stands: it has not moved, and was not said to.
    standing: bool,
    /// They disagree for at least this many samples more: where the positions' speed jumps it may cross a smoothed one.
    apart: u8,
    /// The positions are exact; and the log has told later, or earlier, what they show at once.
    exact: bool,
    smooths: bool,
}

impl VelocityEstimator {
    /// Velocity in m/s at a sample, and whether log and positions are apart: then friction changes within the step, nobody knows
    /// when. `share` is that of a step in what is usual.
    #[inline(always)]
    pub(crate) fn update(
        &mut self,
        last: &Sample,
        sample: &Sample,
        speed_mps: f64,
        share: f64,
    ) -> (f64, bool) {
        let said = sample.velocity_mps;
        let dt_s = sample.time_s - last.time_s;
        let stepped_m = sample.position_m - last.position_m;
        let before = core::mem::replace(&mut self.said_mps, said);
        if stepped_m == 0.0 && (self.standing || said.abs() <= REST_SPEED_MPS) {
            // A velocity that was smoothed in both directions of time rises before the needle has moved.
            self.smooths |= before.abs() > REST_SPEED_MPS && said.abs() > REST_SPEED_MPS;
            (self.standing, self.stepped_mps, self.jumped) = (true, [0.0; 3], false);
            return (0.0, false);
        }
        let starts = core::mem::take(&mut self.standing);
        if dt_s <= 0.0 {
            return (said, starts);
        }
        let stepped = stepped_m / dt_s;
        self.stepped_mps = [stepped, self.stepped_mps[0], self.stepped_mps[1]];
        if starts {
            return (said, true);
        }
        let off = stepped - 0.5 * (said + before);
        let least2 = LEAST_SHARE * speed_mps * (LEAST_SHARE * speed_mps);
        let limit = DISAGREEMENT * at_least(least2, self.usual);
        if off != 0.0 || said != 0.0 {
            self.usual += share * (at_most(limit, off * off) - self.usual);
        }
        let (noise, positions_mps) =
            self.by_positions(DISAGREEMENT * at_least(least2, self.noise / NOISE_OF_BENDS));
        // Jumps are none of it.
        let clip = at_least(least2, DISAGREEMENT * self.noise);
        self.noise += share * (at_most(clip, noise) - self.noise);
        self.exact = SPEED_PER_NOISE * self.noise <= least2;
        if self.uses_positions() {
            return (positions_mps, self.jumped);
        }
        if off * off > limit || self.apart > 0 {
            let told = self.disagree(before, said, stepped, limit);
            self.smooths |= self.exact && SPEED_PER_NOISE * noise <= least2 && self.apart > 0;
            return told;
        }
        (said, false)
    }

    /// The log is smoothed, and the positions are believed: what has happened within a step is told by the next.
    #[inline(always)]
    pub(super) fn uses_positions(&self) -> bool {
        self.exact && self.smooths
    }

    /// What this step says of the noise in (m/s)², and the speed that exact positions show; notes whether it has jumped: `limit` is the squared
    /// change of speed within a step that has no meaning.
    fn by_positions(&mut self, limit: f64) -> (f64, f64) {
        let [now, last, before] = self.stepped_mps;
        let (change, changed) = (now - last, last - before);
        let bent2 = (change - changed) * (change - changed);
        // A jump in the middle of a step changes two of them alike.
        self.jumped = bent2 > limit || (self.jumped && change * change > limit);
        // Behind it the speed goes on as it does now.
        let smoothly = !self.jumped || change * change <= limit;
        (NOISE_OF_BENDS * bent2, if smoothly { now + 0.5 * change } else { now })
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

    impl VelocityEstimator {
        /// Whose log is known to be late.
        pub(in super::super) fn known_late() -> Self {
            Self { exact: true, smooths: true, ..Self::default() }
        }
    }

    /// With the first sample, which has none before it.
    fn begun(velocity_mps: f64) -> (VelocityEstimator, Sample) {
        let (mut going, first) = (VelocityEstimator::default(), Sample { velocity_mps, ..Sample::default() });
        assert_eq!(going.update(&first, &first, 0.0, 0.0), (velocity_mps, false));
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
            found.push(going.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S)));
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
    fn where_the_log_is_late_the_positions_are_right_from_then_on() {
        // A step from 2 to 4 mm/s at sample 500, logged with a first-order lag of 10 samples, and one back at 700.
        let v = |k: usize| if (500..700).contains(&k) { 0.004 } else { 0.002 };
        let lag = |k: usize, step: f64| 1.0 - (-(k as f64 - step).max(0.0) / 10.0).exp();
        let said = |k: usize| 0.002 + 0.002 * (lag(k, 500.0) - lag(k, 700.0));
        let found = told(v, said, 900);
        for (k, (mps, apart)) in found.iter().enumerate() {
            let sample = k + 1;
            if sample < 500 {
                assert_eq!((*mps, *apart), (0.002, false));
            } else if sample > 501 && sample != 700 {
                assert!((mps - v(sample)).abs() < 1e-9, "{mps} m/s at sample {sample}");
            }
            // The step of the jump, half of which it is, and the next two, which differ from it.
            assert_eq!(*apart, (500..=502).contains(&sample) || (700..=702).contains(&sample), "{sample}");
        }
    }

    #[test]
    fn exact_positions_know_a_speed_that_the_log_has_smoothed() {
        // 1 Hz of ripple on 4 mm/s, logged as the mean of 21 samples, which takes off 4 % of it and smears a stop over 10 samples on both sides.
        let v = |k: usize| {
            if k < 1000 { 0.004 + 0.002 * (core::f64::consts::TAU * DT_S * k as f64).sin() } else { 0.0 }
        };
        let said = |k: usize| (0..21).map(|i| v((k + i).saturating_sub(10))).sum::<f64>() / 21.0;
        let found = told(v, said, 1100);
        for (k, (mps, apart)) in found.iter().enumerate().skip(200) {
            let sample = k + 1;
            assert!(sample == 1000 || (mps - v(sample)).abs() < 5e-6, "{mps} m/s at sample {sample}");
            assert!(!apart || (1000..=1002).contains(&sample), "sample {sample}");
        }
    }

    #[test]
    fn a_log_is_late_where_exact_positions_show_it_and_not_for_a_jump_or_noise() {
        let late = |v: &dyn Fn(usize) -> f64, said: &dyn Fn(usize) -> f64, noise_m: f64| {
            let ((mut going, mut last), mut at_m) = (begun(said(0)), 0.0);
            for k in 1..2000_usize {
                at_m += 0.5 * (v(k - 1) + v(k)) * DT_S;
                let position_m = at_m + noise_m * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
                let sample =
                    Sample { time_s: DT_S * k as f64, position_m, velocity_mps: said(k), force_n: 0.0 };
                going.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S));
                last = sample;
            }
            going.uses_positions()
        };
        let step = |k: usize| if k < 1000 { 0.002 } else { 0.004 };
        let ramp = |k: usize| (0.002 + 0.0001 * (k as f64 - 990.0)).clamp(0.002, 0.004);
        assert!(!late(&step, &step, 0.0));
        assert!(late(&step, &ramp, 0.0));
        assert!(!late(&step, &ramp, 1e-6), "a micrometre at 200 Hz is a tenth of the speed");
        // From rest: said to move for two samples before it does.
        let from = |first: usize| move |k: usize| if k < first { 0.0 } else { 0.002 };
        assert!(!late(&from(100), &from(100), 0.0) && late(&from(100), &from(98), 0.0));
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
            let (mps, sudden) = going.update(&last, &sample, 0.002, 0.0025);
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
            let (mps, apart) = going.update(&last, &sample, 0.002, DT_S / (DT_S + DISAGREEMENT_MEMORY_S));
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
        assert!(!apart && (mps - 0.002).abs() < 1e-9);
    }

    /// Said before and now, in m/s, the mean speed of the positions over 5 ms, and what is usual.
    fn next(going: &mut VelocityEstimator, (before, said): (f64, f64), stepped: f64) -> (f64, bool) {
        let last = Sample { velocity_mps: before, ..Sample::default() };
        let sample =
            Sample { time_s: DT_S, position_m: stepped * DT_S, velocity_mps: said, ..Sample::default() };
        going.update(&last, &sample, 0.002, 0.25)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} for {expected}");
    }

    #[test]
    fn log_and_positions_agree_within_four_times_their_usual_difference() {
        // Nothing is usual: half a percent of 2 mm/s is, and four times that is 40 um/s. Or 60 um/s are usual: 240.
        for (usual, limit) in [(0.0, 4e-5), (6e-5, 2.4e-4), (1e-6, 4e-5)] {
            for (share, agree) in [(0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
                let mut going = VelocityEstimator {
                    usual: usual * usual,
                    said_mps: 0.002,
                    ..VelocityEstimator::default()
                };
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
            let mut going =
                VelocityEstimator { usual: 4e-10, said_mps: before, ..VelocityEstimator::default() };
            let last = Sample { velocity_mps: before, ..Sample::default() };
            let stepped_m = 0.5 * (said + before) * DT_S;
            let sample =
                Sample { time_s: DT_S, position_m: stepped_m, velocity_mps: said, ..Sample::default() };
            assert_eq!(going.update(&last, &sample, 0.002, 0.25), (said, false));
            going.usual
        };
        near(at_once(0.002, 0.003), 3e-10);
        assert_eq!(at_once(0.002, 0.0), 4e-10);
    }

    #[test]
    fn positions_are_right_until_two_samples_agree_twice_as_closely() {
        // Within 40 um/s of what lies between those said before and now; within 20 once apart.
        let said = (0.002, 0.0022);
        let mut going = VelocityEstimator { said_mps: 0.002, ..VelocityEstimator::default() };
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
            let mut going = VelocityEstimator { said_mps: 1e-5, ..VelocityEstimator::default() };
            let (mps, apart) = next(&mut going, (1e-5, said), 0.0);
            assert_eq!(
                (mps, apart, going.standing),
                (if stands { 0.0 } else { said }, false, stands),
                "{said}"
            );
            assert_eq!(going.said_mps, said);
        }
        // Once it stands it does so until it moves, and then sets off whatever is said.
        let mut going = VelocityEstimator { standing: true, ..VelocityEstimator::default() };
        assert_eq!(next(&mut going, (0.0, 0.002), 0.0), (0.0, false));
        assert_eq!(next(&mut going, (0.002, 0.002), 1e-6), (0.002, true));
        assert!(!going.standing && going.usual == 0.0);
        // Two samples at one instant tell no speed.
        let mut going = VelocityEstimator { apart: 2, said_mps: 0.002, ..VelocityEstimator::default() };
        let last = Sample { velocity_mps: 0.002, ..Sample::default() };
        let jumped = Sample { position_m: 1e-5, ..last };
        assert_eq!(going.update(&last, &jumped, 0.002, 0.25), (0.002, false));
    }
}
