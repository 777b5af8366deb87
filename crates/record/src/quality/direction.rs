//! Positions of the other sign, and recordings that hold only a retraction.
//!
//! Passive tissue dissipates energy: the work of the force (minus that before contact) is positive over an insertion, its
//! retraction and cyclic loading. Negative work shows that position or force has the wrong sign.

use super::extent::Extent;
use super::note::{QualityKind, QualityNote};
use super::plausibility::{noise_n, rest_n};
use crate::sample_stream::{Quantity, SampleStream};

/// Largest advance, as a share of the travel, of a recording without insertion.
const MAX_ADVANCE_SHARE: f64 = 0.05;
/// The work is summed over steps of this share of the travel, against the noise of the position.
const STEP_SHARE: f64 = 0.005;
/// Largest ratio of the work to the sum of its absolute values; drift and friction together with an elastic load give a
/// larger one.
const MAX_WORK_RATIO: f64 = -0.3;
/// Smallest RMS force over the steps in units of the noise.
const MIN_FORCE_SD: f64 = 8.0;

/// The note on a recording without an insertion: the position only falls, or the tissue does work on the needle.
pub(super) fn no_insertion_note<A: SampleStream>(
    recording: &A,
    extent: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let (low_m, high_m) = extent.position_m;
    let travel_m = high_m - low_m;
    let (mut lowest_m, mut advance_m, mut first_m, mut last_m) = (f64::INFINITY, 0.0_f64, f64::NAN, 0.0);
    recording.for_each_value(Quantity::Position, |z| {
        if first_m.is_nan() {
            first_m = z;
        }
        lowest_m = lowest_m.min(z);
        advance_m = advance_m.max(z - lowest_m);
        last_m = z;
    })?;
    if let Some(note) = both_reversed_note(recording, extent, first_m)? {
        return Ok(Some(note));
    }
    if advance_m <= MAX_ADVANCE_SHARE * travel_m {
        let message = format!(
            "the needle only retracts: the position falls from {first_m:.4} m to {last_m:.4} m and never advances; a recording needs the \
             insertion; if the position runs the other way, reverse the sign of the scale of its `position` in a column map (`scale: -1` for metres, \
             `scale: -0.001` for millimetres)"
        );
        let numbers = [("advance_m", advance_m), ("travel_m", travel_m)];
        return Ok(Some(QualityNote::blocking(QualityKind::OnlyRetraction, message, numbers)));
    }
    let work = Work::sum(recording, STEP_SHARE * travel_m, rest_n(recording)?)?;
    if work.net_j > MAX_WORK_RATIO * work.absolute_j || work.rms_n < MIN_FORCE_SD * noise_n(recording)? {
        return Ok(None);
    }
    let message = format!(
        "the position runs the other way: over the motion the force does {:.4} J on the needle, and a tissue takes up work; positive is into \
         the tissue, reverse the sign of the scale of its `position` in a column map (`scale: -1` for metres, `scale: -0.001` for millimetres)",
        -work.net_j
    );
    let numbers = [("work_j", work.net_j), ("absolute_j", work.absolute_j)];
    Ok(Some(QualityNote::blocking(QualityKind::ReversedPosition, message, numbers)))
}

/// Share of the travel within which a recording begins at its highest position.
const START_SHARE: f64 = 0.1;
/// Largest force at rest, in units of the largest fall, for a force that begins at zero.
const MAX_REST_RATIO: f64 = 0.2;
/// The first share of the way, over which friction of a retraction is already there.
const FIRST_SHARE: f64 = 0.1;
/// Largest mean fall over the first tenth of the way, in units of the largest one; friction of a retraction is largest at its beginning.
const MAX_FIRST_RATIO: f64 = 0.4;

