//! Reproduces the figures of Ferro, Gaz, Anzidei and Vendittelli (2021) and its supplement from the shipped scenarios, and tests each
//! of the paper's claims.
//!
//! - [`paper_experiments`]: the scenario of each experiment; [`algorithm_variant`]: variants of the paper's algorithm;
//!   [`detection_tuning`]: its detection, tuned within the published range; [`assumed_value_changes`]: values that the paper does not
//!   give, halved and doubled.
//! - [`all_runs`]: all runs over all noise seeds, once; [`study_conditions`]: the conditions under which they are evaluated.
//! - [`claim_protocol`]: the protocol of each claim, written before the runs; [`claims`]: one file per claim; [`effect_size`],
//!   [`seed_interval`] and [`claim_verdict`]: from numbers to a verdict.
//! - [`value_source`]: the source of each number; [`assumed_values`]: verdicts that depend on assumed values; [`algorithm_switches`]:
//!   what each switch of the algorithm does.
//! - [`figures`]: one file per group; [`estimates_against_truth`]: K and b against the truth; [`reproduction_page`]: the page.
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
    /// The effect of the algorithm's switches, as JSON.
    pub switches_json: String,
    /// Pictures: file name and SVG.
    pub pictures: Vec<(&'static str, String)>,
}

/// All runs needed by claims, figures and tables, over the noise seeds from `first_seed` on.
#[must_use]
pub fn plan(first_seed: u64, seeds: u64) -> Plan {
    let planning = Study::planning(first_seed, seeds);
    let _ = claims::all(&planning);
    figures::request_runs(&planning);
    let _ = algorithm_switches::section(&planning);
    let _ = estimates_against_truth::section(&planning, &estimates_against_truth::pictures(&planning));
    planning.plan()
}

/// Runs a plan, evaluates the claims, draws the figures. `done` is called once for each of [`Plan::recording_count`]. The output
/// does not depend on the number of threads.
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
