use super::{
    SPEED_TOLERANCE, STROKE_TOLERANCE_M, SegmentedRecording, group_by_speed_and_stroke, have_one_speed,
    have_several_speeds, mean_speeds,
};
use stylet_record::Recording;
use stylet_tissue::{Layer, Tissue};

pub(crate) fn run(name: &str, speed_mps: f64, stroke_m: f64) -> SegmentedRecording {
    let travel = stroke_m / speed_mps;
    let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
    let mut k = 0;
    loop {
        let at = 0.01 * f64::from(k);
        let place = match at {
            x if x < travel => speed_mps * x,
            x if x < travel + 1.0 => stroke_m,
            x => stroke_m - speed_mps * (x - travel - 1.0),
        };
        if place < 0.0 {
            break;
        }
        let inward = at < travel + 1.0;
        let load = match (inward, place) {
            (true, z) if z < 0.004 => 0.0,
            (true, z) if z < 0.010 => 500.0 * (z - 0.004),
            (true, z) if z < 0.022 => 1.0 + 200.0 * (z - 0.010),
            (true, z) => 1.2 + 50.0 * (z - 0.022),
            (false, z) if z > 0.0185 => -2.0,
            (false, z) if z > 0.007 => -1.0,
            (false, _) => 0.0,
        };
        t.push(at);
        z.push(place);
        f.push(load + 1e-3 * (f64::from((k * 37) % 11) / 11.0 - 0.5));
        k += 1;
    }
    SegmentedRecording::new(name.to_owned(), Recording::new(t, z, f).expect("clean columns"), 2)
}

pub(crate) fn assumed() -> Tissue {
    let layer = |d: f64| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: 300.0,
        friction_ns_per_m2: 100.0,
        puncture_n: Some(4.0),
    };
    Tissue { surface_m: 0.001, layers: vec![layer(0.009), layer(0.03)] }
}

#[test]
fn a_recording_is_segmented_by_its_force() {
    let r = run("a", 0.005, 0.026);
    assert!((r.speed_mps - 0.005).abs() < 2e-4, "{}", r.speed_mps);
    assert!((r.stroke_m - 0.026).abs() < 1e-9);
    assert!((r.contact_m - 0.004).abs() < 6e-4, "{}", r.contact_m);
    assert!((r.ruptures_s[0] - 1.995).abs() < 0.011, "{:?}", r.ruptures_s);
    assert!((r.ruptures_s[1] - 4.395).abs() < 0.011, "{:?}", r.ruptures_s);
    assert!((r.ruptures_s[0] * 200.0).fract().abs() < 1e-6, "{}", r.ruptures_s[0]);
    let loads: Vec<f64> = r.loads_n.iter().flatten().copied().collect();
    assert!((loads[0] - 2.9).abs() < 0.06 && (loads[1] - 3.36).abs() < 0.06, "{loads:?}");
    let releases: Vec<f64> = r.releases_m.iter().flatten().copied().collect();
    assert_eq!(releases.len(), 2);
    assert!((releases[0] - 0.007).abs() < 6e-4 && (releases[1] - 0.0185).abs() < 6e-4, "{releases:?}");
    // With three layers the second release cannot be assigned.
    let three = SegmentedRecording::new("b".to_owned(), r.recording.clone(), 3);
    assert!(three.releases_m[0].is_some() && three.releases_m[1..].iter().all(Option::is_none));
    assert_eq!(three.ruptures_s[..2], r.ruptures_s[..]);
    assert!(r.noise_n() < 2e-3 && r.noise_n() > 1e-5, "{}", r.noise_n());
    // Two ruptures, and the reversal of the motion.
    assert_eq!(r.drops().len(), 3);
}

#[test]
fn recordings_are_grouped_by_speed_and_stroke_slowest_first() {
    let mut all: Vec<SegmentedRecording> = (0..6).map(|_| run("a", 0.005, 0.026)).collect();
    for (r, (speed, stroke)) in all.iter_mut().zip([
        (0.005, 0.0300),
        (0.001, 0.0200),
        (0.00549, 0.0309),
        (0.00551, 0.0300),
        (0.0010, 0.0209),
        (0.0010, 0.0211),
    ]) {
        (r.speed_mps, r.stroke_m) = (speed, stroke);
    }
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    assert_eq!(group_by_speed_and_stroke(&refs), vec![vec![1, 4], vec![5], vec![0, 2], vec![3]]);
}

#[test]
fn a_difference_equal_to_the_tolerance_makes_a_new_group() {
    let one = run("a", 0.005, 0.026);
    let of = |speed_mps: f64, stroke_m: f64| SegmentedRecording { speed_mps, stroke_m, ..one.clone() };
    let (slow, fast) = (0.004, 0.004 * (1.0 + SPEED_TOLERANCE));
    let all = [of(slow, 0.0), of(fast, 0.0), of(slow, STROKE_TOLERANCE_M)];
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    assert_eq!(group_by_speed_and_stroke(&refs), vec![vec![0], vec![2], vec![1]]);
    // Two speeds at the tolerance identify a rate.
    assert!(!have_one_speed(&refs[..2]));
}

#[test]
fn one_speed_is_not_several() {
    let run = |speed: f64| {
        let t: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
        let z = t.iter().map(|t| (speed * t).min(0.01)).collect();
        SegmentedRecording::new(
            String::new(),
            Recording::new(t, z, vec![0.0; 200]).expect("clean columns"),
            1,
        )
    };
    let (a, b, c) = (run(0.002), run(0.002), run(0.004));
    assert!(!have_several_speeds(&[&a, &b]) && have_several_speeds(&[&a, &c]));
}

#[test]
fn speeds_are_the_means_of_their_groups() {
    let run = |speed: f64| {
        let t: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
        let z = t.iter().map(|t| (speed * t).min(0.01)).collect();
        SegmentedRecording::new(
            String::new(),
            Recording::new(t, z, vec![0.0; 400]).expect("clean columns"),
            1,
        )
    };
    let mut all = [run(0.004), run(0.002), run(0.002)];
    (all[1].speed_mps, all[2].speed_mps) = (0.00205, 0.002);
    let refs: Vec<&SegmentedRecording> = all.iter().collect();
    let result = mean_speeds(&refs);
    assert_eq!(result.iter().map(|s| s.1.clone()).collect::<Vec<_>>(), [vec![1, 2], vec![0]]);
    assert!((result[0].0 - 0.002025).abs() < 1e-12 && result[1].0 == all[0].speed_mps);
}
