//! Samples of the recorded force that a force law cannot explain: at the end of the sensor's range, spikes, and a quantised
//! force at rest; with range, resolution and spikes of the sensor.
//!
//! Quality notes ([`QualityNote`]) inform the reader; these results are for fits.

mod range_and_resolution;
mod spikes;

pub use spikes::Spikes;

use super::note::QualityNote;
use crate::recording::Recording;
use range_and_resolution::{quantisation_step_n, sensor_limit_n};
use spikes::find_spikes;

/// Sensor artefacts in the recorded force of a set of recordings.
#[derive(Clone, Debug, Default)]
pub struct SensorArtefacts {
    /// Per recording, the samples to exclude from a fit: saturated, spikes, or at rest within one step of the sensor.
    pub exclude: Vec<Vec<bool>>,
    /// Range of the sensor in N, if it is reached.
    pub limit_n: Option<f64>,
    /// Resolution of the recorded force in N.
    pub step_n: Option<f64>,
    /// Spikes.
    pub spikes: Option<Spikes>,
}

impl SensorArtefacts {
    /// Standard deviation (N) of the rounding of the recorded force.
    #[must_use]
    pub fn quantisation_sd_n(&self) -> f64 {
        self.step_n.unwrap_or(0.0) * stylet_stats::UNIFORM_SD
    }
}

/// Finds range, resolution and spikes of the sensor from the forces of recordings with these quality notes.
#[must_use]
pub fn find_sensor_artefacts(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> SensorArtefacts {
    let mut artefacts = SensorArtefacts {
        exclude: recordings.iter().map(|r| vec![false; r.len()]).collect(),
        ..SensorArtefacts::default()
    };
    artefacts.step_n = quantisation_step_n(recordings, notes);
    artefacts.limit_n = sensor_limit_n(recordings, artefacts.step_n);
    if let Some(limit) = artefacts.limit_n {
        for (exclude, recording) in artefacts.exclude.iter_mut().zip(recordings) {
            for (x, f) in exclude.iter_mut().zip(&recording.force_n) {
                *x |= f.abs() >= limit * (1.0 - 1e-9);
            }
        }
    }
    artefacts.spikes = find_spikes(recordings, &mut artefacts.exclude, artefacts.step_n.unwrap_or(0.0));
    if artefacts.step_n.is_some() {
        for (exclude, recording) in artefacts.exclude.iter_mut().zip(recordings) {
            exclude_constant_ends(exclude, &recording.force_n);
        }
    }
    artefacts
}

/// Longest constant run at the ends that is kept.
const MAX_CONSTANT_SAMPLES: usize = 20;

/// Excludes a constant force at the start and end of a recording, but for a few samples: a needle at rest in air is always at
/// the same place within a quantisation step, while a needle in tissue passes through many.
fn exclude_constant_ends(exclude: &mut [bool], f: &[f64]) {
    let (Some(first), Some(last)) = (f.first(), f.last()) else { return };
    let before = f.iter().take_while(|x| *x == first).count();
    let after = f.iter().rev().take_while(|x| *x == last).count();
    exclude.iter_mut().take(before.saturating_sub(MAX_CONSTANT_SAMPLES)).for_each(|x| *x = true);
    exclude.iter_mut().rev().take(after.saturating_sub(MAX_CONSTANT_SAMPLES)).for_each(|x| *x = true);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::QualityKind;
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

    #[test]
    fn quantisation_noise_is_uniform_over_one_step() {
        let noise_n = SensorArtefacts { step_n: Some(0.6), ..SensorArtefacts::default() }.quantisation_sd_n();
        assert!((noise_n / (0.6 / 12.0_f64.sqrt()) - 1.0).abs() < 2e-3, "{noise_n}");
        assert_eq!(SensorArtefacts::default().quantisation_sd_n(), 0.0);
    }

    /// Samples that alternate by `d` about zero differ from their neighbours by `d`: the scatter is 1.4826 `d`.
    pub(in crate::quality::sensor_artefacts) fn alternating(n: usize, d: f64) -> Vec<f64> {
        (0..n).map(|k| if k % 2 == 0 { d } else { -d }).collect()
    }

    #[test]
    fn a_quantised_force_is_excluded_while_it_is_constant_at_the_ends() {
        let steps = |from: usize, to: usize| -> Vec<f64> {
            (0..300).map(|k| if k < from || k >= to { 0.5 } else { 0.5 * (k / 7) as f64 }).collect()
        };
        let marked = |f: Vec<f64>, notes: Vec<QualityNote>| -> Vec<usize> {
            let artefacts = find_sensor_artefacts(&[&recording(f)], &[notes]);
            (0..300).filter(|k| artefacts.exclude[0][*k]).collect()
        };
        let ends: Vec<usize> = (0..20).chain(270..300).collect();
        assert_eq!(marked(steps(40, 250), vec![quantised(0.5)]), ends);
        // Not without a quantisation note, nor after a short constant run.
        assert!(marked(steps(40, 250), Vec::new()).is_empty());
        assert!(marked(steps(3, 290), vec![quantised(0.5)]).is_empty());
    }

    #[test]
    fn samples_at_the_limit_are_excluded_whatever_their_sign() {
        let mut f: Vec<f64> = (0..300).map(|k| (0.1 * f64::from(k)).sin()).collect();
        f[100..107].fill(1.25);
        f[200..203].fill(-1.25);
        f[150] = 1.25 * (1.0 - 1e-6);
        let artefacts = find_sensor_artefacts(&[&recording(f)], &[Vec::new()]);
        assert_eq!(artefacts.limit_n, Some(1.25));
        let marked: Vec<usize> = (0..300).filter(|k| artefacts.exclude[0][*k]).collect();
        assert_eq!(marked, (100..107).chain(200..203).collect::<Vec<_>>());
    }
}
