//! The whole: from runs to a diagnosis with its gain on insertions that took no part.

use crate::fit::{Effort, Fit};
use crate::gain::{self, LeftOut};
use crate::instrument::{Instrument, timing};
use crate::ladder::{self, Ladder};
use crate::population::Population;
use crate::predict::{self, Prediction};
use crate::run::Run;
use crate::shape::{Ingredient, Own};
use crate::stats::{mean_sd, normal_quantile, student_95};
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_diagnose::outcome::{
    BaseParameter, Cause, Diagnosis, Estimate, EvidenceStep, Gain, LeftoverReport, NoiseReport, Quality,
    Rival, Verdict,
};
use stylet_record::{QualityKind, QualityNote};
use stylet_scenario::{ForceTorque, Motion, Scenario, Segment, Sensor};
use stylet_tissue::{AnyEffect, Effect, Tissue};

/// What a speed's runs show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtSpeed {
    /// Mean speed of the advance (m/s).
    pub speed_mps: f64,
    /// Runs.
    pub runs: usize,
    /// Mean of the other runs of this speed as the predictor (N); none for a single run.
    pub floor_n: Option<f64>,
    /// Base law, this run left out (N).
    pub base_n: f64,
    /// Extended law, this run left out (N).
    pub extended_n: f64,
    /// Share of the samples of left-out runs within the 90 % band.
    pub covered: f64,
    /// Extended law, all runs of this speed left out (N).
    pub speed_left_out_n: Option<f64>,
    /// Base law, all runs of this speed left out (N).
    pub base_speed_left_out_n: Option<f64>,
}

/// What a step of the search bought.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bought {
    /// The step.
    pub step: String,
    /// Error on left-out runs after it (N).
    pub left_out_n: f64,
    /// Error on left-out runs of the extended law without it (N).
    pub without_n: Option<f64>,
}

/// Two-level numbers and predictions, for `diagnosis.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeats {
    /// Runs.
    pub runs: Vec<RunReport>,
    /// By speed, slowest first.
    pub speeds: Vec<AtSpeed>,
    /// Means over the speeds: floor, base law, extended law (N), coverage.
    pub mean: MeanReport,
    /// What varies from run to run.
    pub population: Population,
    /// The search, in order.
    pub bought: Vec<Bought>,
    /// What the instrument was seen to do.
    pub instrument: Instrument,
    /// Layers measured alone, put together.
    pub parts: Option<Parts>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// Its name.
    pub name: String,
    /// Speed (m/s).
    pub speed_mps: f64,
    /// Shift of the surface (m).
    pub shift_m: f64,
    /// Factor on friction.
    pub friction: f64,
    /// Per layer the elastic force at the rupture (N) where the force shows one.
    pub puncture_n: Vec<Option<f64>>,
    /// Per layer where it lets go (m).
    pub releases_m: Vec<Option<f64>>,
    /// Error of the base law fitted to the others (N).
    pub base_n: f64,
    /// Error of the extended law fitted to the others (N).
    pub extended_n: f64,
    /// Share within the band.
    pub covered: f64,
    /// Error of the mean of the others at this speed (N).
    pub floor_n: Option<f64>,
}

/// Means over the speeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeanReport {
    /// Floor (N).
    pub floor_n: Option<f64>,
    /// Base law (N).
    pub base_n: f64,
    /// Extended law (N).
    pub extended_n: f64,
    /// Coverage of the 90 % band.
    pub covered: f64,
    /// Extended law with a whole speed left out (N).
    pub speed_left_out_n: Option<f64>,
    /// Base law with a whole speed left out (N).
    pub base_speed_left_out_n: Option<f64>,
}

/// Layers measured alone, put together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parts {
    /// Per part its name, the floor and the extended law's error on its own left-out runs (N).
    pub alone: Vec<(String, Option<f64>, f64)>,
    /// Error of the composed law on the whole (N), by speed.
    pub composed_n: Vec<f64>,
    /// Mean over the speeds.
    pub mean_n: f64,
}

