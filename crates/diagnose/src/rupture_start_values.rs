//! Starts for effects that show at ruptures alone.
//!
//! What such an effect does looks like scatter between insertions until it is taken out, and under a wide scatter no
//! derivative tells that: the strengths are tried one by one, each with puncture forces and scatter of its own.

use crate::effect_start_values::EffectStart;
use rayon::prelude::*;
use stylet_identify::likelihood::replay;
use stylet_identify::model::{EffectTerm, Model, ParameterRole, Scatter};
use stylet_identify::rupture_likelihood::{
    FORCE_SCATTER_GRID, RuptureEvent, evaluate_rupture, scatter_prior_nats,
};
use stylet_identify::score_test::ScoreTest;
use stylet_tissue::EffectInfo;

/// Strengths tried over the range in which a search starts, and again around the best of them ...
const TRIED: usize = 21;
/// ... so often.
const PASSES: usize = 3;
/// A rupture says at most so many nats against a strength: where the speed jumps its instant is not known well enough.
const MOST_NATS: f64 = 12.0;

/// The best start of a one-parameter effect by the ruptures alone; `None` where it gains nothing.
#[must_use]
pub fn start_from_ruptures(info: &'static EffectInfo, look: &ScoreTest) -> Option<EffectStart> {
    let [parameter] = info.parameters else { return None };
    let stands = told(look, look.fit.model.clone())?.0;
    let mut best: Option<(f64, f64, Model)> = None;
    let (mut low, mut high) = parameter.search;
    for _ in 0..PASSES {
        let step = (high - low) / (TRIED - 1) as f64;
        let tried = (0..TRIED).into_par_iter().filter_map(|k| {
            let x = low + step * k as f64;
            let choice = EffectTerm::new(info, &[x]);
            choice.effect().filter(|e| e.check().is_ok())?;
            let (nats, model) = told(look, look.fit.model.with_effect(choice))?;
            Some((x, nats, model))
        });
        for one in tried.collect::<Vec<_>>() {
            if best.as_ref().is_none_or(|b| one.1 < b.1) {
                best = Some(one);
            }
        }
        let at = best.as_ref()?.0;
        (low, high) = ((at - step).max(parameter.low), (at + step).min(parameter.high));
    }
    let (x, nats, model) = best?;
    let gained = stands - nats;
    if gained <= 0.0 {
        return None;
    }
    Some(EffectStart {
        choice: EffectTerm::new(info, &[x]),
        gain_nats: gained,
        detectable_nats: gained,
        model: Some(model),
    })
}

/// Nats of the ruptures where they are, with the puncture forces and the scatter that fit a model best, and the model that
/// has these.
fn told(look: &ScoreTest, mut model: Model) -> Option<(f64, Model)> {
    let events: Vec<Vec<RuptureEvent>> = (0..look.data.recording_count())
        .map(|r| Some(replay(&model, look.data, r)?.ruptures))
        .collect::<Option<_>>()?;
    let layers: Vec<Layer> = (0..model.layers()).map(|l| Layer::new(&model, &events, l)).collect();
    let mut best: Option<(f64, Scatter, Vec<f64>)> = None;
    for force in FORCE_SCATTER_GRID {
        let scatter = Scatter { rupture_force: force, ..model.scatter };
        let told: Vec<(f64, f64)> = layers.iter().map(|l| l.best(&scatter)).collect();
        let nats = told.iter().map(|t| t.1).sum::<f64>() + scatter_prior_nats(&scatter);
        if best.as_ref().is_none_or(|b| nats < b.0) {
            best = Some((nats, scatter, told.iter().map(|t| t.0).collect()));
        }
    }
    let (nats, scatter, factors) = best?;
    model.scatter = scatter;
    for (layer, factor) in factors.iter().enumerate() {
        let role = ParameterRole::Puncture(layer);
        model.set(role, 0, model.get(role, 0) * factor);
    }
    Some((nats, model))
}

/// A layer's events, and the factors on its puncture force that one of them asks for.
struct Layer {
    events: Vec<RuptureEvent>,
    factors: Vec<f64>,
}

impl Layer {
    fn new(model: &Model, events: &[Vec<RuptureEvent>], layer: usize) -> Self {
        let events: Vec<RuptureEvent> = events.iter().filter_map(|e| e.get(layer).copied()).collect();
        let role = ParameterRole::Puncture(layer);
        let mut factors = vec![1.0];
        if let Some(n) = model.shared_parameters().into_iter().find(|n| n.role == role) {
            let now = model.get(role, 0);
            let asked = events
                .iter()
                .filter(|e| e.ruptured && e.force_excess.is_finite())
                .map(|e| 1.0 + e.force_excess);
            factors.extend(asked.map(|f| (f * now).clamp(n.low, n.high) / now));
        }
        Self { events, factors }
    }

