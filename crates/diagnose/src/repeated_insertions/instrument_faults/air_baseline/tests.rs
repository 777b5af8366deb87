use super::{
    AirAnalysis, LinearTrend, air_drift_n_per_s, air_limit_m, consensus, fit_trend, least_squares,
    pre_contact_trends, strongest_tone,
};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::Recording;

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9 * (1.0 + b.abs())
}

#[test]
fn the_least_squares_line_matches_its_closed_form() {
    // Slope sum(dt df)/sum(dt^2) of four points: means 2.5 and 3.75, sums 8.25 and 5.
    let (t, f) = ([1.0, 2.0, 3.0, 4.0], [1.5, 3.0, 4.0, 6.5]);
    let l = fit_trend(&t, &f);
    let (slope, level) = (8.0 / 5.0, 3.75);
    assert!(near(l.rate_n_per_s, slope), "{l:?}");
    assert!(near(l.start_n, level - 1.5 * slope), "{l:?}");
    let rest: f64 = t.iter().zip(&f).map(|(t, f)| (f - level - slope * (t - 2.5)).powi(2)).sum();
    assert!(near(l.sd_n, (rest / 4.0).sqrt()), "{l:?}");
    let later = fit_trend(&t.map(|t| t + 7.0), &f);
    assert!(near(later.start_n, l.start_n) && near(later.rate_n_per_s, slope));
    assert_eq!(fit_trend(&[3.0, 3.0], &[1.0, 4.0]).start_n, 2.5);
}