/// The study.
#[derive(Clone, Debug)]
pub struct Study {
    /// The search.
    pub ladder: Ladder,
    /// Population of the extended law.
    pub population: Population,
    /// Predictions of left-out runs by the extended law.
    pub predictions: Vec<Prediction>,
    /// And by the base law.
    pub base_predictions: Vec<Prediction>,
    /// Extended laws fitted without each run.
    pub left_out: Vec<(Fit, Population)>,
    /// `diagnosis.json`.
    pub diagnosis: Diagnosis,
    /// What it adds.
    pub repeats: Repeats,
    /// The extended scenario: the mean insertion.
    pub extended: Scenario,
}

/// Everything a diagnosis of repeats says, as it is written.
#[derive(Serialize)]
pub struct Written<'a> {
    /// As for single recordings.
    #[serde(flatten)]
    pub diagnosis: &'a Diagnosis,
    /// What repeats add.
    pub repeats: &'a Repeats,
}

/// Fits of left-out runs.
const ONE_OUT: Effort = Effort { steps: 6, rounds: 1 };
/// Fits without a whole speed, which moves them further.
const SPEED_OUT: Effort = Effort { steps: 15, rounds: 1 };

/// Studies runs. `name` is what the extended scenario is called; `instrument` looks at the checks once
/// the residual to be explained is known.
pub fn study(
    name: &str,
    believed: &Tissue,
    runs: &[&Run],
    instrument: impl Fn(f64, f64) -> Instrument,
    mut progress: impl FnMut(&str),
) -> Option<Study> {
    let frame = crate::frame::frame(believed, runs);
    let force_n = frame.force_n;
    let ladder = ladder::climb(frame, runs, &mut progress)?;
    progress("every run predicted without it");
    let singles: Vec<Vec<usize>> = (0..runs.len()).map(|i| vec![i]).collect();
    let speeds = gain::speeds(runs);
    let groups: Vec<Vec<usize>> = speeds.iter().map(|s| s.1.clone()).collect();
    let sorted = |fit: &Fit, groups: &[Vec<usize>], effort: Effort| {
        let done = gain::leave_out(fit, runs, groups, effort);
        let mut fits = Vec::new();
        let mut all = Vec::new();
        for (fit, predicted) in done {
            fits.extend(fit);
            all.extend(predicted);
        }
        all.sort_by_key(|a| a.0);
        (fits, all)
    };
    let (_, base_out) = sorted(&ladder.base, &singles, ONE_OUT);
    let (fits, out) = sorted(&ladder.best, &singles, ONE_OUT);
    if base_out.len() != runs.len() || out.len() != runs.len() || fits.len() != runs.len() {
        return None;
    }
    let by_speed = |fit: &Fit| (groups.len() > 1).then(|| sorted(fit, &groups, SPEED_OUT).1);
    let (base_speed_out, speed_out) = (by_speed(&ladder.base), by_speed(&ladder.best));
    let population = Population::of(&ladder.best, runs);
    let instrument = instrument(force_n, ladder.base_left_out_n);
    let floor = gain::floor(runs);
    let run_reports = run_reports(&ladder.best, runs, &base_out, &out, &floor);
    let at_speeds: Vec<AtSpeed> = speeds
        .iter()
        .map(|(v, m)| at_speed(*v, m, &run_reports, speed_out.as_deref(), base_speed_out.as_deref()))
        .collect();
    let mean = mean_report(&at_speeds);
    let estimates = estimates(&ladder.best, &population, &fits);
    let diagnosis = diagnosis(&ladder, runs, believed, &estimates, &mean, &run_reports, &instrument);
    let extended = extended(name, &ladder.best, &population, runs, &instrument);
    let repeats = Repeats {
        runs: run_reports,
        speeds: at_speeds,
        mean,
        population: population.clone(),
        bought: bought(&ladder),
        instrument,
        parts: None,
    };
    let take = |all: Vec<(usize, LeftOut, Prediction)>| all.into_iter().map(|a| a.2).collect();
    Some(Study {
        population,
        predictions: take(out),
        base_predictions: take(base_out),
        left_out: fits,
        diagnosis,
        repeats,
        extended,
        ladder,
    })
}

