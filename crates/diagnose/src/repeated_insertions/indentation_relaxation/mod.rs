//! Many specimens, each indented once and held: what each lacks, how well the rest of its hold is
//! predicted, and how the numbers scatter over the specimens.
//!
//! Every specimen is a material of its own, so that nothing is shared between them. A law is fitted to the
//! ramp and the first part of the hold; the rest of the hold took no part.

mod diagnosis;

use crate::repeated_insertions::start_values::{SegmentedRecording, indentation_prior};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, fit};
use stylet_identify::insertion_phases::noise_n;
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::noise::Noise;
use stylet_stats::{mean, median_of, rms, sd, student_t};
use stylet_tissue::{AnyEffect, Effect, NonlinearElasticity, PronyTerm, StressRelaxation, Tissue};

/// Share of the hold that is fitted.
const FITTED: f64 = 0.6;
/// An ingredient has to lower the mean error on the rest of the hold, or on all that was fitted, by this share,
const LEAST_GAIN: f64 = 0.1;
/// in at least this share of the specimens.
const LEAST_SHARE: f64 = 0.75;
/// Length of a block in s.
const BLOCK_S: f64 = 0.08;
/// What a law leaves counts as noise of so many times the sensor's, at least of this share of the largest force.
const NOISES: f64 = 3.0;
const NOISE_SHARE: f64 = 1e-3;
/// Shortest hold in s and fewest samples that tell a relaxation.
const LEAST_HOLD_S: f64 = 3.0;
const LEAST_SAMPLES: usize = 50;

/// How long a fit goes on.
const EFFORT: Effort = Effort { max_iterations: 40, min_gain_nats: 1e-3 };

/// A number over the specimens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpecimenStatistic {
    /// Its name.
    pub name: String,
    /// Geometric mean (arithmetic for shares) with its 95 % interval.
    pub mean: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Values between which nine of ten specimens lie.
    pub range_90: (f64, f64),
}

/// One rung: the law after an ingredient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateModel {
    /// What was added; `base law` at first.
    pub step: String,
    /// Effect.
    pub effect: Option<String>,
    /// Median error on what was fitted (N).
    pub fitted_n: f64,
    /// Median error on the rest of the hold (N).
    pub held_out_n: f64,
    /// Share of the specimens that it serves better, fitted and left out together.
    pub improved_share: f64,
    /// Whether it was kept.
    pub kept: bool,
}

/// What the specimens show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpecimenReport {
    /// Specimens used, and those that could not be.
    pub used: usize,
    /// Names of those that were left out, with the reason.
    pub unused: Vec<(String, String)>,
    /// Specimens whose force drops as at a puncture.
    pub punctured: Vec<String>,
    /// The rungs.
    pub candidates: Vec<CandidateModel>,
    /// Numbers of the kept law.
    pub parameters: Vec<SpecimenStatistic>,
}

/// One specimen: per rung the error on what was fitted and on the rest of the hold (N), and the law.
struct One {
    errors: Vec<(f64, f64)>,
    laws: Vec<Model>,
    /// The same for each law without its curvature.
    straight: Vec<((f64, f64), Model)>,
}

/// The effect of a curved spring.
fn curvature() -> &'static str {
    NonlinearElasticity { kappa_per_m: 0.0 }.info().id
}

/// Relaxation with these terms (fraction, time constant in s).
fn relaxing(terms: &[(f64, f64)]) -> AnyEffect {
    let term = |&(fraction, time_constant_s): &(f64, f64)| PronyTerm { fraction, time_constant_s };
    StressRelaxation { terms: terms.iter().map(term).collect() }.into()
}

