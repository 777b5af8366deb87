//! Steps of the sensor's zero: candidates, removal of weak ones, and their report.

use crate::base_law_fit::{PreparedRecordings, SAME_EVENT_S};
use crate::diagnosis_json::{Cause, Estimate};
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use crate::selection_state::Search;
use std::collections::BTreeMap;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, Linearization, fit};
use stylet_identify::force_jumps::{ForceJump, detect_force_jumps};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{ParameterRole, ZeroStep};
use stylet_identify::noise::NoiseSource;
use stylet_stats::Z95;
use stylet_tissue::{AnyEffect, Effect};

/// A jump within this time (s) of a velocity jump may be friction.
const VELOCITY_JUMP_S: f64 = 0.06;

/// Candidates for steps.
pub(crate) struct StepCandidates {
    /// Jumps that no layer explains, per recording.
    pub steps: Vec<Vec<ZeroStep>>,
    /// Drops that the base law assigned to a layer: recording and step, largest first.
    pub alternatives: Vec<(usize, ZeroStep)>,
}

/// Candidates in all recordings: every jump up, and drops where the base law ruptures no layer.
pub(crate) fn zero_step_candidates(prepared: &PreparedRecordings, base: &Fit) -> StepCandidates {
    let mut alternatives: Vec<(usize, ZeroStep)> = Vec::new();
    let mut steps = Vec::new();
    for (r, b) in prepared.blocks.iter().enumerate() {
        let (of_layers, free): (Vec<ForceJump>, Vec<ForceJump>) =
            detect_force_jumps(b).into_iter().filter(|j| !at_velocity_jump(b, j)).partition(|j| {
                let near = |t: &f64| (t - j.time_s).abs() < SAME_EVENT_S;
                j.size_n < 0.0 && base.model.rupture_times_s[r].iter().any(near)
            });
        let step = |j: ForceJump| ZeroStep { time_s: j.time_s, size_n: j.size_n };
        alternatives.extend(of_layers.into_iter().map(|j| (r, step(j))));
        steps.push(free.into_iter().map(step).collect());
    }
    alternatives.sort_by(|a, b| a.1.size_n.total_cmp(&b.1.size_n));
    StepCandidates { steps, alternatives }
}

fn at_velocity_jump(b: &BlockAverages, j: &ForceJump) -> bool {
    b.motion.jumps.iter().any(|v| (v.time_s - j.time_s).abs() < VELOCITY_JUMP_S + v.time_sd_s)
}

/// Standard deviation in N of every step of a fit, per recording.
fn step_sds(f: &Fit, data: &FitData) -> Vec<Vec<f64>> {
    let t = Linearization::new(&f.model, data, &f.residuals);
    let variances = t.factor().inverse_diagonal();
    let place = |k: usize| t.per_recording.iter().position(|n| n.role == ParameterRole::ZeroStep(k));
    let sd = |r: usize, k: usize| {
        place(k).map_or(f64::INFINITY, |o| variances[t.index_of(o, r)].max(0.0).sqrt())
    };
    f.model.zero_steps.iter().enumerate().map(|(r, s)| (0..s.len()).map(|k| sd(r, k)).collect()).collect()
}

/// Removes the least significant step as long as it does not pay for its two parameters.
pub(crate) fn remove_weak_steps(search: &mut Search) {
    while search.best.model.zero_step_count() > 0 {
        let data =
            search.data.with_estimated_noise(&search.best.residuals.residual_n, NoiseSource::Residual);
        let Some(at) = residuals(&search.best.model, &data) else { return };
        let f = Fit { model: search.best.model.clone(), residuals: at };
        let nats = |s: &ZeroStep, sd: f64| 0.5 * (s.size_n / sd).powi(2);
        let weakest = step_sds(&f, &data)
            .iter()
            .enumerate()
            .flat_map(|(r, sds)| sds.iter().enumerate().map(move |(k, sd)| (r, k, *sd)))
            .map(|(r, k, sd)| (nats(&f.model.zero_steps[r][k], sd), r, k))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let needed = bic_penalty(2, data.compared_block_count()) + MIN_GAIN_NATS;
        let Some((_, r, k)) = weakest.filter(|w| w.0 < needed) else { return };
        let mut model = search.best.model.clone();
        model.zero_steps[r].remove(k);
        let Some(reduced) = fit(&model, &search.data, Effort::FULL) else { return };
        search.accept(reduced);
    }
}

