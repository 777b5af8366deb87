//! What the raw force says before any law: where the sensor's range ends, the step of its numbers, spikes.
//!
//! A remark ([`QualityNote`]) tells the reader; this tells whoever compares the force with a law which samples cannot be compared.

mod grid;
mod spikes;

pub use spikes::Spikes;

use crate::{QualityNote, Recording};
use grid::{limit, step};
use spikes::spikes;

/// What was found in the raw force.
#[derive(Clone, Debug, Default)]
pub struct Raw {
    /// Samples per recording that cannot be compared: saturated or spikes.
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
pub fn look(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> Raw {
    let mut raw =
        Raw { exclude: recordings.iter().map(|r| vec![false; r.len()]).collect(), ..Raw::default() };
    raw.step_n = step(recordings, notes);
    raw.limit_n = limit(recordings, raw.step_n);
    if let Some(limit) = raw.limit_n {
        for (exclude, recording) in raw.exclude.iter_mut().zip(recordings) {
            for (x, f) in exclude.iter_mut().zip(&recording.force_n) {
                *x |= f.abs() >= limit * (1.0 - 1e-9);
            }
        }
    }
    raw.spikes = spikes(recordings, &mut raw.exclude, raw.step_n.unwrap_or(0.0));
    raw
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::QualityKind;
    use std::collections::BTreeMap;

    pub(in crate::quality::raw) fn recording(f: Vec<f64>) -> Recording {
        let t: Vec<f64> = (0..f.len()).map(|k| 0.01 * k as f64).collect();
        Recording::new(t, vec![0.0; f.len()], f).expect("clean columns")
    }

    pub(in crate::quality::raw) fn quantised(step: f64) -> QualityNote {
        QualityNote {
            kind: QualityKind::Quantisation,
            message: "force_n moves in steps".to_owned(),
            numbers: BTreeMap::from([("smallest_step".to_owned(), step)]),
            lines: Vec::new(),
            grave: false,
        }
    }

    /// Samples that alternate about nothing by `d` stand out of their neighbours by `d`, each: the scatter is 1.4826 `d`.
    pub(in crate::quality::raw) fn alternating(n: usize, d: f64) -> Vec<f64> {
        (0..n).map(|k| if k % 2 == 0 { d } else { -d }).collect()
    }

    #[test]
    fn samples_at_the_limit_are_marked_whatever_their_sign() {
        let mut f: Vec<f64> = (0..300).map(|k| (0.1 * f64::from(k)).sin()).collect();
        f[100..107].fill(1.25);
        f[200..203].fill(-1.25);
        f[150] = 1.25 * (1.0 - 1e-6);
        let raw = look(&[&recording(f)], &[Vec::new()]);
        assert_eq!(raw.limit_n, Some(1.25));
        let marked: Vec<usize> = (0..300).filter(|k| raw.exclude[0][*k]).collect();
        assert_eq!(marked, (100..107).chain(200..203).collect::<Vec<_>>());
    }
}