/// The rungs, each with the one before: what is called how, and where its fits start.
fn rungs() -> [(&'static str, Vec<AnyEffect>); 4] {
    [
        ("base law", Vec::new()),
        (
            curvature(),
            vec![
                NonlinearElasticity { kappa_per_m: 20.0 }.into(),
                NonlinearElasticity { kappa_per_m: 200.0 }.into(),
            ],
        ),
        (relaxing(&[]).info().id, vec![relaxing(&[(0.3, 0.7)]), relaxing(&[(0.3, 4.0)])]),
        (
            "stress_relaxation (second term)",
            vec![
                relaxing(&[(0.2, 0.3), (0.2, 2.5)]),
                relaxing(&[(0.2, 0.8), (0.2, 6.0)]),
                relaxing(&[(0.2, 0.6), (0.2, 25.0)]),
            ],
        ),
    ]
}

/// Looks at specimens one by one.
#[must_use]
pub fn analyze_specimens(believed: &Tissue, runs: &[SegmentedRecording]) -> Option<SpecimenReport> {
    let mut unused = Vec::new();
    let mut punctured = Vec::new();
    let mut usable: Vec<&SegmentedRecording> = Vec::new();
    for run in runs {
        if run.ruptures_s.iter().any(|t| t.is_finite()) {
            punctured.push(run.name.clone());
        }
        match whole(run) {
            Ok(()) => usable.push(run),
            Err(why) => unused.push((run.name.clone(), why)),
        }
    }
    let each: Vec<One> = usable.par_iter().filter_map(|run| one(believed, run)).collect();
    if each.is_empty() {
        return None;
    }
    let mut done: Vec<CandidateModel> = Vec::new();
    let mut standing = 0;
    for (k, (name, effects)) in rungs().into_iter().enumerate() {
        let of = |j: usize, left_out: bool| {
            median_of(each.iter().map(|o| if left_out { o.errors[j].1 } else { o.errors[j].0 }))
        };
        let better = each.iter().filter(|o| both(o.errors[k]) < both(o.errors[standing])).count() as f64
            / each.len() as f64;
        let gains = |left_out: bool| of(k, left_out) < (1.0 - LEAST_GAIN) * of(standing, left_out);
        let kept = k == 0 || ((gains(true) || gains(false)) && better >= LEAST_SHARE);
        done.push(CandidateModel {
            step: name.to_owned(),
            effect: effects.first().map(|e| e.info().id.to_owned()),
            fitted_n: of(k, false),
            held_out_n: of(k, true),
            improved_share: better,
            kept,
        });
        if kept {
            standing = k;
        }
    }
    let curved = look_at_curvature(&each, &mut done, standing);
    let numbers = numbers(&each, standing, curved);
    Some(SpecimenReport { used: each.len(), unused, punctured, candidates: done, parameters: numbers })
}

/// The errors on what was fitted and on the rest of the hold together.
fn both(errors: (f64, f64)) -> f64 {
    errors.0 + errors.1
}

/// Whether the law of the rung that stands is a curved one. A ramp of a relaxing spring looks curved, and one that is too fast shows its curvature only when the
/// relaxation is known: once there is one it tells.
fn look_at_curvature(each: &[One], rungs: &mut [CandidateModel], standing: usize) -> bool {
    let Some(at) = rungs.iter().position(|r| r.effect.as_deref() == Some(curvature())) else { return false };
    if standing > at {
        let with = median_of(each.iter().map(|o| both(o.errors[standing])));
        let without = median_of(each.iter().map(|o| both(o.straight[standing].0)));
        let better =
            each.iter().filter(|o| both(o.errors[standing]) < both(o.straight[standing].0)).count() as f64;
        rungs[at].kept = with < (1.0 - LEAST_GAIN) * without && better >= LEAST_SHARE * each.len() as f64;
        if !rungs[at].kept {
            rungs[standing].fitted_n = median_of(each.iter().map(|o| o.straight[standing].0.0));
            rungs[standing].held_out_n = median_of(each.iter().map(|o| o.straight[standing].0.1));
        }
    }
    rungs[at].kept
}

/// Whether a recording is a ramp and a hold.
fn whole(run: &SegmentedRecording) -> Result<(), String> {
    let t = &run.recording.time_s;
    let hold = t[t.len() - 1] - t[run.phases.deepest];
    if run.recording.len() < LEAST_SAMPLES {
        return Err(format!("{} samples are too few", run.recording.len()));
    }
    if run.phases.retraction < run.recording.len() {
        return Err("the tool comes back".to_owned());
    }
    if hold < LEAST_HOLD_S {
        return Err(format!("held for {hold:.1} s only"));
    }
    Ok(())
}

fn one(believed: &Tissue, run: &SegmentedRecording) -> Option<One> {
    let r = &run.recording;
    let t = &r.time_s;
    let end = t[run.phases.deepest] + FITTED * (t[t.len() - 1] - t[run.phases.deepest]);
    let late: Vec<bool> = t.iter().map(|t| *t > end).collect();
    let largest = r.force_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let noise = (NOISES * noise_n(&r.force_n)).max(NOISE_SHARE * largest);
    let on = |excluded: &[bool]| {
        FitData::new(Arc::new(vec![BlockAverages::new(r, excluded, BLOCK_S)]), Noise::white(noise), noise)
    };
    let (first, all) = (on(&late), on(&vec![false; t.len()]));
    let mut out = One { errors: Vec::new(), laws: Vec::new(), straight: Vec::new() };
    let errors = |model: &Model| -> Option<(f64, f64)> {
        let left = residuals(model, &all)?;
        let b = all.recordings.first()?;
        let (mut before, mut after) = (Vec::new(), Vec::new());
        for (k, e) in left.residual_n.first()?.iter().enumerate().filter(|(k, _)| b.used[*k]) {
            if 0.5 * (b.start_s[k] + b.end_s[k]) > end { after.push(*e) } else { before.push(*e) }
        }
        Some((rms(&before), rms(&after)))
    };
    let mut model = Model::base(Arc::new(indentation_prior(believed, run)), 1);
    for (_, effects) in rungs() {
        let starts = if effects.is_empty() { vec![model.clone()] } else { Vec::new() };
        let with = |effect: &AnyEffect| {
            let choice = EffectTerm::new(effect.info(), &effect.parameters());
            // Two terms take the place of one.
            let one = model.effects.iter().position(|c| c.info.id == choice.info.id);
            one.map_or_else(|| model.clone(), |k| model.without_effect(k)).with_effect(choice)
        };
        let fitted = starts
            .into_iter()
            .chain(effects.iter().map(with))
            .filter_map(|start| fit(&start, &first, EFFORT))
            .min_by(|a, b| a.nats().total_cmp(&b.nats()))?;
        out.errors.push(errors(&fitted.model)?);
        model = fitted.model;
        let bent = model.effects.iter().position(|c| c.info.id == curvature());
        let straight = bent.map_or_else(
            || Some(model.clone()),
            |k| Some(fit(&model.without_effect(k), &first, EFFORT)?.model),
        )?;
        out.straight.push((errors(&straight)?, straight));
        out.laws.push(model.clone());
    }
    Some(out)
}

/// The effects' numbers of the kept law over the specimens.
fn numbers(each: &[One], rung: usize, curved: bool) -> Vec<SpecimenStatistic> {
    let laws: Vec<&Model> =
        each.iter().map(|o| if curved { &o.laws[rung] } else { &o.straight[rung].1 }).collect();
    let Some(first) = laws.first() else { return Vec::new() };
    let paths = first.effects.iter().flat_map(|c| c.info.parameters.iter());
    paths
        .map(|p| {
            let log = p.path.ends_with("time_constant_s");
            let all = stylet_stats::sorted(
                laws.iter().filter_map(|law| value(law, p.path)).map(|x| if log { libm::log(x) } else { x }),
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

/// A number of a law by its path. Terms come in no order: the fast one first.
fn value(law: &Model, path: &str) -> Option<f64> {
    let of = |path: &str| {
        law.effects.iter().find_map(|c| {
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
mod tests {
    use super::{
        CandidateModel, FITTED, LEAST_GAIN, One, SpecimenReport, SpecimenStatistic, analyze_specimens,
        curvature, look_at_curvature, numbers,
    };
    use super::{one, relaxing, value, whole};
    use crate::diagnosis_json::Verdict;
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::start_values::indentation_prior;
    use std::sync::Arc;
    use stylet_identify::model::{EffectTerm, Model};
    use stylet_record::Recording;
    use stylet_stats::student_t;
    use stylet_tissue::{AnyEffect, Effect, ForceLaw, ForceLawState, Layer, NonlinearElasticity, Tissue};

    fn tissue(k: f64) -> Tissue {
        let layer = Layer {
            name: "gel".to_owned(),
            thickness_m: 0.03,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 0.0,
            puncture_n: None,
        };
        Tissue { surface_m: 0.001, layers: vec![layer] }
    }

    /// A ramp of 5 mm in a second and a hold of so many s, at 50 Hz, with noise of 1 mN.
    fn specimen(name: &str, k: f64, effects: &[AnyEffect], hold_s: f64, seed: usize) -> SegmentedRecording {
        let t = tissue(k);
        let law = ForceLaw::new(&t, effects).expect("a law");
        let mut state = ForceLawState::default();
        let (mut times, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..((1.2 + hold_s) * 50.0) as usize {
            let at = 0.02 * i as f64;
            let (place, v) = if at < 0.2 {
                (0.0, 0.0)
            } else if at < 1.2 {
                (0.005 * (at - 0.2), 0.005)
            } else {
                (0.005, 0.0)
            };
            let force = law.step(&mut state, at, place, v, |_| {}).total_n;
            times.push(at);
            z.push(place);
            f.push(force + 2e-3 * (((i * 7919 + 31 * seed) % 101) as f64 / 101.0 - 0.5));
        }
        SegmentedRecording::new(name.to_owned(), Recording::new(times, z, f).expect("clean columns"), 1)
    }

    fn law(effects: &[AnyEffect]) -> Model {
        let mut m =
            Model::base(Arc::new(indentation_prior(&tissue(300.0), &specimen("a", 300.0, &[], 4.0, 1))), 1);
        m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        m
    }

    #[test]
    fn a_specimen_is_a_ramp_and_a_hold_of_three_seconds() {
        let good = specimen("a", 300.0, &[], 4.0, 1);
        assert_eq!(whole(&good), Ok(()));
        assert_eq!(whole(&specimen("a", 300.0, &[], 2.8, 1)).err().as_deref(), Some("held for 2.8 s only"));
        assert!(whole(&specimen("a", 300.0, &[], 3.1, 1)).is_ok());
        let mut short = good.clone();
        for c in [&mut short.recording.time_s, &mut short.recording.position_m, &mut short.recording.force_n]
        {
            let all: Vec<f64> = c.iter().copied().step_by(6).collect();
            *c = all;
        }
        assert_eq!(short.recording.len(), 44);
        short.phases.deepest = 10;
        assert_eq!(whole(&short).err().as_deref(), Some("44 samples are too few"));
        for (count, fine) in [(50, true), (49, false)] {
            let mut r = good.clone();
            r.phases.deepest = 5;
            let t: Vec<f64> = (0..count).map(|k| 0.1 * f64::from(k)).collect();
            let n = t.len();
            r.recording = Recording::new(t, vec![0.0; n], vec![0.0; n]).expect("clean columns");
            r.phases.retraction = n;
            assert_eq!(whole(&r).is_ok(), fine, "{count}");
        }
        // Just three seconds are enough.
        let mut just = good.clone();
        let t: Vec<f64> = (0..64).map(|k| 0.125 * f64::from(k)).collect();
        just.recording = Recording::new(t, vec![0.0; 64], vec![0.0; 64]).expect("clean columns");
        (just.phases.deepest, just.phases.retraction) = (63 - 24, 64);
        assert_eq!(whole(&just), Ok(()));
        let mut back = good;
        back.phases.retraction -= 5;
        assert_eq!(whole(&back).err().as_deref(), Some("the tool comes back"));
    }

    #[test]
    fn terms_are_told_the_fast_one_first() {
        let two = |a: (f64, f64), b: (f64, f64)| {
            law(&[NonlinearElasticity { kappa_per_m: 30.0 }.into(), relaxing(&[a, b])])
        };
        for m in [two((0.2, 0.5), (0.3, 6.0)), two((0.3, 6.0), (0.2, 0.5))] {
            let told = [
                "terms.0.fraction",
                "terms.0.time_constant_s",
                "terms.1.fraction",
                "terms.1.time_constant_s",
                "kappa_per_m",
            ]
            .map(|p| value(&m, p));
            assert_eq!(told, [Some(0.2), Some(0.5), Some(0.3), Some(6.0), Some(30.0)]);
        }
        let alike = two((0.2, 0.5), (0.3, 0.5));
        assert_eq!(value(&alike, "terms.0.fraction"), Some(0.2), "as they stand where neither is faster");
        let one = law(&[relaxing(&[(0.2, 0.5)])]);
        assert_eq!((value(&one, "terms.0.fraction"), value(&one, "terms.1.fraction")), (Some(0.2), None));
    }

    #[test]
    fn numbers_over_specimens_have_students_interval_time_constants_in_their_logarithm() {
        let (fractions, times) = ([0.2, 0.26, 0.31, 0.24, 0.22], [0.5, 0.9, 0.7, 1.4, 0.8]);
        let each: Vec<super::One> = (0..5)
            .map(|k| super::One {
                errors: Vec::new(),
                laws: vec![law(&[]), law(&[relaxing(&[(fractions[k], times[k])])])],
                straight: vec![((0.0, 0.0), law(&[])), ((0.0, 0.0), law(&[relaxing(&[(0.7, 9.0)])]))],
            })
            .collect();
        assert!(numbers(&each, 0, true).is_empty() && numbers(&[], 0, true).is_empty());
        assert!((numbers(&each, 1, false)[0].mean - 0.7).abs() < 1e-9, "those of the law without curvature");
        let told = numbers(&each, 1, true);
        let of = |x: &[f64]| {
            let mean = x.iter().sum::<f64>() / 5.0;
            let sd = (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4.0).sqrt();
            (mean, student_t::quantile(0.975, 4.0) * sd / 5.0_f64.sqrt())
        };
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} for {b}");
        let SpecimenStatistic { name, mean, low, high, range_90: range_90 } = told[0].clone();
        let (m, reach) = of(&fractions);
        assert_eq!(name, "terms.0.fraction");
        [(mean, m), (low, m - reach), (high, m + reach)].iter().for_each(|(a, b)| near(*a, *b));
        // Between neighbours of 0.2, 0.22 .. 0.31: a fifth of the way at either end.
        near(range_90.0, 0.2 + 0.2 * 0.02);
        near(range_90.1, 0.31 - 0.2 * 0.05);
        let logs: Vec<f64> = times.iter().map(|x: &f64| x.ln()).collect();
        let (m, reach) = of(&logs);
        let t = &told[1];
        [(t.mean, m.exp()), (t.low, (m - reach).exp()), (t.high, (m + reach).exp())]
            .iter()
            .for_each(|(a, b)| near(*a, *b));
        near(t.range_90.0, (0.5_f64.ln() + 0.2 * (0.7_f64 / 0.5).ln()).exp());
    }

    #[test]
    fn what_specimens_relax_by_is_found_and_what_they_do_not_have_is_not() {
        let relaxes = [relaxing(&[(0.3, 2.5)])];
        let mut runs: Vec<SegmentedRecording> =
            (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &relaxes, 4.0, k)).collect();
        runs.push(specimen("short", 300.0, &relaxes, 1.0, 9));
        let s = analyze_specimens(&tissue(300.0), &runs).expect("specimens");
        assert_eq!(
            (s.used, s.unused.as_slice(), s.punctured.len()),
            (4, &[("short".to_owned(), "held for 1.0 s only".to_owned())][..], 0)
        );
        assert_eq!(
            s.candidates.iter().map(|r| r.kept).collect::<Vec<_>>(),
            [true, false, true, false],
            "{:?}",
            s.candidates
        );
        assert_eq!(s.kept_effects().collect::<Vec<_>>(), ["stress_relaxation"]);
        let of = |name: &str| s.parameters.iter().find(|n| n.name == name).expect("a number");
        assert!((of("terms.0.fraction").mean - 0.3).abs() < 0.02, "{:?}", s.parameters);
        assert!((of("terms.0.time_constant_s").mean / 2.5 - 1.0).abs() < 0.1, "{:?}", s.parameters);
        assert!(
            s.candidates[2].held_out_n < 0.3 * s.candidates[0].held_out_n
                && s.candidates[2].improved_share == 1.0
        );
        assert!(
            s.candidates[0].improved_share == 0.0 && s.candidates[2].fitted_n < 2e-3,
            "{:?}",
            s.candidates
        );
        let d = s.diagnosis(&runs);
        assert_eq!((d.verdict, d.causes.len(), d.causes[0].confidence), (Verdict::Named, 1, 1.0));
        assert!(
            d.causes[0].parameters.keys().all(|k| k.starts_with("terms."))
                && !d.causes[0].parameters.is_empty()
        );
        assert_eq!(
            (d.gain.rmse_before_n, d.gain.rmse_after_n),
            (s.candidates[0].held_out_n, s.candidates[2].held_out_n)
        );
        assert_eq!(d.not_identifiable, ["power_law_friction", "shaft_slip", "rate_dependent_puncture"]);
        // A spring alone.
        let plain: Vec<SegmentedRecording> =
            (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &[], 4.0, k)).collect();
        let s = analyze_specimens(&tissue(300.0), &plain).expect("specimens");
        assert_eq!(s.kept_effects().count(), 0, "{:?}", s.candidates);
        assert_eq!(s.diagnosis(&plain).verdict, Verdict::None);
        assert!(analyze_specimens(&tissue(300.0), &runs[4..]).is_none());
        // A quick relaxation bends the ramp as a curved spring would.
        let quick = [relaxing(&[(0.4, 0.9)])];
        let quick: Vec<SegmentedRecording> =
            (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &quick, 4.0, k)).collect();
        let s = analyze_specimens(&tissue(300.0), &quick).expect("specimens");
        assert_eq!(s.kept_effects().collect::<Vec<_>>(), ["stress_relaxation"], "{:?}", s.candidates);
        assert!(s.parameters.iter().all(|n| n.name.starts_with("terms.")), "{:?}", s.parameters);
        assert!((s.parameters[0].mean - 0.4).abs() < 0.02, "{:?}", s.parameters);
        // A curved one that relaxes with two terms.
        let both: [AnyEffect; 2] =
            [NonlinearElasticity { kappa_per_m: 150.0 }.into(), relaxing(&[(0.25, 0.3), (0.3, 3.0)])];
        let curved: Vec<SegmentedRecording> =
            (0..4).map(|k| specimen(&format!("{k}"), 280.0 + 20.0 * k as f64, &both, 9.0, k)).collect();
        let s = analyze_specimens(&tissue(300.0), &curved).expect("specimens");
        assert_eq!(s.candidates.iter().map(|r| r.kept).collect::<Vec<_>>(), [true; 4], "{:?}", s.candidates);
        let d = s.diagnosis(&curved);
        assert_eq!(
            d.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(),
            ["nonlinear_elasticity", "stress_relaxation"]
        );
        assert_eq!(d.causes[0].parameters.keys().collect::<Vec<_>>(), ["kappa_per_m"]);
    }

    /// Three fifths of the hold are fitted: a force that changes behind them is no matter of the fit.
    #[test]
    fn a_specimen_is_fitted_without_the_rest_of_its_hold_and_judged_on_it() {
        let mut r = specimen("a", 300.0, &[], 4.0, 1);
        let t = r.recording.time_s.clone();
        let stop_s = t[r.phases.deepest];
        let end_s = stop_s + FITTED * (t[t.len() - 1] - stop_s);
        for (f, t) in r.recording.force_n.iter_mut().zip(&t) {
            *f += if *t > end_s { 0.5 } else { 0.0 };
        }
        let (fitted_n, rest_n) = one(&tissue(300.0), &r).expect("a fit").errors[0];
        assert!(fitted_n < 2e-3 && (rest_n - 0.5).abs() < 0.01, "{fitted_n} {rest_n}");
    }

    /// Specimens with these errors (N, on what was fitted and on the rest) under the third law, and without its curvature.
    fn judged(all: &[[(f64, f64); 2]]) -> Vec<One> {
        let of = |[with, without]: &[(f64, f64); 2]| One {
            errors: vec![*with; 3],
            laws: Vec::new(),
            straight: vec![(*without, law(&[])); 3],
        };
        all.iter().map(of).collect()
    }

    fn rung(effect: &str, better: f64, kept: bool) -> CandidateModel {
        let effect = Some(effect.to_owned()).filter(|e| !e.is_empty());
        CandidateModel {
            step: String::new(),
            effect,
            fitted_n: 7.0,
            held_out_n: 8.0,
            improved_share: better,
            kept,
        }
    }

    /// A tenth less of both errors together in three of four specimens.
    #[test]
    fn a_curvature_stays_when_most_specimens_lose_by_going_without_it() {
        let told = |all: &[[(f64, f64); 2]], standing: usize| {
            let mut rungs =
                [rung("", 0.0, true), rung(curvature(), 1.0, true), rung("stress_relaxation", 1.0, true)];
            let kept = look_at_curvature(&judged(all), &mut rungs, standing);
            assert_eq!(rungs[1].kept, kept);
            (kept, (rungs[standing].fitted_n, rungs[standing].held_out_n))
        };
        let without = (1.2, 0.8);
        for (with, kept) in
            [((0.4, 1.3), true), ((1.3, 0.6), false), ((1.0 - LEAST_GAIN, 1.0 - LEAST_GAIN), false)]
        {
            let numbers = if kept { (7.0, 8.0) } else { without };
            assert_eq!(told(&[[with, without]; 4], 2), (kept, numbers), "{with:?}");
        }
        let (good, equal) = ([(0.5, 0.4), without], [without, without]);
        assert!(told(&[good, good, good, equal], 2).0 && !told(&[good, good, good, equal, equal], 2).0);
        // Where the curved law is the last one, it stands as it was told.
        assert_eq!(told(&[equal], 1), (true, (7.0, 8.0)));
    }

    #[test]
    fn a_cause_is_as_sure_as_the_best_of_its_kept_rungs() {
        let rungs = vec![
            rung("", 0.0, true),
            rung(curvature(), 0.8, true),
            rung("stress_relaxation", 0.9, true),
            rung("stress_relaxation", 1.0, false),
        ];
        let s = SpecimenReport {
            used: 4,
            unused: Vec::new(),
            punctured: Vec::new(),
            candidates: rungs,
            parameters: Vec::new(),
        };
        let sure: Vec<f64> = s.diagnosis(&[]).causes.iter().map(|c| c.confidence).collect();
        assert_eq!(sure, [0.8, 0.9]);
    }
}
