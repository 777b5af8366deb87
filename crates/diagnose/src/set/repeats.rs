//! What repeats add to a diagnosis: errors by run, speed and part of an insertion, what varies, the data as they are.

use crate::outcome::Quality;
use crate::set::first::Insertion;
use crate::set::instrument::{Instrument, timing};
use crate::set::laws::Law;
use crate::set::left_out::{Out, PARTS, Score};
use crate::set::study::speeds;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_identify::model::NEVER;
use stylet_record::{QualityKind, QualityNote};

/// What a speed's runs show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtSpeed {
    /// Mean speed of the advance (m/s).
    pub speed_mps: f64,
    /// Runs.
    pub runs: usize,
    /// Mean of the other runs of this speed as the predictor (N); none for a single run.
    pub floor_n: Option<f64>,
    /// The same without the scatter of that mean itself.
    pub floor_bare_n: Option<f64>,
    /// Base law, this run left out (N).
    pub base_n: f64,
    /// Extended law, this run left out (N).
    pub extended_n: f64,
    /// Share of the samples of left-out runs within the 90 % band.
    pub covered: f64,
    /// Extended law, all runs of this speed left out (N).
    pub speed_left_out_n: Option<f64>,
    /// Share of the samples within its 90 % band.
    pub speed_covered: Option<f64>,
    /// Base law, all runs of this speed left out (N).
    pub base_speed_left_out_n: Option<f64>,
}

/// What a law or a part of it buys.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bought {
    /// The law or the part.
    pub step: String,
    /// Error on left-out parts of the set with it (N).
    pub left_out_n: f64,
    /// Without it (N).
    pub without_n: Option<f64>,
    /// Whether it belongs to the law in the end.
    pub kept: bool,
}

/// Errors in one part of an insertion, pooled over the runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InPart {
    /// Loading, half a second around a drop, cutting, hold, way back.
    pub part: &'static str,
    /// Mean of the other runs of the speed as the predictor (N).
    pub floor_n: Option<f64>,
    /// Extended law on runs left out (N).
    pub extended_n: f64,
}

/// What varies between runs and days: standard deviations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Varies {
    /// Of the surface, between runs (m).
    pub surface_m: f64,
    /// Of the logarithm of friction.
    pub friction: f64,
    /// Of the force that a layer bears, relative.
    pub puncture: f64,
    /// Of the surface between days (m); a day is a speed and a stroke.
    pub day_surface_m: f64,
    /// Of the logarithm of friction between days.
    pub day_friction: f64,
    /// Per layer: runs in which the force shows its rupture.
    pub drops: Vec<usize>,
    /// Per layer: mean and standard deviation of where it lets go (m), where runs show it.
    pub lets_go_m: Vec<Option<(f64, f64)>>,
    /// What the law leaves in air and loading, cutting, hold, way back (N rms).
    pub residual_n: Vec<f64>,
}

/// What repeats add to `diagnosis.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeats {
    /// Runs.
    pub runs: Vec<RunReport>,
    /// By speed, slowest first.
    pub speeds: Vec<AtSpeed>,
    /// Means over the speeds.
    pub mean: MeanReport,
    /// By part of an insertion.
    pub parts_of_insertion: Vec<InPart>,
    /// What varies.
    pub population: Varies,
    /// Starts of the fit, and how many came to the same optimum.
    pub starts: (usize, usize),
    /// Laws and parts of the law.
    pub bought: Vec<Bought>,
    /// What the instrument was seen to do.
    pub instrument: Instrument,
    /// Layers measured alone, put together.
    pub parts: Option<Alone>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// Its name.
    pub name: String,
    /// Speed (m/s).
    pub speed_mps: f64,
    /// Shift of the surface, with its day's (m).
    pub shift_m: f64,
    /// Factor on friction, with its day's.
    pub friction: f64,
    /// Per layer the elastic force at the rupture (N) where there is one.
    pub puncture_n: Vec<Option<f64>>,
    /// Per layer where it lets go (m) where the force shows it.
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
    /// The same without the scatter of the mean of the others (N).
    pub floor_bare_n: Option<f64>,
    /// Base law (N).
    pub base_n: f64,
    /// Extended law (N).
    pub extended_n: f64,
    /// Coverage of the 90 % band.
    pub covered: f64,
    /// Extended law with a whole speed left out (N).
    pub speed_left_out_n: Option<f64>,
    /// Coverage there.
    pub speed_covered: Option<f64>,
    /// Base law with a whole speed left out (N).
    pub base_speed_left_out_n: Option<f64>,
}

