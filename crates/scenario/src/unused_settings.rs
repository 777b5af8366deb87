//! Settings that the algorithm in force does not look at: they belong to the other one.

use stylet_core::config::{Algorithm, EnhanceConfig};

/// The settings of `enhance` that were changed and have no effect, because the algorithm that runs has no such thing.
#[must_use]
pub fn unused_settings(enhance: &EnhanceConfig) -> Vec<&'static str> {
    let usual = EnhanceConfig::default();
    let mut changed = Vec::new();
    let mut note = |name: &'static str, differs: bool| {
        if differs {
            changed.push(name);
        }
    };
    if enhance.active_algorithm() != Algorithm::Stylet {
        note("stylet", enhance.stylet != usual.stylet);
        return changed;
    }
    note("reset", enhance.reset != usual.reset);
    note("forgetting", enhance.forgetting != usual.forgetting);
    note("prior_stiffness", enhance.prior_stiffness != usual.prior_stiffness);
    note("prior_friction", enhance.prior_friction != usual.prior_friction);
    note("cusum", enhance.cusum != usual.cusum);
    note("derivative", enhance.derivative != usual.derivative);
    // Of these a part is common to both.
    let mut drop = enhance.drop;
    drop.standstill_mps = usual.drop.standstill_mps;
    note("drop", drop != usual.drop);
    let mut guard = enhance.guard;
    (guard.revisit_margin_m, guard.blind_travel_m) =
        (usual.guard.revisit_margin_m, usual.guard.blind_travel_m);
    note("guard", guard != usual.guard);
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EnhancerConfigFile;

    fn found(text: &str) -> Vec<&'static str> {
        unused_settings(&EnhancerConfigFile::parse("e.ron", text).expect("it is right").enhance)
    }

    #[test]
    fn what_the_other_algorithm_alone_looks_at_is_named() {
        assert!(found("Enhance()").is_empty() && found("Enhance(algorithm: Paper)").is_empty());
        assert_eq!(
            found("Enhance(forgetting: 0.99, cusum: (sigma_rupture_n: 0.05))"),
            ["forgetting", "cusum"]
        );
        assert!(found("Enhance(algorithm: Paper, cusum: (sigma_rupture_n: 0.05))").is_empty());
        assert_eq!(found("Enhance(algorithm: Paper, stylet: (min_drop_share: 0.2))"), ["stylet"]);
        // Both know how slow a standing needle is; the paper's runs where a Kelvin-Voigt model is asked for.
        assert!(found("Enhance(drop: (standstill_mps: 2e-5), guard: (blind_travel_m: 0.001))").is_empty());
        assert!(found("Enhance(model: KelvinVoigt, forgetting: 0.99)").is_empty());
    }
}
