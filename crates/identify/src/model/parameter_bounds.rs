//! Bounds and priors of all parameters.

use super::{Model, Parameter, ParameterRole as Role};
use stylet_tissue::{FitScale, Proposal};

/// Lower bound of stiffness, friction and puncture force, as a share of the assumed value.
const MIN_SHARE_OF_ASSUMED: f64 = 0.02;
/// Half width of the bounds of surface and thicknesses, in tolerances.
const MAX_TOLERANCES: f64 = 2.0;
/// Half width of the bounds of thicknesses with [`FreeParameters::wide_thickness`](super::FreeParameters), in tolerances.
pub const MAX_TOLERANCES_WIDE: f64 = 5.0;

/// Finite difference (N) for the size of a step of the sensor zero, in which the force is linear.
const ZERO_STEP_DIFFERENCE_N: f64 = 1e-3;

impl Model {
    /// Whether a thickness deviates from the assumed value by more than its tolerance allows.
    #[must_use]
    pub fn thickness_out_of_tolerance(&self, layer: usize) -> bool {
        let b = &self.assumed;
        let assumed_m = b.tissue.layers[layer].thickness_m;
        let off = (self.tissue.layers[layer].thickness_m - assumed_m).abs();
        off > MAX_TOLERANCES * b.thickness_tolerance[layer] * assumed_m
    }

    /// Parameters that all recordings share.
    #[must_use]
    pub fn shared_parameters(&self) -> Vec<Parameter> {
        let mut out = Vec::new();
        let b = &self.assumed;
        for (layer, l) in b.tissue.layers.iter().enumerate() {
            let tolerance = b.tolerance[layer];
            let mut relative = |role, size: f64| {
                if size > 0.0 {
                    let (low, high) = ((1.0 - tolerance).max(MIN_SHARE_OF_ASSUMED), 1.0 + tolerance);
                    out.push(Parameter { role, low, high, prior_mean: 1.0, prior_sd: tolerance, step: 1e-5 });
                }
            };
            relative(Role::Stiffness(layer), l.stiffness_n_per_m);
            relative(Role::Friction(layer), l.friction_ns_per_m2);
            relative(Role::Puncture(layer), l.puncture_n.unwrap_or(0.0));
        }
        if self.free.surface && b.surface_tolerance_m > 0.0 {
            let (at, sd) = (b.tissue.surface_m, b.surface_tolerance_m);
            let (low, high) = (at - MAX_TOLERANCES * sd, at + MAX_TOLERANCES * sd);
            out.push(Parameter { role: Role::Surface, low, high, prior_mean: at, prior_sd: sd, step: 1e-7 });
        }
        if self.free.thickness {
            for (layer, l) in b.tissue.layers.iter().enumerate() {
                let (d, sd) = (l.thickness_m, b.thickness_tolerance[layer] * l.thickness_m);
                if sd > 0.0 {
                    let most =
                        if self.free.wide_thickness { MAX_TOLERANCES_WIDE } else { MAX_TOLERANCES } * sd;
                    let (low, high) = ((d - most).max(0.05 * d), d + most);
                    out.push(Parameter {
                        role: Role::Thickness(layer),
                        low,
                        high,
                        prior_mean: d,
                        prior_sd: sd,
                        step: 1e-7,
                    });
                }
            }
        }
        for (effect, term) in self.effects.iter().enumerate() {
            let at = term.coordinates();
            for (parameter, p) in term.info.parameters.iter().enumerate().filter(|(_, p)| !p.integer) {
                if self.tied.iter().any(|b| b.effect == effect && b.parameter == parameter) {
                    continue;
                }
                let role = Role::Effect { effect, parameter };
                let (from, to) = p.search;
                let (low, high, step) = match p.fit_scale() {
                    FitScale::Log => {
                        let (low, high) = ((from / 10.0).max(p.low), (to * 10.0).min(p.high));
                        // The phase at the end of a recording limits the step of a frequency.
                        let step = if p.unit == "Hz" { 1e-6 / at[parameter].max(1e-3) } else { 1e-4 };
                        let low = if low > 0.0 { low } else { high.min(1e-12) };
                        (libm::log(low), libm::log(high), step)
                    }
                    FitScale::Reciprocal => (0.0, 10.0 / from, 1e-4 / p.start),
                    FitScale::Linear => {
                        let wide = to - from;
                        let low = if p.low == 0.0 { 0.0 } else { (from - wide).max(p.low) };
                        let high = (to + 3.0 * wide).min(p.high);
                        // A parameter that moves an interface needs the same step as the interfaces.
                        let fine = 1e-4 * p.start.abs().max(at[parameter].abs()).max(1e-4);
                        let bends = p.unit == "m" && term.info.proposal == Proposal::MembraneRupture;
                        (low, high, if bends { 1e-7 } else { fine })
                    }
                };
                let (mean, sd) = p.measured_prior.unwrap_or((0.0, f64::INFINITY));
                out.push(Parameter { role, low, high, prior_mean: mean, prior_sd: sd, step });
            }
        }
        let mut of_day = |role, sd, step| {
            let infinity = f64::INFINITY;
            out.push(Parameter { role, low: -infinity, high: infinity, prior_mean: 0.0, prior_sd: sd, step });
        };
        for day in 0..self.days.len() {
            if self.free.day_surface {
                of_day(Role::DaySurface(day), self.scatter.day_surface_m, 1e-7);
            }
            if self.free.day_friction {
                of_day(Role::DayFriction(day), self.scatter.day_ln_friction, 1e-5);
            }
        }
        out
    }

    /// Standard deviation of the `k`-th varying parameter between recordings: the estimate, or the library's value without one.
    #[must_use]
    pub fn varying_sd(&self, k: usize) -> f64 {
        let known = self.scatter.varying.get(k).copied().unwrap_or(0.0);
        if known > 0.0 { known } else { self.library_varying_sd(k) }
    }

    /// The library's value of this standard deviation.
    pub(crate) fn library_varying_sd(&self, k: usize) -> f64 {
        self.varying_parameters()
            .nth(k)
            .map_or(1.0, |(e, p)| self.effects[e].info.parameters[p].between_recordings_sd)
    }

    /// Per-recording parameters.
    #[must_use]
    pub fn recording_parameters(&self) -> Vec<Parameter> {
        let infinity = f64::INFINITY;
        let parameter = |role, sd, step| Parameter {
            role,
            low: -infinity,
            high: infinity,
            prior_mean: 0.0,
            prior_sd: sd,
            step,
        };
        let mut out = Vec::new();
        if self.free.recording_surface {
            out.push(parameter(Role::RecordingSurface, self.scatter.surface_m, 1e-7));
        }
        if self.free.recording_friction {
            out.push(parameter(Role::RecordingFriction, self.scatter.ln_friction, 1e-5));
        }
        if self.free.recording_effects {
            for (k, (e, p)) in self.varying_parameters().enumerate() {
                let step = 1e-3 * self.effects[e].info.parameters[p].between_recordings_sd;
                out.push(parameter(Role::RecordingEffect(k), self.varying_sd(k), step));
            }
        }
        out.extend(
            (0..self.most_zero_steps())
                .map(|k| parameter(Role::ZeroStep(k), infinity, ZERO_STEP_DIFFERENCE_N)),
        );
        out.extend((0..self.layers()).map(|layer| parameter(Role::RuptureTime(layer), infinity, 1e-5)));
        out
    }
}