/// Layers measured alone, put together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alone {
    /// Per part its name, the floor and the extended law's error on its own left-out runs (N).
    pub alone: Vec<(String, Option<f64>, f64)>,
    /// Error of the composed law on the whole (N), by speed.
    pub composed_n: Vec<f64>,
    /// Mean over the speeds.
    pub mean_n: f64,
}

/// What stands when the predictions are made.
pub struct Standing<'a> {
    /// The runs.
    pub runs: &'a [&'a Insertion],
    /// The law.
    pub law: &'a Law,
    /// Its predictions of runs left out.
    pub out: &'a [Out],
    /// The base law's.
    pub base_out: &'a [Out],
    /// Of runs whose whole speed was left out.
    pub speed_out: Option<&'a [Score]>,
    /// The base law's.
    pub base_speed_out: Option<&'a [Score]>,
    /// The mean of the others as the predictor, and of how many.
    pub floors: &'a [Option<(Score, usize)>],
}

/// Tells it all.
#[must_use]
pub fn repeats(s: &Standing, bought: Vec<Bought>, instrument: Instrument) -> Repeats {
    let runs = each(s);
    let speeds: Vec<AtSpeed> = speeds(s.runs).iter().map(|(v, m)| at_speed(*v, m, s)).collect();
    Repeats {
        mean: mean_report(&speeds),
        parts_of_insertion: by_part(s),
        population: varies(s),
        starts: s.law.fitted.starts,
        bought,
        instrument,
        parts: None,
        speeds,
        runs,
    }
}

