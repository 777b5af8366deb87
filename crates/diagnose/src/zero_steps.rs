//! Steps of the sensor zero: finds candidates, removes insignificant ones, and reports them as causes.

use crate::base_law_fit::{PreparedRecordings, SAME_EVENT_S};
use crate::diagnosis_json::{Cause, Estimate};
use crate::held_out::sample_noise_sd_n;
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, confidence, likelihood_gain};
use crate::selection_state::Search;
use crate::verdict::MIN_GAIN_BESIDE_UNKNOWN;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, Linearization, fit};
use stylet_identify::force_jumps::{ForceJump, detect_force_jumps};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{ParameterRole, ZeroStep};
use stylet_identify::noise::NoiseSource;
use stylet_record::{QualityKind, QualityNote};
use stylet_stats::Z95;
use stylet_tissue::{AnyEffect, Effect, ForceBias};

/// Time (s) around a velocity jump within which a force jump may be friction.
const VELOCITY_JUMP_S: f64 = 0.06;

/// Candidate steps of the zero.
pub(crate) struct StepCandidates {
    /// Per recording, steps at every upward jump; and an offset at the start of every recording except the first.
    pub steps: Vec<Vec<ZeroStep>>,
    /// Drops, which may be ruptures or steps: recording and step, most significant first.
    pub drops: Vec<(usize, ZeroStep)>,
}

/// Force jumps in all recordings except those at velocity jumps.
pub(crate) fn zero_step_candidates(prepared: &PreparedRecordings) -> StepCandidates {
    let mut drops: Vec<(f64, usize, ZeroStep)> = Vec::new();
    let mut steps: Vec<Vec<ZeroStep>> = Vec::new();
    for (r, b) in prepared.blocks.iter().enumerate() {
        // The sensor may be zeroed between two recordings: a step before the first sample.
        let start = (r > 0).then(|| ZeroStep { time_s: b.span_s().0, size_n: 0.0 });
        let mut own: Vec<ZeroStep> = start.into_iter().collect();
        for j in detect_force_jumps(b).into_iter().filter(|j| !at_velocity_jump(b, j)) {
            let step = ZeroStep { time_s: j.time_s, size_n: j.size_n };
            if j.size_n > 0.0 {
                own.push(step);
            } else {
                drops.push((j.score, r, step));
            }
        }
        steps.push(own);
    }
    drops.sort_by(|a, b| b.0.total_cmp(&a.0));
    StepCandidates { steps, drops: drops.into_iter().map(|(_, r, step)| (r, step)).collect() }
}

/// The drops that are not assigned to a rupture of a fit.
pub(crate) fn unassigned<'a>(
    drops: &'a [(usize, ZeroStep)],
    f: &'a Fit,
) -> impl Iterator<Item = &'a (usize, ZeroStep)> {
    drops
        .iter()
        .filter(|(r, s)| f.model.rupture_times_s[*r].iter().all(|t| (t - s.time_s).abs() > SAME_EVENT_S))
}

