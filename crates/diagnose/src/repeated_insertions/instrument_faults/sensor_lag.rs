//! A force that comes late: where the needle stops and where its way back begins, the motion has a corner, and the force answers at once
//! unless the sensor or the clock is late (a corner that is moved) or slow (a corner that is rounded).
//!
//! Before a corner the force goes on as a line, in the way when the needle stops and in time when it turns. Behind the second one a spring and a friction that builds up over a length `delta`
//! answer the way `u` back: `f = a + b t + c L[u] + d L[1 - exp(-u / delta)]`, with the delay in `u` and the lag in `L`; behind the first one
//! the tissue relaxes, with the time since the stop for `u`. The coefficients are every recording's own; `delta` and the delay
//! or the lag are those of all.

use super::air_baseline::least_squares;
use crate::repeated_insertions::start_values::SegmentedRecording;
use rayon::prelude::*;
use stylet_record::Recording;
use stylet_stats::{interpolate, sd, student_t};

/// Stretch (s) before the corner, and behind it.
const AROUND_S: (f64, f64) = (1.0, 0.8);
/// Until so long before the corner the needle has not turned (s).
const RESTS_S: f64 = 0.2;
/// Delays and lags are tried up to so much (s), in these steps.
const MOST_S: f64 = 0.8;
/// Steps (s).
const STEP_S: f64 = 0.02;
/// Shorter ones are no matter of a sensor: play and rounded corners of the drive make them (s).
const LEAST_S: f64 = 0.08;
/// Lengths over which an answer builds up: friction on the way back (m), relaxation after a stop (s).
const DELTA: [[f64; 5]; 2] = [[3e-4, 6e-4, 8e-4, 1e-3, 1.5e-3], [0.1, 0.2, 0.4, 0.8, 1.6]];
/// A filter has forgotten what was so many time constants ago.
const MEMORY: f64 = 5.0;
/// A late force leaves so much less (mean square) of the corners than one in time; without one, no delay or lag is better at all.
const BETTER: f64 = 0.9;

/// How the force comes late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LagModel {
    /// All of it later: `time_delay`.
    PureDelay,
    /// Rounded: `low_pass_lag`.
    LowPass,
}

/// A force that comes late.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedLag {
    /// How.
    pub model: LagModel,
    /// By how much (s), with its 95 % interval over the recordings.
    pub value_s: f64,
    /// Lower end (s).
    pub low_s: f64,
    /// Upper end (s).
    pub high_s: f64,
}

/// Whether the force of these insertions comes late.
#[must_use]
pub fn detect_lag(runs: &[&SegmentedRecording]) -> Option<DetectedLag> {
    let corners = |at: At| -> Vec<Corner> { runs.iter().filter_map(|r| Corner::of(r, at)).collect() };
    let corners: Vec<Vec<Corner>> = [At::Back, At::Stop]
        .into_iter()
        .map(corners)
        .filter(|c| c.len() >= 2 && 2 * c.len() >= runs.len())
        .collect();
    if corners.is_empty() {
        return None;
    }
    let samples: f64 = corners.iter().flatten().map(|c| c.time_s.len() as f64).sum();
    [LagModel::PureDelay, LagModel::LowPass]
        .into_iter()
        .map(|how| {
            let left: Vec<Vec<Left>> =
                corners.iter().map(|c| c.par_iter().map(|c| c.left(how)).collect()).collect();
            (how, together(&left, None), left)
        })
        .min_by(|a, b| lowest(&a.1).1.total_cmp(&lowest(&b.1).1))
        .and_then(|(how, all, left)| {
            let (by_s, height) = lowest(&all);
            // The jackknife over recordings.
            let n = runs.len() as f64;
            let others: Vec<f64> = runs.iter().map(|r| lowest(&together(&left, Some(&r.name))).0).collect();
            let half = student_t::quantile(0.975, n - 1.0) * sd(&others) * (n - 1.0) / n.sqrt();
            let shows = by_s > LEAST_S && height - all[0] < samples * libm::log(BETTER);
            shows.then_some(DetectedLag {
                model: how,
                value_s: by_s,
                low_s: (by_s - half).max(0.0),
                high_s: by_s + half,
            })
        })
}

