//! The page of `stylet benchmark judge-online`.

use crate::chart_model::{Chart, Series};
use crate::page_model::{Cell, Page, Section, Status, Table};
use crate::pages::formatting::significant_or_dash;
use crate::palette::Colour;
use stylet_examine::online::measured_stream::{MEASURED_DESCRIPTION, MEASURED_ROW};
use stylet_examine::online::stream_id::Row;
use stylet_examine::online::stream_scores::{EntrantScore, Rate, StreamScore, is_first};

/// Colours of the curves, in the order of the table.
const COLOURS: [Colour; 7] = [
    Colour::Blue,
    Colour::Vermillion,
    Colour::Green,
    Colour::Purple,
    Colour::Orange,
    Colour::SkyBlue,
    Colour::Grey,
];

fn percent(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), |x| format!("{:.1}", 100.0 * x))
}

/// A table of one rate, a line per row and a column per detector; those as good as the best are marked.
fn rate_table(title: &str, scores: &[EntrantScore], rate: impl Fn(&StreamScore) -> Rate) -> Table {
    let mut headers = vec!["row"];
    headers.extend(scores.iter().map(|s| s.entrant.as_str()));
    let count = scores.first().map_or(0, |s| s.rows.len());
    let lines = (0..=count)
        .map(|k| {
            let of = |s: &'_ EntrantScore| rate(s.rows.get(k).unwrap_or(&s.all));
            let best = scores.iter().filter_map(|s| of(s).value).fold(0.0, f64::max);
            let name = scores.first().map_or("", |s| s.rows.get(k).unwrap_or(&s.all).row.as_str());
            let mut cells = vec![Cell::text(name)];
            cells.extend(scores.iter().map(|s| {
                let rate = of(s);
                let good = rate.value.is_some() && is_first(&rate, best);
                Cell::number(percent(rate.value)).status(if good { Status::Good } else { Status::Plain })
            }));
            cells
        })
        .collect();
    Table::new(title, &headers, lines)
}

fn summary_table(scores: &[EntrantScore]) -> Table {
    let interval =
        |r: &Rate| format!("{} ({} to {})", percent(r.value), percent(Some(r.low)), percent(Some(r.high)));
    let lines = scores
        .iter()
        .map(|s| {
            let a = &s.all;
            vec![
                Cell::text(&s.entrant),
                Cell::number(interval(&a.precision)),
                Cell::number(interval(&a.recall)),
                Cell::number(format!("{} / {} of {}", a.missed, a.false_alarms, a.punctures)),
                Cell::number(significant_or_dash(Some(a.false_per_hour), 1.0, 3)),
                Cell::number(percent(s.recall_at_one_per_hour)),
                Cell::number(format!(
                    "{} / {}",
                    significant_or_dash(a.delay_s[0], 1e3, 2),
                    significant_or_dash(a.delay_s[1], 1e3, 2)
                )),
                Cell::number(percent(a.drop_error)),
                Cell::number(percent(a.enhancement_error)),
                Cell::number(significant_or_dash(s.ns_per_sample, 1.0, 2)),
            ]
        })
        .collect();
    Table::new(
        "All rows",
        &[
            "detector",
            "precision, %",
            "recall, %",
            "missed / false",
            "false per hour",
            "recall at 1 false per hour, %",
            "delay median / p95, ms",
            "error of the drop, %",
            "error of the tip force, %",
            "ns per sample",
        ],
        lines,
    )
}

/// A quantity over false alarms per hour, one curve per detector with a confidence.
fn curve_chart(
    scores: &[EntrantScore],
    y_label: &str,
    y: impl Fn(&EntrantScore, usize) -> Option<f64>,
) -> Chart {
    let mut chart = Chart::new(y_label, "False alarms per hour, log10", y_label);
    chart.parametric = true;
    for (k, s) in scores.iter().filter(|s| !s.curve.is_empty()).enumerate() {
        let points: Vec<(f64, f64)> = (0..s.curve.len())
            .filter_map(|i| Some((libm::log10(s.curve[i].false_per_hour.max(0.1)), y(s, i)?)))
            .collect();
        let (x, y) = points.into_iter().unzip();
        chart = chart.with_series(Series::line(&s.entrant, COLOURS[k % COLOURS.len()], x, y));
    }
    chart.height_px = 360;
    chart
}

