//! The figures: one file per group, each with its number in the supplement (S) or the main paper (M).

mod ablation_figures;
mod friction_figures;
mod insertion_figures;
mod insertion_panels;
mod state_machine;
mod supplement_comparison;

use crate::algorithm_variant::Sensor;
use crate::all_runs::{NOISE_MN, ReproduceError, Study};
use crate::detection_tuning::Tuning;
use crate::paper_experiments::Case;
use crate::simulated_insertion::Insertion;
use crate::study_conditions::View;
use crate::value_source::Sourced;
use stylet_report::Chart;

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
    /// Tables that belong to it.
    pub tables: Vec<Sourced>,
}

/// The recording that a figure draws: the study's first seed.
struct Draw {
    insertion: Insertion,
    force_n: Vec<f64>,
    sensor: Sensor,
    seed: u64,
    tuning: Tuning,
}

impl Draw {
    fn of(study: &Study, case: Case, sensor: Sensor) -> Result<Self, ReproduceError> {
        let seed = study.first_seed;
        let insertion = Insertion::of(&case.scenario()?, seed)?;
        let force_n = match sensor {
            Sensor::ForceTorque => insertion.reading(seed, NOISE_MN),
            Sensor::Virtual => insertion.force_n(sensor).to_vec(),
        };
        let tuning = study.tuning(View::primary(study).recorded(case), sensor);
        Ok(Self { insertion, force_n, sensor, seed, tuning })
    }
}

/// Notes what the figures look up.
pub fn ask(study: &Study) {
    insertion_figures::ask(study);
    ablation_figures::ask(study);
    let _ = (friction_figures::figure(study), friction_figures::table_one(study));
}

/// All figures in the order of the supplement, those of the main paper at the end.
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