/// Per length of [`DELTA`] and delay or lag, samples times the logarithm of the mean square that is left.
struct Left {
    name: String,
    by: [Vec<f64>; 5],
}

/// The sum over corners and recordings but one, each kind of corner at the length that suits it best.
fn together(left: &[Vec<Left>], but: Option<&str>) -> Vec<f64> {
    let at = |kind: &[Left], k: usize| {
        let of = |d: usize| -> f64 {
            kind.iter().filter(|l| Some(l.name.as_str()) != but).map(|l| l.by[d][k]).sum()
        };
        (0..5).map(of).fold(f64::INFINITY, f64::min)
    };
    (0..left[0][0].by[0].len()).map(|k| left.iter().map(|kind| at(kind, k)).sum()).collect()
}

/// Place (s) and height of the lowest point of a curve over steps of [`STEP_S`], between its points.
fn lowest(curve: &[f64]) -> (f64, f64) {
    let k = (0..curve.len()).min_by(|a, b| curve[*a].total_cmp(&curve[*b])).unwrap_or(0);
    let mut at = k as f64;
    if k > 0 && k + 1 < curve.len() {
        let (before, here, after) = (curve[k - 1], curve[k], curve[k + 1]);
        let bend = before - 2.0 * here + after;
        if bend > 0.0 {
            at += 0.5 * (before - after) / bend;
        }
    }
    (at * STEP_S, curve[k])
}

/// Where a motion has its corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    /// Where the way back begins.
    Back,
    /// Where the advance ends.
    Stop,
}

/// The force around a corner of one recording.
struct Corner<'a> {
    name: &'a str,
    recording: &'a Recording,
    at: At,
    /// Instant (s) of the corner and where it lies (m).
    at_s: f64,
    turned_m: f64,
    /// First of the samples.
    first: usize,
    time_s: &'a [f64],
    force_n: &'a [f64],
}

impl<'a> Corner<'a> {
    fn of(run: &'a SegmentedRecording, at: At) -> Option<Self> {
        let r = &run.recording;
        let time = |k: usize| r.time_s.get(k).copied();
        let (stop_s, back_s) =
            (time(run.phases.deepest)?, time(run.phases.retraction).unwrap_or(f64::INFINITY));
        let at_s = if at == At::Back { back_s } else { stop_s };
        let (from_s, to_s) = (at_s - AROUND_S.0, at_s + AROUND_S.1);
        let alone = r.time_s[r.len() - 1] > to_s
            && match at {
                At::Stop => back_s > to_s,
                At::Back => stop_s < from_s || back_s - stop_s < LEAST_S,
            };
        let first = r.time_s.partition_point(|t| *t < from_s);
        let end = r.time_s.partition_point(|t| *t < to_s);
        // A rupture that a late sensor shows inside is elsewhere.
        let torn = run.ruptures_s.iter().any(|t| (from_s - MOST_S..to_s).contains(t));
        let turned_m = r.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (alone && !torn && end - first > 4 * COLUMNS).then(|| Self {
            name: &run.name,
            recording: r,
            at,
            at_s,
            turned_m,
            first,
            time_s: &r.time_s[first..end],
            force_n: &r.force_n[first..end],
        })
    }

    /// What is left over all lengths and delays or lags.
    fn left(&self, how: LagModel) -> Left {
        let n = self.time_s.len() as f64;
        let by = DELTA[self.at as usize].map(|delta| {
            let at = |k: usize| self.squares(how, k as f64 * STEP_S, delta);
            (0..=(MOST_S / STEP_S) as usize).map(|k| n * libm::log((at(k) / n).max(1e-30))).collect()
        });
        Left { name: self.name.to_owned(), by }
    }

