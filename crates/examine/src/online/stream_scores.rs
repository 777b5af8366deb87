//! Scores of a detector over the streams of a row, and over all rows.

use super::event_matching::{Event, Window, match_events, uncounted_events};
use super::simulate_stream::Stream;
use super::stream_id::Row;
use core::fmt::Write as _;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_stats::{Z95, wilson};

/// Most thresholds of a curve.
const THRESHOLDS: usize = 40;
/// Rate of false alarms per hour at which the recall is stated.
const STATED_PER_HOUR: f64 = 1.0;

/// Answers of a detector by stream number.
#[derive(Clone, Debug, Default)]
pub struct EntrantAnswers {
    /// Name of the detector.
    pub name: String,
    /// Events in the order of time.
    pub events: BTreeMap<String, Vec<Event>>,
    /// Relative RMS error of its tip force, for streams for which it gave one.
    pub enhancement: BTreeMap<String, f64>,
    /// Time per sample, with the way through the pipe, in ns.
    pub ns_per_sample: Option<f64>,
}

/// Value with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    /// Value; `null` where nothing was counted.
    pub value: Option<f64>,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Rate {
    fn of(hits: usize, of: usize) -> Self {
        let interval = wilson(hits, of);
        Self { value: (of > 0).then(|| hits as f64 / of as f64), low: interval.low, high: interval.high }
    }

    /// F1 from hits, false alarms and misses. Its interval is that of the binomial share of hits among all three, of which F1 is a
    /// monotone function.
    fn f1(hits: usize, events: usize, punctures: usize) -> Self {
        let share = Self::of(hits, events + punctures - hits);
        let f1 = |x: f64| 2.0 * x / (1.0 + x);
        Self { value: share.value.map(f1), low: f1(share.low), high: f1(share.high) }
    }
}

/// Scores at a threshold of the confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Events below it are left out.
    pub threshold: f64,
    /// False alarms per hour.
    pub false_per_hour: f64,
    /// Share of the punctures that are found.
    pub recall: f64,
    /// Median delay of these in s.
    pub delay_s: Option<f64>,
    /// F1.
    pub f1: f64,
}

/// Scores over some streams.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StreamScore {
    /// Row; `all` for the sum.
    pub row: String,
    /// Number of streams.
    pub streams: usize,
    /// Duration of all of them in hours.
    pub hours: f64,
    /// Punctures in them.
    pub punctures: usize,
    /// Events reported, without further ones while a layer still tears and those at possible punctures of recordings.
    pub events: usize,
    /// Punctures without an event from 50 ms before to 1 s after them.
    pub missed: usize,
    /// Of these events, those without a puncture.
    #[serde(rename = "false")]
    pub false_alarms: usize,
    /// Share of the events that belong to a puncture.
    pub precision: Rate,
    /// Share of the punctures that are found.
    pub recall: Rate,
    /// F1 of these two.
    pub f1: Rate,
    /// F1 where an event has to come within 50 ms.
    pub f1_50ms: Rate,
    /// F1 where the needle may have moved by at most 0.5 mm.
    pub f1_half_mm: Rate,
    /// False alarms per hour.
    pub false_per_hour: f64,
    /// Median and 95th percentile of the delay in s.
    pub delay_s: [Option<f64>; 2],
    /// Median error of the reported drop over the true one.
    pub drop_error: Option<f64>,
    /// Median over streams of the RMS error of the tip force over its RMS.
    pub enhancement_error: Option<f64>,
}

/// A detector's scores.
#[derive(Clone, Debug, Serialize)]
pub struct EntrantScore {
    /// Name.
    pub entrant: String,
    /// By row.
    pub rows: Vec<StreamScore>,
    /// Over all rows.
    pub all: StreamScore,
    /// Over all rows, for thresholds of the confidence; empty for a detector that gives none.
    pub curve: Vec<CurvePoint>,
    /// The threshold with the best F1.
    pub best_threshold: Option<f64>,
    /// The largest recall at no more than one false alarm per hour.
    pub recall_at_one_per_hour: Option<f64>,
    /// Time per sample, with the way through the pipe, in ns.
    pub ns_per_sample: Option<f64>,
}

/// Counts over streams.
#[derive(Default)]
struct Counts {
    streams: usize,
    seconds: f64,
    punctures: usize,
    events: usize,
    found: usize,
    within_50ms: usize,
    within_half_mm: usize,
    delays_s: Vec<f64>,
    drop_errors: Vec<f64>,
    enhancement: Vec<f64>,
}

impl Counts {
    fn add(&mut self, stream: &Stream, events: &[Event]) {
        self.streams += 1;
        self.seconds += stream.duration_s();
        self.punctures += stream.punctures.len();
        self.events += events.len() - uncounted_events(stream, events);
        let hits = |window| match_events(stream, events, window);
        self.within_50ms += hits(Window::Within50ms).iter().flatten().count();
        self.within_half_mm += hits(Window::WithinHalfMillimetre).iter().flatten().count();
        for (puncture, hit) in stream.punctures.iter().zip(hits(Window::Found)) {
            let Some(event) = hit.and_then(|k| events.get(k)) else { continue };
            self.found += 1;
            self.delays_s.push(event.time_s - puncture.time_s);
            if let Some(drop_n) = event.drop_n {
                self.drop_errors.push((drop_n - puncture.drop_n).abs() / puncture.drop_n);
            }
        }
    }

