//! The paper's claims (a) to (j), each computed: one file per claim holds what is computed, the threshold
//! and what the verdict can depend on.

mod a_friction_apart;
mod b_slightly_lower;
mod c_multi_layer_better;
mod d_kelvin_voigt_over;
mod e_latex_ruptures;
mod f_either_sensor;
mod g_only_ruptures;
mod h_no_reweighting;
mod i_reset_mechanisms;
mod j_weighting;

use crate::spread::Spread;
use crate::study::{ReproduceError, Study};
use crate::verdict::{Condition, Verdict};
use serde::Serialize;
use std::collections::BTreeMap;

/// A claim with what our testbed says of it: a row of `claims.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// `a` to `j`.
    pub id: char,
    /// The claim.
    pub claim: &'static str,
    /// Where the paper or its supplement makes it.
    pub figure: &'static str,
    /// What is asked of every seed: the statement with its thresholds.
    pub rule: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Number of noise seeds.
    pub seeds: u64,
    /// In how many seeds the statement holds, per condition.
    pub conditions: Vec<Condition>,
    /// Our numbers with their spread.
    pub numbers: BTreeMap<String, Spread>,
    /// Those of them that stand in the table of all claims.
    #[serde(skip)]
    pub headline: &'static [&'static str],
    /// What the numbers mean, and why the testbed says so.
    pub remark: String,
}

/// All ten claims.
///
/// # Errors
/// [`ReproduceError`] when a shipped scenario is wrong.
pub fn all(study: &Study) -> Result<Vec<Claim>, ReproduceError> {
    Ok(vec![
        a_friction_apart::claim(study),
        b_slightly_lower::claim(study),
        c_multi_layer_better::claim(study),
        d_kelvin_voigt_over::claim(study),
        e_latex_ruptures::claim(study),
        f_either_sensor::claim(study),
        g_only_ruptures::claim(study),
        h_no_reweighting::claim(study),
        i_reset_mechanisms::claim(study),
        j_weighting::claim(study.seeds)?,
    ])
}

/// Numbers by name; what no seed gave is left out.
fn numbers(list: impl IntoIterator<Item = (String, Option<Spread>)>) -> BTreeMap<String, Spread> {
    list.into_iter().filter_map(|(name, spread)| Some((name, spread?))).collect()
}
