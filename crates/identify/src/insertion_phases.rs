//! Phases of the motion and abrupt force changes, from raw samples: drops during insertion, releases during
//! retraction.
//!
//! Model-free; thresholds are shares of the largest force and multiples of the noise.

use stylet_record::Recording;

/// Shortest window in s in which a drop happens.
const DROP_WINDOW_S: f64 = 0.06;
/// Smallest drop or release, as a share of the largest force.
const MIN_SHARE_OF_MAX_FORCE: f64 = 0.06;
/// Smallest drop or release, in standard deviations of the noise.
const MIN_NOISE_SDS: f64 = 12.0;
/// Smallest share of a drop within two neighbouring intervals.
const ABRUPT_SHARE: f64 = 0.7;
/// A fall that continues by this share over the same time again is not a drop.
const MAX_CONTINUED_SHARE: f64 = 0.2;
/// Smallest drop of the first layer, as a share of the largest one; smaller ones before it are ignored.
const MIN_FIRST_RUPTURE_SHARE: f64 = 0.4;
/// Steps within this travel (m) during retraction belong to one release.
const MERGE_RELEASES_M: f64 = 2.5e-3;

/// Phases of the motion, as sample indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsertionPhases {
    /// First sample of the motion.
    pub start: usize,
    /// Last sample of the insertion.
    pub deepest: usize,
    /// First sample of the retraction; the number of samples without one.
    pub retraction: usize,
}

/// An abrupt drop of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbruptDrop {
    /// First sample after the drop.
    pub sample: usize,
    /// Size in N.
    pub size_n: f64,
}

/// Release of a layer during retraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Release {
    /// Position of the tip in m.
    pub position_m: f64,
    /// Size of the force step in N.
    pub size_n: f64,
}

/// Standard deviation of the noise from differences of neighbouring samples, which a slow force hardly changes.
#[must_use]
pub fn noise_n(force_n: &[f64]) -> f64 {
    let mut steps: Vec<f64> = force_n.windows(2).map(|p| (p[1] - p[0]).abs()).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    steps.select_nth_unstable_by(middle, f64::total_cmp);
    steps[middle] / (0.6745 * std::f64::consts::SQRT_2)
}

/// Detects the start and end of the insertion and the start of the retraction.
#[must_use]
pub fn detect_phases(recording: &Recording) -> InsertionPhases {
    let z = &recording.position_m;
    let (low, high) = z.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
    let near = (0.005 * (high - low)).min(1e-4);
    let start = z.iter().position(|x| *x > z[0] + 0.5 * near).unwrap_or(0);
    let deepest = z.iter().position(|x| *x > high - near).unwrap_or(z.len() - 1);
    let last = z.iter().rposition(|x| *x > high - near).unwrap_or(z.len() - 1);
    let comes_back = z.last().is_some_and(|x| *x < high - 0.1 * (high - low));
    InsertionPhases { start, deepest, retraction: if comes_back { last + 1 } else { z.len() } }
}

fn min_drop_n(recording: &Recording) -> f64 {
    let largest = recording.force_n.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    (MIN_SHARE_OF_MAX_FORCE * largest).max(MIN_NOISE_SDS * noise_n(&recording.force_n))
}

/// End of the window that begins at sample `i`: [`DROP_WINDOW_S`] long, at least five samples.
fn window_end(t: &[f64], i: usize) -> usize {
    let mut j = i + 5;
    while j < t.len() && t[j] - t[i] < DROP_WINDOW_S {
        j += 1;
    }
    j
}

/// Whether most of a fall happens within three neighbouring samples and then ends (`after`: the fall over the
/// same time again). Relaxation after a stop is fast but continues.
fn is_abrupt(f: &[f64], after: f64) -> bool {
    let fall = f[0] - f[f.len() - 1];
    after < MAX_CONTINUED_SHARE * fall
        && f.windows(3).map(|w| w[0] - w[2]).fold(0.0, f64::max) > ABRUPT_SHARE * fall
}