    fn false_per_hour(&self) -> f64 {
        if self.seconds > 0.0 { (self.events - self.found) as f64 * 3600.0 / self.seconds } else { 0.0 }
    }

    fn score(mut self, row: &str) -> StreamScore {
        StreamScore {
            row: row.to_owned(),
            streams: self.streams,
            hours: self.seconds / 3600.0,
            punctures: self.punctures,
            events: self.events,
            missed: self.punctures - self.found,
            false_alarms: self.events - self.found,
            precision: Rate::of(self.found, self.events),
            recall: Rate::of(self.found, self.punctures),
            f1: Rate::f1(self.found, self.events, self.punctures),
            f1_50ms: Rate::f1(self.within_50ms, self.events, self.punctures),
            f1_half_mm: Rate::f1(self.within_half_mm, self.events, self.punctures),
            false_per_hour: self.false_per_hour(),
            delay_s: [quantile(&mut self.delays_s, 0.5), quantile(&mut self.delays_s, 0.95)],
            drop_error: quantile(&mut self.drop_errors, 0.5),
            enhancement_error: quantile(&mut self.enhancement, 0.5),
        }
    }
}

/// The quantile; `None` without values.
fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    (!values.is_empty()).then(|| stylet_stats::quantile(values, share))
}

/// Scores a detector's answers to these streams, given with their numbers.
#[must_use]
pub fn score_entrant(streams: &[(String, Stream)], answers: &EntrantAnswers) -> EntrantScore {
    let none = Vec::new();
    let events = |number: &String| answers.events.get(number).unwrap_or(&none);
    let mut rows: Vec<(&str, Counts)> = Vec::new();
    let mut all = Counts::default();
    for (number, stream) in streams {
        let row = stream.row;
        let at = rows.iter().position(|r| r.0 == row).unwrap_or_else(|| {
            rows.push((row, Counts::default()));
            rows.len() - 1
        });
        for counts in [&mut rows[at].1, &mut all] {
            counts.add(stream, events(number));
            counts.enhancement.extend(answers.enhancement.get(number));
        }
    }
    // Measured streams, which are no row of the simulator, come last.
    rows.sort_by_key(|(row, _)| Row::parse(row).map_or(Row::ALL.len(), |row| row as usize));
    let curve: Vec<CurvePoint> = thresholds(answers)
        .into_iter()
        .map(|threshold| {
            let mut counts = Counts::default();
            for (number, stream) in streams {
                let kept: Vec<Event> = events(number)
                    .iter()
                    .copied()
                    .filter(|e| e.confidence.is_none_or(|c| c >= threshold))
                    .collect();
                counts.add(stream, &kept);
            }
            CurvePoint {
                threshold,
                false_per_hour: counts.false_per_hour(),
                recall: counts.found as f64 / counts.punctures.max(1) as f64,
                delay_s: quantile(&mut counts.delays_s, 0.5),
                f1: Rate::f1(counts.found, counts.events, counts.punctures).value.unwrap_or(0.0),
            }
        })
        .collect();
    let best = curve.iter().max_by(|a, b| a.f1.total_cmp(&b.f1)).map(|p| p.threshold);
    let quiet = curve.iter().filter(|p| p.false_per_hour <= STATED_PER_HOUR).map(|p| p.recall);
    EntrantScore {
        entrant: answers.name.clone(),
        rows: rows.into_iter().map(|(row, counts)| counts.score(row)).collect(),
        all: all.score("all"),
        best_threshold: best,
        recall_at_one_per_hour: quiet.max_by(f64::total_cmp),
        curve,
        ns_per_sample: answers.ns_per_sample,
    }
}

