//! The forward model: the tissue law replayed over a measured motion, then the measuring chain.
//!
//! With ruptures imposed where the data show them the force is smooth in nearly every parameter, and
//! each rupture adds one event: how far the law is from rupturing there by itself. With free ruptures
//! the law decides, as in any simulation.

use crate::model::Compiled;
use crate::noise::Noise;
use crate::track::{NEVER, Track};
use stylet_tissue::{LawState, MeasurementState, Reading, Strain, TissueForce};

/// What a layer's rupture says of the law: its strain at the instant that the data show.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// Distance from rupture in standard deviations of what sampling leaves open; positive: the law
    /// would have ruptured before, negative: not yet.
    pub u: f64,
    /// Elastic force in N half-way between the last sample before the rupture and the first after.
    pub elastic_n: f64,
    /// Ratio of the actual puncture force (speed) to the layer's own.
    pub ratio: f64,
    /// What it was worked out from.
    strained: Strained,
    ruptured: bool,
}

/// Relative uncertainty of an elastic force at rupture beyond sampling.
const FORCE_FLOOR: f64 = 5e-5;
/// Uncertainty of a position in m beyond sampling.
const POSITION_FLOOR_M: f64 = 1e-6;

/// What must pass zero for a rupture: its largest value up to the sample before last, and the last two.
#[derive(Clone, Copy, Debug)]
struct Course {
    most: f64,
    before: f64,
    at: f64,
}

impl Course {
    const UNSEEN: Self = Self { most: f64::NEG_INFINITY, before: f64::NEG_INFINITY, at: f64::NEG_INFINITY };

    fn note(&mut self, value: f64) {
        self.most = self.most.max(self.before);
        self.before = self.at;
        self.at = value;
    }

    /// Largest value before the last.
    fn largest_before(&self) -> f64 {
        self.most.max(self.before)
    }

    /// Half-way between the last sample and the largest before, of which none is taken for less than `least`, and
    /// what they leave open beyond a floor. Where the largest came before and was not passed again, it says how far
    /// this is from a rupture, and the last step what sampling leaves open.
    fn passed(&self, least: f64, floor: f64) -> (f64, f64) {
        let before = self.largest_before().max(least);
        if self.at >= before {
            (mid(before, self.at), spread(before, self.at, floor))
        } else {
            (before, spread(self.before.max(least), self.at, floor))
        }
    }
}

/// Strain before and at the rupture of one layer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strained {
    force: Course,
    place: Course,
    elastic_before: f64,
    elastic_at: f64,
    puncture: f64,
    seen: bool,
}

const UNSEEN: Strained = Strained {
    force: Course::UNSEEN,
    place: Course::UNSEEN,
    elastic_before: 0.0,
    elastic_at: 0.0,
    puncture: f64::INFINITY,
    seen: false,
};

impl Strained {
    fn note(&mut self, s: &Strain) {
        self.elastic_before = if self.seen { self.elastic_at } else { 0.0 };
        self.elastic_at = s.elastic_n;
        self.force.note(s.elastic_n - s.puncture_n);
        self.place.note(s.tip_m - s.far_m);
        self.puncture = s.puncture_n;
        self.seen = true;
    }

    /// The same with the elastic force and the puncture force changed by these shares.
    fn changed(&self, elastic: f64, puncture: f64) -> Self {
        let by = |elastic_n: f64| {
            elastic * elastic_n - if self.puncture.is_finite() { puncture * self.puncture } else { 0.0 }
        };
        Self {
            force: Course {
                most: self.force.most + by(self.elastic_before),
                before: self.force.before + by(self.elastic_before),
                at: self.force.at + by(self.elastic_at),
            },
            elastic_before: self.elastic_before * (1.0 + elastic),
            elastic_at: self.elastic_at * (1.0 + elastic),
            puncture: self.puncture * (1.0 + puncture),
            ..*self
        }
    }

    fn event(&self, ruptured: bool, own_puncture: f64) -> Event {
        let ratio = if self.puncture.is_finite() { self.puncture / own_puncture } else { 1.0 };
        let event = Event { u: 0.0, elastic_n: self.elastic_at, ratio, strained: *self, ruptured };
        if !ruptured {
            // Nothing is known but that it did not happen.
            let step = (self.elastic_at - self.elastic_before).abs();
            let by_force = self.force.largest_before().max(self.force.at) / (self.floor_n() + step);
            let u = by_force.max(self.place.largest_before().max(self.place.at) / 1e-5).max(0.0);
            return Event { u, ..event };
        }
        let by_force = if self.puncture.is_finite() {
            let (mid, spread) = self.force_and_spread();
            mid / spread
        } else {
            f64::NAN
        };
        let by_place = self.by_place();
        let u = if by_force.is_nan() { by_place } else { by_force.max(by_place) };
        Event { u, elastic_n: mid(self.elastic_before, self.elastic_at), ..event }
    }

