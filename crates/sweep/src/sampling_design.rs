//! Points of a sampling design in the unit cube. Each point is a function of seed, trial and number of trials.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use stylet_scenario::Sampling;

/// Largest number of quantities for [`Sampling::Sobol`].
pub const MAX_SOBOL_DIMENSIONS: usize = 21;

/// Streams of the random number generator.
const POINT: u64 = 1;
const REDRAW: u64 = 2;
const SHIFT: u64 = 3;
const CLOCK: u64 = 4;

fn generator(seed: u64, purpose: u64, number: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream((purpose << 56) | (number & ((1 << 56) - 1)));
    generator
}

/// A number above 0 and below 1 from 52 random bits.
fn open_unit(bits: u64) -> f64 {
    ((bits >> 12) as f64 + 0.5) * (1.0 / 4_503_599_627_370_496.0)
}

/// One step of SplitMix64 (Steele, Lea and Flood 2014): a hash of `x`.
#[must_use]
pub fn splitmix64(x: u64) -> u64 {
    let mut x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Seed of the noise of a trial.
#[must_use]
pub fn trial_seed(seed: u64, trial: u64) -> u64 {
    splitmix64(splitmix64(seed) ^ trial)
}

/// Time of the first sample after the start of the motion, in sampling steps (0 to 1), drawn from `seed`.
#[must_use]
pub fn sampling_phase(seed: u64) -> f64 {
    open_unit(generator(seed, CLOCK, 0).next_u64())
}

/// Generates the points of one sweep.
#[derive(Clone, Debug)]
pub struct SamplingDesign {
    sampling: Sampling,
    seed: u64,
    trials: u64,
    /// Random digital shift per dimension of the Sobol sequence.
    shifts: Vec<u32>,
    directions: Vec<[u32; 32]>,
}

impl SamplingDesign {
    /// A design of `trials` points in `dimensions` dimensions.
    #[must_use]
    pub fn new(sampling: Sampling, seed: u64, trials: u64, dimensions: usize) -> Self {
        let mut design = Self { sampling, seed, trials, shifts: Vec::new(), directions: Vec::new() };
        if sampling == Sampling::Sobol {
            for d in 0..dimensions.min(MAX_SOBOL_DIMENSIONS) {
                design.shifts.push(generator(seed, SHIFT, d as u64).next_u32());
                design.directions.push(directions(d));
            }
        }
        design
    }

    /// Point of trial `trial`, every coordinate above 0 and below 1. `attempt` counts from zero; attempts after the first, which follow
    /// draws of invalid scenarios, are independent random points.
    pub fn point(&self, trial: u64, attempt: u32, point: &mut [f64]) {
        if attempt > 0 {
            let mut generator =
                generator(splitmix64(self.seed ^ u64::from(attempt).rotate_left(32)), REDRAW, trial);
            point.iter_mut().for_each(|x| *x = open_unit(generator.next_u64()));
            return;
        }
        let mut generator = generator(self.seed, POINT, trial);
        for (d, x) in point.iter_mut().enumerate() {
            let bits = generator.next_u64();
            *x = match self.sampling {
                Sampling::Random => open_unit(bits),
                Sampling::LatinHypercube => {
                    let key = splitmix64(self.seed ^ (d as u64 + 1).rotate_left(40));
                    let stratum = permuted(trial, self.trials, key);
                    (stratum as f64 + open_unit(bits)) / self.trials as f64
                }
                Sampling::Sobol => self.sobol(trial, d),
            }
            .clamp(f64::EPSILON, 1.0 - f64::EPSILON);
        }
    }

    fn sobol(&self, trial: u64, d: usize) -> f64 {
        let (Some(directions), Some(shift)) = (self.directions.get(d), self.shifts.get(d)) else {
            return 0.5;
        };
        let mut digits = *shift;
        for (bit, direction) in directions.iter().enumerate() {
            if trial >> bit & 1 == 1 {
                digits ^= direction;
            }
        }
        (f64::from(digits) + 0.5) / 4_294_967_296.0
    }
}

/// Position of `index` in a random permutation of `0..count`: a Feistel cipher on the next power of four, iterated until the result is
/// in range (cycle walking), so that the permutation need not be stored.
fn permuted(index: u64, count: u64, key: u64) -> u64 {
    let half = (64 - count.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let mut at = index;
    loop {
        let (mut left, mut right) = (at >> half & mask, at & mask);
        for round in 0..6_u64 {
            let mixed = splitmix64(right ^ key.wrapping_add(round.wrapping_mul(0x9e37_79b9))) & mask;
            (left, right) = (right, left ^ mixed);
        }
        at = left << half | right;
        if at < count {
            return at;
        }
    }
}

/// Degree, coefficients and first direction numbers of Joe and Kuo (2008, new-joe-kuo-6.21201),
/// dimensions 2 to 21.
const JOE_KUO: [(u32, u32, [u32; 7]); 20] = [
    (1, 0, [1, 0, 0, 0, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0, 0, 0, 0]),
    (3, 1, [1, 3, 1, 0, 0, 0, 0]),
    (3, 2, [1, 1, 1, 0, 0, 0, 0]),
    (4, 1, [1, 1, 3, 3, 0, 0, 0]),
    (4, 4, [1, 3, 5, 13, 0, 0, 0]),
    (5, 2, [1, 1, 5, 5, 17, 0, 0]),
    (5, 4, [1, 1, 5, 5, 5, 0, 0]),
    (5, 7, [1, 1, 7, 11, 19, 0, 0]),
    (5, 11, [1, 1, 5, 1, 1, 0, 0]),
    (5, 13, [1, 1, 1, 3, 11, 0, 0]),
    (5, 14, [1, 3, 5, 5, 31, 0, 0]),
    (6, 1, [1, 3, 3, 9, 7, 49, 0]),
    (6, 13, [1, 1, 1, 15, 21, 21, 0]),
    (6, 16, [1, 3, 1, 13, 27, 49, 0]),
    (6, 19, [1, 1, 1, 15, 7, 5, 0]),
    (6, 22, [1, 3, 1, 15, 13, 25, 0]),
    (6, 25, [1, 1, 5, 5, 19, 61, 0]),
    (7, 1, [1, 3, 7, 11, 23, 15, 103]),
    (7, 4, [1, 3, 7, 13, 13, 15, 69]),
];

/// Direction numbers of a dimension, counted from zero.
fn directions(dimension: usize) -> [u32; 32] {
    let mut v = [0_u32; 32];
    let Some((degree, coefficients, first)) = dimension.checked_sub(1).and_then(|d| JOE_KUO.get(d)) else {
        for (bit, v) in v.iter_mut().enumerate() {
            *v = 1 << (31 - bit);
        }
        return v;
    };
    let s = *degree as usize;
    for bit in 0..32 {
        v[bit] = if bit < s {
            first[bit] << (31 - bit)
        } else {
            let mut x = v[bit - s] ^ (v[bit - s] >> s);
            for k in 1..s {
                if coefficients >> (s - 1 - k) & 1 == 1 {
                    x ^= v[bit - k];
                }
            }
            x
        };
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampling_phases_cover_the_step_and_repeat_for_a_seed() {
        let tenth = |seed: u64| (10.0 * super::sampling_phase(seed)) as usize;
        let mut found = [false; 10];
        (0..400).for_each(|seed| found[tenth(seed)] = true);
        assert_eq!(found, [true; 10]);
        assert_eq!(super::sampling_phase(7).to_bits(), super::sampling_phase(7).to_bits());
    }

    fn column(sampling: Sampling, trials: u64, dimensions: usize, d: usize) -> Vec<f64> {
        let design = SamplingDesign::new(sampling, 7, trials, dimensions);
        let mut point = vec![0.0; dimensions];
        (0..trials)
            .map(|k| {
                design.point(k, 0, &mut point);
                point[d]
            })
            .collect()
    }

    /// How many points each of `strata` equal intervals holds.
    fn counts(values: &[f64], strata: usize) -> Vec<usize> {
        let mut counts = vec![0; strata];
        values.iter().for_each(|x| counts[(x * strata as f64) as usize] += 1);
        counts
    }

    #[test]
    fn a_latin_hypercube_samples_every_stratum_once_in_every_dimension() {
        for trials in [1, 2, 7, 100, 1000] {
            for d in 0..5 {
                let values = column(Sampling::LatinHypercube, trials, 5, d);
                assert_eq!(counts(&values, trials as usize), vec![1; trials as usize]);
            }
        }
        let (a, b) =
            (column(Sampling::LatinHypercube, 1000, 2, 0), column(Sampling::LatinHypercube, 1000, 2, 1));
        let r: f64 = a.iter().zip(&b).map(|(x, y)| (x - 0.5) * (y - 0.5) * 12.0).sum::<f64>() / 1000.0;
        assert!(r.abs() < 0.1, "the strata of two dimensions are unrelated, r = {r}");
    }

    #[test]
    fn sobol_points_fill_dyadic_strata_equally_in_one_and_two_dimensions() {
        for d in 0..MAX_SOBOL_DIMENSIONS {
            let values = column(Sampling::Sobol, 1024, MAX_SOBOL_DIMENSIONS, d);
            assert_eq!(counts(&values, 1024), vec![1; 1024], "dimension {d}");
        }
        // The first pair is a (0, m, 2)-net: 64 points in every one of 4 x 4 squares of 1024.
        let (a, b) = (column(Sampling::Sobol, 1024, 2, 0), column(Sampling::Sobol, 1024, 2, 1));
        let mut squares = [0; 1024];
        for (x, y) in a.iter().zip(&b) {
            squares[(x * 32.0) as usize * 32 + (y * 32.0) as usize] += 1;
        }
        assert!(squares.iter().all(|n| *n == 1));
    }

    #[test]
    fn points_are_independent_of_the_calls_before_and_differ_between_seeds() {
        for sampling in [Sampling::Random, Sampling::LatinHypercube, Sampling::Sobol] {
            let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
            let design = SamplingDesign::new(sampling, 1, 50, 3);
            design.point(49, 0, &mut a);
            (0..50).for_each(|k| design.point(k, 0, &mut b));
            assert_eq!(a, b);
            SamplingDesign::new(sampling, 2, 50, 3).point(49, 0, &mut b);
            assert_ne!(a, b);
        }
    }
}
