//! Reading and writing parameter values.

use super::{Model, ParameterRole as Role};
use stylet_tissue::FitScale;

impl Model {
    /// Value of a parameter, in recording `r` if it is per-recording.
    #[must_use]
    pub fn get(&self, role: Role, r: usize) -> f64 {
        let assumed = &self.assumed.tissue;
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
                let term = &self.effects[effect];
                let x = term.coordinates()[parameter];
                match term.info.parameters[parameter].fit_scale() {
                    FitScale::Linear => x,
                    FitScale::Log => libm::log(x.max(1e-300)),
                    FitScale::Reciprocal => 1.0 / x,
                }
            }
            Role::RecordingSurface => self.per_recording[r].surface_m,
            Role::RecordingFriction => self.per_recording[r].ln_friction,
            Role::RecordingEffect(k) => self.per_recording[r].varying[k],
            Role::DaySurface(d) => self.days[d].surface_m,
            Role::DayFriction(d) => self.days[d].ln_friction,
            Role::ZeroStep(k) => self.zero_steps.get(r).and_then(|s| s.get(k)).map_or(0.0, |s| s.size_n),
            Role::RuptureTime(l) => self.rupture_times_s[r][l],
        }
    }

    /// Sets a parameter, in recording `r` if it is per-recording.
    pub fn set(&mut self, role: Role, r: usize, x: f64) {
        let assumed = &self.assumed.tissue;
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
                let term = &mut self.effects[effect];
                let mut at = term.coordinates();
                at[parameter] = match term.info.parameters[parameter].fit_scale() {
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
                if let Some(effect) = term.info.with_coordinates(&at) {
                    term.values = effect.parameters();
                }
                let values = term.values.clone();
                for b in self.tied.iter().filter(|b| b.tied_to == Some(effect)) {
                    self.effects[b.effect].values[b.parameter] = values[b.parameter];
                }
            }
            Role::RecordingSurface => self.per_recording[r].surface_m = x,
            Role::RecordingFriction => self.per_recording[r].ln_friction = x,
            Role::RecordingEffect(k) => self.per_recording[r].varying[k] = x,
            Role::DaySurface(d) => self.days[d].surface_m = x,
            Role::DayFriction(d) => self.days[d].ln_friction = x,
            Role::ZeroStep(k) => {
                if let Some(step) = self.zero_steps.get_mut(r).and_then(|s| s.get_mut(k)) {
                    step.size_n = x;
                }
            }
            Role::RuptureTime(l) => self.rupture_times_s[r][l] = x,
        }
    }
}