    fn floor_n(&self) -> f64 {
        FORCE_FLOOR * self.puncture.min(1e3) + 1e-5
    }

    /// Force beyond the puncture force around the rupture, and what sampling leaves open of it, in N.
    fn force_and_spread(&self) -> (f64, f64) {
        self.force.passed(-1e3, self.floor_n())
    }

    /// Distance from the layer's far side in standard deviations.
    fn by_place(&self) -> f64 {
        let (mid, spread) = self.place.passed(self.place.at - 1e-2, POSITION_FLOOR_M);
        mid / spread
    }
}

fn mid(lo: f64, hi: f64) -> f64 {
    0.5 * (lo + hi)
}

/// Standard deviation of a value that lies anywhere between two, and of a floor.
fn spread(lo: f64, hi: f64, floor: f64) -> f64 {
    let half = 0.5 * (hi - lo).abs();
    (half * half / 3.0 + floor * floor).sqrt()
}

impl Event {
    /// How far the elastic force at rupture is from the puncture force, as a share of it, and the standard deviation
    /// that sampling leaves; `None` where no force says when the layer ruptured.
    #[must_use]
    pub fn by_force(&self) -> Option<(f64, f64)> {
        let puncture = self.strained.puncture;
        let known = self.ruptured && puncture.is_finite() && puncture > 0.0 && self.strained.seen;
        let (mid, spread) = self.strained.force_and_spread();
        let by_place = self.strained.by_place();
        (known && mid / spread >= by_place).then_some((mid / puncture, spread / puncture))
    }

    /// The same were the puncture force larger by this share.
    #[must_use]
    pub fn with_puncture(&self, share: f64) -> Self {
        let own = self.strained.puncture / self.ratio;
        self.strained.changed(0.0, share).event(self.ruptured, own * (1.0 + share))
    }

    /// Its distance from rupture were the elastic force and the puncture force larger by these shares.
    #[must_use]
    pub fn u_at(&self, elastic: f64, puncture: f64) -> f64 {
        let own = self.strained.puncture / self.ratio;
        self.strained.changed(elastic, puncture).event(self.ruptured, own * (1.0 + puncture)).u
    }
}

/// Most layers that a replay keeps events of.
const LAYERS: usize = 16;

/// A replay with imposed ruptures under way; a clone goes on from the same instant.
#[derive(Clone)]
pub(crate) struct Replay {
    pub(crate) state: LawState,
    chain: Option<MeasurementState>,
    strained: [Strained; LAYERS],
    done: usize,
    kink: usize,
    before: Option<(f64, f64, f64)>,
}

impl Replay {
    /// Before the first sample.
    pub(crate) fn start(model: &Compiled, track: &Track) -> Self {
        Self {
            state: LawState::default(),
            chain: model.measures.then(|| model.chain.start(track.sample_hz * 4.0)),
            strained: [UNSEEN; LAYERS],
            done: 0,
            kink: 0,
            before: None,
        }
    }

    /// The tissue's force at sample `i`, to be called in order.
    #[inline]
    pub(crate) fn tissue(
        &mut self,
        model: &Compiled,
        track: &Track,
        ruptures: &[f64],
        i: usize,
    ) -> TissueForce {
        let now = (track.t[i], track.z[i] * model.to_true, track.v[i] * model.to_true);
        while let Some(&at) = ruptures.get(self.done).filter(|r| **r - model.delay_s <= now.0) {
            if model.feels_instants {
                self.kinks(model, track, i, at - model.delay_s);
                self.rupture(model, track, i, now, at - model.delay_s);
            }
            self.done += 1;
        }
        if model.feels_instants {
            self.kinks(model, track, i, NEVER);
        }
        self.before = Some(now);
        let strained = &mut self.strained;
        model.law.step_imposed(&mut self.state, now.0, now.1, now.2, self.done, |s| {
            if let Some(mine) = strained.get_mut(s.layer - 1) {
                mine.note(&s);
            }
        })
    }