/// The note on a recording whose position and force both have the opposite sign: the needle first moves backward from its highest position, and the
/// force falls from zero with the way. The work is then positive, as of an insertion.
fn both_reversed_note<A: SampleStream>(
    recording: &A,
    extent: &Extent,
    first_m: f64,
) -> Result<Option<QualityNote>, A::Error> {
    let (low_m, high_m) = extent.position_m;
    let (travel_m, rest_n) = (high_m - low_m, rest_n(recording)?);
    // The first stroke backward ends where the position has risen again.
    let (mut before_m, mut lowest_m, mut in_stroke) = (first_m, first_m, true);
    let (mut fall_n, mut rise_n, mut first_work_j) = (0.0_f64, 0.0_f64, 0.0);
    recording.for_each_block([Quantity::Position, Quantity::Force], |[position_m, force_n]| {
        for (&z, &f) in position_m.iter().zip(force_n) {
            lowest_m = lowest_m.min(z);
            in_stroke &= z - lowest_m < START_SHARE * travel_m;
            if in_stroke {
                fall_n = fall_n.max(rest_n - f);
                rise_n = rise_n.max(f - rest_n);
                if first_m - lowest_m < FIRST_SHARE * travel_m {
                    first_work_j += (rest_n - f) * (before_m - z);
                }
                before_m = z;
            }
        }
    })?;
    if high_m - first_m > START_SHARE * travel_m
        || fall_n <= rise_n
        || rest_n.abs() > MAX_REST_RATIO * fall_n
        || fall_n < MIN_FORCE_SD * noise_n(recording)?
        || first_work_j > MAX_FIRST_RATIO * fall_n * FIRST_SHARE * travel_m
    {
        return Ok(None);
    }
    let message = format!(
        "position and force both run the other way: the needle first moves backward, by {:.4} m, and the force falls by {fall_n:.4} N; both should \
         be positive in an insertion. Reverse the signs of both scales in a column map (`scale: -1` for metres and newtons, `scale: -0.001` for \
         millimetres); a recording that begins inside the tissue needs the insertion before it",
        first_m - low_m
    );
    let numbers = [("travel_m", travel_m), ("fall_n", fall_n)];
    Ok(Some(QualityNote::blocking(QualityKind::ReversedPosition, message, numbers)))
}

/// Work on the tissue.
struct Work {
    net_j: f64,
    absolute_j: f64,
    /// Root mean square force over the steps in N.
    rms_n: f64,
}

