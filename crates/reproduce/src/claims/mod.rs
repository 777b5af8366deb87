//! The claims of the paper. One file per claim or group of claims holds the measure; criterion, conditions and sources are given in the protocol
//! of the claim (`claims/*.md`), which was written before the runs.

mod a_friction_does_not_overlap;
mod b_friction_slightly_lower;
mod c_multi_layer_better;
mod claim;
mod claim_definition;
mod d_kelvin_voigt_overcompensates;
mod e_f_detection;
mod g_resets_only_at_ruptures;
mod h_no_reweighting;
mod i_reset_mechanisms;
mod j_weighting;
mod verdict_reason;

pub use claim::{Claim, Condition, Primary};
use claim_definition::protocol;
pub use claim_definition::{Definition, Measure, Sensitivity};
pub(crate) use d_kelvin_voigt_overcompensates::VISIBLE_RATIO;

use crate::all_runs::Study;

/// The definitions of all claims in the order of the protocols.
#[must_use]
pub fn definitions() -> Vec<Definition> {
    let mut all = vec![
        a_friction_does_not_overlap::definition(),
        Definition::untestable(protocol!("a2")),
        b_friction_slightly_lower::online(),
        b_friction_slightly_lower::sinusoidal(),
        c_multi_layer_better::force_after_exit(),
        c_multi_layer_better::on_the_liver(),
        d_kelvin_voigt_overcompensates::definition(),
    ];
    all.extend(e_f_detection::definitions());
    all.extend([
        Definition::untestable(protocol!("f2")),
        g_resets_only_at_ruptures::definition(),
        h_no_reweighting::reconstructs(),
        h_no_reweighting::compensates(),
        i_reset_mechanisms::definition(),
        j_weighting::definition(),
    ]);
    all
}

/// Evaluates all claims.
#[must_use]
pub fn all(study: &Study) -> Vec<Claim> {
    definitions().iter().map(|d| d.evaluate(study)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::claim_protocol::Protocol;

    #[test]
    fn code_and_protocols_agree_on_ids_bars_conditions_and_numbers() {
        let definitions = definitions();
        let protocols: Vec<Protocol> = definitions.iter().map(|d| Protocol::read(d.protocol)).collect();
        let ids: Vec<&str> = protocols.iter().map(|p| p.id.as_str()).collect();
        assert_eq!(
            ids,
            ["a1", "a2", "b1", "b2", "c1", "c2", "d", "e", "f1", "f2", "g", "h1", "h2", "i", "j"]
        );
        for (definition, protocol) in definitions.iter().zip(&protocols) {
            let bar = definition.primary.map_or("none".to_owned(), |(_, bar)| bar.words());
            assert_eq!(bar, protocol.section("Supported when"), "{}", protocol.id);
            let names: Vec<&str> = definition.sensitivities.iter().map(|s| s.name).collect();
            assert_eq!(names, protocol.list("Sensitivity conditions"), "{}", protocol.id);
            let assumed_values: Vec<&str> = definition.assumed_values.iter().map(|n| n.name()).collect();
            assert_eq!(
                assumed_values,
                protocol.list("Numbers of ours, halved and doubled"),
                "{}",
                protocol.id
            );
            for heading in
                ["The paper says", "Source", "Primary condition", "Effect", "Assumed", "Untestable"]
            {
                assert!(!protocol.section(heading).is_empty(), "{}: {heading}", protocol.id);
            }
        }
    }
}
