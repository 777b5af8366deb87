//! A linear look at many starts: how much would the objective gain if the start's change of the force,
//! less what the parameters already fitted can imitate, were added in the right amount.

use crate::fit::{Data, Residuals, dot, jacobian, normal, residuals, solve};
use crate::model::Model;
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
}

/// What a look at a start shows.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The start, scaled to its best amount.
    pub start: Start,
    /// Nats that the linear model gains.
    pub gain: f64,
    /// Nats that the start's own size would cost if it were there and ignored.
    pub visible: f64,
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
        let _ = normal;
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
        Some(Self { model, data, at, root, r, q })
    }

    /// Change of the weighted residuals by an effect, less what the fitted numbers imitate.
    fn change(&self, start: &Start, work: &mut Residuals) -> Option<(Vec<f64>, f64)> {
        let trial = self.model.with(start.choice.clone());
        if !residuals(&trial, self.data, work) {
            return None;
        }
        let new = work.w.iter().copied().chain(work.events.iter().map(|e| e.u));
        let old = self.at.w.iter().copied().chain(self.at.events.iter().map(|e| e.u));
        let mut d: Vec<f64> = new.zip(old).zip(&self.root).map(|((n, o), s)| (n - o) * s).collect();
        let size = dot(&d, &d);
        for u in &self.q {
            let share = dot(u, &d);
            d.iter_mut().zip(u).for_each(|(d, u)| *d -= share * u);
        }
        Some((d, size))
    }

    /// Looks at a start.
    #[must_use]
    pub fn at(&self, start: &Start, work: &mut Residuals) -> Option<Seen> {
        if start.quadrature {
            return self.both_phases(start, work);
        }
        let (d, size) = self.change(start, work)?;
        let left = dot(&d, &d);
        let nothing = Seen { start: start.clone(), gain: 0.0, visible: 0.5 * left };
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
        let scale = if amount < 0.0 { amount.clamp(-5.0, -0.2) } else { amount.clamp(0.2, 5.0) };
        if !matches!(info.id, "power_law_friction" | "rate_dependent_puncture" | "boundary_shift" | "position_scale") && info.id != "needle_compliance" && info.id != "hidden_membrane" {
            for (value, p) in start.choice.values.iter_mut().zip(info.parameters) {
                let scalable = p.strength && !matches!(info.id, "low_pass_lag" | "time_delay" | "soft_boundary");
                if scalable {
                    *value = (*value * scale).clamp(p.low, p.high.min(p.search.1));
                }
            }
        }
        Some(Seen { start, gain, visible: 0.5 * left })
    }

    /// An effect with amplitude and phase: linear in the two quadratures.
    fn both_phases(&self, start: &Start, work: &mut Residuals) -> Option<Seen> {
        let mut other = start.clone();
        other.choice.values[2] = core::f64::consts::FRAC_PI_2;
        let (a, _) = self.change(start, work)?;
        let (b, _) = self.change(&other, work)?;
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        let (ar, br) = (-dot(&a, &self.r), -dot(&b, &self.r));
        let nothing = Seen { start: start.clone(), gain: 0.0, visible: 0.25 * (aa + bb) };
        let Some(x) = solve(&[vec![aa, ab], vec![ab, bb]], &[ar, br]) else { return Some(nothing) };
        let (sin, cos) = (x[0], x[1]);
        let gain = 0.5 * (sin * ar + cos * br);
        let mut start = start.clone();
        let amplitude = start.choice.info.parameters[0];
        start.choice.values[0] =
            (start.choice.values[0] * libm::hypot(sin, cos)).clamp(amplitude.search.0, amplitude.search.1);
        start.choice.values[2] = libm::atan2(cos, sin);
        start.quadrature = false;
        Some(Seen { start, gain, visible: nothing.visible })
    }
}
