//! Saturation: the force is constant at its extreme value.

use super::constant_runs::for_each_constant_run;
use super::extent::Extent;
use super::note::{QualityKind, QualityNote};
use crate::sample_stream::SampleStream;

/// Least length of a run of equal extremes that counts.
const SHORT_RUN: usize = 5;
/// Least length of a single run.
const LONG_RUN: usize = 20;
/// Least motion during a single run, as a share of the total travel.
const MIN_MOTION_SHARE: f64 = 0.01;

pub(super) fn saturation<A: SampleStream>(
    recording: &A,
    extent: &Extent,
) -> Result<Vec<QualityNote>, A::Error> {
    let (low, high) = extent.force_n;
    let mut notes = Vec::new();
    if low == high {
        return Ok(notes);
    }
    for (which, value) in [("largest", high), ("smallest", low)] {
        if value != 0.0 {
            notes.extend(saturated_at(recording, which, value, extent)?);
        }
    }
    Ok(notes)
}

fn saturated_at<A: SampleStream>(
    recording: &A,
    which: &str,
    value: f64,
    extent: &Extent,
) -> Result<Option<QualityNote>, A::Error> {
    let travel_m = extent.position_m.1 - extent.position_m.0;
    let (mut stretches, mut samples, mut all, mut longest, mut at_s, mut moved) =
        (0_u32, 0, 0, 0, 0.0, false);
    for_each_constant_run(recording, |run| {
        if run.force_n != value {
            return;
        }
        all += run.samples;
        if run.samples >= SHORT_RUN {
            stretches += 1;
            samples += run.samples;
        }
        if run.samples >= LONG_RUN {
            moved |= run.position_range_m.1 - run.position_range_m.0 > MIN_MOTION_SHARE * travel_m;
        }
        if run.samples > longest {
            (longest, at_s) = (run.samples, run.start_s);
        }
    })?;
    let several = stretches >= 2 && 2 * samples > all;
    Ok((several || moved).then(|| {
        let message = format!(
            "the force stays at its {which} value {value:.4} N in {stretches} run(s) of five or more samples (the longest: \
             {longest}, from t = {at_s:.4} s): the sensor is probably saturated there"
        );
        let numbers = [
            ("value", value),
            ("runs", f64::from(stretches)),
            ("samples", samples as f64),
            ("longest", longest as f64),
            ("at_s", at_s),
        ];
        QualityNote::new(QualityKind::Saturation, message, numbers)
    }))
}
