//! A recording as means over short blocks of time, ready for thousands of replays.
//!
//! The mean over a block in which a layer ruptures lies between the force before and after, so that a predicted mean is
//! continuous in the instant of the rupture; and a recording at 1 kHz costs as much as one at 200 Hz.

use crate::motion::{Motion, Piece, Shown};
use std::sync::{Arc, OnceLock};
use stylet_record::Recording;

/// Length of a block in s: short against layers, relaxation and ripple, long against samples at 200 Hz and more.
pub const BLOCK_S: f64 = 0.02;
/// A time step of more than so many sampling steps is a gap.
const GAP: f64 = 1.8;
/// A longer gap, in s, is left open.
const BRIDGED_S: f64 = 2.0;
/// A sample so near (share of a step) to a jump of the speed may have either speed.
const AT_A_JUMP: f64 = 0.03;
/// Standard deviation of a number spread evenly over one.
const UNIFORM_SD: f64 = 0.289;
/// Seconds over which the size of the force is smoothed.
const SMOOTH_S: f64 = 0.1;

/// One recording in blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Begin of every block in s.
    pub from_s: Vec<f64>,
    /// End of every block in s.
    pub to_s: Vec<f64>,
    /// Mean recorded force in N.
    pub f: Vec<f64>,
    /// Whether the block is compared.
    pub used: Vec<bool>,
    /// Whether the noise's memory begins anew: what came before is not known.
    pub restart: Vec<bool>,
    /// Size of the recorded force around the block in N.
    pub size_n: Vec<f64>,
    /// Standard deviation in N of what sampling leaves open of the block's mean where the speed jumps.
    pub doubt_n: Vec<f64>,
    /// Times in s as they were recorded.
    pub raw_t: Arc<Vec<f64>>,
    /// Forces in N as they were recorded.
    pub raw_f: Arc<Vec<f64>>,
    /// The block of every recorded force.
    pub raw_block: Arc<Vec<u32>>,
    /// Samples in a block.
    pub samples: usize,
    /// Time between samples in s.
    pub step_s: f64,
    /// The motion.
    pub motion: Arc<Motion>,
    /// Pieces of smooth motion, no delay.
    pub pieces: Arc<Vec<Piece>>,
    /// Those of a force that shows the instants of the speed's jumps, no delay.
    smeared: Arc<OnceLock<Arc<Vec<Piece>>>>,
}

impl Blocks {
    /// The blocks of a recording, about `length_s` long; samples marked in `exclude` are not compared.
    #[must_use]
    pub fn new(recording: &Recording, exclude: &[bool], length_s: f64) -> Self {
        let steps = recording.time_s.windows(2).map(|w| w[1] - w[0]);
        let step_s = stylet_stats::order::median_of(steps).max(1e-9);
        let q = ((length_s / step_s).round() as usize).max(1);
        let motion = Arc::new(Motion::of(recording));
        let t = &recording.time_s;
        let n = t.len();
        let mut b = Self {
            from_s: Vec::new(),
            to_s: Vec::new(),
            f: Vec::new(),
            used: Vec::new(),
            restart: Vec::new(),
            size_n: Vec::new(),
            doubt_n: Vec::new(),
            raw_t: Arc::new(recording.time_s.clone()),
            raw_f: Arc::new(recording.force_n.clone()),
            raw_block: Arc::default(),
            samples: q,
            step_s,
            motion,
            pieces: Arc::default(),
            smeared: Arc::default(),
        };
        let mut i = 0;
        let mut raw_block = Vec::with_capacity(n);
        while i < n {
            let mut to = i + 1;
            while to < n && to - i < q && t[to] - t[to - 1] <= GAP * step_s {
                to += 1;
            }
            let good = |k: &usize| !exclude.get(*k).copied().unwrap_or(false);
            let kept = (i..to).filter(good).count();
            let sum: f64 = (i..to).filter(good).map(|k| recording.force_n[k]).sum();
            let from_s = if i > 0 && t[i] - t[i - 1] <= GAP * step_s {
                0.5 * (t[i] + t[i - 1])
            } else {
                t[i] - 0.5 * step_s
            };
            let to_s = if to < n && t[to] - t[to - 1] <= GAP * step_s {
                0.5 * (t[to] + t[to - 1])
            } else {
                t[to - 1] + 0.5 * step_s
            };
            b.bridge(from_s, length_s);
            b.from_s.push(from_s);
            b.to_s.push(to_s);
            b.f.push(if kept > 0 { sum / kept as f64 } else { 0.0 });
            b.used.push(2 * kept > q.min(to - i) && 2 * (to - i) > q);
            raw_block.resize(to, (b.f.len() - 1) as u32);
            i = to;
        }
        b.raw_block = Arc::new(raw_block);
        b.leave_out_jumps(t);
        b.finish();
        b
    }

