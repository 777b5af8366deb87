use super::{
    BUILD_UP_LENGTHS, Corner, CornerKind, CornerResiduals, LagModel, MIN_LAG_S, STEP_S, detect_lag, minimum,
    total_residual,
};
use crate::repeated_insertions::SegmentedRecording;
use crate::test_fixtures::uniform_sequence;
use stylet_record::Recording;

#[test]
fn the_minimum_is_interpolated_by_a_parabola() {
    for place in [2.0, 2.3, 3.49, 5.75] {
        let curve: Vec<f64> = (0..9).map(|k| 4.0 + 1.7 * (f64::from(k) - place).powi(2)).collect();
        let (at, height) = minimum(&curve);
        assert!((at - place * STEP_S).abs() < 1e-12, "{place}: {at}");
        let nearest = curve.iter().copied().fold(f64::INFINITY, f64::min);
        assert_eq!(height, nearest);
    }
    assert_eq!(minimum(&[1.0, 2.0, 5.0]), (0.0, 1.0));
    assert_eq!(minimum(&[5.0, 2.0, 1.0]), (2.0 * STEP_S, 1.0));
    assert_eq!(minimum(&[7.0, 7.0, 7.0]), (0.0, 7.0));
}

#[test]
fn corners_are_summed_at_the_best_length_of_each_kind() {
    let one = |name: &str, add: f64| CornerResiduals {
        name: name.to_owned(),
        by: std::array::from_fn(|d| {
            (0..3).map(|k| add + (d as f64 - 1.0).powi(2) + 10.0 * k as f64).collect()
        }),
    };
    let back = vec![one("a", 1.0), one("b", 4.0)];
    let stop = vec![one("b", 0.5)];
    let all = total_residual(&[back, stop], None);
    assert_eq!(all, [5.5, 35.5, 65.5]);
    let back = vec![one("a", 1.0), one("b", 4.0)];
    let stop = vec![one("b", 0.5)];
    assert_eq!(total_residual(&[back, stop], Some("b")), [1.0, 11.0, 21.0]);
}

/// Advance for 8 s, hold, retraction at 50 Hz; the force follows the position with a delay and a lag.
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
        let back =
            if at - delay_s > 8.0 + rest_s { 0.6 * libm::exp(-(0.018 - there) / 3e-4) - 0.6 } else { 0.0 };
        let share = if lag_s > 0.0 && k > 0 { 1.0 - libm::exp(-0.02 / lag_s) } else { 1.0 };
        slow += (load + back - slow) * share;
        t.push(at);
        f.push(slow + 0.002 * (noise as f64 / 2_147_483_648.0 - 0.5));
    }
    let z = t.iter().map(|t| z(*t)).collect();
    SegmentedRecording::new(name.to_owned(), Recording::new(t, z, f).expect("clean columns"), 1)
}

fn detected(rest_s: f64, delay_s: f64, lag_s: f64) -> Option<super::DetectedLag> {
    let recordings: Vec<SegmentedRecording> =
        (0..4).map(|k| run(&format!("{k}"), rest_s, delay_s, lag_s, 17 + 5 * k)).collect();
    detect_lag(&recordings.iter().collect::<Vec<_>>())
}

#[test]
fn delay_and_low_pass_lag_are_distinguished_and_measured() {
    assert_eq!(detected(4.0, 0.0, 0.0), None);
    let l = detected(4.0, 0.26, 0.0).expect("late");
    assert_eq!(l.model, LagModel::PureDelay);
    assert!((l.value_s - 0.26).abs() < 0.01 && l.low_s < l.value_s && l.value_s < l.high_s, "{l:?}");
    let l = detected(4.0, 0.0, 0.32).expect("slow");
    assert_eq!(l.model, LagModel::LowPass);
    assert!((l.value_s - 0.32).abs() < 0.02, "{l:?}");
    assert!(l.high_s - l.low_s < 0.1 && (l.high_s + l.low_s - 2.0 * l.value_s).abs() < 1e-9, "{l:?}");
    // Too short: play of the drive.
    assert_eq!(detected(4.0, MIN_LAG_S - 0.03, 0.0), None);
}

#[test]
fn a_trembling_advance_before_the_reversal_shows_no_delay() {
    // Advance at 2.5 mm/s, modulated by 30 % at 0.5 Hz, then retraction; the friction on the shaft follows the velocity.
    let trembling = |seed: u64| {
        let (mut t, mut z, mut f, mut tip, mut noise) = (vec![], vec![], vec![], -0.002, seed);
        for k in 0..900 {
            let at = 0.02 * f64::from(k);
            let v = if at < 10.0 {
                0.0025 * (1.0 + 0.3 * libm::sin(core::f64::consts::PI * at))
            } else {
                -0.0025
            };
            tip = f64::max(tip + 0.02 * v, -0.002);
            noise = (noise * 1_103_515_245 + 12_345) % 2_147_483_648;
            let inside = f64::max(tip, 0.0);
            t.push(at);
            z.push(tip);
            f.push((100.0 + 6000.0 * v) * inside + 0.01 * (noise as f64 / 2_147_483_648.0 - 0.5));
        }
        SegmentedRecording::new(seed.to_string(), Recording::new(t, z, f).expect("clean columns"), 1)
    };
    let recordings: Vec<SegmentedRecording> = (3..7).map(trembling).collect();
    assert_eq!(detect_lag(&recordings.iter().collect::<Vec<_>>()), None);
}

