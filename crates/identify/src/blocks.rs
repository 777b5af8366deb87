//! A recording as means over short blocks of time, ready for thousands of replays.
//!
//! The mean over a block in which a layer ruptures lies between the force before and after, so that a predicted mean is
//! continuous in the instant of the rupture; and a recording at 1 kHz costs as much as one at 200 Hz.

use std::sync::{Arc, OnceLock};
use stylet_record::Recording;
use stylet_record::motion::{Motion, Piece, Shown};
use stylet_stats::UNIFORM_SD;
use stylet_tissue::effect::SGN_DEAD_BAND_MPS;

/// Length of a block in s: short against layers, relaxation and ripple, long against samples at 200 Hz and more.
pub const BLOCK_S: f64 = 0.02;
/// A time step of more than so many sampling steps is a gap.
const GAP: f64 = 1.8;
/// Samples missing between two that are compared in one block with them: a gap of no more than so many blocks.
const MISSING: f64 = 1.0;
/// A longer gap, in s, is left open.
const BRIDGED_S: f64 = 2.0;
/// A sample so near (share of a step) to a jump of the speed may have either speed.
const AT_A_JUMP: f64 = 0.03;
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
    /// Standard deviation in N of what sampling leaves open of the block's mean where the speed jumps or something gives way.
    pub doubt_n: Vec<f64>,
    /// Instants in s at which something gives way.
    falls_s: Vec<f64>,
    /// Standard deviation in N of what no law explains around every block; empty where nothing is unexplained.
    unexplained_n: Vec<f64>,
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

