//! Whether the hidden effects of a case can be distinguished in its recordings at all.

use super::case_definition::CaseSetup;
use super::case_id::Size;
use super::effect_strength::simulate_effects;
use crate::simulator::effect::Effect;

/// Least distance in m between the puncture of a membrane and a rupture; closer ones are a single event in the recording.
const MEMBRANE_APART_M: f64 = 2e-3;

/// Whether every hidden membrane breaks away from the ruptures of the layers.
pub fn is_clear_of_ruptures(setup: &CaseSetup) -> bool {
    setup.effects.iter().all(|e| match *e {
        Effect::HiddenMembrane { depth_m, stiffness_n_per_m, puncture_n } => {
            let breaks_m = setup.truth.surface_m + depth_m + puncture_n / stiffness_n_per_m;
            breaks_m < setup.truth.end_m()
                && simulate_effects(setup, &setup.effects, None).iter().all(|(insertion, _)| {
                    insertion.ruptures_s.iter().all(|r| {
                        let k =
                            insertion.time_s.partition_point(|t| t < r).min(insertion.position_m.len() - 1);
                        (insertion.position_m[k] - breaks_m).abs() > MEMBRANE_APART_M
                    })
                })
        }
        _ => true,
    })
}

/// Whether a rate-dependent puncture force is identified by the ruptures: at least one layer is punctured by force in two recordings, at
/// forces that differ by as much as the size requires.
pub fn is_identified_by_ruptures(setup: &CaseSetup, size: Size) -> bool {
    let depends = setup.effects.iter().any(|e| matches!(e, Effect::RateDependentPuncture { .. }));
    if !depends || setup.paths.len() < 2 {
        return true;
    }
    let least = match size {
        Size::Faint => 0.005,
        Size::Medium => 0.015,
        Size::Strong => 0.05,
    };
    let all = simulate_effects(setup, &setup.effects, None);
    (0..setup.truth.layers.len()).any(|i| {
        let layer = &setup.truth.layers[i];
        let front = setup.truth.front_m(i);
        let mut forces = Vec::new();
        for (insertion, _) in &all {
            let Some(r) = insertion.ruptures_s.get(i) else { continue };
            let k = insertion.time_s.partition_point(|t| t < r).min(insertion.position_m.len() - 1);
            let x = insertion.position_m[k] - front;
            if x < 0.97 * layer.thickness_m {
                forces.push(x * layer.stiffness_n_per_m);
            }
        }
        let high = forces.iter().fold(0.0, |m: f64, f| m.max(*f));
        let low = forces.iter().fold(f64::INFINITY, |m: f64, f| m.min(*f));
        forces.len() >= 2 && high - low >= least * high
    })
}
