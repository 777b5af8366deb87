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

pub mod case;
pub mod change;
pub mod chosen;
pub mod claims;
pub mod effect;
pub mod figures;
pub mod friction;
pub mod insertion;
pub mod interval;
pub mod outcome;
pub mod page;
pub mod protocol;
pub mod source;
pub mod spread;
pub mod study;
pub mod switches;
pub mod truth;
pub mod tuning;
pub mod variant;
pub mod verdict;
pub mod view;

use claims::Claim;
use study::{Plan, ReproduceError, Study};

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
    let _ = switches::section(&asking);
    let _ = truth::section(&asking, &truth::pictures(&asking));
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
    let mut pictures = truth::pictures(&study).to_vec();
    let files: Vec<_> = figures.iter().flat_map(|f| f.files.clone()).collect();
    let html = page::page(&study, &claims, figures, &pictures).to_html();
    let claims_json = serde_json::to_string_pretty(&claims)? + "\n";
    let switches_json = serde_json::to_string_pretty(&switches::record(&study))? + "\n";
    pictures.extend(files);
    Ok(Reproduction { html, claims, claims_json, switches_json, pictures })
}
