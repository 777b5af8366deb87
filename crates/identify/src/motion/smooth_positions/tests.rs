use super::*;
use crate::motion::smooth_interval::adaptive_window_fit;

/// Cells every 20 ms with 10 µm of noise.
struct Given {
    t: Vec<f64>,
    z: Vec<f64>,
}

impl Given {
    fn new(n: usize, trajectory: impl Fn(f64) -> f64) -> Self {
        let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
        let z = t.iter().enumerate().map(|(k, t)| trajectory(*t) + 1e-5 * rough(k)).collect();
        Self { t, z }
    }

    fn cells(&self) -> Cells<'_> {
        Cells { t: &self.t, z: &self.z, dt: 0.02, noise_m: 1e-5, rounded_m: 0.0 }
    }

    fn intervals(&self, edges: &[usize]) -> Vec<SmoothInterval> {
        edges.windows(2).map(|e| SmoothInterval::new(&self.cells(), (e[0], e[1]), &[])).collect()
    }
}

fn borders(intervals: &[SmoothInterval]) -> Vec<(usize, usize)> {
    intervals.iter().map(|s| (s.from, s.to)).collect()
}

/// A line with a bend.
fn bent(at_s: f64, before: f64, after: f64) -> impl Fn(f64) -> f64 {
    move |t| if t < at_s { before * (t - at_s) } else { after * (t - at_s) }
}

/// Samples every 5 ms of positions with noise (m) for a given velocity.
fn driven(speed: impl Fn(f64) -> f64, lasts_s: f64, noise_m: f64, seed: usize) -> (Vec<f64>, SmoothedMotion) {
    let t: Vec<f64> = (0..(lasts_s / 0.005) as usize).map(|k| 0.005 * k as f64).collect();
    let mut at = 0.0;
    let z: Vec<f64> = t
        .iter()
        .enumerate()
        .map(|(k, t)| {
            let here = at + noise_m * rough(k + 10_000 * seed);
            at += (0..50).map(|j| 1e-4 * speed(t + 1e-4 * (f64::from(j) + 0.5))).sum::<f64>();
            here
        })
        .collect();
    let actual = smooth_positions(&t, &z);
    (t, actual)
}

/// 20 µm of noise hide jumps of 1 mm/s from a window of 0.3 s, and half a second of a sinusoid resembles a
/// rest with the start of a move.
#[test]
fn a_hold_is_recognised_before_slow_motion() {
    for ([before, after], rest_s) in [
        ([5.27e-3, 0.98e-3], 0.95),
        ([5.27e-3, 0.98e-3], 0.6),
        ([2e-3, 0.8e-3], 1.5),
        ([5e-3, -0.7e-3], 1.0),
        ([2e-3, 2e-3], 1.0),
        ([5e-3, 0.98e-3], 2.5),
    ] {
        let speed = |t: f64| match t {
            ..1.5 => before,
            _ if t < 1.5 + rest_s => 0.0,
            _ => after,
        };
        for seed in 0..12 {
            let (t, actual) = driven(speed, 8.5 + rest_s, 2e-5, seed);
            let rests = |t: f64| t > 1.55 && t < 1.45 + rest_s;
            let worst = t
                .iter()
                .zip(&actual.velocity_mps)
                .filter(|(t, _)| rests(**t))
                .fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
            assert!(worst < 5e-5, "{before} m/s, {rest_s} s, {after} m/s, seed {seed}: {worst} m/s");
        }
    }
}

/// 5 mm/s from 1 s, rest from 6 s, 1 mm/s from 7.5 s, rest from 12 s, back at 3 mm/s from 13 s; every
/// change has a finite duration.
#[test]
fn finite_accelerations_are_recovered() {
    for (ramp_s, noise_m, all_mps) in
        [(0.05, 5e-6, 5e-5), (0.1, 2e-5, 1e-4), (0.2, 2e-5, 1e-4), (0.3, 2e-5, 1e-4)]
    {
        let changes = [(1.0, 5e-3), (6.0, -5e-3), (7.5, 1e-3), (12.0, -1e-3), (13.0, -3e-3)];
        let speed =
            |t: f64| changes.iter().map(|(at, by)| by * ((t - at) / ramp_s).clamp(0.0, 1.0)).sum::<f64>();
        let (mut squares, mut n) = (0.0, 0.0);
        for seed in 0..8 {
            let (t, actual) = driven(speed, 18.0, noise_m, seed);
            for (t, v) in t.iter().zip(&actual.velocity_mps) {
                squares += (v - speed(*t)).powi(2);
                n += 1.0;
            }
        }
        let rms = f64::sqrt(squares / n);
        assert!(rms < all_mps, "{ramp_s} s, {noise_m} m: {rms} m/s");
    }
}

