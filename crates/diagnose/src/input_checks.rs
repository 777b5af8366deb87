//! Checks recordings for plausibility against the scenario (length, reach, units, signs), and cleans them.

use crate::error::DiagnoseError;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_record::sensor_artefacts::{SensorArtefacts, find_sensor_artefacts};
use stylet_record::{MIN_SAMPLES, QualityKind, QualityNote, Recording, assess};
use stylet_scenario::Scenario;
use stylet_stats::parallel::*;
use stylet_tissue::{ForceLaw, replay};

/// A recording with its name.
#[derive(Clone, Debug)]
pub struct NamedRecording {
    /// Name, for example of the file.
    pub name: String,
    /// The recording.
    pub recording: Recording,
    /// Notes of the file reader, in addition to those of [`assess`].
    pub notes: Vec<QualityNote>,
}

/// Recordings ready for the fit.
pub(crate) struct CleanRecordings {
    /// Recordings without non-finite samples.
    pub recordings: Vec<Recording>,
    /// Notes on each recording.
    pub notes: Vec<Vec<QualityNote>>,
    /// Artefacts of the sensor in the raw samples.
    pub raw: SensorArtefacts,
}

/// Largest number of layers; as many were distinguished in simulated cases with clean data.
const MAX_LAYERS: usize = 40;

/// Smallest number of recordings in which one can be an outlier.
const MIN_RECORDINGS_FOR_OUTLIER: usize = 3;
/// Factor by which the force ratio (measured over expected force) of an outlier differs from the median of the others.
const OUTLIER_FORCE_FACTOR: f64 = 2.0;

/// Checks that there are recordings with enough usable samples.
pub(crate) fn check_length(recordings: &[NamedRecording]) -> Result<(), DiagnoseError> {
    if recordings.is_empty() {
        return Err(DiagnoseError::NoRecording);
    }
    for e in recordings {
        let samples = (0..e.recording.len()).filter(|i| is_finite_sample(&e.recording, *i)).count();
        if samples < MIN_SAMPLES {
            return Err(DiagnoseError::TooShort { name: e.name.clone(), samples, least: MIN_SAMPLES });
        }
    }
    Ok(())
}

/// Checks length, reach, units and signs of all recordings.
///
/// Returns the force ratio of each recording, measured over expected force; `None` if both do not correlate.
pub(crate) fn check_recordings(
    scenario: &Scenario,
    recordings: &[NamedRecording],
) -> Result<Vec<Option<f64>>, DiagnoseError> {
    check_length(recordings)?;
    let layers = scenario.tissue.layers.len();
    if layers > MAX_LAYERS {
        return Err(DiagnoseError::TooManyLayers { layers, most: MAX_LAYERS });
    }
    let (surface_m, end_m) = (scenario.tissue.surface_m, scenario.tissue.end_m());
    let mut ratios = Vec::with_capacity(recordings.len());
    for e in recordings {
        let r = &e.recording;
        let usable: Vec<usize> = (0..r.len()).filter(|i| is_finite_sample(r, *i)).collect();
        let name = || e.name.clone();
        let deepest_m = usable.iter().fold(f64::NEG_INFINITY, |m, &i| m.max(r.position_m[i]));
        let lowest_m = usable.iter().fold(f64::INFINITY, |m, &i| m.min(r.position_m[i]));
        let depth_m = end_m - surface_m;
        // Smallest useful depth: a hundredth of the first layer.
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
                 position: (name: \"...\", offset: 0.01) with the name in your file and the distance that is missing, or give the scenario the surface_m that the recording has"
            };
            return Err(DiagnoseError::NeverReaches { name: name(), deepest_m, surface_m, remedy });
        }
        check_time_unit(scenario, e, &usable)?;
        ratios.push(force_ratio_of(scenario, e, &usable)?);
    }
    Ok(ratios)
}

/// Units of time with their length in s, as a column map gives them.
const TIME_UNITS: [(&str, &str, f64); 5] = [
    ("microseconds", "1e-6", 1e-6),
    ("milliseconds", "1e-3", 1e-3),
    ("minutes", "60", 60.0),
    ("hours", "3600", 3600.0),
    ("centiseconds", "0.01", 0.01),
];
/// Largest ratio of duration and speed between the scenario's motion and a recording of it.
const SAME_MOTION_FACTOR: f64 = 1.25;

