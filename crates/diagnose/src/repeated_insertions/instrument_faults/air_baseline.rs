//! A sensor that touches nothing: what it shows in air, in a recording of its own or before an insertion reaches the tissue.

use crate::repeated_insertions::start_values::SegmentedRecording;
use stylet_identify::insertion_phases::noise_n;
use stylet_record::Recording;
use stylet_stats::linear_algebra::{SymmetricMatrix, dot};
use stylet_stats::{mean, median_of, rms};

/// Share of the way to the believed surface that counts as air: the surface may be nearer than believed.
const AIR_SHARE: f64 = 0.5;
/// Fewest samples of it.
const AIR_SAMPLES: usize = 20;
/// Force that scatters about its line by more than so many standard deviations of its noise is no air.
const AIR_NOISES: f64 = 2.0;
/// Speed (m/s) from which the drive moves.
const MOVES_MPS: f64 = 2e-4;

/// A straight line through a force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearTrend {
    /// Force (N) at the first instant.
    pub start_n: f64,
    /// Slope (N/s).
    pub rate_n_per_s: f64,
    /// Standard deviation about it (N).
    pub sd_n: f64,
}

/// The line of least squares.
#[must_use]
pub fn fit_trend(t: &[f64], f: &[f64]) -> LinearTrend {
    let (middle, level) = (mean(t), mean(f));
    let about = |x: &[f64], mean: f64| x.iter().map(|x| x - mean).collect::<Vec<_>>();
    let (t, f) = (about(t, middle), about(f, level));
    let rate = dot(&t, &f) / dot(&t, &t).max(1e-12);
    let rest: Vec<f64> = t.iter().zip(&f).map(|(t, f)| f - rate * t).collect();
    LinearTrend { start_n: level + rate * t[0], rate_n_per_s: rate, sd_n: rms(&rest) }
}

/// Coefficients of the combination of columns that leaves least squares, and what it leaves.
pub fn least_squares<const N: usize>(rows: &[[f64; N]], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut a = SymmetricMatrix::zeros(N);
    let mut b = [0.0; N];
    for (row, y) in rows.iter().zip(y) {
        for i in 0..N {
            b[i] += row[i] * y;
            for j in i..N {
                a.add(i, j, row[i] * row[j]);
            }
        }
    }
    let x = a.cholesky().solve(&b);
    let of = |row: &[f64; N]| row.iter().zip(&x).map(|(r, x)| r * x).sum::<f64>();
    let rest = rows.iter().zip(y).map(|(row, y)| y - of(row)).collect();
    (x, rest)
}

/// What a recording in air shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirAnalysis {
    /// Its line.
    pub trend: LinearTrend,
    /// Correlation of neighbouring noise samples.
    pub ar1: f64,
    /// Amplitude (N) and frequency (Hz) of the strongest line of its spectrum.
    pub tone: Option<(f64, f64)>,
    /// Half the difference (N) between moving in and moving out.
    pub drive_friction_n: Option<f64>,
}

impl AirAnalysis {
    /// Looks at a recording in air.
    #[must_use]
    pub fn new(air: &Recording) -> Self {
        let (t, f) = (&air.time_s, &air.force_n);
        let way =
            |sign: f64| air.velocity_mps.iter().filter(|v| **v * sign > MOVES_MPS).count() > AIR_SAMPLES;
        let moves = way(1.0) && way(-1.0);
        let drive = |i: usize| match air.velocity_mps[i] {
            v if !moves || v.abs() <= MOVES_MPS => 0.0,
            v => v.signum(),
        };
        // Offset, drift and drive at once: the way in comes before the way out, as the early part of a drift before the late one.
        let middle = mean(t);
        let rows: Vec<[f64; 3]> = (0..t.len()).map(|i| [1.0, t[i] - middle, drive(i)]).collect();
        let (x, rest) = least_squares(&rows, f);
        let lagged: f64 = rest.windows(2).map(|p| p[0] * p[1]).sum();
        Self {
            trend: LinearTrend {
                start_n: x[0] + x[1] * (t[0] - middle),
                rate_n_per_s: x[1],
                sd_n: rms(&rest),
            },
            ar1: lagged / rest.iter().map(|x| x * x).sum::<f64>().max(1e-300),
            tone: tone(t, &rest),
            drive_friction_n: moves.then_some(x[2]),
        }
    }
}