#[test]
fn an_interval_is_fitted_without_cells_next_to_jumps() {
    let mut given = Given::new(100, |t| 0.003 * t);
    // Cells next to jumps have both velocities.
    for k in [20, 79] {
        given.z[k] += 0.01;
    }
    let s = SmoothInterval::new(&given.cells(), (20, 80), &[]);
    let segment = s.segment.as_ref().expect("a form");
    assert!((s.at(&given.t, 1.0).1 - 0.003).abs() < 1e-5 && s.local.is_empty());
    assert_eq!(s.cost, segment.cost);
    // Slope of a line over 58 cells of 20 ms, doubled.
    let sd = 2.0 * segment.sd_m * (12.0 / 58.0_f64).sqrt() / (58.0 * 0.02);
    assert_eq!(s.sds.len(), 60);
    assert!(s.sds.iter().all(|x| (x / sd - 1.0).abs() < 1e-12));
    // At the ends of the recording all cells count.
    given.z[20] -= 0.01;
    given.z[79] -= 0.01;
    for k in [0, 99] {
        given.z[k] += 0.01;
    }
    let form =
        |from: usize, to: usize| SmoothInterval::new(&given.cells(), (from, to), &[]).segment.is_some();
    assert!(form(20, 80) && !form(0, 80) && !form(20, 100));
    // At rest the velocity is known.
    let rest = Given::new(100, |_| 0.07);
    assert_eq!(SmoothInterval::new(&rest.cells(), (0, 100), &[]).sds, [0.0; 100]);
    // Twice the position noise is too large a residual.
    let segment = SmoothInterval::new(&rest.cells(), (0, 100), &[]).segment.expect("a form");
    let quieter = |share: f64| Cells { noise_m: segment.sd_m * share, ..rest.cells() };
    assert!(SmoothInterval::new(&quieter(0.51), (0, 100), &[]).segment.is_some());
    assert!(SmoothInterval::new(&quieter(0.49), (0, 100), &[]).segment.is_none());
    // Thirteen cells between jumps, next to one, or in all.
    let few = |from: usize, to: usize| SmoothInterval::new(&rest.cells(), (from, to), &[]).segment.is_some();
    assert!(few(20, 35) && !few(20, 34));
    let short = Given::new(13, |_| 0.07);
    assert!(SmoothInterval::new(&short.cells(), (0, 13), &[]).segment.is_some());
    let short = Given::new(12, |_| 0.07);
    assert!(SmoothInterval::new(&short.cells(), (0, 12), &[]).segment.is_none());
}

#[test]
fn without_a_segment_motion_is_interpolated_between_cells() {
    let s = SmoothInterval {
        from: 2,
        to: 5,
        segment: None,
        local: vec![(1.0, 3.0), (2.0, 5.0), (6.0, -1.0)],
        sds: vec![1.0; 3],
        cost: f64::INFINITY,
    };
    let t = [0.0, 1.0, 2.0, 3.0, 5.0, 6.0];
    let expected = [
        (1.5, -0.5, 3.0),
        (2.0, 1.0, 3.0),
        (2.25, 1.25, 3.5),
        (3.0, 2.0, 5.0),
        (4.5, 5.0, 0.5),
        (7.0, 4.0, -1.0),
    ];
    for (at, z, v) in expected {
        let actual = s.at(&t, at);
        assert!((actual.0 - z).abs() < 1e-12 && (actual.1 - v).abs() < 1e-12, "{actual:?} at {at}");
    }
}

#[test]
fn intervals_of_one_segment_are_merged() {
    let line = Given::new(200, |t| 0.003 * t);
    assert_eq!(borders(&merge_neighbours(&line.cells(), line.intervals(&[0, 60, 110, 200]))), [(0, 200)]);
    let bend = Given::new(200, bent(2.2, 0.003, 0.004));
    assert_eq!(
        borders(&merge_neighbours(&bend.cells(), bend.intervals(&[0, 60, 110, 200]))),
        [(0, 110), (110, 200)]
    );
    // Parts of a ripple resemble cubics; together they are a sinusoid.
    let ripple = Given::new(200, |t| 0.003 * t + 4e-4 * (3.0 * t).sin());
    let actual = merge_neighbours(&ripple.cells(), ripple.intervals(&[0, 35, 70, 105, 200]));
    assert_eq!(borders(&actual), [(0, 200)]);
    let hz: Vec<f64> = actual[0].segment.iter().flat_map(MotionSegment::frequencies).collect();
    assert!(hz.len() == 1 && (hz[0] - 3.0).abs() < 0.02, "{hz:?}");
}

