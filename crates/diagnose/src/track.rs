//! A recording made ready for thousands of replays: columns, what is used of them, where the noise's
//! memory begins anew.

use crate::noise::median;
use crate::velocity::velocity;
use stylet_record::Recording;

/// The instant (s) of a rupture that never was.
pub const NEVER: f64 = f64::INFINITY;

/// Columns of one recording, at its own rate or averaged in blocks.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Time in s.
    pub t: Vec<f64>,
    /// Recorded position in m.
    pub z: Vec<f64>,
    /// Velocity in m/s.
    pub v: Vec<f64>,
    /// Acceleration in m/s².
    pub a: Vec<f64>,
    /// Force in N.
    pub f: Vec<f64>,
    /// Whether the sample counts in the likelihood.
    pub used: Vec<bool>,
    /// Whether the whitening restarts here: a sample before is missing.
    pub restart: Vec<bool>,
    /// Samples per second.
    pub sample_hz: f64,
    /// Where the velocity jumps between two samples.
    pub kinks: Vec<Kink>,
}

/// A jump of the velocity between two samples; where, the positions tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kink {
    /// The sample after it.
    pub sample: usize,
    /// Time in s.
    pub t: f64,
    /// Recorded position in m.
    pub z: f64,
    /// Velocities in m/s before and after.
    pub v: [f64; 2],
}

/// A sample so near (share of a step) to a jump of the velocity is not compared.
const AT_A_JUMP: f64 = 0.02;

impl Track {
    /// The track of a recording; samples that are not finite are left out, samples with `exclude` set
    /// are replayed but not compared.
    #[must_use]
    pub fn new(recording: &Recording, exclude: &[bool]) -> Self {
        let mut track = Self { sample_hz: recording.sample_hz(), ..Self::default() };
        for i in 0..recording.len() {
            let row = (
                recording.time_s[i],
                recording.position_m[i],
                recording.velocity_mps[i],
                recording.force_n[i],
            );
            if !(row.0 + row.1 + row.2 + row.3).is_finite() {
                continue;
            }
            track.t.push(row.0);
            track.z.push(row.1);
            track.v.push(row.2);
            track.f.push(row.3);
            track.used.push(!exclude.get(i).copied().unwrap_or(false));
        }
        track.take_velocity(recording.velocity_measured);
        track.find_restarts();
        track
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// The velocity that the positions tell, where they tell it better than what was recorded.
    fn take_velocity(&mut self, recorded: bool) {
        let told = velocity(&self.t, &self.z);
        let mut d: Vec<f64> =
            self.v.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
        let noise_mps = median(&mut d) * 1.4826 / 20.0_f64.sqrt();
        if recorded && told.noise_mps >= 1e-5 && told.noise_mps >= noise_mps {
            self.a = slope(&self.t, &self.v);
            self.leave_out_jumps();
            return;
        }
        // A sample at the very instant of a jump has either velocity.
        for kink in &told.kinks {
            for i in kink.sample.saturating_sub(1)..=kink.sample {
                self.used[i] &= (self.t[i] - kink.t).abs() * self.sample_hz > AT_A_JUMP;
            }
        }
        (self.v, self.a, self.kinks) = (told.v, told.a, told.kinks);
    }

    /// Where the velocity jumps the acceleration is anybody's guess: it is taken from around, and the
    /// samples there are not compared.
    fn leave_out_jumps(&mut self) {
        let n = self.len();
        let raw = self.a.clone();
        for i in 0..n {
            let (from, to) = (i.saturating_sub(3), (i + 4).min(n));
            let mut around = [0.0; 7];
            around[..to - from].copy_from_slice(&raw[from..to]);
            let around = &mut around[..to - from];
            around.sort_unstable_by(f64::total_cmp);
            let middle = around[around.len() / 2];
            let spread = if around.len() < 7 { 0.0 } else { around[4] - around[2] };
            if (raw[i] - middle).abs() > 0.002 + 0.2 * middle.abs() + 8.0 * spread {
                self.a[i] = middle;
                self.used[i] = false;
            }
        }
    }

    /// The first sample at `time_s` or later.
    #[must_use]
    pub fn first_from(&self, time_s: f64) -> usize {
        self.t.partition_point(|t| *t < time_s)
    }

    /// The instant in the middle between sample `i` and the one before.
    #[must_use]
    pub fn before(&self, i: usize) -> f64 {
        let Some(&t) = self.t.get(i) else { return NEVER };
        0.5 * (t + if i > 0 { self.t[i - 1] } else { t - 1.0 / self.sample_hz })
    }

    fn find_restarts(&mut self) {
        let long = 1.8 / self.sample_hz;
        self.restart = (0..self.len())
            .map(|i| {
                i < 2
                    || !self.used[i - 1]
                    || !self.used[i - 2]
                    || self.t[i] - self.t[i - 1] > long
                    || self.t[i - 1] - self.t[i - 2] > long
            })
            .collect();
    }

    /// Averages over blocks of `q` samples. The samples before and at each of `breaks` (s) stay alone, so
    /// that an instant between them stays where it was; pieces that are not whole blocks are replayed
    /// but not compared.
    #[must_use]
    pub fn blocks(&self, q: usize, breaks: &[f64]) -> Self {
        let n = self.len();
        let mut edges: Vec<usize> = Vec::new();
        for b in breaks.iter().map(|b| self.first_from(*b)).filter(|b| *b < n) {
            edges.extend([b.saturating_sub(1), b, b + 1]);
        }
        edges.extend([0, n]);
        edges.sort_unstable();
        edges.dedup();
        let mut out = Self { sample_hz: self.sample_hz / q as f64, ..Self::default() };
        for pair in edges.windows(2) {
            let mut from = pair[0];
            while from < pair[1] {
                let to = (from + q).min(pair[1]);
                let mean = |x: &[f64]| x[from..to].iter().sum::<f64>() / (to - from) as f64;
                out.t.push(mean(&self.t));
                out.z.push(mean(&self.z));
                out.v.push(mean(&self.v));
                out.a.push(mean(&self.a));
                out.f.push(mean(&self.f));
                out.used.push(to - from == q && self.used[from..to].iter().all(|u| *u));
                from = to;
            }
        }
        out.find_restarts();
        out
    }
}

/// Central differences.
fn slope(t: &[f64], x: &[f64]) -> Vec<f64> {
    let n = t.len();
    (0..n)
        .map(|i| {
            let (lo, hi) = (i.saturating_sub(1), (i + 1).min(n - 1));
            if t[hi] > t[lo] { (x[hi] - x[lo]) / (t[hi] - t[lo]) } else { 0.0 }
        })
        .collect()
}
