//! Ruptures whose drops take their time: where the sharp drops of the data tell another story than the smeared
//! ones, and the law with soft boundaries likes the smeared ones far better, those are begun with.

use super::choice;
use crate::fit::Data;
use crate::model::Model;
use crate::noise::Noise;
use crate::refine::fit_seeded;
use crate::ruptures::{self, Found, SMEARED};
use crate::track::Track;
use std::sync::Arc;

/// Share of the objective that the smeared drops may leave.
const FAR_BETTER: f64 = 0.5;
/// Widths (m) of the boundaries that are tried.
const WIDTHS_M: [f64; 3] = [3e-4, 1e-3, 3e-3];

/// Takes the smeared drops when they fit far better.
pub(super) fn tried(model: &mut Model, found: &mut Found, tracks: &[Track], noise: Noise) {
    let mut other = Model::base(&model.assumed, model.tolerance, &model.given);
    let smeared = ruptures::find(&mut other, tracks, SMEARED);
    if !found.differs(&smeared) {
        return;
    }
    let q = (tracks.first().map_or(1.0, |t| t.sample_hz) / super::SCREEN_HZ).round().max(1.0) as usize;
    let tracks = Arc::new(tracks.to_vec());
    let best = |model: &Model, instants: &[Vec<f64>]| {
        let data = Data {
            tracks: tracks.clone(),
            ruptures: instants.to_vec(),
            reach: Arc::default(),
            dead_n: 0.0,
            noise,
        };
        let coarse = data.blocks(q, noise.blocks(q));
        let soft = WIDTHS_M.iter().filter_map(|w| Some(model.with(choice("soft_boundary", &[*w])?)));
        std::iter::once(model.clone())
            .chain(soft)
            .filter_map(|m| Some(fit_seeded(m, &coarse, 6, 1.0)?.nats))
            .fold(f64::INFINITY, f64::min)
    };
    if best(&other, &smeared.instants) < FAR_BETTER * best(model, &found.instants) {
        *model = other;
        *found = smeared;
    }
}
