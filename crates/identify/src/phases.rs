//! What happens at an instant, read off the raw force: drops on the way in, releases on the way back.
//!
//! Nothing here knows a law. Thresholds are shares of the largest force and multiples of the noise.

use stylet_record::Recording;

/// Shortest window in which a drop happens (s).
const WINDOW_S: f64 = 0.06;
/// A drop or release is at least this share of the largest force,
const SHARE: f64 = 0.06;
/// and this many standard deviations of the noise.
const NOISES: f64 = 12.0;
/// Share of a drop that two neighbouring intervals hold.
const SUDDEN: f64 = 0.7;
/// A fall that goes on by this share in as much time again is no drop.
const GOES_ON: f64 = 0.2;
/// The first layer's drop is at least this share of the largest one: what comes before is a crackle.
const FIRST: f64 = 0.4;
/// Travel (m) within which steps on the way back belong to one release.
const ONE_RELEASE_M: f64 = 2.5e-3;

/// When the needle moves where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phases {
    /// First sample of the motion.
    pub start: usize,
    /// Last sample of the advance.
    pub deepest: usize,
    /// First sample of the way back; the number of samples when there is none.
    pub back: usize,
}

/// A sudden fall of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drop {
    /// First sample after it.
    pub at: usize,
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
pub fn phases(recording: &Recording) -> Phases {
    let z = &recording.position_m;
    let (low, high) = z.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
    let near = (0.005 * (high - low)).min(1e-4);
    let start = z.iter().position(|x| *x > z[0] + 0.5 * near).unwrap_or(0);
    let deepest = z.iter().position(|x| *x > high - near).unwrap_or(z.len() - 1);
    let last = z.iter().rposition(|x| *x > high - near).unwrap_or(z.len() - 1);
    let comes_back = z.last().is_some_and(|x| *x < high - 0.1 * (high - low));
    Phases { start, deepest, back: if comes_back { last + 1 } else { z.len() } }
}

fn threshold(recording: &Recording) -> f64 {
    let largest = recording.force_n.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    (SHARE * largest).max(NOISES * noise_n(&recording.force_n))
}

/// The window that begins at sample `i`: as long as [`WINDOW_S`] and at least five samples.
fn window(t: &[f64], i: usize) -> usize {
    let mut j = i + 5;
    while j < t.len() && t[j] - t[i] < WINDOW_S {
        j += 1;
    }
    j
}

/// Whether most of a fall happens between three neighbouring samples and it is over then (`after` is what falls in
/// as much time again). Relaxation after a stop falls fast too, but goes on.
fn sudden(f: &[f64], after: f64) -> bool {
    let fall = f[0] - f[f.len() - 1];
    after < GOES_ON * fall && f.windows(3).map(|w| w[0] - w[2]).fold(0.0, f64::max) > SUDDEN * fall
}

/// Sudden falls of the force until the way back begins.
#[must_use]
pub fn drops(recording: &Recording, phases: &Phases) -> Vec<Drop> {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let least = threshold(recording);
    let mut out = Vec::new();
    let mut i = phases.start;
    loop {
        let j = window(t, i);
        if j >= f.len() || i >= phases.back {
            return out;
        }
        let after = f[j] - f[(j + (j - i)).min(f.len() - 1)];
        if f[i] - f[j] > least && sudden(&f[i..=j], after) {
            let at = (i..j).max_by(|a, b| (f[*a] - f[a + 1]).total_cmp(&(f[*b] - f[b + 1]))).unwrap_or(i) + 1;
            let end = window(t, at).min(f.len() - 1);
            let size_n = f[at.saturating_sub(4)] - f[at + (end - at).min(5)];
            out.push(Drop { at, size_n });
            i = (window(t, window(t, at).min(f.len() - 1))).max(at + 1);
        } else {
            i += 1;
        }
    }
}

/// Which drop is whose rupture: per layer the first sample after it. A layer whose rupture leaves no
/// drop has none.
#[must_use]
pub fn ruptures(drops: &[Drop], layers: usize) -> Vec<Option<usize>> {
    let largest = drops.iter().map(|d| d.size_n).fold(0.0, f64::max);
    let mut of = drops.iter().skip_while(|d| d.size_n < FIRST * largest).map(|d| d.at);
    (0..layers).map(|_| of.next()).collect()
}

/// Releases on the way back, the largest `layers` of them, shallowest first.
#[must_use]
pub fn releases(recording: &Recording, phases: &Phases, layers: usize) -> Vec<Release> {
    let (t, z, f) = (&recording.time_s, &recording.position_m, &recording.force_n);
    let least = 0.8 * threshold(recording);
    let mut steps: Vec<(f64, f64)> = Vec::new();
    let mut i = phases.back;
    while i < f.len() {
        let j = window(t, i);
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
            Some((release, last)) if *last - z < ONE_RELEASE_M => {
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
pub fn contact_m(recording: &Recording, phases: &Phases) -> f64 {
    let f = &recording.force_n;
    let largest = f[..=phases.deepest].iter().fold(0.0_f64, |m, f| m.max(*f));
    let least = (0.01 * largest).max(5.0 * noise_n(f));
    let last_quiet = f[..=phases.deepest].iter().position(|f| *f > 0.1 * largest).unwrap_or(phases.deepest);
    let at = f[..last_quiet].iter().rposition(|f| *f < least).unwrap_or(0);
    recording.position_m[at]
}
