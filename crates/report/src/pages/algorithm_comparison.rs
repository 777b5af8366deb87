//! The page of `stylet compare`.

use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::pages::formatting::significant_or_dash;
use stylet_sweep::algorithm_comparison::ComparisonRow;

fn percent(x: f64) -> String {
    significant_or_dash(Some(x), 100.0, 2)
}

/// The page over `seeds` insertions per row: tables of detection, estimates and interval coverage.
#[must_use]
pub fn page(rows: &[ComparisonRow], seeds: u64) -> Page {
    let head = |r: &ComparisonRow| vec![Cell::text(r.scenario.clone()), Cell::text(r.algorithm.clone())];
    let list = |v: &[Option<f64>]| {
        v.iter().map(|x| significant_or_dash(*x, 100.0, 2)).collect::<Vec<_>>().join(" / ")
    };
    let intervals = |v: &[Option<[f64; 2]>]| {
        let one = |x: &Option<[f64; 2]>| {
            x.map_or_else(|| "-".to_owned(), |[low, high]| format!("{} to {}", percent(low), percent(high)))
        };
        v.iter().map(one).collect::<Vec<_>>().join(" / ")
    };
    let detection = rows.iter().map(|r| {
        let [value, low, high] = r.errors_per_rupture;
        let mut cells = head(r);
        cells.push(
            Cell::number(format!("{} / {} of {}", r.missed, r.false_alarms, r.ruptures))
                .status(Status::at_most(value, 0.001, 0.05)),
        );
        cells.push(Cell::number(intervals(&[Some([low, high])])));
        cells.push(Cell::number(format!(
            "{} / {}",
            significant_or_dash(r.delay_s.median, 1e3, 2),
            significant_or_dash(r.delay_s.p95, 1e3, 2)
        )));
        cells
    });
    // Cases of the independent simulator have no true parameters.
    let estimates: Vec<_> =
        rows.iter()
            .filter(|r| r.enhancement_rms_relative.is_some())
            .map(|r| {
                let mut cells = head(r);
                let enhancement = Cell::number(significant_or_dash(r.enhancement_rms_relative, 100.0, 2));
                cells.push(enhancement.status(
                    r.enhancement_rms_relative.map_or(Status::Plain, |x| Status::at_most(x, 0.05, 0.2)),
                ));
                cells.push(Cell::number(intervals(&[r.enhancement_interval])));
                cells.push(Cell::number(significant_or_dash(r.enhancement_with_noise, 100.0, 2)));
                cells.push(Cell::number(list(&r.stiffness_error)));
                cells.push(Cell::number(list(&r.friction_error)));
                cells
            })
            .collect();
    let interval_rows = rows.iter().filter(|r| r.enhancement_rms_relative.is_some()).map(|r| {
        let mut cells = head(r);
        cells.push(Cell::number(intervals(&r.stiffness_error_interval)));
        cells
    });
    let stiffness_intervals = Table::new(
        "95 % intervals of the median stiffness error per layer, in %",
        &["scenario", "algorithm", "stiffness"],
        interval_rows.collect(),
    );
    let calibrated: Vec<_> = rows
        .iter()
        .filter(|r| r.coverage.tip_force.is_some())
        .map(|r| {
            let mut cells = head(r);
            let c = &r.coverage;
            for share in [c.stiffness, c.friction, c.cumulative_friction, c.tip_force] {
                let status = share.map_or(Status::Plain, |x| Status::at_most((x - 0.94).abs(), 0.04, 0.1));
                cells.push(Cell::number(significant_or_dash(share, 100.0, 3)).status(status));
            }
            cells
        })
        .collect();
    let (estimated, has_intervals) = (!estimates.is_empty(), !calibrated.is_empty());
    let ruptures = Table::new(
        "Ruptures missed and false alarms",
        &[
            "scenario",
            "algorithm",
            "missed / false",
            "95 % interval, % of ruptures",
            "delay median / p95, ms",
        ],
        detection.collect(),
    );
    let errors = Table::new(
        "Median errors in %",
        &[
            "scenario",
            "algorithm",
            "enhanced force, noise-free",
            "95 % interval",
            "enhanced force, with noise",
            "stiffness per layer",
            "friction per layer",
        ],
        estimates,
    );
    let covered = Table::new(
        "Coverage of 95 % intervals, in %",
        &["scenario", "algorithm", "stiffness", "friction", "cumulative friction", "tip force"],
        calibrated,
    );
    let mut page = Page::new("Algorithms compared")
        .subtitle(format!("{seeds} noise seeds per scenario; every algorithm processes the same insertions"))
        .fact("version", env!("CARGO_PKG_VERSION"))
        .section(
            Section::new("Ruptures")
                .text(
                    "A rupture counts as found by the first detection from 50 ms before to 1 s after it. The interval is that of \
                     missed plus false per rupture: Wilson's, or a Poisson count's where there are more errors than ruptures.",
                )
                .table(ruptures),
        );
    for (algorithm, [missed, false_alarms, ruptures]) in totals(rows) {
        page = page.fact(algorithm, format!("{missed} missed, {false_alarms} false of {ruptures} ruptures"));
    }
    if estimated {
        page = page.section(
            Section::new("Estimates")
                .text(
                    "Medians over the seeds with 95 % intervals from order statistics. Enhanced force, noise-free: RMS of \
                     estimated minus true friction force, relative to the RMS of the tip force, from first contact to the \
                     deepest point. With noise: the same for the enhanced force itself, sensor noise included.",
                )
                .table(errors)
                .table(stiffness_intervals),
        );
    }
    if has_intervals {
        page = page.section(
            Section::new("Calibration")
                .text(
                    "Share of true values inside the 95 % intervals: over layers and seeds; for the tip force over samples. \
                     Algorithms without intervals are not listed.",
                )
                .table(covered),
        );
    }
    page
}

