use super::*;
use crate::test_support::assert_close;

/// Samples every 10.1 ms; the needle moves by `step_m` per sample, forward and, from sample `back` on,
/// backward.
fn recording(force_n: &[f64], step_m: f64, back: usize) -> Recording {
    let t = (0..force_n.len()).map(|k| 0.0101 * k as f64).collect();
    let z =
        (0..force_n.len()).map(|k| step_m * if k < back { k as f64 } else { 2.0 * back as f64 - k as f64 });
    Recording::new(t, z.collect(), force_n.to_vec()).expect("a recording")
}

/// The whole recording as one insertion.
fn whole(r: &Recording) -> InsertionPhases {
    InsertionPhases { start: 0, deepest: r.len() - 1, retraction: r.len() }
}

#[test]
fn noise_is_estimated_from_the_median_difference() {
    assert_eq!(noise_n(&[]), 0.0);
    assert_eq!(noise_n(&[3.0]), 0.0);
    // Differences of 0.1, 0.7, 0.2, 0.4: the upper median is 0.4.
    assert_close(noise_n(&[1.0, 1.1, 0.4, 0.6, 0.2]), 0.4 / (0.6745 * 2.0_f64.sqrt()));
    assert_close(noise_n(&[1.0, 1.1, 0.4, 0.6]), 0.2 / (0.6745 * 2.0_f64.sqrt()));
}

#[test]
fn the_drop_threshold_is_a_share_of_the_force_or_a_multiple_of_the_noise() {
    let quiet: Vec<f64> = (0..50).map(|k| if k < 30 { 0.0 } else { -2.5 }).collect();
    assert_close(min_drop_n(&recording(&quiet, 1e-4, 99)), 0.06 * 2.5);
    let rough: Vec<f64> = (0..50).map(|k| if k % 2 == 0 { 0.0 } else { 0.3 }).collect();
    assert_close(min_drop_n(&recording(&rough, 1e-4, 99)), 12.0 * 0.3 / (0.6745 * 2.0_f64.sqrt()));
}

/// A rest, an insertion, a hold, a retraction.
#[test]
fn phases_agree_with_the_commanded_motion() {
    let plan = |k: usize, out: f64| match k {
        0..=20 => 0.001,
        21..=120 => 0.001 + 3e-4 * (k - 20) as f64,
        121..=150 => 0.031,
        _ => 0.031 - out * (k - 150) as f64,
    };
    let of = |n: usize, out: f64| {
        let z: Vec<f64> = (0..n).map(|k| plan(k, out)).collect();
        let t: Vec<f64> = (0..n).map(|k| 0.01 * k as f64).collect();
        detect_phases(&Recording::new(t, z, vec![0.0; n]).expect("a recording"))
    };
    // Insertion from sample 21, deepest at 120, further back by more than 0.1 mm at 151.
    assert_eq!(of(220, 4e-4), InsertionPhases { start: 21, deepest: 120, retraction: 151 });
    // A slow retraction passes 0.1 mm a sample later; 3 mm of 30 count as retraction.
    assert_eq!(of(220, 5.5e-5).retraction, 152);
    assert_eq!((of(220, 4.4e-5).retraction, of(220, 4.3e-5).retraction), (153, 220));
    // Less than a tenth of the travel is not a retraction.
    assert_eq!(of(150 + 8, 4e-4).retraction, 158);
    assert_eq!(of(150 + 9, 4e-4).retraction, 151);
    // Short travel: the tolerance at the deepest point is 1/200 of it.
    let z: Vec<f64> = (0..=200).map(|k| 1e-5 * f64::from(k)).collect();
    let t: Vec<f64> = (0..=200).map(|k| 0.01 * f64::from(k)).collect();
    let short = detect_phases(&Recording::new(t, z, vec![0.0; 201]).expect("a recording"));
    // 0.01 mm: half of it is passed at the first step; the deepest point is within it at the last sample
    // only.
    assert_eq!(short, InsertionPhases { start: 1, deepest: 200, retraction: 201 });
}

#[test]
fn a_window_is_sixty_milliseconds_and_five_samples() {
    let even = |step: f64| -> Vec<f64> { (0..200).map(|k| step * f64::from(k)).collect() };
    assert_eq!(window_end(&even(0.001), 7), 7 + 60);
    assert_eq!(window_end(&even(0.0101), 3), 3 + 6);
    assert_eq!(window_end(&even(0.05), 3), 8);
    assert_eq!(window_end(&even(0.001), 170), 200);
    assert_eq!(window_end(&even(0.001), 198), 203);
}

