//! The page of a sweep, and the map of failure rates over all drawn quantities as a picture.

use crate::chart_model::{Chart, Series};
use crate::page_model::{Cell, Page, Section, Status, Table, Tile};
use crate::pages::formatting::significant_or_dash;
use crate::palette::Colour;
use crate::svg::{Bar, BarChart, FigureOptions, HeatMap, bar_chart, heat_map};
use stylet_stats::Interval;
use stylet_stats::number_format::{percent, significant};
use stylet_sweep::{
    BIN_COUNT, Columns, FailureMapRow, FailureRateBin, OutcomeSensitivity, Summary, Sweep, TrialTable,
    failure_rate_bins, score_value,
};

fn interval_text(i: &Interval) -> String {
    format!("95 % interval {} to {}", percent(i.low), percent(i.high))
}

/// The page of a sweep: rates, failures along each drawn quantity, sensitivities, worst trials, all scores.
///
/// # Errors
/// When the rows cannot be read.
pub fn page<T: TrialTable + ?Sized>(
    sweep: &Sweep,
    columns: &Columns,
    rows: &T,
    summary: &Summary,
) -> Result<Page, T::Error> {
    let mut page = Page::new(format!("Sweep: {}", summary.sweep))
        .subtitle(format!("{} trials of {}", summary.trials, summary.scenario))
        .fact("seed", summary.seed.to_string())
        .fact("sampling", summary.sampling.clone())
        .fact("version", summary.version.clone())
        .fact("identity", summary.identity.chars().take(16).collect::<String>());
    if summary.redrawn > 0 {
        page = page.fact("redrawn", format!("{} trials whose first draw was out of range", summary.redrawn));
    }
    let page = page
        .section(Section::new("Rates").tiles(rate_tiles(summary)))
        .section(failures_by_quantity(sweep, columns, rows)?)
        .section(sensitivities(&summary.explained))
        .section(worst_trials(summary))
        .section(Section::new("Scores").table(scores(summary)))
        .section(Section::new("Definition of the sweep").folded("sweep.ron", sweep.to_ron()));
    Ok(page)
}

fn rate_tiles(s: &Summary) -> Vec<Tile> {
    let rate = |label: &str, i: &Interval| {
        Tile::new(label, percent(i.value), interval_text(i)).status(Status::at_most(i.value, 0.01, 0.05))
    };
    let mut tiles = vec![
        rate("insertions with an error", &s.failed),
        rate("ruptures missed", &s.missed),
        rate("insertions with a false alarm", &s.trials_with_false),
        Tile::new(
            "false alarms",
            s.false_alarms.to_string(),
            format!("in {} insertions with {} ruptures", s.trials, s.ruptures),
        ),
    ];
    for (score, label) in
        [("enhancement.rms_relative", "enhancement error"), ("reconstruction_rms_n", "reconstruction error")]
    {
        if let Some(found) = s.scores.iter().find(|f| f.score == score) {
            let unit = if score.ends_with("_n") { " N" } else { "" };
            let show = |x: f64| if unit.is_empty() { percent(x) } else { significant(x, 3) + unit };
            tiles.push(Tile::new(
                label,
                show(found.median.value),
                format!("median; p95 {}", show(found.p95.value)),
            ));
        }
    }
    tiles
}

fn worst_trials(s: &Summary) -> Section {
    let mut headers =
        vec!["trial".to_owned(), "missed".to_owned(), "false".to_owned(), "enhancement".to_owned()];
    // Only the quantities with the largest sensitivity, so that the table fits the page.
    let shown: Vec<usize> = match s.explained.first() {
        Some(outcome) => {
            outcome.by.iter().take(6).filter_map(|e| s.drawn.iter().position(|d| *d == e.quantity)).collect()
        }
        None => (0..s.drawn.len().min(6)).collect(),
    };
    headers.extend(shown.iter().map(|i| s.drawn[*i].clone()));
    headers.push("replay".to_owned());
    let rows = s
        .worst
        .iter()
        .map(|w| {
            let mut row = vec![
                Cell::text(w.trial.to_string()),
                Cell::number(w.missed.to_string()),
                Cell::number(w.false_alarms.to_string()),
                Cell::number(w.enhancement.map_or("-".to_owned(), percent)),
            ];
            row.extend(shown.iter().map(|i| Cell::number(significant(w.drawn[*i], 4))));
            row.push(Cell::text(w.replay.clone()));
            row
        })
        .collect();
    Section::new("Worst trials").table(Table { headers, rows, ..Table::default() })
}

fn sensitivities(outcomes: &[OutcomeSensitivity]) -> Section {
    let mut section = Section::new("Sensitivity");
    if outcomes.is_empty() {
        return section;
    }
    section = section.text(
        "First-order Sobol index: the share of the outcome's variance explained by its mean given one quantity, estimated \
         in groups of equal size along the quantity and corrected for chance. Rank correlation: Spearman's, with its \
         two-sided p-value. An index well above the squared correlation indicates a dependence that is not monotonic; \
         indices that sum to far less than one indicate interactions or noise.",
    );
    for outcome in outcomes {
        let bars = outcome.by.iter().take(12).filter_map(|e| {
            let value = e.first_order?;
            Some(Bar { name: e.quantity.clone(), value, interval: None, colour: Colour::Blue })
        });
        let chart = BarChart { label: "first-order Sobol index".to_owned(), bars: bars.collect() };
        let title = outcome.outcome.clone();
        let options = FigureOptions { title: title.clone(), ..FigureOptions::default() };
        section =
            section.picture(title.clone(), bar_chart(&chart, &options)).table(sensitivity_table(outcome));
    }
    section
}