/// The page: tables by row, sums, and the curves of the swept thresholds.
#[must_use]
pub fn page(scores: &[EntrantScore]) -> Page {
    let all = scores.first().map(|s| s.all.clone()).unwrap_or_default();
    let described = Row::ALL.iter().map(|r| (r.as_str(), r.description()));
    let rows = described
        .chain([(MEASURED_ROW, MEASURED_DESCRIPTION)])
        .filter(|(row, _)| scores.iter().any(|s| s.rows.iter().any(|x| x.row == *row)))
        .map(|(row, description)| vec![Cell::text(row), Cell::text(description)])
        .collect();
    let delay = curve_chart(scores, "Median delay, ms", |s, i| s.curve[i].delay_s.map(|d| 1e3 * d));
    let recall =
        curve_chart(scores, "Share of the punctures found, %", |s, i| Some(100.0 * s.curve[i].recall));
    Page::new("Online detection of punctures")
        .subtitle(format!(
            "{} streams, {:.1} hours, {} punctures; every detector is given the same samples one by one",
            all.streams, all.hours, all.punctures
        ))
        .fact("version", env!("CARGO_PKG_VERSION"))
        .section(
            Section::new("All rows")
                .text(
                    "An event belongs to a puncture if it comes from 50 ms before to 1 s after it; every other one is a false alarm. \
                     Intervals are 95 % (Wilson).",
                )
                .table(summary_table(scores))
                .chart(recall)
                .chart(delay)
                .text("Curves: a threshold on the confidence that the detector gives with its events; a detector without one has no curve."),
        )
        .section(
            Section::new("By row")
                .text("F1 in %. Marked: the best of the row, and those whose 95 % interval holds the best value.")
                .table(rate_table("The needle has moved by at most 0.5 mm since the puncture", scores, |s| s.f1_half_mm))
                .table(rate_table("The event comes within 50 ms", scores, |s| s.f1_50ms))
                .table(rate_table("The event comes within 1 s", scores, |s| s.f1))
                .table(Table::new("Rows: simulated ones with three amounts, in equal numbers", &["row", "what it is"], rows)),
        )
}

#[cfg(test)]
mod tests {
    use super::page;
    use stylet_examine::World;
    use stylet_examine::online::event_matching::Event;
    use stylet_examine::online::simulate_stream::simulate_stream;
    use stylet_examine::online::stream_id::{Row, Split, stream_ids};
    use stylet_examine::online::stream_scores::{EntrantAnswers, score_entrant};

    #[test]
    fn the_page_has_a_column_per_detector_and_a_curve_where_there_is_a_confidence() {
        let ids = stream_ids(World::Plain, &[Row::Hold], Split::Make, 2, 1);
        let streams: Vec<_> = ids.iter().map(|id| (id.index.to_string(), simulate_stream(id))).collect();
        let events = streams.iter().map(|(number, stream)| {
            let event = |p: &stylet_examine::online::simulate_stream::TruePuncture| Event {
                time_s: p.time_s,
                drop_n: Some(p.drop_n),
                confidence: Some(p.drop_n),
            };
            (number.clone(), stream.punctures.iter().map(event).collect())
        });
        let perfect = EntrantAnswers {
            name: "perfect".to_owned(),
            events: events.collect(),
            ..EntrantAnswers::default()
        };
        let silent = EntrantAnswers { name: "silent".to_owned(), ..EntrantAnswers::default() };
        let scores = [score_entrant(&streams, &perfect), score_entrant(&streams, &silent)];
        let html = page(&scores).to_html();
        assert!(html.contains("perfect") && html.contains("silent") && html.contains("100.0"), "{html}");
        assert!(html.contains("hold"));
    }
}
