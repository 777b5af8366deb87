//! What the raw force says before any law: where the sensor's range ends, the step of its numbers, spikes.
//!
//! A remark ([`QualityNote`]) tells the reader; this tells whoever compares the force with a law which samples cannot be compared.

mod range_and_resolution;
mod spikes;

pub use spikes::Spikes;

use crate::{QualityNote, Recording};
use range_and_resolution::{quantisation_step_n, sensor_limit_n};
use spikes::find_spikes;

/// What was found in the raw force.
#[derive(Clone, Debug, Default)]
pub struct SensorArtefacts {
    /// Samples per recording that cannot be compared: saturated, spikes, or at rest within a step of the sensor.
    pub exclude: Vec<Vec<bool>>,
    /// Range of the sensor in N, if it was reached.
    pub limit_n: Option<f64>,
    /// Step of the recorded force in N.
    pub step_n: Option<f64>,
    /// Spikes.
    pub spikes: Option<Spikes>,
}

/// Looks the raw forces over.
#[must_use]
pub fn find_sensor_artefacts(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> SensorArtefacts {
    let mut raw = SensorArtefacts {
        exclude: recordings.iter().map(|r| vec![false; r.len()]).collect(),
        ..SensorArtefacts::default()
    };
    raw.step_n = quantisation_step_n(recordings, notes);
    raw.limit_n = sensor_limit_n(recordings, raw.step_n);
    if let Some(limit) = raw.limit_n {
        for (exclude, recording) in raw.exclude.iter_mut().zip(recordings) {
            for (x, f) in exclude.iter_mut().zip(&recording.force_n) {
                *x |= f.abs() >= limit * (1.0 - 1e-9);
            }
        }
    }
    raw.spikes = find_spikes(recordings, &mut raw.exclude, raw.step_n.unwrap_or(0.0));
    if raw.step_n.is_some() {
        for (exclude, recording) in raw.exclude.iter_mut().zip(recordings) {
            leave_out_ends(exclude, &recording.force_n);
        }
    }
    raw
}

/// Samples of one number in a row that noise would have moved.
const STANDS: usize = 20;

/// Leaves out a force that stands at one number until shortly before it first changes, and from shortly after it last does: a needle in air
/// rests somewhere within a step, always at the same place of it, where a needle in tissue goes through many.
fn leave_out_ends(exclude: &mut [bool], f: &[f64]) {
    let (Some(first), Some(last)) = (f.first(), f.last()) else { return };
    let before = f.iter().take_while(|x| *x == first).count();
    let after = f.iter().rev().take_while(|x| *x == last).count();
    exclude.iter_mut().take(before.saturating_sub(STANDS)).for_each(|x| *x = true);
    exclude.iter_mut().rev().take(after.saturating_sub(STANDS)).for_each(|x| *x = true);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::QualityKind;
    use std::collections::BTreeMap;

    pub(in crate::quality::sensor_artefacts) fn recording(f: Vec<f64>) -> Recording {
        let t: Vec<f64> = (0..f.len()).map(|k| 0.01 * k as f64).collect();
        Recording::new(t, vec![0.0; f.len()], f).expect("clean columns")
    }

    pub(in crate::quality::sensor_artefacts) fn quantised(step: f64) -> QualityNote {
        QualityNote {
            kind: QualityKind::Quantisation,
            message: "force_n moves in steps".to_owned(),
            numbers: BTreeMap::from([("smallest_step".to_owned(), step)]),
            lines: Vec::new(),
            blocking: false,
        }
    }

    /// Samples that alternate about nothing by `d` stand out of their neighbours by `d`, each: the scatter is 1.4826 `d`.
    pub(in crate::quality::sensor_artefacts) fn alternating(n: usize, d: f64) -> Vec<f64> {
        (0..n).map(|k| if k % 2 == 0 { d } else { -d }).collect()
    }

    #[test]
    fn a_force_in_steps_is_not_compared_while_it_stands_at_its_ends() {
        let steps = |from: usize, to: usize| -> Vec<f64> {
            (0..300).map(|k| if k < from || k >= to { 0.5 } else { 0.5 * (k / 7) as f64 }).collect()
        };
        let marked = |f: Vec<f64>, notes: Vec<QualityNote>| -> Vec<usize> {
            let raw = find_sensor_artefacts(&[&recording(f)], &[notes]);
            (0..300).filter(|k| raw.exclude[0][*k]).collect()
        };
        let ends: Vec<usize> = (0..20).chain(270..300).collect();
        assert_eq!(marked(steps(40, 250), vec![quantised(0.5)]), ends);
        // Not where nothing says that it comes in steps, nor where it moves on soon.
        assert!(marked(steps(40, 250), Vec::new()).is_empty());
        assert!(marked(steps(3, 290), vec![quantised(0.5)]).is_empty());
    }

    #[test]
    fn samples_at_the_limit_are_marked_whatever_their_sign() {
        let mut f: Vec<f64> = (0..300).map(|k| (0.1 * f64::from(k)).sin()).collect();
        f[100..107].fill(1.25);
        f[200..203].fill(-1.25);
        f[150] = 1.25 * (1.0 - 1e-6);
        let raw = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
        assert_eq!(raw.limit_n, Some(1.25));
        let marked: Vec<usize> = (0..300).filter(|k| raw.exclude[0][*k]).collect();
        assert_eq!(marked, (100..107).chain(200..203).collect::<Vec<_>>());
    }
}
