//! The report of a run as one SVG figure, for README pages and papers.

use super::estimate_charts::stiffness_chart;
use super::model::{Combination, RunReport};
use super::time_charts::{force_chart, state_chart};
use crate::chart_model::Chart;
use crate::svg::{FigureOptions, figure};
use stylet_stats::number_format::{percent, significant};

impl RunReport {
    /// Force with all events, detection states and stiffness, stacked, as SVG. An empty title or subtitle is filled from the report.
    #[must_use]
    pub fn to_svg(&self, options: &FigureOptions) -> String {
        let force = Chart { height_px: 330, ..force_chart(self) };
        let rows = u32::try_from(self.combinations.len()).unwrap_or(1).max(1);
        let states = Chart { height_px: 24 * rows, ..state_chart(self) };
        let mut stiffness = Chart { height_px: 150, ..stiffness_chart(self) };
        stiffness.markers.retain(|set| set.name.starts_with("true"));
        let charts: Vec<Chart> =
            [force, states, stiffness].into_iter().filter(|chart| !chart.is_empty()).collect();
        let mut options = options.clone();
        if options.title.is_empty() {
            options.title.clone_from(&self.title);
        }
        if options.subtitle.is_empty() {
            options.subtitle = self.combinations.first().map(summary).unwrap_or_default();
        }
        figure(&charts, &options)
    }
}

/// The score in one line.
fn summary(combination: &Combination) -> String {
    let Some(score) = &combination.score else {
        return format!("{} ruptures detected", combination.detections.len());
    };
    let total = score.ruptures.len();
    let mut parts = vec![format!(
        "{} of {total} ruptures found, {} false",
        total.saturating_sub(score.missed),
        score.false_detections
    )];
    if let Some(delay_s) = score.median_delay_s {
        parts.push(format!("median delay {} ms", significant(delay_s * 1e3, 2)));
    }
    let worst = combination.layers.iter().filter_map(|l| l.stiffness_error).map(f64::abs).reduce(f64::max);
    if let Some(worst) = worst {
        parts.push(format!("stiffness within {}", percent(worst)));
    }
    parts.join(" · ")
}
