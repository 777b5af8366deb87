//! Hypotheses on the force in air: an offset that may drift in time, change with position (a cable, a guide, the weight of a tilted
//! tool) or jump (a tare), and a contact, a *bend* of the force that none of these explains.
//!
//! The samples since the start are kept as block averages of growing length: eight single samples, then four blocks of two,
//! of four, and so on, and a dozen equally long ones for everything older. [`AirHistory::evaluate`] compares,
//! by the Bayesian information criterion, the baselines
//!
//! ```text
//! f = c,   f = c + d t,   f = c + g z
//! ```
//!
//! each alone, with a step of the zero at any block, and with a bend `s (z - z_c)` from any block on. The noise of a block average
//! follows from the differences of neighbouring samples, which no baseline changes; if the best hypothesis leaves a larger residual
//! variance, all log evidence is divided by the ratio.

pub(super) use super::air_sums::Form;
use super::air_sums::{Block, Suffix, Totals};
use super::noise_estimator::MAX_RHO;
use crate::bounds::at_least;
use crate::sample::Sample;

/// Blocks per level, and in the last level (an odd number).
const LEVEL_BLOCKS: usize = 4;
const LAST_LEVEL_BLOCKS: usize = 17;
/// Levels, with blocks of 1, 1, 2, 4, 8 samples and, in the last one, as many as necessary.
const LEVELS: usize = 6;
/// Largest number of blocks, including one per level in transit.
const MAX_BLOCKS: usize = (LEVELS - 1) * (LEVEL_BLOCKS + 1) + LAST_LEVEL_BLOCKS + 2;
/// Log odds at which a hypothesis is accepted: 7 to 1.
pub(super) const DECISION_NATS: f64 = 2.0;
/// Prior log odds against a moving baseline: 2 to 1.
const MOVING_PRIOR_NATS: f64 = 0.7;
/// Prior log odds against a step of the zero: 10 to 1.
const STEP_PRIOR_NATS: f64 = 2.3;
/// Standard deviations beyond which a sample between two others is a logging spike.
const SPIKE_SDS: f64 = 6.0;
/// Number of differences after which further ones are clipped.
const MIN_DIFFERENCES: f64 = 5.0;
/// Clip of squared differences, in multiples of their mean, so that a step does not count as noise.
const MAX_SQUARED_DIFFERENCE: f64 = 16.0;
/// Lag in samples of the differences from which a correlation above [`LONG_LAG_FROM`] is solved, to `2^-BISECTIONS`.
const LONG_LAG: usize = 8;
const LONG_LAG_FROM: f64 = 0.5;
const BISECTIONS: u32 = 12;
/// Fewest independent samples for a moving baseline.
const MIN_INDEPENDENT: f64 = 20.0;
/// Independent samples after which the noise level counts as known (relative error 1/9).
const MIN_FOR_NOISE: f64 = 40.0;
/// Smallest step of the zero in standard deviations of the noise, so that it is visible between two samples.
const MIN_STEP_SDS: f64 = 5.0;
/// Longest blocks between which a step is searched, in samples (longer ones do not distinguish a step from a ramp), and the smallest
/// share of the step that lies between them.
const MAX_JUMP_SAMPLES: f64 = 2.0;
pub(super) const MIN_JUMP_SHARE: f64 = 0.6;
/// Multiplications and additions of an evaluation per block.
const OPERATIONS_PER_BLOCK: u32 = 85;
/// Of a fit.
const OPERATIONS_PER_FIT: u32 = 90;

/// A hypothesis: the form of the baseline, and the block at which a step or a bend begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    pub(super) form: Form,
    /// Log evidence in nats, up to a constant common to all.
    pub(super) nats: f64,
    /// First block of the event.
    pub(super) from: usize,
    /// Size of the step in N, or slope of the bend in N/m.
    pub(super) size: f64,
    /// Sums over the blocks of the event.
    pub(super) sums: Suffix,
}

impl Hypothesis {
    fn none() -> Self {
        Self { form: Form::Constant, nats: f64::NEG_INFINITY, from: 0, size: 0.0, sums: Suffix::default() }
    }

    fn keep_more_probable(&mut self, other: Hypothesis) {
        if other.nats > self.nats {
            *self = other;
        }
    }
}