type Out = [(usize, LeftOut, Prediction)];

fn run_reports(best: &Fit, runs: &[&Run], base: &Out, out: &Out, floor: &[Option<f64>]) -> Vec<RunReport> {
    runs.iter()
        .enumerate()
        .map(|(i, run)| RunReport {
            name: run.name.clone(),
            speed_mps: run.speed_mps,
            shift_m: best.own[i].shift_m,
            friction: libm::exp(best.own[i].friction_log),
            puncture_n: (0..run.ruptures.len())
                .map(|l| {
                    (run.ruptures[l].is_some() && best.shape.imposes(l)).then_some(best.at_rupture[i][l])
                })
                .collect(),
            releases_m: run.releases_m.clone(),
            base_n: base[i].1.rmse_n,
            extended_n: out[i].1.rmse_n,
            covered: out[i].1.covered,
            floor_n: floor[i],
        })
        .collect()
}

fn average(values: impl Iterator<Item = f64>) -> f64 {
    mean_sd(&values.collect::<Vec<_>>()).0
}

fn at_speed(
    v: f64,
    members: &[usize],
    runs: &[RunReport],
    out: Option<&Out>,
    base_out: Option<&Out>,
) -> AtSpeed {
    let of = |what: &dyn Fn(&RunReport) -> f64| average(members.iter().map(|i| what(&runs[*i])));
    let left = |out: Option<&Out>| {
        out.filter(|o| o.len() == runs.len()).map(|o| average(members.iter().map(|i| o[*i].1.rmse_n)))
    };
    AtSpeed {
        speed_mps: v,
        runs: members.len(),
        floor_n: (members.len() > 1).then(|| of(&|r| r.floor_n.unwrap_or(f64::NAN))),
        base_n: of(&|r| r.base_n),
        extended_n: of(&|r| r.extended_n),
        covered: of(&|r| r.covered),
        speed_left_out_n: left(out),
        base_speed_left_out_n: left(base_out),
    }
}

fn mean_report(speeds: &[AtSpeed]) -> MeanReport {
    let optional = |what: &dyn Fn(&AtSpeed) -> Option<f64>| {
        let all: Option<Vec<f64>> = speeds.iter().map(what).collect();
        all.map(|all| mean_sd(&all).0)
    };
    MeanReport {
        floor_n: optional(&|s| s.floor_n),
        base_n: average(speeds.iter().map(|s| s.base_n)),
        extended_n: average(speeds.iter().map(|s| s.extended_n)),
        covered: average(speeds.iter().map(|s| s.covered)),
        speed_left_out_n: optional(&|s| s.speed_left_out_n),
        base_speed_left_out_n: optional(&|s| s.base_speed_left_out_n),
    }
}

fn bought(ladder: &Ladder) -> Vec<Bought> {
    ladder
        .path
        .iter()
        .map(|(ingredient, left_out_n)| Bought {
            step: ingredient.label(),
            left_out_n: *left_out_n,
            without_n: ladder.without.iter().find(|(i, _)| i == ingredient).map(|w| w.1),
        })
        .collect()
}

/// One number of the extended law as the library has it.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    /// Effect, or `layer.1` for a base parameter.
    owner: String,
    path: String,
    value: f64,
}

