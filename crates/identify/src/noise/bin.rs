//! Noise in one range of the force.

use super::slow::{ROW, SEARCHED, SLOW, row, sums};
use super::{From, HUBER, LOSS, Noise};
use crate::blocks::Blocks;
use stylet_stats::ar::stationary;
use stylet_stats::foretell::{foretell, unforetold};
use stylet_stats::order::median;

/// Highest order.
pub const ORDER: usize = 4;
/// Turns of robust least squares.
const TURNS: usize = 4;

/// Noise in one range of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Coefficients, newest first.
    pub a: [f64; ORDER],
    /// Coefficients of the means of stretches further back.
    pub slow: [f64; SLOW.len()],
    /// Standard deviation of the innovations in N.
    pub innovation_n: f64,
    /// Standard deviation in N.
    pub sd_n: f64,
    /// How a block is foretold that has fewer than [`ORDER`] before it since a break: none, one ...
    pub first: [First; ORDER],
}

/// How a block is foretold soon after a break.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct First {
    /// Coefficients, newest first; as many as there are blocks since the break.
    pub a: [f64; ORDER],
    /// Coefficients of the means of stretches further back.
    pub slow: [f64; SLOW.len()],
    /// Standard deviation in N of what is not foretold.
    pub sd_n: f64,
}

impl First {
    /// Nothing is known of what was before.
    pub(super) fn unknown(sd_n: f64) -> Self {
        Self { a: [0.0; ORDER], slow: [0.0; SLOW.len()], sd_n }
    }
}

impl Bin {
    /// Independent noise of one size.
    pub(super) fn white(sd_n: f64) -> Self {
        let none = First::unknown(sd_n);
        Self { a: none.a, slow: none.slow, innovation_n: sd_n, sd_n, first: [none; ORDER] }
    }

    /// Whether it has a slow wander.
    pub(super) fn wanders(&self) -> bool {
        let none = [0.0; SLOW.len()];
        self.slow != none || self.first.iter().any(|f| f.slow != none)
    }

    /// Standard deviation in N of what is not foretold of a block with so many before it since a break.
    pub(super) fn size_n(&self, run: usize) -> f64 {
        self.first.get(run).map_or(self.innovation_n, |f| f.sd_n)
    }
}

