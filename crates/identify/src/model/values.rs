//! The value of every number.

use super::{Model, Role};
use stylet_tissue::{AnyEffect, FitScale};

impl Model {
    /// A number's value, of recording `r` if it is its own.
    #[must_use]
    pub fn get(&self, role: Role, r: usize) -> f64 {
        let assumed = &self.belief.tissue;
        match role {
            Role::Stiffness(l) => {
                self.tissue.layers[l].stiffness_n_per_m / assumed.layers[l].stiffness_n_per_m
            }
            Role::Friction(l) => {
                self.tissue.layers[l].friction_ns_per_m2 / assumed.layers[l].friction_ns_per_m2
            }
            Role::Puncture(l) => {
                self.tissue.layers[l].puncture_n.unwrap_or(1.0) / assumed.layers[l].puncture_n.unwrap_or(1.0)
            }
            Role::Surface => self.tissue.surface_m,
            Role::Thickness(l) => self.tissue.layers[l].thickness_m,
            Role::Effect { effect, parameter } => {
                let choice = &self.effects[effect];
                let x = choice.coordinates()[parameter];
                match choice.info.parameters[parameter].fit_scale() {
                    FitScale::Linear => x,
                    FitScale::Log => libm::log(x.max(1e-300)),
                    FitScale::Reciprocal => 1.0 / x,
                }
            }
            Role::OwnSurface => self.own[r].surface_m,
            Role::OwnFriction => self.own[r].friction,
            Role::OwnEffect(k) => self.own[r].differing[k],
            Role::DaySurface(d) => self.days[d].surface_m,
            Role::DayFriction(d) => self.days[d].friction,
            Role::Instant(l) => self.instants[r][l],
        }
    }

    /// Sets a number, of recording `r` if it is its own.
    pub fn set(&mut self, role: Role, r: usize, x: f64) {
        let assumed = &self.belief.tissue;
        match role {
            Role::Stiffness(l) => {
                self.tissue.layers[l].stiffness_n_per_m = x * assumed.layers[l].stiffness_n_per_m;
            }
            Role::Friction(l) => {
                self.tissue.layers[l].friction_ns_per_m2 = x * assumed.layers[l].friction_ns_per_m2;
            }
            Role::Puncture(l) => {
                self.tissue.layers[l].puncture_n = assumed.layers[l].puncture_n.map(|f| f * x);
            }
            Role::Surface => self.tissue.surface_m = x,
            Role::Thickness(l) => self.tissue.layers[l].thickness_m = x,
            Role::Effect { effect, parameter } => {
                let choice = &mut self.effects[effect];
                let mut at = choice.coordinates();
                at[parameter] = match choice.info.parameters[parameter].fit_scale() {
                    FitScale::Linear => x,
                    FitScale::Log => libm::exp(x),
                    FitScale::Reciprocal => {
                        if x > 0.0 {
                            1.0 / x
                        } else {
                            f64::INFINITY
                        }
                    }
                };
                if let Some(effect) = AnyEffect::from_coordinates(choice.info.id, &at) {
                    choice.values = effect.parameters();
                }
                let values = choice.values.clone();
                for b in self.bound.iter().filter(|b| b.like == Some(effect)) {
                    self.effects[b.effect].values[b.parameter] = values[b.parameter];
                }
            }
            Role::OwnSurface => self.own[r].surface_m = x,
            Role::OwnFriction => self.own[r].friction = x,
            Role::OwnEffect(k) => self.own[r].differing[k] = x,
            Role::DaySurface(d) => self.days[d].surface_m = x,
            Role::DayFriction(d) => self.days[d].friction = x,
            Role::Instant(l) => self.instants[r][l] = x,
        }
    }
}