#[test]
fn the_interval_of_a_delay_is_a_jackknife_interval() {
    let recordings: Vec<SegmentedRecording> = [0.26, 0.3, 0.36]
        .iter()
        .enumerate()
        .map(|(k, by)| run(&format!("{k}"), 4.0, *by, 0.0, 17 + 5 * k as u64))
        .collect();
    let result = detect_lag(&recordings.iter().collect::<Vec<_>>()).expect("late");
    let others: Vec<f64> = (0..3)
        .map(|out| {
            let rest: Vec<&SegmentedRecording> =
                (0..3).filter(|k| *k != out).map(|k| &recordings[k]).collect();
            detect_lag(&rest).expect("late").value_s
        })
        .collect();
    let mean = others.iter().sum::<f64>() / 3.0;
    let sd = (others.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 2.0).sqrt();
    // 97.5 % point of Student's distribution with two degrees of freedom.
    let half = 4.302_653 * sd * 2.0 / 3.0_f64.sqrt();
    assert!(half > 0.02, "{half}");
    assert!((result.high_s - result.value_s - half).abs() < 1e-6, "{result:?} for {half}");
    assert!((result.low_s - (result.value_s - half).max(0.0)).abs() < 1e-6, "{result:?} for {half}");
}

#[test]
fn a_delay_needs_corners_in_half_of_the_recordings() {
    let result = |with: usize, without: usize| {
        let recordings: Vec<SegmentedRecording> = (0..with + without)
            .map(|k| run(&format!("{k}"), if k < with { 4.0 } else { 0.5 }, 0.26, 0.0, 17 + 5 * k as u64))
            .collect();
        detect_lag(&recordings.iter().collect::<Vec<_>>()).is_some()
    };
    assert!(result(2, 2) && result(3, 3));
    assert!(!result(1, 0) && !result(2, 3));
}

#[test]
fn only_isolated_corners_count() {
    let has = |run: &SegmentedRecording| {
        [CornerKind::Reversal, CornerKind::Stop].map(|at| Corner::of(run, at).is_some())
    };
    assert_eq!(has(&run("a", 4.0, 0.0, 0.0, 3)), [true, true]);
    // A hold shorter than the windows: both corners overlap.
    assert_eq!(has(&run("a", 0.5, 0.0, 0.0, 3)), [false, false]);
    assert_eq!(has(&run("a", 0.9, 0.0, 0.0, 3)), [false, true]);
    assert_eq!(has(&run("a", 0.0, 0.0, 0.0, 3)), [true, false]);
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
    let corner = Corner::of(&whole, CornerKind::Reversal).expect("a corner");
    assert!((corner.at_s - 12.02).abs() < 0.06, "{}", corner.at_s);
    assert!((corner.turned_m - 0.018).abs() < 1e-9);
    assert_eq!(corner.time_s.len(), corner.force_n.len());
    assert!((corner.time_s[0] - (corner.at_s - 1.0)).abs() < 0.021);
    assert!((corner.time_s[corner.time_s.len() - 1] - (corner.at_s + 0.8)).abs() < 0.021);
    assert_eq!(corner.time_s[0], whole.recording.time_s[corner.first]);
}

#[test]
fn the_corner_model_has_zero_residual_on_its_own_force() {
    for (at, delta) in
        [(CornerKind::Stop, BUILD_UP_LENGTHS[1][2]), (CornerKind::Reversal, BUILD_UP_LENGTHS[0][3])]
    {
        let mut r = run("a", 4.0, 0.0, 0.0, 3);
        let (stop, back) = (r.phases.deepest, r.phases.retraction);
        let corner_s = r.recording.time_s[if at == CornerKind::Stop { stop } else { back }];
        // A creep until shortly before the reversal is not part of it.
        for k in stop..back - 5 {
            r.recording.position_m[k] -= if at == CornerKind::Reversal { 5e-4 } else { 0.0 };
        }
        let turned = r.recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for k in 0..r.recording.len() {
            let (t, z) = (r.recording.time_s[k] - corner_s, r.recording.position_m[k]);
            let (u, before) = match at {
                CornerKind::Stop => (t.max(0.0), 90.0 * z),
                CornerKind::Reversal if t < -0.2 => (0.0, 0.3 * t),
                CornerKind::Reversal => (turned - z, 0.3 * t),
            };
            r.recording.force_n[k] = 1.0 + before - 0.2 * u / delta - 0.7 * (1.0 - (-u / delta).exp());
        }
        let corner = Corner::of(&r, at).expect("a corner");
        let left = corner.residual_square_sum(LagModel::PureDelay, 0.0, delta);
        assert!(left < 1e-12, "{at:?}: {left:e}");
        assert!(corner.residual_square_sum(LagModel::PureDelay, 0.3, delta) > 1e-4);
    }
}

#[test]
fn a_delay_must_reduce_the_residual_enough() {
    let mut spread = uniform_sequence(11);
    let recordings: Vec<SegmentedRecording> = (0..4)
        .map(|k| {
            let mut r = run(&format!("{k}"), 4.0, 0.4, 0.0, 17 + 5 * k);
            for f in &mut r.recording.force_n {
                *f = 0.25 * *f + 1.5 * (spread() - 0.5);
            }
            r.ruptures_s.fill(f64::INFINITY);
            r
        })
        .collect();
    assert_eq!(detect_lag(&recordings.iter().collect::<Vec<_>>()), None);
}
