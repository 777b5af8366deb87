//! What unit tests of several modules make up.

use crate::select::Stage;
use crate::set::Insertion;
use crate::set::fitted::{Fitted, refitted};
use crate::set::laws::{Kind, Law};
use crate::set::left_out::Score;
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::model::{Belief, Choice, Model};
use stylet_identify::noise::Noise;
use stylet_identify::objective::{Data, Residuals};
use stylet_record::Recording;
use stylet_tissue::{AnyEffect, Effect, Law as TissueLaw, LawState, Layer, Tissue};

/// Layers of so much thickness, stiffness and friction, from the origin on, believed to 30 % and their thickness to 10 %.
pub fn believed(layers: &[[f64; 3]]) -> Arc<Belief> {
    let layer = |&[thickness_m, stiffness_n_per_m, friction_ns_per_m2]: &[f64; 3]| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: None,
    };
    Arc::new(Belief {
        tissue: Tissue { surface_m: 0.0, layers: layers.iter().map(layer).collect() },
        given: Vec::new(),
        tolerance: vec![0.3; layers.len()],
        thickness_tolerance: vec![0.1; layers.len()],
        surface_tolerance_m: 0.01,
    })
}

/// A law of this kind with these effects, judged by these errors (N) and fitted to so many nats; nothing of it was measured.
pub fn law(kind: Kind, effects: &[AnyEffect], errors_n: &[f64], nats: f64) -> Law {
    let mut model = Model::base(believed(&[[0.02, 100.0, 1000.0]]), 0);
    model.effects = effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    let residuals = Residuals { e: Vec::new(), w: Vec::new(), events: Vec::new(), nats };
    let data = Data::new(Arc::new(Vec::new()), Noise::white(1.0), 0.0);
    let fitted = Fitted { fit: Fit { model, residuals }, data, drops: Vec::new(), starts: (8, 3) };
    let score = |e: &f64| {
        let parts = [(100.0 * e * e, 100.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)];
        Some(Score { rmse_n: *e, covered: 0.0, parts }).filter(|_| e.is_finite())
    };
    Law { kind, fitted, errors_n: errors_n.to_vec(), scores: errors_n.iter().map(score).collect() }
}

/// One layer of gel from 4 mm on that gives way at 2 N.
pub fn gel() -> Tissue {
    let layer = Layer {
        name: "gel".to_owned(),
        thickness_m: 0.05,
        stiffness_n_per_m: 250.0,
        friction_ns_per_m2: 2e4,
        puncture_n: Some(2.0),
    };
    Tissue { surface_m: 0.004, layers: vec![layer] }
}

/// Noise of the sensor (N) in what follows.
pub const SENSOR_N: f64 = 0.01;

/// Insertions into the gel by 16 mm, with a rest of a second, and back, at 50 Hz: each at a speed (m/s), its surface moved by so much (m).
pub fn insertions(effects: &[AnyEffect], all: &[[f64; 2]]) -> Vec<Insertion> {
    showing(effects, all, |_| 0.0)
}

/// The same, read off a sensor that shows so much (N) more at every instant (s).
pub fn showing(effects: &[AnyEffect], all: &[[f64; 2]], more_n: impl Fn(f64) -> f64) -> Vec<Insertion> {
    all.iter().enumerate().map(|(k, at)| insertion(k, effects, *at, &more_n)).collect()
}

fn insertion(
    k: usize,
    effects: &[AnyEffect],
    [speed, moved_m]: [f64; 2],
    more_n: &impl Fn(f64) -> f64,
) -> Insertion {
    let mut tissue = gel();
    tissue.surface_m += moved_m;
    let law = TissueLaw::new(&tissue, effects).expect("a law");
    let travel_s = 0.016 / speed;
    let (mut state, mut seed) = (LawState::default(), 17 + 1000 * k as u64);
    // The sum of twelve evenly spread numbers is nearly normal.
    let mut normal = || {
        (0..12).fold(-6.0, |sum, _| {
            seed = (seed * 1_103_515_245 + 12_345) % 2_147_483_648;
            sum + seed as f64 / 2_147_483_648.0
        })
    };
    let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..((2.0 * travel_s + 1.5) * 50.0) as usize {
        let at = 0.02 * i as f64;
        let (place, v) = match at {
            x if x < travel_s => (speed * x, speed),
            x if x < travel_s + 1.0 => (0.016, 0.0),
            x if x < 2.0 * travel_s + 1.0 => (0.016 - speed * (x - travel_s - 1.0), -speed),
            _ => (0.0, 0.0),
        };
        t.push(at);
        z.push(place);
        f.push(law.step(&mut state, at, place, v, |_| {}).total_n + more_n(at) + SENSOR_N * normal());
    }
    Insertion::new(format!("run {k}"), Recording::new(t, z, f).expect("clean columns"), 1)
}

/// Insertions fitted with these effects from the truth on; surface and friction are every run's own.
pub fn settled(effects: &[AnyEffect], runs: &[&Insertion]) -> Fitted {
    let belief = Belief {
        tissue: gel(),
        given: Vec::new(),
        tolerance: vec![4.0],
        thickness_tolerance: vec![0.0],
        surface_tolerance_m: 2e-3,
    };
    let mut model = Model::base(Arc::new(belief), runs.len());
    model.effects = effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    (model.free.own_surface, model.free.own_friction, model.steady) = (true, true, true);
    model.scatter.surface_m = 2e-4;
    model.instants = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    let raw = stylet_record::raw::Raw::default();
    let drops = runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    refitted(&model, crate::set::fitted::blocks(runs, &raw), drops.collect()).expect("a fit")
}

/// Numbers spread evenly between nothing and one, the same ones for a seed.
pub fn evenly(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = (seed * 1_103_515_245 + 12_345) % 2_147_483_648;
        seed as f64 / 2_147_483_648.0
    }
}

/// A stage of a search that took this effect among rivals that gained so many nats.
pub fn stage(taken: Option<(&'static str, f64)>, needed: f64, rivals: &[(AnyEffect, f64)]) -> Stage {
    let choice = |(e, _): &(AnyEffect, f64)| Choice::new(e.info(), &e.parameters());
    let choices: Vec<Choice> = rivals.iter().map(choice).collect();
    let gained = choices.iter().zip(rivals).map(|(c, r)| (c.info.id, r.1, c.values.len())).collect();
    Stage { stood: Vec::new(), rivals: gained, taken, needed, choices }
}