    /// Blocks that are not compared from the end so far to `to_s` (s): a law goes on where nothing was recorded, and may
    /// rupture there.
    fn bridge(&mut self, to_s: f64, length_s: f64) {
        let (Some(&end), Some(&force)) = (self.to_s.last(), self.f.last()) else { return };
        let gap_s = to_s - end;
        if gap_s < 0.01 * self.step_s || gap_s > BRIDGED_S {
            return;
        }
        let count = (gap_s / length_s).ceil().max(1.0);
        for k in 0..count as usize {
            self.from_s.push(end + gap_s * k as f64 / count);
            self.to_s.push(end + gap_s * (k + 1) as f64 / count);
            self.f.push(force);
            self.used.push(false);
        }
    }

    /// A sample at the very instant of a jump of the speed has either; so have all within the doubt about the instant.
    fn leave_out_jumps(&mut self, t: &[f64]) {
        let motion = Arc::clone(&self.motion);
        for jump in &motion.jumps {
            let reach = jump.doubt_s.max(AT_A_JUMP * self.step_s);
            let (lo, hi) = (jump.at_s - reach, jump.at_s + reach);
            let first = t.partition_point(|t| *t < lo);
            if t.get(first).is_some_and(|t| *t <= hi) {
                for k in self.at(lo)..(self.at(hi) + 1).min(self.len()) {
                    self.used[k] = false;
                }
            }
        }
    }

    /// Blocks of `m` blocks each, for screening.
    #[must_use]
    pub fn coarser(&self, m: usize) -> Self {
        let mut b = Self {
            samples: self.samples * m,
            pieces: Arc::default(),
            smeared: Arc::default(),
            ..self.clone()
        };
        for column in [&mut b.from_s, &mut b.to_s, &mut b.f, &mut b.size_n, &mut b.doubt_n] {
            column.clear();
        }
        b.used.clear();
        b.restart.clear();
        let n = self.len();
        let mut i = 0;
        while i < n {
            let mut to = i + 1;
            while to < n && to - i < m && self.from_s[to] - self.to_s[to - 1] < self.step_s {
                to += 1;
            }
            let whole = to - i == m && self.used[i..to].iter().all(|u| *u);
            b.from_s.push(self.from_s[i]);
            b.to_s.push(self.to_s[to - 1]);
            b.f.push(self.f[i..to].iter().sum::<f64>() / (to - i) as f64);
            b.used.push(whole);
            i = to;
        }
        b.finish();
        b
    }

    /// What follows from the columns.
    fn finish(&mut self) {
        let n = self.len();
        self.restart = (0..n)
            .map(|k| k == 0 || !self.used[k - 1] || self.from_s[k] - self.to_s[k - 1] > self.step_s)
            .collect();
        let length_s = self.step_s * self.samples as f64;
        let half = ((0.5 * SMOOTH_S / length_s).round() as usize).max(1);
        self.size_n = (0..n)
            .map(|k| {
                let (lo, hi) = (k.saturating_sub(half), (k + half + 1).min(n));
                self.f[lo..hi].iter().sum::<f64>().abs() / (hi - lo) as f64
            })
            .collect();
        self.doubt_n = vec![0.0; n];
        let motion = Arc::clone(&self.motion);
        motion.jumps.iter().for_each(|j| self.doubt_jump(j.between_s));
        self.pieces = Arc::new(self.pieces_shown(Shown::Sampled));
    }

    /// A force that jumps with the speed jumps between two samples: its mean is known to a step of one sample.
    fn doubt_jump(&mut self, at_s: f64) {
        let k = self.at(at_s);
        if k > 0 && k + 1 < self.len() {
            let step = (self.f[k + 1] - self.f[k - 1]).abs() / self.samples as f64 * UNIFORM_SD;
            self.doubt_n[k] = self.doubt_n[k].max(step);
        }
    }

    /// The same for a force that is late by so many s: its jumps are between other samples, and where noisy positions leave open
    /// between which, the mean of their block is uncertain.
    #[must_use]
    pub fn seen_late(&self, late_s: f64) -> Self {
        let mut b = self.clone();
        b.doubt_n = vec![0.0; self.len()];
        for jump in &self.motion.jumps {
            b.doubt_jump(jump.between_s);
            let at_s = jump.at_s + late_s;
            let reach = jump.doubt_s.max(AT_A_JUMP * self.step_s);
            let of = |t: f64| self.raw_t.partition_point(|sample| *sample < t);
            if of(at_s - reach) < of(at_s + reach) {
                b.doubt_jump(at_s - reach);
                b.doubt_jump(at_s + reach);
            }
        }
        b
    }