/// Returns an error if duration and speed agree with the scenario's motion in another unit of time and not in seconds.
fn check_time_unit(scenario: &Scenario, e: &NamedRecording, usable: &[usize]) -> Result<(), DiagnoseError> {
    let r = &e.recording;
    let (Some(&first), Some(&last)) = (usable.first(), usable.last()) else { return Ok(()) };
    let duration_s = r.time_s[last] - r.time_s[first];
    let wrong = |expected: String, unit: &'static str, scale: &'static str| DiagnoseError::TimeUnit {
        name: e.name.clone(),
        duration_s,
        expected,
        unit,
        scale,
    };
    let Some(plan) = scenario.motion.plan() else {
        return force_in_other_unit(scenario, r, usable).map_or(Ok(()), |(unit, scale)| {
            Err(wrong("its force is that of slower motions".to_owned(), unit, scale))
        });
    };
    let path_m: f64 = usable.windows(2).map(|w| (r.position_m[w[1]] - r.position_m[w[0]]).abs()).sum();
    /// Number of times at which the planned motion is sampled.
    const POINTS: usize = 2000;
    let (mut planned_path_m, mut before) = (0.0, None);
    for k in 0..=POINTS {
        let z = plan.at(plan.duration_s() * k as f64 / POINTS as f64).position_m;
        planned_path_m += before.replace(z).map_or(0.0, |b: f64| (z - b).abs());
    }
    // Speed averaged over the motion.
    let (speed_mps, planned_mps) = (path_m / duration_s, planned_path_m / plan.duration_s());
    let near = |ratio: f64| ratio < SAME_MOTION_FACTOR && ratio * SAME_MOTION_FACTOR > 1.0;
    let is_unit =
        |unit_s: f64| near(unit_s * duration_s / plan.duration_s()) && near(speed_mps / unit_s / planned_mps);
    match TIME_UNITS.into_iter().find(|(_, _, unit_s)| is_unit(*unit_s)) {
        Some((unit, scale, _)) if !is_unit(1.0) => {
            Err(wrong(format!("the scenario's motion takes {:.4} s", plan.duration_s()), unit, scale))
        }
        _ => Ok(()),
    }
}

/// Unit of time longer than a second that explains a force far below the expected one, for a needle faster than usual in seconds: in that
/// unit, the expected force has the measured size.
fn force_in_other_unit(
    scenario: &Scenario,
    r: &Recording,
    usable: &[usize],
) -> Option<(&'static str, &'static str)> {
    /// Median speed (m/s) above which insertions by a robot are rare.
    const FAST_MPS: f64 = 0.05;
    /// Largest ratio of measured to expected force in seconds for a wrong unit.
    const MAX_RATIO: f64 = 1.0 / 3.0;
    let speeds = usable.iter().map(|&i| r.velocity_mps[i].abs());
    if stylet_stats::order_statistics::median_of(speeds) < FAST_MPS {
        return None;
    }
    let (ratio, _) = force_ratio_in_unit(scenario, r, usable, 1.0)?;
    let fits = |unit_s: f64| {
        force_ratio_in_unit(scenario, r, usable, unit_s)
            .is_some_and(|(ratio, correlation)| (0.5..2.0).contains(&ratio) && correlation > 0.8)
    };
    let unit = TIME_UNITS.into_iter().find(|(_, _, unit_s)| *unit_s > 1.0 && fits(*unit_s))?;
    (ratio < MAX_RATIO).then_some((unit.0, unit.1))
}

/// A note for each recording whose force ratio ([`check_recordings`]) differs from that of the others.
pub(crate) fn force_outlier_notes(ratios: &[Option<f64>]) -> Vec<Option<QualityNote>> {
    let note = |i: usize| {
        let ratio = ratios[i]?;
        let others: Vec<f64> =
            ratios.iter().enumerate().filter(|(j, _)| *j != i).filter_map(|(_, t)| *t).collect();
        let typical =
            (others.len() + 1 >= MIN_RECORDINGS_FOR_OUTLIER).then(|| stylet_stats::median_of(others))?;
        if ratio < OUTLIER_FORCE_FACTOR * typical && ratio * OUTLIER_FORCE_FACTOR > typical {
            return None;
        }
        let message = format!(
            "it is not like the others: its force is {ratio:.2} times what the scenario expects of its motion, that of the others {typical:.2} \
             times; check its tissue, needle and units, or leave it out"
        );
        let numbers = [("force_ratio", ratio), ("others_force_ratio", typical)];
        Some(QualityNote::new(QualityKind::OutlierRecording, message, numbers))
    };
    (0..ratios.len()).map(note).collect()
}

