//! Quantities that look as if they had another unit.

use super::extent::Extent;
use super::note::{QualityKind, QualityNote};
use crate::differentiate::{DEFAULT_HALF_WIDTH_S, SlopeFilter};
use crate::inspect::magnitude::{in_words, propose_units};
use crate::sample_stream::{Quantity, SampleStream};
use crate::units::Dimension;
use std::collections::VecDeque;
use stylet_stats::quantiles_of_stream;

/// Most position range (m).
const MAX_RANGE_M: f64 = 2.0;
/// Most speed (m/s).
const MAX_SPEED_MPS: f64 = 1.0;
/// Most force (N).
const MAX_FORCE_N: f64 = 500.0;
/// Most sampling interval (s): slower samples show no rupture.
const MAX_INTERVAL_S: f64 = 0.999;
/// Usual sampling intervals (s).
const USUAL_INTERVAL_S: core::ops::RangeInclusive<f64> = 5e-5..=0.2;
/// Factor between measured velocity and slope of the position (or its inverse) above which the note is blocking.
const BLOCKING_FACTOR: f64 = 20.0;
/// Quantile of speed and force, so that single bad samples do not count.
const QUANTILE: f64 = 0.99;

pub(super) fn unit_mix_ups<A: SampleStream>(
    recording: &A,
    extent: &Extent,
) -> Result<Vec<QualityNote>, A::Error> {
    let typical = |which| -> Result<f64, A::Error> {
        let most =
            quantiles_of_stream(&[QUANTILE], |take| recording.for_each_value(which, |x| take(x.abs())))?;
        Ok(most.first().copied().unwrap_or(f64::NAN))
    };
    let mut notes = Vec::new();
    let mut note_above = |value: f64, limit: f64, blocking: bool, message: String| {
        if value > limit {
            let note =
                QualityNote::new(QualityKind::UnitMixUp, message, [("value", value), ("limit", limit)]);
            notes.push(QualityNote { blocking, ..note });
        }
    };
    let (low, high) = extent.position_m;
    let travel_m = high - low;
    note_above(
        travel_m,
        MAX_RANGE_M,
        true,
        format!(
            "the position ranges over {travel_m:.4} m; by that it may be in {}: give the scale in a column map, position: (..., scale: ...)",
            in_words(&propose_units(Dimension::Length, travel_m), "m")
        ),
    );
    let speed_mps = typical(Quantity::Velocity)?;
    note_above(
        speed_mps,
        MAX_SPEED_MPS,
        true,
        format!(
            "the needle moves at {speed_mps:.4} m/s: position, velocity or time have another unit than SI; give the scale in a column map"
        ),
    );
    let force_n = typical(Quantity::Force)?;
    note_above(
        force_n,
        MAX_FORCE_N,
        // Presses and bone biopsies reach such forces.
        false,
        format!(
            "the force reaches {force_n:.1} N, which is much for a needle; by that it may be in {}: give the scale in a column map, force: (..., scale: ...)",
            in_words(&propose_units(Dimension::Force, force_n), "N")
        ),
    );
    let interval_s = extent.median_interval_s;
    note_above(
        interval_s,
        MAX_INTERVAL_S,
        true,
        format!(
            "the typical sampling interval is {interval_s:.4} s: {}",
            time_unit_remedy(recording.at(Quantity::Time, 0)?, interval_s)
        ),
    );
    notes.extend(velocity_against_position(recording)?);
    Ok(notes)
}

/// What a sampling interval of a second and more (s) may mean, and what to do; the recording begins at `start_s`.
fn time_unit_remedy(start_s: f64, interval_s: f64) -> String {
    // The sample number.
    if (interval_s - 1.0).abs() < 1e-9 && start_s.fract() == 0.0 {
        return "the time looks like the number of the sample; give the rate in a column map: `time` with `scale: 0.005` for 200 Hz"
            .to_owned();
    }
    let units =
        [("milliseconds", "1e-3", 1e-3), ("microseconds", "1e-6", 1e-6), ("nanoseconds", "1e-9", 1e-9)];
    let unit = units.into_iter().find(|(_, _, scale)| USUAL_INTERVAL_S.contains(&(scale * interval_s)));
    unit.map_or_else(
        || "slower than a rupture; record at 50 Hz and more".to_owned(),
        |(name, scale, _)| {
            format!("the time looks like {name}; give a column map with `scale: {scale}` in its `time`")
        },
    )
}

