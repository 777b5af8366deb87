//! Phases of the motion and abrupt force changes from raw samples: drops during insertion, releases during retraction.
//!
//! No model is used; thresholds are shares of the largest force and multiples of the noise.

use stylet_record::Recording;

/// Shortest window (s) over which a drop is measured.
const DROP_WINDOW_S: f64 = 0.06;
/// Smallest drop or release, as a share of the largest force.
const MIN_SHARE_OF_MAX_FORCE: f64 = 0.06;
/// Smallest drop or release, in standard deviations of the noise.
const MIN_NOISE_SDS: f64 = 12.0;
/// Share of a drop that must occur within two neighbouring sampling intervals.
const ABRUPT_SHARE: f64 = 0.7;
/// Largest continuation of a drop, as a share of its size over an equal time afterwards; relaxation continues by more.
const MAX_CONTINUED_SHARE: f64 = 0.2;
/// Smallest drop of the first layer, as a share of the largest drop; smaller ones before it are taken for unmodelled structures.
const MIN_FIRST_RUPTURE_SHARE: f64 = 0.4;
/// Force steps within this travel (m) during retraction are merged into one release.
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

/// Standard deviation (N) of the noise from the median absolute difference of neighbouring samples, which a slow force hardly changes.
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
    let (low, high) = stylet_stats::extremes(z);
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

/// Whether most of a fall occurs within three neighbouring samples and then ends. `after` is the fall (N) over an equal time afterwards.
/// Relaxation after a stop is as fast but continues.
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

/// Estimate of the surface: position (m) of the last sample below the noise before the force rises.
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
mod tests;