    /// The factor under which the events are likeliest, and their nats.
    fn best(&self, scatter: &Scatter) -> (f64, f64) {
        let nats = |factor: f64| -> f64 {
            let moved = |e: &RuptureEvent| RuptureEvent {
                force_excess: (1.0 + e.force_excess) / factor - 1.0,
                force_excess_rate: e.force_excess_rate / factor,
                ..*e
            };
            self.events.iter().map(|e| evaluate_rupture(&moved(e), scatter).nats.min(MOST_NATS)).sum()
        };
        let of = |factor: &f64| (*factor, nats(*factor));
        self.factors.iter().map(of).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1.0, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::{Layer, MOST_NATS};
    use crate::test_fixtures::assumed_layers;
    use stylet_identify::model::{Assumptions, Model, Scatter};
    use stylet_identify::rupture_likelihood::{RuptureEvent, evaluate_rupture};

    /// A rupture so far beyond the puncture force, relative to it, long before the far face.
    fn rupture(force: f64) -> RuptureEvent {
        RuptureEvent {
            force_excess: force,
            depth_excess_m: -0.01,
            force_excess_rate: 0.5,
            depth_rate_mps: 4e-3,
            elastic_n: 1.0,
            ruptured: true,
            sample_step_s: 0.02,
        }
    }

    fn model(puncture_n: f64) -> Model {
        let belief = assumed_layers(&[[0.02, 100.0, 1000.0]]);
        let mut tissue = belief.tissue.clone();
        tissue.layers[0].puncture_n = Some(2.0);
        let mut model = Model::base(std::sync::Arc::new(Assumptions { tissue, ..(*belief).clone() }), 3);
        model.tissue.layers[0].puncture_n = Some(puncture_n);
        model
    }

    #[test]
    fn each_rupture_asks_for_the_factor_that_puts_the_puncture_force_where_it_gave_way() {
        let whole = RuptureEvent { ruptured: false, ..rupture(0.4) };
        let events: Vec<Vec<RuptureEvent>> =
            [rupture(0.1), whole, rupture(-0.2), rupture(f64::NEG_INFINITY)].map(|e| vec![e]).to_vec();
        let layer = Layer::new(&model(2.0), &events, 0);
        assert_eq!(layer.events.len(), 4);
        assert_eq!(layer.factors, [1.0, 1.1, 0.8]);
        // Where the force stands elsewhere factors are of what it is now, and end where the force may not go further.
        let layer = Layer::new(&model(1.8), &events, 0);
        assert!(layer.factors.iter().zip([1.0, 1.1, 0.8]).all(|(a, b)| (a - b).abs() < 1e-12));
        let far = Layer::new(&model(2.0), &[vec![rupture(1e9)], vec![rupture(-1.0)]], 0);
        let role = stylet_identify::model::ParameterRole::Puncture(0);
        let n = model(2.0).shared_parameters().into_iter().find(|n| n.role == role).expect("free");
        assert_eq!(far.factors, [1.0, n.high, n.low]);
        // A layer without a puncture force is left as it is.
        assert_eq!(
            Layer::new(&Model::base(assumed_layers(&[[0.02, 100.0, 1000.0]]), 3), &events, 0).factors,
            [1.0]
        );
    }

    #[test]
    fn the_best_factor_is_the_one_under_which_the_ruptures_are_likeliest() {
        let scatter = Scatter { rupture_force: 0.02, ..Scatter::default() };
        let nats = |forces: &[f64], factor: f64| -> f64 {
            let moved = |f: &f64| RuptureEvent {
                force_excess_rate: 0.5 / factor,
                ..rupture((1.0 + f) / factor - 1.0)
            };
            forces.iter().map(|f| evaluate_rupture(&moved(f), &scatter).nats.min(12.0)).sum()
        };
        for forces in [vec![0.1, 0.11, 0.09], vec![-0.2, -0.21, 0.3], vec![0.0, 0.004, -0.2], vec![0.5, -0.5]]
        {
            let layer = Layer {
                events: forces.iter().map(|f| rupture(*f)).collect(),
                factors: std::iter::once(1.0).chain(forces.iter().map(|f| 1.0 + f)).collect(),
            };
            let (factor, told) = layer.best(&scatter);
            let least = layer.factors.iter().map(|f| nats(&forces, *f)).fold(f64::INFINITY, f64::min);
            assert!(
                (told - least).abs() < 1e-9 && (nats(&forces, factor) - least).abs() < 1e-9,
                "{forces:?}"
            );
        }
        // One that is off by fifty deviations says no more than one that is off by ten.
        let alone = Layer { events: vec![rupture(1.0)], factors: vec![1.0] };
        assert_eq!(alone.best(&scatter), (1.0, MOST_NATS));
        let none = Layer { events: Vec::new(), factors: Vec::new() };
        assert_eq!(none.best(&scatter), (1.0, 0.0));
    }
}
