//! Analyses the relaxation of many specimens, each indented once and held: effects missing from the base law, held-out error of the rest of
//! the hold, and statistics of the parameters.
//!
//! Every specimen is a separate material. A model is fitted to the ramp and the first part of the hold; the rest of the hold is held out.

mod diagnosis;

use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::repeated_insertions::start_values::indentation_prior;
use serde::Serialize;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, fit};
use stylet_identify::insertion_phases::noise_n;
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_stats::parallel::*;
use stylet_stats::{mean, median_of, rms, sd, student_t};
use stylet_tissue::{AnyEffect, Effect, NonlinearElasticity, PronyTerm, StressRelaxation, Tissue};

/// Share of the hold that is fitted.
const FITTED_HOLD_SHARE: f64 = 0.6;
/// Smallest relative decrease of the mean error, held out or fitted, for an effect to be kept.
const MIN_RELATIVE_GAIN: f64 = 0.1;
/// Smallest share of specimens that must improve for an effect to be kept.
const MIN_IMPROVED_SHARE: f64 = 0.75;
/// Length of a block (s): relaxation is slow, so blocks may be longer than in insertions.
const BLOCK_S: f64 = 0.08;
/// Noise of a fit in multiples of the sensor noise, which leaves room for model error.
const NOISE_FACTOR: f64 = 3.0;
/// Lower bound of the noise of a fit, as a share of the largest force.
const MIN_NOISE_SHARE: f64 = 1e-3;
/// Shortest hold (s) of a usable specimen.
const MIN_HOLD_S: f64 = 3.0;
/// Smallest number of samples of a usable specimen.
const MIN_SAMPLES: usize = 50;

/// Stopping criteria of a fit.
const FIT_EFFORT: Effort = Effort { max_iterations: 40, min_gain_nats: 1e-3 };

/// Statistics of a parameter over the specimens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpecimenStatistic {
    /// Parameter path.
    pub name: String,
    /// Geometric mean (arithmetic for fractions).
    pub mean: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Range of the central 90 % of the specimens.
    pub range_90: (f64, f64),
}

/// A candidate model in the sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateModel {
    /// Name of the step: the added effect, or `base law`.
    pub step: String,
    /// Effect id.
    pub effect: Option<String>,
    /// Median RMS error on the fitted part (N).
    pub fitted_n: f64,
    /// Median RMS error on the held-out part (N).
    pub held_out_n: f64,
    /// Share of the specimens whose sum of both errors decreases.
    pub improved_share: f64,
    /// Whether the effect is kept.
    pub kept: bool,
}

/// Result over all specimens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpecimenReport {
    /// Number of specimens used.
    pub used: usize,
    /// Specimens that were not used, with the reason.
    pub unused: Vec<(String, String)>,
    /// Specimens with a force drop as at a puncture.
    pub punctured: Vec<String>,
    /// Candidate models.
    pub candidates: Vec<CandidateModel>,
    /// Parameters of the selected model.
    pub parameters: Vec<SpecimenStatistic>,
}

/// Fits of one specimen: per candidate, RMS errors (N) on the fitted and the held-out part, and the model.
struct SpecimenFits {
    errors: Vec<(f64, f64)>,
    models: Vec<Model>,
    /// The same without the nonlinear spring.
    straight: Vec<((f64, f64), Model)>,
}

/// Relaxation with terms of (fraction, time constant in s).
fn relaxation(terms: &[(f64, f64)]) -> AnyEffect {
    let term = |&(fraction, time_constant_s): &(f64, f64)| PronyTerm { fraction, time_constant_s };
    StressRelaxation { terms: terms.iter().map(term).collect() }.into()
}