#[test]
fn a_regression_recovers_coefficients_and_residuals() {
    let rows: Vec<[f64; 3]> = (0..9).map(f64::from).map(|k| [1.0, 0.3 * k - 1.1, (1.7 * k).sin()]).collect();
    let y: Vec<f64> = rows.iter().map(|r| 0.7 * r[0] - 1.3 * r[1] + 2.9 * r[2]).collect();
    let (x, rest) = least_squares(&rows, &y);
    for (x, wanted) in x.iter().zip([0.7, -1.3, 2.9]) {
        assert!((x - wanted).abs() < 1e-8, "{x} is not {wanted}");
    }
    assert!(rest.iter().all(|e| e.abs() < 1e-8));
    // Residuals are orthogonal to every column.
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

#[test]
fn offset_drift_drive_and_autocorrelation_are_separated_in_air() {
    let noise = |k: usize| if k.is_multiple_of(2) { 0.003 } else { -0.003 };
    let there_and_back = |t: f64| if t < 2.5 { 0.004 * t } else { 0.02 - 0.004 * t };
    let force = |k: usize, t: f64| 0.4 + 0.02 * (t - 0.5) + if t < 2.5 { 0.05 } else { -0.05 } + noise(k);
    let air = AirAnalysis::new(&recording(400, 0.01, there_and_back, force));
    assert!((air.trend.start_n - 0.4).abs() < 2e-3, "{air:?}");
    assert!((air.trend.rate_n_per_s - 0.02).abs() < 1e-3, "{air:?}");
    assert!((air.trend.sd_n - 0.003).abs() < 1.2e-3, "{air:?}");
    assert!((-1.0..-0.5).contains(&air.ar1), "{air:?}");
    assert!((air.drive_friction_n.expect("it moves both ways") - 0.05).abs() < 2e-3, "{air:?}");
    assert_eq!(AirAnalysis::new(&recording(400, 0.01, |_| 0.0, force)).drive_friction_n, None);
    assert_eq!(AirAnalysis::new(&recording(400, 0.01, |t| 0.004 * t, force)).drive_friction_n, None);
    let slow = noise(0);
    let correlated =
        AirAnalysis::new(&recording(400, 0.01, |_| 0.0, |k, _| if k < 200 { slow } else { -slow }));
    assert!((0.5..1.0).contains(&correlated.ar1) && correlated.trend.sd_n < slow, "{correlated:?}");
}

#[test]
fn the_strongest_tone_is_found_with_amplitude_and_frequency() {
    // 4 s at 50 Hz: grid of 1/8 Hz.
    let t: Vec<f64> = (0..201).map(|k| 0.7 + 0.02 * f64::from(k)).collect();
    let wave = |hz: f64, a: f64, phase: f64| {
        t.iter()
            .map(move |t| a * (std::f64::consts::TAU * hz * (t - 0.7) + phase).sin())
            .collect::<Vec<f64>>()
    };
    for (hz, a, phase) in [(3.25, 0.4, 0.3), (11.5, 0.07, 1.9), (24.0, 1.3, 0.2), (0.5, 0.6, 0.0)] {
        let (amplitude, frequency) = strongest_tone(&t, &wave(hz, a, phase)).expect("a tone");
        assert!((frequency - hz).abs() < 1e-9, "{hz}: {frequency}");
        assert!((amplitude / a - 1.0).abs() < 0.03, "{hz}: {amplitude} for {a}");
    }
    let both: Vec<f64> = wave(3.25, 0.4, 0.3).iter().zip(wave(11.5, 0.5, 1.0)).map(|(a, b)| a + b).collect();
    assert!((strongest_tone(&t, &both).expect("a tone").1 - 11.5).abs() < 1e-9);
    assert_eq!(strongest_tone(&t[..19], &wave(3.25, 0.4, 0.3)[..19]), None);
    assert!(strongest_tone(&t[..20], &wave(3.25, 0.4, 0.3)[..20]).is_some());
    assert_eq!(strongest_tone(&[1.0; 30], &[0.5; 30]), None);
    assert!(strongest_tone(&t, &wave(7.0, 1.0, 0.0)).expect("a tone").1 < 25.0);
    // Nor at uneven time stamps; a constant has no tone.
    let uneven: Vec<f64> =
        (0..33).map(f64::from).map(|k| k + 0.3 * (0.25 * std::f64::consts::PI * k).sin()).collect();
    let most = 0.5 * 33.0 / 32.0;
    let e: Vec<f64> = uneven.iter().map(|t| (std::f64::consts::TAU * most * t).cos()).collect();
    assert!(
        (uneven[32] - 32.0).abs() < 1e-12 && strongest_tone(&uneven, &e).expect("a tone").1 < most - 1e-9
    );
    assert_eq!(strongest_tone(&t, &[0.0; 201]), Some((0.0, 0.0)));
}

#[test]
fn a_consensus_is_the_median_or_zero() {
    assert_eq!(consensus(&[0.31, 0.29, 0.3, 0.33, 0.1]), 0.3);
    assert_eq!(consensus(&[-0.31, -0.29, -0.3]), -0.3);
    assert_eq!(consensus(&[0.1, 0.2, 0.29]), 0.2);
    assert_eq!(consensus(&[0.05, 0.2, 0.4]), 0.0);
    assert_eq!(consensus(&[-0.2, 0.1, 0.3]), 0.0);
    assert_eq!(consensus(&[1.0, 2.0, 3.0]), 0.0);
}

/// Insertion from 10 mm before a surface at 0: the first 5 mm are air.
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
fn the_trend_before_contact_is_fitted_in_air() {
    let run = insertion(0.3, 0.02, 0.0);
    assert!(near(air_limit_m(&run.recording, 0.0), -0.005));
    assert!(near(air_limit_m(&run.recording, 0.004), -0.003));
    let lines: Vec<LinearTrend> = pre_contact_trends(&[&run, &run], 0.0);
    assert_eq!(lines.len(), 2);
    assert!((lines[0].start_n - 0.3).abs() < 1e-3, "{:?}", lines[0]);
    assert!((lines[0].rate_n_per_s - 0.02).abs() < 1e-3, "{:?}", lines[0]);
    assert!(pre_contact_trends(&[&run], 0.02).is_empty());
    assert!(pre_contact_trends(&[&run], -0.0101).is_empty());
    // 0.2 mm take four samples: too few.
    assert!(pre_contact_trends(&[&run], -0.0095).is_empty());
}

#[test]
fn the_air_before_and_after_an_insertion_gives_its_drift() {
    // Back in air at 14.2 s; the later half of the rest counts.
    let rate = air_drift_n_per_s(&insertion(0.3, 0.02, 0.0), 0.0).expect("air on both sides");
    assert!((rate - 0.02).abs() < 2e-4, "{rate}");
    // Levels are compared over the time between the middles of both stretches.
    let (t0, t1) = (0.5 + 0.5 * 1.66, 0.5 * (0.5 + 899.0 * 0.02 + 16.1));
    let rate = air_drift_n_per_s(&insertion(0.3, 0.0, 0.5), 0.0).expect("air on both sides");
    assert!((rate * (t1 - t0) - 0.5).abs() < 0.01, "{}", rate * (t1 - t0));
    assert_eq!(air_drift_n_per_s(&insertion(0.3, 0.02, 0.0), 0.03), None);
}
