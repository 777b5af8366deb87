//! The paper, figure by figure and claim by claim: our analogues of the figures of Ferro, Gaz, Anzidei and
//! Vendittelli (2021) and its supplement, from the shipped scenarios, and a verdict on every claim.
//!
//! - [`case`]: which scenario stands for which experiment; [`variant`]: the ways the algorithm is run.
//! - [`study`]: all runs over all noise seeds, once.
//! - [`claims`]: one file per claim; [`verdict`]: the rule that makes a verdict of numbers.
//! - [`figures`]: one file per group; [`truth`]: K and b against the truth; [`page`]: all together.
#![forbid(unsafe_code)]

pub mod case;
pub mod claims;
pub mod figures;
pub mod friction;
pub mod outcome;
pub mod page;
pub mod spread;
pub mod study;
pub mod truth;
pub mod variant;
pub mod verdict;

use claims::Claim;
use study::{ReproduceError, Study};

/// Everything that `stylet reproduce` writes.
#[derive(Clone, Debug)]
pub struct Reproduction {
    /// The page.
    pub html: String,
    /// The claims with their verdicts.
    pub claims: Vec<Claim>,
    /// The same as JSON.
    pub claims_json: String,
    /// Pictures: file name and SVG.
    pub pictures: Vec<(&'static str, String)>,
}

/// Runs every experiment over the noise seeds `1..=seeds`, judges the claims, draws the figures. `done` is
/// called once for each of [`Study::insertions`]. The same bytes for any number of threads.
///
/// # Errors
/// [`ReproduceError`] when a shipped scenario is wrong.
pub fn reproduce(seeds: u64, done: &(dyn Fn() + Sync)) -> Result<Reproduction, ReproduceError> {
    let study = Study::run(seeds, done)?;
    let claims = claims::all(&study)?;
    let figures = figures::all(&study)?;
    let mut pictures = truth::pictures(&study).to_vec();
    let html = page::page(&study, &claims, &figures, &pictures).to_html();
    let claims_json = serde_json::to_string_pretty(&claims)? + "\n";
    pictures.extend(figures.into_iter().flat_map(|f| f.files));
    Ok(Reproduction { html, claims, claims_json, pictures })
}