/// Depth (m) up to which a recording counts as air.
fn in_air_m(r: &Recording, surface_m: f64) -> f64 {
    let from = r.position_m[0];
    from + AIR_SHARE * (surface_m - from)
}

/// The line of some samples' force, where it is straight.
fn straight(r: &Recording, samples: std::ops::Range<usize>) -> Option<LinearTrend> {
    if samples.len() < AIR_SAMPLES {
        return None;
    }
    let (t, f) = (&r.time_s[samples.clone()], &r.force_n[samples]);
    let at = fit_trend(t, f);
    (at.sd_n <= AIR_NOISES * noise_n(f).max(1e-9)).then_some(at)
}

/// The samples of an insertion before it reaches the tissue.
fn way_there(r: &Recording, surface_m: f64) -> Option<std::ops::Range<usize>> {
    let end = r.position_m.iter().position(|z| *z > in_air_m(r, surface_m))?;
    (surface_m > r.position_m[0]).then_some(0..end)
}

/// The line of the force before each insertion reaches the tissue, where that can be told from the tissue's own: it is straight.
#[must_use]
pub fn pre_contact_trends(runs: &[&SegmentedRecording], surface_m: f64) -> Vec<LinearTrend> {
    runs.iter().filter_map(|run| straight(&run.recording, way_there(&run.recording, surface_m)?)).collect()
}

/// Change of the force in air (N/s) from before an insertion to after it, where the needle comes back into the air.
#[must_use]
pub fn air_drift_n_per_s(run: &SegmentedRecording, surface_m: f64) -> Option<f64> {
    let r = &run.recording;
    let there = way_there(r, surface_m)?;
    let back = r.position_m.iter().rposition(|z| *z > in_air_m(r, surface_m))? + 1;
    // What a slow sensor still has of the tissue fades first.
    let late = back + (r.len() - back) / 2;
    let (before, after) = (straight(r, there.clone())?, straight(r, late..r.len())?);
    let level = |l: LinearTrend, from: usize, to: usize| {
        l.start_n + l.rate_n_per_s * 0.5 * (r.time_s[to - 1] - r.time_s[from])
    };
    let middle = |from: usize, to: usize| 0.5 * (r.time_s[to - 1] + r.time_s[from]);
    let change = level(after, late, r.len()) - level(before, 0, there.end);
    Some(change / (middle(late, r.len()) - middle(0, there.end)))
}

/// The middle of a number that the insertions have in common: nothing when they do not agree on it.
#[must_use]
pub fn consensus(values: &[f64]) -> f64 {
    let middle = median_of(values.iter().copied());
    let apart = median_of(values.iter().map(|x| (x - middle).abs()));
    if apart < 0.5 * middle.abs() { middle } else { 0.0 }
}