/// The note on a measured velocity whose factor to the slope of the position (least squares) is not near one.
fn velocity_against_position<A: SampleStream>(recording: &A) -> Result<Option<QualityNote>, A::Error> {
    if !recording.velocity_measured() {
        return Ok(None);
    }
    let (mut cross, mut square) = (0.0, 0.0);
    // Measured velocities whose slope is not known yet.
    let mut pending = VecDeque::new();
    let mut compare = |slope: f64, velocity: Option<f64>| {
        if let Some(velocity) = velocity {
            cross += slope * velocity;
            square += slope * slope;
        }
    };
    let mut slopes = SlopeFilter::new(DEFAULT_HALF_WIDTH_S);
    recording.for_each_block(
        [Quantity::Time, Quantity::Position, Quantity::Velocity],
        |[time_s, position_m, velocity_mps]| {
            for ((time_s, position_m), velocity_mps) in time_s.iter().zip(position_m).zip(velocity_mps) {
                pending.push_back(*velocity_mps);
                slopes.push(*time_s, *position_m, |slope| compare(slope, pending.pop_front()));
            }
        },
    )?;
    slopes.finish(|slope| compare(slope, pending.pop_front()));
    let factor = cross / square;
    Ok((square > 0.0 && !(0.5..=2.0).contains(&factor)).then(|| {
        let message = format!(
            "the measured velocity is {factor:.4} times the slope of the position: check the units and signs of both, or leave the velocity out of the \
             column map"
        );
        let note = QualityNote::new(QualityKind::UnitMixUp, message, [("value", factor), ("limit", 2.0)]);
        QualityNote { blocking: !(1.0 / BLOCKING_FACTOR..=BLOCKING_FACTOR).contains(&factor), ..note }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RecordError;
    use crate::recording::Recording;

    /// Three seconds at 100 Hz and 5 mm/s, with units wrong by the given factors.
    fn insertion(time: f64, position: f64, force: f64) -> Result<Recording, RecordError> {
        let time_s: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.01).collect();
        let force_n = time_s.iter().map(|t| t * force).collect();
        let position_m = time_s.iter().map(|t| 0.005 * t * position).collect();
        Recording::new(time_s.iter().map(|t| t * time).collect(), position_m, force_n)
    }

    fn messages(recording: &Recording) -> String {
        let notes = super::super::assess(recording).into_iter();
        notes.filter(|note| note.kind == QualityKind::UnitMixUp).map(|note| note.message + "\n").collect()
    }

    #[test]
    fn an_insertion_in_si_units_has_no_note() -> Result<(), RecordError> {
        assert_eq!(messages(&insertion(1.0, 1.0, 1.0)?), "");
        Ok(())
    }

    #[test]
    fn millimetres_millinewtons_and_milliseconds_are_reported() -> Result<(), RecordError> {
        let millimetres = messages(&insertion(1.0, 1e3, 1.0)?);
        assert!(
            millimetres.contains("may be in mm (scale 0.001") && millimetres.contains("m/s"),
            "{millimetres}"
        );
        assert!(messages(&insertion(1.0, 1.0, -1e3)?).contains("mN (scale 0.001"));
        assert!(messages(&insertion(1e3, 1.0, 1.0)?).contains("looks like milliseconds"));
        Ok(())
    }

    #[test]
    fn a_velocity_of_the_wrong_sign_or_unit_is_reported_and_a_noisy_one_is_not() -> Result<(), RecordError> {
        let si = insertion(1.0, 1.0, 1.0)?;
        let measured = |factor: f64| {
            let velocity_mps =
                si.velocity_mps.iter().enumerate().map(|(i, v)| v * factor + 0.002 * ((i % 2) as f64 - 0.5));
            Recording { velocity_mps: velocity_mps.collect(), velocity_measured: true, ..si.clone() }
        };
        assert_eq!(messages(&measured(1.0)), "");
        assert!(messages(&measured(-1.0)).contains("-1.0"), "{}", messages(&measured(-1.0)));
        assert!(messages(&measured(60.0)).contains("times the slope of the position"));
        Ok(())
    }
}