fn each(s: &Standing) -> Vec<RunReport> {
    let fit = &s.law.fitted.fit;
    let model = &fit.model;
    s.runs
        .iter()
        .enumerate()
        .map(|(r, run)| {
            let own = model.own.get(r).copied().unwrap_or_default();
            let day = model.day_of.get(r).and_then(|d| model.days.get(*d)).copied().unwrap_or_default();
            let at = |l: usize| {
                let ruptured = model.instants[r].get(l).is_some_and(|t| *t < NEVER);
                let event = fit.residuals.events.get(r).and_then(|e| e.get(l));
                event.filter(|_| ruptured).map(|e| e.elastic_n)
            };
            RunReport {
                name: run.name.clone(),
                speed_mps: run.speed_mps,
                shift_m: own.surface_m + day.surface_m,
                friction: libm::exp(own.friction + day.friction),
                puncture_n: (0..model.layers()).map(at).collect(),
                releases_m: run.releases_m.clone(),
                base_n: s.base_out[r].score.rmse_n,
                extended_n: s.out[r].score.rmse_n,
                covered: s.out[r].score.covered,
                floor_n: s.floors[r].as_ref().map(|f| f.0.rmse_n),
            }
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    stylet_stats::mean(&values.collect::<Vec<_>>())
}

/// Share of the error of a mean of `n` others that is not that mean's own scatter.
fn bare(n: usize) -> f64 {
    (n as f64 / (n + 1) as f64).sqrt()
}

fn at_speed(v: f64, members: &[usize], s: &Standing) -> AtSpeed {
    let of = |what: &dyn Fn(usize) -> f64| mean(members.iter().map(|i| what(*i)));
    let floor = |what: &dyn Fn(&(Score, usize)) -> f64| {
        let all: Option<Vec<f64>> = members.iter().map(|i| s.floors[*i].as_ref().map(what)).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    let left = |out: Option<&[Score]>, what: &dyn Fn(&Score) -> f64| {
        out.filter(|o| o.len() == s.runs.len()).map(|o| mean(members.iter().map(|i| what(&o[*i]))))
    };
    AtSpeed {
        speed_mps: v,
        runs: members.len(),
        floor_n: floor(&|f| f.0.rmse_n),
        floor_bare_n: floor(&|f| f.0.rmse_n * bare(f.1)),
        base_n: of(&|i| s.base_out[i].score.rmse_n),
        extended_n: of(&|i| s.out[i].score.rmse_n),
        covered: of(&|i| s.out[i].score.covered),
        speed_left_out_n: left(s.speed_out, &|o| o.rmse_n),
        speed_covered: left(s.speed_out, &|o| o.covered),
        base_speed_left_out_n: left(s.base_speed_out, &|o| o.rmse_n),
    }
}

fn mean_report(speeds: &[AtSpeed]) -> MeanReport {
    let optional = |what: &dyn Fn(&AtSpeed) -> Option<f64>| {
        let all: Option<Vec<f64>> = speeds.iter().map(what).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    MeanReport {
        floor_n: optional(&|s| s.floor_n),
        floor_bare_n: optional(&|s| s.floor_bare_n),
        base_n: mean(speeds.iter().map(|s| s.base_n)),
        extended_n: mean(speeds.iter().map(|s| s.extended_n)),
        covered: mean(speeds.iter().map(|s| s.covered)),
        speed_left_out_n: optional(&|s| s.speed_left_out_n),
        speed_covered: optional(&|s| s.speed_covered),
        base_speed_left_out_n: optional(&|s| s.base_speed_left_out_n),
    }
}

fn by_part(s: &Standing) -> Vec<InPart> {
    let pooled = |scores: &mut dyn Iterator<Item = &Score>, k: usize| {
        let (sum, n) = scores.fold((0.0, 0.0), |(sum, n), x| (sum + x.parts[k].0, n + x.parts[k].1));
        (n > 0.0).then(|| (sum / n).sqrt())
    };
    PARTS
        .iter()
        .enumerate()
        .filter_map(|(k, part)| {
            let extended_n = pooled(&mut s.out.iter().map(|o| &o.score), k)?;
            let floor_n = pooled(&mut s.floors.iter().flatten().map(|f| &f.0), k);
            Some(InPart { part, floor_n, extended_n })
        })
        .collect()
}

fn varies(s: &Standing) -> Varies {
    let model = &s.law.fitted.fit.model;
    let (scatter, free) = (&model.scatter, model.free);
    let when = |free: bool, x: f64| if free { x } else { 0.0 };
    let population = crate::set::population::Population::of(&s.law.fitted, s.runs);
    Varies {
        surface_m: when(free.own_surface, scatter.surface_m),
        friction: when(free.own_friction, scatter.friction),
        puncture: scatter.force,
        day_surface_m: when(free.day_surface, scatter.day_surface_m),
        day_friction: when(free.day_friction, scatter.day_friction),
        drops: (0..model.layers())
            .map(|l| s.runs.iter().filter(|r| r.ruptures_s[l].is_finite()).count())
            .collect(),
        lets_go_m: (0..model.layers())
            .map(|l| {
                let all: Vec<f64> = s.runs.iter().filter_map(|r| r.releases_m[l]).collect();
                let sd = if all.len() > 1 { stylet_stats::sd(&all) } else { 0.0 };
                (!all.is_empty()).then(|| (stylet_stats::mean(&all), sd))
            })
            .collect(),
        residual_n: population.residual_n.to_vec(),
    }
}

/// Remarks on the data: one per speed on what all its recordings have in common, then those of every recording.
#[must_use]
pub fn quality(runs: &[&Insertion]) -> Vec<Quality> {
    let mut out = Vec::new();
    let plain = |message: String, numbers: BTreeMap<String, f64>| QualityNote {
        kind: QualityKind::Jitter,
        message,
        numbers,
        lines: Vec::new(),
        grave: false,
    };
    for (v, members) in speeds(runs) {
        let some: Vec<&Insertion> = members.iter().map(|i| runs[*i]).collect();
        let rate = mean(some.iter().map(|r| (r.recording.len() - 1) as f64 / r.recording.duration_s()));
        let gap = |r: &&Insertion| r.recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
        let end = mean(some.iter().map(|r| {
            let z = &r.recording.position_m;
            z[r.phases.deepest..].iter().copied().fold(f64::NEG_INFINITY, f64::max) - z[0]
        }));
        let largest = some.iter().map(gap).fold(0.0, f64::max);
        let message = format!(
            "{} recording(s) at {:.2} mm/s: really {rate:.1} samples per second on the average, largest gap {:.0} ms, stroke ends at {:.1} mm",
            members.len(),
            1e3 * v,
            1e3 * largest,
            1e3 * end
        );
        let numbers = [("speed_mps", v), ("sample_hz", rate), ("largest_gap_s", largest), ("stroke_m", end)];
        let numbers = numbers.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        out.push(Quality { recording: format!("all at {:.2} mm/s", 1e3 * v), note: plain(message, numbers) });
    }
    for run in runs {
        let quality = |note: QualityNote| Quality { recording: run.name.clone(), note };
        out.extend(run.notes.iter().cloned().map(quality));
        out.push(quality(plain(timing(&run.recording), BTreeMap::new())));
    }
    out
}