#[test]
fn an_interval_without_a_segment_is_split() {
    for bend in [60_usize, 130, 170] {
        let given = Given::new(260, bent(0.02 * bend as f64, 0.003, 0.009));
        let actual = split_unfitted(&given.cells(), given.intervals(&[0, 260]));
        assert_eq!(actual.len(), 2, "{:?}", borders(&actual));
        assert_eq!((actual[0].from, actual[0].to, actual[1].to), (0, actual[1].from, 260));
        assert!(actual[1].from.abs_diff(bend) <= 16, "{:?}", borders(&actual));
        assert!(actual[0].segment.is_some() && actual[1].segment.is_some());
    }
    // Two bends, and an interval that remains one segment.
    let given = Given::new(400, |t| {
        if t < 2.0 {
            0.003 * t
        } else if t < 4.0 {
            0.006 + 0.005 * (t - 2.0)
        } else {
            0.016 + 0.002 * (t - 4.0)
        }
    });
    let actual = split_unfitted(&given.cells(), given.intervals(&[0, 300, 400]));
    let b = borders(&actual);
    assert_eq!(b.len(), 4, "{b:?}");
    assert!(b.windows(2).all(|p| p[0].1 == p[1].0) && b[3] == (300, 400), "{b:?}");
    assert!(b[0].1.abs_diff(100) <= 12 && b[1].1.abs_diff(200) <= 12, "{b:?}");
    // Left whole where not even the beginning is a segment, or there is no room for two.
    let wild = Given {
        t: given.t.clone(),
        z: (0..400).map(|k| 1e-3 * (0.9 * f64::from(k * k)).sin() * f64::from(k)).collect(),
    };
    assert_eq!(borders(&split_unfitted(&wild.cells(), wild.intervals(&[0, 400]))), [(0, 400)]);
    let room = |n: usize| {
        let given = Given::new(n, bent(0.02 * 24.0, 0.003, 0.03));
        split_unfitted(&given.cells(), given.intervals(&[0, n])).len()
    };
    assert_eq!((room(47), room(48)), (1, 2));
}

#[test]
fn borders_move_to_intersections() {
    let given = Given::new(240, bent(2.4, 0.002, 0.006));
    let lines = [0.002, 0.006].map(|v| Given::new(240, move |t| v * (t - 2.4)));
    for border in [100, 110, 119, 120, 121, 132, 140] {
        let one = SmoothInterval::new(&lines[0].cells(), (0, border), &[]);
        let two = SmoothInterval::new(&lines[1].cells(), (border, 240), &[]);
        let actual = move_borders_to_intersections(&given.cells(), vec![one, two]);
        let b = borders(&actual);
        assert!(b[0].1 == b[1].0 && b[0].1.abs_diff(120) <= 1, "{b:?} from {border}");
        for (s, v) in actual.iter().zip([0.002, 0.006]) {
            assert!((s.at(&given.t, 2.4).1 - v).abs() < 2e-5);
        }
    }
    // At least the minimum number of cells stays on either side.
    let short = Given::new(240, bent(0.2, 0.002, 0.006));
    let mut both = short.intervals(&[0, 14, 240]);
    both[0] = SmoothInterval::new(&Given::new(240, |t| 0.002 * (t - 0.2)).cells(), (0, 14), &[]);
    assert_eq!(borders(&move_borders_to_intersections(&short.cells(), both)), [(0, 14), (14, 240)]);
    // Nothing moves without a segment on both sides.
    let mut half = given.intervals(&[0, 110, 240]);
    half[1].segment = None;
    assert_eq!(borders(&move_borders_to_intersections(&given.cells(), half)), [(0, 110), (110, 240)]);
}