    /// Jumps of the velocity between the sample before and sample `i`, as far as they come before `until_s`.
    #[inline]
    fn kinks(&mut self, model: &Compiled, track: &Track, i: usize, until_s: f64) {
        while let Some(kink) = track.kinks.get(self.kink).filter(|k| k.sample <= i && k.t < until_s) {
            self.kink += 1;
            if kink.sample == i {
                let z = kink.z * model.to_true;
                for v in kink.v {
                    self.between(model, track, i, (kink.t, z, v * model.to_true), self.done);
                }
            }
        }
    }

    /// Law and chain at an instant between the sample before and sample `i`.
    fn between(
        &mut self,
        model: &Compiled,
        track: &Track,
        i: usize,
        (time_s, z, velocity_mps): (f64, f64, f64),
        done: usize,
    ) {
        let force = model.law.step_imposed(&mut self.state, time_s, z, velocity_mps, done, |_| {});
        if let Some(chain) = &mut self.chain {
            let (tissue_n, acceleration_mps2) = (force.total_n, track.a[i] * model.to_true);
            let reading = Reading { time_s, velocity_mps, acceleration_mps2, tissue_n, noise_n: 0.0 };
            model.chain.step(chain, &reading);
        }
        self.before = Some((time_s, z, velocity_mps));
    }

    /// A rupture between the sample before and sample `i`, at its instant: law and chain see the force
    /// just before and just after it.
    #[cold]
    fn rupture(&mut self, model: &Compiled, track: &Track, i: usize, now: (f64, f64, f64), at_s: f64) {
        let before = self.before.unwrap_or(now);
        // What the strain would have been at the sample, had nothing happened.
        let mut peek = self.state;
        let (strained, done) = (&mut self.strained, self.done);
        model.law.step_imposed(&mut peek, now.0, now.1, now.2, done, |s| {
            if let Some(mine) = strained.get_mut(s.layer - 1) {
                mine.note(&s);
            }
        });
        let span = now.0 - before.0;
        let share = if span > 0.0 { ((at_s - before.0) / span).clamp(0.0, 1.0) } else { 1.0 };
        let mix = |a: f64, b: f64| a + share * (b - a);
        let (t, z, v) = (mix(before.0, now.0), mix(before.1, now.1), mix(before.2, now.2));
        for done in [done, done + 1] {
            self.between(model, track, i, (t, z, v), done);
        }
    }

    /// The recorded force at sample `i`, to be called in order.
    #[inline]
    pub(crate) fn step(&mut self, model: &Compiled, track: &Track, ruptures: &[f64], i: usize) -> f64 {
        let tissue_n = self.tissue(model, track, ruptures, i).total_n;
        match &mut self.chain {
            None => tissue_n,
            Some(chain) => measure(model, chain, track, i, tissue_n),
        }
    }

    /// The event of a layer (0-based).
    pub(crate) fn event(&self, model: &Compiled, ruptures: &[f64], layer: usize) -> Event {
        let ruptured = ruptures.get(layer).is_some_and(|r| *r != NEVER);
        let own = model.law.slabs().get(layer).map_or(f64::INFINITY, |s| s.puncture_n);
        self.strained.get(layer).unwrap_or(&UNSEEN).event(ruptured, own)
    }
}

/// Replays with imposed ruptures (`ruptures[i]`: the time (s) at which the recorded force shows the rupture of
/// layer `i`, or [`NEVER`]); writes the recorded force that the model predicts and one event per
/// layer.
pub fn imposed(model: &Compiled, track: &Track, ruptures: &[f64], out: &mut [f64], events: &mut Vec<Event>) {
    let mut replay = Replay::start(model, track);
    for (i, out) in out.iter_mut().enumerate() {
        *out = replay.step(model, track, ruptures, i);
    }
    events.clear();
    events.extend((0..model.law.slabs().len().min(LAYERS)).map(|l| replay.event(model, ruptures, l)));
}

/// How much of a departure counts at the sample of a drop, in standard deviations of the noise.
const MIXED_SD: f64 = 3.0;