fn told(fit: &Fit, population: &Population) -> Vec<Told> {
    let shape = predict::law_of(fit, population);
    let (tissue, effects) = shape.tissue(&fit.x, &population.mean());
    let mut out = Vec::new();
    let mut tell =
        |owner: String, path: &str, value: f64| out.push(Told { owner, path: path.to_owned(), value });
    for (i, layer) in tissue.layers.iter().enumerate() {
        let owner = format!("layer.{}", i + 1);
        tell(owner.clone(), "front_m", tissue.front_m(i));
        tell(owner.clone(), "stiffness_n_per_m", layer.stiffness_n_per_m);
        tell(owner.clone(), "friction_ns_per_m2", layer.friction_ns_per_m2);
        if let Some(force) = layer.puncture_n {
            tell(owner, "puncture_n", force);
        }
    }
    let count = |id: &str| effects.iter().filter(|e| e.id() == id).count();
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for effect in &effects {
        let many = count(effect.id()) > 1;
        let k = seen.entry(effect.id()).or_insert(0);
        for (p, value) in effect.info().parameters.iter().zip(effect.parameters()) {
            let path = if many { format!("{k}.{}", p.path) } else { p.path.to_owned() };
            tell(effect.id().to_owned(), &path, value);
        }
        *k += 1;
    }
    for (number, x) in shape.numbers().iter().zip(&fit.x).filter(|(n, _)| n.name.ends_with("curvature")) {
        out.push(Told {
            owner: "nonlinear_elasticity".to_owned(),
            path: number.name.clone(),
            value: number.value(*x),
        });
    }
    // What belongs to a cause although another effect carries it.
    let mut term = 0;
    for effect in &effects {
        match effect {
            AnyEffect::LayerStiffening(own) => {
                let all = out.iter().find(|t| t.owner == "nonlinear_elasticity").map_or(0.0, |t| t.value);
                out.push(Told {
                    owner: "nonlinear_elasticity".to_owned(),
                    path: format!("layer.{}.kappa_per_m", own.layer),
                    value: all + own.kappa_per_m,
                });
            }
            AnyEffect::ViscoelasticPresliding(branch)
                if branch.layer == 1 && branch.time_constant_s < LONGEST_S =>
            {
                out.push(Told {
                    owner: "stress_relaxation".to_owned(),
                    path: format!("terms.{term}.dragged_fraction"),
                    value: branch.share,
                });
                term += 1;
            }
            _ => {}
        }
    }
    out
}

/// A branch that creeps more slowly does not creep (s).
const LONGEST_S: f64 = 1e5;

/// Values with their 95 % intervals by the jackknife over runs (Quenouille, Tukey): how the numbers
/// change when runs are left out, which counts what one law cannot say about all of them.
fn estimates(best: &Fit, population: &Population, fits: &[(Fit, Population)]) -> Vec<(Told, f64, f64)> {
    let all: Vec<Vec<Told>> = fits.iter().map(|(fit, population)| told(fit, population)).collect();
    let n = all.len() as f64;
    told(best, population)
        .into_iter()
        .map(|t| {
            let values: Vec<f64> = all
                .iter()
                .filter_map(|list| list.iter().find(|o| o.owner == t.owner && o.path == t.path))
                .map(|o| o.value)
                .collect();
            let (_, sd) = mean_sd(&values);
            // sd of the values has n - 1; the jackknife's variance is (n - 1)/n times the sum of squares.
            let error = sd * (n - 1.0) / libm::sqrt(n.max(1.0));
            let reach = student_95(all.len().saturating_sub(1)) * error;
            let (mut low, mut high) = (t.value - reach, t.value + reach);
            // What no run moves, these data do not tell: all that is possible.
            if reach < 1e-9 * t.value.abs() && t.path.ends_with("kept") {
                (low, high) = (0.0, 1.0);
            }
            (t, low, high)
        })
        .collect()
}

