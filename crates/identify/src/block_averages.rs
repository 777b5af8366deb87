//! Averages a recording over blocks of [`BLOCK_S`]: mean force, times, flags and motion per block, the input of every fit.
//!
//! A rupture inside a block gives a mean between the forces before and after it, so the predicted mean is continuous in the rupture time.
//! The cost of a fit does not grow with the sampling rate.

use crate::motion::{JumpAppearance, Motion, MotionPiece};
use std::sync::{Arc, OnceLock};
use stylet_record::Recording;
use stylet_stats::UNIFORM_SD;
use stylet_tissue::effect::SGN_DEAD_BAND_MPS;

/// Block length in s: short compared with layers, relaxation and ripple, several samples at 200 Hz and more.
pub const BLOCK_S: f64 = 0.02;
/// A time step longer than this many sampling intervals is a gap; a single jittered step stays below it.
const GAP_STEPS: f64 = 1.8;
/// A gap of at most this many blocks is bridged within its block, which is still compared by its remaining samples.
const MAX_MISSING_BLOCKS: f64 = 1.0;
/// Gaps up to this length (s) are filled with blocks that are not compared; longer ones stay empty.
const MAX_BRIDGED_S: f64 = 2.0;
/// A sample within this distance (sampling intervals) of a velocity jump may have the velocity of either side.
const JUMP_MARGIN_STEPS: f64 = 0.03;
/// Window (s) over which the force is averaged for [`BlockAverages::abs_force_n`].
const FORCE_SMOOTHING_S: f64 = 0.1;

/// One recording in blocks.
#[derive(Clone, Debug, Default)]
pub struct BlockAverages {
    /// Start of every block in s.
    pub start_s: Vec<f64>,
    /// End of every block in s.
    pub end_s: Vec<f64>,
    /// Mean recorded force in N.
    pub force_n: Vec<f64>,
    /// Whether the block enters the likelihood.
    pub used: Vec<bool>,
    /// Whether the noise model restarts at this block because the preceding one is missing or not compared.
    pub memory_reset: Vec<bool>,
    /// Magnitude of the recorded force in N, averaged over 0.1 s.
    pub abs_force_n: Vec<f64>,
    /// Additional standard deviation in N of the block mean, from jumps between samples and unmodelled force.
    pub extra_sd_n: Vec<f64>,
    /// Times in s at which the predicted force drops because an elastic element breaks.
    break_times_s: Vec<f64>,
    /// Standard deviation in N of unmodelled force around every block; empty for none.
    unmodelled_sd_n: Vec<f64>,
    /// Recorded times in s.
    pub sample_time_s: Arc<Vec<f64>>,
    /// Recorded forces in N.
    pub sample_force_n: Arc<Vec<f64>>,
    /// Block index of every recorded sample.
    pub sample_block: Arc<Vec<u32>>,
    /// Samples per block.
    pub samples_per_block: usize,
    /// Sampling interval in s.
    pub sample_step_s: f64,
    /// Base motion.
    pub motion: Arc<Motion>,
    /// Smooth motion pieces without delay, jumps between samples.
    pub pieces: Arc<Vec<MotionPiece>>,
    /// Smooth motion pieces without delay, jumps at their exact times; computed on first use.
    exact_pieces: Arc<OnceLock<Arc<Vec<MotionPiece>>>>,
}

/// Mean force over a time span. With missing samples (`whole` is false), each remaining sample is weighted by the time nearest to it, so
/// that the mean of a ramp or a step is unbiased.
fn time_weighted_mean(
    (from_s, to_s): (f64, f64),
    samples: impl Iterator<Item = (f64, f64)>,
    whole: bool,
) -> f64 {
    let samples: Vec<(f64, f64)> = samples.collect();
    let n = samples.len();
    if whole || n < 2 {
        return samples.iter().map(|s| s.1).sum::<f64>() / n.max(1) as f64;
    }
    let edge = |k: usize| match k {
        0 => from_s,
        k if k == n => to_s,
        k => 0.5 * (samples[k - 1].0 + samples[k].0),
    };
    let parts = samples.iter().enumerate().map(|(k, s)| s.1 * (edge(k + 1) - edge(k)));
    parts.sum::<f64>() / (to_s - from_s)
}