    /// The middle between the samples around an instant.
    fn between(&self, at_s: f64) -> f64 {
        let k = self.raw_t.partition_point(|t| *t <= at_s);
        match (k.checked_sub(1).and_then(|k| self.raw_t.get(k)), self.raw_t.get(k)) {
            (Some(before), Some(after)) if after - before <= GAP * self.step_s => 0.5 * (before + after),
            _ => at_s,
        }
    }

    /// Pieces of smooth motion as a force sees them that is late by so many s and, if it is `smeared` or late, shows the
    /// instants at which the speed jumps; if it is not smeared and its jumps are `placed` where they are when it is late by so many s, the
    /// middles between the samples around them.
    #[must_use]
    pub fn pieces_seen(&self, smeared: bool, late_s: f64, placed: Option<f64>) -> Arc<Vec<Piece>> {
        if let Some(placed_s) = placed.filter(|_| late_s > 0.0 && !smeared) {
            Arc::new(self.pieces_shown(Shown::SampledLate { late_s, placed_s }))
        } else if late_s > 0.0 {
            Arc::new(self.pieces_shown(Shown::Late(late_s)))
        } else if smeared {
            Arc::clone(self.smeared.get_or_init(|| Arc::new(self.pieces_shown(Shown::Late(0.0)))))
        } else {
            Arc::clone(&self.pieces)
        }
    }

    fn pieces_shown(&self, shown: Shown) -> Vec<Piece> {
        let spans = self.from_s.iter().copied().zip(self.to_s.iter().copied());
        self.motion.pieces(spans, shown, |t| self.between(t))
    }

    /// Residuals (N) of the recorded forces for those of the blocks: what a block leaves, and what a sample differs from
    /// the course of the blocks' means.
    #[must_use]
    pub fn raw_residual(&self, e: &[f64]) -> Vec<f64> {
        let n = self.len();
        let mut within = 0;
        let mut before = u32::MAX;
        (0..self.raw_f.len())
            .map(|i| {
                let block = self.raw_block[i];
                within = if block == before { within + 1 } else { 0 };
                before = block;
                let k = block as usize;
                let (lo, hi) = (k.saturating_sub(1), (k + 1).min(n - 1));
                // Predicted means have the slope of their neighbours.
                let predicted = |k: usize| self.f[k] - e[k];
                let slope = (predicted(hi) - predicted(lo)) / ((hi - lo).max(1) * self.samples) as f64;
                let off = within as f64 - 0.5 * (self.samples as f64 - 1.0);
                self.raw_f[i] - predicted(k) - slope * off
            })
            .collect()
    }

    /// Standard deviation in N of recorded forces about their blocks' means, by the median block.
    #[must_use]
    pub fn within_n(&self) -> f64 {
        if self.samples < 2 {
            return 0.0;
        }
        let mut sums = vec![(0.0, 0.0, 0.0); self.len()];
        for (f, k) in self.raw_f.iter().zip(self.raw_block.iter()) {
            let s: &mut (f64, f64, f64) = &mut sums[*k as usize];
            *s = (s.0 + 1.0, s.1 + f, s.2 + f * f);
        }
        let mut variances: Vec<f64> = sums
            .iter()
            .filter(|s| s.0 >= 2.0)
            .map(|(n, f, ff)| (ff / n - (f / n) * (f / n)).max(0.0))
            .collect();
        variances.sort_unstable_by(f64::total_cmp);
        // A mean without the roughest tenth, which ruptures and jumps make.
        let kept = variances.len() * 9 / 10;
        (variances[..kept].iter().sum::<f64>() / kept.max(1) as f64).sqrt()
    }

    /// Number of blocks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.from_s.len()
    }

    /// Whether there is no block.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.from_s.is_empty()
    }

    /// The block in which an instant lies, or the next one.
    #[must_use]
    pub fn at(&self, time_s: f64) -> usize {
        self.to_s.partition_point(|t| *t <= time_s)
    }

    /// First and last instant in s.
    #[must_use]
    pub fn span_s(&self) -> (f64, f64) {
        (self.from_s.first().copied().unwrap_or(0.0), self.to_s.last().copied().unwrap_or(0.0))
    }
}
