//! A linear look at many starts: how much would the objective gain if the start's change of the force,
//! less what the parameters already fitted can imitate, were added in the right amount.

use crate::fit::{Data, Residuals, dot, jacobian, normal, residuals, solve};
use crate::model::{Model, Slot};
use crate::starts::Start;

/// The model that stands, taken apart for looking.
pub struct Look<'a> {
    model: &'a Model,
    data: &'a Data,
    at: Residuals,
    /// Root weights of samples and events.
    root: Vec<f64>,
    /// Weighted residuals.
    r: Vec<f64>,
    /// Orthonormal weighted columns of the fitted numbers.
    q: Vec<Vec<f64>>,
    /// The fitted numbers, their weighted columns and normal matrix.
    p: Vec<f64>,
    columns: Vec<Vec<f64>>,
    h: Vec<Vec<f64>>,
    slots: Vec<Slot>,
}

/// Share of a start's change that is left where the fitted numbers imitate it nearly.
const IMITATED: f64 = 0.1;

/// What a look at a start shows.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The start, scaled to its best amount.
    pub start: Start,
    /// Nats that the linear model gains.
    pub gain: f64,
    /// Nats that the start's own size would cost if it were there and ignored.
    pub visible: f64,
    /// Where the numbers fitted before, which imitate most of the start, have to go when it is added.
    pub given_way: Option<Vec<f64>>,
}

impl<'a> Look<'a> {
    /// Takes the model apart; `None` when it cannot be replayed.
    #[must_use]
    pub fn new(model: &'a Model, data: &'a Data) -> Option<Self> {
        let (mut at, mut work) = (Residuals::default(), Residuals::default());
        if !residuals(model, data, &mut at) {
            return None;
        }
        let jac = jacobian(model, data, &at, &mut work, None);
        let all = || at.w.iter().copied().chain(at.events.iter().map(|e| e.u));
        let root: Vec<f64> = all()
            .map(|w| {
                let size: f64 = w.abs();
                if size <= crate::fit::HUBER { 1.0 } else { (crate::fit::HUBER / size).sqrt() }
            })
            .collect();
        let r: Vec<f64> = all().zip(&root).map(|(w, s)| w * s).collect();
        let (h, _) = normal(model, &jac, &at);
        let columns = jac.columns.iter().map(|c| c.iter().zip(&root).map(|(x, s)| x * s).collect()).collect();
        // Gram-Schmidt with the prior's pull as one further row per base number.
        let m = jac.slots.len();
        let mut q: Vec<Vec<f64>> = Vec::new();
        for (j, column) in jac.columns.iter().enumerate() {
            let mut c: Vec<f64> = column.iter().zip(&root).map(|(x, s)| x * s).collect();
            let base = matches!(jac.slots[j].role, crate::model::Role::Base { .. });
            c.extend((0..m).map(|k| if k == j && base { 1.0 / model.tolerance } else { 0.0 }));
            let size = dot(&c, &c);
            if size == 0.0 {
                continue;
            }
            for _ in 0..2 {
                for u in &q {
                    let share = dot(u, &c);
                    c.iter_mut().zip(u).for_each(|(c, u)| *c -= share * u);
                }
            }
            let left = dot(&c, &c);
            if left > 1e-10 * size {
                let scale = 1.0 / left.sqrt();
                c.iter_mut().for_each(|c| *c *= scale);
                q.push(c);
            }
        }
        let n = at.w.len() + at.events.len();
        for u in &mut q {
            u.truncate(n);
        }
        let p = model.vector(&jac.slots);
        Some(Self { model, data, at, root, r, q, p, columns, h, slots: jac.slots })
    }

