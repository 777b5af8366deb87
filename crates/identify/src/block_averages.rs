//! A recording as means over short blocks of time.
//!
//! The mean over the block in which a layer ruptures lies between the forces before and after, so a predicted
//! mean is continuous in the rupture time; and a recording at 1 kHz costs no more than one at 200 Hz.

use crate::motion::{JumpAppearance, Motion, MotionPiece};
use std::sync::{Arc, OnceLock};
use stylet_record::Recording;
use stylet_stats::UNIFORM_SD;
use stylet_tissue::effect::SGN_DEAD_BAND_MPS;

/// Block length in s: short compared with layers, relaxation and ripple, several samples at 200 Hz and more.
pub const BLOCK_S: f64 = 0.02;
/// A time step longer than this many sampling intervals is a gap.
const GAP_STEPS: f64 = 1.8;
/// A gap of at most this many blocks stays within a block; its other samples are compared.
const MAX_MISSING_BLOCKS: f64 = 1.0;
/// Longer gaps, in s, are not filled with blocks.
const MAX_BRIDGED_S: f64 = 2.0;
/// A sample this close (share of a sampling interval) to a velocity jump may have either velocity.
const JUMP_MARGIN_STEPS: f64 = 0.03;
/// Window in s over which the force magnitude is smoothed.
const FORCE_SMOOTHING_S: f64 = 0.1;