/// The steps of the zero as the diagnosis reports them.
pub(crate) struct ZeroStepReport {
    /// One cause for all steps, with time and size of the largest.
    cause: Option<Cause>,
    /// The offset before the first step belongs to the steps: the zero is right between two of them, or at the end.
    holds_offset: bool,
}

impl ZeroStepReport {
    /// The report of a finished search.
    pub(crate) fn new(search: &Search) -> Self {
        let data =
            search.data.with_estimated_noise(&search.best.residuals.residual_n, NoiseSource::LongMemory);
        let sds = step_sds(&search.best, &data);
        Self { cause: zero_step_cause(search, &sds), holds_offset: holds_offset(search, &sds) }
    }

    /// Adds the cause; the offset before the steps is no cause of its own.
    pub(crate) fn add_to(self, causes: &mut Vec<Cause>) {
        if self.holds_offset {
            causes.retain(|c| c.effect != stylet_tissue::ForceBias::ID);
        }
        causes.extend(self.cause);
    }
}

/// Offset of the model in N; zero without one.
fn offset_n(search: &Search) -> f64 {
    let bias = search.best.model.effects.iter().filter_map(|e| match e.effect()? {
        AnyEffect::ForceBias(bias) => Some(bias.force_n),
        _ => None,
    });
    bias.sum()
}

/// Whether the zero is right, to within the error of the steps and the noise, after one of the steps.
fn holds_offset(search: &Search, sds: &[Vec<f64>]) -> bool {
    let noise_n = search.data.noise.sd_n();
    let of_recording = |(steps, sds): (&Vec<ZeroStep>, &Vec<f64>)| {
        let (mut level, mut variance) = (offset_n(search), noise_n * noise_n);
        steps.iter().zip(sds).any(|(s, sd)| {
            level += s.size_n;
            variance += sd * sd;
            level.abs() < Z95 * variance.sqrt()
        })
    };
    search.best.model.zero_steps.iter().zip(sds).any(of_recording)
}

/// The steps of a single recording as effects of the extended scenario, with the offset that belongs to them. Those of several
/// recordings are at different times, and no property of the next insertion.
pub(crate) fn zero_effects(search: &Search, causes: &[Cause]) -> Vec<AnyEffect> {
    let model = &search.best.model;
    let [steps] = &model.zero_steps[..] else { return Vec::new() };
    let mut effects: Vec<AnyEffect> = Vec::new();
    let offset = offset_n(search);
    if !steps.is_empty() && offset != 0.0 && causes.iter().all(|c| c.effect != stylet_tissue::ForceBias::ID) {
        effects.push(stylet_tissue::ForceBias { force_n: offset }.into());
    }
    let step = |s: &ZeroStep| stylet_tissue::ZeroStep { time_s: s.time_s, step_n: s.size_n }.into();
    effects.extend(steps.iter().map(step));
    effects
}

/// The steps as one cause; `sds` are the standard deviations of their sizes. `None` without steps.
fn zero_step_cause(search: &Search, sds: &[Vec<f64>]) -> Option<Cause> {
    let (model, data) = (&search.best.model, &search.data);
    let all = model.zero_steps.iter().enumerate().flat_map(|(r, s)| s.iter().enumerate().map(move |(k, s)| (r, k, s)));
    let (r, k, largest) = all.max_by(|a, b| a.2.size_n.abs().total_cmp(&b.2.size_n.abs()))?;
    let mut without = model.clone();
    without.zero_steps.iter_mut().for_each(Vec::clear);
    let gain_nats = fit(&without, &search.data, Effort::FULL)
        .map_or(0.0, |f| likelihood_gain(&f, &search.best, &search.data).value());
    let needed = bic_penalty(2 * model.zero_step_count(), data.compared_block_count()) + MIN_GAIN_NATS;
    let half_s = 0.5 * search.data.recordings[r].sample_step_s;
    let half_n = Z95 * sds[r][k];
    let effect = stylet_tissue::ZeroStep { time_s: largest.time_s, step_n: largest.size_n };
    let effect = AnyEffect::from(effect);
    let intervals = [half_s, half_n];
    let parameters: BTreeMap<String, Estimate> = effect
        .info()
        .parameters
        .iter()
        .zip(effect.parameters())
        .zip(intervals)
        .map(|((p, value), half)| (p.path.to_owned(), Estimate { value, low: value - half, high: value + half }))
        .collect();
    Some(Cause {
        effect: effect.id().to_owned(),
        equivalent: Vec::new(),
        confidence: 1.0 / (1.0 + libm::exp(-(gain_nats - needed).clamp(-30.0, 30.0) - 3.0)),
        parameters,
        gain_nats,
        share: 0.0,
    })
}