/// The best hypothesis of each kind.
#[derive(Clone, Copy, Debug)]
pub(super) struct AirEvidence {
    /// No event.
    pub(super) no_event: Hypothesis,
    /// A step of the zero.
    pub(super) step: Hypothesis,
    /// A bend: contact.
    pub(super) bend: Hypothesis,
    /// No event, with a constant offset.
    pub(super) constant_nats: f64,
    /// A bend, with a constant offset.
    pub(super) constant_bend_nats: f64,
    /// A bend, with a moving baseline.
    pub(super) moving_bend: Hypothesis,
    /// Posterior mean of the bend's onset in m and its standard deviation.
    pub(super) onset_m: (f64, f64),
    /// Excess of the block variance over that of the noise, 1 or more.
    pub(super) excess: f64,
    pub(super) total: Totals,
    pub(super) sample_weight: f64,
}

impl AirEvidence {
    /// Variance in N² of the mean of the samples of an event.
    pub(super) fn event_variance(&self, event: &Hypothesis) -> f64 {
        self.excess / at_least(1e-300, event.sums.n)
    }

    /// Log odds of a contact against everything else.
    pub(super) fn contact_nats(&self) -> f64 {
        self.bend.nats - self.no_event.nats.max(self.step.nats)
    }

    /// Probability of a contact.
    pub(super) fn contact_probability(&self) -> f64 {
        1.0 / (1.0 + libm::exp(-self.contact_nats()))
    }

    /// Probability of a moving baseline before a bend.
    pub(super) fn moving_probability(&self) -> f64 {
        1.0 / (1.0 + libm::exp(self.constant_bend_nats - self.moving_bend.nats))
    }