#[test]
fn the_intersection_is_near_the_border() {
    // Lines of 2 and 6 mm/s that intersect at 2.4 s; the border is at cell 114, half a cell before 2.28 s.
    let (one, two) = (Given::new(240, |t| 0.002 * (t - 2.4)), Given::new(240, |t| 0.006 * (t - 2.4)));
    let of = |given: &Given, from: usize, to: usize| SmoothInterval::new(&given.cells(), (from, to), &[]);
    let whole = Given::new(240, bent(2.4, 0.002, 0.006));
    let at = intersection_time(&of(&one, 0, 114), &of(&two, 114, 240), &whole.cells()).expect("an instant");
    assert!((at - 2.4).abs() < 2e-3, "{at}");
    // The search is limited to half a second around the border.
    let at = intersection_time(&of(&one, 0, 60), &of(&two, 60, 240), &whole.cells()).expect("an instant");
    assert!((at - (1.19 + 0.5)).abs() < 1e-9, "{at}");
    let at = intersection_time(&of(&one, 0, 180), &of(&two, 180, 240), &whole.cells()).expect("an instant");
    assert!((at - (3.59 - 0.5)).abs() < 1e-9, "{at}");
    // Parallel segments meet at their border.
    let parallel = Given::new(240, |t| 0.002 * (t - 2.4) + 1e-4);
    let mut pair = [of(&one, 0, 100), of(&parallel, 100, 240)];
    pair[1].segment = pair[0].segment.clone();
    let at = intersection_time(&pair[0], &pair[1], &one.cells()).expect("an instant");
    assert!((at - 1.99).abs() < 1e-9, "{at}");
    pair[0].segment = None;
    assert_eq!(intersection_time(&pair[0], &pair[1], &one.cells()), None);
}

#[test]
fn a_jump_is_at_the_intersection_the_break_or_the_border() {
    let given = Given::new(240, bent(2.4, 0.002, 0.006));
    let samples: Vec<f64> = (0..960).map(|k| 0.005 * f64::from(k)).collect();
    let mut both = given.intervals(&[0, 120, 240]);
    let of = |both: &[SmoothInterval], found: &[SlopeBreak]| {
        jump_between(&both[0], &both[1], found, &given.cells(), &samples)
    };
    let jump = of(&both, &[]);
    assert!((jump.time_s - 2.4).abs() < 2e-3 && jump.position_m.abs() < 1e-5, "{jump:?}");
    assert!(
        (jump.velocity_mps[0] - 0.002).abs() < 2e-5 && (jump.velocity_mps[1] - 0.006).abs() < 2e-5,
        "{jump:?}"
    );
    assert!(samples[jump.next_sample] >= jump.time_s && samples[jump.next_sample - 1] < jump.time_s);
    let sd = |s: &SmoothInterval| s.segment.as_ref().map_or(0.0, |c| 3.0 * c.sd_m / 120.0_f64.sqrt());
    assert!((jump.position_sd_m - sd(&both[0]).hypot(sd(&both[1]))).abs() < 1e-12);
    // Without a segment: the break found at that cell.
    both[0].segment = None;
    both[0].local = (0..120).map(|k| (given.z[k], 0.002)).collect();
    let found = [(90, (1.7, 5.0, 6.0), 7.0), (120, (2.3931, 0.1, 0.2), 0.3)];
    let jump = of(&both, &found);
    assert_eq!(
        (jump.time_s, jump.position_m, jump.velocity_mps, jump.position_sd_m),
        (2.3931, 0.1, [0.2, 0.3], 1e-5)
    );
    assert_eq!(jump.next_sample, 479);
    // Or half a cell before the border, midway between both sides.
    let jump = of(&both, &found[..1]);
    assert!((jump.time_s - 2.39).abs() < 1e-12);
    let sides = [both[0].at(&given.t, jump.time_s), both[1].at(&given.t, jump.time_s)];
    assert!((jump.position_m - 0.5 * (sides[0].0 + sides[1].0)).abs() < 1e-15);
    assert_eq!(jump.velocity_mps, [sides[0].1, sides[1].1]);
}