#[test]
fn a_fall_is_abrupt_when_three_samples_contain_most_of_it() {
    assert!(is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.0));
    // Exactly 70 % is not more than 70 %.
    assert!(!is_abrupt(&[10.0, 10.0, 7.0, 3.0, 0.0], 0.0));
    assert!(is_abrupt(&[10.0, 10.0, 7.0, 2.9, 0.0], 0.0));
    assert!(!is_abrupt(&[1.0, 0.8, 0.6, 0.4, 0.2, 0.0], 0.0));
    // Continues by a fifth.
    assert!(is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.19));
    assert!(!is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.2));
    // Independent of the force level.
    assert!(
        is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.19) && !is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.21)
    );
}

/// A force that rises at a constant rate and falls at two samples.
fn falls() -> Vec<f64> {
    let (mut f, mut x) = (Vec::new(), 0.0);
    for k in 0..200 {
        x += match k {
            60 => -0.5,
            61 => -0.1,
            130 => -0.9,
            _ => 0.01,
        };
        f.push(x);
    }
    f
}

#[test]
fn drops_have_the_time_and_size_of_the_fall() {
    let r = recording(&falls(), 1e-4, 999);
    let actual = abrupt_drops(&r, &whole(&r));
    assert_eq!(actual.iter().map(|d| d.sample).collect::<Vec<_>>(), [60, 130]);
    // From four samples before to five after: the drop minus the rise in between.
    assert_close(actual[0].size_n, falls()[56] - falls()[65]);
    assert_close(actual[0].size_n, 0.6 - 0.07);
    assert_close(actual[1].size_n, 0.9 - 0.08);
    // None during retraction, nor before the motion.
    let until = |back: usize, start: usize| {
        abrupt_drops(&r, &InsertionPhases { start, deepest: back, retraction: back })
    };
    assert_eq!(until(100, 0).len(), 1);
    assert_eq!(until(200, 61).len(), 1);
    assert_eq!(until(40, 0).len(), 0);
    // The window that contains it begins six samples before.
    assert_eq!(until(55, 0).len(), 1);
    assert_eq!(until(54, 0).len(), 0);
    // A rise is not a drop.
    let up: Vec<f64> = falls().iter().map(|f| -f).collect();
    assert_eq!(abrupt_drops(&recording(&up, 1e-4, 999), &whole(&r)).len(), 0);
}

/// A fall that continues is not a drop.
#[test]
fn a_continued_fall_is_not_a_drop() {
    let relaxing: Vec<f64> = (0..200)
        .map(|k| if k < 60 { 0.02 * f64::from(k) } else { 1.18 * libm::exp(-0.1 * f64::from(k - 59)) })
        .collect();
    let r = recording(&relaxing, 1e-4, 999);
    assert_eq!(abrupt_drops(&r, &whole(&r)), []);
    let stepped: Vec<f64> = relaxing.iter().enumerate().map(|(k, f)| if k < 60 { *f } else { 0.1 }).collect();
    let r = recording(&stepped, 1e-4, 999);
    assert_eq!(abrupt_drops(&r, &whole(&r)).iter().map(|d| d.sample).collect::<Vec<_>>(), [60]);
}

#[test]
fn small_drops_before_the_first_rupture_are_ignored() {
    let drop = |at: usize, size_n: f64| AbruptDrop { sample: at, size_n };
    let all = [drop(5, 0.3), drop(9, 0.4), drop(20, 0.1), drop(40, 1.0)];
    assert_eq!(rupture_samples(&all, 2), [Some(9), Some(20)]);
    assert_eq!(rupture_samples(&all, 4), [Some(9), Some(20), Some(40), None]);
    assert_eq!(rupture_samples(&[drop(5, 0.399), drop(40, 1.0)], 2), [Some(40), None]);
    assert_eq!(rupture_samples(&[], 1), [None]);
}

/// A force below zero that steps towards zero three times during retraction, the second time in two steps.
fn released() -> (Recording, InsertionPhases) {
    let (mut f, mut x) = (Vec::new(), -3.0);
    for k in 0..300 {
        x += match k {
            120 => 1.1,
            180 => 0.6,
            192 => 0.4,
            250 => 0.3,
            _ => 0.0,
        };
        f.push(x);
    }
    // 0.1 mm per sample: the two steps in the middle are 1.2 mm apart.
    (recording(&f, 1e-4, 100), InsertionPhases { start: 0, deepest: 99, retraction: 100 })
}