impl Work {
    /// Sums (force - `rest_n`) times travel over steps of `step_m`, with the mean force of each step.
    fn sum<A: SampleStream>(recording: &A, step_m: f64, rest_n: f64) -> Result<Self, A::Error> {
        let (mut from_m, mut sum_n, mut count) = (f64::NAN, 0.0, 0.0);
        let (mut net_j, mut absolute_j, mut square, mut steps) = (0.0, 0.0, 0.0, 0.0_f64);
        recording.for_each_block([Quantity::Position, Quantity::Force], |[position_m, force_n]| {
            for (&z, &f) in position_m.iter().zip(force_n) {
                if from_m.is_nan() {
                    from_m = z;
                }
                (sum_n, count) = (sum_n + f - rest_n, count + 1.0);
                if (z - from_m).abs() >= step_m {
                    let mean_n = sum_n / count;
                    net_j += mean_n * (z - from_m);
                    absolute_j += (mean_n * (z - from_m)).abs();
                    (square, steps) = (square + mean_n * mean_n, steps + 1.0);
                    (from_m, sum_n, count) = (z, 0.0, 0.0);
                }
            }
        })?;
        Ok(Self { net_j, absolute_j, rms_n: (square / steps.max(1.0)).sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use crate::error::RecordError;
    use crate::quality::{QualityKind, assess};
    use crate::recording::Recording;
    use crate::test_noise::uniform;

    /// Motion up to `deepest_m` and back at 4 mm/s; force of a spring with friction from `surface_m` on, and noise.
    fn insertion(scale: f64, back: bool, from_s: f64, loaded_n: f64) -> Result<Recording, RecordError> {
        let mut uniform = uniform(3);
        let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..3600_u32 {
            let s = f64::from(i) * 0.005;
            let (place, v) =
                if s < 10.0 { (-0.01 + 0.004 * s, 1.0) } else { (0.03 - 0.004 * (s - 10.0), -1.0) };
            if s < from_s || (s > 10.0 && !back) {
                continue;
            }
            let depth = f64::max(place, 0.0);
            let elastic = if v > 0.0 { 60.0 * depth } else { 0.0 };
            t.push(s);
            z.push(scale * place);
            f.push(elastic + 12.0 * v * depth + loaded_n + 0.04 * (uniform() - 0.5));
        }
        Recording::new(t, z, f)
    }

    fn direction_notes(r: &Recording) -> Vec<QualityKind> {
        let kinds = [QualityKind::ReversedPosition, QualityKind::OnlyRetraction];
        let notes = assess(r).into_iter().filter(|n| kinds.contains(&n.kind));
        notes
            .inspect(|n| assert!(n.blocking && n.message.contains("scale: -1"), "{}", n.message))
            .map(|n| n.kind)
            .collect()
    }

    #[test]
    fn a_position_of_the_other_sign_is_refused_with_the_remedy() -> Result<(), RecordError> {
        for loaded_n in [0.0, 3.0, -3.0] {
            assert_eq!(
                direction_notes(&insertion(-1.0, true, 0.0, loaded_n)?),
                [QualityKind::ReversedPosition]
            );
            // Without a way back it could be a retraction as well: the remedy is in the message.
            assert_eq!(
                direction_notes(&insertion(-1.0, false, 0.0, loaded_n)?),
                [QualityKind::OnlyRetraction]
            );
        }
        Ok(())
    }

    #[test]
    fn a_position_and_a_force_of_the_other_sign_are_refused_together() -> Result<(), RecordError> {
        for back in [true, false] {
            let mut mirrored = insertion(-1.0, back, 0.0, 0.0)?;
            mirrored.force_n.iter_mut().for_each(|f| *f = -*f);
            let notes = assess(&mirrored);
            let found: Vec<&str> = notes.iter().filter(|n| n.blocking).map(|n| n.message.as_str()).collect();
            assert!(
                matches!(found[..], [message] if message.contains("position and force both")),
                "{found:?}"
            );
        }
        Ok(())
    }

    #[test]
    fn a_retraction_alone_is_refused() -> Result<(), RecordError> {
        assert_eq!(direction_notes(&insertion(1.0, true, 10.1, 0.0)?), [QualityKind::OnlyRetraction]);
        Ok(())
    }

    #[test]
    fn insertions_with_and_without_retraction_air_and_load_are_not_refused() -> Result<(), RecordError> {
        for loaded_n in [0.0, 3.0, -3.0] {
            for (back, from_s) in [(true, 0.0), (false, 0.0), (true, 5.0), (false, 5.0)] {
                assert_eq!(direction_notes(&insertion(1.0, back, from_s, loaded_n)?), [], "{back} {from_s}");
            }
        }
        Ok(())
    }

    /// The force falls with depth after a puncture, and the encoder is noisy: half of all steps go back.
    #[test]
    fn encoder_noise_under_a_falling_force_is_no_retraction() -> Result<(), RecordError> {
        let mut uniform = uniform(5);
        let t: Vec<f64> = (0..3000).map(|i| f64::from(i) * 0.005).collect();
        let z: Vec<f64> = t.iter().map(|t| 0.002 * t + 4e-5 * (uniform() - 0.5)).collect();
        let f = t.iter().map(|t| if *t < 2.0 { 1.5 * t } else { 3.0 - 0.2 * (t - 2.0) }).collect();
        assert_eq!(direction_notes(&Recording::new(t, z, f)?), []);
        Ok(())
    }

    #[test]
    fn cyclic_loading_that_begins_at_depth_is_not_refused() -> Result<(), RecordError> {
        let t: Vec<f64> = (0..6000).map(|i| f64::from(i) * 0.005).collect();
        let z: Vec<f64> = t.iter().map(|t| 0.003 + 0.003 * (0.8 * t).cos()).collect();
        let f = z.iter().zip(&t).map(|(z, t)| 120.0 * z - 0.2 * (0.8 * t).sin()).collect();
        assert_eq!(direction_notes(&Recording::new(t, z, f)?), []);
        Ok(())
    }
}