/// Mean of forces over a stretch of time. Where samples are missing of it each of the others stands for the time that is nearest to it: what
/// rises or jumps meanwhile has the mean that it would have with them.
fn mean_over((from_s, to_s): (f64, f64), samples: impl Iterator<Item = (f64, f64)>, whole: bool) -> f64 {
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

impl Blocks {
    /// The blocks of a recording, about `length_s` long; samples marked in `exclude` are not compared.
    #[must_use]
    pub fn new(recording: &Recording, exclude: &[bool], length_s: f64) -> Self {
        let steps = recording.time_s.windows(2).map(|w| w[1] - w[0]);
        let step_s = stylet_stats::order::median_of(steps).max(1e-9);
        let q = ((length_s / step_s).round() as usize).max(1);
        let motion = Arc::new(Motion::of(recording, SGN_DEAD_BAND_MPS));
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
            unexplained_n: Vec::new(),
            falls_s: Vec::new(),
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
            // Where a block began with samples missing, they count as places of it.
            let spans = |k: usize| {
                let gap = t[k] - t[k - 1];
                let missing = gap > GAP * step_s && gap <= (q as f64 * MISSING + 0.8) * step_s && q > 1;
                (gap <= GAP * step_s || missing).then_some(if missing {
                    (gap / step_s).round() as usize
                } else {
                    1
                })
            };
            let begun_s = b.to_s.last().copied().filter(|_| i > 0 && spans(i).is_some_and(|s| s > 1));
            let mut places = begun_s.map_or(1, |s| ((t[i] - s) / step_s + 0.5).round().max(1.0) as usize);
            let mut to = i + 1;
            while to < n && spans(to).is_some_and(|s| places + s <= q) {
                places += spans(to).unwrap_or(1);
                to += 1;
            }
            let good = |k: &usize| !exclude.get(*k).copied().unwrap_or(false);
            let kept: Vec<usize> = (i..to).filter(good).collect();
            let from_s = if i > 0 && t[i] - t[i - 1] <= GAP * step_s {
                0.5 * (t[i] + t[i - 1])
            } else {
                begun_s.unwrap_or(t[i] - 0.5 * step_s)
            };
            let to_s = if to < n && t[to] - t[to - 1] <= GAP * step_s {
                0.5 * (t[to] + t[to - 1])
            } else {
                let missing = if to < n && spans(to).is_some() { q.saturating_sub(places) } else { 0 };
                t[to - 1] + (missing as f64 + 0.5) * step_s
            };
            b.bridge(from_s, length_s);
            b.from_s.push(from_s);
            b.to_s.push(to_s);
            let whole = kept.len() as f64 + 0.5 > (to_s - from_s) / step_s;
            b.f.push(mean_over((from_s, to_s), kept.iter().map(|k| (t[*k], recording.force_n[*k])), whole));
            b.used.push(2 * kept.len() > q.min(to - i) && 2 * (to - i) > q);
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
        let unexplained_n = std::mem::take(&mut b.unexplained_n);
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
            if let Some(of) = unexplained_n.get(i..to) {
                b.unexplained_n.push(of.iter().map(|u| u * u).sum::<f64>().sqrt() / of.len() as f64);
            }
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
        self.doubt_what_jumps();
        self.pieces = Arc::new(self.pieces_shown(Shown::Sampled));
    }

    /// The same blocks with instants (s) at which the force falls because something gives way: it does so between two samples, and a law
    /// that says where knows it within a sample only.
    #[must_use]
    pub fn falling(mut self, falls_s: Vec<f64>) -> Self {
        self.falls_s = falls_s;
        self.doubt_what_jumps();
        self
    }

    /// The same blocks where around each of them so much (N, standard deviation) is left that no law explains: it is in doubt by that.
    #[must_use]
    pub fn unexplained(mut self, sd_n: Vec<f64>) -> Self {
        self.unexplained_n = sd_n;
        self.doubt_what_jumps();
        self
    }

    fn doubt_what_jumps(&mut self) {
        self.doubt_n.clone_from(&self.unexplained_n);
        self.doubt_n.resize(self.len(), 0.0);
        let motion = Arc::clone(&self.motion);
        motion.jumps.iter().for_each(|j| self.doubt_jump(j.between_s));
        let falls = std::mem::take(&mut self.falls_s);
        falls.iter().for_each(|t| self.doubt_jump(*t));
        self.falls_s = falls;
    }

    /// A force that jumps with the speed jumps between two samples: its mean is known to what lies between them.
    fn doubt_jump(&mut self, at_s: f64) {
        let k = self.at(at_s);
        if k > 0 && k + 1 < self.len() {
            let after = self.raw_t.partition_point(|t| *t <= at_s).clamp(1, self.raw_t.len() - 1);
            let steps = ((self.raw_t[after] - self.raw_t[after - 1]) / self.step_s).round();
            let open = steps.clamp(1.0, self.samples as f64) / self.samples as f64;
            let step = (self.f[k + 1] - self.f[k - 1]).abs() * open * UNIFORM_SD;
            self.doubt_n[k] = self.doubt_n[k].max(step);
        }
    }

    /// The same for a force that is late by so many s: its jumps are between other samples, and where noisy positions leave open
    /// between which, the mean of their block is uncertain.
    #[must_use]
    pub fn seen_late(&self, late_s: f64) -> Self {
        let mut b = self.clone();
        b.doubt_what_jumps();
        for jump in &self.motion.jumps {
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
            (Some(before), Some(after))
                if after - before < (self.samples as f64 * MISSING + 0.8) * self.step_s =>
            {
                0.5 * (before + after)
            }
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

    /// Standard deviation in N of recorded forces about the course of their blocks' means: what a force changes by within a block is no noise.
    #[must_use]
    pub fn within_n(&self) -> f64 {
        if self.samples < 2 {
            return 0.0;
        }
        let mut sums = vec![(0.0, 0.0); self.len()];
        for (off, k) in self.raw_residual(&vec![0.0; self.len()]).iter().zip(self.raw_block.iter()) {
            let s: &mut (f64, f64) = &mut sums[*k as usize];
            *s = (s.0 + 1.0, s.1 + off * off);
        }
        let mut variances: Vec<f64> =
            sums.iter().filter(|s| s.0 >= 2.0).map(|(n, square)| square / n).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_record::motion::Jump;

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-3), "{told} for {wanted}");
    }

    fn are(told: &[f64], wanted: impl IntoIterator<Item = f64>) {
        let wanted: Vec<f64> = wanted.into_iter().collect();
        assert_eq!(told.len(), wanted.len());
        told.iter().zip(wanted).for_each(|(told, wanted)| near(*told, wanted));
    }

    /// A needle that goes evenly; the force at these instants (s).
    fn recorded(t: Vec<f64>, force: impl Fn(f64) -> f64) -> Recording {
        let z = t.iter().map(|t| 0.002 * t).collect();
        let f = t.iter().map(|t| force(*t)).collect();
        Recording::new(t, z, f).expect("a recording")
    }

    fn even(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64 * 0.005).collect()
    }

    /// Blocks of four samples at 200 Hz.
    fn of(t: Vec<f64>, force: impl Fn(f64) -> f64) -> Blocks {
        Blocks::new(&recorded(t, force), &[], BLOCK_S)
    }

    /// The same with one jump of the speed.
    fn with_jump(b: &Blocks, at_s: f64, between_s: f64, doubt_s: f64) -> Blocks {
        let jump = Jump { at_s, between_s, doubt_s, z_m: 0.002 * at_s, v_mps: [0.002, 0.0] };
        let mut motion = (*b.motion).clone();
        motion.jumps = vec![jump];
        Blocks { motion: Arc::new(motion), ..b.clone() }
    }

    #[test]
    fn a_block_is_the_mean_of_its_samples_and_ends_half_way_to_the_next() {
        // Instants that lie up to a millisecond off the even ones, mostly none.
        let off = [0.0, 0.0, 0.0, 0.001, -0.001, 0.0, 0.0];
        let t: Vec<f64> = even(43).iter().enumerate().map(|(k, t)| t + off[k % 7]).collect();
        let force = |t: f64| 1.0 + (40.0 * t).sin();
        let b = of(t.clone(), force);
        assert_eq!((b.len(), b.samples, b.is_empty()), (11, 4, false));
        near(b.step_s, 0.005);
        let ends: Vec<f64> = (1..11).map(|k| 0.5 * (t[4 * k - 1] + t[4 * k])).collect();
        are(&b.from_s, [-0.0025].into_iter().chain(ends.iter().copied()));
        are(&b.to_s, ends.iter().copied().chain([t[42] + 0.0025]));
        are(&b.f, t.chunks(4).map(|t| t.iter().map(|t| force(*t)).sum::<f64>() / t.len() as f64));
        // Three of four samples are more than half of a block.
        assert_eq!(b.used, [true; 11]);
        assert_eq!(b.restart, core::array::from_fn::<bool, 11, _>(|k| k == 0));
        assert_eq!(*b.raw_block, (0..43).map(|k| k / 4).collect::<Vec<u32>>());
        near(b.span_s().0, -0.0025);
        near(b.span_s().1, t[42] + 0.0025);
        assert_eq!((b.at(-1.0), b.at(ends[4]), b.at(ends[4] - 1e-6), b.at(9.0)), (0, 5, 4, 11));
        // Two samples of four are not, and a block of one sample is one.
        assert_eq!(of(even(42), force).used[10..], [false]);
        let single = Blocks::new(&recorded(even(20), force), &[], 0.001);
        assert_eq!((single.samples, single.len()), (1, 20));
        assert!(single.used.iter().all(|u| *u));
        let none = Blocks { from_s: Vec::new(), to_s: Vec::new(), ..single };
        assert_eq!((none.len(), none.is_empty(), none.span_s()), (0, true, (0.0, 0.0)));
    }

    #[test]
    fn samples_that_are_excluded_do_not_count_and_half_a_block_of_them_is_none() {
        let excluded = [1, 8, 9, 12, 13, 14, 15, 40];
        let exclude: Vec<bool> = (0..43).map(|k| excluded.contains(&k)).collect();
        let b = Blocks::new(&recorded(even(43), |t| 200.0 * t), &exclude, BLOCK_S);
        let used: Vec<usize> = (0..b.len()).filter(|k| b.used[*k]).collect();
        // Of the last three samples two are left, more than half of them.
        assert_eq!(used, [0, 1, 4, 5, 6, 7, 8, 9, 10]);
        are(&b.f[..5], [1.5, 5.5, 10.25, 0.0, 17.5]);
        // Sample 41 stands for the one before it, too.
        near(b.f[10], 124.0 / 3.0);
        let restart: Vec<usize> = (0..b.len()).filter(|k| b.restart[*k]).collect();
        assert_eq!(restart, [0, 3, 4]);
    }

    #[test]
    fn a_gap_is_bridged_by_blocks_that_are_not_compared_unless_it_is_long() {
        let t = |gap_s: f64| -> Vec<f64> {
            even(40).iter().enumerate().map(|(k, t)| if k < 19 { *t } else { t + gap_s - 0.005 }).collect()
        };
        let b = of(t(0.1), |t| 3.0 + t);
        // Samples 16 to 18, then 0.095 s in five blocks, then four samples each.
        assert_eq!(b.len(), 5 + 5 + 6);
        let edges: Vec<f64> = (0..=5).map(|k| 0.0925 + 0.019 * f64::from(k)).collect();
        are(&b.from_s[5..10], edges[..5].iter().copied());
        are(&b.to_s[5..10], edges[1..].iter().copied());
        are(&b.f[4..10], [3.085; 6]);
        let told: Vec<bool> = (0..16).map(|k| !(5..10).contains(&k)).collect();
        assert_eq!(b.used[..15], told[..15]);
        assert!(!b.used[15]);
        let restart: Vec<usize> = (0..16).filter(|k| b.restart[*k]).collect();
        assert_eq!(restart, [0, 6, 7, 8, 9, 10]);
        near(b.from_s[10], 0.1875);
        assert_eq!((b.raw_block[18], b.raw_block[19], b.raw_block[23]), (4, 10, 11));
        // Up to two seconds, the half steps beside them not counted.
        assert_eq!(of(t(2.004), |t| t).len(), 11 + 100);
        let open = of(t(2.006), |t| t);
        assert_eq!(open.len(), 11);
        assert_eq!((0..11).filter(|k| open.restart[*k]).collect::<Vec<_>>(), [0, 5]);
        // Less than 1.8 steps is no gap.
        assert_eq!(of(t(0.0089), |t| t).len(), 10);
        // Samples that miss for longer than a block leave a gap.
        assert_eq!(of(t(0.0239), |t| t).len(), 11);
        assert_eq!(of(t(0.0241), |t| t).len(), 11 + 1);
    }

    /// Where samples are missing the others lie in the blocks in which they would lie without, and the noise's memory goes on.
    #[test]
    fn a_few_missing_samples_leave_the_blocks_as_they_are() {
        let missing = [5, 11, 12, 19, 20, 21, 30, 39];
        let t = even(43).into_iter().enumerate().filter(|(k, _)| !missing.contains(k)).map(|(_, t)| t);
        let (b, whole) = (of(t.collect(), |t| 200.0 * t), of(even(43), |t| 200.0 * t));
        are(&b.from_s, whole.from_s.iter().copied());
        are(&b.to_s, whole.to_s.iter().copied());
        // A straight force has its mean where samples are missing within, and half as far off as theirs where they miss at an end.
        are(&b.f[1..6], [5.5, 9.25, 13.75, 17.25, 22.25]);
        assert_eq!((0..11).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [5]);
        assert_eq!((0..11).filter(|k| b.restart[*k]).collect::<Vec<_>>(), [0, 6]);
    }

    /// So near to a jump that it may have either speed, or that the instant is not known better.
    #[test]
    fn a_block_is_left_out_when_a_sample_of_it_is_at_a_jump_of_the_speed() {
        let t = even(40);
        let b = of(t.clone(), |t| t);
        let left_out = |at_s: f64, doubt_s: f64| -> Vec<usize> {
            let mut b = with_jump(&b, at_s, at_s, doubt_s);
            b.leave_out_jumps(&t);
            (0..b.len()).filter(|k| !b.used[*k]).collect()
        };
        // Sample 18 at 0.09 s is in block 4, which lies from 0.0775 to 0.0975 s.
        assert_eq!(left_out(0.09, 0.0), [4]);
        assert_eq!(left_out(0.09 + 0.00014, 0.0), [4]);
        assert_eq!(left_out(0.09 - 0.00014, 0.0), [4]);
        assert_eq!(left_out(0.09 + 0.00016, 0.0), [0_usize; 0]);
        assert_eq!(left_out(0.09 - 0.00016, 0.0), [0_usize; 0]);
        assert_eq!(left_out(0.0925, 0.0024), [0_usize; 0]);
        assert_eq!(left_out(0.0925, 0.0026), [4]);
        // All blocks within the doubt, as far as there are any.
        assert_eq!(left_out(0.0775, 0.003), [3, 4]);
        assert_eq!(left_out(0.0775, 0.021), [2, 3, 4, 5]);
        assert_eq!(left_out(0.19, 0.03), [8, 9]);
        // Of a recording, too: the needle stops at its sample 60, in block 15.
        let t = even(400);
        let z: Vec<f64> = t.iter().map(|t| 0.002 * t.min(0.3)).collect();
        let b = Blocks::new(&Recording::new(t, z, vec![0.0; 400]).expect("a recording"), &[], BLOCK_S);
        assert_eq!((0..100).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [15]);
    }

    #[test]
    fn coarser_blocks_are_means_of_whole_groups_and_none_reaches_across_what_is_open() {
        // 36 samples, nothing for three seconds, 32 samples: nine blocks and eight.
        let t: Vec<f64> =
            even(68).iter().enumerate().map(|(k, t)| if k < 36 { *t } else { t + 3.0 }).collect();
        let exclude: Vec<bool> = (0..68).map(|k| (12..16).contains(&k)).collect();
        let b = Blocks::new(&recorded(t, |t| (9.0 * t).cos()), &exclude, BLOCK_S);
        assert_eq!(b.len(), 17);
        let fine = b.pieces_seen(true, 0.0, None);
        let c = b.coarser(4);
        let groups = [(0, 4), (4, 8), (8, 9), (9, 13), (13, 17)];
        assert_eq!((c.len(), c.samples), (5, 16));
        are(&c.from_s, groups.map(|g| b.from_s[g.0]));
        are(&c.to_s, groups.map(|g| b.to_s[g.1 - 1]));
        are(&c.f, groups.map(|g| b.f[g.0..g.1].iter().sum::<f64>() / (g.1 - g.0) as f64));
        // The first one holds a block that is not compared, the third is not whole.
        assert_eq!(c.used, [false, true, false, true, true]);
        assert_eq!(c.restart, [true, true, false, true, false]);
        assert_eq!((c.size_n.len(), c.doubt_n.len()), (5, 5));
        // Pieces are those of the coarser blocks, however they are shown.
        for pieces in [c.pieces_seen(false, 0.0, None), c.pieces_seen(true, 0.0, None)] {
            assert_eq!(pieces.iter().map(|p| p.block).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
            are(&pieces.iter().map(|p| p.to_s).collect::<Vec<_>>(), c.to_s.iter().copied());
        }
        assert_eq!(fine.len(), 17);
    }

    #[test]
    fn the_size_of_the_force_is_that_of_its_mean_over_a_tenth_of_a_second() {
        // Blocks of 30 ms: two on each side.
        let b = Blocks::new(&recorded(even(66), |t| (20.0 * t).sin()), &[], 0.03);
        assert_eq!((b.len(), b.samples), (11, 6));
        let around = |k: usize| -> Vec<f64> {
            (0..11).filter(|i: &usize| i.abs_diff(k) <= 2).map(|i| b.f[i]).collect()
        };
        are(&b.size_n, (0..11).map(|k| (around(k).iter().sum::<f64>() / around(k).len() as f64).abs()));
        // However long the blocks are, one on each side.
        let long = Blocks::new(&recorded(even(200), |t| t), &[], 0.2);
        are(&long.size_n[..2], [0.5 * (long.f[0] + long.f[1]), long.f[1]]);
    }

    #[test]
    fn a_mean_is_uncertain_by_a_sample_where_the_speed_jumps() {
        let force = |t: f64| if t < 0.096 { 1.0 } else { 3.0 };
        let b = of(even(40), force);
        let doubts = |at_s: f64, between_s: f64| {
            let mut b = with_jump(&b, at_s, between_s, 0.0);
            b.finish();
            b.doubt_n
        };
        // A quarter of two newtons, spread evenly; block 4 ends at 0.0975 s.
        let at = |block: usize| (0..10).map(move |k| if k == block { 0.5 * 0.289 } else { 0.0 });
        are(&doubts(0.0, 0.096), at(4));
        are(&doubts(0.096, 0.098), at(5));
        // At either end nobody knows what it jumps to.
        for between_s in [0.0, 0.19, 0.5] {
            are(&doubts(0.096, between_s), [0.0; 10]);
        }
        // As much where something gives way, and on blocks averaged further as long as a sample is.
        let fell = of(even(40), force).falling(vec![0.09]);
        are(&fell.doubt_n, at(4));
        are(&fell.seen_late(0.01).doubt_n, at(4));
        let coarse = of(even(80), force).falling(vec![0.09]).coarser(3);
        near(coarse.doubt_n[1], 2.0 / 12.0 * 0.289);
        // As large as the largest of two jumps.
        let mut two = with_jump(&b, 0.0, 0.09, 0.0);
        two.doubt_jump(0.09);
        two.doubt_n[4] *= 3.0;
        two.doubt_jump(0.09);
        near(two.doubt_n[4], 1.5 * 0.289);
    }

    #[test]
    fn a_mean_is_in_doubt_by_what_no_law_explains_around_it() {
        let force = |t: f64| if t < 0.09 { 1.0 } else { 3.0 };
        let left: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(k)).collect();
        let b = of(even(40), force).unexplained(left.clone());
        are(&b.doubt_n, left.clone());
        // Where something gives way by what is more, and white means of three are as sure as their number tells.
        let fell = b.clone().falling(vec![0.09]);
        are(&fell.doubt_n, left.iter().map(|l| l.max(if *l == 0.4 { 0.5 * 0.289 } else { 0.0 })));
        near(b.coarser(2).doubt_n[1], (0.04_f64 + 0.09).sqrt() / 2.0);
        are(&fell.unexplained(vec![0.0; 10]).falling(Vec::new()).doubt_n, [0.0; 10]);
    }

    #[test]
    fn a_late_force_is_uncertain_also_where_nobody_knows_between_which_samples_it_jumps() {
        let b = of(even(60), |t| 100.0 * t * t);
        let size = |k: usize| (b.f[k + 1] - b.f[k - 1]).abs() / 4.0 * 0.289;
        let late = |doubt_s: f64, late_s: f64| -> Vec<usize> {
            let seen = with_jump(&b, 0.06, 0.062, doubt_s).seen_late(late_s);
            let told: Vec<usize> = (0..15).filter(|k| seen.doubt_n[*k] > 0.0).collect();
            told.iter().for_each(|k| near(seen.doubt_n[*k], size(*k)));
            told
        };
        // Between samples it is in block 3, as it would be without a delay.
        assert_eq!(late(0.0, 0.0772), [3]);
        // Around 0.1375 s, between samples at 0.135 and 0.14, the end of block 6: known until the doubt holds a sample.
        assert_eq!(late(0.0024, 0.0775), [3]);
        assert_eq!(late(0.0026, 0.0775), [3, 6, 7]);
        // A sample nearer than three hundredths of a step has either speed.
        assert_eq!(late(0.0, 0.08 + 0.00014), [3, 7]);
        assert_eq!(late(0.0, 0.08 - 0.00014), [3, 7]);
        assert_eq!(late(0.0, 0.08 + 0.00016), [3]);
        assert_eq!(late(0.0, 0.08 - 0.00016), [3]);
    }

    #[test]
    fn an_instant_lies_in_the_middle_between_the_samples_around_it() {
        let t: Vec<f64> = even(20).iter().map(|t| if *t < 0.048 { *t } else { t + 0.1 }).collect();
        let b = of(t, |t| t);
        near(b.between(0.0131), 0.0125);
        near(b.between(0.0149), 0.0125);
        near(b.between(0.0151), 0.0175);
        // In a gap, and outside, the samples say nothing.
        for at_s in [0.0799, -0.003, 0.2] {
            near(b.between(at_s), at_s);
        }
        near(b.between(0.0), 0.0025);
    }

    #[test]
    fn motion_is_cut_where_a_force_shows_the_jumps_of_the_speed() {
        let t = even(120);
        let z: Vec<f64> = t.iter().map(|t| 0.002 * t.min(0.3013)).collect();
        let b = Blocks::new(&Recording::new(t, z, vec![0.0; 120]).expect("a recording"), &[], BLOCK_S);
        let cut = |smeared: bool, late_s: f64, placed: Option<f64>| {
            let pieces = b.pieces_seen(smeared, late_s, placed);
            let ends: Vec<f64> =
                pieces.windows(2).filter(|p| p[0].block == p[1].block).map(|p| p[0].to_s).collect();
            assert_eq!((pieces.len(), ends.len()), (31, 1));
            (ends[0], pieces.iter().find(|p| p.to_s == ends[0]).map_or(0.0, |p| p.v_mps))
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
    fn residuals_of_samples_follow_a_straight_course_of_those_of_the_blocks() {
        let b = of(even(48), |t| 2.0 - 30.0 * t);
        let e: Vec<f64> = (0..12).map(|k| 0.3 + 0.01 * f64::from(k)).collect();
        // The middle of block k is at sample 4 k + 1.5.
        are(&b.raw_residual(&e), (0..48).map(|i| 0.3 + 0.01 * (f64::from(i) - 1.5) / 4.0));
        // What a sample has beside that course is its own.
        let mut raw = (*b.raw_f).clone();
        raw[21] += 0.7;
        let spiked = Blocks { raw_f: Arc::new(raw), ..b.clone() };
        let told: Vec<f64> =
            spiked.raw_residual(&e).iter().zip(b.raw_residual(&e)).map(|(a, b)| a - b).collect();
        are(&told, (0..48).map(|i| if i == 21 { 0.7 } else { 0.0 }));
        // Of curved means the slope is that from neighbour to neighbour.
        let mut bent = e.clone();
        bent[5] += 0.4;
        let told = b.raw_residual(&bent);
        for (i, off) in [(16, -1.5), (17, -0.5), (18, 0.5), (19, 1.5)] {
            near(told[i], 0.3 + 0.01 * (i as f64 - 1.5) / 4.0 + 0.4 / 8.0 * off);
        }
        near(told[20], 0.3 + 0.01 * 18.5 / 4.0 + 0.4);
    }

    #[test]
    fn what_samples_differ_within_a_block_is_told_without_the_roughest_tenth() {
        // In block k samples lie k + 1 millinewtons above and below, in two of twenty a hundred times as much.
        let size = |k: usize| 0.001 * (k + 1) as f64 * if k == 3 || k == 11 { 100.0 } else { 1.0 };
        let force = |t: f64| {
            let i = (t / 0.005).round() as usize;
            0.5 + size(i / 4) * if i.is_multiple_of(2) { 1.0 } else { -1.0 }
        };
        let b = of(even(80), force);
        let calm: f64 = (0..20).filter(|k| *k != 3 && *k != 11).map(|k| size(k) * size(k)).sum();
        assert!((b.within_n() - (calm / 18.0).sqrt()).abs() < 1e-9, "{}", b.within_n());
        // One sample more is a block without a spread; one that lies as the others do bends no course.
        let more = of(even(81), |t| if t > 0.398 { 0.5 } else { force(t) });
        assert!((more.within_n() - b.within_n()).abs() < 1e-9);
        assert_eq!(Blocks::new(&recorded(even(80), force), &[], 0.001).within_n(), 0.0);
        // A force that rises by 20 N/s changes by 0.3 N within a block, and is no noisier for it.
        let rising = of(even(80), |t| force(t) + 20.0 * t);
        assert!((rising.within_n() - b.within_n()).abs() < 1e-9, "{}", rising.within_n());
    }
}
