//! The reproduced figures, one file per group. Each carries its number in the supplement (S) or the main paper (M).

mod ablation_figures;
mod figure;
mod friction_figures;
mod insertion_figures;
mod insertion_panels;
mod state_machine;
mod supplement_comparison;

pub use figure::Figure;

use crate::all_runs::{ReproduceError, Study};

/// Requests all runs that the figures use.
pub fn request_runs(study: &Study) {
    insertion_figures::request_runs(study);
    ablation_figures::request_runs(study);
    let _ = (friction_figures::figure(study), friction_figures::table_one(study));
}

/// All figures in the order of the supplement, followed by those of the main paper.
///
/// # Errors
/// [`ReproduceError`] when a shipped scenario is wrong.
pub fn all(study: &Study) -> Result<Vec<Figure>, ReproduceError> {
    let mut figures = vec![state_machine::figure(), friction_figures::figure(study)];
    let (supplement, main) = insertion_figures::figures(study)?;
    figures.extend(supplement);
    figures.extend(ablation_figures::figures(study)?);
    figures.push(friction_figures::table_one(study));
    figures.extend(main);
    Ok(figures)
}