    /// Sum of squares (N²) that is left with this delay or lag.
    fn squares(&self, how: LagModel, by_s: f64, delta: f64) -> f64 {
        let (delay_s, lag_s) = match how {
            LagModel::PureDelay => (by_s, 0.0),
            LagModel::LowPass => (0.0, by_s),
        };
        let (time, z) = (&self.recording.time_s, &self.recording.position_m);
        // The filter forgets how it began before the window opens.
        let from = time.partition_point(|t| *t < self.time_s[0] - MEMORY * lag_s);
        let mut slow = [z[from], 0.0, 0.0];
        let mut rows: Vec<[f64; COLUMNS]> = Vec::with_capacity(self.time_s.len());
        for i in from..self.first + self.time_s.len() {
            let at_s = time[i] - delay_s;
            let at_m = interpolate(time, z, at_s);
            let u = match self.at {
                At::Stop => (at_s - self.at_s).max(0.0),
                At::Back if at_s < self.at_s - RESTS_S => 0.0,
                At::Back => (self.turned_m - at_m).max(0.0),
            };
            // All of it where there is no lag.
            let share = if i == from { 1.0 } else { 1.0 - libm::exp(-(time[i] - time[i - 1]) / lag_s) };
            for (s, x) in slow.iter_mut().zip([at_m, u / delta, 1.0 - libm::exp(-u / delta)]) {
                *s += (x - *s) * share;
            }
            if i >= self.first {
                // Until it stops the needle goes on, slower and slower; before its way back time alone passes.
                let before =
                    if self.at == At::Stop { 1e3 * (slow[0] - self.turned_m) } else { time[i] - self.at_s };
                rows.push([1.0, before, slow[1], slow[2]]);
            }
        }
        least_squares(&rows, self.force_n).1.iter().map(|e| e * e).sum()
    }
}

/// Columns of the regression.
const COLUMNS: usize = 4;

#[cfg(test)]
mod tests {
    use super::{AROUND_S, At, Corner, DELTA, LEAST_S, LagModel, Left, STEP_S, detect_lag, lowest, together};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::test_fixtures::uniform_sequence;
    use stylet_record::Recording;

    #[test]
    fn the_lowest_point_of_a_parabola_lies_where_the_parabola_has_it() {
        for place in [2.0, 2.3, 3.49, 5.75] {
            let curve: Vec<f64> = (0..9).map(|k| 4.0 + 1.7 * (f64::from(k) - place).powi(2)).collect();
            let (at, height) = lowest(&curve);
            assert!((at - place * STEP_S).abs() < 1e-12, "{place}: {at}");
            let nearest = curve.iter().copied().fold(f64::INFINITY, f64::min);
            assert_eq!(height, nearest);
        }
        // At an end there is nothing to go between; on a flat bottom the first is as good as any.
        assert_eq!(lowest(&[1.0, 2.0, 5.0]), (0.0, 1.0));
        assert_eq!(lowest(&[5.0, 2.0, 1.0]), (2.0 * STEP_S, 1.0));
        assert_eq!(lowest(&[7.0, 7.0, 7.0]), (0.0, 7.0));
    }

    #[test]
    fn corners_are_summed_at_the_length_that_suits_each_kind_best_and_one_may_be_left_out() {
        let one = |name: &str, add: f64| Left {
            name: name.to_owned(),
            by: std::array::from_fn(|d| {
                (0..3).map(|k| add + (d as f64 - 1.0).powi(2) + 10.0 * k as f64).collect()
            }),
        };
        let back = vec![one("a", 1.0), one("b", 4.0)];
        let stop = vec![one("b", 0.5)];
        let all = together(&[back, stop], None);
        // Length 1 adds nothing; two corners and one.
        assert_eq!(all, [5.5, 35.5, 65.5]);
        let back = vec![one("a", 1.0), one("b", 4.0)];
        let stop = vec![one("b", 0.5)];
        assert_eq!(together(&[back, stop], Some("b")), [1.0, 11.0, 21.0]);
    }

