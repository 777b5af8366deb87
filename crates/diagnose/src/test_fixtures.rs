//! Fixtures shared by unit tests.

use crate::repeated_insertions::SegmentedRecording;
use crate::repeated_insertions::cross_validation::PredictionScore;
use crate::repeated_insertions::multistart_fit::{SetFit, fit_from};
use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel};
use crate::selection_state::{Search, SearchStage};
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::{FitData, Residuals};
use stylet_identify::model::{Assumptions, EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_tissue::{AnyEffect, Effect, ForceLaw as TissueLaw, ForceLawState, Layer, Tissue};

/// Prior of layers given by thickness, stiffness and friction, starting at zero; tolerance 30 %, of thicknesses 10 %.
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
        further_effects: Vec::new(),
        tolerance: vec![0.3; layers.len()],
        thickness_tolerance: vec![0.1; layers.len()],
        surface_tolerance_m: 0.01,
    })
}

/// A candidate model with these effects, held-out errors (N) and objective (nats), without data.
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

/// One layer of gel that starts at 4 mm and ruptures at 2 N.
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

/// Noise standard deviation of the simulated sensor in N.
pub const SENSOR_NOISE_SD_N: f64 = 0.01;

/// Insertions of 16 mm into the gel with a hold of one second and a retraction, at 50 Hz; one speed (m/s) and surface
/// shift (m) each.
pub fn simulated_recordings(effects: &[AnyEffect], all: &[[f64; 2]]) -> Vec<SegmentedRecording> {
    recordings_with_added_force(effects, all, |_| 0.0)
}

/// As [`simulated_recordings`], with a force `added_n(t)` (N) added by the sensor.
pub fn recordings_with_added_force(
    effects: &[AnyEffect],
    all: &[[f64; 2]],
    added_n: impl Fn(f64) -> f64,
) -> Vec<SegmentedRecording> {
    all.iter().enumerate().map(|(k, at)| insertion(k, effects, *at, &added_n)).collect()
}

/// Insertion number `k`.
fn insertion(
    k: usize,
    effects: &[AnyEffect],
    [speed, shift_m]: [f64; 2],
    added_n: &impl Fn(f64) -> f64,
) -> SegmentedRecording {
    let mut tissue = gel_tissue();
    tissue.surface_m += shift_m;
    let law = TissueLaw::new(&tissue, effects).expect("a law");
    let travel_s = 0.016 / speed;
    let (mut state, mut seed) = (ForceLawState::default(), 17 + 1000 * k as u64);
    // The sum of twelve uniform numbers is nearly normal.
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
            law.step(&mut state, at, place, v, |_| {}).total_n + added_n(at) + SENSOR_NOISE_SD_N * normal(),
        );
    }
    SegmentedRecording::new(format!("run {k}"), Recording::new(t, z, f).expect("clean columns"), 1)
}

/// Recordings fitted with these effects, starting at the truth; surface and friction are random effects.
pub fn fit_from_truth(effects: &[AnyEffect], runs: &[&SegmentedRecording]) -> SetFit {
    let assumed = Assumptions {
        tissue: gel_tissue(),
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![4.0],
        thickness_tolerance: vec![0.0],
        surface_tolerance_m: 2e-3,
    };
    let mut model = Model::base(Arc::new(assumed), runs.len());
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    (model.free.recording_surface, model.free.recording_friction, model.fixed_scatter) = (true, true, true);
    model.scatter.surface_m = 2e-4;
    model.rupture_times_s = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    let raw = stylet_record::sensor_artefacts::SensorArtefacts::default();
    let drops = runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect());
    fit_from(&model, crate::repeated_insertions::multistart_fit::set_blocks(runs, &raw), drops.collect())
        .expect("a fit")
}

/// Simulated recordings with the effects `there` and an added sensor force (N), fitted with the effects `fitted`.
pub fn fit_simulated(
    fitted: &[AnyEffect],
    there: &[AnyEffect],
    at: &[[f64; 2]],
    added_n: impl Fn(f64) -> f64,
) -> SetFit {
    let runs = recordings_with_added_force(there, at, added_n);
    fit_from_truth(fitted, &runs.iter().collect::<Vec<_>>())
}

/// Blocks of a recording with these columns.
pub fn blocks_of(time_s: Vec<f64>, position_m: Vec<f64>, force_n: Vec<f64>) -> BlockAverages {
    let recording = Recording::new(time_s, position_m, force_n).expect("clean columns");
    BlockAverages::new(&recording, &[], BLOCK_S)
}

/// Data of these blocks with white noise.
pub fn data_of(blocks: Vec<BlockAverages>, noise_sd_n: f64) -> FitData {
    FitData::new(Arc::new(blocks), Noise::white(noise_sd_n), 0.0)
}

/// Reproducible uniform numbers in [0, 1).
pub fn uniform_sequence(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = (seed * 1_103_515_245 + 12_345) % 2_147_483_648;
        seed as f64 / 2_147_483_648.0
    }
}

/// A search stage that selected `selected` among candidates with these gains (nats).
pub fn search_stage(
    selected: Option<(&'static str, f64)>,
    required_nats: f64,
    candidates: &[(AnyEffect, f64)],
) -> SearchStage {
    let choice = |(e, _): &(AnyEffect, f64)| EffectTerm::new(e.info(), &e.parameters());
    let choices: Vec<EffectTerm> = candidates.iter().map(choice).collect();
    let gains = choices.iter().zip(candidates).map(|(c, r)| (c.info.id, r.1, c.values.len())).collect();
    SearchStage { included: Vec::new(), candidates: gains, selected, required_nats, choices }
}

/// Speed (m/s) and surface shift (m) of four insertions.
const FOUR_INSERTIONS: [[f64; 2]; 4] = [[3e-3, 3e-4], [4e-3, -3e-4], [5e-3, 0.0], [6e-3, 1e-4]];

/// A search that found these effects in recordings with an added sensor force (N), and a base law fitted to them.
pub fn search_result(effects: &[AnyEffect], runs: usize, added_n: impl Fn(f64) -> f64) -> Search {
    let f = fit_simulated(effects, &[], &FOUR_INSERTIONS[..runs], added_n);
    let mut search = Search::from_fit(f.fit, f.data);
    search.accept(search.best.clone());
    search.base = search.best.clone();
    if !effects.is_empty() {
        search.base.model.effects.clear();
        search.base = fit(&search.base.model, &search.data, Effort::FULL).expect("a fit");
    }
    search.stages = effects.iter().map(|e| search_stage(Some((e.id(), 50.0)), 48.0, &[])).collect();
    search
}
