//! What happens at an instant, read off the raw force: drops on the way in, releases on the way back.
//!
//! Nothing here knows a law. Thresholds are shares of the largest force and multiples of the noise.

use stylet_record::Recording;

/// Shortest window in which a drop happens (s).
const DROP_WINDOW_S: f64 = 0.06;
/// A drop or release is at least this share of the largest force,
const MIN_SHARE_OF_MAX_FORCE: f64 = 0.06;
/// and this many standard deviations of the noise.
const MIN_NOISE_SDS: f64 = 12.0;
/// Share of a drop that two neighbouring intervals hold.
const ABRUPT_SHARE: f64 = 0.7;
/// A fall that goes on by this share in as much time again is no drop.
const MAX_CONTINUED_SHARE: f64 = 0.2;
/// The first layer's drop is at least this share of the largest one: what comes before is a crackle.
const MIN_FIRST_RUPTURE_SHARE: f64 = 0.4;
/// Travel (m) within which steps on the way back belong to one release.
const MERGE_RELEASES_M: f64 = 2.5e-3;

/// When the needle moves where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsertionPhases {
    /// First sample of the motion.
    pub start: usize,
    /// Last sample of the advance.
    pub deepest: usize,
    /// First sample of the way back; the number of samples when there is none.
    pub retraction: usize,
}

/// A sudden fall of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AbruptDrop {
    /// First sample after it.
    pub sample: usize,
    /// Its size in N.
    pub size_n: f64,
}

/// A layer that lets go of the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Release {
    /// Position of the tip in m.
    pub position_m: f64,
    /// Size of the step in N.
    pub size_n: f64,
}

/// Standard deviation of the noise from differences of neighbours, which a slow force hardly changes.
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

/// Finds start, end of the advance and beginning of the way back.
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

/// The window that begins at sample `i`: as long as [`WINDOW_S`] and at least five samples.
fn window_end(t: &[f64], i: usize) -> usize {
    let mut j = i + 5;
    while j < t.len() && t[j] - t[i] < DROP_WINDOW_S {
        j += 1;
    }
    j
}

/// Whether most of a fall happens between three neighbouring samples and it is over then (`after` is what falls in
/// as much time again). Relaxation after a stop falls fast too, but goes on.
fn is_abrupt(f: &[f64], after: f64) -> bool {
    let fall = f[0] - f[f.len() - 1];
    after < MAX_CONTINUED_SHARE * fall
        && f.windows(3).map(|w| w[0] - w[2]).fold(0.0, f64::max) > ABRUPT_SHARE * fall
}

/// Sudden falls of the force until the way back begins.
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

/// Which drop is whose rupture: per layer the first sample after it. A layer whose rupture leaves no
/// drop has none.
#[must_use]
pub fn rupture_samples(drops: &[AbruptDrop], layers: usize) -> Vec<Option<usize>> {
    let largest = drops.iter().map(|d| d.size_n).fold(0.0, f64::max);
    let mut of = drops.iter().skip_while(|d| d.size_n < MIN_FIRST_RUPTURE_SHARE * largest).map(|d| d.sample);
    (0..layers).map(|_| of.next()).collect()
}

/// Releases on the way back, the largest `layers` of them, shallowest first.
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