impl BlockAverages {
    /// Blocks of a recording, about `length_s` long; samples marked in `exclude` are not compared.
    #[must_use]
    pub fn new(recording: &Recording, exclude: &[bool], length_s: f64) -> Self {
        let steps = recording.time_s.windows(2).map(|w| w[1] - w[0]);
        let step_s = stylet_stats::order_statistics::median_of(steps).max(1e-9);
        let q = ((length_s / step_s).round() as usize).max(1);
        let motion = Arc::new(Motion::from_recording(recording, SGN_DEAD_BAND_MPS));
        let t = &recording.time_s;
        let n = t.len();
        let mut b = Self {
            sample_time_s: Arc::new(recording.time_s.clone()),
            sample_force_n: Arc::new(recording.force_n.clone()),
            samples_per_block: q,
            sample_step_s: step_s,
            motion,
            ..Self::default()
        };
        let mut i = 0;
        let mut raw_block = Vec::with_capacity(n);
        while i < n {
            // Samples that are missing inside a block still occupy places in it.
            let spans = |k: usize| {
                let gap = t[k] - t[k - 1];
                let missing = gap > GAP_STEPS * step_s
                    && gap <= (q as f64 * MAX_MISSING_BLOCKS + 0.8) * step_s
                    && q > 1;
                let steps = if missing { (gap / step_s).round() as usize } else { 1 };
                (gap <= GAP_STEPS * step_s || missing).then_some(steps)
            };
            let begun_s = b.end_s.last().copied().filter(|_| i > 0 && spans(i).is_some_and(|s| s > 1));
            let mut places = begun_s.map_or(1, |s| ((t[i] - s) / step_s + 0.5).round().max(1.0) as usize);
            let mut to = i + 1;
            while to < n && spans(to).is_some_and(|s| places + s <= q) {
                places += spans(to).unwrap_or(1);
                to += 1;
            }
            let good = |k: &usize| !exclude.get(*k).copied().unwrap_or(false);
            let kept: Vec<usize> = (i..to).filter(good).collect();
            let from_s = if i > 0 && t[i] - t[i - 1] <= GAP_STEPS * step_s {
                0.5 * (t[i] + t[i - 1])
            } else {
                begun_s.unwrap_or(t[i] - 0.5 * step_s)
            };
            let to_s = if to < n && t[to] - t[to - 1] <= GAP_STEPS * step_s {
                0.5 * (t[to] + t[to - 1])
            } else {
                let missing = if to < n && spans(to).is_some() { q.saturating_sub(places) } else { 0 };
                t[to - 1] + (missing as f64 + 0.5) * step_s
            };
            b.bridge_gap(from_s, length_s);
            b.start_s.push(from_s);
            b.end_s.push(to_s);
            let whole = kept.len() as f64 + 0.5 > (to_s - from_s) / step_s;
            b.force_n.push(time_weighted_mean(
                (from_s, to_s),
                kept.iter().map(|k| (t[*k], recording.force_n[*k])),
                whole,
            ));
            b.used.push(2 * kept.len() > q.min(to - i) && 2 * (to - i) > q);
            raw_block.resize(to, (b.force_n.len() - 1) as u32);
            i = to;
        }
        b.sample_block = Arc::new(raw_block);
        b.exclude_jump_blocks(t);
        b.derive_columns();
        b
    }

    /// Fills a gap up to `to_s` (s) with blocks that are not compared; the model still moves, and may rupture, during them.
    fn bridge_gap(&mut self, to_s: f64, length_s: f64) {
        let (Some(&end), Some(&force)) = (self.end_s.last(), self.force_n.last()) else { return };
        let gap_s = to_s - end;
        if gap_s < 0.01 * self.sample_step_s || gap_s > MAX_BRIDGED_S {
            return;
        }
        let count = (gap_s / length_s).ceil().max(1.0);
        for k in 0..count as usize {
            self.start_s.push(end + gap_s * k as f64 / count);
            self.end_s.push(end + gap_s * (k + 1) as f64 / count);
            self.force_n.push(force);
            self.used.push(false);
        }
    }

