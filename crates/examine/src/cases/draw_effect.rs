//! Draws the effects to hide: shape parameters over plausible ranges, and a strength that can be scaled.

use super::case_id::Size;
use super::draw_motion::{log_uniform, uniform};
use crate::simulator::effect::{Effect, IDS};
use crate::simulator::tissue::Tissue;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

/// Context of a draw.
pub struct EffectContext<'a> {
    /// The true tissue.
    pub tissue: &'a Tissue,
    /// Largest force without the effect in N.
    pub largest_n: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Relative error of K, b, F in this case.
    pub coefficients: f64,
    /// Target strength.
    pub size: Size,
}

/// Tolerances of the assumed scenario (docs/reference/files.md).
pub const TOLERANCE: f64 = 0.3;
/// The same for thicknesses.
pub const THICKNESS_TOLERANCE: f64 = 0.1;

/// Draws effect number `which` of the library at an initial strength; effects whose strength is not measured by a residual
/// (`by_size`) at the final one.
pub fn draw_effect(rng: &mut ChaCha8Rng, which: usize, case: &EffectContext) -> Effect {
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let depth = case.tissue.end_m() - case.tissue.surface_m;
    let phase_rad = uniform(rng, -3.0, 3.0);
    let by_size = |rng: &mut ChaCha8Rng, three: [(f64, f64); 3]| {
        let (low, high) = three[case.size as usize];
        log_uniform(rng, low, high)
    };
    match IDS[which % IDS.len()] {
        "nonlinear_elasticity" => Effect::NonlinearElasticity { kappa_per_m: 8.0 },
        "stress_relaxation" => {
            let two = uniform(rng, 0.0, 1.0) < 0.25;
            let (fast, slow) = (log_uniform(rng, 0.2, 0.6), log_uniform(rng, 3.0, 10.0));
            let one = log_uniform(rng, 0.2, 8.0);
            let terms = if two { [(0.15, fast), (0.2, slow)] } else { [(0.3, one), (0.0, 1.0)] };
            Effect::StressRelaxation { terms }
        }
        "coulomb_friction" => Effect::CoulombFriction { c_n_per_m: 4.0 },
        "stribeck_friction" => {
            let c = 3.0;
            Effect::StribeckFriction {
                c_n_per_m: c,
                c_static_n_per_m: c * uniform(rng, 1.8, 3.5),
                v_stribeck_mps: log_uniform(rng, 0.6e-3, 3e-3),
            }
        }
        "presliding_friction" => {
            Effect::PreslidingFriction { c_n_per_m: 4.0, delta_m: log_uniform(rng, 2e-4, 3e-3) }
        }
        "asymmetric_friction" => Effect::AsymmetricFriction { eps: 0.1 * sign },
        "power_law_friction" => Effect::PowerLawFriction { exponent: 1.0 + 0.25 * sign },
        "cutting_force" => Effect::CuttingForce { force_n: 0.2 },
        "incomplete_release" => Effect::IncompleteRelease { fraction: 0.25 },
        "rate_dependent_puncture" => Effect::RateDependentPuncture {
            alpha: sign * by_size(rng, [(0.01, 0.03), (0.03, 0.1), (0.1, 0.25)]),
        },
        "hidden_membrane" => {
            let stiffness_n_per_m = log_uniform(rng, 80.0, 400.0);
            Effect::HiddenMembrane {
                depth_m: uniform(rng, 0.08, 0.85) * depth,
                stiffness_n_per_m,
                puncture_n: 0.4,
            }
        }
        "boundary_shift" => {
            let faces = case.tissue.layers.len().max(2) - 1;
            let layer = 1 + rng.random_range(0..faces);
            let thick = |i: usize| case.tissue.layers.get(i).map_or(0.02, |l| l.thickness_m);
            let (near, far) = (thick(layer - 1), thick(layer));
            // Strong: more than the thickness of either layer may be off; medium and faint: less.
            let size = by_size(rng, [(0.15, 0.4), (0.4, 0.95), (1.4, 2.2)]) * THICKNESS_TOLERANCE;
            let of = if case.size == Size::Strong { near.max(far) } else { near.min(far) };
            Effect::BoundaryShift { layer, shift_m: sign * (size * of).min(0.5 * near.min(far)) }
        }
        "soft_boundary" => Effect::SoftBoundary { width_m: 2e-3 },
        "respiration" => {
            Effect::Respiration { amplitude_m: 1e-3, frequency_hz: uniform(rng, 0.15, 0.4), phase_rad }
        }
        "needle_compliance" => Effect::NeedleCompliance { stiffness_n_per_m: 800.0 },
        "tool_inertia" => Effect::ToolInertia { mass_kg: 2.0 },
        "drive_friction" => Effect::DriveFriction { force_n: 0.2 },
        "force_gain" => {
            // Gain and coefficient errors together must stay within the tolerance of the scenario.
            let most = ((1.0 + TOLERANCE) / (1.0 + case.coefficients) - 1.0).min(0.12);
            Effect::ForceGain { eps: sign * uniform(rng, 0.3, 0.95) * most }
        }
        "low_pass_lag" => Effect::LowPassLag { time_constant_s: 0.05 },
        "time_delay" => Effect::TimeDelay { delay_s: 0.05 },
        "force_bias" => Effect::ForceBias { force_n: 0.1 * sign },
        "force_drift" => Effect::ForceDrift { rate_n_per_s: 5e-3 * sign },
        "periodic_interference" => Effect::PeriodicInterference {
            amplitude_n: 0.05,
            frequency_hz: log_uniform(rng, 0.5, (0.35 * case.rate_hz).min(40.0)),
            phase_rad,
        },
        "saturation" => Effect::Saturation { limit_n: 0.7 * case.largest_n },
        "quantisation" => Effect::Quantisation { step_n: 0.1 },
        "position_scale" => {
            Effect::PositionScale { eps: sign * by_size(rng, [(0.003, 0.01), (0.01, 0.04), (0.04, 0.08)]) }
        }
        "zero_step" => Effect::ZeroStep { time_s: uniform(rng, 1.5, 15.0), step_n: 0.2 * sign },
        "position_dependent_force" => Effect::PositionDependentForce {
            stiffness_n_per_m: 3.0 * sign,
            rest_m: case.tissue.surface_m - uniform(rng, 0.0, 0.02),
        },
        "loading_hysteresis" => {
            Effect::LoadingHysteresis { fraction: 0.2, reversal_n: log_uniform(rng, 0.01, 0.2) }
        }
        _ => Effect::ForceSpikes { rate_hz: uniform(rng, 0.2, 1.0), size_n: 1.0 },
    }
}