/// Position at which the force first leaves zero for good, less a little: where the surface may be.
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

    /// Samples every 10.1 ms, a needle that goes by `step_m` each, in and (from sample `back` on) out.
    fn recording(force_n: &[f64], step_m: f64, back: usize) -> Recording {
        let t = (0..force_n.len()).map(|k| 0.0101 * k as f64).collect();
        let z = (0..force_n.len())
            .map(|k| step_m * if k < back { k as f64 } else { 2.0 * back as f64 - k as f64 });
        Recording::new(t, z.collect(), force_n.to_vec()).expect("a recording")
    }

    /// All that there is, as one advance.
    fn whole(r: &Recording) -> InsertionPhases {
        InsertionPhases { start: 0, deepest: r.len() - 1, retraction: r.len() }
    }

    #[test]
    fn noise_is_told_by_the_middle_difference_of_neighbours() {
        assert_eq!(noise_n(&[]), 0.0);
        assert_eq!(noise_n(&[3.0]), 0.0);
        // Differences of 0.1, 0.7, 0.2, 0.4: the upper of the two middle ones is 0.4.
        near(noise_n(&[1.0, 1.1, 0.4, 0.6, 0.2]), 0.4 / (0.6745 * 2.0_f64.sqrt()));
        near(noise_n(&[1.0, 1.1, 0.4, 0.6]), 0.2 / (0.6745 * 2.0_f64.sqrt()));
    }

    #[test]
    fn a_threshold_is_a_share_of_the_largest_force_or_so_much_noise() {
        let quiet: Vec<f64> = (0..50).map(|k| if k < 30 { 0.0 } else { -2.5 }).collect();
        near(min_drop_n(&recording(&quiet, 1e-4, 99)), 0.06 * 2.5);
        let rough: Vec<f64> = (0..50).map(|k| if k % 2 == 0 { 0.0 } else { 0.3 }).collect();
        near(min_drop_n(&recording(&rough, 1e-4, 99)), 12.0 * 0.3 / (0.6745 * 2.0_f64.sqrt()));
    }

    /// A plan of a rest, an advance, a hold, a way back: borders are where it has them.
    #[test]
    fn phases_are_those_of_the_plan() {
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
        // In from sample 21 on, at the bottom at 120, away from it by more than 0.1 mm at 151.
        assert_eq!(of(220, 4e-4), InsertionPhases { start: 21, deepest: 120, retraction: 151 });
        // Slowly it is away from the bottom by 0.1 mm a sample later; by 3 mm of 30 it has come back.
        assert_eq!(of(220, 5.5e-5).retraction, 152);
        assert_eq!((of(220, 4.4e-5).retraction, of(220, 4.3e-5).retraction), (153, 220));
        // Back by less than a tenth of the way it has not come back.
        assert_eq!(of(150 + 8, 4e-4).retraction, 158);
        assert_eq!(of(150 + 9, 4e-4).retraction, 151);
        // A short way: near the bottom is a two-hundredth of it.
        let z: Vec<f64> = (0..=200).map(|k| 1e-5 * f64::from(k)).collect();
        let t: Vec<f64> = (0..=200).map(|k| 0.01 * f64::from(k)).collect();
        let short = detect_phases(&Recording::new(t, z, vec![0.0; 201]).expect("a recording"));
        // 0.01 mm: half of it is passed at the first step, the bottom is nearer than that only at the last.
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
    fn a_fall_is_sudden_when_three_samples_hold_most_of_it_and_it_is_over() {
        assert!(is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.0));
        // Exactly seven tenths are not more than seven tenths.
        assert!(!is_abrupt(&[10.0, 10.0, 7.0, 3.0, 0.0], 0.0));
        assert!(is_abrupt(&[10.0, 10.0, 7.0, 2.9, 0.0], 0.0));
        assert!(!is_abrupt(&[1.0, 0.8, 0.6, 0.4, 0.2, 0.0], 0.0));
        // Goes on by a fifth as much.
        assert!(is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.19));
        assert!(!is_abrupt(&[1.0, 1.0, 0.2, 0.1, 0.0, 0.0], 0.2));
        // From another level.
        assert!(
            is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.19)
                && !is_abrupt(&[4.0, 4.0, 3.2, 3.1, 3.0, 3.0], 0.21)
        );
    }

    /// A force that rises evenly and falls at two samples.
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
    fn drops_are_where_the_force_falls_and_as_large_as_it_falls() {
        let r = recording(&falls(), 1e-4, 999);
        let told = abrupt_drops(&r, &whole(&r));
        assert_eq!(told.iter().map(|d| d.sample).collect::<Vec<_>>(), [60, 130]);
        // From four samples before to five after: what falls less what rises meanwhile.
        near(told[0].size_n, falls()[56] - falls()[65]);
        near(told[0].size_n, 0.6 - 0.07);
        near(told[1].size_n, 0.9 - 0.08);
        // None on the way back, nor before the motion.
        let until = |back: usize, start: usize| {
            abrupt_drops(&r, &InsertionPhases { start, deepest: back, retraction: back })
        };
        assert_eq!(until(100, 0).len(), 1);
        assert_eq!(until(200, 61).len(), 1);
        assert_eq!(until(40, 0).len(), 0);
        // The window that holds it begins six samples before.
        assert_eq!(until(55, 0).len(), 1);
        assert_eq!(until(54, 0).len(), 0);
        // Turned over it rises.
        let up: Vec<f64> = falls().iter().map(|f| -f).collect();
        assert_eq!(abrupt_drops(&recording(&up, 1e-4, 999), &whole(&r)).len(), 0);
    }

    /// Two falls nearer than the windows of one are one.
    #[test]
    fn a_fall_that_goes_on_is_no_drop() {
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
    fn the_first_rupture_is_no_crackle() {
        let drop = |at: usize, size_n: f64| AbruptDrop { sample: at, size_n };
        let all = [drop(5, 0.3), drop(9, 0.4), drop(20, 0.1), drop(40, 1.0)];
        assert_eq!(rupture_samples(&all, 2), [Some(9), Some(20)]);
        assert_eq!(rupture_samples(&all, 4), [Some(9), Some(20), Some(40), None]);
        assert_eq!(rupture_samples(&[drop(5, 0.399), drop(40, 1.0)], 2), [Some(40), None]);
        assert_eq!(rupture_samples(&[], 1), [None]);
    }

    /// A force below zero that steps towards zero three times on the way back, the second time in two steps.
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
        // 0.1 mm a sample: the two steps in the middle are 1.2 mm apart.
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
        // Two steps within 2.5 mm are one release, in their middle by size.
        near(told[1].position_m, 0.6 * z(180) + 0.4 * z(192));
        near(told[1].size_n, 1.0);
        near(told[2].position_m, z(120));
        near(told[2].size_n, 1.1);
        let two = releases(&r, &p, 2);
        assert_eq!(two, told[1..]);
        assert_eq!(releases(&r, &p, 1), told[2..]);
        // Not before the way back, and not where the force pushes.
        assert_eq!(releases(&r, &InsertionPhases { retraction: 200, ..p }, 5), told[..1]);
        let pushes: Vec<f64> = r.force_n.iter().map(|f| f + 3.0).collect();
        assert_eq!(releases(&recording(&pushes, 1e-4, 100), &p, 5), []);
    }

    #[test]
    fn steps_further_apart_are_releases_of_their_own() {
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
        // At the very end as much counts as there is.
        let f: Vec<f64> = (0..303).map(|k| if k < 300 { -3.0 } else { -2.0 }).collect();
        let last = releases(
            &recording(&f, 1e-4, 100),
            &InsertionPhases { start: 0, deepest: 99, retraction: 100 },
            5,
        );
        assert_eq!(last.iter().map(|r| r.size_n).collect::<Vec<_>>(), [1.0]);
        // Eight tenths of what makes a drop.
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
    fn contact_is_where_the_force_leaves_zero_for_good() {
        // A touch at sample 30, back to zero, then for good from 60 on, by 0.02 N a sample up to 2 N.
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
        // Below a hundredth of the largest force, 0.02 N, for the last time at 60: 61 has a hundredth exactly.
        near(contact_m(&r, &p), 1e-4 * 60.0);
        // Under noise, below five standard deviations of it.
        let rough: Vec<f64> =
            f.iter().enumerate().map(|(k, f)| f + 0.03 * f64::from((k % 2) as u8)).collect();
        let least = 5.0 * noise_n(&rough);
        assert!(least > 0.05, "{least}");
        let last = (0..72).rposition(|k| rough[k] < least).expect("quiet");
        near(contact_m(&recording(&rough, 1e-4, 370), &p), 1e-4 * last as f64);
        assert!(last > 61);
        // Nothing before the deepest point counts that comes after it.
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
