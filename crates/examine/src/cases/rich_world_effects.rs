//! Draws the effects of the rich law to hide, and lists the library effects accepted for them.

use super::case_id::Size;
use super::draw_motion::{log_uniform, uniform};
use crate::simulator::rich_world::{Bending, Bristles, Damage, Foundation, Membrane, RichEffects, Tearing};
use crate::simulator::tissue::Tissue;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

/// Names of the rich law's effects.
pub const RICH_EFFECTS: [&str; 6] = ["bristles", "foundation", "damage", "tearing", "membrane", "bending"];

/// Speed in m/s at which damage ruptures a layer at its puncture force: the middle of the motions.
const DAMAGE_SPEED_MPS: f64 = 3e-3;
/// Free length of the needle in m (docs/reference/model.md, section 4).
const NEEDLE_M: f64 = 0.153;

/// Library effects that describe an effect of the rich law, fixed before any run. `unknown` is correct for all of them.
#[must_use]
pub fn accepted_names(effect: &str) -> &'static [&'static str] {
    match effect {
        // Friction that builds up with travel, creeps, and in part does not depend on speed.
        "bristles" => &[
            "presliding_friction",
            "viscoelastic_presliding",
            "coulomb_friction",
            "stribeck_friction",
            "power_law_friction",
        ],
        // The far face yields before it tears; the next layer is met later and already pressed; with its lag the force relaxes.
        "foundation" => &[
            "deep_indentation",
            "boundary_shift",
            "incomplete_release",
            "stress_relaxation",
            "needle_compliance",
            "low_pass_lag",
        ],
        // Fast loading reaches a higher force before the damage is done.
        "damage" => &["rate_dependent_puncture"],
        // A drop in steps, over a travel, with a part that stays for a while.
        "tearing" => &["soft_boundary", "incomplete_release", "hidden_membrane"],
        "membrane" => &["hidden_membrane"],
        // The tip falls back under load; the bent shaft rubs in proportion to the tip's force, against the motion.
        "bending" => &[
            "needle_compliance",
            "asymmetric_friction",
            "coulomb_friction",
            "presliding_friction",
            "stribeck_friction",
            "cutting_force",
            "drive_friction",
            "nonlinear_elasticity",
            "layer_stiffening",
        ],
        _ => &[],
    }
}

/// Adds effect number `which` of the rich law at an initial strength.
pub fn add_rich_effect(
    rng: &mut ChaCha8Rng,
    which: usize,
    tissue: &Tissue,
    size: Size,
    to: &mut RichEffects,
) {
    let by_size = |rng: &mut ChaCha8Rng, three: [(f64, f64); 3]| {
        let (low, high) = three[size as usize];
        log_uniform(rng, low, high)
    };
    match RICH_EFFECTS[which % RICH_EFFECTS.len()] {
        "bristles" => {
            let creeps = rng.random::<bool>();
            let creep_s = log_uniform(rng, 2.0, 15.0);
            to.bristles = Some(Bristles {
                share: 0.5,
                delta_m: log_uniform(rng, 5e-4, 4e-3),
                dry_mps: uniform(rng, 0.0, 1.5e-3),
                creep_s: if creeps { creep_s } else { f64::INFINITY },
            });
        }
        "foundation" => {
            let lags = rng.random::<bool>();
            let lag_s = uniform(rng, 0.3, 2.0);
            to.foundation = Some(Foundation {
                softness: by_size(rng, [(0.01, 0.03), (0.03, 0.1), (0.13, 0.3)]),
                lag_s: if lags { lag_s } else { 0.0 },
            });
        }
        "damage" => {
            let exponent = by_size(rng, [(30.0, 80.0), (10.0, 30.0), (5.0, 10.0)]);
            let layer = tissue.layers.iter().find_map(|l| Some((l.puncture_n?, l.stiffness_n_per_m)));
            let (f, k) = layer.unwrap_or((1.0, 60.0));
            to.damage = Some(Damage { exponent, time_s: f / ((exponent + 1.0) * k * DAMAGE_SPEED_MPS) });
        }
        "tearing" => {
            to.tearing = Some(Tearing { steps: rng.random_range(2..=3), travel_m: 1.5e-3 });
        }
        "membrane" => {
            let depth = tissue.end_m() - tissue.surface_m;
            to.membrane = Some(Membrane {
                depth_m: uniform(rng, 0.08, 0.85) * depth,
                stiffness_n_per_m: log_uniform(rng, 80.0, 400.0),
                puncture_n: 0.6,
            });
        }
        _ => {
            let stiffness_nm2 = log_uniform(rng, 0.01, 0.1);
            to.bending = Some(Bending {
                ratio: uniform(rng, 0.04, 0.13),
                compliance_m_per_n: NEEDLE_M * NEEDLE_M * NEEDLE_M / (3.0 * stiffness_nm2),
                length_m: NEEDLE_M,
                rubbing: 0.6,
            });
        }
    }
}

/// The effects with their strength times about `factor`; `None` if the strength is drawn with the parameters.
#[must_use]
pub fn scaled(it: &RichEffects, factor: f64) -> Option<RichEffects> {
    let mut next = *it;
    if let Some(b) = &mut next.bristles {
        b.share = (b.share * factor).clamp(0.01, 1.0);
    } else if let Some(t) = &mut next.tearing {
        t.travel_m = (t.travel_m * factor).clamp(5e-5, 6e-3);
    } else if let Some(m) = &mut next.membrane {
        let root = libm::sqrt(factor.clamp(0.1, 10.0));
        m.stiffness_n_per_m = (m.stiffness_n_per_m * libm::sqrt(root)).clamp(40.0, 1500.0);
        m.puncture_n = (m.puncture_n * root).clamp(0.03, 6.0);
    } else if let Some(b) = &mut next.bending {
        b.rubbing = (b.rubbing * factor).clamp(0.01, 2.0);
    } else {
        return None;
    }
    Some(next)
}

/// Names of the effects present.
#[must_use]
pub fn names(it: &RichEffects) -> Vec<&'static str> {
    let present = [
        it.bristles.is_some(),
        it.foundation.is_some(),
        it.damage.is_some(),
        it.tearing.is_some(),
        it.membrane.is_some(),
        it.bending.is_some(),
    ];
    RICH_EFFECTS.iter().zip(present).filter_map(|(name, present)| present.then_some(*name)).collect()
}

/// Union of two sets of effects; the second has priority.
#[must_use]
pub fn combine(a: &RichEffects, b: &RichEffects) -> RichEffects {
    RichEffects {
        bristles: b.bristles.or(a.bristles),
        foundation: b.foundation.or(a.foundation),
        damage: b.damage.or(a.damage),
        tearing: b.tearing.or(a.tearing),
        membrane: b.membrane.or(a.membrane),
        bending: b.bending.or(a.bending),
    }
}