/// Force ratio of one recording: size of the measured force over that of the assumed model; `None` if both do not correlate.
fn force_ratio_of(
    scenario: &Scenario,
    e: &NamedRecording,
    usable: &[usize],
) -> Result<Option<f64>, DiagnoseError> {
    let Some((ratio, correlation)) = force_ratio_in_unit(scenario, &e.recording, usable, 1.0) else {
        return Ok(None);
    };
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

/// Size of the measured force over that of the assumed model, and their correlation, for time in units of `unit_s`.
fn force_ratio_in_unit(
    scenario: &Scenario,
    r: &Recording,
    usable: &[usize],
    unit_s: f64,
) -> Option<(f64, f64)> {
    let law = ForceLaw::new(&scenario.tissue, &scenario.effects).ok()?;
    let mut expected_n = Vec::with_capacity(usable.len());
    replay(
        &law,
        usable.iter().map(|&i| (r.time_s[i] * unit_s, r.position_m[i], r.velocity_mps[i] / unit_s)),
        |_| {},
        |f| expected_n.push(f.total_n),
    );
    let mean: f64 = usable.iter().map(|&i| r.force_n[i]).sum::<f64>() / usable.len() as f64;
    let expected: f64 = expected_n.iter().sum::<f64>() / expected_n.len() as f64;
    let (mut ff, mut bb, mut fb) = (0.0, 0.0, 0.0);
    for (&i, b) in usable.iter().zip(&expected_n) {
        let (f, b) = (r.force_n[i] - mean, b - expected);
        ff += f * f;
        bb += b * b;
        fb += f * b;
    }
    let (measured, model) = (ff.sqrt(), bb.sqrt());
    Some((measured / model.max(1e-300), fb / (measured * model).max(1e-300)))
}

/// Whether all columns of a sample are finite.
fn is_finite_sample(r: &Recording, i: usize) -> bool {
    [&r.time_s, &r.position_m, &r.velocity_mps, &r.force_n].iter().all(|x| x[i].is_finite())
}

/// Assesses the quality of recordings and removes non-finite samples.
pub(crate) fn clean_recordings(named: &[NamedRecording]) -> CleanRecordings {
    let mut notes: Vec<Vec<QualityNote>> = Vec::new();
    let mut recordings: Vec<Recording> = Vec::new();
    for e in named {
        let mut all = e.notes.clone();
        all.extend(non_finite_note(&e.recording));
        let finite = drop_non_finite(&e.recording);
        for note in assess(&finite) {
            if !all.contains(&note) {
                all.push(note);
            }
        }
        notes.push(all);
        recordings.push(finite);
    }
    let borrowed: Vec<&Recording> = recordings.iter().collect();
    let raw = find_sensor_artefacts(&borrowed, &notes);
    CleanRecordings { recordings, notes, raw }
}

/// Blocks of recordings, without the samples that sensor artefacts exclude.
pub(crate) fn average_blocks(recordings: &[Recording], raw: &SensorArtefacts) -> Vec<BlockAverages> {
    recordings.par_iter().zip(&raw.exclude).map(|(r, x)| BlockAverages::new(r, x, BLOCK_S)).collect()
}

/// The recording without non-finite samples.
pub(crate) fn drop_non_finite(r: &Recording) -> Recording {
    let kept: Vec<usize> = (0..r.len()).filter(|i| is_finite_sample(r, *i)).collect();
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

/// A note on non-finite samples, which were removed.
pub(crate) fn non_finite_note(r: &Recording) -> Option<QualityNote> {
    let bad: Vec<usize> = (0..r.len()).filter(|i| !is_finite_sample(r, *i)).collect();
    let first = *bad.first()?;
    let message = format!(
        "{} sample(s) are not finite numbers, the first is number {}: they were removed",
        bad.len(),
        first + 1
    );
    let numbers = [("count", bad.len() as f64), ("first", first as f64)];
    Some(QualityNote::new(QualityKind::Gaps, message, numbers))
}

#[cfg(test)]
mod tests;