#[test]
fn releases_are_the_largest_steps_towards_zero_shallowest_first() {
    let (r, p) = released();
    let actual = releases(&r, &p, 5);
    let z = |k: usize| 1e-4 * (200.0 - k as f64);
    assert_eq!(actual.len(), 3);
    assert_close(actual[0].position_m, z(250));
    assert_close(actual[0].size_n, 0.3);
    // Two steps within 2.5 mm are one release at their weighted mean position.
    assert_close(actual[1].position_m, 0.6 * z(180) + 0.4 * z(192));
    assert_close(actual[1].size_n, 1.0);
    assert_close(actual[2].position_m, z(120));
    assert_close(actual[2].size_n, 1.1);
    let two = releases(&r, &p, 2);
    assert_eq!(two, actual[1..]);
    assert_eq!(releases(&r, &p, 1), actual[2..]);
    // Not before the retraction, and not where the force pushes.
    assert_eq!(releases(&r, &InsertionPhases { retraction: 200, ..p }, 5), actual[..1]);
    let pushes: Vec<f64> = r.force_n.iter().map(|f| f + 3.0).collect();
    assert_eq!(releases(&recording(&pushes, 1e-4, 100), &p, 5), []);
}

#[test]
fn distant_steps_are_separate_releases() {
    let of = |apart: usize, step_m: f64| {
        let f: Vec<f64> = (0..300)
            .map(|k| -3.0 + if k >= 120 { 1.0 } else { 0.0 } + if k >= 120 + apart { 0.7 } else { 0.0 })
            .collect();
        releases(&recording(&f, step_m, 100), &InsertionPhases { start: 0, deepest: 99, retraction: 100 }, 5)
            .len()
    };
    assert_eq!(of(24, 1e-4), 1);
    assert_eq!(of(26, 1e-4), 2);
    assert_eq!(of(20, 2e-4), 2);
    // At the very end the available samples count.
    let f: Vec<f64> = (0..303).map(|k| if k < 300 { -3.0 } else { -2.0 }).collect();
    let last =
        releases(&recording(&f, 1e-4, 100), &InsertionPhases { start: 0, deepest: 99, retraction: 100 }, 5);
    assert_eq!(last.iter().map(|r| r.size_n).collect::<Vec<_>>(), [1.0]);
    // 80 % of the threshold of a drop.
    let small = |size: f64| {
        let f: Vec<f64> = (0..300).map(|k| -2.0 + if k >= 150 { size } else { 0.0 }).collect();
        releases(&recording(&f, 1e-4, 100), &InsertionPhases { start: 0, deepest: 99, retraction: 100 }, 5)
            .len()
    };
    assert_eq!((small(0.095), small(0.097)), (0, 1));
}

#[test]
fn contact_is_where_the_force_finally_leaves_zero() {
    // A touch at sample 30, back to zero, then contact from 60 on, by 0.02 N per sample up to 2 N.
    let f: Vec<f64> = (0..400)
        .map(|k| match k {
            30..=33 => 0.05,
            0..=60 => 0.001 * f64::from(k % 2),
            61..=160 => 0.02 * f64::from(k - 60),
            _ => -1.0,
        })
        .collect();
    let r = recording(&f, 1e-4, 370);
    let p = InsertionPhases { start: 0, deepest: 365, retraction: 370 };
    // Below 1 % of the largest force, 0.02 N, for the last time at 60; 61 has exactly 1 %.
    assert_close(contact_m(&r, &p), 1e-4 * 60.0);
    // With noise: below five standard deviations.
    let rough: Vec<f64> = f.iter().enumerate().map(|(k, f)| f + 0.03 * f64::from((k % 2) as u8)).collect();
    let least = 5.0 * noise_n(&rough);
    assert!(least > 0.05, "{least}");
    let last = (0..72).rposition(|k| rough[k] < least).expect("quiet");
    assert_close(contact_m(&recording(&rough, 1e-4, 370), &p), 1e-4 * last as f64);
    assert!(last > 61);
    // Samples after the deepest point are not used.
    assert_close(contact_m(&r, &InsertionPhases { deepest: 163, ..p }), 1e-4 * 60.0);
    assert_eq!(
        contact_m(
            &recording(&[1.0; 50], 1e-4, 99),
            &InsertionPhases { start: 0, deepest: 40, retraction: 50 }
        ),
        0.0
    );
}
