//! How far every number may go, and what is known of it before any measurement.

use super::{Model, Number, Role};
use stylet_tissue::{FitScale, Proposal};

/// Smallest share of what is believed that a stiffness, friction or puncture force may have.
const LEAST_SHARE: f64 = 0.02;
/// By how many of its tolerances a surface or a thickness may be off.
const TOLERATED: f64 = 2.0;
/// By how many of them one may be off while faces are looked for that only an effect can have moved.
const FARTHEST: f64 = 5.0;

impl Model {
    /// Whether a thickness is further from what is believed than its tolerance allows.
    #[must_use]
    pub fn is_strained(&self, layer: usize) -> bool {
        let b = &self.belief;
        let believed = b.tissue.layers[layer].thickness_m;
        let off = (self.tissue.layers[layer].thickness_m - believed).abs();
        off > TOLERATED * b.thickness_tolerance[layer] * believed
    }

    /// The numbers that every recording shares.
    #[must_use]
    pub fn shared(&self) -> Vec<Number> {
        let mut out = Vec::new();
        let b = &self.belief;
        for (layer, l) in b.tissue.layers.iter().enumerate() {
            let tolerance = b.tolerance[layer];
            let mut relative = |role, size: f64| {
                if size > 0.0 {
                    let (low, high) = ((1.0 - tolerance).max(LEAST_SHARE), 1.0 + tolerance);
                    out.push(Number { role, low, high, mean: 1.0, sd: tolerance, step: 1e-5 });
                }
            };
            relative(Role::Stiffness(layer), l.stiffness_n_per_m);
            relative(Role::Friction(layer), l.friction_ns_per_m2);
            relative(Role::Puncture(layer), l.puncture_n.unwrap_or(0.0));
        }
        if self.free.surface && b.surface_tolerance_m > 0.0 {
            let (at, sd) = (b.tissue.surface_m, b.surface_tolerance_m);
            let (low, high) = (at - TOLERATED * sd, at + TOLERATED * sd);
            out.push(Number { role: Role::Surface, low, high, mean: at, sd, step: 1e-7 });
        }
        if self.free.thickness {
            for (layer, l) in b.tissue.layers.iter().enumerate() {
                let (d, sd) = (l.thickness_m, b.thickness_tolerance[layer] * l.thickness_m);
                if sd > 0.0 {
                    let most = if self.free.far { FARTHEST } else { TOLERATED } * sd;
                    let (low, high) = ((d - most).max(0.05 * d), d + most);
                    out.push(Number { role: Role::Thickness(layer), low, high, mean: d, sd, step: 1e-7 });
                }
            }
        }
        for (effect, choice) in self.effects.iter().enumerate() {
            let at = choice.coordinates();
            for (parameter, p) in choice.info.parameters.iter().enumerate().filter(|(_, p)| !p.whole) {
                if self.bound.iter().any(|b| b.effect == effect && b.parameter == parameter) {
                    continue;
                }
                let role = Role::Effect { effect, parameter };
                let (from, to) = p.search;
                let (low, high, step) = match p.fit_scale() {
                    FitScale::Log => {
                        let (low, high) = ((from / 10.0).max(p.low), (to * 10.0).min(p.high));
                        // A frequency is told by the phase at the end of a recording.
                        let step = if p.unit == "Hz" { 1e-6 / at[parameter].max(1e-3) } else { 1e-4 };
                        (libm::log(low.max(1e-12)), libm::log(high), step)
                    }
                    FitScale::Reciprocal => (0.0, 10.0 / from, 1e-4 / p.start),
                    FitScale::Linear => {
                        let wide = to - from;
                        let low = if p.low == 0.0 { 0.0 } else { (from - wide).max(p.low) };
                        let high = (to + 3.0 * wide).min(p.high);
                        // What moves with a face has to move as finely.
                        let fine = 1e-4 * p.start.abs().max(at[parameter].abs()).max(1e-4);
                        let bends = p.unit == "m" && choice.info.proposal == Proposal::Break;
                        (low, high, if bends { 1e-7 } else { fine })
                    }
                };
                let (mean, sd) = p.expected.unwrap_or((0.0, f64::INFINITY));
                out.push(Number { role, low, high, mean, sd, step });
            }
        }
        let mut of_day = |role, sd, step| {
            let infinity = f64::INFINITY;
            out.push(Number { role, low: -infinity, high: infinity, mean: 0.0, sd, step });
        };
        for day in 0..self.days.len() {
            if self.free.day_surface {
                of_day(Role::DaySurface(day), self.scatter.day_surface_m, 1e-7);
            }
            if self.free.day_friction {
                of_day(Role::DayFriction(day), self.scatter.day_friction, 1e-5);
            }
        }
        out
    }

    /// Standard deviation of the `k`-th number that differs between insertions.
    #[must_use]
    pub fn differing_sd(&self, k: usize) -> f64 {
        let known = self.scatter.differing.get(k).copied().unwrap_or(0.0);
        if known > 0.0 { known } else { self.differing_said(k) }
    }

    /// The same as the library has it, before any data.
    #[must_use]
    pub fn differing_said(&self, k: usize) -> f64 {
        self.differing().nth(k).map_or(1.0, |(e, p)| self.effects[e].info.parameters[p].differs)
    }

    /// The numbers that each recording has of its own.
    #[must_use]
    pub fn own_numbers(&self) -> Vec<Number> {
        let infinity = f64::INFINITY;
        let number = |role, sd, step| Number { role, low: -infinity, high: infinity, mean: 0.0, sd, step };
        let mut out = Vec::new();
        if self.free.own_surface {
            out.push(number(Role::OwnSurface, self.scatter.surface_m, 1e-7));
        }
        if self.free.own_friction {
            out.push(number(Role::OwnFriction, self.scatter.friction, 1e-5));
        }
        if self.free.own_effects {
            for (k, (e, p)) in self.differing().enumerate() {
                let step = 1e-3 * self.effects[e].info.parameters[p].differs;
                out.push(number(Role::OwnEffect(k), self.differing_sd(k), step));
            }
        }
        out.extend((0..self.layers()).map(|layer| number(Role::Instant(layer), infinity, 1e-5)));
        out
    }
}