    /// In for 8 s, a rest, and back, at 50 Hz; the force is that of the position so many s ago, through a lag.
    fn run(name: &str, rest_s: f64, delay_s: f64, lag_s: f64, seed: u64) -> SegmentedRecording {
        let z = |t: f64| match t {
            t if t < 8.0 => 0.0025 * t - 0.002,
            t if t < 8.0 + rest_s => 0.018,
            t => (0.018 - 0.0025 * (t - 8.0 - rest_s)).max(-0.002),
        };
        let (mut slow, mut noise) = (0.0, seed);
        let (mut t, mut f) = (Vec::new(), Vec::new());
        for k in 0..((17.0 + rest_s) * 50.0) as usize {
            let at = 0.02 * k as f64;
            noise = (noise * 1_103_515_245 + 12_345) % 2_147_483_648;
            let there = z(at - delay_s);
            let load = 180.0 * there.max(0.0);
            // Friction turns where the way back begins.
            let back = if at - delay_s > 8.0 + rest_s {
                0.6 * libm::exp(-(0.018 - there) / 3e-4) - 0.6
            } else {
                0.0
            };
            let share = if lag_s > 0.0 && k > 0 { 1.0 - libm::exp(-0.02 / lag_s) } else { 1.0 };
            slow += (load + back - slow) * share;
            t.push(at);
            f.push(slow + 0.002 * (noise as f64 / 2_147_483_648.0 - 0.5));
        }
        let z = t.iter().map(|t| z(*t)).collect();
        SegmentedRecording::new(name.to_owned(), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    fn said(rest_s: f64, delay_s: f64, lag_s: f64) -> Option<super::DetectedLag> {
        let runs: Vec<SegmentedRecording> =
            (0..4).map(|k| run(&format!("{k}"), rest_s, delay_s, lag_s, 17 + 5 * k)).collect();
        detect_lag(&runs.iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_late_and_a_slow_force_are_told_with_their_time() {
        assert_eq!(said(4.0, 0.0, 0.0), None);
        let l = said(4.0, 0.26, 0.0).expect("late");
        assert_eq!(l.model, LagModel::PureDelay);
        assert!((l.value_s - 0.26).abs() < 0.01 && l.low_s < l.value_s && l.value_s < l.high_s, "{l:?}");
        let l = said(4.0, 0.0, 0.32).expect("slow");
        assert_eq!(l.model, LagModel::LowPass);
        assert!((l.value_s - 0.32).abs() < 0.02, "{l:?}");
        assert!(l.high_s - l.low_s < 0.1 && (l.high_s + l.low_s - 2.0 * l.value_s).abs() < 1e-9, "{l:?}");
        // What play makes, too.
        assert_eq!(said(4.0, LEAST_S - 0.03, 0.0), None);
    }

    /// The jackknife: the delays that the others tell when each insertion in turn is left out, scattered by `(n - 1) / sqrt(n)`.
    #[test]
    fn the_interval_of_a_delay_is_that_of_what_the_other_insertions_tell() {
        let runs: Vec<SegmentedRecording> = [0.26, 0.3, 0.36]
            .iter()
            .enumerate()
            .map(|(k, by)| run(&format!("{k}"), 4.0, *by, 0.0, 17 + 5 * k as u64))
            .collect();
        let told = detect_lag(&runs.iter().collect::<Vec<_>>()).expect("late");
        let others: Vec<f64> = (0..3)
            .map(|out| {
                let rest: Vec<&SegmentedRecording> = (0..3).filter(|k| *k != out).map(|k| &runs[k]).collect();
                detect_lag(&rest).expect("late").value_s
            })
            .collect();
        let mean = others.iter().sum::<f64>() / 3.0;
        let sd = (others.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 2.0).sqrt();
        // Student's 97.5 % point of two degrees of freedom.
        let half = 4.302_653 * sd * 2.0 / 3.0_f64.sqrt();
        assert!(half > 0.02, "{half}");
        assert!((told.high_s - told.value_s - half).abs() < 1e-6, "{told:?} for {half}");
        assert!((told.low_s - (told.value_s - half).max(0.0)).abs() < 1e-6, "{told:?} for {half}");
    }

    #[test]
    fn two_corners_at_least_and_half_of_the_insertions_tell_a_delay() {
        let told = |with: usize, without: usize| {
            let runs: Vec<SegmentedRecording> = (0..with + without)
                .map(|k| run(&format!("{k}"), if k < with { 4.0 } else { 0.5 }, 0.26, 0.0, 17 + 5 * k as u64))
                .collect();
            detect_lag(&runs.iter().collect::<Vec<_>>()).is_some()
        };
        assert!(told(2, 2) && told(3, 3));
        assert!(!told(1, 0) && !told(2, 3));
    }

    #[test]
    fn a_corner_counts_only_when_it_stands_alone() {
        let has = |run: &SegmentedRecording| [At::Back, At::Stop].map(|at| Corner::of(run, at).is_some());
        assert_eq!(has(&run("a", 4.0, 0.0, 0.0, 3)), [true, true]);
        // A rest shorter than the stretches around it: the corner of the way back has the stop in it, and the stop the way back.
        assert_eq!(has(&run("a", 0.5, 0.0, 0.0, 3)), [false, false]);
        assert_eq!(has(&run("a", 0.9, 0.0, 0.0, 3)), [false, true]);
        assert_eq!(has(&run("a", 0.0, 0.0, 0.0, 3)), [true, false]);
        // A rupture within or shortly before.
        let mut torn = run("a", 4.0, 0.0, 0.0, 3);
        for (at, wanted) in [
            (6.1, [true, true]),
            (6.3, [true, false]),
            (8.7, [true, false]),
            (9.0, [true, true]),
            (10.1, [true, true]),
            (10.3, [false, true]),
            (12.7, [false, true]),
            (12.9, [true, true]),
        ] {
            torn.ruptures_s = vec![at];
            assert_eq!(has(&torn), wanted, "{at}");
        }
        let whole = run("a", 4.0, 0.0, 0.0, 3);
        let corner = Corner::of(&whole, At::Back).expect("a corner");
        assert!((corner.at_s - 12.02).abs() < 0.06, "{}", corner.at_s);
        assert!((corner.turned_m - 0.018).abs() < 1e-9);
        assert_eq!(corner.time_s.len(), corner.force_n.len());
        assert!((corner.time_s[0] - (corner.at_s - 1.0)).abs() < 0.021);
        assert!((corner.time_s[corner.time_s.len() - 1] - (corner.at_s + 0.8)).abs() < 0.021);
        assert_eq!(corner.time_s[0], whole.recording.time_s[corner.first]);
    }

    /// Where the needle turns, and the samples just a second before and four fifths behind: the first belongs to the corner.
    #[test]
    fn a_corner_has_what_lies_from_a_second_before_to_four_fifths_behind() {
        let mut r = run("a", 4.0, 0.0, 0.0, 3);
        let (stop, back) = (r.phases.deepest, r.phases.retraction);
        let t = r.recording.time_s.clone();
        let first = t.partition_point(|x| *x < t[back] - AROUND_S.0 - 1e-6);
        let end = t.partition_point(|x| *x < t[back] + AROUND_S.1 - 1e-6);
        r.recording.time_s[first] = t[back] - AROUND_S.0;
        r.recording.time_s[end] = t[back] + AROUND_S.1;
        let corner = Corner::of(&r, At::Back).expect("a corner");
        assert_eq!((corner.first, corner.time_s.len()), (first, end - first));
        // Nothing comes behind it: no corner.
        let mut short = r.clone();
        short.recording.time_s.truncate(end + 1);
        assert!(Corner::of(&short, At::Back).is_none());
        // The other corner just at the end of the stretch, or at its beginning, or a play's length away.
        let has = |at: At, times: &dyn Fn(&mut Vec<f64>)| {
            let mut r = run("a", 4.0, 0.0, 0.0, 3);
            times(&mut r.recording.time_s);
            Corner::of(&r, at).is_some()
        };
        assert!(!has(At::Stop, &|x| x[back] = t[stop] + AROUND_S.1));
        assert!(!has(At::Back, &|x| x[stop] = t[back] - AROUND_S.0));
        assert!(!has(At::Back, &|x| {
            x.iter_mut().for_each(|x| *x -= t[back]);
            (x[stop], x[back]) = (0.0, LEAST_S);
        }));
    }

    #[test]
    fn a_corner_of_sixteen_samples_is_too_few_for_four_columns() {
        let whole = run("a", 4.0, 0.0, 0.0, 3);
        let at_s = whole.recording.time_s[whole.phases.retraction];
        for (count, told) in [(16, false), (17, true)] {
            // All others lie before and behind.
            let mut r = whole.clone();
            for (k, t) in r.recording.time_s.iter_mut().enumerate() {
                let place = k as f64 - whole.phases.retraction as f64;
                *t = at_s
                    + if place < -8.0 {
                        place - 1.0
                    } else if place >= f64::from(count) - 8.0 {
                        place
                    } else {
                        0.02 * place
                    };
            }
            r.recording.time_s[whole.phases.retraction - 8] = at_s - 0.16;
            assert_eq!(Corner::of(&r, At::Back).is_some(), told, "{count}");
        }
    }

    /// Without noise and late in nothing, the force that the corner supposes leaves nothing.
    #[test]
    fn the_force_of_a_corner_is_a_line_before_it_and_a_spring_and_friction_behind() {
        for (at, delta) in [(At::Stop, DELTA[1][2]), (At::Back, DELTA[0][3])] {
            let mut r = run("a", 4.0, 0.0, 0.0, 3);
            let (stop, back) = (r.phases.deepest, r.phases.retraction);
            let corner_s = r.recording.time_s[if at == At::Stop { stop } else { back }];
            // It creeps until shortly before it turns: that is no way back.
            for k in stop..back - 5 {
                r.recording.position_m[k] -= if at == At::Back { 5e-4 } else { 0.0 };
            }
            let turned = r.recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            for k in 0..r.recording.len() {
                let (t, z) = (r.recording.time_s[k] - corner_s, r.recording.position_m[k]);
                let (u, before) = match at {
                    At::Stop => (t.max(0.0), 90.0 * z),
                    At::Back if t < -0.2 => (0.0, 0.3 * t),
                    At::Back => (turned - z, 0.3 * t),
                };
                r.recording.force_n[k] = 1.0 + before - 0.2 * u / delta - 0.7 * (1.0 - (-u / delta).exp());
            }
            let corner = Corner::of(&r, at).expect("a corner");
            let left = corner.squares(LagModel::PureDelay, 0.0, delta);
            assert!(left < 1e-12, "{at:?}: {left:e}");
            assert!(corner.squares(LagModel::PureDelay, 0.3, delta) > 1e-4);
        }
    }

    /// Five time constants.
    #[test]
    fn a_filter_begins_where_it_has_forgotten_what_was() {
        let mut r = run("a", 4.0, 0.0, 0.3, 3);
        let of = |r: &SegmentedRecording| {
            Corner::of(r, At::Stop).expect("a corner").squares(LagModel::LowPass, 0.3, 0.4)
        };
        let (was, begins) = (of(&r), r.recording.time_s[r.phases.deepest] - AROUND_S.0);
        for (t, z) in r.recording.time_s.iter().zip(&mut r.recording.position_m) {
            *z -= if *t < begins - 1.55 { 5e-3 } else { 0.0 };
        }
        assert_eq!(of(&r), was);
        let late = r.recording.time_s.partition_point(|t| *t < begins - 1.45);
        r.recording.position_m[late] -= 5e-3;
        assert!(of(&r) != was);
    }

    /// A force half a second late under noise of as much as it changes.
    #[test]
    fn a_delay_that_hardly_leaves_less_is_none() {
        let mut spread = uniform_sequence(11);
        let runs: Vec<SegmentedRecording> = (0..4)
            .map(|k| {
                let mut r = run(&format!("{k}"), 4.0, 0.4, 0.0, 17 + 5 * k);
                for f in &mut r.recording.force_n {
                    *f = 0.25 * *f + 1.5 * (spread() - 0.5);
                }
                r.ruptures_s.fill(f64::INFINITY);
                r
            })
            .collect();
        assert_eq!(detect_lag(&runs.iter().collect::<Vec<_>>()), None);
    }
}
