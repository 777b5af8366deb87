//! What the needle's base did, as a function of time: position and velocity between samples, jumps of the speed at
//! their instants, means over any span.

use crate::settle::settle;
use crate::velocity::{Kink, position_noise, velocity};
use stylet_record::Recording;
use stylet_tissue::effect::sgn;

/// The motion of one recording.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// With the jumps of the speed at their instants.
    exact: Knots,
    /// With the jumps half-way between two samples: what a mean over samples sees.
    sampled: Knots,
    /// Jumps of the speed.
    pub jumps: Vec<Jump>,
    /// Instants at which the speed smoothly changes its sign, and the middles between the samples around them, in s: dry
    /// friction jumps there.
    turns: Vec<(f64, f64)>,
    /// Standard deviation in m/s of what the positions leave open of the velocity.
    pub velocity_sd_mps: f64,
    /// Standard deviation of the positions' noise in m.
    pub noise_m: f64,
}

/// Position and velocity, linear between knots.
#[derive(Clone, Debug, Default)]
struct Knots {
    /// Time in s, never falling; twice the same at a jump of the speed.
    t: Vec<f64>,
    /// Position in m.
    z: Vec<f64>,
    /// Velocity in m/s.
    v: Vec<f64>,
    /// Integral of the position in m s up to each knot.
    sum_z: Vec<f64>,
    /// Integral of the velocity in m.
    sum_v: Vec<f64>,
}

/// How jumps of the speed show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shown {
    /// A force that follows the speed at once is sampled before or after a jump.
    Sampled,
    /// A force that is late by so many s, or smeared, shows the instants.
    Late(f64),
    /// A force that follows the speed at once, and is late, is sampled before or after a jump.
    SampledLate {
        /// By so many s.
        late_s: f64,
        /// The jumps show between the samples around where they are if it is late by so many s.
        placed_s: f64,
    },
}

/// A jump of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// Its instant in s.
    pub at_s: f64,
    /// The middle between the samples before and after it: what a mean over samples sees.
    pub between_s: f64,
    /// How uncertain the instant is, in s.
    pub doubt_s: f64,
    /// Where it is in m.
    pub z_m: f64,
    /// Velocity in m/s before and after it.
    pub v_mps: [f64; 2],
}

/// Velocity noise in m/s from which on positions are smoothed over as long as they allow.
const NOISY_MPS: f64 = 1.2e-5;