/// The strongest sinusoid (amplitude, frequency) up to half the sampling rate, on the time stamps as they are.
fn tone(t: &[f64], e: &[f64]) -> Option<(f64, f64)> {
    let duration = t[t.len() - 1] - t[0];
    if duration <= 0.0 || t.len() < AIR_SAMPLES {
        return None;
    }
    let most = 0.5 * t.len() as f64 / duration;
    let step = 0.5 / duration;
    let mut best = (0.0, 0.0);
    let mut k = 2.0;
    while k * step < most {
        let omega = std::f64::consts::TAU * k * step;
        let (mut c, mut s) = (0.0, 0.0);
        for (at, e) in t.iter().zip(e) {
            let (sin, cos) = libm::sincos(omega * (at - t[0]));
            c += e * cos;
            s += e * sin;
        }
        let amplitude = 2.0 * libm::sqrt(c * c + s * s) / t.len() as f64;
        if amplitude > best.0 {
            best = (amplitude, k * step);
        }
        k += 1.0;
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::{
        AirAnalysis, LinearTrend, MOVES_MPS, air_drift_n_per_s, consensus, fit_trend, in_air_m,
        least_squares, pre_contact_trends, straight, tone, way_there,
    };
    use crate::repeated_insertions::start_values::SegmentedRecording;
    use stylet_record::Recording;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * (1.0 + b.abs())
    }

    #[test]
    fn a_line_of_least_squares_is_the_one_of_the_text_books() {
        // Slope sum(dt df)/sum(dt^2) of four points, by hand: means 2.5 and 3.75, sums 8.25 and 5.
        let (t, f) = ([1.0, 2.0, 3.0, 4.0], [1.5, 3.0, 4.0, 6.5]);
        let l = fit_trend(&t, &f);
        let (slope, level) = (8.0 / 5.0, 3.75);
        assert!(near(l.rate_n_per_s, slope), "{l:?}");
        assert!(near(l.start_n, level - 1.5 * slope), "{l:?}");
        let rest: f64 = t.iter().zip(&f).map(|(t, f)| (f - level - slope * (t - 2.5)).powi(2)).sum();
        assert!(near(l.sd_n, (rest / 4.0).sqrt()), "{l:?}");
        // The instants begin anywhere: what counts is the first one.
        let later = fit_trend(&t.map(|t| t + 7.0), &f);
        assert!(near(later.start_n, l.start_n) && near(later.rate_n_per_s, slope));
        // Where time stands still there is no slope, and the level is the mean.
        assert_eq!(fit_trend(&[3.0, 3.0], &[1.0, 4.0]).start_n, 2.5);
    }

    #[test]
    fn a_regression_gives_the_coefficients_that_made_the_force_and_what_no_column_explains() {
        let rows: Vec<[f64; 3]> =
            (0..9).map(f64::from).map(|k| [1.0, 0.3 * k - 1.1, (1.7 * k).sin()]).collect();
        let y: Vec<f64> = rows.iter().map(|r| 0.7 * r[0] - 1.3 * r[1] + 2.9 * r[2]).collect();
        let (x, rest) = least_squares(&rows, &y);
        for (x, wanted) in x.iter().zip([0.7, -1.3, 2.9]) {
            assert!((x - wanted).abs() < 1e-8, "{x} is not {wanted}");
        }
        assert!(rest.iter().all(|e| e.abs() < 1e-8));
        // What is left stands at right angles to every column.
        let bent: Vec<f64> = y.iter().enumerate().map(|(k, y)| y + ((k * k) as f64 * 0.37).cos()).collect();
        let (_, rest) = least_squares(&rows, &bent);
        for column in 0..3 {
            let dot: f64 = rest.iter().zip(&rows).map(|(e, r)| e * r[column]).sum();
            assert!(dot.abs() < 1e-8, "{dot}");
        }
        assert!(rest.iter().map(|e| e * e).sum::<f64>() > 0.1);
    }

    fn recording(n: usize, dt: f64, z: impl Fn(f64) -> f64, f: impl Fn(usize, f64) -> f64) -> Recording {
        let t: Vec<f64> = (0..n).map(|k| 0.5 + dt * k as f64).collect();
        let z = t.iter().map(|t| z(*t)).collect();
        let f = t.iter().enumerate().map(|(k, t)| f(k, *t)).collect();
        Recording::new(t, z, f).expect("clean columns")
    }

    /// Offset, drift, drive and noise at once; the noise alternates, so that neighbours are opposed.
    #[test]
    fn air_tells_offset_drift_drive_and_the_colour_of_its_noise_apart() {
        let noise = |k: usize| if k.is_multiple_of(2) { 0.003 } else { -0.003 };
        let there_and_back = |t: f64| if t < 2.5 { 0.004 * t } else { 0.02 - 0.004 * t };
        let force = |k: usize, t: f64| 0.4 + 0.02 * (t - 0.5) + if t < 2.5 { 0.05 } else { -0.05 } + noise(k);
        let air = AirAnalysis::new(&recording(400, 0.01, there_and_back, force));
        assert!((air.trend.start_n - 0.4).abs() < 2e-3, "{air:?}");
        assert!((air.trend.rate_n_per_s - 0.02).abs() < 1e-3, "{air:?}");
        assert!((air.trend.sd_n - 0.003).abs() < 1.2e-3, "{air:?}");
        assert!((-1.0..-0.5).contains(&air.ar1), "{air:?}");
        assert!((air.drive_friction_n.expect("it moves both ways") - 0.05).abs() < 2e-3, "{air:?}");
        // At rest, or in one direction only, nothing tells a drive.
        assert_eq!(AirAnalysis::new(&recording(400, 0.01, |_| 0.0, force)).drive_friction_n, None);
        assert_eq!(AirAnalysis::new(&recording(400, 0.01, |t| 0.004 * t, force)).drive_friction_n, None);
        let slow = noise(0);
        let alike =
            AirAnalysis::new(&recording(400, 0.01, |_| 0.0, |k, _| if k < 200 { slow } else { -slow }));
        assert!((0.5..1.0).contains(&alike.ar1) && alike.trend.sd_n < slow, "{alike:?}");
    }

    #[test]
    fn the_strongest_tone_has_its_amplitude_and_its_frequency() {
        // 4 s at 50 Hz: the grid's step is an eighth of a hertz.
        let t: Vec<f64> = (0..201).map(|k| 0.7 + 0.02 * f64::from(k)).collect();
        let wave = |hz: f64, a: f64, phase: f64| {
            t.iter()
                .map(move |t| a * (std::f64::consts::TAU * hz * (t - 0.7) + phase).sin())
                .collect::<Vec<f64>>()
        };
        for (hz, a, phase) in [(3.25, 0.4, 0.3), (11.5, 0.07, 1.9), (24.0, 1.3, 0.2), (0.5, 0.6, 0.0)] {
            let (amplitude, frequency) = tone(&t, &wave(hz, a, phase)).expect("a tone");
            assert!((frequency - hz).abs() < 1e-9, "{hz}: {frequency}");
            assert!((amplitude / a - 1.0).abs() < 0.03, "{hz}: {amplitude} for {a}");
        }
        let both: Vec<f64> =
            wave(3.25, 0.4, 0.3).iter().zip(wave(11.5, 0.5, 1.0)).map(|(a, b)| a + b).collect();
        assert!((tone(&t, &both).expect("a tone").1 - 11.5).abs() < 1e-9);
        // Half the sampling rate and beyond show nothing, and too few samples tell nothing.
        assert_eq!(tone(&t[..19], &wave(3.25, 0.4, 0.3)[..19]), None);
        assert!(tone(&t[..20], &wave(3.25, 0.4, 0.3)[..20]).is_some());
        assert_eq!(tone(&[1.0; 30], &[0.5; 30]), None);
        assert!(tone(&t, &wave(7.0, 1.0, 0.0)).expect("a tone").1 < 25.0);
        // Not on uneven stamps either, where half the rate is no mirror; and silence has no tone.
        let uneven: Vec<f64> =
            (0..33).map(f64::from).map(|k| k + 0.3 * (0.25 * std::f64::consts::PI * k).sin()).collect();
        let most = 0.5 * 33.0 / 32.0;
        let e: Vec<f64> = uneven.iter().map(|t| (std::f64::consts::TAU * most * t).cos()).collect();
        assert!((uneven[32] - 32.0).abs() < 1e-12 && tone(&uneven, &e).expect("a tone").1 < most - 1e-9);
        assert_eq!(tone(&t, &[0.0; 201]), Some((0.0, 0.0)));
    }

    #[test]
    fn numbers_on_which_insertions_agree_are_common_and_others_nothing() {
        assert_eq!(consensus(&[0.31, 0.29, 0.3, 0.33, 0.1]), 0.3);
        assert_eq!(consensus(&[-0.31, -0.29, -0.3]), -0.3);
        // Half of its size is the most by which the middle one may lie apart.
        assert_eq!(consensus(&[0.1, 0.2, 0.29]), 0.2);
        assert_eq!(consensus(&[0.05, 0.2, 0.4]), 0.0);
        assert_eq!(consensus(&[-0.2, 0.1, 0.3]), 0.0);
        assert_eq!(consensus(&[1.0, 2.0, 3.0]), 0.0);
    }

    /// An insertion from 10 mm before a surface at 0: half of the way counts as air.
    fn insertion(bias: f64, rate: f64, late: f64) -> SegmentedRecording {
        let z = |t: f64| {
            let t = t - 0.5;
            if t < 10.0 { 0.003 * t - 0.01 } else { 0.02 - 0.006 * (t - 10.0) }
        };
        let jitter = |k: usize| 1e-3 * (((k * 7919) % 101) as f64 / 101.0 - 0.5);
        let f = move |k: usize, t: f64| {
            let back = if t > 15.5 { late } else { 0.0 };
            bias + rate * (t - 0.5) + back + 300.0 * z(t).max(0.0) + jitter(k)
        };
        SegmentedRecording::new("one".to_owned(), recording(900, 0.02, z, f), 1)
    }

    #[test]
    fn the_way_there_shows_the_line_of_the_air() {
        let run = insertion(0.3, 0.02, 0.0);
        assert!(near(in_air_m(&run.recording, 0.0), -0.005));
        assert!(near(in_air_m(&run.recording, 0.004), -0.003));
        let lines: Vec<LinearTrend> = pre_contact_trends(&[&run, &run], 0.0);
        assert_eq!(lines.len(), 2);
        assert!((lines[0].start_n - 0.3).abs() < 1e-3, "{:?}", lines[0]);
        assert!((lines[0].rate_n_per_s - 0.02).abs() < 1e-3, "{:?}", lines[0]);
        // With a surface believed too deep the tissue is in it, and that is not straight; one above the needle leaves no air.
        assert!(pre_contact_trends(&[&run], 0.02).is_empty());
        assert!(pre_contact_trends(&[&run], -0.0101).is_empty());
        // Two tenths of a millimetre take four samples: too few.
        assert!(pre_contact_trends(&[&run], -0.0095).is_empty());
    }

    #[test]
    fn the_air_before_and_after_an_insertion_tells_its_drift() {
        // The needle is back in air from 5 mm before the surface on: 14.2 s; the later half of what follows counts.
        let rate = air_drift_n_per_s(&insertion(0.3, 0.02, 0.0), 0.0).expect("air on both sides");
        assert!((rate - 0.02).abs() < 2e-4, "{rate}");
        // Another level at the end counts by the time between the middles of both stretches.
        let (t0, t1) = (0.5 + 0.5 * 1.66, 0.5 * (0.5 + 899.0 * 0.02 + 16.1));
        let rate = air_drift_n_per_s(&insertion(0.3, 0.0, 0.5), 0.0).expect("air on both sides");
        assert!((rate * (t1 - t0) - 0.5).abs() < 0.01, "{}", rate * (t1 - t0));
        assert_eq!(air_drift_n_per_s(&insertion(0.3, 0.02, 0.0), 0.03), None);
    }

    #[test]
    fn a_drive_is_told_by_more_than_twenty_samples_each_way_at_more_than_its_least_speed() {
        let told = |back: usize, speed: f64| {
            let v: Vec<f64> = (0..120)
                .map(|k| {
                    if k < 40 {
                        speed
                    } else if k < 40 + back {
                        -speed
                    } else {
                        0.0
                    }
                })
                .collect();
            let t: Vec<f64> = (0..120).map(|k| 0.02 * f64::from(k)).collect();
            let f = v.iter().enumerate().map(|(k, v)| 0.1 * v.signum() + 1e-3 * (k % 3) as f64).collect();
            let air = Recording::with_velocity(t, vec![0.0; 120], v, f).expect("clean columns");
            AirAnalysis::new(&air).drive_friction_n.is_some()
        };
        assert_eq!([(21, 1e-3), (20, 1e-3), (40, MOVES_MPS)].map(|(n, v)| told(n, v)), [true, false, false]);
    }

    /// The air ends where a sample lies beyond half of the way; a line takes twenty samples.
    #[test]
    fn the_air_before_an_insertion_ends_beyond_half_of_its_way() {
        let r = recording(64, 0.02, |t| ((t - 0.5) * 50.0).round() / 64.0, |k, _| 1e-3 * (k % 3) as f64);
        assert_eq!(way_there(&r, 40.0 / 64.0), Some(0..21));
        assert_eq!((way_there(&r, 0.0), way_there(&r, -0.1)), (None, None));
        assert!(straight(&r, 0..20).is_some() && straight(&r, 0..19).is_none());
    }

    /// Out of the air at the 30th sample and back so many before the last: the later half of these tells the level.
    #[test]
    fn the_air_after_an_insertion_begins_behind_the_last_sample_beyond_half_of_its_way() {
        let told = |back: usize, edge: f64| {
            let place = |k: usize| if (30..200 - back).contains(&k) { 1.0 } else { 0.0 };
            let mut r = recording(
                200,
                0.02,
                |t| place(((t - 0.5) * 50.0).round() as usize),
                |k, _| 0.25 + 0.01 * k as f64 + 1e-6 * (k % 3) as f64,
            );
            r.position_m[200 - back] = edge;
            air_drift_n_per_s(&SegmentedRecording { recording: r, ..insertion(0.0, 0.0, 0.0) }, 0.5)
        };
        let rate = told(80, 0.0).expect("air on both sides");
        assert!((rate - 0.5).abs() < 1e-5, "{rate}");
        // Twenty samples are enough; what lies at half of the way is air.
        assert!(told(39, 0.0).is_some() && told(38, 0.0).is_none());
        assert!(told(39, 0.25).is_some());
    }
}