/// Whether an effect's strength is drawn with its parameters, because the residual of a re-fitted base law does not measure
/// it: the effect acts through the times of ruptures only, or not at all.
#[must_use]
pub fn has_size_parameter(effect: &Effect) -> bool {
    matches!(
        effect,
        Effect::RateDependentPuncture { .. }
            | Effect::BoundaryShift { .. }
            | Effect::PositionScale { .. }
            | Effect::ForceGain { .. }
    )
}

/// The effect with its strength times about `factor`, within plausible values; `None` if its strength is fixed.
#[must_use]
pub fn scaled(effect: &Effect, factor: f64, largest_n: f64) -> Option<Effect> {
    use Effect::*;
    let to = |x: f64, low: f64, high: f64| (x * factor).abs().clamp(low, high) * x.signum();
    Some(match *effect {
        NonlinearElasticity { kappa_per_m } => {
            NonlinearElasticity { kappa_per_m: to(kappa_per_m, 0.05, 80.0) }
        }
        StressRelaxation { terms } => {
            let sum = terms[0].0 + terms[1].0;
            let by = to(sum, 0.005, 0.85) / sum;
            StressRelaxation { terms: terms.map(|(g, tau)| (g * by, tau)) }
        }
        CoulombFriction { c_n_per_m } => CoulombFriction { c_n_per_m: to(c_n_per_m, 0.02, 60.0) },
        StribeckFriction { c_n_per_m, c_static_n_per_m, v_stribeck_mps } => {
            let c = to(c_n_per_m, 0.02, 60.0);
            StribeckFriction {
                c_n_per_m: c,
                c_static_n_per_m: c_static_n_per_m * c / c_n_per_m,
                v_stribeck_mps,
            }
        }
        PreslidingFriction { c_n_per_m, delta_m } => {
            PreslidingFriction { c_n_per_m: to(c_n_per_m, 0.02, 60.0), delta_m }
        }
        AsymmetricFriction { eps } => AsymmetricFriction { eps: to(eps, 0.002, 0.8) },
        PowerLawFriction { exponent } => PowerLawFriction { exponent: 1.0 + to(exponent - 1.0, 0.003, 0.7) },
        CuttingForce { force_n } => CuttingForce { force_n: to(force_n, 0.002, 3.0) },
        IncompleteRelease { fraction } => IncompleteRelease { fraction: to(fraction, 0.003, 0.9) },
        HiddenMembrane { depth_m, stiffness_n_per_m, puncture_n } => {
            // Height and length each by the square root.
            let root = libm::sqrt(factor.clamp(0.1, 10.0));
            HiddenMembrane {
                depth_m,
                stiffness_n_per_m: (stiffness_n_per_m * libm::sqrt(root)).clamp(40.0, 1500.0),
                puncture_n: (puncture_n * root).clamp(0.03, 6.0),
            }
        }
        SoftBoundary { width_m } => SoftBoundary { width_m: to(width_m, 5e-5, 0.015) },
        Respiration { amplitude_m, frequency_hz, phase_rad } => {
            Respiration { amplitude_m: to(amplitude_m, 5e-6, 0.012), frequency_hz, phase_rad }
        }
        NeedleCompliance { stiffness_n_per_m } => {
            NeedleCompliance { stiffness_n_per_m: (stiffness_n_per_m / factor).clamp(100.0, 3e5) }
        }
        ToolInertia { mass_kg } => ToolInertia { mass_kg: to(mass_kg, 0.01, 12.0) },
        DriveFriction { force_n } => DriveFriction { force_n: to(force_n, 0.002, 3.0) },
        LowPassLag { time_constant_s } => LowPassLag { time_constant_s: to(time_constant_s, 2e-4, 0.6) },
        TimeDelay { delay_s } => TimeDelay { delay_s: to(delay_s, 2e-4, 0.4) },
        ForceBias { force_n } => ForceBias { force_n: to(force_n, 1e-3, 2.0) },
        ForceDrift { rate_n_per_s } => ForceDrift { rate_n_per_s: to(rate_n_per_s, 2e-5, 0.2) },
        PeriodicInterference { amplitude_n, frequency_hz, phase_rad } => {
            PeriodicInterference { amplitude_n: to(amplitude_n, 1e-3, 1.5), frequency_hz, phase_rad }
        }
        Saturation { limit_n } => {
            let cut = (1.0 - limit_n / largest_n).max(0.005) * libm::sqrt(factor);
            Saturation { limit_n: largest_n * (1.0 - cut.clamp(0.005, 0.75)) }
        }
        Quantisation { step_n } => Quantisation { step_n: to(step_n, 2e-3, 2.0) },
        ForceSpikes { rate_hz, size_n } => ForceSpikes { rate_hz, size_n: to(size_n, 0.05, 8.0) },
        ZeroStep { time_s, step_n } => ZeroStep { time_s, step_n: to(step_n, 2e-3, 5.0) },
        PositionDependentForce { stiffness_n_per_m, rest_m } => {
            PositionDependentForce { stiffness_n_per_m: to(stiffness_n_per_m, 0.02, 60.0), rest_m }
        }
        LoadingHysteresis { fraction, reversal_n } => {
            LoadingHysteresis { fraction: to(fraction, 0.003, 0.9), reversal_n }
        }
        RateDependentPuncture { .. } | BoundaryShift { .. } | PositionScale { .. } | ForceGain { .. } => {
            return None;
        }
    })
}