/// Abrupt force drops until the retraction.
#[must_use]
pub fn abrupt_drops(recording: &Recording, phases: &InsertionPhases) -> Vec<AbruptDrop> {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let least = min_drop_n(recording);
    let mut out = Vec::new();
    let mut i = phases.start;
    loop {
        let j = window_end(t, i);
        if j >= f.len() || i >= phases.retraction {
            return out;
        }
        let after = f[j] - f[(j + (j - i)).min(f.len() - 1)];
        if f[i] - f[j] > least && is_abrupt(&f[i..=j], after) {
            let at = (i..j).max_by(|a, b| (f[*a] - f[a + 1]).total_cmp(&(f[*b] - f[b + 1]))).unwrap_or(i) + 1;
            let end = window_end(t, at).min(f.len() - 1);
            let size_n = f[at.saturating_sub(4)] - f[at + (end - at).min(5)];
            out.push(AbruptDrop { sample: at, size_n });
            i = (window_end(t, window_end(t, at).min(f.len() - 1))).max(at + 1);
        } else {
            i += 1;
        }
    }
}

/// First sample after the rupture of each layer; `None` for a layer without a drop.
#[must_use]
pub fn rupture_samples(drops: &[AbruptDrop], layers: usize) -> Vec<Option<usize>> {
    let largest = drops.iter().map(|d| d.size_n).fold(0.0, f64::max);
    let mut of = drops.iter().skip_while(|d| d.size_n < MIN_FIRST_RUPTURE_SHARE * largest).map(|d| d.sample);
    (0..layers).map(|_| of.next()).collect()
}

/// The `layers` largest releases during retraction, shallowest first.
#[must_use]
pub fn releases(recording: &Recording, phases: &InsertionPhases, layers: usize) -> Vec<Release> {
    let (t, z, f) = (&recording.time_s, &recording.position_m, &recording.force_n);
    let least = 0.8 * min_drop_n(recording);
    let mut steps: Vec<(f64, f64)> = Vec::new();
    let mut i = phases.retraction;
    while i < f.len() {
        let j = window_end(t, i);
        if j >= f.len() {
            break;
        }
        if f[j] - f[i] > least && f[i] < 0.0 {
            let at = (i..j).max_by(|a, b| (f[a + 1] - f[*a]).total_cmp(&(f[b + 1] - f[*b]))).unwrap_or(i) + 1;
            let size = f[(at + 4).min(f.len() - 1)] - f[at.saturating_sub(4)];
            if size > 0.0 {
                steps.push((z[at], size));
            }
            i = j.max(at + 4);
        } else {
            i += 1;
        }
    }
    let mut found: Vec<(Release, f64)> = Vec::new(); // with the place of its last step
    for (z, size) in steps {
        match found.last_mut() {
            Some((release, last)) if *last - z < MERGE_RELEASES_M => {
                let whole = release.size_n + size;
                release.position_m = (release.position_m * release.size_n + z * size) / whole;
                release.size_n = whole;
                *last = z;
            }
            _ => found.push((Release { position_m: z, size_n: size }, z)),
        }
    }
    let mut out: Vec<Release> = found.into_iter().map(|(release, _)| release).collect();
    out.sort_by(|a, b| b.size_n.total_cmp(&a.size_n));
    out.truncate(layers);
    out.sort_by(|a, b| a.position_m.total_cmp(&b.position_m));
    out
}

