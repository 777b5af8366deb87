//! Changed settings that the selected online algorithm does not use.

use stylet_core::config::{Algorithm, EnhanceConfig};

/// Names of the settings in `enhance` that differ from their defaults and have no effect on the algorithm that runs.
#[must_use]
pub fn unused_settings(enhance: &EnhanceConfig) -> Vec<&'static str> {
    let default = EnhanceConfig::default();
    let mut changed = Vec::new();
    let mut note = |name: &'static str, differs: bool| {
        if differs {
            changed.push(name);
        }
    };
    if enhance.active_algorithm() != Algorithm::Stylet {
        note("stylet", enhance.stylet != default.stylet);
        return changed;
    }
    note("reset", enhance.reset != default.reset);
    note("forgetting", enhance.forgetting != default.forgetting);
    note("prior_stiffness", enhance.prior_stiffness != default.prior_stiffness);
    note("prior_friction", enhance.prior_friction != default.prior_friction);
    note("cusum", enhance.cusum != default.cusum);
    note("derivative", enhance.derivative != default.derivative);
    // Some of these settings are used by both algorithms.
    let mut drop = enhance.drop;
    drop.standstill_mps = default.drop.standstill_mps;
    note("drop", drop != default.drop);
    let mut guard = enhance.guard;
    (guard.revisit_margin_m, guard.blind_travel_m) =
        (default.guard.revisit_margin_m, default.guard.blind_travel_m);
    note("guard", guard != default.guard);
    let (search, usual) = (&enhance.contact_search, &default.contact_search);
    note("contact_search.samples", search.samples != usual.samples);
    note("contact_search.learn_s", search.learn_s != usual.learn_s);
    note("contact_search.extrapolate_over_m", search.extrapolate_over_m != usual.extrapolate_over_m);
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EnhancerConfigFile;

    fn unused(text: &str) -> Vec<&'static str> {
        unused_settings(&EnhancerConfigFile::parse("e.ron", text).expect("it is right").enhance)
    }

    #[test]
    fn settings_of_the_other_algorithm_are_named() {
        assert!(unused("Enhance()").is_empty() && unused("Enhance(algorithm: Paper)").is_empty());
        assert_eq!(
            unused("Enhance(forgetting: 0.99, cusum: (sigma_rupture_n: 0.05))"),
            ["forgetting", "cusum"]
        );
        assert!(unused("Enhance(algorithm: Paper, cusum: (sigma_rupture_n: 0.05))").is_empty());
        assert_eq!(unused("Enhance(algorithm: Paper, stylet: (min_drop_share: 0.2))"), ["stylet"]);
        // Both use the standstill speed; a Kelvin-Voigt model runs the paper's algorithm.
        assert!(unused("Enhance(drop: (standstill_mps: 2e-5), guard: (blind_travel_m: 0.001))").is_empty());
        assert!(unused("Enhance(model: KelvinVoigt, forgetting: 0.99)").is_empty());
        let search = "contact_search: (samples: 9, learn_s: 0.5, extrapolate_over_m: 0.002, noise_sds: 4.0)";
        assert_eq!(
            unused(&format!("Enhance({search})")),
            ["contact_search.samples", "contact_search.learn_s", "contact_search.extrapolate_over_m"]
        );
        assert!(unused(&format!("Enhance(algorithm: Paper, {search})")).is_empty());
    }
}
