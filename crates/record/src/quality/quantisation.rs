//! Quantisation: values on a coarse grid.

use super::note::{QualityKind, QualityNote};
use crate::sample_stream::SortedValues;

/// Least number of samples.
const MIN_SAMPLES: usize = 100;
/// Most distinct values, as a share of the samples.
const MAX_DISTINCT_SHARE: f64 = 0.2;
/// Least share of steps that are multiples of the smallest one (to 2 % of it).
const MIN_GRID_SHARE: f64 = 0.9;

/// The note on a column whose values lie on a grid; `sorted` are its values in ascending order.
pub(super) fn quantisation<K: SortedValues>(
    sorted: &K,
    what: &str,
    unit: &str,
) -> Result<Option<QualityNote>, K::Error> {
    let samples = sorted.len();
    if samples < MIN_SAMPLES {
        return Ok(None);
    }
    let (mut low, mut high) = (None, f64::NAN);
    sorted.for_each(|x| {
        low.get_or_insert(x);
        high = x;
    })?;
    let whole = high - low.unwrap_or(f64::NAN);
    let steps = |each: &mut dyn FnMut(f64)| {
        let mut kept: Option<f64> = None;
        sorted.for_each(|x| match kept {
            // Values that differ by rounding are one value.
            Some(before) if x - before <= 1e-9 * whole => {}
            before => {
                if let Some(before) = before {
                    each(x - before);
                }
                kept = Some(x);
            }
        })
    };
    let (mut distinct, mut step) = (1_usize, f64::NAN);
    steps(&mut |step_size| {
        distinct += 1;
        step = step.min(step_size);
    })?;
    let ratio = distinct as f64 / samples as f64;
    if distinct < 2 || ratio >= MAX_DISTINCT_SHARE {
        return Ok(None);
    }
    let mut on_grid = 0_usize;
    steps(&mut |step_size| {
        on_grid += usize::from((step_size / step - (step_size / step).round()).abs() < 0.02)
    })?;
    Ok((on_grid as f64 >= MIN_GRID_SHARE * (distinct - 1) as f64).then(|| {
        let message = format!(
            "{what}: the values come in steps of {step:.4e} {unit} ({distinct} different ones in {samples} samples); smaller \
             changes are not resolved"
        );
        let numbers = [("smallest_step", step), ("distinct", distinct as f64), ("distinct_ratio", ratio)];
        QualityNote::new(QualityKind::Quantisation, message, numbers)
    }))
}
