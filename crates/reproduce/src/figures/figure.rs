//! A figure of the page, and the recording that it shows.

use crate::algorithm_variant::Sensor;
use crate::all_runs::{NOISE_MN, ReproduceError, Study};
use crate::paper_experiments::Case;
use crate::simulated_insertion::Insertion;
use crate::study_conditions::View;
use crate::tuned_thresholds::Tuning;
use crate::value_source::SourcedTable;
use stylet_report::Chart;

/// A reproduced figure of the paper.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Number, such as `S Fig. 3`.
    pub number: &'static str,
    /// Title.
    pub title: String,
    /// Which figure it reproduces, and what it shows.
    pub caption: String,
    /// The force panel, zoomable in the page; the pictures then contain only the other panels.
    pub force: Option<Chart>,
    /// Pictures for the page.
    pub pictures: Vec<String>,
    /// Pictures as files, each complete: name and content.
    pub files: Vec<(&'static str, String)>,
    /// Tables that belong to it.
    pub tables: Vec<SourcedTable>,
}

/// The recording that a figure shows: that of the first seed of the study.
pub(super) struct FigureRecording {
    pub(super) insertion: Insertion,
    pub(super) force_n: Vec<f64>,
    pub(super) sensor: Sensor,
    pub(super) seed: u64,
    pub(super) tuning: Tuning,
}

impl FigureRecording {
    pub(super) fn of(study: &Study, case: Case, sensor: Sensor) -> Result<Self, ReproduceError> {
        let seed = study.first_seed;
        let insertion = Insertion::of(&case.scenario()?, seed)?;
        let force_n = match sensor {
            Sensor::ForceTorque => insertion.reading(seed, NOISE_MN),
            Sensor::Virtual => insertion.force_n(sensor).to_vec(),
        };
        let tuning = study.tuning(View::primary(study).recording_key(case), sensor);
        Ok(Self { insertion, force_n, sensor, seed, tuning })
    }
}