/// Missed, false and true ruptures of each algorithm summed over all scenarios, in the order of the rows.
fn totals(rows: &[ComparisonRow]) -> Vec<(&str, [usize; 3])> {
    let mut totals: Vec<(&str, [usize; 3])> = Vec::new();
    for r in rows {
        let at = totals.iter().position(|t| t.0 == r.algorithm).unwrap_or(totals.len());
        if at == totals.len() {
            totals.push((&r.algorithm, [0; 3]));
        }
        for (sum, x) in totals[at].1.iter_mut().zip([r.missed, r.false_alarms, r.ruptures]) {
            *sum += x;
        }
    }
    totals
}

#[cfg(test)]
mod tests {
    use super::page;
    use stylet_sweep::algorithm_comparison::{ComparisonRow, DetectionCounts};

    #[test]
    fn a_table_without_true_parameters_has_no_empty_sections() {
        let counts = DetectionCounts { ruptures: 4, missed: 1, ..DetectionCounts::default() };
        let html = page(&[ComparisonRow::new("clean", "Stylet", 2, &counts)], 2).to_html();
        assert!(html.contains("1 / 0 of 4"));
        assert!(!html.contains("Estimates") && !html.contains("Calibration"));
    }

    #[test]
    fn the_page_head_sums_errors_per_algorithm() {
        let counts = |missed, false_alarms| DetectionCounts {
            ruptures: 4,
            missed,
            false_alarms,
            ..DetectionCounts::default()
        };
        let row =
            |scenario: &str, algorithm: &str, counts| ComparisonRow::new(scenario, algorithm, 2, &counts);
        let rows = [
            row("a", "Paper", counts(1, 3)),
            row("a", "Stylet", counts(0, 1)),
            row("b", "Paper", counts(2, 2)),
            row("b", "Stylet", counts(1, 0)),
        ];
        let html = page(&rows, 2).to_html();
        assert!(html.contains("3 missed, 5 false of 8 ruptures"), "{html}");
        assert!(html.contains("1 missed, 1 false of 8 ruptures"), "{html}");
    }
}