#[test]
fn the_widest_consistent_window_is_used() {
    // A parabola fits at any window.
    let t: Vec<f64> = (0..200).map(|k| 0.02 * f64::from(k)).collect();
    let z: Vec<f64> = t.iter().map(|t| 0.01 + 0.003 * t + 0.002 * t * t).collect();
    // Slope of a line over n cells: sd = noise sqrt(12/n) over the span; at the end of a parabola four
    // times that.
    let sd =
        |n: f64, off: f64| 1e-5 * (12.0 / n).sqrt() / (0.02 * (n - 1.0)) * (1.0 + 15.0 * off * off).sqrt();
    // Cell, limits, number of cells of the widest window, relative offset from its middle.
    let cases = [
        (100, (0, 200), 121.0, 0.0),
        (80, (0, 200), 121.0, 0.0),
        (0, (0, 200), 61.0, 1.0),
        (199, (0, 200), 61.0, 1.0),
        (20, (0, 200), 81.0, 20.0 / 40.0),
        (100, (90, 140), 50.0, 14.5 / 24.5),
        (100, (97, 105), 8.0, 0.5 / 3.5),
    ];
    for (i, (from, to), n, off) in cases {
        let actual = adaptive_window_fit(&t, &z, i, (from, to), 1e-5);
        assert!(
            (actual.0 - z[i]).abs() < 1e-9 && (actual.1 - 0.003 - 0.004 * t[i]).abs() < 1e-8,
            "{actual:?} at {i}"
        );
        assert!((actual.2 / sd(n, off) - 1.0).abs() < 1e-9, "{actual:?} at {i}: {}", sd(n, off));
    }
    // Near a velocity change within twelve cells the window is narrower.
    let jump: Vec<f64> =
        t.iter().map(|t| 0.003 * t + if *t > 2.2 { 0.02 * (t - 2.2) } else { 0.0 }).collect();
    let actual = adaptive_window_fit(&t, &jump, 100, (0, 200), 1e-5);
    assert!((actual.1 - 0.003).abs() < 1e-5, "{actual:?}");
    assert!(actual.2 >= sd(25.0, 0.0) * 0.999 && actual.2 < sd(7.0, 0.0), "{actual:?}");
    // Three cells give a position and no velocity.
    assert_eq!(adaptive_window_fit(&t, &z, 100, (99, 102), 1e-5), (z[100], 0.0, f64::INFINITY));
    assert!(adaptive_window_fit(&t, &z, 100, (99, 103), 1e-5).2.is_finite());
}

#[test]
fn a_short_recording_is_differentiated() {
    let of = |n: usize| {
        let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
        let z: Vec<f64> = t.iter().enumerate().map(|(k, t)| 0.003 * t + 1e-5 * rough(k)).collect();
        (smooth_positions(&t, &z), stylet_record::differentiate(&t, &z, 0.1), z)
    };
    let (actual, v, z) = of(31);
    assert_eq!((actual.position_m, actual.velocity_mps, actual.sd_mps), (z, v, f64::INFINITY));
    assert!(actual.jumps.is_empty());
    let (actual, _, _) = of(32);
    assert!(actual.sd_mps < 1e-3 && actual.velocity_mps.iter().all(|v| (v - 0.003).abs() < 1e-4));
}

/// Insertion with ripple, a hold, a retraction.
fn trajectory(t: f64) -> (f64, f64) {
    let w = core::f64::consts::TAU * 0.4;
    let a = 0.001;
    if t < 6.0 {
        (0.003 * t + a / w * (1.0 - (w * t).cos()), 0.003 + a * (w * t).sin())
    } else if t < 9.0 {
        (trajectory(6.0 - 1e-9).0, 0.0)
    } else {
        (trajectory(7.0).0 - 0.004 * (t - 9.0), -0.004)
    }
}

fn error(trajectory: impl Fn(f64) -> (f64, f64), noise: impl Fn(usize) -> f64, round_m: f64) -> (f64, usize) {
    let t: Vec<f64> = (0..2400).map(|k| k as f64 / 200.0).collect();
    let round = |z: f64| if round_m > 0.0 { (z / round_m).round() * round_m } else { z };
    let z: Vec<f64> = t.iter().enumerate().map(|(k, t)| round(trajectory(*t).0 + noise(k))).collect();
    let found = smooth_positions(&t, &z);
    let mut off: Vec<f64> =
        found.velocity_mps.iter().zip(&t).map(|(v, t)| (v - trajectory(*t).1).abs()).collect();
    off.sort_unstable_by(f64::total_cmp);
    (off[off.len() * 9 / 10], found.jumps.len())
}

/// A fixed sequence that resembles noise of unit variance.
fn rough(k: usize) -> f64 {
    let mut h = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut sum = 0.0;
    for _ in 0..12 {
        h ^= h >> 29;
        h = h.wrapping_mul(0xbf58_476d_1ce4_e5b9);
        sum += (h >> 40) as f64 / (1u64 << 24) as f64;
    }
    sum - 6.0
}

