//! Motion of the needle base as a function of time: position and velocity between samples, times of velocity jumps, means over any span.
//!
//! | module | contents |
//! |---|---|
//! | `velocity_estimate` | velocity and its jumps from exact positions |
//! | `smooth_positions` | the same from noisy positions |
//! | `smooth_interval`, `interval_borders` | intervals between velocity jumps, and their borders |
//! | `motion_segment`, `acceleration_ramp` | parametric segments of commanded motion, and transitions between them |
//! | `jump_timing`, `interpolant` | times of velocity jumps; position and velocity between samples |
//! | `motion_pieces` | means over spans, cut at velocity jumps and reversals |

mod acceleration_ramp;
mod interpolant;
mod interval_borders;
mod jump_timing;
mod motion_pieces;
mod motion_segment;
mod smooth_interval;
mod smooth_positions;
mod velocity_estimate;

pub use jump_timing::JumpTiming;
pub use motion_pieces::{JumpAppearance, MotionPiece};
use smooth_positions::smooth_positions;
pub use velocity_estimate::MIN_JUMP_MPS;

use interpolant::Interpolant;
use stylet_record::Recording;
use velocity_estimate::{VelocityJump, estimate_velocity, position_noise};

/// Motion of one recording.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Interpolant with jumps at their exact times.
    exact: Interpolant,
    /// Interpolant with jumps midway between two samples, which gives the mean over samples.
    sampled: Interpolant,
    /// Velocity jumps.
    pub jumps: Vec<JumpTiming>,
    /// Times (s) at which the velocity smoothly changes sign, and the midpoints of the samples around them; Coulomb friction jumps there.
    reversals_s: Vec<(f64, f64)>,
    /// Standard deviation of the velocity in m/s.
    pub velocity_sd_mps: f64,
    /// Standard deviation of the position noise in m.
    pub noise_m: f64,
}

/// Velocity noise (m/s) above which positions are smoothed.
const MAX_EXACT_SD_MPS: f64 = 1.2e-5;

impl Motion {
    /// Motion of a recording with finite samples. Below `still_mps` (m/s) the needle is at rest.
    #[must_use]
    pub fn from_recording(recording: &Recording, still_mps: f64) -> Self {
        let (t, z) = (&recording.time_s, &recording.position_m);
        let estimate = estimate_velocity(t, z);
        let recorded_sd = stylet_stats::third_difference_sd([recording.velocity_mps.as_slice()]);
        let mut noise_m = position_noise(t, z);
        let precise = estimate.precise_positions;
        let (z, v, jumps, sd) = if estimate.sd_mps <= MAX_EXACT_SD_MPS {
            noise_m = noise_m.min(1e-6);
            (z.clone(), estimate.velocity_mps, estimate.jumps, estimate.sd_mps)
        } else {
            let smoothed = smooth_positions(t, z);
            (smoothed.position_m, smoothed.velocity_mps, smoothed.jumps, smoothed.sd_mps)
        };
        if recording.velocity_measured && sd > MAX_EXACT_SD_MPS && recorded_sd < sd {
            let v = &recording.velocity_mps;
            let sides = |k: &VelocityJump| VelocityJump {
                velocity_mps: [v[k.next_sample.saturating_sub(1)], v[k.next_sample.min(v.len() - 1)]],
                ..*k
            };
            let jumps: Vec<VelocityJump> = jumps.iter().map(sides).collect();
            return Self::from_knots(t, &z, v, &jumps, (recorded_sd, false), noise_m, still_mps);
        }
        Self::from_knots(t, &z, &v, &jumps, (sd, precise), noise_m, still_mps)
    }