impl Motion {
    /// The motion of a recording whose samples are all finite.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let (t, z) = (&recording.time_s, &recording.position_m);
        let told = velocity(t, z);
        let recorded_sd = roughness(&recording.velocity_mps);
        let mut noise_m = position_noise(t, z);
        let (z, v, kinks, sd) = if told.noise_mps <= NOISY_MPS {
            noise_m = noise_m.min(1e-6);
            (z.clone(), told.v, told.kinks, told.noise_mps)
        } else {
            let calm = settle(t, z);
            (calm.z, calm.v, calm.kinks, calm.sd_mps)
        };
        if recording.velocity_measured && sd > NOISY_MPS && recorded_sd < sd {
            let v = &recording.velocity_mps;
            let sides =
                |k: &Kink| Kink { v: [v[k.sample.saturating_sub(1)], v[k.sample.min(v.len() - 1)]], ..*k };
            let kinks: Vec<Kink> = kinks.iter().map(sides).collect();
            return Self::from_knots(t, &z, v, &kinks, recorded_sd, noise_m);
        }
        Self::from_knots(t, &z, &v, &kinks, sd, noise_m)
    }

    fn from_knots(t: &[f64], z: &[f64], v: &[f64], kinks: &[Kink], sd: f64, noise_m: f64) -> Self {
        let mut m = Self { velocity_sd_mps: sd, noise_m, ..Self::default() };
        let mut kinks = kinks.iter().peekable();
        for i in 0..t.len() {
            while let Some(kink) = kinks.next_if(|k| k.sample <= i) {
                if kink.sample == i && i > 0 {
                    let at_s = kink.t.clamp(t[i - 1], t[i]);
                    let between_s = 0.5 * (t[i - 1] + t[i]);
                    for side in kink.v {
                        m.exact.push(at_s, kink.z, side);
                        m.sampled.push(between_s, kink.z + side * (between_s - at_s), side);
                    }
                    let doubt_s = kink.sd_m / (kink.v[1] - kink.v[0]).abs().max(1e-6);
                    m.jumps.push(Jump { at_s, between_s, doubt_s, z_m: kink.z, v_mps: kink.v });
                }
            }
            m.exact.push(t[i], z[i], v[i]);
            m.sampled.push(t[i], z[i], v[i]);
        }
        // Noisy positions do not tell a turn from a hold.
        if sd <= NOISY_MPS {
            m.find_turns(t);
        }
        m
    }

    /// Where the sign of the speed changes between two samples without a jump.
    fn find_turns(&mut self, t: &[f64]) {
        let mut near = 0;
        let mut before: Option<(f64, f64)> = None;
        for &now in t {
            let v = self.sampled.speed(now, &mut near);
            if let Some((then, was)) = before
                && sgn(v) != sgn(was)
                && !self.jumps.iter().any(|j| j.at_s >= then && j.at_s <= now)
            {
                let share = (was / (was - v)).clamp(0.0, 1.0);
                self.turns.push((then + share * (now - then), 0.5 * (then + now)));
            }
            before = Some((now, v));
        }
    }

    /// Position in m and velocity in m/s at an instant.
    #[must_use]
    pub fn at(&self, at_s: f64) -> (f64, f64) {
        let k = &self.exact;
        let last = k.t.len() - 1;
        let i = k.before(at_s);
        if i == last || at_s <= k.t[i] {
            return (k.z[i], k.v[i]);
        }
        let share = (at_s - k.t[i]) / (k.t[i + 1] - k.t[i]).max(1e-300);
        (k.z[i] + share * (k.z[i + 1] - k.z[i]), k.v[i] + share * (k.v[i + 1] - k.v[i]))
    }

    /// Cuts spans `(from, to)` in s, in their order, at the jumps of the speed, and gives the mean motion of every piece. `between` is the
    /// middle between the samples around an instant of the recording.
    #[must_use]
    pub fn pieces(
        &self,
        spans: impl Iterator<Item = (f64, f64)>,
        shown: Shown,
        between: impl Fn(f64) -> f64,
    ) -> Vec<Piece> {
        let (knots, late_s) = match shown {
            Shown::Sampled => (&self.sampled, 0.0),
            Shown::Late(late_s) | Shown::SampledLate { late_s, .. } => (&self.exact, late_s),
        };
        let seen = |at_s: f64, between_s: f64| match shown {
            Shown::Sampled => between_s,
            Shown::Late(late_s) => at_s + late_s,
            Shown::SampledLate { placed_s, .. } => between(at_s + placed_s),
        };
        let jumps: Vec<f64> = self.jumps.iter().map(|j| seen(j.at_s, j.between_s)).collect();
        let turns: Vec<f64> = self.turns.iter().map(|t| seen(t.0, t.1)).collect();
        let mut out = Vec::new();
        let mut near = 0;
        let (mut jump, mut turn) = (0, 0);
        for (block, (from, to)) in spans.enumerate() {
            let mut at = from;
            let whole = to - from;
            loop {
                while jumps.get(jump).is_some_and(|j| *j <= at + 1e-6 * whole) {
                    jump += 1;
                }
                while turns.get(turn).is_some_and(|t| *t <= at + 1e-6 * whole) {
                    turn += 1;
                }
                let cut = |next: Option<&f64>| next.copied().filter(|j| *j < to - 1e-6 * whole).unwrap_or(to);
                let end = cut(jumps.get(jump)).min(cut(turns.get(turn)));
                // A jump that shows between samples: until there, and from there on, the motion is that of its own side.
                let (before, next) = match shown {
                    Shown::SampledLate { .. } => {
                        (jump.checked_sub(1).and_then(|k| self.jumps.get(k)), self.jumps.get(jump))
                    }
                    _ => (None, None),
                };
                let mut sums = |at_s: f64| match (before, next) {
                    (Some(j), _) if at_s < j.at_s => knots.sums_beside(j, 1, at_s, &mut near),
                    (_, Some(j)) if at_s > j.at_s => knots.sums_beside(j, 0, at_s, &mut near),
                    _ => knots.sums(at_s, &mut near),
                };
                // Slope of the velocity from means over both halves.
                let (z0, v0) = sums(at - late_s);
                let (_, vm) = sums(0.5 * (at + end) - late_s);
                let (z1, v1) = sums(end - late_s);
                let dt = (end - at).max(1e-12);
                let a = ((v1 - vm) - (vm - v0)) / (0.25 * dt * dt);
                out.push(Piece {
                    block: block as u32,
                    from_s: at,
                    to_s: end,
                    z_m: (z1 - z0) / dt,
                    v_mps: (v1 - v0) / dt,
                    a_mps2: a,
                });
                if end >= to {
                    break;
                }
                at = end;
            }
        }
        out
    }
}