#[test]
fn noise_of_20_um_gives_velocity_to_10_um_per_second() {
    let (off, jumps) = error(trajectory, |k| 2e-5 * rough(k), 0.0);
    assert!(off < 1e-5, "{off}");
    assert_eq!(jumps, 2);
}

#[test]
fn quantisation_of_50_um_gives_velocity_to_10_um_per_second() {
    let (off, jumps) = error(trajectory, |_| 0.0, 5e-5);
    assert!(off < 1e-5, "{off}");
    assert_eq!(jumps, 2);
}

/// 4.93 mm/s are 98.6 quantisation steps of 50 µm per second, nearly one in two samples at 200 Hz: a beat
/// of 3 Hz and 0.1 mm/s.
#[test]
fn quantisation_beating_with_the_sampling_is_not_a_ripple() {
    for speed_mps in [0.00493, 0.00494, 0.00495, 0.00506, 0.00507] {
        let line = |t: f64| if t < 2.0 { (0.0, 0.0) } else { (speed_mps * (t - 2.0), speed_mps) };
        let (off, jumps) = error(line, |_| 0.0, 5e-5);
        assert!(off < 1e-5, "{speed_mps}: {off}");
        assert_eq!(jumps, 1, "{speed_mps}");
    }
}

#[test]
fn a_fast_ripple_is_not_a_chain_of_jumps() {
    let w = core::f64::consts::TAU * 1.4;
    let rippled = move |t: f64| {
        let s = (t - 5.0).max(0.0);
        (0.003 * t + 0.002 / w * (1.0 - (w * s).cos()), 0.003 + 0.002 * (w * s).sin())
    };
    let (off, jumps) = error(rippled, |k| 2e-5 * rough(k), 0.0);
    assert!(off < 2e-5, "{off}");
    assert!(jumps <= 1, "{jumps}");
}

#[test]
fn a_jump_of_300_um_per_second_is_detected() {
    let bent = |t: f64| {
        if t < 6.0 { (0.003 * t, 0.003) } else { (0.018 + 0.0033 * (t - 6.0), 0.0033) }
    };
    let (off, jumps) = error(bent, |k| 2e-5 * rough(k), 0.0);
    assert!(off < 1e-5, "{off}");
    assert_eq!(jumps, 1);
}

/// A ripple that starts at a line returns to it: they intersect more than once.
#[test]
fn of_several_intersections_the_best_fitting_one_is_used() {
    let w = core::f64::consts::TAU * 1.22;
    let ripple =
        move |s: f64| (0.0069 * s + 0.0055 / w * (1.0 - (w * s).cos()), 0.0069 + 0.0055 * (w * s).sin());
    let actual = move |begin: f64| {
        move |t: f64| {
            let s = t - begin;
            let at = 0.0039 * begin;
            if s < 0.0 {
                (0.0039 * t, 0.0039)
            } else if s < 3.86 {
                (at + ripple(s).0, ripple(s).1)
            } else {
                (at + ripple(3.86).0 + 0.0056 * (s - 3.86), 0.0056)
            }
        }
    };
    let t: Vec<f64> = (0..1800).map(|k| f64::from(k) / 200.0).collect();
    for k in 0..12 {
        let begin = 4.0 + 0.0137 * f64::from(k);
        let z: Vec<f64> = t.iter().map(|t| (actual(begin)(*t).0 / 5e-5).round() * 5e-5).collect();
        let found = smooth_positions(&t, &z);
        let calm = |t: f64| t < begin + 3.5 && (t - begin).abs() > 0.03;
        let off = |(t, v): (&f64, &f64)| if calm(*t) { (v - actual(begin)(*t).1).abs() } else { 0.0 };
        let most = t.iter().zip(&found.velocity_mps).map(off).fold(0.0, f64::max);
        assert!(most < 5e-4, "begin {begin}: {most}");
    }
}

#[test]
fn a_chirp_is_followed_by_local_windows() {
    // A chirp: neither a low-order polynomial nor a sinusoid.
    let drawn =
        |t: f64| (0.002 * t + 4e-4 * (1.0 + (0.3 * t * t).sin()), 0.002 + 2.4e-4 * t * (0.3 * t * t).cos());
    let (off, _) = error(drawn, |k| 2e-5 * rough(k), 0.0);
    assert!(off < 8e-4, "{off}");
}