    fn from_knots(
        t: &[f64],
        z: &[f64],
        v: &[f64],
        jumps: &[VelocityJump],
        (sd, precise): (f64, bool),
        noise_m: f64,
        still_mps: f64,
    ) -> Self {
        let mut m = Self {
            exact: Interpolant::new(precise),
            sampled: Interpolant::new(precise),
            velocity_sd_mps: sd,
            noise_m,
            ..Self::default()
        };
        let mut jumps = jumps.iter().peekable();
        for i in 0..t.len() {
            while let Some(jump) = jumps.next_if(|k| k.next_sample <= i) {
                if jump.next_sample == i && i > 0 {
                    let at_s = jump.time_s.clamp(t[i - 1], t[i]);
                    let between_s = 0.5 * (t[i - 1] + t[i]);
                    for side in jump.velocity_mps {
                        m.exact.push(at_s, jump.position_m, side);
                        m.sampled.push(between_s, jump.position_m + side * (between_s - at_s), side);
                    }
                    let doubt_s =
                        jump.position_sd_m / (jump.velocity_mps[1] - jump.velocity_mps[0]).abs().max(1e-6);
                    m.jumps.push(JumpTiming {
                        time_s: at_s,
                        sample_mid_s: between_s,
                        time_sd_s: doubt_s,
                        position_m: jump.position_m,
                        velocity_mps: jump.velocity_mps,
                    });
                }
            }
            m.exact.push(t[i], z[i], v[i]);
            m.sampled.push(t[i], z[i], v[i]);
        }
        // Noise would turn a hold into reversals.
        if sd <= MAX_EXACT_SD_MPS {
            m.find_reversals(t, still_mps);
        }
        m
    }

    /// Finds sign changes of the velocity between two samples that are not at a jump.
    fn find_reversals(&mut self, t: &[f64], still_mps: f64) {
        let sign = |v: f64| i8::from(v > still_mps) - i8::from(v < -still_mps);
        let mut near = 0;
        let mut before: Option<(f64, f64)> = None;
        for &now in t {
            let v = self.sampled.velocity_at(now, &mut near);
            if let Some((then, was)) = before
                && sign(v) != sign(was)
                && !self.jumps.iter().any(|j| j.time_s >= then && j.time_s <= now)
            {
                let share = (was / (was - v)).clamp(0.0, 1.0);
                self.reversals_s.push((then + share * (now - then), 0.5 * (then + now)));
            }
            before = Some((now, v));
        }
    }

