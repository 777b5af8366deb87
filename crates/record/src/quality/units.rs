//! Quantities that look as if they came in another unit.

use super::{QualityKind, QualityNote};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
use crate::recording::Recording;
use stylet_stats::{extremes, quantile_of};

/// No needle travels so far (m).
const FARTHEST_M: f64 = 2.0;
/// No needle is so fast (m/s).
const FASTEST_MPS: f64 = 1.0;
/// No needle is pushed so hard (N).
const STRONGEST_N: f64 = 500.0;
/// No log is so slow (s).
const SLOWEST_S: f64 = 1.0;
/// A measured velocity so many times the slope of the position (or of the other sign) is in another unit; a noisy one is not.
const GRAVE_FACTOR: f64 = 20.0;
/// Single bad samples shall not look like a unit.
const PERCENTILE: f64 = 0.99;

pub(super) fn unit_mix_ups(recording: &Recording) -> Vec<QualityNote> {
    let mut notes = Vec::new();
    let mut beyond = |value: f64, limit: f64, grave: bool, message: String| {
        if value > limit {
            let note =
                QualityNote::new(QualityKind::UnitMixUp, message, [("value", value), ("limit", limit)]);
            notes.push(QualityNote { grave, ..note });
        }
    };
    let (low, high) = extremes(&recording.position_m);
    let travel_m = high - low;
    beyond(
        travel_m,
        FARTHEST_M,
        true,
        format!(
            "the position ranges over {travel_m:.4} m: it looks like millimetres; give a column map with position scale 1e-3"
        ),
    );
    let speed_mps = quantile_of(recording.velocity_mps.iter().map(|v| v.abs()), PERCENTILE);
    beyond(
        speed_mps,
        FASTEST_MPS,
        true,
        format!(
            "the needle moves at {speed_mps:.4} m/s: position or velocity look like millimetres: give a column map with scale 1e-3 \
         (or the time is too short by its unit)"
        ),
    );
    let force_n = quantile_of(recording.force_n.iter().map(|f| f.abs()), PERCENTILE);
    beyond(
        force_n,
        STRONGEST_N,
        true,
        format!(
            "the force reaches {force_n:.1} N: it looks like millinewtons; give a column map with force scale 1e-3"
        ),
    );
    let interval_s = recording.median_interval_s();
    beyond(
        interval_s,
        SLOWEST_S,
        false,
        format!(
            "the typical sampling interval is {interval_s:.4} s: the time looks like milliseconds (scale 1e-3) or microseconds \
         (scale 1e-6)"
        ),
    );
    notes.extend(velocity_against_position(recording));
    notes
}

/// A measured velocity should be the slope of the position: the factor between them (least squares) is near one.
fn velocity_against_position(recording: &Recording) -> Option<QualityNote> {
    if !recording.velocity_measured {
        return None;
    }
    let slope = differentiate(&recording.time_s, &recording.position_m, DEFAULT_HALF_WIDTH_S);
    let (mut together, mut alone) = (0.0, 0.0);
    for (slope, velocity) in slope.iter().zip(&recording.velocity_mps) {
        together += slope * velocity;
        alone += slope * slope;
    }
    let factor = together / alone;
    (alone > 0.0 && !(0.5..=2.0).contains(&factor)).then(|| {
        let message = format!(
            "the measured velocity is {factor:.4} times the slope of the position: check the units and signs of both, or leave the velocity out of the \
             column map"
        );
        let note = QualityNote::new(QualityKind::UnitMixUp, message, [("value", factor), ("limit", 2.0)]);
        QualityNote { grave: !(1.0 / GRAVE_FACTOR..=GRAVE_FACTOR).contains(&factor), ..note }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;

    /// Three seconds at 100 Hz and 5 mm/s, with units wrong by the given factors.
    fn insertion(time: f64, position: f64, force: f64) -> Result<Recording, RecordError> {
        let time_s: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.01).collect();
        let force_n = time_s.iter().map(|t| t * force).collect();
        let position_m = time_s.iter().map(|t| 0.005 * t * position).collect();
        Recording::new(time_s.iter().map(|t| t * time).collect(), position_m, force_n)
    }

    fn remarks(recording: &Recording) -> String {
        unit_mix_ups(recording).into_iter().map(|note| note.message + "\n").collect()
    }

    #[test]
    fn an_insertion_in_si_units_raises_no_doubt() -> Result<(), RecordError> {
        assert_eq!(remarks(&insertion(1.0, 1.0, 1.0)?), "");
        Ok(())
    }

    #[test]
    fn millimetres_millinewtons_and_milliseconds_are_named() -> Result<(), RecordError> {
        let millimetres = remarks(&insertion(1.0, 1e3, 1.0)?);
        assert!(
            millimetres.contains("looks like millimetres") && millimetres.contains("m/s"),
            "{millimetres}"
        );
        assert!(remarks(&insertion(1.0, 1.0, -1e3)?).contains("looks like millinewtons"));
        assert!(remarks(&insertion(1e3, 1.0, 1.0)?).contains("looks like milliseconds"));
        Ok(())
    }

    #[test]
    fn a_velocity_of_the_wrong_sign_or_unit_is_named_and_a_noisy_one_is_not() -> Result<(), RecordError> {
        let si = insertion(1.0, 1.0, 1.0)?;
        let measured = |factor: f64| {
            let velocity_mps =
                si.velocity_mps.iter().enumerate().map(|(i, v)| v * factor + 0.002 * ((i % 2) as f64 - 0.5));
            Recording { velocity_mps: velocity_mps.collect(), velocity_measured: true, ..si.clone() }
        };
        assert_eq!(remarks(&measured(1.0)), "");
        assert!(remarks(&measured(-1.0)).contains("-1.0"), "{}", remarks(&measured(-1.0)));
        assert!(remarks(&measured(60.0)).contains("times the slope of the position"));
        Ok(())
    }
}