/// Turns predicted forces into recorded less predicted ones. A sample at which the force jumps may have
/// seen it from before and after, whatever the sensor does between samples: between the predictions it
/// counts for little. That is the first one after a rupture, and with a delay or a lag also those at which
/// jumps of the velocity arrive. `e` begins at sample `from`.
pub(crate) fn departures(
    model: &Compiled,
    track: &Track,
    ruptures: &[f64],
    noise: &Noise,
    from: usize,
    e: &mut [f64],
) {
    let least = MIXED_SD * noise.marginal_n;
    let mut mixed: Vec<(usize, f64)> = Vec::new();
    let mut note = |k: usize, after: bool| {
        let Some(k) = k.checked_sub(from).filter(|k| *k > 0 && k + 1 < e.len()) else { return };
        let (mut lo, mut hi) = (e[k - 1].min(e[k]), e[k - 1].max(e[k]));
        if after {
            (lo, hi) = (lo.min(e[k + 1]), hi.max(e[k + 1]));
        }
        let f = track.f[from + k];
        let beyond = f - f.clamp(lo, hi);
        mixed.push((k, beyond + (f - e[k] - beyond).clamp(-least, least)));
    };
    let at_kinks = model.delay_s > 0.0 || model.smears;
    let kinks = track.kinks.iter().filter(|_| at_kinks).map(|k| (k.t + model.delay_s, true));
    let ruptures = ruptures.iter().map(|t| (*t, false));
    for (at, after) in ruptures.chain(kinks).filter(|at| at.0.is_finite()) {
        let k = track.first_from(at);
        note(k, after);
        if model.delay_s > 0.0
            && k > 0
            && k < track.len()
            && at - track.t[k - 1] < NEAR * (track.t[k] - track.t[k - 1])
        {
            note(k - 1, true);
        }
    }
    for (e, f) in e.iter_mut().zip(&track.f[from..]) {
        *e = f - *e;
    }
    for (k, departure) in mixed {
        e[k] = departure;
    }
}

/// A delayed jump so near (share of a sample) after a sample may already show there.
const NEAR: f64 = 0.3;

fn measure(model: &Compiled, chain: &mut MeasurementState, track: &Track, i: usize, tissue_n: f64) -> f64 {
    let reading = Reading {
        time_s: track.t[i],
        velocity_mps: track.v[i] * model.to_true,
        acceleration_mps2: track.a[i] * model.to_true,
        tissue_n,
        noise_n: 0.0,
    };
    model.chain.step(chain, &reading)
}

/// Replays with the law's own ruptures; returns the instants (s) at which the recorded force shows them.
pub fn free(model: &Compiled, track: &Track, out: &mut [f64]) -> Vec<f64> {
    let mut state = LawState::default();
    let mut instants = vec![NEVER; model.law.slabs().len()];
    for i in 0..track.len() {
        let (t, z, v) = (track.t[i], track.z[i] * model.to_true, track.v[i] * model.to_true);
        model.law.step(&mut state, t, z, v, |r| {
            if let Some(instant) = instants.get_mut(r.layer - 1) {
                *instant = r.time_s + model.delay_s;
            }
        });
    }
    imposed(model, track, &instants, out, &mut Vec::new());
    instants
}

#[cfg(test)]
mod tests {
    use super::Course;

    fn after(values: impl IntoIterator<Item = f64>) -> Course {
        let mut course = Course::UNSEEN;
        values.into_iter().for_each(|v| course.note(v));
        course
    }

    /// A force that rises steadily passes zero somewhere between its last two samples.
    #[test]
    fn a_steady_rise_passes_between_the_last_two_samples() {
        let (mid, spread) = after([-0.3, -0.2, -0.04, 0.06]).passed(-1e3, 0.0);
        assert!((mid - 0.01).abs() < 1e-12);
        assert!((spread - 0.05 / 3.0_f64.sqrt()).abs() < 1e-12);
    }

    /// A law that had to rupture long before, and hardly moves now, is not excused by how far it has come back since.
    #[test]
    fn a_rupture_that_was_due_long_before_is_far_off() {
        let rise = (0..20).map(|k| -0.1 + 0.01 * f64::from(k));
        let fall = (0..50).map(|k| 0.09 - 0.001 * f64::from(k));
        let (off, spread) = after(rise.chain(fall)).passed(-1e3, 0.0);
        assert!((off - 0.09).abs() < 1e-12);
        assert!(off / spread > 100.0);
    }

    /// Nor is one that came near once, and is far from rupture now, credited with more than it reached.
    #[test]
    fn a_rupture_that_came_near_once_is_as_far_as_it_came() {
        let (off, spread) = after([-0.3, -0.02, -0.1, -0.1 - 1e-4]).passed(-1e3, 1e-5);
        assert!((off + 0.02).abs() < 1e-12);
        assert!(off / spread < -100.0);
    }
}