    /// Position in m and velocity in m/s at a time.
    #[must_use]
    pub fn at(&self, at_s: f64) -> (f64, f64) {
        let k = &self.exact;
        let last = k.t.len() - 1;
        let i = k.index_before(at_s);
        if i == last || at_s <= k.t[i] {
            return (k.z[i], k.v[i]);
        }
        let share = (at_s - k.t[i]) / (k.t[i + 1] - k.t[i]).max(1e-300);
        (k.z[i] + share * (k.z[i + 1] - k.z[i]), k.v[i] + share * (k.v[i + 1] - k.v[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(in crate::motion) fn assert_close(actual: f64, expected: f64) {
        assert!((actual - expected).abs() <= 1e-9, "{actual} for {expected}");
    }

    /// Velocity in m/s below which the needle counts as at rest.
    const STILL_MPS: f64 = 1e-5;

    pub(in crate::motion) fn from_knots(
        t: &[f64],
        z: &[f64],
        v: &[f64],
        jumps: &[VelocityJump],
        sd: f64,
        noise_m: f64,
    ) -> Motion {
        Motion::from_knots(t, z, v, jumps, (sd, sd == 0.0), noise_m, STILL_MPS)
    }

    /// 2 m/s, from 0.53 s on back at 1 m/s, sampled every 0.1 s up to 1.2 s.
    pub(in crate::motion) fn bent() -> Motion {
        let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
        let z: Vec<f64> = t.iter().map(|t| if *t < 0.53 { 2.0 * t } else { 1.06 - (t - 0.53) }).collect();
        let v: Vec<f64> = t.iter().map(|t| if *t < 0.53 { 2.0 } else { -1.0 }).collect();
        let jump = VelocityJump {
            next_sample: 6,
            time_s: 0.53,
            position_m: 1.06,
            velocity_mps: [2.0, -1.0],
            position_sd_m: 0.006,
        };
        from_knots(&t, &z, &v, &[jump], 0.0, 0.0)
    }

    #[test]
    fn position_and_velocity_are_linear_between_samples_and_jumps() {
        let m = bent();
        for (at_s, z, v) in [(0.0, 0.0, 2.0), (0.34, 0.68, 2.0), (0.52, 1.04, 2.0), (0.54, 1.05, -1.0)] {
            assert_close(m.at(at_s).0, z);
            assert_close(m.at(at_s).1, v);
        }
        assert_close(m.at(0.97).0, 0.62);
        // Outside of the recording: the first and last sample.
        assert_eq!(m.at(-0.4), (0.0, 2.0));
        assert_close(m.at(7.0).0, 0.39);
        // A velocity that changes between samples.
        let slowing = from_knots(&[1.0, 1.5, 3.0], &[0.0, 1.0, 4.0], &[3.0, 1.0, 7.0], &[], 0.0, 0.0);
        assert_close(slowing.at(1.125).1, 2.5);
        assert_close(slowing.at(2.0).0, 2.0);
        assert_close(slowing.at(2.0).1, 3.0);
    }

    #[test]
    fn jump_timing_uncertainty_follows_from_the_position_uncertainty() {
        let actual = bent().jumps[0];
        assert_close(actual.time_s, 0.53);
        assert_close(actual.sample_mid_s, 0.55);
        assert_close(actual.time_sd_s, 0.002);
        assert_eq!((actual.position_m, actual.velocity_mps), (1.06, [2.0, -1.0]));
        // Clamped to the sampling interval; the smallest velocity change is 1 µm/s.
        let jump = |sample: usize, t: f64, after: f64| VelocityJump {
            next_sample: sample,
            time_s: t,
            position_m: 0.0,
            velocity_mps: [1.0, after],
            position_sd_m: 3e-6,
        };
        let of = |jumps: &[VelocityJump]| {
            from_knots(&[0.0, 1.0, 2.0, 3.0], &[0.0; 4], &[1.0; 4], jumps, 0.0, 0.0).jumps
        };
        let actual = of(&[jump(0, 0.0, 2.0), jump(1, 1.2, 1.5), jump(3, 1.7, 1.0), jump(4, 3.5, 2.0)]);
        assert_eq!(
            actual.iter().map(|j| (j.time_s, j.sample_mid_s)).collect::<Vec<_>>(),
            [(1.0, 0.5), (2.0, 2.5)]
        );
        assert_close(actual[0].time_sd_s, 6e-6);
        assert_close(actual[1].time_sd_s, 3.0);
    }

    #[test]
    fn a_smooth_stop_is_a_reversal() {
        let t: Vec<f64> = (0..8).map(f64::from).collect();
        let v = [0.3, 0.2, 0.1, 0.0, 0.0, -0.2, -0.1, -0.1];
        let m = from_knots(&t, &[0.0; 8], &v, &[], 0.0, 0.0);
        assert_eq!(m.reversals_s, [(3.0, 2.5), (4.0, 4.5)]);
    }

    #[test]
    fn position_noise_does_not_enter_the_mean_velocity_between_two_samples() {
        // 3 mm/s; alternating errors of 0.1 um are 40 um/s between two samples, more than the velocity's uncertainty.
        let t: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.005).collect();
        let z: Vec<f64> = t
            .iter()
            .enumerate()
            .map(|(k, t)| 0.003 * t + 1e-7 * (1.7 * (k * k % 101) as f64).sin())
            .collect();
        let r =
            Recording::with_velocity(t.clone(), z, vec![0.003; 600], vec![0.0; 600]).expect("a recording");
        let m = Motion::from_recording(&r, STILL_MPS);
        let mut near = 0;
        let travel: Vec<f64> = t.iter().map(|t| m.sampled.integrals(*t, &mut near).1).collect();
        let errors: Vec<f64> = travel.windows(2).map(|w| (w[1] - w[0]) / 0.005 - 0.003).collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!(m.velocity_sd_mps < MAX_EXACT_SD_MPS, "{}", m.velocity_sd_mps);
        assert!(rms < 2.0 * m.velocity_sd_mps, "{rms} with {}", m.velocity_sd_mps);
    }

    #[test]
    fn a_measured_velocity_is_used_when_it_is_more_accurate() {
        let t: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.005).collect();
        // Noisy positions; slower from 1.5 s on.
        let z: Vec<f64> = t
            .iter()
            .enumerate()
            .map(|(k, t)| 0.025 * t.min(1.5013) + 0.005 * t + 3e-4 * (1.7 * (k * k % 101) as f64).sin())
            .collect();
        let of = |rough_mps: f64, measured: bool| {
            let v: Vec<f64> = (0..600)
                .map(|k| if k <= 300 { 0.031 } else { 0.0051 } + rough_mps * f64::from(k % 2))
                .collect();
            let mut r =
                Recording::with_velocity(t.clone(), z.clone(), v, vec![0.0; 600]).expect("a recording");
            r.velocity_measured = measured;
            Motion::from_recording(&r, STILL_MPS)
        };
        let actual = of(0.0, true);
        assert_eq!((actual.at(1.0).1, actual.at(2.5).1), (0.031, 0.0051));
        assert_eq!(actual.velocity_sd_mps, 0.0);
        // Jumps come from positions.
        assert_eq!(actual.jumps.len(), 1);
        assert!((actual.jumps[0].time_s - 1.5).abs() < 0.05, "{:?}", actual.jumps);
        // Not measured, or too noisy.
        for from_positions in [of(0.0, false), of(0.01, true)] {
            assert!((from_positions.at(1.0).1 - 0.03).abs() < 3e-4, "{}", from_positions.at(1.0).1);
            assert!(from_positions.velocity_sd_mps > MAX_EXACT_SD_MPS);
        }
    }

    /// At 1.1 mm/s an encoder with 50 µm resolution stands still in eight samples of nine, at 0.2 mm/s in 49 of
    /// 50.
    #[test]
    fn a_needle_slower_than_one_encoder_step_per_sample_has_constant_velocity() {
        for speed_mps in [0.0011, 0.0002, 0.006] {
            let t: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.005).collect();
            let true_m = |t: f64| if t < 25.0 { speed_mps * t } else { speed_mps * (50.0 - t) };
            let z: Vec<f64> = t.iter().map(|t| (true_m(*t) / 5e-5).round() * 5e-5).collect();
            let force = vec![0.0; t.len()];
            let m = Motion::from_recording(&Recording::new(t, z, force).expect("a recording"), STILL_MPS);
            for k in 1..240 {
                let (at, actual) = (0.1 * f64::from(k), m.at(0.1 * f64::from(k)).1);
                assert!((actual - speed_mps).abs() < 1e-5, "{speed_mps} m/s: {actual} at {at} s");
            }
        }
    }

    /// Constant velocity with holds and a retraction also has equal differences, but exact positions.
    #[test]
    fn constant_velocity_with_rests_is_not_quantised() {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.005).collect();
        let z: Vec<f64> =
            t.iter().map(|t| 0.003 * if *t < 8.0 { *t } else { 8.0 - (*t - 12.0).max(0.0) }).collect();
        let force = vec![0.0; t.len()];
        let m = Motion::from_recording(&Recording::new(t, z, force).expect("a recording"), STILL_MPS);
        assert!(m.noise_m < 1e-9, "{}", m.noise_m);
        assert_eq!(m.jumps.len(), 2);
    }
}