impl Noise {
    /// Robust least squares of one range.
    pub(super) fn fit(
        &self,
        blocks: &[Blocks],
        columns: &[Vec<f64>],
        bin: usize,
        from: From,
        floor_n: f64,
    ) -> Bin {
        let mut rows: Vec<[f64; ROW]> = Vec::new();
        let mut all: Vec<f64> = Vec::new();
        for (b, e) in blocks.iter().zip(columns) {
            let sums = if self.lasting { sums(e, |k| b.used[k]) } else { sums(e, |_| true) };
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.restart[k] { 0 } else { run + 1 };
                if !b.used[k] || !e[k].is_finite() || self.bin(b.size_n[k]) != bin {
                    continue;
                }
                all.push(e[k].abs());
                if run >= ORDER && (1..=ORDER).all(|i| e[k - i].is_finite()) {
                    rows.push(row(e, &sums, k, if self.lasting { k } else { run }));
                }
            }
        }
        let sd_n = (median(&mut all) * stylet_stats::MAD_TO_SD).max(floor_n);
        if rows.len() < 40 {
            return Bin::white(sd_n);
        }
        let n = rows.len() as f64;
        let mut best: Option<(f64, Bin)> = None;
        // Residuals without their smooth course have no slow wander.
        let most = match from {
            From::Calm => ORDER,
            From::Whole => ORDER + SEARCHED,
            From::Lasting | From::Drawn => ORDER + SLOW.len(),
        };
        // An interval reckons with a wander that cannot be excluded: there it is the largest order that holds.
        let largest = from.lasts();
        let turns = if from == From::Drawn { 1 } else { TURNS };
        for order in (0..=most).map(|k| if largest { most - k } else { k }) {
            let columns: Vec<usize> = (1..=order).collect();
            let (a, s) = foretell(&rows, &columns, (sd_n, floor_n), HUBER, turns);
            let (near, slow) = a[1..].split_at(ORDER);
            if !stationary(near) || (order > ORDER && a[1..].iter().sum::<f64>() > 0.999) {
                continue;
            }
            let near: [f64; ORDER] = core::array::from_fn(|i| near[i]);
            let slow: [f64; SLOW.len()] = core::array::from_fn(|i| slow[i]);
            let loss: f64 =
                rows.iter().map(|row| LOSS.value(unforetold(row, &a) / s)).sum::<f64>() + n * libm::log(s);
            let cost = loss + 0.5 * order as f64 * libm::log(n);
            if best.is_none_or(|b| cost < b.0) {
                let first = [First::unknown(sd_n.max(s)); ORDER];
                best = Some((cost, Bin { a: near, slow, innovation_n: s, sd_n, first }));
            }
            if largest {
                break;
            }
        }
        let mut best = best.map_or_else(|| Bin::white(sd_n), |b| b.1);
        if from.lasts() {
            // The first blocks after a break go on where those before it ended, and with one another.
            for (run, first) in best.first.iter_mut().enumerate() {
                let columns: Vec<usize> = (1..=run).chain(ORDER + 1..ROW).collect();
                let (a, s) = foretell(&rows, &columns, (sd_n, floor_n), HUBER, turns);
                let (near, slow) = a[1..].split_at(ORDER);
                *first = First {
                    a: core::array::from_fn(|i| near[i]),
                    slow: core::array::from_fn(|i| slow[i]),
                    sd_n: s.max(best.innovation_n),
                };
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{near, normal, still};
    use super::*;

    /// Noise that grows with the force and remembers is found as it was drawn.
    #[test]
    fn noise_is_estimated_as_it_was_drawn() {
        let n = 16_000;
        let mut b = still(n);
        let draw = normal(9, n);
        let mut e = vec![0.0; n];
        for k in 0..n {
            // Stretches of one size each.
            let range = k / 800 % 2;
            b.size_n[k] = [0.3, 1.7][range];
            let a = [[0.5, -0.2], [0.3, 0.25]][range];
            let before = |i: usize| if k >= i { e[k - i] } else { 0.0 };
            e[k] = a[0] * before(1) + a[1] * before(2) + [0.01, 0.04][range] * draw[k];
        }
        for from in [From::Whole, From::Lasting, From::Drawn] {
            let mut noise = Noise { edges_n: vec![1.0], bins: Vec::new(), lasting: from.lasts() };
            for range in 0..2 {
                noise.bins.push(noise.fit(
                    std::slice::from_ref(&b),
                    std::slice::from_ref(&e),
                    range,
                    from,
                    1e-6,
                ));
            }
            for (bin, (a, sd)) in noise.bins.iter().zip([([0.5, -0.2], 0.01), ([0.3, 0.25], 0.04)]) {
                let whole: Vec<f64> = bin.a.iter().chain(&bin.slow).copied().collect();
                assert!(
                    (whole[0] - a[0]).abs() < 0.04 && (whole[1] - a[1]).abs() < 0.04,
                    "{from:?}: {whole:?}"
                );
                assert!((bin.innovation_n / sd - 1.0).abs() < 0.03, "{from:?}: {}", bin.innovation_n);
                // The process has a larger size than its innovations: c0 = s^2 (1 - a2) / ((1 + a2) ((1 - a2)^2 - a1^2)).
                let ratio = (1.0 - a[1]) / ((1.0 + a[1]) * ((1.0 - a[1]).powi(2) - a[0] * a[0]));
                assert!((bin.sd_n / (sd * ratio.sqrt()) - 1.0).abs() < 0.05, "{from:?}: {}", bin.sd_n);
            }
        }
    }

    #[test]
    fn fewer_than_forty_blocks_tell_a_size_and_no_more() {
        let told = |blocks: usize| {
            let b = still(blocks);
            let e: Vec<f64> = (0..blocks).map(|k| libm::sin(0.3 * k as f64)).collect();
            let noise = Noise::estimate(&[b], std::slice::from_ref(&e), From::Whole, 0.0);
            let mut sizes: Vec<f64> = e.iter().map(|e| e.abs()).collect();
            (noise.bins[0], median(&mut sizes) * stylet_stats::MAD_TO_SD)
        };
        // The first four have not four before them.
        let (few, sd) = told(43);
        assert_eq!(few, Bin::white(sd));
        let (many, sd) = told(44);
        near(many.sd_n, sd);
        assert!(many.a != [0.0; ORDER] && many.innovation_n < 0.25 * sd, "{many:?}");
        let none = Noise::estimate(&[still(10)], &[vec![f64::NAN; 10]], From::Whole, 0.0);
        assert_eq!(none.bins[0], Bin::white(1e-6));
        let floor = Noise::estimate(&[still(60)], &[vec![0.0; 60]], From::Whole, 0.02);
        assert_eq!((floor.bins[0].sd_n, floor.bins[0].innovation_n), (0.02, 0.02));
        let least = Noise::estimate(&[still(60)], &[vec![0.0; 60]], From::Whole, 0.0);
        assert_eq!(least.bins[0].sd_n, 1e-6);
    }
}