impl Knots {
    fn push(&mut self, t: f64, z: f64, v: f64) {
        let (mut sum_z, mut sum_v) = (0.0, 0.0);
        if let (Some(t0), Some(z0), Some(v0)) = (self.t.last(), self.z.last(), self.v.last()) {
            let dt = t - t0;
            sum_z = self.sum_z.last().unwrap_or(&0.0) + 0.5 * dt * (z0 + z);
            sum_v = self.sum_v.last().unwrap_or(&0.0) + 0.5 * dt * (v0 + v);
        }
        self.t.push(t);
        self.z.push(z);
        self.v.push(v);
        self.sum_z.push(sum_z);
        self.sum_v.push(sum_v);
    }

    /// Velocity in m/s at a knot, searched from knot `near` on.
    fn speed(&self, at_s: f64, near: &mut usize) -> f64 {
        while self.t.get(*near + 1).is_some_and(|t| *t <= at_s) {
            *near += 1;
        }
        self.v.get(*near).copied().unwrap_or(0.0)
    }

    /// The last knot at or before `at_s`; the first one when there is none.
    fn before(&self, at_s: f64) -> usize {
        self.t.partition_point(|t| *t <= at_s).saturating_sub(1)
    }

    /// [`sums`](Self::sums) as if the speed of one side of a jump lasted beyond it.
    fn sums_beside(&self, jump: &Jump, side: usize, at_s: f64, near: &mut usize) -> (f64, f64) {
        let (z, v) = self.sums(jump.at_s, near);
        let (dt, speed) = (at_s - jump.at_s, jump.v_mps[side]);
        (z + dt * (jump.z_m + 0.5 * dt * speed), v + dt * speed)
    }

    /// Integrals of position and velocity up to an instant, searched from knot `near` on.
    fn sums(&self, at_s: f64, near: &mut usize) -> (f64, f64) {
        let last = self.t.len() - 1;
        let mut k = (*near).min(last);
        if self.t[k] > at_s {
            k = self.before(at_s);
        }
        while k < last && self.t[k + 1] <= at_s {
            k += 1;
        }
        *near = k;
        let dt = at_s - self.t[k];
        if k == last || dt <= 0.0 {
            return (self.sum_z[k] + dt * self.z[k], self.sum_v[k] + dt * self.v[k]);
        }
        let share = dt / (self.t[k + 1] - self.t[k]);
        let mix = |x: &[f64]| x[k] + 0.5 * share * (x[k + 1] - x[k]);
        (self.sum_z[k] + dt * mix(&self.z), self.sum_v[k] + dt * mix(&self.v))
    }
}

/// A span of time in which the motion is smooth: its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// The block that it belongs to.
    pub block: u32,
    /// Begin in s.
    pub from_s: f64,
    /// End in s.
    pub to_s: f64,
    /// Mean recorded position in m.
    pub z_m: f64,
    /// Mean velocity in m/s.
    pub v_mps: f64,
    /// Acceleration in m/s².
    pub a_mps2: f64,
}

impl Piece {
    /// Position and velocity at an instant within.
    #[must_use]
    pub fn at(&self, t: f64) -> (f64, f64) {
        let s = t - 0.5 * (self.from_s + self.to_s);
        (self.z_m + self.v_mps * s, self.v_mps + self.a_mps2 * s)
    }
}