    /// Change of the weighted residuals by an effect, less what the fitted numbers imitate.
    fn change(&self, start: &Start, work: &mut Residuals) -> Option<(Vec<f64>, f64, Vec<f64>)> {
        let trial = self.model.with(start.choice.clone());
        if !residuals(&trial, self.data, work) {
            return None;
        }
        let new = work.w.iter().copied().chain(work.events.iter().map(|e| e.u));
        let old = self.at.w.iter().copied().chain(self.at.events.iter().map(|e| e.u));
        let mut d: Vec<f64> = new.zip(old).zip(&self.root).map(|((n, o), s)| (n - o) * s).collect();
        let size = dot(&d, &d);
        let whole = d.clone();
        for u in &self.q {
            let share = dot(u, &d);
            d.iter_mut().zip(u).for_each(|(d, u)| *d -= share * u);
        }
        Some((d, size, whole))
    }

    /// The fitted numbers when `amount` of a change is added.
    fn give_way(&self, change: &[f64], amount: f64) -> Option<Vec<f64>> {
        let g: Vec<f64> = self.columns.iter().map(|c| -amount * dot(c, change)).collect();
        let live: Vec<usize> =
            (0..g.len()).filter(|i| self.h[*i][*i] > 0.0 && !self.slots[*i].stepped).collect();
        let sub: Vec<Vec<f64>> = live.iter().map(|&i| live.iter().map(|&j| self.h[i][j]).collect()).collect();
        let right: Vec<f64> = live.iter().map(|&i| g[i]).collect();
        let d = solve(&sub, &right)?;
        let mut p = self.p.clone();
        for (&i, d) in live.iter().zip(d) {
            p[i] = (p[i] + d).clamp(self.slots[i].low, self.slots[i].high);
        }
        Some(p)
    }

    /// Looks at a start.
    #[must_use]
    pub fn at(&self, start: &Start, work: &mut Residuals) -> Option<Seen> {
        if start.quadrature {
            return self.both_phases(start, work);
        }
        let (d, size, whole) = self.change(start, work)?;
        let left = dot(&d, &d);
        let nothing = Seen { start: start.clone(), gain: 0.0, visible: 0.5 * left, given_way: None };
        if left <= 1e-9 * size || left < 1e-12 {
            return Some(Seen { visible: 0.0, ..nothing });
        }
        let amount = -dot(&d, &self.r) / left;
        let gain = 0.5 * amount * amount * left;
        let mut start = start.clone();
        let info = start.choice.info;
        let signed = info.parameters.iter().any(|p| p.strength && p.low < p.neutral);
        if amount < 0.0 && !signed {
            return Some(nothing);
        }
        let scale = if amount < 0.0 { amount.clamp(-5.0, -0.01) } else { amount.clamp(0.01, 5.0) };
        if info.id == "power_law_friction" {
            let value = &mut start.choice.values[0];
            *value = (1.0 + (*value - 1.0) * scale).clamp(0.2, 2.0);
        }
        if !matches!(
            info.id,
            "power_law_friction" | "rate_dependent_puncture" | "boundary_shift" | "position_scale"
        ) && info.id != "needle_compliance"
            && info.id != "hidden_membrane"
        {
            for (value, p) in start.choice.values.iter_mut().zip(info.parameters) {
                let scalable =
                    p.strength && !matches!(info.id, "low_pass_lag" | "time_delay" | "soft_boundary");
                if scalable {
                    *value = (*value * scale).clamp(p.low, p.high.min(p.search.1));
                }
            }
        }
        let given_way = (left < IMITATED * size).then(|| self.give_way(&whole, scale)).flatten();
        Some(Seen { start, gain, visible: 0.5 * left, given_way })
    }

