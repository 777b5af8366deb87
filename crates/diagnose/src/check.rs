//! Whether the recordings can belong to the scenario at all.

use crate::diagnose::Evidence;
use crate::error::DiagnoseError;
use stylet_record::{QualityKind, QualityNote, Recording};
use stylet_scenario::Scenario;
use stylet_tissue::{Law, replay};

/// Fewest samples of a recording.
const LEAST_SAMPLES: usize = stylet_record::LEAST_SAMPLES;
/// Most layers: so many were seen to be told apart, with clean data and no cause named.
const MOST_LAYERS: usize = 40;

/// Among so many recordings one can be unlike the others ...
const FEWEST: usize = 3;
/// ... when its force is more than so many times theirs, or less than one of so many parts of it, each against what the law expects of its
/// motion.
const UNLIKE: f64 = 2.0;

/// Checks reach, units and signs; says how many times what the scenario expects each recording's force is (none where they do not go
/// together).
pub(crate) fn check(scenario: &Scenario, evidence: &[Evidence]) -> Result<Vec<Option<f64>>, DiagnoseError> {
    if evidence.is_empty() {
        return Err(DiagnoseError::NoRecording);
    }
    let layers = scenario.tissue.layers.len();
    if layers > MOST_LAYERS {
        return Err(DiagnoseError::TooManyLayers { layers, most: MOST_LAYERS });
    }
    let (surface_m, end_m) = (scenario.tissue.surface_m, scenario.tissue.end_m());
    let mut times = Vec::with_capacity(evidence.len());
    for e in evidence {
        let r = &e.recording;
        let usable = (0..r.len())
            .filter(|&i| (r.time_s[i] + r.position_m[i] + r.velocity_mps[i] + r.force_n[i]).is_finite());
        let usable: Vec<usize> = usable.collect();
        let name = || e.name.clone();
        if usable.len() < LEAST_SAMPLES {
            return Err(DiagnoseError::TooShort {
                name: name(),
                samples: usable.len(),
                least: LEAST_SAMPLES,
            });
        }
        let deepest_m = usable.iter().fold(f64::NEG_INFINITY, |m, &i| m.max(r.position_m[i]));
        let lowest_m = usable.iter().fold(f64::INFINITY, |m, &i| m.min(r.position_m[i]));
        let depth_m = end_m - surface_m;
        // The smallest depth of any use: a hundredth of the first layer.
        let first_m = scenario.tissue.layers.first().map_or(depth_m, |l| l.thickness_m);
        if lowest_m >= end_m && deepest_m - lowest_m <= 20.0 * depth_m {
            let offset_m = surface_m - lowest_m;
            return Err(DiagnoseError::BeginsBehind { name: name(), lowest_m, end_m, offset_m });
        }
        if deepest_m - surface_m > 20.0 * depth_m {
            let scale = if deepest_m > 2e4 * depth_m { 1e-6 } else { 1e-3 };
            let unit = if scale == 1e-3 { "millimetres" } else { "micrometres" };
            return Err(DiagnoseError::PositionUnit { name: name(), deepest: deepest_m, end_m, unit, scale });
        }
        if deepest_m - surface_m < 0.01 * first_m {
            let start_m = usable.first().map_or(deepest_m, |&i| r.position_m[i]);
            let remedy = if start_m - lowest_m > deepest_m - start_m && -lowest_m > surface_m + 0.1 * depth_m
            {
                "the position runs the other way: positive is into the tissue, give a column map with a negative scale"
            } else if deepest_m - lowest_m > 1e-9 && deepest_m - lowest_m < 2e-3 * depth_m {
                "its whole travel is a thousandth of the tissue: is the position in kilometres, or scaled twice?"
            } else {
                "is this the right scenario, and does position zero mean the same in both? a column map shifts it with \
                 position: (name: \"position_m\", offset: 0.01), or give the scenario the surface_m that the recording has"
            };
            return Err(DiagnoseError::NeverReaches { name: name(), deepest_m, surface_m, remedy });
        }
        times.push(force(scenario, e, &usable)?);
    }
    Ok(times)
}