fn diagnosis(
    ladder: &Ladder,
    runs: &[&Run],
    believed: &Tissue,
    estimates: &[(Told, f64, f64)],
    mean: &MeanReport,
    reports: &[RunReport],
    instrument: &Instrument,
) -> Diagnosis {
    let mut ids: Vec<&'static str> = Vec::new();
    let worth = |id: &str| {
        ladder
            .without
            .iter()
            .filter(|(i, _)| i.id() == id)
            .map(|(_, e)| e - ladder.left_out_n)
            .fold(0.0, f64::max)
    };
    for ingredient in ladder.best.shape.with.iter().filter(|i| **i != Ingredient::Deeper) {
        if !ids.contains(&ingredient.id()) {
            ids.push(ingredient.id());
        }
    }
    ids.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    let causes: Vec<Cause> = ids
        .iter()
        .map(|id| Cause {
            share: 0.0,
            effect: (*id).to_owned(),
            equivalent: Vec::new(),
            confidence: confidence(
                worth(id),
                mean_sd(&reports.iter().map(|r| r.extended_n).collect::<Vec<_>>()).1,
                runs.len(),
            ),
            parameters: estimates
                .iter()
                .filter(|(t, _, _)| t.owner == *id)
                .map(|(t, low, high)| (t.path.clone(), Estimate { value: t.value, low: *low, high: *high }))
                .collect(),
            gain_nats: nats(ladder, id),
        })
        .collect();
    let base_parameters = estimates
        .iter()
        .filter_map(|(t, low, high)| {
            let layer: usize = t.owner.strip_prefix("layer.")?.parse().ok()?;
            let assumed = match t.path.as_str() {
                "front_m" => believed.front_m(layer - 1),
                "stiffness_n_per_m" => believed.layers[layer - 1].stiffness_n_per_m,
                "friction_ns_per_m2" => believed.layers[layer - 1].friction_ns_per_m2,
                _ => believed.layers[layer - 1].puncture_n.unwrap_or(f64::NAN),
            };
            Some(BaseParameter {
                layer,
                name: t.path.clone(),
                assumed: if assumed.is_finite() { assumed } else { 0.0 },
                value: t.value,
                low: *low,
                high: *high,
                changed: !(*low <= assumed && assumed <= *high),
                at_bound: false,
            })
        })
        .collect();
    let verdict = if causes.is_empty() { Verdict::None } else { Verdict::Named };
    Diagnosis {
        traces: Vec::new(),
        verdict,
        causes,
        base_parameters,
        invisible: if gain::speeds(runs).len() > 1 {
            Vec::new()
        } else {
            vec!["power_law_friction".to_owned(), "rate_dependent_puncture".to_owned()]
        },
        gain: Gain {
            held_out: true,
            recordings: reports.iter().map(|r| r.name.clone()).collect(),
            rmse_before_n: mean.base_n,
            rmse_after_n: mean.extended_n,
            floor_n: mean.floor_n.unwrap_or_else(|| instrument.noise_n.unwrap_or(0.0)),
            each_n: reports.iter().map(|r| (r.base_n, r.extended_n)).collect(),
        },
        leftover: leftover(&ladder.best, runs),
        data_quality: quality(runs),
        evidence: ladder
            .steps
            .iter()
            .scan(Vec::new(), |standing, step| Some(evidence(standing, step, ladder)))
            .collect(),
        noise: NoiseReport {
            sd_n: instrument.noise_n.unwrap_or_else(|| crate::events::noise_n(&runs[0].recording.force_n)),
            ar: [instrument.ar1.unwrap_or(0.0), 0.0],
            from_air: instrument.noise_n.is_some(),
        },
        differences: Default::default(),
        advice: Vec::new(),
    }
}