    /// Excludes blocks in which a sample lies at a velocity jump or within its timing uncertainty: the sample may have the velocity of
    /// either side.
    fn exclude_jump_blocks(&mut self, t: &[f64]) {
        let motion = Arc::clone(&self.motion);
        for jump in &motion.jumps {
            let reach = jump.time_sd_s.max(JUMP_MARGIN_STEPS * self.sample_step_s);
            let (lo, hi) = (jump.time_s - reach, jump.time_s + reach);
            let first = t.partition_point(|t| *t < lo);
            if t.get(first).is_some_and(|t| *t <= hi) {
                for k in self.block_at(lo)..(self.block_at(hi) + 1).min(self.len()) {
                    self.used[k] = false;
                }
            }
        }
    }

    /// The recording in blocks `m` times as long, for ranking start values.
    #[must_use]
    pub fn coarsened(&self, m: usize) -> Self {
        let mut b = Self {
            samples_per_block: self.samples_per_block * m,
            pieces: Arc::default(),
            exact_pieces: Arc::default(),
            ..self.clone()
        };
        for column in [&mut b.start_s, &mut b.end_s, &mut b.force_n, &mut b.abs_force_n, &mut b.extra_sd_n] {
            column.clear();
        }
        b.used.clear();
        b.memory_reset.clear();
        let unexplained_n = std::mem::take(&mut b.unmodelled_sd_n);
        let n = self.len();
        let mut i = 0;
        while i < n {
            let mut to = i + 1;
            while to < n && to - i < m && self.start_s[to] - self.end_s[to - 1] < self.sample_step_s {
                to += 1;
            }
            let whole = to - i == m && self.used[i..to].iter().all(|u| *u);
            b.start_s.push(self.start_s[i]);
            b.end_s.push(self.end_s[to - 1]);
            b.force_n.push(self.force_n[i..to].iter().sum::<f64>() / (to - i) as f64);
            b.used.push(whole);
            if let Some(of) = unexplained_n.get(i..to) {
                b.unmodelled_sd_n.push(of.iter().map(|u| u * u).sum::<f64>().sqrt() / of.len() as f64);
            }
            i = to;
        }
        b.derive_columns();
        b
    }

    /// Computes `memory_reset`, `abs_force_n`, `extra_sd_n` and `pieces` from the other columns.
    fn derive_columns(&mut self) {
        let n = self.len();
        self.memory_reset = (0..n)
            .map(|k| k == 0 || !self.used[k - 1] || self.start_s[k] - self.end_s[k - 1] > self.sample_step_s)
            .collect();
        let half = ((0.5 * FORCE_SMOOTHING_S / self.block_s()).round() as usize).max(1);
        self.abs_force_n = (0..n)
            .map(|k| {
                let (lo, hi) = (k.saturating_sub(half), (k + half + 1).min(n));
                self.force_n[lo..hi].iter().sum::<f64>().abs() / (hi - lo) as f64
            })
            .collect();
        self.update_extra_sd();
        self.pieces = Arc::new(self.cut_motion(JumpAppearance::BetweenSamples));
    }

    /// The same blocks with the times (s) at which an elastic element breaks. Each adds to `extra_sd_n`, because a break is located only to
    /// within a sampling interval.
    pub(crate) fn with_break_times(mut self, falls_s: Vec<f64>) -> Self {
        self.break_times_s = falls_s;
        self.update_extra_sd();
        self
    }

    /// The same blocks with the standard deviation (N) of an unmodelled force per block, added to `extra_sd_n`.
    #[must_use]
    pub fn with_unmodelled_sd(mut self, sd_n: Vec<f64>) -> Self {
        self.unmodelled_sd_n = sd_n;
        self.update_extra_sd();
        self
    }