/// Standard deviation of a column about a smooth course, by its third differences.
fn roughness(x: &[f64]) -> f64 {
    let mut d: Vec<f64> = x.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    stylet_stats::order::median(&mut d) * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9, "{told} for {wanted}");
    }

    /// At 2 m/s, from 0.53 s on back at 1 m/s, sampled every 0.1 s up to 1.2 s.
    fn bent() -> Motion {
        let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
        let z: Vec<f64> = t.iter().map(|t| if *t < 0.53 { 2.0 * t } else { 1.06 - (t - 0.53) }).collect();
        let v: Vec<f64> = t.iter().map(|t| if *t < 0.53 { 2.0 } else { -1.0 }).collect();
        let kink = Kink { sample: 6, t: 0.53, z: 1.06, v: [2.0, -1.0], sd_m: 0.006 };
        Motion::from_knots(&t, &z, &v, &[kink], 0.0, 0.0)
    }

    /// A piece by its block, borders, mean position and velocity.
    fn is(piece: &Piece, block: u32, (from_s, to_s): (f64, f64), z_m: f64, v_mps: f64) {
        assert_eq!(piece.block, block);
        near(piece.from_s, from_s);
        near(piece.to_s, to_s);
        near(piece.z_m, z_m);
        near(piece.v_mps, v_mps);
        assert!(piece.a_mps2.abs() < 1e-9, "{piece:?}");
    }

    fn pieces(m: &Motion, spans: &[(f64, f64)], shown: Shown) -> Vec<Piece> {
        // Between samples every 0.1 s.
        m.pieces(spans.iter().copied(), shown, |t| 0.1 * (10.0 * t).floor() + 0.05)
    }

    #[test]
    fn position_and_velocity_lie_on_lines_between_samples_and_jumps() {
        let m = bent();
        for (at_s, z, v) in [(0.0, 0.0, 2.0), (0.34, 0.68, 2.0), (0.52, 1.04, 2.0), (0.54, 1.05, -1.0)] {
            near(m.at(at_s).0, z);
            near(m.at(at_s).1, v);
        }
        near(m.at(0.97).0, 0.62);
        // Outside it is at the first and last sample.
        assert_eq!(m.at(-0.4), (0.0, 2.0));
        near(m.at(7.0).0, 0.39);
        // A speed that changes between samples.
        let slowing = Motion::from_knots(&[1.0, 1.5, 3.0], &[0.0, 1.0, 4.0], &[3.0, 1.0, 7.0], &[], 0.0, 0.0);
        near(slowing.at(1.125).1, 2.5);
        near(slowing.at(2.0).0, 2.0);
        near(slowing.at(2.0).1, 3.0);
    }

    #[test]
    fn a_jump_of_the_speed_is_known_as_well_as_the_place_where_both_sides_meet() {
        let told = bent().jumps[0];
        near(told.at_s, 0.53);
        near(told.between_s, 0.55);
        near(told.doubt_s, 0.002);
        assert_eq!((told.z_m, told.v_mps), (1.06, [2.0, -1.0]));
        // Between its samples, whatever is said of its instant; a change of the speed counts from a micrometre per second on.
        let kink =
            |sample: usize, t: f64, after: f64| Kink { sample, t, z: 0.0, v: [1.0, after], sd_m: 3e-6 };
        let of = |kinks: &[Kink]| {
            Motion::from_knots(&[0.0, 1.0, 2.0, 3.0], &[0.0; 4], &[1.0; 4], kinks, 0.0, 0.0).jumps
        };
        let told = of(&[kink(0, 0.0, 2.0), kink(1, 1.2, 1.5), kink(3, 1.7, 1.0), kink(4, 3.5, 2.0)]);
        assert_eq!(told.iter().map(|j| (j.at_s, j.between_s)).collect::<Vec<_>>(), [(1.0, 0.5), (2.0, 2.5)]);
        near(told[0].doubt_s, 6e-6);
        near(told[1].doubt_s, 3.0);
    }

    #[test]
    fn pieces_are_means_of_the_motion_as_samples_show_it() {
        let m = bent();
        let spans = [(-0.1, 0.1), (0.3, 0.5), (0.5, 0.7), (0.7, 0.77), (1.15, 1.25)];
        let told = pieces(&m, &spans, Shown::Sampled);
        assert_eq!(told.len(), 6);
        // Before the first sample it is where it is then, and as fast.
        is(&told[0], 0, (-0.1, 0.1), 0.25 * 0.2, 2.0);
        is(&told[1], 1, (0.3, 0.5), 0.8, 2.0);
        // The jump shows in the middle between its samples, each side as it went.
        is(&told[2], 2, (0.5, 0.55), 1.05, 2.0);
        is(&told[3], 2, (0.55, 0.7), 0.965, -1.0);
        is(&told[4], 3, (0.7, 0.77), 0.855, -1.0);
        is(&told[5], 4, (1.15, 1.25), 0.5 * (0.415 + 0.39), -1.0);
        // A border at a jump cuts nothing.
        let told = pieces(&m, &[(0.4, 0.55), (0.55, 0.6)], Shown::Sampled);
        assert_eq!(told.len(), 2);
        is(&told[1], 1, (0.55, 0.6), 1.015, -1.0);
        // Nor does one nearer to it than a millionth of the span, on either side; a turn neither.
        let cuts =
            |m: &Motion, from_s: f64, to_s: f64| pieces(m, &[(from_s, to_s)], Shown::Sampled).len() - 1;
        let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
        let v: Vec<f64> = t.iter().map(|t| 1.0 - 1.8 * t).collect();
        let turn = Motion::from_knots(&t, &[0.0; 13], &v, &[], 0.0, 0.0);
        for m in [&m, &turn] {
            for (share, wanted) in [(3e-7, 0), (3e-6, 1)] {
                assert_eq!(cuts(m, 0.55 - 0.2 * share, 0.75), wanted);
                assert_eq!(cuts(m, 0.35, 0.55 + 0.2 * share), wanted);
                assert_eq!(cuts(m, 0.55 - 0.02 * share, 0.57), wanted);
            }
        }
    }

    #[test]
    fn a_late_force_shows_the_motion_of_before() {
        let m = bent();
        let told = pieces(&m, &[(0.3, 0.5), (0.5, 0.7), (0.7, 0.9)], Shown::Late(0.04));
        assert_eq!(told.len(), 4);
        is(&told[0], 0, (0.3, 0.5), 0.72, 2.0);
        is(&told[1], 1, (0.5, 0.57), 2.0 * 0.495, 2.0);
        is(&told[2], 1, (0.57, 0.7), 1.06 - 0.065, -1.0);
        is(&told[3], 2, (0.7, 0.9), 1.06 - 0.23, -1.0);
        // Without a delay it shows the instant.
        let told = pieces(&m, &[(0.5, 0.7)], Shown::Late(0.0));
        is(&told[0], 0, (0.5, 0.53), 1.03, 2.0);
        is(&told[1], 0, (0.53, 0.7), 1.06 - 0.085, -1.0);
    }

    #[test]
    fn a_late_force_that_is_sampled_shows_each_side_up_to_the_middle_between_samples() {
        let m = bent();
        let spans = [(0.3, 0.5), (0.5, 0.7), (0.7, 0.9)];
        let placed = |late_s: f64, placed_s: f64| pieces(&m, &spans, Shown::SampledLate { late_s, placed_s });
        // It jumps at 0.57 s and shows so at 0.55 s: the way back lasts longer than it did.
        let told = placed(0.04, 0.04);
        assert_eq!(told.len(), 4);
        is(&told[0], 0, (0.3, 0.5), 0.72, 2.0);
        is(&told[1], 1, (0.5, 0.55), 2.0 * 0.485, 2.0);
        is(&told[2], 1, (0.55, 0.7), 1.06 - (0.625 - 0.57), -1.0);
        is(&told[3], 2, (0.7, 0.9), 1.06 - (0.8 - 0.57), -1.0);
        // It jumps at 0.54 s: the way in does.
        let told = placed(0.01, 0.01);
        is(&told[1], 1, (0.5, 0.55), 2.0 * 0.515, 2.0);
        is(&told[2], 1, (0.55, 0.7), 1.06 - (0.625 - 0.54), -1.0);
        // Where it is placed need not be where it is late to.
        let told = placed(0.01, 0.08);
        assert_eq!(told.len(), 4);
        is(&told[1], 1, (0.5, 0.65), 2.0 * 0.565, 2.0);
        is(&told[2], 1, (0.65, 0.7), 1.06 - (0.675 - 0.54), -1.0);
    }

    #[test]
    fn a_piece_knows_how_the_speed_grows() {
        // v = 1 + 3 t at the samples, and between them on lines: so it is anywhere.
        let t: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k)).collect();
        let v: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t).collect();
        let m = Motion::from_knots(&t, &[0.25; 20], &v, &[], 0.0, 0.0);
        for p in pieces(&m, &[(0.23, 0.61), (0.61, 0.75), (1.0, 1.1)], Shown::Sampled) {
            assert!((p.a_mps2 - 3.0).abs() < 1e-9, "{p:?}");
            near(p.v_mps, 1.0 + 1.5 * (p.from_s + p.to_s));
            near(p.z_m, 0.25);
            near(p.at(p.from_s).1, 1.0 + 3.0 * p.from_s);
            near(p.at(p.to_s).0, 0.25 + p.v_mps * 0.5 * (p.to_s - p.from_s));
        }
    }

    #[test]
    fn dry_friction_jumps_where_the_speed_smoothly_turns() {
        let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
        let of = |v: &dyn Fn(f64) -> f64, sd: f64| {
            let v: Vec<f64> = t.iter().map(|t| v(*t)).collect();
            Motion::from_knots(&t, &[0.0; 13], &v, &[], sd, 0.0)
        };
        // 1 m/s at first, through zero at 5/11 s.
        let slowing = of(&|t| 1.0 - 2.2 * t, 0.0);
        assert_eq!(slowing.turns.len(), 1);
        near(slowing.turns[0].0, 1.0 / 2.2);
        near(slowing.turns[0].1, 0.45);
        // Samples show it in their middle, a late force when it gets there.
        let cut = |shown: Shown| {
            let told = pieces(&slowing, &[(0.3, 0.4), (0.4, 0.6)], shown);
            assert_eq!(told.iter().map(|p| p.block).collect::<Vec<_>>(), [0, 1, 1]);
            told[1].to_s
        };
        near(cut(Shown::Sampled), 0.45);
        near(cut(Shown::Late(0.02)), 1.0 / 2.2 + 0.02);
        near(cut(Shown::SampledLate { late_s: 0.02, placed_s: 0.06 }), 0.55);
        // There and back: one turn each.
        let swinging = of(&|t| (core::f64::consts::TAU * (t + 0.03)).cos(), 0.0);
        let middles: Vec<f64> = swinging.turns.iter().map(|t| t.1).collect();
        assert_eq!(middles.len(), 2);
        near(middles[0], 0.25);
        near(middles[1], 0.75);
        // None without a change of the sign, in a hold, or where the speed jumps; noisy positions tell none.
        assert!(of(&|t| 1.0 - 0.8 * t, 0.0).turns.is_empty());
        assert!(of(&|_| 0.0, 0.0).turns.is_empty());
        assert!(bent().turns.is_empty());
        assert_eq!(of(&|t| 1.0 - 2.2 * t, NOISY_MPS).turns.len(), 1);
        assert!(of(&|t| 1.0 - 2.2 * t, 1.01 * NOISY_MPS).turns.is_empty());
        // A jump elsewhere is not this turn.
        let kink =
            |sample: usize| Kink { sample, t: 0.1 * sample as f64 - 0.05, z: 0.0, v: [1.0, 0.9], sd_m: 0.0 };
        let both = |sample: usize| {
            let v: Vec<f64> = t.iter().map(|t| 1.0 - 2.2 * t).collect();
            Motion::from_knots(&t, &[0.0; 13], &v, &[kink(sample)], 0.0, 0.0)
        };
        assert_eq!([4, 5, 6].map(|sample| both(sample).turns.len()), [1, 0, 1]);
        // What comes after a span does not cut it, a jump at 0.35 s and a turn at 0.45 s.
        let told = pieces(&both(4), &[(0.0, 0.3), (0.3, 0.5)], Shown::Sampled);
        let ends: Vec<f64> = told.iter().map(|p| p.to_s).collect();
        assert_eq!(ends.len(), 4);
        ends.iter().zip([0.3, 0.35, 0.45, 0.5]).for_each(|(told, wanted)| near(*told, wanted));
    }

    #[test]
    fn a_motion_that_comes_to_rest_smoothly_turns_where_it_does() {
        let t: Vec<f64> = (0..8).map(f64::from).collect();
        let v = [0.3, 0.2, 0.1, 0.0, 0.0, -0.2, -0.1, -0.1];
        let m = Motion::from_knots(&t, &[0.0; 8], &v, &[], 0.0, 0.0);
        assert_eq!(m.turns, [(3.0, 2.5), (4.0, 4.5)]);
    }

    #[test]
    fn roughness_is_what_third_differences_leave() {
        let parabola: Vec<f64> = (0..40).map(|k| f64::from(k * k) - 3.0 * f64::from(k)).collect();
        near(roughness(&parabola), 0.0);
        // Alternating by one to either side: third differences of eight.
        let rough: Vec<f64> =
            parabola.iter().enumerate().map(|(k, x)| x + if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!((roughness(&rough) - 8.0 * 1.4826 / 20.0_f64.sqrt()).abs() < 1e-3, "{}", roughness(&rough));
        // A step in two samples of forty is none.
        let cubic: Vec<f64> = (0..40).map(|k| f64::from(k).powi(3) / 6.0).collect();
        assert!((roughness(&cubic) - 1.4826 / 20.0_f64.sqrt()).abs() < 1e-3);
    }

    #[test]
    fn a_measured_velocity_is_taken_when_it_is_better_than_what_positions_tell() {
        let t: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.005).collect();
        // Rough positions; slower from a second and a half on.
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
            Motion::of(&r)
        };
        let told = of(0.0, true);
        assert_eq!((told.at(1.0).1, told.at(2.5).1), (0.031, 0.0051));
        assert_eq!(told.velocity_sd_mps, 0.0);
        // Where they jump the positions tell.
        assert_eq!(told.jumps.len(), 1);
        assert!((told.jumps[0].at_s - 1.5).abs() < 0.05, "{:?}", told.jumps);
        // Nobody measured, or too roughly.
        for from_positions in [of(0.0, false), of(0.01, true)] {
            assert!((from_positions.at(1.0).1 - 0.03).abs() < 3e-4, "{}", from_positions.at(1.0).1);
            assert!(from_positions.velocity_sd_mps > NOISY_MPS);
        }
    }

    /// At 1.1 mm/s an encoder of 50 um stands still in eight samples of nine, at 0.2 mm/s in forty-nine of fifty.
    #[test]
    fn a_needle_slower_than_a_step_per_sample_goes_evenly() {
        for speed_mps in [0.0011, 0.0002, 0.006] {
            let t: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.005).collect();
            let true_m = |t: f64| if t < 25.0 { speed_mps * t } else { speed_mps * (50.0 - t) };
            let z: Vec<f64> = t.iter().map(|t| (true_m(*t) / 5e-5).round() * 5e-5).collect();
            let force = vec![0.0; t.len()];
            let m = Motion::of(&Recording::new(t, z, force).expect("a recording"));
            for k in 1..240 {
                let (at, told) = (0.1 * f64::from(k), m.at(0.1 * f64::from(k)).1);
                assert!((told - speed_mps).abs() < 1e-5, "{speed_mps} m/s: {told} at {at} s");
            }
        }
    }

    /// A needle that goes evenly, rests and goes back has equal differences, too; its positions are exact.
    #[test]
    fn even_motion_with_rests_is_not_rounded() {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.005).collect();
        let z: Vec<f64> =
            t.iter().map(|t| 0.003 * if *t < 8.0 { *t } else { 8.0 - (*t - 12.0).max(0.0) }).collect();
        let force = vec![0.0; t.len()];
        let m = Motion::of(&Recording::new(t, z, force).expect("a recording"));
        assert!(m.noise_m < 1e-9, "{}", m.noise_m);
        assert_eq!(m.jumps.len(), 2);
    }
}