    /// Log odds of a step of the zero against everything else.
    pub(super) fn step_nats(&self) -> f64 {
        self.step.nats - self.no_event.nats.max(self.bend.nats)
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct AirHistory {
    blocks: [[Block; LAST_LEVEL_BLOCKS + 1]; LEVELS],
    filled: [usize; LEVELS],
    /// Samples per block of the last level.
    last_unit: f64,
    pub(super) origin: Sample,
    /// Samples taken.
    pub(super) samples: f64,
    /// The last two samples; the newest is checked for a spike once its successor is known.
    before: [Block; 2],
    /// Mean squared differences in N² of samples one, two and [`LONG_LAG`] apart, and their numbers.
    differences: [f64; 3],
    difference_counts: [f64; 3],
    /// Ring buffer of the last forces in N.
    recent_n: [f64; LONG_LAG],
    /// Lower bound on the variance of the noise in N².
    least_n2: f64,
}

/// Blocks in the order of time.
struct Ordered {
    blocks: [Block; MAX_BLOCKS],
    len: usize,
}

impl AirHistory {
    /// Empty history; the noise variance is at least `least_n2`.
    pub(super) fn new(least_n2: f64) -> Self {
        Self {
            blocks: [[Block::default(); LAST_LEVEL_BLOCKS + 1]; LEVELS],
            filled: [0; LEVELS],
            last_unit: 16.0,
            origin: Sample::default(),
            samples: 0.0,
            before: [Block::default(); 2],
            differences: [0.0; 3],
            difference_counts: [0.0; 3],
            recent_n: [0.0; LONG_LAG],
            least_n2,
        }
    }

    /// Adds a sample in air.
    pub(super) fn push(&mut self, sample: &Sample) {
        self.add_sample(sample, true);
    }

    /// Adds a sample that may be in tissue, where the force changes by more than the noise; it does not update a noise level that is
    /// known.
    pub(super) fn push_uncertain(&mut self, sample: &Sample) {
        let rho = self.rho();
        let is_known = self.samples * (1.0 - rho) >= MIN_FOR_NOISE * (1.0 + rho);
        self.add_sample(sample, !is_known);
    }

    fn add_sample(&mut self, sample: &Sample, informs_noise: bool) {
        if self.samples == 0.0 {
            self.origin = *sample;
        }
        let new = Block {
            count: 1.0,
            time_s: sample.time_s - self.origin.time_s,
            position_m: sample.position_m - self.origin.position_m,
            force_n: sample.force_n - self.origin.force_n,
        };
        let slot = self.samples as usize % LONG_LAG;
        if informs_noise && self.samples >= LONG_LAG as f64 {
            self.difference(2, new.force_n - self.recent_n[slot]);
        }
        self.recent_n[slot] = new.force_n;
        self.samples += 1.0;
        let [older, mut last] = self.before;
        if informs_noise && last.count > 0.0 {
            self.difference(0, new.force_n - last.force_n);
        }
        if older.count > 0.0 {
            if informs_noise {
                self.difference(1, new.force_n - older.force_n);
            }
            let median = older.force_n.max(new.force_n).min(last.force_n.max(older.force_n.min(new.force_n)));
            let off = last.force_n - median;
            if off * off > SPIKE_SDS * SPIKE_SDS * 0.5 * self.differences[0].max(self.least_n2)
                && self.samples > 40.0
            {
                last.force_n = median;
            }
        }
        if last.count > 0.0 {
            self.insert(last);
        }
        self.before = [last, new];
    }

    fn difference(&mut self, lag: usize, step: f64) {
        let mut square = step * step;
        let (count, mean) = (self.difference_counts[lag], self.differences[lag]);
        if count > MIN_DIFFERENCES {
            square = square.min(MAX_SQUARED_DIFFERENCE * mean.max(self.least_n2));
        }
        self.difference_counts[lag] += 1.0;
        self.differences[lag] += (square - mean) / (count + 1.0);
    }

    fn insert(&mut self, mut block: Block) {
        for level in 0..LEVELS {
            let filled = self.filled[level];
            if level + 1 == LEVELS
                && let Some(newest) = filled.checked_sub(1)
                && self.blocks[level][newest].count < self.last_unit
            {
                self.blocks[level][newest] = self.blocks[level][newest].merged(&block);
                return;
            }
            self.blocks[level][filled] = block;
            self.filled[level] = filled + 1;
            let most = if level + 1 == LEVELS { LAST_LEVEL_BLOCKS } else { LEVEL_BLOCKS };
            if filled < most {
                return;
            }
            if level + 1 == LEVELS {
                // Full: merge pairs, which doubles the length of all blocks.
                for pair in 0..LAST_LEVEL_BLOCKS.div_ceil(2) {
                    let [first, second] = [self.blocks[level][2 * pair], self.blocks[level][2 * pair + 1]];
                    self.blocks[level][pair] = first.merged(&second);
                }
                self.filled[level] = LAST_LEVEL_BLOCKS.div_ceil(2);
                self.last_unit *= 2.0;
                return;
            }
            // The first level passes single samples on.
            let taken = if level == 0 { 1 } else { 2 };
            block = self.blocks[level][0];
            if taken == 2 {
                block = block.merged(&self.blocks[level][1]);
            }
            for i in taken..=LEVEL_BLOCKS {
                self.blocks[level][i - taken] = self.blocks[level][i];
            }
            self.filled[level] = LEVEL_BLOCKS + 1 - taken;
        }
    }

    /// Correlation of the noise from sample to sample. Half the mean squared differences are the variance times `1 - rho^lag`.
    pub(super) fn rho(&self) -> f64 {
        let [near, far, farthest] = self.differences;
        if near <= 0.0 {
            return 0.0;
        }
        let rho = far / near - 1.0;
        if rho > LONG_LAG_FROM && farthest > 0.0 {
            // Slow noise hardly changes over two samples: 1 + rho + ... + rho^7 by bisection.
            let (mut low, mut high) = (0.0, MAX_RHO);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                let mut sum = 0.0;
                for _ in 0..LONG_LAG {
                    sum = 1.0 + middle * sum;
                }
                if sum * near < farthest {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            return 0.5 * (low + high);
        }
        if rho <= 0.0 || rho * rho * self.difference_counts[0] < 4.0 { 0.0 } else { rho.min(MAX_RHO) }
    }

    /// Variance of the noise in N².
    pub(super) fn noise_variance(&self) -> f64 {
        (0.5 * self.differences[0] / (1.0 - self.rho())).max(self.least_n2)
    }

    /// Information per sample about a slow signal in N⁻²: the inverse of the long-run noise variance.
    fn sample_weight(&self) -> f64 {
        let rho = self.rho();
        (1.0 - rho) / ((1.0 + rho) * self.noise_variance())
    }

    fn ordered(&self) -> Ordered {
        let mut out = Ordered { blocks: [Block::default(); MAX_BLOCKS], len: 0 };
        let last = core::iter::once(&self.before[1]).filter(|b| b.count > 0.0);
        let older =
            self.blocks.iter().zip(self.filled).rev().flat_map(|(level, filled)| level[..filled].iter());
        for block in older.filter(|b| b.count > 0.0).chain(last) {
            if let Some(slot) = out.blocks.get_mut(out.len) {
                *slot = *block;
                out.len += 1;
            }
        }
        out
    }

    /// Multiplications and additions of an evaluation.
    pub(super) fn evaluation_operations(&self) -> u32 {
        OPERATIONS_PER_BLOCK * self.filled.iter().sum::<usize>() as u32 + OPERATIONS_PER_FIT
    }

    /// Compares all hypotheses.
    pub(super) fn evaluate(&self) -> AirEvidence {
        let ordered = self.ordered();
        let blocks = &ordered.blocks[..ordered.len];
        let sample_weight = self.sample_weight();
        let total = Totals::new(blocks, sample_weight);
        let n = at_least(2.0, self.samples);
        let half_log_n = 0.5 * libm::log(n);
        let moving = half_log_n + MOVING_PRIOR_NATS;
        // The better one of the moving baselines.
        let line = total.residual(Form::Line) < total.residual(Form::Drift);
        let forms = [(Form::Constant, 0.0), (if line { Form::Line } else { Form::Drift }, moving)];
        let residual = |form: Form| total.residual(form);
        let (mut step, mut bend) = ([Hypothesis::none(); 2], [Hypothesis::none(); 2]);
        // Log-likelihood of a bend of any slope at each block.
        let mut onset_nats = [[f64::NEG_INFINITY; MAX_BLOCKS]; 2];
        let mut sums = Suffix::default();
        let variance = self.noise_variance();
        let least_step_n2 = MIN_STEP_SDS * MIN_STEP_SDS * variance;
        for (j, block) in blocks.iter().enumerate().skip(2).rev() {
            sums.add(block, sample_weight, &total);
            let before = &blocks[j - 1];
            let onset = edge_m(before, block) - total.position_m;
            let jump_n = block.force_n - before.force_n;
            let recent = before.count <= MAX_JUMP_SAMPLES && block.count <= MAX_JUMP_SAMPLES;
            for (k, (form, _)) in forms.iter().enumerate() {
                if recent
                    && let Some((gain, size)) = sums.step_gain(*form, &total)
                    && size * size > least_step_n2
                    && jump_n * size > MIN_JUMP_SHARE * size * size
                {
                    step[k].keep_more_probable(Hypothesis {
                        form: *form,
                        nats: 0.5 * gain,
                        from: j,
                        size,
                        sums,
                    });
                }
                let independent = (total.weight - sums.n) * variance;
                if let Some((gain, size)) = sums.bend_gain(*form, &total, onset)
                    && size > 0.0
                    && (k == 0 || independent > MIN_INDEPENDENT)
                {
                    // The slope is unknown: integrated over, the likelihood is proportional to its standard deviation.
                    onset_nats[k][j] = 0.5 * gain + libm::log(size) - 0.5 * libm::log(gain);
                    bend[k].keep_more_probable(Hypothesis {
                        form: *form,
                        nats: 0.5 * gain,
                        from: j,
                        size,
                        sums,
                    });
                }
            }
        }
        // The residual of the best hypothesis is noise.
        let mut least = f64::INFINITY;
        for (k, (form, _)) in forms.iter().enumerate() {
            let gain = 2.0 * step[k].nats.max(bend[k].nats).max(0.0);
            least = least.min(residual(*form) - gain);
        }
        let excess = (least / (blocks.len() as f64 - 4.0).max(1.0)).max(1.0);
        let (mut out, event) = (
            AirEvidence {
                no_event: Hypothesis::none(),
                step: Hypothesis::none(),
                bend: Hypothesis::none(),
                constant_nats: -0.5 * residual(Form::Constant) / excess,
                constant_bend_nats: f64::NEG_INFINITY,
                moving_bend: Hypothesis::none(),
                onset_m: (0.0, 0.0),
                excess,
                total,
                sample_weight,
            },
            2.0 * half_log_n,
        );
        for (k, (form, penalty)) in forms.into_iter().enumerate() {
            let base = -0.5 * residual(form) / excess - penalty;
            if form != Form::Constant && total.weight * variance < MIN_INDEPENDENT {
                continue;
            }
            out.no_event.keep_more_probable(Hypothesis {
                form,
                nats: base,
                from: blocks.len(),
                ..Hypothesis::none()
            });
            out.step.keep_more_probable(Hypothesis {
                nats: base + step[k].nats / excess - event - STEP_PRIOR_NATS,
                ..step[k]
            });
            let bend = Hypothesis { nats: base + bend[k].nats / excess - event, ..bend[k] };
            out.bend.keep_more_probable(bend);
            if form == Form::Constant {
                out.constant_bend_nats = out.bend.nats;
            } else {
                out.moving_bend.keep_more_probable(bend);
            }
        }
        let form = usize::from(out.bend.form != Form::Constant);
        out.onset_m = self.onset_posterior(blocks, &onset_nats[form], excess);
        out
    }

    /// Mean and standard deviation of the position of a bend in m, with the log-likelihood `nats` of a bend at the beginning of each
    /// block and uniform priors over travel and slope. Within a block the density is linear.
    fn onset_posterior(&self, blocks: &[Block], nats: &[f64], excess: f64) -> (f64, f64) {
        let most = nats.iter().copied().fold(f64::NEG_INFINITY, at_least);
        let density = |nats: f64| libm::exp((nats - most) / excess);
        let (mut weight, mut mean, mut square) = (0.0, 0.0, 0.0);
        for (three, nats) in blocks.windows(3).zip(nats.get(1..).unwrap_or(&[]).windows(2)) {
            let (from_m, to_m) = (edge_m(&three[0], &three[1]), edge_m(&three[1], &three[2]));
            let (p, q) = (density(nats[0]), density(nats[1]));
            let (cell_m, sum) = (to_m - from_m, p + q);
            let w = 0.5 * cell_m * sum;
            if w > 0.0 {
                let share = q / sum;
                let off = from_m + cell_m * (1.0 + share) / 3.0 - mean;
                weight += w;
                mean += w / weight * off;
                let within = cell_m * cell_m * (1.0 + 2.0 * share * (1.0 - share)) / 18.0;
                square += w * (off * (off - w / weight * off) + within);
            }
        }
        let variance = if weight > 0.0 { square / weight } else { 0.0 };
        (mean + self.origin.position_m, libm::sqrt(at_least(0.0, variance)))
    }

    /// Time and position of the last sample before block `from`.
    pub(super) fn onset(&self, from: usize) -> (f64, f64) {
        let ordered = self.ordered();
        let at = ordered.blocks[..ordered.len].get(from.saturating_sub(1)).copied().unwrap_or_default();
        (at.time_s + self.origin.time_s, at.position_m + self.origin.position_m)
    }

    /// Removes a step of the zero by `size_n` that began with the last `count` samples.
    pub(super) fn absorb_last_samples(&mut self, count: usize, size_n: f64) {
        self.absorb_step(self.ordered().len.saturating_sub(count), size_n);
    }

    /// Removes a step of the zero by `size_n` at block `from`: shifts earlier blocks to the new zero.
    pub(super) fn absorb_step(&mut self, from: usize, size_n: f64) {
        let mut index = 0;
        for level in (0..LEVELS).rev() {
            for block in &mut self.blocks[level][..self.filled[level]] {
                if block.count == 0.0 {
                    continue;
                }
                if index < from {
                    block.force_n += size_n;
                }
                // Drop a block that may contain both levels.
                if block.count > 1.0 && (index == from || index + 1 == from) {
                    block.count = 0.0;
                }
                index += 1;
            }
        }
    }
}

/// Position in m at which one block ends and the next begins.
fn edge_m(before: &Block, block: &Block) -> f64 {
    let share = before.count / (before.count + block.count);
    before.position_m + share * (block.position_m - before.position_m)
}

#[cfg(test)]
mod tests;