/// The steps with one step added, or removed if it is already there.
pub(crate) fn toggled(steps: &[Vec<ZeroStep>], (r, step): (usize, ZeroStep)) -> Vec<Vec<ZeroStep>> {
    let mut steps = steps.to_vec();
    let count = steps[r].len();
    steps[r].retain(|s| s.time_s != step.time_s);
    if steps[r].len() == count {
        steps[r].push(step);
        steps[r].sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    steps
}

/// The steps with further ones at jumps of the residual of a fit; `None` when there are none.
pub(crate) fn with_steps_in_residual(
    steps: &[Vec<ZeroStep>],
    f: &Fit,
    data: &FitData,
) -> Option<Vec<Vec<ZeroStep>>> {
    let mut all = steps.to_vec();
    for (r, b) in data.recordings.iter().enumerate() {
        let e = &f.residuals.residual_n[r];
        let samples = Arc::new(b.sample_residuals(e));
        let mut residual = b.clone();
        (residual.force_n, residual.sample_force_n) = (e.clone(), samples);
        let known = |j: &ForceJump| {
            let near = |t: f64| (t - j.time_s).abs() < SAME_EVENT_S;
            steps[r].iter().any(|s| near(s.time_s)) || f.model.rupture_times_s[r].iter().any(|t| near(*t))
        };
        let new = detect_force_jumps(&residual).into_iter().filter(|j| !known(j) && !at_velocity_jump(b, j));
        all[r].extend(new.map(|j| ZeroStep { time_s: j.time_s, size_n: j.size_n }));
        all[r].sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    (all != steps).then_some(all)
}

fn at_velocity_jump(b: &BlockAverages, j: &ForceJump) -> bool {
    b.motion.jumps.iter().any(|v| (v.time_s - j.time_s).abs() < VELOCITY_JUMP_S + v.time_sd_s)
}

/// Standard deviation in N of every step of a fit, per recording.
fn step_sds(f: &Fit, data: &FitData) -> Vec<Vec<f64>> {
    let t = Linearization::new(&f.model, data, &f.residuals);
    let variances = t.factor().inverse_diagonal();
    let place = |k: usize| t.per_recording.iter().position(|n| n.role == ParameterRole::ZeroStep(k));
    let sd =
        |r: usize, k: usize| place(k).map_or(f64::INFINITY, |o| variances[t.index_of(o, r)].max(0.0).sqrt());
    f.model.zero_steps.iter().enumerate().map(|(r, s)| (0..s.len()).map(|k| sd(r, k)).collect()).collect()
}

/// Removes the least significant step as long as its gain, under noise estimated as `noise`, is below the penalty of its two parameters.
pub(crate) fn remove_weak_steps(search: &mut Search, noise: NoiseSource) {
    while search.best.model.zero_step_count() > 0 {
        let data = search.data.with_estimated_noise(&search.best.residuals.residual_n, noise);
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

/// The sensor zero as the diagnosis reports it.
pub(crate) struct ZeroStepReport {
    /// One cause for all steps, with time and size of the largest.
    steps: Option<Cause>,
    /// The largest offset, if offsets differ between recordings.
    offset: Option<Cause>,
    /// Whether the offset before the first step is part of the steps, because the zero is correct after one of them.
    holds_offset: bool,
    /// Notes on recordings with steps or an offset of their own.
    pub notes: Vec<Option<QualityNote>>,
}

impl ZeroStepReport {
    /// The report of a finished search.
    pub(crate) fn new(search: &Search) -> Self {
        let data =
            search.data.with_estimated_noise(&search.best.residuals.residual_n, NoiseSource::LongMemory);
        let zeros = recorded_zeros(search, &step_sds(&search.best, &data));
        let noise_n = search.data.noise.sd_n();
        let right = |level_n: f64, sd_n: f64| level_n.abs() < Z95 * libm::hypot(noise_n, sd_n);
        let is_right_later = |z: &RecordedZero| {
            let (mut level, mut sd) = z.offset_n;
            z.steps.iter().any(|(s, step_sd)| {
                (level, sd) = (level + s.size_n, libm::hypot(sd, *step_sd));
                right(level, sd)
            })
        };
        let with_steps = || zeros.iter().filter(|z| !z.steps.is_empty());
        Self {
            steps: steps_cause(search, &zeros),
            offset: offset_cause(search, &zeros),
            holds_offset: with_steps().next().is_some() && with_steps().all(is_right_later),
            notes: zeros.iter().map(RecordedZero::note).collect(),
        }
    }

    /// The causes and those of the steps.
    pub(crate) fn with_causes(&self, causes: &[Cause]) -> Vec<Cause> {
        causes.iter().chain(&self.offset).chain(&self.steps).cloned().collect()
    }

    /// Adds the causes of the zero; an offset that steps correct later is not a separate cause.
    pub(crate) fn add_to(&mut self, causes: &mut Vec<Cause>) {
        // The offset of a recording is that of the first one plus its own difference.
        let common = causes.iter().find(|c| c.effect == ForceBias::ID).cloned();
        if let (Some(offset), Some(common)) = (&mut self.offset, &common) {
            widen(offset, common);
        }
        if self.offset.is_some() || self.holds_offset {
            causes.retain(|c| c.effect != ForceBias::ID);
        }
        causes.extend(self.offset.take().filter(|_| !self.holds_offset));
        causes.extend(self.steps.take());
    }

    /// Drops causes that remove so little of the residual that they may imitate an unmodelled force. Steps do not recur, so there is no
    /// held-out recording that could confirm them.
    pub(crate) fn keep_strong(&mut self) {
        for cause in [&mut self.offset, &mut self.steps] {
            cause.take_if(|c| c.share < MIN_GAIN_BESIDE_UNKNOWN);
        }
    }
}

/// Adds the half widths of `other`'s intervals to those of `cause` in quadrature.
fn widen(cause: &mut Cause, other: &Cause) {
    for (path, e) in &mut cause.parameters {
        let half = |e: &Estimate| 0.5 * (e.high - e.low);
        let Some(other) = other.parameters.get(path) else { continue };
        let half = libm::hypot(half(e), half(other));
        (e.low, e.high) = (e.value - half, e.value + half);
    }
}

/// The sensor zero of one recording.
struct RecordedZero {
    /// Offset (N) at the start, and its standard deviation relative to the first recording.
    offset_n: (f64, f64),
    /// Whether the offset differs from that of the first recording.
    differs: bool,
    /// Steps and standard deviations (N) of their sizes.
    steps: Vec<(ZeroStep, f64)>,
    /// Half the sampling interval in s.
    half_step_s: f64,
}

impl RecordedZero {
    fn largest(&self) -> Option<&(ZeroStep, f64)> {
        self.steps.iter().max_by(|a, b| a.0.size_n.abs().total_cmp(&b.0.size_n.abs()))
    }

    fn note(&self) -> Option<QualityNote> {
        let offset_n = self.offset_n.0;
        let mut numbers = vec![("offset_n", offset_n), ("count", self.steps.len() as f64)];
        let message = if let Some((s, _)) = self.largest() {
            numbers.extend([("largest_n", s.size_n), ("at_s", s.time_s)]);
            format!(
                "the zero of the force sensor steps {} time(s), most by {:.3} N at {:.3} s; before the first step it is off by {offset_n:.3} N",
                self.steps.len(),
                s.size_n,
                s.time_s
            )
        } else if self.differs {
            format!(
                "the zero of the force sensor is off by {offset_n:.3} N, another value than in the first recording"
            )
        } else {
            return None;
        };
        Some(QualityNote::new(QualityKind::ZeroStep, message, numbers))
    }
}

fn recorded_zeros(search: &Search, sds: &[Vec<f64>]) -> Vec<RecordedZero> {
    let common_n = offset_n(search);
    let one = |((b, steps), sds): ((&BlockAverages, &Vec<ZeroStep>), &Vec<f64>)| {
        let all = steps.iter().copied().zip(sds.iter().copied());
        let (at_start, later): (Vec<(ZeroStep, f64)>, Vec<_>) =
            all.partition(|(s, _)| s.time_s <= b.span_s().0);
        let own = at_start.first().map_or((0.0, 0.0), |(s, sd)| (s.size_n, *sd));
        RecordedZero {
            offset_n: (common_n + own.0, own.1),
            differs: !at_start.is_empty(),
            steps: later,
            half_step_s: 0.5 * b.sample_step_s,
        }
    };
    search.data.recordings.iter().zip(&search.best.model.zero_steps).zip(sds).map(one).collect()
}

/// Offset (N) that all recordings share; zero without one.
fn offset_n(search: &Search) -> f64 {
    let bias = search.best.model.effects.iter().filter_map(|e| match e.effect()? {
        AnyEffect::ForceBias(bias) => Some(bias.force_n),
        _ => None,
    });
    bias.sum()
}

/// The steps of a single recording as effects of the extended scenario, with the offset that is part of them. Steps of several recordings
/// are at different times and do not recur in the next insertion.
pub(crate) fn zero_effects(search: &Search, causes: &[Cause]) -> Vec<AnyEffect> {
    let [steps] = &search.best.model.zero_steps[..] else { return Vec::new() };
    let offset = offset_n(search);
    let folded = !steps.is_empty() && offset != 0.0 && causes.iter().all(|c| c.effect != ForceBias::ID);
    let bias = folded.then(|| ForceBias { force_n: offset }.into());
    let step = |s: &ZeroStep| stylet_tissue::ZeroStep { time_s: s.time_s, step_n: s.size_n }.into();
    bias.into_iter().chain(steps.iter().map(step)).collect()
}

/// The steps as one cause; `None` without steps.
fn steps_cause(search: &Search, zeros: &[RecordedZero]) -> Option<Cause> {
    let largest = zeros.iter().filter_map(|z| Some((z.half_step_s, z.largest()?)));
    let (half_s, (s, sd)) = largest.max_by(|a, b| a.1.0.size_n.abs().total_cmp(&b.1.0.size_n.abs()))?;
    let effect = stylet_tissue::ZeroStep { time_s: s.time_s, step_n: s.size_n }.into();
    Some(cause(search, &effect, &[half_s, Z95 * sd], |at_start| !at_start))
}

/// The largest offset as a cause, if offsets differ between recordings.
fn offset_cause(search: &Search, zeros: &[RecordedZero]) -> Option<Cause> {
    zeros.iter().find(|z| z.differs)?;
    let largest = zeros.iter().max_by(|a, b| a.offset_n.0.abs().total_cmp(&b.offset_n.0.abs()))?;
    let (force_n, sd_n) = largest.offset_n;
    Some(cause(search, &ForceBias { force_n }.into(), &[Z95 * sd_n], |at_start| at_start))
}

/// A cause with these half widths. Its gain is the loss without the steps that `removed` selects; its argument says whether a step is
/// before the first sample.
fn cause(search: &Search, effect: &AnyEffect, half_widths: &[f64], removed: impl Fn(bool) -> bool) -> Cause {
    let (model, data) = (&search.best.model, &search.data);
    let mut without = model.clone();
    for (steps, b) in without.zero_steps.iter_mut().zip(data.recordings.iter()) {
        steps.retain(|s| !removed(s.time_s <= b.span_s().0));
    }
    let without_steps = fit(&without, data, Effort::FULL);
    let gain_nats = without_steps.as_ref().map_or(0.0, |f| likelihood_gain(f, &search.best, data));
    let share = without_steps.map_or(0.0, |f| {
        let (noise_n, after_n, before_n) = (sample_noise_sd_n(data), search.best.rms_n(data), f.rms_n(data));
        (before_n * before_n - after_n * after_n) / (before_n * before_n - noise_n * noise_n).max(1e-12)
    });
    let count = model.zero_step_count() - without.zero_step_count();
    let needed = bic_penalty(2 * count, data.compared_block_count()) + MIN_GAIN_NATS;
    let parameters = effect.info().parameters.iter().zip(effect.parameters()).zip(half_widths);
    let estimate = |value: f64, half: f64| Estimate { value, low: value - half, high: value + half };
    Cause {
        effect: effect.id().to_owned(),
        confidence: confidence(gain_nats - needed, 0.0),
        parameters: parameters
            .map(|((p, value), half)| (p.path.to_owned(), estimate(value, *half)))
            .collect(),
        gain_nats,
        share: share.clamp(0.0, 1.0),
        ..Cause::default()
    }
}