    fn update_extra_sd(&mut self) {
        self.extra_sd_n.clone_from(&self.unmodelled_sd_n);
        self.extra_sd_n.resize(self.len(), 0.0);
        let motion = Arc::clone(&self.motion);
        motion.jumps.iter().for_each(|j| self.add_jump_uncertainty(j.sample_mid_s));
        let falls = std::mem::take(&mut self.break_times_s);
        falls.iter().for_each(|t| self.add_jump_uncertainty(*t));
        self.break_times_s = falls;
    }

    /// Adds the uncertainty of a force jump to its block: size of the jump times the standard deviation of its time, which is uniform over
    /// one sampling interval.
    fn add_jump_uncertainty(&mut self, at_s: f64) {
        let k = self.block_at(at_s);
        if k > 0 && k + 1 < self.len() {
            let after =
                self.sample_time_s.partition_point(|t| *t <= at_s).clamp(1, self.sample_time_s.len() - 1);
            let steps =
                ((self.sample_time_s[after] - self.sample_time_s[after - 1]) / self.sample_step_s).round();
            let open = steps.clamp(1.0, self.samples_per_block as f64) / self.samples_per_block as f64;
            let step = (self.force_n[k + 1] - self.force_n[k - 1]).abs() * open * UNIFORM_SD;
            self.extra_sd_n[k] = self.extra_sd_n[k].max(step);
        }
    }

    /// The same blocks for a force delayed by `delay_s`: jumps are delayed too, and one whose timing uncertainty spans a sample makes the
    /// block means on both sides uncertain.
    pub(crate) fn with_delayed_jump_uncertainty(&self, delay_s: f64) -> Self {
        let mut b = self.clone();
        b.update_extra_sd();
        for jump in &self.motion.jumps {
            let at_s = jump.time_s + delay_s;
            let reach = jump.time_sd_s.max(JUMP_MARGIN_STEPS * self.sample_step_s);
            let of = |t: f64| self.sample_time_s.partition_point(|sample| *sample < t);
            if of(at_s - reach) < of(at_s + reach) {
                b.add_jump_uncertainty(at_s - reach);
                b.add_jump_uncertainty(at_s + reach);
            }
        }
        b
    }

    /// Midpoint of the two samples around a time.
    fn sample_midpoint_s(&self, at_s: f64) -> f64 {
        let k = self.sample_time_s.partition_point(|t| *t <= at_s);
        match (k.checked_sub(1).and_then(|k| self.sample_time_s.get(k)), self.sample_time_s.get(k)) {
            (Some(before), Some(after))
                if after - before
                    < (self.samples_per_block as f64 * MAX_MISSING_BLOCKS + 0.8) * self.sample_step_s =>
            {
                0.5 * (before + after)
            }
            _ => at_s,
        }
    }

    /// Smooth motion pieces for a force delayed by `delay_s`. Velocity jumps are placed at the sample midpoints if the force is neither
    /// delayed nor low-pass filtered (`smeared`), at the sample midpoints for the delay `jump_delay_s` if that is given and the force is
    /// delayed but not filtered, and otherwise at their exact times.
    #[must_use]
    pub fn motion_pieces(
        &self,
        smeared: bool,
        delay_s: f64,
        jump_delay_s: Option<f64>,
    ) -> Arc<Vec<MotionPiece>> {
        if let Some(jump_delay) = jump_delay_s.filter(|_| delay_s > 0.0 && !smeared) {
            Arc::new(
                self.cut_motion(JumpAppearance::DelayedBetweenSamples { delay_s, jump_delay_s: jump_delay }),
            )
        } else if delay_s > 0.0 {
            Arc::new(self.cut_motion(JumpAppearance::Delayed(delay_s)))
        } else if smeared {
            Arc::clone(
                self.exact_pieces.get_or_init(|| Arc::new(self.cut_motion(JumpAppearance::Delayed(0.0)))),
            )
        } else {
            Arc::clone(&self.pieces)
        }
    }