/// Candidate models, each an extension of the previous one, with their start values.
fn candidate_sequence() -> [(&'static str, Vec<AnyEffect>); 4] {
    [
        ("base law", Vec::new()),
        (
            NonlinearElasticity::ID,
            vec![
                NonlinearElasticity { kappa_per_m: 20.0 }.into(),
                NonlinearElasticity { kappa_per_m: 200.0 }.into(),
            ],
        ),
        (StressRelaxation::ID, vec![relaxation(&[(0.3, 0.7)]), relaxation(&[(0.3, 4.0)])]),
        (
            "stress_relaxation (second term)",
            vec![
                relaxation(&[(0.2, 0.3), (0.2, 2.5)]),
                relaxation(&[(0.2, 0.8), (0.2, 6.0)]),
                relaxation(&[(0.2, 0.6), (0.2, 25.0)]),
            ],
        ),
    ]
}

/// Analyses each specimen, and selects one sequence of effects for all of them.
#[must_use]
pub fn analyze_specimens(assumed: &Tissue, recordings: &[SegmentedRecording]) -> Option<SpecimenReport> {
    let mut unused = Vec::new();
    let mut punctured = Vec::new();
    let mut usable: Vec<&SegmentedRecording> = Vec::new();
    for run in recordings {
        if run.ruptures_s.iter().any(|t| t.is_finite()) {
            punctured.push(run.name.clone());
        }
        match check_ramp_and_hold(run) {
            Ok(()) => usable.push(run),
            Err(why) => unused.push((run.name.clone(), why)),
        }
    }
    let each: Vec<SpecimenFits> = usable.par_iter().filter_map(|run| fit_specimen(assumed, run)).collect();
    if each.is_empty() {
        return None;
    }
    let mut done: Vec<CandidateModel> = Vec::new();
    let mut selected = 0;
    for (k, (name, effects)) in candidate_sequence().into_iter().enumerate() {
        let of = |j: usize, held_out_part: bool| {
            median_of(each.iter().map(|o| if held_out_part { o.errors[j].1 } else { o.errors[j].0 }))
        };
        let better =
            each.iter().filter(|o| total_error(o.errors[k]) < total_error(o.errors[selected])).count() as f64
                / each.len() as f64;
        let gains = |held_out_part: bool| {
            of(k, held_out_part) < (1.0 - MIN_RELATIVE_GAIN) * of(selected, held_out_part)
        };
        let kept = k == 0 || ((gains(true) || gains(false)) && better >= MIN_IMPROVED_SHARE);
        done.push(CandidateModel {
            step: name.to_owned(),
            effect: effects.first().map(|e| e.info().id.to_owned()),
            fitted_n: of(k, false),
            held_out_n: of(k, true),
            improved_share: better,
            kept,
        });
        if kept {
            selected = k;
        }
    }
    let curved = retest_curvature(&each, &mut done, selected);
    let numbers = parameter_statistics(&each, selected, curved);
    Some(SpecimenReport { used: each.len(), unused, punctured, candidates: done, parameters: numbers })
}

/// Sum of the errors on both parts.
fn total_error(errors: (f64, f64)) -> f64 {
    errors.0 + errors.1
}

/// Whether the nonlinear spring is kept in the selected model. The ramp of a relaxing linear spring is curved, so the test is repeated with
/// the relaxation in the model.
fn retest_curvature(each: &[SpecimenFits], candidates: &mut [CandidateModel], selected: usize) -> bool {
    let Some(at) = candidates.iter().position(|r| r.effect.as_deref() == Some(NonlinearElasticity::ID))
    else {
        return false;
    };
    if selected > at {
        let with = median_of(each.iter().map(|o| total_error(o.errors[selected])));
        let without = median_of(each.iter().map(|o| total_error(o.straight[selected].0)));
        let better = each
            .iter()
            .filter(|o| total_error(o.errors[selected]) < total_error(o.straight[selected].0))
            .count() as f64;
        candidates[at].kept =
            with < (1.0 - MIN_RELATIVE_GAIN) * without && better >= MIN_IMPROVED_SHARE * each.len() as f64;
        if !candidates[at].kept {
            candidates[selected].fitted_n = median_of(each.iter().map(|o| o.straight[selected].0.0));
            candidates[selected].held_out_n = median_of(each.iter().map(|o| o.straight[selected].0.1));
        }
    }
    candidates[at].kept
}

/// Checks that a recording is a ramp and a hold; the error is the reason why not.
fn check_ramp_and_hold(run: &SegmentedRecording) -> Result<(), String> {
    let t = &run.recording.time_s;
    let hold = t[t.len() - 1] - t[run.phases.deepest];
    if run.recording.len() < MIN_SAMPLES {
        return Err(format!("{} samples are not enough", run.recording.len()));
    }
    if run.phases.retraction < run.recording.len() {
        return Err("the indenter is retracted".to_owned());
    }
    if hold < MIN_HOLD_S {
        return Err(format!("held for only {hold:.1} s"));
    }
    Ok(())
}

fn fit_specimen(assumed: &Tissue, run: &SegmentedRecording) -> Option<SpecimenFits> {
    let r = &run.recording;
    let t = &r.time_s;
    let end = t[run.phases.deepest] + FITTED_HOLD_SHARE * (t[t.len() - 1] - t[run.phases.deepest]);
    let held_out: Vec<bool> = t.iter().map(|t| *t > end).collect();
    let largest = r.force_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let noise = (NOISE_FACTOR * noise_n(&r.force_n)).max(MIN_NOISE_SHARE * largest);
    let on = |excluded: &[bool]| {
        FitData::new(Arc::new(vec![BlockAverages::new(r, excluded, BLOCK_S)]), Noise::white(noise), noise)
    };
    let (first, all) = (on(&held_out), on(&vec![false; t.len()]));
    let mut out = SpecimenFits { errors: Vec::new(), models: Vec::new(), straight: Vec::new() };
    let errors = |model: &Model| -> Option<(f64, f64)> {
        let left = residuals(model, &all)?;
        let b = all.recordings.first()?;
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (k, e) in left.residual_n.first()?.iter().enumerate().filter(|(k, _)| b.used[*k]) {
            if b.mid_s(k) > end { after.push(*e) } else { before.push(*e) }
        }
        Some((rms(&before), rms(&after)))
    };
    let mut model = Model::base(Arc::new(indentation_prior(assumed, run)), 1);
    for (_, effects) in candidate_sequence() {
        let starts = if effects.is_empty() { vec![model.clone()] } else { Vec::new() };
        let with = |effect: &AnyEffect| {
            let term = EffectTerm::of(effect);
            // The candidate replaces a term of the same effect.
            let one = model.effects.iter().position(|c| c.info.id == term.info.id);
            one.map_or_else(|| model.clone(), |k| model.without_effect(k)).with_effect(term)
        };
        let fitted = starts
            .into_iter()
            .chain(effects.iter().map(with))
            .filter_map(|start| fit(&start, &first, FIT_EFFORT))
            .min_by(|a, b| a.nats().total_cmp(&b.nats()))?;
        out.errors.push(errors(&fitted.model)?);
        model = fitted.model;
        let bent = model.effects.iter().position(|c| c.info.id == NonlinearElasticity::ID);
        let straight = bent.map_or_else(
            || Some(model.clone()),
            |k| Some(fit(&model.without_effect(k), &first, FIT_EFFORT)?.model),
        )?;
        out.straight.push((errors(&straight)?, straight));
        out.models.push(model.clone());
    }
    Some(out)
}

/// Statistics of the effect parameters of the selected model over the specimens.
fn parameter_statistics(each: &[SpecimenFits], candidate: usize, curved: bool) -> Vec<SpecimenStatistic> {
    let models: Vec<&Model> =
        each.iter().map(|o| if curved { &o.models[candidate] } else { &o.straight[candidate].1 }).collect();
    let Some(first) = models.first() else { return Vec::new() };
    let paths = first.effects.iter().flat_map(|c| c.info.parameters.iter());
    paths
        .map(|p| {
            let log = p.path.ends_with("time_constant_s");
            let all = stylet_stats::sorted(
                models
                    .iter()
                    .filter_map(|model| parameter_value(model, p.path))
                    .map(|x| if log { libm::log(x) } else { x }),
            );
            let n = all.len();
            let middle = mean(&all);
            let reach = student_t::quantile(0.975, (n.max(2) - 1) as f64) * sd(&all) / libm::sqrt(n as f64);
            let back = |x: f64| if log { libm::exp(x) } else { x };
            let at = |share: f64| back(stylet_stats::quantile_of_sorted(&all, share));
            SpecimenStatistic {
                name: p.path.to_owned(),
                mean: back(middle),
                low: back(middle - reach),
                high: back(middle + reach),
                range_90: (at(0.05), at(0.95)),
            }
        })
        .collect()
}

/// Parameter of a model by path, with relaxation terms in ascending order of their time constants.
fn parameter_value(model: &Model, path: &str) -> Option<f64> {
    let of = |path: &str| {
        model.effects.iter().find_map(|c| {
            let k = c.info.parameters.iter().position(|p| p.path == path)?;
            Some(c.values[k])
        })
    };
    let swapped = of("terms.0.time_constant_s")
        .zip(of("terms.1.time_constant_s"))
        .is_some_and(|(first, second)| first > second);
    match (swapped, path.strip_prefix("terms.0."), path.strip_prefix("terms.1.")) {
        (true, Some(rest), _) => of(&format!("terms.1.{rest}")),
        (true, _, Some(rest)) => of(&format!("terms.0.{rest}")),
        _ => of(path),
    }
}

#[cfg(test)]
mod tests;
