//! Resolution and range of a force sensor: the step of the force grid, and the level at which the force is clipped.

use crate::quality::note::{QualityKind, QualityNote};
use crate::recording::Recording;
use stylet_stats::median;

/// Least number of equal extremes of a clipped force.
const MIN_EXTREMES: usize = 6;
/// With fewer levels than this up to the largest force, a limit needs more samples.
const COARSE_LEVELS: f64 = 20.0;

/// Step of the grid of all forces in N, from the quantisation notes of at least half of the recordings.
pub(super) fn quantisation_step_n(recordings: &[&Recording], notes: &[Vec<QualityNote>]) -> Option<f64> {
    let mut steps: Vec<f64> = notes
        .iter()
        .flatten()
        .filter(|n| n.kind == QualityKind::Quantisation && n.message.starts_with("force_n"))
        .filter_map(|n| n.numbers.get("smallest_step").copied())
        .filter(|s| *s > 0.0)
        .collect();
    if 2 * steps.len() < recordings.len().max(1) {
        return None;
    }
    let rough = median(&mut steps);
    // Refined by least squares through zero: value against level number.
    let (mut nf, mut nn) = (0.0, 0.0);
    for f in recordings.iter().flat_map(|r| &r.force_n) {
        let n = (f / rough).round();
        nf += n * f;
        nn += n * n;
    }
    let fine = if nn > 0.0 { nf / nn } else { rough };
    Some(if (fine / rough - 1.0).abs() < 0.02 { fine } else { rough })
}

/// Level in N at which the force is clipped.
pub(super) fn sensor_limit_n(recordings: &[&Recording], step: Option<f64>) -> Option<f64> {
    let all = || recordings.iter().flat_map(|r| &r.force_n);
    let most = all().fold(0.0_f64, |m, f| m.max(f.abs()));
    if most <= 0.0 {
        return None;
    }
    let at = all().filter(|f| f.abs() >= most * (1.0 - 1e-9)).count();
    let expected = match step {
        None => 0,
        // On a grid several samples share the last level; below a true limit there are fewer.
        Some(step) => {
            let level = |k: f64| all().filter(|f| (f.abs() - (most - k * step)).abs() < 0.25 * step).count();
            // On a coarse grid a constant force looks like a limit.
            let factor = if COARSE_LEVELS * step > most { 12 } else { 3 };
            factor * level(1.0).max(level(2.0)).max(2)
        }
    };
    (at >= MIN_EXTREMES && at > expected).then_some(most)
}

#[cfg(test)]
mod tests {
    use super::super::find_sensor_artefacts;
    use super::super::tests::{quantised, recording};
    use super::*;

    #[test]
    fn a_limit_needs_six_samples_or_three_times_the_counts_of_the_levels_below() {
        let ramp = |at_limit: usize| {
            let mut f: Vec<f64> = (0..300).map(|k| 0.0101 * f64::from(k)).collect();
            f.iter_mut().rev().take(at_limit).for_each(|f| *f = -3.5);
            recording(f)
        };
        assert_eq!(sensor_limit_n(&[&ramp(5)], None), None);
        assert_eq!(sensor_limit_n(&[&ramp(6)], None), Some(3.5));
        assert_eq!(sensor_limit_n(&[&recording(vec![0.0; 50])], None), None);
        // On a grid of 0.1 N up to 3.5 N, four samples share the level below and two the one below that.
        let grid = |at: usize, below: usize, further: usize| {
            let mut f: Vec<f64> = (0..300).map(|k| 0.1 * f64::from(k % 10)).collect();
            f[..at].fill(3.5);
            f[at..at + below].fill(3.4);
            f[at + below..at + below + further].fill(3.3);
            sensor_limit_n(&[&recording(f)], Some(0.1))
        };
        assert_eq!(grid(12, 4, 2), None);
        assert_eq!(grid(13, 4, 2), Some(3.5));
        assert_eq!(grid(13, 2, 5), None);
        assert_eq!(grid(16, 2, 5), Some(3.5));
        // At least two are expected.
        assert_eq!((grid(6, 0, 0), grid(7, 1, 0)), (None, Some(3.5)));
        // With fewer than twenty levels a limit needs twelve times the counts.
        let coarse = |at: usize, step: f64| {
            let mut f: Vec<f64> = (0..300).map(|k| step * f64::from(k % 5)).collect();
            f[..at].fill(3.8);
            sensor_limit_n(&[&recording(f)], Some(step))
        };
        assert_eq!((coarse(24, 0.2), coarse(25, 0.2)), (None, Some(3.8)));
        assert_eq!(coarse(24, 0.19), Some(3.8));
    }

    #[test]
    fn the_step_is_refined_from_all_levels() {
        let f: Vec<f64> = (0..500).map(|k| 0.0503 * f64::from((k * 37) % 61 - 20)).collect();
        let r = recording(f);
        let fine = quantisation_step_n(&[&r], &[vec![quantised(0.05)]]).expect("a step");
        assert!((fine - 0.0503).abs() < 1e-9, "{fine}");
        // If note and refinement differ by more than two per cent, the note's value is used.
        let two = recording((0..60).map(|k| if k % 3 == 0 { -0.0503 } else { 0.0503 }).collect());
        assert_eq!(quantisation_step_n(&[&two], &[vec![quantised(0.049)]]), Some(0.049));
        assert!(
            (quantisation_step_n(&[&two], &[vec![quantised(0.0495)]]).expect("a step") - 0.0503).abs() < 1e-9
        );
        assert_eq!(quantisation_step_n(&[&two], &[vec![quantised(0.052)]]), Some(0.052));
        // At least half of the recordings have to be on a grid; other notes, and steps of zero, do not count.
        assert!(quantisation_step_n(&[&r, &r], &[vec![quantised(0.05)], Vec::new()]).is_some());
        assert_eq!(
            quantisation_step_n(&[&r, &r, &r], &[vec![quantised(0.05)], Vec::new(), Vec::new()]),
            None
        );
        assert_eq!(quantisation_step_n(&[&r], &[vec![quantised(0.0)]]), None);
        let of_position = QualityNote { message: "position_m moves in steps".to_owned(), ..quantised(0.05) };
        let gaps = QualityNote { kind: QualityKind::Gaps, ..quantised(0.05) };
        assert_eq!(quantisation_step_n(&[&r], &[vec![of_position, gaps]]), None);
        // Without any force the note's value is used.
        assert_eq!(quantisation_step_n(&[&recording(vec![0.0; 20])], &[vec![quantised(0.05)]]), Some(0.05));
        let artefacts = find_sensor_artefacts(&[&r], &[vec![quantised(0.05)]]);
        assert!((artefacts.step_n.expect("a step") - 0.0503).abs() < 1e-9);
    }

    #[test]
    fn the_step_needs_half_of_the_recordings_and_is_not_zero() {
        let r = recording((0..50).map(|k| 0.25 * f64::from(k % 7)).collect());
        let notes = |steps: &[f64]| steps.iter().map(|s| vec![quantised(*s)]).collect::<Vec<_>>();
        assert_eq!(quantisation_step_n(&[&r, &r], &notes(&[0.25])), Some(0.25));
        assert_eq!(quantisation_step_n(&[&r, &r, &r], &notes(&[0.25])), None);
        assert_eq!(quantisation_step_n(&[&r], &notes(&[0.0])), None);
        assert_eq!(quantisation_step_n(&[], &[]), None);
    }
}