    fn cut_motion(&self, appearance: JumpAppearance) -> Vec<MotionPiece> {
        let spans = self.start_s.iter().copied().zip(self.end_s.iter().copied());
        self.motion.pieces(spans, appearance, |t| self.sample_midpoint_s(t))
    }

    /// The same blocks with other mean forces (N).
    #[must_use]
    pub fn with_force(&self, force_n: Vec<f64>) -> Self {
        Self { force_n, ..self.clone() }
    }

    /// The same blocks with a constant force (N) subtracted from means and samples.
    #[must_use]
    pub fn without_offset(&self, offset_n: f64) -> Self {
        let less = |force_n: &[f64]| force_n.iter().map(|f| f - offset_n).collect();
        Self {
            force_n: less(&self.force_n),
            sample_force_n: Arc::new(less(&self.sample_force_n)),
            ..self.clone()
        }
    }

    /// Residuals (N) per sample for block residuals `e` (N): the sample minus the predicted block mean, interpolated linearly within the
    /// block.
    #[must_use]
    pub fn sample_residuals(&self, e: &[f64]) -> Vec<f64> {
        let n = self.len();
        let mut within = 0;
        let mut before = u32::MAX;
        (0..self.sample_force_n.len())
            .map(|i| {
                let block = self.sample_block[i];
                within = if block == before { within + 1 } else { 0 };
                before = block;
                let k = block as usize;
                let (lo, hi) = (k.saturating_sub(1), (k + 1).min(n - 1));
                // Slope between the predicted means of the two neighbouring blocks.
                let predicted = |k: usize| self.force_n[k] - e[k];
                let slope =
                    (predicted(hi) - predicted(lo)) / ((hi - lo).max(1) * self.samples_per_block) as f64;
                let off = within as f64 - 0.5 * (self.samples_per_block as f64 - 1.0);
                self.sample_force_n[i] - predicted(k) - slope * off
            })
            .collect()
    }

    /// Standard deviation in N of the samples within their blocks, after removal of the linear trend between block means.
    #[must_use]
    pub fn within_block_sd_n(&self) -> f64 {
        if self.samples_per_block < 2 {
            return 0.0;
        }
        let mut sums = vec![(0.0, 0.0); self.len()];
        for (off, k) in self.sample_residuals(&vec![0.0; self.len()]).iter().zip(self.sample_block.iter()) {
            let s: &mut (f64, f64) = &mut sums[*k as usize];
            *s = (s.0 + 1.0, s.1 + off * off);
        }
        let mut variances: Vec<f64> =
            sums.iter().filter(|s| s.0 >= 2.0).map(|(n, square)| square / n).collect();
        variances.sort_unstable_by(f64::total_cmp);
        // Trimmed mean: the largest tenth contains ruptures and jumps.
        let kept = variances.len() * 9 / 10;
        (variances[..kept].iter().sum::<f64>() / kept.max(1) as f64).sqrt()
    }

    /// Number of blocks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.start_s.len()
    }

    /// Whether there is no block.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.start_s.is_empty()
    }

    /// Nominal length of a block in s.
    #[must_use]
    pub fn block_s(&self) -> f64 {
        self.sample_step_s * self.samples_per_block as f64
    }

    /// Middle of a block in s.
    #[must_use]
    pub fn mid_s(&self, k: usize) -> f64 {
        0.5 * (self.start_s[k] + self.end_s[k])
    }

    /// Number of blocks that enter the likelihood.
    #[must_use]
    pub fn compared_block_count(&self) -> usize {
        self.used.iter().filter(|u| **u).count()
    }

    /// Index of the block that contains a time, or of the next one.
    #[must_use]
    pub fn block_at(&self, time_s: f64) -> usize {
        self.end_s.partition_point(|t| *t <= time_s)
    }

    /// Start and end in s.
    #[must_use]
    pub fn span_s(&self) -> (f64, f64) {
        (self.start_s.first().copied().unwrap_or(0.0), self.end_s.last().copied().unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests;