    /// An effect with amplitude and phase: linear in the two quadratures.
    fn both_phases(&self, start: &Start, work: &mut Residuals) -> Option<Seen> {
        let mut other = start.clone();
        other.choice.values[2] = core::f64::consts::FRAC_PI_2;
        let (a, ..) = self.change(start, work)?;
        let (b, ..) = self.change(&other, work)?;
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        let (ar, br) = (-dot(&a, &self.r), -dot(&b, &self.r));
        let nothing = Seen { start: start.clone(), gain: 0.0, visible: 0.25 * (aa + bb), given_way: None };
        let Some(x) = solve(&[vec![aa, ab], vec![ab, bb]], &[ar, br]) else { return Some(nothing) };
        let (sin, cos) = (x[0], x[1]);
        let gain = 0.5 * (sin * ar + cos * br);
        let mut start = start.clone();
        let amplitude = start.choice.info.parameters[0];
        start.choice.values[0] =
            (start.choice.values[0] * libm::hypot(sin, cos)).clamp(amplitude.search.0, amplitude.search.1);
        start.choice.values[2] = libm::atan2(cos, sin);
        start.quadrature = false;
        Some(Seen { start, gain, ..nothing })
    }

    /// The best places for a membrane that breaks at `z_b` after `w` of travel: its force has a short support
    /// (the first passage of the last `w` before `z_b`), so that a fine grid is cheap. Returns (depth below the
    /// surface at which it begins, depth at which it breaks, slope in N/m, gain in nats), best first, apart by
    /// more than 1 mm.
    #[must_use]
    pub fn membranes(&self, surface_m: f64, depth_m: f64) -> Vec<[f64; 4]> {
        let [a1, a2] = self.data.noise.a;
        let inverse = 1.0 / self.data.noise.innovation_n;
        let mut found: Vec<[f64; 4]> = Vec::new();
        let mut firsts: Vec<Vec<usize>> = Vec::new(); // per track: samples that reach deeper than all before
        for track in self.data.tracks.iter() {
            let mut deepest = f64::NEG_INFINITY;
            firsts.push(
                (0..track.len())
                    .filter(|&i| {
                        let new = track.z[i] > deepest;
                        deepest = deepest.max(track.z[i]);
                        new
                    })
                    .collect(),
            );
        }
        let steps = (depth_m / 1.5e-4) as usize;
        for w in [0.4e-3, 0.8e-3, 1.6e-3, 3.2e-3, 6.4e-3, 12.8e-3] {
            for k in 4..steps {
                let breaks = surface_m + 1.5e-4 * k as f64;
                let begins = breaks - w;
                if begins < surface_m {
                    continue;
                }
                let (mut dd, mut dr) = (0.0, 0.0);
                let mut dq = vec![0.0; self.q.len()];
                let mut offset = 0;
                for (track, first) in self.data.tracks.iter().zip(&firsts) {
                    let from = first.partition_point(|i| track.z[*i] <= begins);
                    let to = first.partition_point(|i| track.z[*i] < breaks);
                    if from < to {
                        let (from, to) = (first[from], first[to - 1] + 1);
                        let force = |i: usize| {
                            if i < from || i >= to { 0.0 } else { (track.z[i] - begins).max(0.0) }
                        };
                        for i in from..(to + 2).min(track.len()) {
                            if !track.used[i] || track.restart[i] {
                                continue;
                            }
                            let d = -(force(i) - a1 * force(i - 1) - a2 * force(i - 2))
                                * inverse
                                * self.root[offset + i];
                            dd += d * d;
                            dr += d * self.r[offset + i];
                            for (sum, u) in dq.iter_mut().zip(&self.q) {
                                *sum += d * u[offset + i];
                            }
                        }
                    }
                    offset += track.len();
                }
                let left = dd - dq.iter().map(|x| x * x).sum::<f64>();
                if left > 1e-6 * dd && dr < 0.0 {
                    found.push([begins - surface_m, breaks - surface_m, -dr / left, 0.5 * dr * dr / left]);
                }
            }
        }
        found.sort_by(|a, b| b[3].total_cmp(&a[3]));
        let mut apart: Vec<[f64; 4]> = Vec::new();
        for f in found {
            if apart.iter().all(|a| (a[1] - f[1]).abs() > 1e-3) {
                apart.push(f);
            }
            if apart.len() == 5 {
                break;
            }
        }
        apart
    }
}
