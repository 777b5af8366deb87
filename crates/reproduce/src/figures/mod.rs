//! The figures: one file per group, each with its number in the supplement (S) or the main paper (M).

mod ablations;
mod friction;
mod insertions;
mod machine;
mod panels;

use crate::study::{ReproduceError, Study};
use stylet_report::{Chart, Table};

/// A figure of the paper, re-made.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Number, as in `S Fig. 3`.
    pub number: &'static str,
    /// What it shows.
    pub title: String,
    /// What it corresponds to, and what to look at.
    pub caption: String,
    /// The force panel, to be zoomed in the page; the picture then holds the other panels only.
    pub force: Option<Chart>,
    /// Pictures for the page.
    pub pictures: Vec<String>,
    /// Pictures as files, each complete: name and content.
    pub files: Vec<(&'static str, String)>,
    /// Numbers beside it.
    pub tables: Vec<Table>,
}

/// All figures in the order of the supplement, those of the main paper at the end.
///
/// # Errors
/// [`ReproduceError`] when a shipped scenario is wrong.
pub fn all(study: &Study) -> Result<Vec<Figure>, ReproduceError> {
    let mut figures = vec![machine::figure(), friction::figure(study)];
    let (supplement, main) = insertions::figures(study)?;
    figures.extend(supplement);
    figures.extend(ablations::figures(study)?);
    figures.push(friction::table_one(study));
    figures.extend(main);
    Ok(figures)
}