fn sensitivity_table(outcome: &OutcomeSensitivity) -> Table {
    let number = |x: Option<f64>| significant_or_dash(x, 1.0, 3);
    Table::new(
        outcome.outcome.clone(),
        &["quantity", "first-order index", "rank correlation", "p-value"],
        outcome
            .by
            .iter()
            .map(|e| {
                vec![
                    Cell::text(e.quantity.clone()),
                    Cell::number(number(e.first_order)),
                    Cell::number(number(e.rank_correlation)),
                    Cell::number(match e.p_value {
                        Some(p) if p < 1e-15 => "< 1e-15".to_owned(),
                        p => number(p),
                    }),
                ]
            })
            .collect(),
    )
}

fn scores(s: &Summary) -> Table {
    let cell = |x: f64| Cell::number(significant(x, 3));
    let range =
        |i: &Interval| Cell::number(format!("{} to {}", significant(i.low, 3), significant(i.high, 3)));
    Table::new(
        "Medians and 95th percentiles with 95 % intervals from order statistics; relative errors as fractions",
        &["score", "trials", "median", "interval", "p95", "interval", "worst", "in trial"],
        s.scores
            .iter()
            .map(|x| {
                vec![
                    Cell::text(x.score.clone()),
                    Cell::number(x.trials.to_string()),
                    cell(x.median.value),
                    range(&x.median),
                    cell(x.p95.value),
                    range(&x.p95),
                    cell(x.worst),
                    Cell::number(x.worst_trial.to_string()),
                ]
            })
            .collect(),
    )
}

/// The share of failed insertions, and the enhancement error, over the drawn quantities (at most 12).
fn failures_by_quantity<T: TrialTable + ?Sized>(
    sweep: &Sweep,
    columns: &Columns,
    rows: &T,
) -> Result<Section, T::Error> {
    let mut section = Section::new("Failures by drawn quantity");
    for (index, quantity) in columns.drawn.iter().take(sweep.fields.len()).enumerate().take(12) {
        let bins = failure_rate_bins(sweep, columns, rows, index)?;
        if bins.len() < 2 {
            continue;
        }
        let x: Vec<f64> = bins.iter().map(|b| b.middle).collect();
        let line = |f: fn(&FailureRateBin) -> f64| bins.iter().map(f).map(|y| 100.0 * y).collect::<Vec<_>>();
        let mut chart =
            Chart::new(format!("Failed insertions by {quantity}"), quantity.clone(), "insertions (%)")
                .with_series(Series::line("failed", Colour::Vermillion, x.clone(), line(|b| b.failed.value)))
                .with_series(
                    Series::line("95 % low", Colour::Grey, x.clone(), line(|b| b.failed.low)).width(1.0),
                )
                .with_series(Series::line("95 % high", Colour::Grey, x, line(|b| b.failed.high)).width(1.0));
        chart.y_range = Some((0.0, 100.0));
        section = section.chart(chart);
    }
    if let Some(first) = columns.drawn.first() {
        let mut pairs: Vec<(f64, f64)> = Vec::new();
        for place in 0..rows.count().min(2000) {
            let row = rows.row(place)?;
            pairs.push((row.values[0], score_value(columns, &row, "enhancement.rms_relative")));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let (x, y) = pairs.into_iter().unzip();
        let mut chart = Chart::new("Enhancement error", first.clone(), "relative error")
            .caption("RMS of enhanced minus true tip force, relative to the RMS of the tip force; one point per trial, at most 2000.")
            .with_series(Series::points("trials", Colour::Blue, x, y).width(2.0));
        chart.scale = crate::chart_model::Scale::Log;
        section = section.chart(chart);
    }
    Ok(section)
}

/// Title of [`failure_map_svg`].
pub const MAP_TITLE: &str = "Where the algorithm fails";

/// The map of failure rates as SVG: one row per drawn quantity, one column per tenth of its values.
#[must_use]
pub fn failure_map_svg(rows: &[FailureMapRow]) -> String {
    let map = HeatMap {
        row_label: String::new(),
        column_label: "tenth of the drawn values, in ascending order".to_owned(),
        rows: rows.iter().map(|r| r.name.clone()).collect(),
        columns: (1..=BIN_COUNT).map(|i| i.to_string()).collect(),
        values: rows.iter().map(|r| r.failed_percent.clone()).collect(),
        values_are_fractions: false,
    };
    heat_map(
        &map,
        &FigureOptions {
            title: MAP_TITLE.to_owned(),
            subtitle: "insertions with a missed or false rupture, in %; blank: none".to_owned(),
            ..FigureOptions::default()
        },
    )
}