/// Probability that leaving an effect out is worse on new runs: its mean worth against the scatter of the runs'
/// errors over the root of their number (one-sided, normal).
fn confidence(worth_n: f64, scatter_n: f64, runs: usize) -> f64 {
    let z = worth_n / (scatter_n / libm::sqrt(runs.max(1) as f64)).max(1e-9);
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

/// Nats that the step which took an effect gained.
fn nats(ladder: &Ladder, id: &str) -> f64 {
    ladder
        .steps
        .iter()
        .filter_map(|s| {
            let taken = s.taken.filter(|i| i.id() == id)?;
            s.tried.iter().find(|t| t.ingredient == taken).map(|t| t.nats)
        })
        .sum()
}

fn evidence(standing: &mut Vec<String>, step: &ladder::Step, _ladder: &Ladder) -> EvidenceStep {
    let out = EvidenceStep {
        standing: standing.clone(),
        rivals: step
            .tried
            .iter()
            .map(|t| Rival {
                effect: t.ingredient.label(),
                gain_nats: t.nats,
                parameters: 0,
                screened_only: true,
            })
            .collect(),
        needed_nats: 0.0,
        taken: step.taken.map(Ingredient::label),
    };
    standing.extend(step.taken.map(Ingredient::label));
    out
}

/// What all runs still have in common: the residual of the fitted runs over thirty pieces of the path.
fn leftover(best: &Fit, runs: &[&Run]) -> LeftoverReport {
    const PIECES: usize = 10;
    let mut sums = vec![Vec::new(); 3 * PIECES];
    let (mut force, mut events) = (Vec::new(), Vec::new());
    for (run, own) in runs.iter().zip(&best.own) {
        if !crate::forward::imposed(
            &best.shape,
            &best.x,
            own,
            run.seen_by(&best.shape),
            &mut force,
            &mut events,
        ) {
            continue;
        }
        let data = run.seen_by(&best.shape);
        let (t_deep, t_back) = (
            run.recording.time_s[run.phases.deepest],
            run.recording.time_s.get(run.phases.back).copied().unwrap_or(f64::INFINITY),
        );
        let deepest = run.recording.position_m[run.phases.deepest];
        let mut mine = vec![(0.0, 0usize); 3 * PIECES];
        for i in 0..data.t.len() {
            let share = |x: f64| ((x * PIECES as f64) as usize).min(PIECES - 1);
            let depth = ((data.z[i] - run.contact_m) / (deepest - run.contact_m).max(1e-6)).clamp(0.0, 1.0);
            let bin = match data.t[i] {
                t if t >= t_back => 2 * PIECES + share(depth),
                t if t > t_deep => {
                    let hold =
                        if t_back.is_finite() { t_back - t_deep } else { data.t[data.t.len() - 1] - t_deep };
                    PIECES + share((t - t_deep) / hold.max(1e-6))
                }
                _ => share(depth),
            };
            mine[bin].0 += data.f[i] - force[i];
            mine[bin].1 += 1;
        }
        for (bin, (sum, n)) in mine.iter().enumerate().filter(|(_, m)| m.1 > 0) {
            sums[bin].push(sum / *n as f64);
        }
    }
    let mut worst = [(1.0, 0.0); 3];
    let mut tests = 0;
    for (bin, means) in sums.iter().enumerate().filter(|(_, m)| m.len() > 2) {
        tests += 1;
        let (mean, sd) = mean_sd(means);
        let n = means.len();
        // Student's t as a normal deviate of the same two-sided probability at 95 %, roughly.
        let t = mean / (sd / libm::sqrt(n as f64)).max(1e-9) * (-normal_quantile(0.025) / student_95(n - 1));
        let p = libm::erfc(t.abs() / std::f64::consts::SQRT_2);
        let part = &mut worst[bin / PIECES];
        if p < part.0 {
            *part = (p, 0.5 * t * t);
        }
    }
    let names = ["depth on the way in", "time in the hold", "depth on the way back"];
    let mut found: Vec<(f64, f64, &str)> = worst
        .iter()
        .zip(names)
        .map(|((p, nats), name)| ((p * f64::from(tests)).min(1.0), *nats, name))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    LeftoverReport {
        share: 0.0,
        p_value: found[0].0,
        depends_on: found.iter().filter(|f| f.0 < 1e-3).map(|f| f.2.to_owned()).collect(),
        nats: found[0].1,
    }
}

fn quality(runs: &[&Run]) -> Vec<Quality> {
    let mut out = Vec::new();
    // One remark per speed on what all its recordings have in common.
    for (v, members) in gain::speeds(runs) {
        let some: Vec<&Run> = members.iter().map(|i| runs[*i]).collect();
        let rates: Vec<f64> =
            some.iter().map(|r| (r.recording.len() - 1) as f64 / r.recording.duration_s()).collect();
        let gap = |r: &&Run| r.recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
        let ends: Vec<f64> = some
            .iter()
            .map(|r| {
                r.recording.position_m[r.phases.deepest..].iter().copied().fold(f64::NEG_INFINITY, f64::max)
                    - r.recording.position_m[0]
            })
            .collect();
        let (rate, end) = (mean_sd(&rates).0, mean_sd(&ends).0);
        let largest = some.iter().map(gap).fold(0.0, f64::max);
        let message = format!(
            "{} recording(s) at {:.2} mm/s: really {rate:.1} samples per second on the average, largest gap {:.0} ms, stroke ends at {:.1} mm",
            members.len(),
            1e3 * v,
            1e3 * largest,
            1e3 * end
        );
        let numbers = [("speed_mps", v), ("sample_hz", rate), ("largest_gap_s", largest), ("stroke_m", end)];
        out.push(Quality {
            recording: format!("all at {:.2} mm/s", 1e3 * v),
            note: QualityNote {
                kind: QualityKind::Jitter,
                message,
                numbers: numbers.into_iter().map(|(k, v)| (k.to_owned(), v)).collect(),
                lines: Vec::new(),
                grave: false,
            },
        });
    }
    for run in runs {
        for note in &run.notes {
            out.push(Quality { recording: run.name.clone(), note: note.clone() });
        }
        let message = timing(&run.recording);
        out.push(Quality {
            recording: run.name.clone(),
            note: QualityNote {
                kind: QualityKind::Jitter,
                message,
                numbers: BTreeMap::new(),
                lines: Vec::new(),
                grave: false,
            },
        });
    }
    out
}

/// The mean insertion as a scenario.
fn extended(
    name: &str,
    best: &Fit,
    population: &Population,
    runs: &[&Run],
    instrument: &Instrument,
) -> Scenario {
    let shape = predict::law_of(best, population);
    let (tissue, effects): (Tissue, Vec<AnyEffect>) = shape.tissue(&best.x, &population.mean());
    let run = runs[runs.len() / 2];
    let r = &run.recording;
    let (start, deepest) = (r.position_m[0], r.position_m[run.phases.deepest]);
    let speed = run.speed_mps.max(1e-5);
    let t = |i: usize| r.time_s.get(i).copied().unwrap_or(r.time_s[r.len() - 1]);
    let hold = (t(run.phases.back) - t(run.phases.deepest)).max(0.1);
    let mut segments = vec![
        Segment::Move { velocity_mps: speed, duration_s: (deepest - start) / speed },
        Segment::Hold { duration_s: hold },
    ];
    if run.phases.back < r.len() {
        segments.push(Segment::Move { velocity_mps: -speed, duration_s: (deepest - start) / speed });
    }
    Scenario {
        name: format!("{name}, as measured: the mean insertion"),
        source: "fitted to measured insertions by stylet diagnose".to_owned(),
        tissue,
        effects,
        motion: Motion::Program { start_m: start, segments },
        robot: stylet_scenario::Robot::Replay,
        sensor: Sensor::ForceTorque(ForceTorque {
            noise_n: instrument.noise_n.unwrap_or(0.01),
            ar1: instrument.ar1.unwrap_or(0.0).clamp(-0.99, 0.99),
            ..ForceTorque::default()
        }),
        sample_hz: 100.0,
        ..blank()
    }
}

/// A scenario with every default.
fn blank() -> Scenario {
    Scenario {
        name: String::new(),
        source: String::new(),
        tissue: Tissue { surface_m: 0.0, layers: Vec::new() },
        effects: Vec::new(),
        motion: Motion::Recorded,
        robot: stylet_scenario::Robot::default(),
        sensor: Sensor::default(),
        enhance: Default::default(),
        enhance_virtual: None,
        compare: Vec::new(),
        sample_hz: 200.0,
        physics_hz: 1000.0,
        tolerance: 0.3,
        thickness_tolerance: 0.1,
        surface_tolerance_m: 0.002,
        seed: 1,
    }
}

/// The law of layers measured alone, put together, on the whole.
///
/// `alone` holds per layer of the whole the runs of that layer alone. Every part is fitted with the whole's
/// ingredients, numbers that belong to no layer are taken from the first part.
#[must_use]
pub fn compose(
    study: &Study,
    believed: &Tissue,
    alone: &[(String, Vec<Run>)],
    whole: &[&Run],
) -> Option<Parts> {
    let mut numbers: Vec<(String, f64)> = Vec::new();
    let mut frame = study.ladder.best.shape.frame.clone();
    let mut own: Vec<crate::population::LayerScatter> = Vec::new();
    let mut told = Vec::new();
    let (mut shift, mut friction) = (0.0, 0.0);
    let mut residual = [0.0; 4];
    for (i, (name, runs)) in alone.iter().enumerate() {
        let runs: Vec<&Run> = runs.iter().collect();
        let tissue = Tissue { surface_m: believed.front_m(i), layers: vec![believed.layers[i].clone()] };
        let part_frame = crate::frame::frame(&tissue, &runs);
        let mut shape = crate::shape::Shape::base(part_frame.clone());
        shape.with = study
            .ladder
            .best
            .shape
            .with
            .iter()
            .copied()
            .filter(|k| !matches!(k, Ingredient::Deeper | Ingredient::RatePuncture))
            .collect();
        let start: Vec<f64> = shape.numbers().iter().map(|n| n.start).collect();
        let fitted = crate::fit::fit(
            &shape,
            start,
            None,
            &runs,
            crate::fit::Spread::default(),
            Effort { steps: 30, rounds: 3 },
        )?;
        let population = Population::of(&fitted, &runs);
        let singles: Vec<Vec<usize>> = (0..runs.len()).map(|i| vec![i]).collect();
        let errors: Vec<f64> = gain::leave_out(&fitted, &runs, &singles, ONE_OUT)
            .into_iter()
            .flat_map(|g| g.1)
            .map(|p| p.1.rmse_n)
            .collect();
        let floors: Option<Vec<f64>> = gain::floor(&runs).into_iter().collect();
        told.push((name.clone(), floors.map(|f| mean_sd(&f).0), mean_sd(&errors).0));
        for (n, x) in fitted.shape.numbers().iter().zip(&fitted.x) {
            let named = match n.name.strip_prefix("layer.1.") {
                Some(rest) => format!("layer.{}.{rest}", i + 1),
                None => n.name.clone(),
            };
            if i == 0 || named.starts_with("layer.") {
                numbers.push((named, *x));
            }
        }
        frame.loads[i] = part_frame.loads[0];
        frame.fronts_m[i] = part_frame.fronts_m[0];
        frame.unseen[i] = part_frame.unseen[0];
        own.extend(population.layers.clone());
        if i == 0 {
            (shift, friction) = (population.shift_sd_m, population.friction_sd);
            residual = population.residual_n;
        }
    }
    let mut shape = study.ladder.best.shape.clone();
    shape.frame = frame;
    shape.alpha = 0.0;
    shape.with.retain(|k| !matches!(k, Ingredient::RatePuncture));
    let x = shape
        .numbers()
        .iter()
        .map(|n| numbers.iter().find(|(name, _)| *name == n.name).map_or(n.start, |(_, x)| *x))
        .collect();
    let fit = Fit { shape, x, own: vec![Own::default(); whole.len()], ..study.ladder.best.clone() };
    let population = Population::composed(own, shift, friction, residual);
    let mut composed_n = Vec::new();
    for (_, members) in gain::speeds(whole) {
        composed_n.push(average(members.iter().map(|i| {
            let data = whole[*i].columns();
            let mean = predict::mean(&fit, &population, &data, predict::DRAWS);
            crate::stats::rms(&data.f.iter().zip(&mean).map(|(f, m)| f - m).collect::<Vec<_>>())
        })));
    }
    let mean_n = mean_sd(&composed_n).0;
    Some(Parts { alone: told, composed_n, mean_n })
}
