//! Failure rates binned over a drawn quantity: the rows of the failure map.

use crate::summary::score_column;
use crate::sweep_file::Sweep;
use crate::trial_row::{Columns, TrialRow};
use crate::trial_table::TrialTable;
use stylet_stats::number_format::significant;
use stylet_stats::{Interval, wilson};

/// Number of bins.
pub const BIN_COUNT: usize = 10;

/// One bin of a drawn quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FailureRateBin {
    /// Median of the quantity in the bin.
    pub middle: f64,
    /// Share of failed insertions with its 95 % interval.
    pub failed: Interval,
}

/// Failure rates in bins of equal size over drawn quantity `quantity`; trials in which the effect of the quantity is off are excluded.
///
/// # Errors
/// When the rows cannot be read.
pub fn failure_rate_bins<T: TrialTable + ?Sized>(
    sweep: &Sweep,
    columns: &Columns,
    rows: &T,
    quantity: usize,
) -> Result<Vec<FailureRateBin>, T::Error> {
    let switch = sweep
        .fields
        .get(quantity)
        .and_then(|f| f.effect_index())
        .and_then(|e| e.checked_sub(sweep.scenario_effects))
        .map(|e| sweep.fields.len() + e);
    let on = switch.map(|switch| rows.column(switch)).transpose()?;
    let mut kept: Vec<usize> =
        (0..rows.count()).filter(|place| on.as_ref().is_none_or(|on| on[*place] > 0.0)).collect();
    let along = rows.column(quantity)?;
    kept.sort_by(|&a, &b| along[a].total_cmp(&along[b]).then(a.cmp(&b)));
    let (missed, alarms) = (score_column(columns, rows, "missed")?, score_column(columns, rows, "false")?);
    let size = kept.len().div_ceil(BIN_COUNT).max(1);
    let bin = |chunk: &[usize]| {
        let hits = chunk.iter().filter(|&&place| missed[place] > 0.0 || alarms[place] > 0.0).count();
        FailureRateBin { middle: along[chunk[chunk.len() / 2]], failed: wilson(hits, chunk.len()) }
    };
    Ok(kept.chunks(size).map(bin).collect())
}

/// A row of the failure map.
#[derive(Clone, Debug, PartialEq)]
pub struct FailureMapRow {
    /// Quantity with its range.
    pub name: String,
    /// Share of failed insertions per bin, in %.
    pub failed_percent: Vec<f64>,
}

/// The rows of the failure map of a sweep, one per drawn quantity that is not constant.
#[must_use]
pub fn failure_map_rows(sweep: &Sweep, columns: &Columns, rows: &[TrialRow]) -> Vec<FailureMapRow> {
    (0..sweep.fields.len())
        .filter_map(|quantity| {
            let Ok(bins) = failure_rate_bins(sweep, columns, rows, quantity);
            let (first, last) = (bins.first()?, bins.last()?);
            if first.middle == last.middle {
                return None; // a constant
            }
            let path = name(sweep, quantity);
            Some(FailureMapRow {
                name: format!("{path}  {} … {}", significant(first.middle, 2), significant(last.middle, 2)),
                failed_percent: bins.iter().map(|b| (100.0 * b.failed.value).round()).collect(),
            })
        })
        .collect()
}

/// Short label of a quantity; that of an effect starts with the effect's id.
fn name(sweep: &Sweep, quantity: usize) -> String {
    use stylet_tissue::Effect;
    let Some(field) = sweep.fields.get(quantity) else { return String::new() };
    match field.effect_index().and_then(|e| sweep.template.effects.get(e)) {
        Some(effect) => {
            let last = field.path().rsplit('.').next().unwrap_or_default();
            format!("{} {last}", effect.id())
        }
        None => {
            let path = field.path();
            let short =
                ["tissue.", "enhance.", "motion.", "sensor."].iter().find_map(|p| path.strip_prefix(p));
            short.unwrap_or(path).to_owned()
        }
    }
}
