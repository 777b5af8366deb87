//! What unit tests of several modules make up.

use crate::effect_selection::SearchStage;
use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::cross_validation::PredictionScore;
use crate::repeated_insertions::model_selection::{ModelFamily, ScoredModel};
use crate::repeated_insertions::multistart_fit::{SetFit, fit_from};
use std::sync::Arc;
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::{FitData, Residuals};
use stylet_identify::model::{Assumptions, EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::{AnyEffect, Effect, ForceLaw as TissueLaw, ForceLawState, Layer, Tissue};

/// Layers of so much thickness, stiffness and friction, from the origin on, believed to 30 % and their thickness to 10 %.
pub fn assumed_layers(layers: &[[f64; 3]]) -> Arc<Assumptions> {
    let layer = |&[thickness_m, stiffness_n_per_m, friction_ns_per_m2]: &[f64; 3]| Layer {
        name: String::new(),
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n: None,
    };
    Arc::new(Assumptions {
        tissue: Tissue { surface_m: 0.0, layers: layers.iter().map(layer).collect() },
        known_effects: Vec::new(),
        tolerance: vec![0.3; layers.len()],
        thickness_tolerance: vec![0.1; layers.len()],
        surface_tolerance_m: 0.01,
    })
}

/// A law of this kind with these effects, judged by these errors (N) and fitted to so many nats; nothing of it was measured.
pub fn unmeasured_candidate(
    kind: ModelFamily,
    effects: &[AnyEffect],
    errors_n: &[f64],
    nats: f64,
) -> ScoredModel {
    let mut model = Model::base(assumed_layers(&[[0.02, 100.0, 1000.0]]), 0);
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    let residuals = Residuals { residual_n: Vec::new(), innovations: Vec::new(), ruptures: Vec::new(), nats };
    let data = FitData::new(Arc::new(Vec::new()), Noise::white(1.0), 0.0);
    let fitted = SetFit { fit: Fit { model, residuals }, data, drop_times_s: Vec::new(), starts: (8, 3) };
    let score = |e: &f64| {
        let parts = [(100.0 * e * e, 100.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)];
        Some(PredictionScore { rmse_n: *e, coverage: 0.0, phase_squares: parts }).filter(|_| e.is_finite())
    };
    ScoredModel {
        family: kind,
        set_fit: fitted,
        errors_n: errors_n.to_vec(),
        scores: errors_n.iter().map(score).collect(),
    }
}

/// One layer of gel from 4 mm on that gives way at 2 N.
pub fn gel_tissue() -> Tissue {
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
pub const SENSOR_NOISE_SD_N: f64 = 0.01;

/// Insertions into the gel by 16 mm, with a rest of a second, and back, at 50 Hz: each at a speed (m/s), its surface moved by so much (m).
pub fn simulated_recordings(effects: &[AnyEffect], all: &[[f64; 2]]) -> Vec<SegmentedRecording> {
    recordings_with_added_force(effects, all, |_| 0.0)
}

/// The same, read off a sensor that shows so much (N) more at every instant (s).
pub fn recordings_with_added_force(
    effects: &[AnyEffect],
    all: &[[f64; 2]],
    more_n: impl Fn(f64) -> f64,
) -> Vec<SegmentedRecording> {
    all.iter().enumerate().map(|(k, at)| insertion(k, effects, *at, &more_n)).collect()
}

fn insertion(
    k: usize,
    effects: &[AnyEffect],
    [speed, moved_m]: [f64; 2],
    more_n: &impl Fn(f64) -> f64,
) -> SegmentedRecording {
    let mut tissue = gel_tissue();
    tissue.surface_m += moved_m;
    let law = TissueLaw::new(&tissue, effects).expect("a law");
    let travel_s = 0.016 / speed;
    let (mut state, mut seed) = (ForceLawState::default(), 17 + 1000 * k as u64);
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
        f.push(
            law.step(&mut state, at, place, v, |_| {}).total_n + more_n(at) + SENSOR_NOISE_SD_N * normal(),
        );
    }
    SegmentedRecording::new(format!("run {k}"), Recording::new(t, z, f).expect("clean columns"), 1)
}

/// Insertions fitted with these effects from the truth on; surface and friction are every run's own.
pub fn fit_from_truth(effects: &[AnyEffect], runs: &[&SegmentedRecording]) -> SetFit {
    let belief = Assumptions {
        tissue: gel_tissue(),
        known_effects: Vec::new(),
        tolerance: vec![4.0],
        thickness_tolerance: vec![0.0],
        surface_tolerance_m: 2e-3,
    };
    let mut model = Model::base(Arc::new(belief), runs.len());
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    (model.free.recording_surface, model.free.recording_friction, model.fixed_scatter) = (true, true, true);
    model.scatter.surface_m = 2e-4;
    model.rupture_times_s = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    let raw = stylet_record::sensor_artefacts::SensorArtefacts::default();
    let drops = runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    fit_from(&model, crate::repeated_insertions::multistart_fit::set_blocks(runs, &raw), drops.collect())
        .expect("a fit")
}

/// Numbers spread evenly between nothing and one, the same ones for a seed.
pub fn uniform_sequence(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = (seed * 1_103_515_245 + 12_345) % 2_147_483_648;
        seed as f64 / 2_147_483_648.0
    }
}

/// A stage of a search that took this effect among rivals that gained so many nats.
pub fn search_stage(
    taken: Option<(&'static str, f64)>,
    needed: f64,
    rivals: &[(AnyEffect, f64)],
) -> SearchStage {
    let choice = |(e, _): &(AnyEffect, f64)| EffectTerm::new(e.info(), &e.parameters());
    let choices: Vec<EffectTerm> = rivals.iter().map(choice).collect();
    let gained = choices.iter().zip(rivals).map(|(c, r)| (c.info.id, r.1, c.values.len())).collect();
    SearchStage { included: Vec::new(), candidates: gained, selected: taken, required_nats: needed, choices }
}