/// Thresholds at evenly spaced ranks of the confidences.
fn thresholds(answers: &EntrantAnswers) -> Vec<f64> {
    let mut all: Vec<f64> =
        answers.events.values().flatten().filter_map(|e| e.confidence).filter(|c| c.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let count = all.len().min(THRESHOLDS);
    let mut out: Vec<f64> = (0..count).map(|k| all[k * all.len() / count]).collect();
    out.dedup();
    out
}

/// Whether a detector is not significantly worse than the best of a row: the best value lies within its interval.
#[must_use]
pub fn is_first(rate: &Rate, best: f64) -> bool {
    rate.high >= best
}

/// The table as text: F1 within 0.5 mm by row and entrant, and the sums.
#[must_use]
pub fn scores_text(scores: &[EntrantScore]) -> String {
    let mut out = String::new();
    let percent = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{:.1}", 100.0 * x));
    let ms = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{:.0}", 1e3 * x));
    let _ = writeln!(
        out,
        "F1 within 0.5 mm in %, by row; * first or within its 95 % interval of the first (z = {Z95:.2})\n"
    );
    let _ = write!(out, "{:18}", "row");
    let width = scores.iter().map(|s| s.entrant.len()).max().unwrap_or(0).max(7) + 2;
    for score in scores {
        let _ = write!(out, "{:>width$}", score.entrant);
    }
    out.push('\n');
    let rows = scores.first().map_or(0, |s| s.rows.len());
    for k in 0..=rows {
        let of = |s: &EntrantScore| s.rows.get(k).unwrap_or(&s.all).clone();
        let best = scores.iter().filter_map(|s| of(s).f1_half_mm.value).fold(0.0, f64::max);
        let _ = write!(out, "{:18}", scores.first().map_or(String::new(), |s| of(s).row));
        for score in scores {
            let f1 = of(score).f1_half_mm;
            let mark = if f1.value.is_some() && is_first(&f1, best) { "*" } else { " " };
            let _ = write!(out, "{:>width$}", format!("{}{mark}", percent(f1.value)));
        }
        out.push('\n');
    }
    let _ = writeln!(
        out,
        "\n{:width$}{:>10}{:>9}{:>9}{:>9}{:>9}{:>12}{:>14}{:>12}{:>12}{:>11}",
        "all rows",
        "punctures",
        "missed",
        "false",
        "F1",
        "F1 50ms",
        "delay ms",
        "recall, 1/h",
        "drop err %",
        "tip err %",
        "ns/sample"
    );
    for s in scores {
        let all = &s.all;
        let _ = writeln!(
            out,
            "{:width$}{:>10}{:>9}{:>9}{:>9}{:>9}{:>12}{:>14}{:>12}{:>12}{:>11}",
            s.entrant,
            all.punctures,
            all.missed,
            all.false_alarms,
            percent(all.f1.value),
            percent(all.f1_50ms.value),
            format!("{} / {}", ms(all.delay_s[0]), ms(all.delay_s[1])),
            percent(s.recall_at_one_per_hour),
            percent(all.drop_error),
            percent(all.enhancement_error),
            s.ns_per_sample.map_or_else(|| "-".to_owned(), |x| format!("{x:.0}")),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::simulate_stream::simulate_stream;
    use super::super::stream_id::{Row, Split, stream_ids};
    use super::*;
    use crate::cases::case_id::World;

    fn streams() -> Vec<(String, Stream)> {
        let ids = stream_ids(World::Plain, &[Row::Constant, Row::Hold], Split::Make, 3, 9);
        ids.iter().enumerate().map(|(k, id)| (format!("{k:04}"), simulate_stream(id))).collect()
    }

    /// Every puncture 20 ms late with confidence 0.9, and one false alarm per stream with 0.1.
    fn answers(streams: &[(String, Stream)]) -> EntrantAnswers {
        let events = |stream: &Stream| {
            let event = |time_s, confidence| Event { time_s, drop_n: None, confidence: Some(confidence) };
            let hits = stream.punctures.iter().map(|p| event(p.time_s + 0.02, 0.9));
            [event(0.1, 0.1)].into_iter().chain(hits).collect()
        };
        EntrantAnswers {
            name: "late".to_owned(),
            events: streams.iter().map(|(n, s)| (n.clone(), events(s))).collect(),
            ..EntrantAnswers::default()
        }
    }

    #[test]
    fn every_false_alarm_counts_and_a_threshold_on_the_confidence_removes_them() {
        let streams = streams();
        let score = score_entrant(&streams, &answers(&streams));
        assert_eq!(score.rows.iter().map(|r| r.row.as_str()).collect::<Vec<_>>(), ["constant", "hold"]);
        assert_eq!((score.all.missed, score.all.false_alarms), (0, 6));
        assert!((score.all.delay_s[0].unwrap_or(0.0) - 0.02).abs() < 1e-9);
        let f1 = score.all.f1_50ms.value.unwrap_or(0.0);
        let n = score.all.punctures as f64;
        assert!((f1 - 2.0 * n / (2.0 * n + 6.0)).abs() < 1e-12);
        assert!(score.all.f1_50ms.low < f1 && f1 < score.all.f1_50ms.high);
        assert_eq!(score.best_threshold, Some(0.9));
        assert_eq!(score.recall_at_one_per_hour, Some(1.0));
    }

    #[test]
    fn a_silent_detector_misses_all_and_has_no_precision() {
        let streams = streams();
        let silent = EntrantAnswers { name: "silent".to_owned(), ..EntrantAnswers::default() };
        let score = score_entrant(&streams, &silent);
        assert_eq!(score.all.missed, score.all.punctures);
        assert_eq!((score.all.precision.value, score.all.recall.value), (None, Some(0.0)));
        assert!(score.curve.is_empty() && scores_text(&[score]).contains("silent"));
    }
}
