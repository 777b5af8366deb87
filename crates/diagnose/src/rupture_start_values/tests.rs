use super::*;
use crate::test_fixtures::assumed_layers;
use stylet_identify::model::Assumptions;

/// A rupture at a relative force excess of `force`, well before the end of the layer.
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
    let assumed = assumed_layers(&[[0.02, 100.0, 1000.0]]);
    let mut tissue = assumed.tissue.clone();
    tissue.layers[0].puncture_n = Some(2.0);
    let mut model = Model::base(std::sync::Arc::new(Assumptions { tissue, ..(*assumed).clone() }), 3);
    model.tissue.layers[0].puncture_n = Some(puncture_n);
    model
}

#[test]
fn each_rupture_proposes_the_factor_that_matches_its_force() {
    let whole = RuptureEvent { ruptured: false, ..rupture(0.4) };
    let events: Vec<Vec<RuptureEvent>> =
        [rupture(0.1), whole, rupture(-0.2), rupture(f64::NEG_INFINITY)].map(|e| vec![e]).to_vec();
    let layer = LayerEvents::new(&model(2.0), &events, 0);
    assert_eq!(layer.events.len(), 4);
    assert_eq!(layer.factors, [1.0, 1.1, 0.8]);
    // Factors are relative to the current force and limited by its bounds.
    let layer = LayerEvents::new(&model(1.8), &events, 0);
    assert!(layer.factors.iter().zip([1.0, 1.1, 0.8]).all(|(a, b)| (a - b).abs() < 1e-12));
    let far = LayerEvents::new(&model(2.0), &[vec![rupture(1e9)], vec![rupture(-1.0)]], 0);
    let role = stylet_identify::model::ParameterRole::Puncture(0);
    let n = model(2.0).shared_parameters().into_iter().find(|n| n.role == role).expect("free");
    assert_eq!(far.factors, [1.0, n.high, n.low]);
    // A layer without a puncture force is not changed.
    assert_eq!(
        LayerEvents::new(&Model::base(assumed_layers(&[[0.02, 100.0, 1000.0]]), 3), &events, 0).factors,
        [1.0]
    );
}

#[test]
fn best_factor_maximises_the_likelihood_of_the_ruptures() {
    let scatter = Scatter { rupture_force: 0.02, ..Scatter::default() };
    let nats = |forces: &[f64], factor: f64| -> f64 {
        let moved =
            |f: &f64| RuptureEvent { force_excess_rate: 0.5 / factor, ..rupture((1.0 + f) / factor - 1.0) };
        forces.iter().map(|f| evaluate_rupture(&moved(f), &scatter).nats.min(12.0)).sum()
    };
    for forces in [vec![0.1, 0.11, 0.09], vec![-0.2, -0.21, 0.3], vec![0.0, 0.004, -0.2], vec![0.5, -0.5]] {
        let layer = LayerEvents {
            events: forces.iter().map(|f| rupture(*f)).collect(),
            factors: std::iter::once(1.0).chain(forces.iter().map(|f| 1.0 + f)).collect(),
        };
        let (factor, rupture_objective) = layer.best(&scatter);
        let least = layer.factors.iter().map(|f| nats(&forces, *f)).fold(f64::INFINITY, f64::min);
        assert!(
            (rupture_objective - least).abs() < 1e-9 && (nats(&forces, factor) - least).abs() < 1e-9,
            "{forces:?}"
        );
    }
    // The contribution of one event is limited: 50 standard deviations count as much as 10.
    let alone = LayerEvents { events: vec![rupture(1.0)], factors: vec![1.0] };
    assert_eq!(alone.best(&scatter), (1.0, MAX_EVENT_NATS));
    let none = LayerEvents { events: Vec::new(), factors: Vec::new() };
    assert_eq!(none.best(&scatter), (1.0, 0.0));
}