/// Per recording a note when its force is not of the others' size, by what [`check`] says of all.
pub(crate) fn unlike(times: &[Option<f64>]) -> Vec<Option<QualityNote>> {
    let note = |i: usize| {
        let own = times[i]?;
        let others: Vec<f64> =
            times.iter().enumerate().filter(|(j, _)| *j != i).filter_map(|(_, t)| *t).collect();
        let typical = (others.len() + 1 >= FEWEST).then(|| stylet_stats::median_of(others))?;
        if own < UNLIKE * typical && own * UNLIKE > typical {
            return None;
        }
        let message = format!(
            "it is not like the others: its force is {own:.2} times what the scenario expects of its motion, that of the others {typical:.2} \
             times; is it filed under the right tissue, needle and units? leave it out or put it right"
        );
        let numbers = [("own_times", own), ("others_times", typical)].map(|(name, x)| (name.to_owned(), x));
        Some(QualityNote {
            kind: QualityKind::NotLikeTheOthers,
            message,
            numbers: numbers.into_iter().collect(),
            lines: Vec::new(),
            grave: false,
        })
    };
    (0..times.len()).map(note).collect()
}

/// Compares the size and sign of the measured force with the believed law's; how many times it is, where the two go together.
fn force(scenario: &Scenario, e: &Evidence, usable: &[usize]) -> Result<Option<f64>, DiagnoseError> {
    let r = &e.recording;
    let Ok(law) = Law::new(&scenario.tissue, &scenario.effects) else { return Ok(None) };
    let mut believed = Vec::with_capacity(usable.len());
    replay(
        &law,
        usable.iter().map(|&i| (r.time_s[i], r.position_m[i], r.velocity_mps[i])),
        |_| {},
        |f| believed.push(f.total_n),
    );
    let mean: f64 = usable.iter().map(|&i| r.force_n[i]).sum::<f64>() / usable.len() as f64;
    let expected: f64 = believed.iter().sum::<f64>() / believed.len() as f64;
    let (mut ff, mut bb, mut fb) = (0.0, 0.0, 0.0);
    for (&i, b) in usable.iter().zip(&believed) {
        let (f, b) = (r.force_n[i] - mean, b - expected);
        ff += f * f;
        bb += b * b;
        fb += f * b;
    }
    let (measured, law_n) = (ff.sqrt(), bb.sqrt());
    let correlation = fb / (measured * law_n).max(1e-300);
    let ratio = measured / law_n.max(1e-300);
    let wrong = |what: String, scale: f64| Err(DiagnoseError::Force { name: e.name.clone(), what, scale });
    if correlation < -0.5 {
        return wrong(
            "the force runs the other way: it should be positive when it resists the insertion".to_owned(),
            -1.0,
        );
    }
    if correlation.abs() > 0.5 && ratio > 100.0 {
        return wrong(
            format!("the force is {ratio:.0} times what the scenario expects: is it in millinewtons?"),
            1e-3,
        );
    }
    if correlation.abs() > 0.5 && ratio < 0.01 {
        return wrong(
            format!("the force is {ratio:.1e} of what the scenario expects: is it in kilonewtons?"),
            1e3,
        );
    }
    Ok((correlation > 0.5).then_some(ratio))
}

/// The recording without samples that are not finite.
pub(crate) fn finite(r: &Recording) -> Recording {
    let good = |i: usize| (r.time_s[i] + r.position_m[i] + r.velocity_mps[i] + r.force_n[i]).is_finite();
    let kept: Vec<usize> = (0..r.len()).filter(|i| good(*i)).collect();
    if kept.len() == r.len() {
        return r.clone();
    }
    let pick = |x: &[f64]| kept.iter().map(|i| x[*i]).collect::<Vec<f64>>();
    Recording {
        time_s: pick(&r.time_s),
        position_m: pick(&r.position_m),
        velocity_mps: pick(&r.velocity_mps),
        force_n: pick(&r.force_n),
        velocity_measured: r.velocity_measured,
        ..Recording::default()
    }
}

/// A remark on samples that are not finite: they are cut out.
pub(crate) fn holes(r: &Recording) -> Option<QualityNote> {
    let bad: Vec<usize> = (0..r.len())
        .filter(|&i| !(r.time_s[i] + r.position_m[i] + r.velocity_mps[i] + r.force_n[i]).is_finite())
        .collect();
    let first = *bad.first()?;
    let message = format!(
        "{} sample(s) are not finite numbers, the first is number {}: they were cut out",
        bad.len(),
        first + 1
    );
    let numbers =
        [("count".to_owned(), bad.len() as f64), ("first".to_owned(), first as f64)].into_iter().collect();
    Some(QualityNote { kind: QualityKind::Gaps, message, numbers, lines: Vec::new(), grave: false })
}
