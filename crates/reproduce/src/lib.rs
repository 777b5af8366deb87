//! The paper, figure by figure and claim by claim: our analogues of the figures of Ferro, Gaz, Anzidei and
//! Vendittelli (2021) and its supplement, from the shipped scenarios, and a verdict on every claim.
//!
//! - [`case`]: which scenario stands for which experiment; [`variant`]: the ways the algorithm is run, always the
//!   paper's; [`tuning`]: its detection, tuned within the published range; [`change`]: numbers of ours, halved
//!   and doubled.
//! - [`study`]: all runs over all noise seeds, once; [`view`]: the conditions under which they are looked at.
//! - [`protocol`]: what was written down for each claim before the numbers; [`claims`]: one file per claim;
//!   [`effect`], [`interval`] and [`verdict`]: the rule that makes a verdict of numbers.
//! - [`source`]: whose each number is; [`chosen`]: the verdicts that hang on ours; [`switches`]: the algorithm's.
//! - [`figures`]: one file per group; [`truth`]: K and b against the truth; [`page`]: all together.
#![forbid(unsafe_code)]

pub mod algorithm_switches;
pub mod algorithm_variant;
pub mod all_runs;
pub mod assumed_value_changes;
pub mod assumed_values;
pub mod claim_protocol;
pub mod claim_verdict;
pub mod claims;
pub mod detection_tuning;
pub mod effect_size;
pub mod estimates_against_truth;
pub mod figures;
pub mod friction_estimates;
pub mod paper_experiments;
pub mod reproduction_page;
pub mod run_outcome;
pub mod seed_interval;
pub mod seed_spread;
pub mod simulated_insertion;
pub mod study_conditions;
pub mod tuned_thresholds;
pub mod value_source;

use all_runs::{Plan, ReproduceError, Study};
use claims::Claim;

/// Everything that `stylet reproduce` writes.
#[derive(Clone, Debug)]
pub struct Reproduction {
    /// The page.
    pub html: String,
    /// The claims with their verdicts.
    pub claims: Vec<Claim>,
    /// The same as JSON.
    pub claims_json: String,
    /// What the algorithm's switches do, as JSON.
    pub switches_json: String,
    /// Pictures: file name and SVG.
    pub pictures: Vec<(&'static str, String)>,
}

/// Everything that claims, figures and tables look up, over the noise seeds from `first_seed` on.
#[must_use]
pub fn plan(first_seed: u64, seeds: u64) -> Plan {
    let asking = Study::asking(first_seed, seeds);
    let _ = claims::all(&asking);
    figures::ask(&asking);
    let _ = algorithm_switches::section(&asking);
    let _ = estimates_against_truth::section(&asking, &estimates_against_truth::pictures(&asking));
    asking.plan()
}

/// Runs a plan, judges the claims, draws the figures. `done` is called once for each of
/// [`Plan::recordings_in_all`]. The same bytes for any number of threads.
///
/// # Errors
/// [`ReproduceError`] when a shipped scenario is wrong.
pub fn reproduce(plan: &Plan, done: &(dyn Fn() + Sync)) -> Result<Reproduction, ReproduceError> {
    let study = Study::run(plan, done)?;
    let claims = claims::all(&study);
    let figures = figures::all(&study)?;
    let mut pictures = estimates_against_truth::pictures(&study).to_vec();
    let files: Vec<_> = figures.iter().flat_map(|f| f.files.clone()).collect();
    let html = reproduction_page::page(&study, &claims, figures, &pictures).to_html();
    let claims_json = serde_json::to_string_pretty(&claims)? + "\n";
    let switches_json = serde_json::to_string_pretty(&algorithm_switches::record(&study))? + "\n";
    pictures.extend(files);
    Ok(Reproduction { html, claims, claims_json, switches_json, pictures })
}

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
