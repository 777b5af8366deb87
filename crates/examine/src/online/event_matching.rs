//! Matching of a detector's events to the true punctures.

use super::simulate_stream::{Stream, TruePuncture};

/// A puncture reported by a detector, with the time of the report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Time in s.
    pub time_s: f64,
    /// Drop of the force in N.
    pub drop_n: Option<f64>,
    /// Confidence of the detector; larger is more certain.
    pub confidence: Option<f64>,
}

/// Window in which an event counts as the detection of a puncture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Window {
    /// From 50 ms before to 1 s after it.
    Found,
    /// At most 50 ms before or after it.
    Within50ms,
    /// As `Found`, and the needle's base at most 0.5 mm away from where it was at the puncture.
    WithinHalfMillimetre,
}

/// Largest time of an event before its puncture in s.
const EARLY_S: f64 = 0.05;
/// Largest time of an event after its puncture in s.
const FOUND_S: f64 = 1.0;
const CLOSE_S: f64 = 0.05;
const CLOSE_M: f64 = 0.5e-3;

impl Window {
    fn holds(self, stream: &Stream, puncture: &TruePuncture, event: &Event) -> bool {
        let late_s = event.time_s - puncture.time_s;
        let found = (-EARLY_S..=FOUND_S).contains(&late_s);
        match self {
            Window::Found => found,
            Window::Within50ms => late_s.abs() <= CLOSE_S,
            Window::WithinHalfMillimetre => {
                found && (stream.position_at_m(event.time_s) - puncture.position_m).abs() <= CLOSE_M
            }
        }
    }
}

/// Number of events that are neither hits nor false alarms: repeated events of the same puncture (while a layer still tears, each of its
/// steps may be reported), and those at possible punctures.
#[must_use]
pub fn uncounted_events(stream: &Stream, events: &[Event]) -> usize {
    let hits = match_events(stream, events, Window::Found);
    let tears = |event: &Event| {
        stream.punctures.iter().zip(&hits).any(|(puncture, hit)| {
            hit.is_some() && (puncture.time_s..=puncture.released_s + EARLY_S).contains(&event.time_s)
        })
    };
    let unmatched = |k: &usize| !hits.contains(&Some(*k));
    let (repeated, further): (Vec<usize>, Vec<usize>) =
        (0..events.len()).filter(unmatched).partition(|&k| tears(&events[k]));
    let further: Vec<Event> = further.into_iter().map(|k| events[k]).collect();
    let minor = first_events(stream, &stream.minor, &further, Window::Found);
    repeated.len() + minor.iter().flatten().count()
}

/// For each puncture, the index of the first event in its window that is not matched to an earlier puncture.
#[must_use]
pub fn match_events(stream: &Stream, events: &[Event], window: Window) -> Vec<Option<usize>> {
    first_events(stream, &stream.punctures, events, window)
}

fn first_events(
    stream: &Stream,
    punctures: &[TruePuncture],
    events: &[Event],
    window: Window,
) -> Vec<Option<usize>> {
    let mut taken = vec![false; events.len()];
    punctures
        .iter()
        .map(|puncture| {
            let hit = (0..events.len()).find(|&k| !taken[k] && window.holds(stream, puncture, &events[k]));
            if let Some(k) = hit {
                taken[k] = true;
            }
            hit
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::simulate_stream::simulate_stream;
    use super::super::stream_id::{Row, Split, stream_ids};
    use super::*;
    use crate::cases::case_id::World;

    #[test]
    fn an_event_belongs_to_one_puncture_and_only_within_the_window() {
        let stream = simulate_stream(&stream_ids(World::Plain, &[Row::Constant], Split::Make, 1, 3)[0]);
        let first = stream.punctures[0];
        let event = |late_s: f64| Event { time_s: first.time_s + late_s, drop_n: None, confidence: None };
        for (late_s, found, close) in [
            (-0.06, false, false),
            (-0.04, true, true),
            (0.03, true, true),
            (0.3, true, false),
            (1.2, false, false),
        ] {
            assert_eq!(
                match_events(&stream, &[event(late_s)], Window::Found)[0].is_some(),
                found,
                "{late_s}"
            );
            assert_eq!(
                match_events(&stream, &[event(late_s)], Window::Within50ms)[0].is_some(),
                close,
                "{late_s}"
            );
        }
        // At 2 mm/s and more, half a millimetre is at most 0.25 s.
        assert_eq!(match_events(&stream, &[event(0.3)], Window::WithinHalfMillimetre)[0], None);
        assert_eq!(match_events(&stream, &[event(0.05)], Window::WithinHalfMillimetre)[0], Some(0));
        let twice = [event(0.01), event(0.02)];
        let hits: Vec<usize> = match_events(&stream, &twice, Window::Found).into_iter().flatten().collect();
        assert_eq!(hits, [0]);
    }

    #[test]
    fn an_event_at_a_possible_puncture_does_not_count() {
        let mut stream = simulate_stream(&stream_ids(World::Plain, &[Row::Constant], Split::Make, 1, 3)[0]);
        stream.minor = std::mem::take(&mut stream.punctures);
        let minor = stream.minor[0];
        let event = |late_s: f64| Event { time_s: minor.time_s + late_s, drop_n: None, confidence: None };
        assert!(match_events(&stream, &[event(0.02)], Window::Found).is_empty());
        assert_eq!(uncounted_events(&stream, &[event(0.02)]), 1);
        // One event per possible puncture.
        assert_eq!(uncounted_events(&stream, &[event(0.02), event(0.03)]), 1);
        assert_eq!(uncounted_events(&stream, &[event(-0.06)]), 0);
    }
}