/// Position at which the force finally leaves zero: an estimate of the surface.
#[must_use]
pub fn contact_m(recording: &Recording, phases: &InsertionPhases) -> f64 {
    let f = &recording.force_n;
    let largest = f[..=phases.deepest].iter().fold(0.0_f64, |m, f| m.max(*f));
    let least = (0.01 * largest).max(5.0 * noise_n(f));
    let last_quiet = f[..=phases.deepest].iter().position(|f| *f > 0.1 * largest).unwrap_or(phases.deepest);
    let at = f[..last_quiet].iter().rposition(|f| *f < least).unwrap_or(0);
    recording.position_m[at]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    /// Samples every 10.1 ms; the needle moves by `step_m` per sample, forward and, from sample `back` on,
    /// backward.
    fn recording(force_n: &[f64], step_m: f64, back: usize) -> Recording {
        let t = (0..force_n.len()).map(|k| 0.0101 * k as f64).collect();
        let z = (0..force_n.len())
            .map(|k| step_m * if k < back { k as f64 } else { 2.0 * back as f64 - k as f64 });
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
        near(noise_n(&[1.0, 1.1, 0.4, 0.6, 0.2]), 0.4 / (0.6745 * 2.0_f64.sqrt()));
        near(noise_n(&[1.0, 1.1, 0.4, 0.6]), 0.2 / (0.6745 * 2.0_f64.sqrt()));
    }

    #[test]
    fn the_drop_threshold_is_a_share_of_the_force_or_a_multiple_of_the_noise() {
        let quiet: Vec<f64> = (0..50).map(|k| if k < 30 { 0.0 } else { -2.5 }).collect();
        near(min_drop_n(&recording(&quiet, 1e-4, 99)), 0.06 * 2.5);
        let rough: Vec<f64> = (0..50).map(|k| if k % 2 == 0 { 0.0 } else { 0.3 }).collect();
        near(min_drop_n(&recording(&rough, 1e-4, 99)), 12.0 * 0.3 / (0.6745 * 2.0_f64.sqrt()));
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
            is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.19)
                && !is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.21)
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
        let told = abrupt_drops(&r, &whole(&r));
        assert_eq!(told.iter().map(|d| d.sample).collect::<Vec<_>>(), [60, 130]);
        // From four samples before to five after: the drop minus the rise in between.
        near(told[0].size_n, falls()[56] - falls()[65]);
        near(told[0].size_n, 0.6 - 0.07);
        near(told[1].size_n, 0.9 - 0.08);
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
        let stepped: Vec<f64> =
            relaxing.iter().enumerate().map(|(k, f)| if k < 60 { *f } else { 0.1 }).collect();
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
        let told = releases(&r, &p, 5);
        let z = |k: usize| 1e-4 * (200.0 - k as f64);
        assert_eq!(told.len(), 3);
        near(told[0].position_m, z(250));
        near(told[0].size_n, 0.3);
        // Two steps within 2.5 mm are one release at their weighted mean position.
        near(told[1].position_m, 0.6 * z(180) + 0.4 * z(192));
        near(told[1].size_n, 1.0);
        near(told[2].position_m, z(120));
        near(told[2].size_n, 1.1);
        let two = releases(&r, &p, 2);
        assert_eq!(two, told[1..]);
        assert_eq!(releases(&r, &p, 1), told[2..]);
        // Not before the retraction, and not where the force pushes.
        assert_eq!(releases(&r, &InsertionPhases { retraction: 200, ..p }, 5), told[..1]);
        let pushes: Vec<f64> = r.force_n.iter().map(|f| f + 3.0).collect();
        assert_eq!(releases(&recording(&pushes, 1e-4, 100), &p, 5), []);
    }

    #[test]
    fn distant_steps_are_separate_releases() {
        let of = |apart: usize, step_m: f64| {
            let f: Vec<f64> = (0..300)
                .map(|k| -3.0 + if k >= 120 { 1.0 } else { 0.0 } + if k >= 120 + apart { 0.7 } else { 0.0 })
                .collect();
            releases(
                &recording(&f, step_m, 100),
                &InsertionPhases { start: 0, deepest: 99, retraction: 100 },
                5,
            )
            .len()
        };
        assert_eq!(of(24, 1e-4), 1);
        assert_eq!(of(26, 1e-4), 2);
        assert_eq!(of(20, 2e-4), 2);
        // At the very end the available samples count.
        let f: Vec<f64> = (0..303).map(|k| if k < 300 { -3.0 } else { -2.0 }).collect();
        let last = releases(
            &recording(&f, 1e-4, 100),
            &InsertionPhases { start: 0, deepest: 99, retraction: 100 },
            5,
        );
        assert_eq!(last.iter().map(|r| r.size_n).collect::<Vec<_>>(), [1.0]);
        // 80 % of the threshold of a drop.
        let small = |size: f64| {
            let f: Vec<f64> = (0..300).map(|k| -2.0 + if k >= 150 { size } else { 0.0 }).collect();
            releases(
                &recording(&f, 1e-4, 100),
                &InsertionPhases { start: 0, deepest: 99, retraction: 100 },
                5,
            )
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
        near(contact_m(&r, &p), 1e-4 * 60.0);
        // With noise: below five standard deviations.
        let rough: Vec<f64> =
            f.iter().enumerate().map(|(k, f)| f + 0.03 * f64::from((k % 2) as u8)).collect();
        let least = 5.0 * noise_n(&rough);
        assert!(least > 0.05, "{least}");
        let last = (0..72).rposition(|k| rough[k] < least).expect("quiet");
        near(contact_m(&recording(&rough, 1e-4, 370), &p), 1e-4 * last as f64);
        assert!(last > 61);
        // Samples after the deepest point are not used.
        near(contact_m(&r, &InsertionPhases { deepest: 163, ..p }), 1e-4 * 60.0);
        assert_eq!(
            contact_m(
                &recording(&[1.0; 50], 1e-4, 99),
                &InsertionPhases { start: 0, deepest: 40, retraction: 50 }
            ),
            0.0
        );
    }
}