/// One recording in blocks.
#[derive(Clone, Debug)]
pub struct BlockAverages {
    /// Start of every block in s.
    pub start_s: Vec<f64>,
    /// End of every block in s.
    pub end_s: Vec<f64>,
    /// Mean recorded force in N.
    pub force_n: Vec<f64>,
    /// Whether the block is compared.
    pub used: Vec<bool>,
    /// Whether the noise memory restarts here because the preceding block is unknown.
    pub memory_reset: Vec<bool>,
    /// Magnitude of the smoothed recorded force in N.
    pub abs_force_n: Vec<f64>,
    /// Additional standard deviation in N of the block mean, from jumps between samples and unmodelled force.
    pub extra_sd_n: Vec<f64>,
    /// Times in s at which the force drops because something breaks.
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

/// Mean force over a time span. With missing samples each remaining one represents the times nearest to it, so
/// that a ramp or a step keeps its mean.
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
            start_s: Vec::new(),
            end_s: Vec::new(),
            force_n: Vec::new(),
            used: Vec::new(),
            memory_reset: Vec::new(),
            abs_force_n: Vec::new(),
            extra_sd_n: Vec::new(),
            unmodelled_sd_n: Vec::new(),
            break_times_s: Vec::new(),
            sample_time_s: Arc::new(recording.time_s.clone()),
            sample_force_n: Arc::new(recording.force_n.clone()),
            sample_block: Arc::default(),
            samples_per_block: q,
            sample_step_s: step_s,
            motion,
            pieces: Arc::default(),
            exact_pieces: Arc::default(),
        };
        let mut i = 0;
        let mut raw_block = Vec::with_capacity(n);
        while i < n {
            // Missing samples after the start of a block occupy places in it.
            let spans = |k: usize| {
                let gap = t[k] - t[k - 1];
                let missing = gap > GAP_STEPS * step_s
                    && gap <= (q as f64 * MAX_MISSING_BLOCKS + 0.8) * step_s
                    && q > 1;
                (gap <= GAP_STEPS * step_s || missing).then_some(if missing {
                    (gap / step_s).round() as usize
                } else {
                    1
                })
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

    /// Fills a gap up to `to_s` (s) with blocks that are not compared: the model continues there and may
    /// rupture.
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

    /// Excludes blocks with a sample at a velocity jump, or within its timing uncertainty: it may have either
    /// velocity.
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

    /// Blocks of `m` blocks each, for screening.
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

    /// Computes the derived columns.
    fn derive_columns(&mut self) {
        let n = self.len();
        self.memory_reset = (0..n)
            .map(|k| k == 0 || !self.used[k - 1] || self.start_s[k] - self.end_s[k - 1] > self.sample_step_s)
            .collect();
        let length_s = self.sample_step_s * self.samples_per_block as f64;
        let half = ((0.5 * FORCE_SMOOTHING_S / length_s).round() as usize).max(1);
        self.abs_force_n = (0..n)
            .map(|k| {
                let (lo, hi) = (k.saturating_sub(half), (k + half + 1).min(n));
                self.force_n[lo..hi].iter().sum::<f64>().abs() / (hi - lo) as f64
            })
            .collect();
        self.update_extra_sd();
        self.pieces = Arc::new(self.cut_motion(JumpAppearance::BetweenSamples));
    }

    /// The same blocks with times (s) at which the force drops because something breaks: the break lies between
    /// two samples, and its time is known to within a sampling interval.
    #[must_use]
    pub fn with_break_times(mut self, falls_s: Vec<f64>) -> Self {
        self.break_times_s = falls_s;
        self.update_extra_sd();
        self
    }

    /// The same blocks with an unmodelled force of the given standard deviation (N) around each.
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

    /// A jump lies between two samples: the mean of its block is uncertain by the jump times one sampling
    /// interval.
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

    /// The same blocks for a force delayed by `late_s`: its jumps lie between other samples, and where position
    /// noise leaves open between which, the block mean is uncertain.
    #[must_use]
    pub fn with_delayed_jump_uncertainty(&self, late_s: f64) -> Self {
        let mut b = self.clone();
        b.update_extra_sd();
        for jump in &self.motion.jumps {
            let at_s = jump.time_s + late_s;
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

    /// Smooth motion pieces for a force delayed by `late_s`. Jumps are placed at their exact times if the force
    /// is low-pass filtered (`smeared`) or delayed; if it is delayed, not filtered, and `placed` is given, at
    /// the sample midpoints for that delay.
    #[must_use]
    pub fn motion_pieces(&self, smeared: bool, late_s: f64, placed: Option<f64>) -> Arc<Vec<MotionPiece>> {
        if let Some(placed_s) = placed.filter(|_| late_s > 0.0 && !smeared) {
            Arc::new(self.cut_motion(JumpAppearance::DelayedBetweenSamples {
                delay_s: late_s,
                jump_delay_s: placed_s,
            }))
        } else if late_s > 0.0 {
            Arc::new(self.cut_motion(JumpAppearance::Delayed(late_s)))
        } else if smeared {
            Arc::clone(
                self.exact_pieces.get_or_init(|| Arc::new(self.cut_motion(JumpAppearance::Delayed(0.0)))),
            )
        } else {
            Arc::clone(&self.pieces)
        }
    }

    fn cut_motion(&self, shown: JumpAppearance) -> Vec<MotionPiece> {
        let spans = self.start_s.iter().copied().zip(self.end_s.iter().copied());
        self.motion.pieces(spans, shown, |t| self.sample_midpoint_s(t))
    }

    /// Residuals (N) of the samples for block residuals `e`: the block residual plus the sample's deviation
    /// from the course of the block means.
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
                // Predicted means are interpolated with the slope of their neighbours.
                let predicted = |k: usize| self.force_n[k] - e[k];
                let slope =
                    (predicted(hi) - predicted(lo)) / ((hi - lo).max(1) * self.samples_per_block) as f64;
                let off = within as f64 - 0.5 * (self.samples_per_block as f64 - 1.0);
                self.sample_force_n[i] - predicted(k) - slope * off
            })
            .collect()
    }

    /// Standard deviation in N of samples about the course of the block means; a force trend within a block is
    /// not noise.
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
        // Mean without the largest tenth, which contains ruptures and jumps.
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
mod tests {
    use super::*;
    use crate::motion::JumpTiming;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-3), "{told} for {wanted}");
    }

    fn are(told: &[f64], wanted: impl IntoIterator<Item = f64>) {
        let wanted: Vec<f64> = wanted.into_iter().collect();
        assert_eq!(told.len(), wanted.len());
        told.iter().zip(wanted).for_each(|(told, wanted)| near(*told, wanted));
    }

    /// Constant velocity; the force at these times (s).
    fn recorded(t: Vec<f64>, force: impl Fn(f64) -> f64) -> Recording {
        let z = t.iter().map(|t| 0.002 * t).collect();
        let f = t.iter().map(|t| force(*t)).collect();
        Recording::new(t, z, f).expect("a recording")
    }

    fn even(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64 * 0.005).collect()
    }

    /// Blocks of four samples at 200 Hz.
    fn of(t: Vec<f64>, force: impl Fn(f64) -> f64) -> BlockAverages {
        BlockAverages::new(&recorded(t, force), &[], BLOCK_S)
    }

    /// The same with one velocity jump.
    fn with_jump(b: &BlockAverages, at_s: f64, between_s: f64, doubt_s: f64) -> BlockAverages {
        let jump = JumpTiming {
            time_s: at_s,
            sample_mid_s: between_s,
            time_sd_s: doubt_s,
            position_m: 0.002 * at_s,
            velocity_mps: [0.002, 0.0],
        };
        let mut motion = (*b.motion).clone();
        motion.jumps = vec![jump];
        BlockAverages { motion: Arc::new(motion), ..b.clone() }
    }

    #[test]
    fn a_block_is_the_mean_of_its_samples_and_ends_midway_to_the_next() {
        // Sample times up to a millisecond off the regular ones.
        let off = [0.0, 0.0, 0.0, 0.001, -0.001, 0.0, 0.0];
        let t: Vec<f64> = even(43).iter().enumerate().map(|(k, t)| t + off[k % 7]).collect();
        let force = |t: f64| 1.0 + (40.0 * t).sin();
        let b = of(t.clone(), force);
        assert_eq!((b.len(), b.samples_per_block, b.is_empty()), (11, 4, false));
        near(b.sample_step_s, 0.005);
        let ends: Vec<f64> = (1..11).map(|k| 0.5 * (t[4 * k - 1] + t[4 * k])).collect();
        are(&b.start_s, [-0.0025].into_iter().chain(ends.iter().copied()));
        are(&b.end_s, ends.iter().copied().chain([t[42] + 0.0025]));
        are(&b.force_n, t.chunks(4).map(|t| t.iter().map(|t| force(*t)).sum::<f64>() / t.len() as f64));
        // Three of four samples are more than half of a block.
        assert_eq!(b.used, [true; 11]);
        assert_eq!(b.memory_reset, core::array::from_fn::<bool, 11, _>(|k| k == 0));
        assert_eq!(*b.sample_block, (0..43).map(|k| k / 4).collect::<Vec<u32>>());
        near(b.span_s().0, -0.0025);
        near(b.span_s().1, t[42] + 0.0025);
        assert_eq!(
            (b.block_at(-1.0), b.block_at(ends[4]), b.block_at(ends[4] - 1e-6), b.block_at(9.0)),
            (0, 5, 4, 11)
        );
        // Two of four samples are not; a block of one sample is used.
        assert_eq!(of(even(42), force).used[10..], [false]);
        let single = BlockAverages::new(&recorded(even(20), force), &[], 0.001);
        assert_eq!((single.samples_per_block, single.len()), (1, 20));
        assert!(single.used.iter().all(|u| *u));
        let none = BlockAverages { start_s: Vec::new(), end_s: Vec::new(), ..single };
        assert_eq!((none.len(), none.is_empty(), none.span_s()), (0, true, (0.0, 0.0)));
    }

    #[test]
    fn excluded_samples_do_not_count_and_disable_a_block_from_one_half_on() {
        let excluded = [1, 8, 9, 12, 13, 14, 15, 40];
        let exclude: Vec<bool> = (0..43).map(|k| excluded.contains(&k)).collect();
        let b = BlockAverages::new(&recorded(even(43), |t| 200.0 * t), &exclude, BLOCK_S);
        let used: Vec<usize> = (0..b.len()).filter(|k| b.used[*k]).collect();
        // Two of the last three samples remain, more than half.
        assert_eq!(used, [0, 1, 4, 5, 6, 7, 8, 9, 10]);
        are(&b.force_n[..5], [1.5, 5.5, 10.25, 0.0, 17.5]);
        // Sample 41 represents the excluded one before it.
        near(b.force_n[10], 124.0 / 3.0);
        let restart: Vec<usize> = (0..b.len()).filter(|k| b.memory_reset[*k]).collect();
        assert_eq!(restart, [0, 3, 4]);
    }

    #[test]
    fn short_gaps_are_filled_with_blocks_that_are_not_compared() {
        let t = |gap_s: f64| -> Vec<f64> {
            even(40).iter().enumerate().map(|(k, t)| if k < 19 { *t } else { t + gap_s - 0.005 }).collect()
        };
        let b = of(t(0.1), |t| 3.0 + t);
        // Samples 16 to 18, then 0.095 s in five blocks, then four samples each.
        assert_eq!(b.len(), 5 + 5 + 6);
        let edges: Vec<f64> = (0..=5).map(|k| 0.0925 + 0.019 * f64::from(k)).collect();
        are(&b.start_s[5..10], edges[..5].iter().copied());
        are(&b.end_s[5..10], edges[1..].iter().copied());
        are(&b.force_n[4..10], [3.085; 6]);
        let told: Vec<bool> = (0..16).map(|k| !(5..10).contains(&k)).collect();
        assert_eq!(b.used[..15], told[..15]);
        assert!(!b.used[15]);
        let restart: Vec<usize> = (0..16).filter(|k| b.memory_reset[*k]).collect();
        assert_eq!(restart, [0, 6, 7, 8, 9, 10]);
        near(b.start_s[10], 0.1875);
        assert_eq!((b.sample_block[18], b.sample_block[19], b.sample_block[23]), (4, 10, 11));
        // Up to two seconds, without the half intervals at either end.
        assert_eq!(of(t(2.004), |t| t).len(), 11 + 100);
        let open = of(t(2.006), |t| t);
        assert_eq!(open.len(), 11);
        assert_eq!((0..11).filter(|k| open.memory_reset[*k]).collect::<Vec<_>>(), [0, 5]);
        // Less than 1.8 intervals is not a gap.
        assert_eq!(of(t(0.0089), |t| t).len(), 10);
        // Samples missing for longer than a block leave a gap.
        assert_eq!(of(t(0.0239), |t| t).len(), 11);
        assert_eq!(of(t(0.0241), |t| t).len(), 11 + 1);
    }

    /// The remaining samples stay in the blocks they would otherwise be in, and the noise memory continues.
    #[test]
    fn a_few_missing_samples_do_not_move_the_blocks() {
        let missing = [5, 11, 12, 19, 20, 21, 30, 39];
        let t = even(43).into_iter().enumerate().filter(|(k, _)| !missing.contains(k)).map(|(_, t)| t);
        let (b, whole) = (of(t.collect(), |t| 200.0 * t), of(even(43), |t| 200.0 * t));
        are(&b.start_s, whole.start_s.iter().copied());
        are(&b.end_s, whole.end_s.iter().copied());
        // A linear force keeps its mean when samples are missing inside, and half of the error when they are
        // missing at an end.
        are(&b.force_n[1..6], [5.5, 9.25, 13.75, 17.25, 22.25]);
        assert_eq!((0..11).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [5]);
        assert_eq!((0..11).filter(|k| b.memory_reset[*k]).collect::<Vec<_>>(), [0, 6]);
    }

    /// Within a margin of the jump, or within its timing uncertainty.
    #[test]
    fn a_block_with_a_sample_at_a_velocity_jump_is_excluded() {
        let t = even(40);
        let b = of(t.clone(), |t| t);
        let left_out = |at_s: f64, doubt_s: f64| -> Vec<usize> {
            let mut b = with_jump(&b, at_s, at_s, doubt_s);
            b.exclude_jump_blocks(&t);
            (0..b.len()).filter(|k| !b.used[*k]).collect()
        };
        // Sample 18 at 0.09 s is in block 4, which spans 0.0775 to 0.0975 s.
        assert_eq!(left_out(0.09, 0.0), [4]);
        assert_eq!(left_out(0.09 + 0.00014, 0.0), [4]);
        assert_eq!(left_out(0.09 - 0.00014, 0.0), [4]);
        assert_eq!(left_out(0.09 + 0.00016, 0.0), [0_usize; 0]);
        assert_eq!(left_out(0.09 - 0.00016, 0.0), [0_usize; 0]);
        assert_eq!(left_out(0.0925, 0.0024), [0_usize; 0]);
        assert_eq!(left_out(0.0925, 0.0026), [4]);
        // All existing blocks within the uncertainty.
        assert_eq!(left_out(0.0775, 0.003), [3, 4]);
        assert_eq!(left_out(0.0775, 0.021), [2, 3, 4, 5]);
        assert_eq!(left_out(0.19, 0.03), [8, 9]);
        // In a recording: the needle stops at sample 60, in block 15.
        let t = even(400);
        let z: Vec<f64> = t.iter().map(|t| 0.002 * t.min(0.3)).collect();
        let b = BlockAverages::new(&Recording::new(t, z, vec![0.0; 400]).expect("a recording"), &[], BLOCK_S);
        assert_eq!((0..100).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [15]);
    }

    #[test]
    fn coarsened_blocks_average_whole_groups_and_do_not_span_gaps() {
        // 36 samples, three seconds of nothing, 32 samples: nine blocks and eight.
        let t: Vec<f64> =
            even(68).iter().enumerate().map(|(k, t)| if k < 36 { *t } else { t + 3.0 }).collect();
        let exclude: Vec<bool> = (0..68).map(|k| (12..16).contains(&k)).collect();
        let b = BlockAverages::new(&recorded(t, |t| (9.0 * t).cos()), &exclude, BLOCK_S);
        assert_eq!(b.len(), 17);
        let fine = b.motion_pieces(true, 0.0, None);
        let c = b.coarsened(4);
        let groups = [(0, 4), (4, 8), (8, 9), (9, 13), (13, 17)];
        assert_eq!((c.len(), c.samples_per_block), (5, 16));
        are(&c.start_s, groups.map(|g| b.start_s[g.0]));
        are(&c.end_s, groups.map(|g| b.end_s[g.1 - 1]));
        are(&c.force_n, groups.map(|g| b.force_n[g.0..g.1].iter().sum::<f64>() / (g.1 - g.0) as f64));
        // The first group contains a block that is not compared, the third is incomplete.
        assert_eq!(c.used, [false, true, false, true, true]);
        assert_eq!(c.memory_reset, [true, true, false, true, false]);
        assert_eq!((c.abs_force_n.len(), c.extra_sd_n.len()), (5, 5));
        // Motion pieces follow the coarser blocks.
        for pieces in [c.motion_pieces(false, 0.0, None), c.motion_pieces(true, 0.0, None)] {
            assert_eq!(pieces.iter().map(|p| p.block).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
            are(&pieces.iter().map(|p| p.end_s).collect::<Vec<_>>(), c.end_s.iter().copied());
        }
        assert_eq!(fine.len(), 17);
    }

    #[test]
    fn force_magnitude_is_smoothed_over_a_tenth_of_a_second() {
        // Blocks of 30 ms: two on each side.
        let b = BlockAverages::new(&recorded(even(66), |t| (20.0 * t).sin()), &[], 0.03);
        assert_eq!((b.len(), b.samples_per_block), (11, 6));
        let around = |k: usize| -> Vec<f64> {
            (0..11).filter(|i: &usize| i.abs_diff(k) <= 2).map(|i| b.force_n[i]).collect()
        };
        are(&b.abs_force_n, (0..11).map(|k| (around(k).iter().sum::<f64>() / around(k).len() as f64).abs()));
        // At least one block on each side.
        let long = BlockAverages::new(&recorded(even(200), |t| t), &[], 0.2);
        are(&long.abs_force_n[..2], [0.5 * (long.force_n[0] + long.force_n[1]), long.force_n[1]]);
    }

    #[test]
    fn a_block_mean_with_a_velocity_jump_is_uncertain_by_one_sampling_interval() {
        let force = |t: f64| if t < 0.096 { 1.0 } else { 3.0 };
        let b = of(even(40), force);
        let doubts = |at_s: f64, between_s: f64| {
            let mut b = with_jump(&b, at_s, between_s, 0.0);
            b.derive_columns();
            b.extra_sd_n
        };
        // A quarter of 2 N, uniformly distributed; block 4 ends at 0.0975 s.
        let at = |block: usize| (0..10).map(move |k| if k == block { 0.5 * 0.289 } else { 0.0 });
        are(&doubts(0.0, 0.096), at(4));
        are(&doubts(0.096, 0.098), at(5));
        // At either end the jump height is unknown.
        for between_s in [0.0, 0.19, 0.5] {
            are(&doubts(0.096, between_s), [0.0; 10]);
        }
        // The same at a break; in coarser blocks still one sampling interval.
        let fell = of(even(40), force).with_break_times(vec![0.09]);
        are(&fell.extra_sd_n, at(4));
        are(&fell.with_delayed_jump_uncertainty(0.01).extra_sd_n, at(4));
        let coarse = of(even(80), force).with_break_times(vec![0.09]).coarsened(3);
        near(coarse.extra_sd_n[1], 2.0 / 12.0 * 0.289);
        // The larger of two jumps counts.
        let mut two = with_jump(&b, 0.0, 0.09, 0.0);
        two.add_jump_uncertainty(0.09);
        two.extra_sd_n[4] *= 3.0;
        two.add_jump_uncertainty(0.09);
        near(two.extra_sd_n[4], 1.5 * 0.289);
    }

    #[test]
    fn unmodelled_force_adds_to_the_uncertainty_of_a_block_mean() {
        let force = |t: f64| if t < 0.09 { 1.0 } else { 3.0 };
        let left: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(k)).collect();
        let b = of(even(40), force).with_unmodelled_sd(left.clone());
        are(&b.extra_sd_n, left.clone());
        // The larger of both at a break; the unmodelled part averages as independent noise.
        let fell = b.clone().with_break_times(vec![0.09]);
        are(&fell.extra_sd_n, left.iter().map(|l| l.max(if *l == 0.4 { 0.5 * 0.289 } else { 0.0 })));
        near(b.coarsened(2).extra_sd_n[1], (0.04_f64 + 0.09).sqrt() / 2.0);
        are(&fell.with_unmodelled_sd(vec![0.0; 10]).with_break_times(Vec::new()).extra_sd_n, [0.0; 10]);
    }

    #[test]
    fn a_delayed_force_is_uncertain_where_jump_and_sample_coincide() {
        let b = of(even(60), |t| 100.0 * t * t);
        let size = |k: usize| (b.force_n[k + 1] - b.force_n[k - 1]).abs() / 4.0 * 0.289;
        let late = |doubt_s: f64, late_s: f64| -> Vec<usize> {
            let seen = with_jump(&b, 0.06, 0.062, doubt_s).with_delayed_jump_uncertainty(late_s);
            let told: Vec<usize> = (0..15).filter(|k| seen.extra_sd_n[*k] > 0.0).collect();
            told.iter().for_each(|k| near(seen.extra_sd_n[*k], size(*k)));
            told
        };
        // Between samples it is in block 3, as without a delay.
        assert_eq!(late(0.0, 0.0772), [3]);
        // Around 0.1375 s, between samples at 0.135 and 0.14, the end of block 6: certain until the uncertainty
        // reaches a sample.
        assert_eq!(late(0.0024, 0.0775), [3]);
        assert_eq!(late(0.0026, 0.0775), [3, 6, 7]);
        // A sample closer than 3 % of an interval may have either velocity.
        assert_eq!(late(0.0, 0.08 + 0.00014), [3, 7]);
        assert_eq!(late(0.0, 0.08 - 0.00014), [3, 7]);
        assert_eq!(late(0.0, 0.08 + 0.00016), [3]);
        assert_eq!(late(0.0, 0.08 - 0.00016), [3]);
    }

    #[test]
    fn sample_midpoints_exclude_gaps_and_ends() {
        let t: Vec<f64> = even(20).iter().map(|t| if *t < 0.048 { *t } else { t + 0.1 }).collect();
        let b = of(t, |t| t);
        near(b.sample_midpoint_s(0.0131), 0.0125);
        near(b.sample_midpoint_s(0.0149), 0.0125);
        near(b.sample_midpoint_s(0.0151), 0.0175);
        // In a gap and outside of the recording the time itself is used.
        for at_s in [0.0799, -0.003, 0.2] {
            near(b.sample_midpoint_s(at_s), at_s);
        }
        near(b.sample_midpoint_s(0.0), 0.0025);
    }

    #[test]
    fn motion_is_cut_where_jumps_appear_in_the_force() {
        let t = even(120);
        let z: Vec<f64> = t.iter().map(|t| 0.002 * t.min(0.3013)).collect();
        let b = BlockAverages::new(&Recording::new(t, z, vec![0.0; 120]).expect("a recording"), &[], BLOCK_S);
        let cut = |smeared: bool, late_s: f64, placed: Option<f64>| {
            let pieces = b.motion_pieces(smeared, late_s, placed);
            let ends: Vec<f64> =
                pieces.windows(2).filter(|p| p[0].block == p[1].block).map(|p| p[0].end_s).collect();
            assert_eq!((pieces.len(), ends.len()), (31, 1));
            (ends[0], pieces.iter().find(|p| p.end_s == ends[0]).map_or(0.0, |p| p.velocity_mps))
        };
        let is = |(at_s, v): (f64, f64), wanted: f64| {
            assert!((at_s - wanted).abs() < 1e-5 && (v - 0.002).abs() < 1e-7, "{at_s} for {wanted}, {v}");
        };
        is(cut(false, 0.0, None), 0.3025);
        is(cut(false, 0.0, Some(0.02)), 0.3025);
        is(cut(true, 0.0, None), 0.3013);
        is(cut(true, 0.0, Some(0.02)), 0.3013);
        for smeared in [false, true] {
            is(cut(smeared, 0.0271, None), 0.3284);
        }
        is(cut(true, 0.0271, Some(0.0271)), 0.3284);
        is(cut(false, 0.0271, Some(0.0271)), 0.3275);
        is(cut(false, 0.0271, Some(0.0301)), 0.3325);
    }

    #[test]
    fn sample_residuals_interpolate_block_residuals_linearly() {
        let b = of(even(48), |t| 2.0 - 30.0 * t);
        let e: Vec<f64> = (0..12).map(|k| 0.3 + 0.01 * f64::from(k)).collect();
        // The middle of block k is at sample 4 k + 1.5.
        are(&b.sample_residuals(&e), (0..48).map(|i| 0.3 + 0.01 * (f64::from(i) - 1.5) / 4.0));
        // A sample's own deviation is added.
        let mut raw = (*b.sample_force_n).clone();
        raw[21] += 0.7;
        let spiked = BlockAverages { sample_force_n: Arc::new(raw), ..b.clone() };
        let told: Vec<f64> =
            spiked.sample_residuals(&e).iter().zip(b.sample_residuals(&e)).map(|(a, b)| a - b).collect();
        are(&told, (0..48).map(|i| if i == 21 { 0.7 } else { 0.0 }));
        // The slope is the one between the neighbouring means.
        let mut bent = e.clone();
        bent[5] += 0.4;
        let told = b.sample_residuals(&bent);
        for (i, off) in [(16, -1.5), (17, -0.5), (18, 0.5), (19, 1.5)] {
            near(told[i], 0.3 + 0.01 * (i as f64 - 1.5) / 4.0 + 0.4 / 8.0 * off);
        }
        near(told[20], 0.3 + 0.01 * 18.5 / 4.0 + 0.4);
    }

    #[test]
    fn within_block_deviation_excludes_the_largest_tenth() {
        // In block k samples alternate by k + 1 mN, in two of twenty blocks by a hundred times as much.
        let size = |k: usize| 0.001 * (k + 1) as f64 * if k == 3 || k == 11 { 100.0 } else { 1.0 };
        let force = |t: f64| {
            let i = (t / 0.005).round() as usize;
            0.5 + size(i / 4) * if i.is_multiple_of(2) { 1.0 } else { -1.0 }
        };
        let b = of(even(80), force);
        let calm: f64 = (0..20).filter(|k| *k != 3 && *k != 11).map(|k| size(k) * size(k)).sum();
        assert!((b.within_block_sd_n() - (calm / 18.0).sqrt()).abs() < 1e-9, "{}", b.within_block_sd_n());
        // One more sample is a block without a spread; one that follows the course of the means changes
        // nothing.
        let more = of(even(81), |t| if t > 0.398 { 0.5 } else { force(t) });
        assert!((more.within_block_sd_n() - b.within_block_sd_n()).abs() < 1e-9);
        assert_eq!(BlockAverages::new(&recorded(even(80), force), &[], 0.001).within_block_sd_n(), 0.0);
        // A force that rises by 20 N/s changes by 0.3 N within a block without adding noise.
        let rising = of(even(80), |t| force(t) + 20.0 * t);
        assert!(
            (rising.within_block_sd_n() - b.within_block_sd_n()).abs() < 1e-9,
            "{}",
            rising.within_block_sd_n()
        );
    }
}
