//! Intervals of all numbers by the curvature of the likelihood, the instants of ruptures marginalised.

use crate::outcome::Estimate;
use stylet_identify::fit::{Fit, Tangent};
use stylet_identify::linear::Factor;
use stylet_identify::model::Role;
use stylet_identify::objective::Data;
use stylet_tissue::FitScale;

/// Half width of a 95 % interval in standard deviations.
const Z95: f64 = 1.959_963_985;

/// The curvature at an optimum.
pub struct Spread<'a> {
    fit: &'a Fit,
    tangent: Tangent,
    factor: Factor,
}

impl<'a> Spread<'a> {
    /// Of a fit.
    #[must_use]
    pub fn new(fit: &'a Fit, data: &Data) -> Self {
        let tangent = Tangent::new(&fit.model, data, &fit.residuals);
        let factor = tangent.factor();
        Self { fit, tangent, factor }
    }

    /// Value and standard deviation of a shared number, in the scale of the fit; `None` when it is not free.
    #[must_use]
    pub fn of(&self, role: Role) -> Option<(f64, f64)> {
        let i = self.tangent.shared.iter().position(|n| n.role == role)?;
        let mut unit = vec![0.0; self.tangent.matrix.size];
        unit[i] = 1.0;
        let variance: f64 = self.factor.half(&unit).iter().map(|y| y * y).sum();
        let sd = if variance > 0.0 { variance.sqrt() } else { self.tangent.shared[i].sd };
        Some((self.fit.model.get(role, 0), sd))
    }

    /// Whether a shared number stands at a bound.
    #[must_use]
    pub fn at_bound(&self, role: Role) -> bool {
        self.tangent.shared.iter().find(|n| n.role == role).is_some_and(|n| {
            let x = self.fit.model.get(role, 0);
            let near = 1e-6 * (n.high - n.low).min(1.0);
            x <= n.low + near || x >= n.high - near
        })
    }

    /// A parameter of an effect of the model with its interval.
    #[must_use]
    pub fn parameter(&self, effect: usize, parameter: usize) -> Estimate {
        let choice = &self.fit.model.effects[effect];
        let p = &choice.info.parameters[parameter];
        let value = choice.values[parameter];
        if p.whole {
            return Estimate { value, low: value, high: value };
        }
        // How the value changes with each of the effect's numbers in the fit.
        let mut gradient = vec![0.0; self.tangent.matrix.size];
        for (i, n) in self.tangent.shared.iter().enumerate() {
            let Role::Effect { effect: e, parameter: k } = n.role else { continue };
            if e != effect {
                continue;
            }
            let mut moved = self.fit.model.clone();
            let x = moved.get(n.role, 0);
            moved.set(n.role, 0, x + n.step);
            let change = (moved.effects[effect].values[parameter] - value) / n.step;
            gradient[i] = if change.is_finite() { change } else { 0.0 };
            let _ = k;
        }
        let variance: f64 = self.factor.half(&gradient).iter().map(|y| y * y).sum();
        let sd = variance.sqrt() * Z95;
        let (low, high) = match p.fit_scale() {
            FitScale::Log => (value * libm::exp(-sd / value), value * libm::exp(sd / value)),
            FitScale::Reciprocal => {
                // Evenly about the reciprocal.
                let (x, half) = (1.0 / value, sd / (value * value));
                (1.0 / (x + half), if x > half { 1.0 / (x - half) } else { f64::INFINITY })
            }
            FitScale::Linear => (value - sd, value + sd),
        };
        Estimate { value, low: low.max(p.low), high: high.min(p.high).min(1e300) }
    }
}
