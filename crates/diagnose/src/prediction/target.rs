//! A recording to predict, matched with the training recordings.

use super::insertion_course::{Curve, curve_of};
use super::prepared::Prepared;
use super::training_curves::BaselineCurves;

/// A recording to predict.
#[derive(Default)]
pub struct Target {
    /// Its index.
    pub r: usize,
    /// Index among the training recordings, if it is one of them.
    pub training_index: Option<usize>,
    /// Mean residual (N) of the other training recordings.
    pub mean_residual: Curve,
    /// Place of every block.
    pub places: Vec<f64>,
    /// Model-free predictions.
    pub baselines: BaselineCurves,
}

impl Target {
    /// Matches recording `r` with the training recordings.
    pub fn new(prepared: &Prepared, r: usize) -> Self {
        let (b, course) = (&prepared.data.recordings[r], &prepared.courses[r]);
        let Some(t) = prepared.training else { return Self { r, ..Self::default() } };
        let places = course.places(b, t.range, 0.0);
        let training_index = t.index_of(&curve_of(&places, &b.used, &b.force_n));
        let (speed, stroke) = (course.speed_mps, course.range.deepest_m);
        Self {
            r,
            mean_residual: t.mean_residual(speed, stroke, training_index),
            baselines: t.baselines(speed, stroke, training_index),
            training_index,
            places,
        }
    }
}
