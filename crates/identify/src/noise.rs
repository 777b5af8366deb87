//! The noise of measured force: autoregressive, one set of coefficients and one size per range of the force.
//!
//! Growth with the force, tails and missing air need no special case then. Residuals are means over blocks.

use crate::blocks::Blocks;
use crate::linear::Symmetric;
use stylet_stats::order::{median, quantile_of_sorted};

/// Highest order.
pub const ORDER: usize = 4;
/// Most ranges of the force.
const BINS: usize = 5;
/// Fewest blocks of a range: a size is then known to a twentieth.
const LEAST: usize = 220;
/// Beyond so many standard deviations a residual counts linearly (Huber).
pub const HUBER: f64 = 2.5;
/// Smallest noise in N: rounding of numbers in files.
const FLOOR_N: f64 = 1e-6;

/// Stretches of blocks before those of the autoregression whose means a slow wander is told by: some tenths of a second,
/// some seconds (a heterogeneous autoregression: Corsi 2009).
const SLOW: [(usize, usize); 2] = [(ORDER, 24), (24, 124)];
/// Numbers of a row: the residual, those before it, the means.
const ROW: usize = 1 + ORDER + SLOW.len();

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
}

/// The noise of a set of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Upper edges in N of all ranges but the last.
    pub edges_n: Vec<f64>,
    /// The ranges.
    pub bins: Vec<Bin>,
}

/// How the blocks of one recording are whitened.
#[derive(Clone, Debug, PartialEq)]
pub struct Laid {
    rows: Vec<Row>,
    /// Some range has a slow wander.
    wander: bool,
}

/// How one block is whitened.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// Range of the force.
    bin: u32,
    /// Blocks that are known before it, without a break.
    run: u32,
    /// Standard deviation of its innovation in N; infinite when it is not compared.
    sd_n: f64,
}

/// Huber's loss of a normalised residual, in nats.
#[must_use]
pub fn rho(w: f64) -> f64 {
    let a = w.abs();
    if a <= HUBER { 0.5 * w * w } else { HUBER * (a - 0.5 * HUBER) }
}

/// Its weight in least squares.
#[must_use]
pub fn weight(w: f64) -> f64 {
    let a = w.abs();
    if a <= HUBER { 1.0 } else { HUBER / a }
}

/// How residuals are looked at when the noise is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// As they are: everything that is left is noise.
    Whole,
    /// Less what is smooth over a second, in the calmer windows: structure that a law lacks is no noise.
    Calm,
}

impl Noise {
    /// Independent noise of one size.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self {
            edges_n: Vec::new(),
            bins: vec![Bin { a: [0.0; ORDER], slow: [0.0; SLOW.len()], innovation_n: sd_n, sd_n }],
        }
    }

    /// The noise of residuals `e` (N), one column per recording; nowhere less than `floor_n`.
    #[must_use]
    pub fn estimate(blocks: &[Blocks], e: &[Vec<f64>], from: From, floor_n: f64) -> Self {
        let columns: Vec<Vec<f64>> = match from {
            From::Whole => e.to_vec(),
            From::Calm => blocks.iter().zip(e).map(|(b, e)| calm(b, e)).collect(),
        };
        let mut sizes: Vec<f64> = Vec::new();
        for b in blocks {
            sizes.extend(b.size_n.iter().zip(&b.used).filter(|(_, u)| **u).map(|(s, _)| *s));
        }
        sizes.sort_unstable_by(f64::total_cmp);
        let count = (sizes.len() / LEAST).clamp(1, BINS);
        let edges_n: Vec<f64> =
            (1..count).map(|k| quantile_of_sorted(&sizes, k as f64 / count as f64)).collect();
        let mut noise = Self { edges_n, bins: Vec::new() };
        for bin in 0..count {
            noise.bins.push(noise.fit(blocks, &columns, bin, from, floor_n.max(FLOOR_N)));
        }
        noise
    }

    /// The range in which a size of the force lies.
    #[must_use]
    pub fn bin(&self, size_n: f64) -> usize {
        self.edges_n.iter().take_while(|e| **e <= size_n).count()
    }

    /// Robust least squares of one range.
    fn fit(&self, blocks: &[Blocks], columns: &[Vec<f64>], bin: usize, from: From, floor_n: f64) -> Bin {
        let mut rows: Vec<[f64; ROW]> = Vec::new();
        let mut all: Vec<f64> = Vec::new();
        for (b, e) in blocks.iter().zip(columns) {
            let sums = sums(e);
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.restart[k] { 0 } else { run + 1 };
                if !b.used[k] || !e[k].is_finite() || self.bin(b.size_n[k]) != bin {
                    continue;
                }
                all.push(e[k].abs());
                if run >= ORDER && (1..=ORDER).all(|i| e[k - i].is_finite()) {
                    rows.push(row(e, &sums, k, run));
                }
            }
        }
        let sd_n = (median(&mut all) * 1.4826).max(floor_n);
        let white = Bin { a: [0.0; ORDER], slow: [0.0; SLOW.len()], innovation_n: sd_n, sd_n };
        if rows.len() < 40 {
            return if sd_n.is_finite() { white } else { Bin { innovation_n: 1.0, sd_n: 1.0, ..white } };
        }
        let n = rows.len() as f64;
        let mut best: Option<(f64, Bin)> = None;
        // Residuals without their smooth course have no slow wander.
        let most = if from == From::Whole { ORDER + SLOW.len() } else { ORDER };
        for order in 0..=most {
            let mut a = [0.0; ORDER + SLOW.len()];
            let mut s = sd_n;
            for _ in 0..4 {
                let mut h = Symmetric::zeros(order);
                let mut g = vec![0.0; order];
                for row in &rows {
                    let w = weight(innovation(row, &a) / s);
                    for i in 0..order {
                        g[i] += w * row[i + 1] * row[0];
                        for j in 0..=i {
                            h.add(i, j, w * row[i + 1] * row[j + 1]);
                        }
                    }
                }
                let x = h.factor().solve(&g);
                a[..order].copy_from_slice(&x);
                s = scale(&rows, &a).max(floor_n);
            }
            let (near, slow) = a.split_at(ORDER);
            if !stationary(near) || (order > ORDER && a.iter().sum::<f64>() > 0.999) {
                continue;
            }
            let near: [f64; ORDER] = core::array::from_fn(|i| near[i]);
            let slow: [f64; SLOW.len()] = core::array::from_fn(|i| slow[i]);
            let loss: f64 =
                rows.iter().map(|row| rho(innovation(row, &a) / s)).sum::<f64>() + n * libm::log(s);
            let cost = loss + 0.5 * order as f64 * libm::log(n);
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, Bin { a: near, slow, innovation_n: s, sd_n }));
            }
        }
        best.map_or(white, |b| b.1)
    }

    /// How the blocks of a recording are whitened.
    #[must_use]
    pub fn laid(&self, b: &Blocks) -> Laid {
        let mut run = 0;
        let rows = (0..b.len()).map(|k| {
            run = if b.restart[k] { 0 } else { run + 1 };
            if !b.used[k] {
                return Row { bin: 0, run: 0, sd_n: f64::INFINITY };
            }
            let bin = self.bin(b.size_n[k]).min(self.bins.len() - 1);
            let of = &self.bins[bin];
            // At the beginning nothing is known of the samples before.
            let sd = if run >= ORDER { of.innovation_n } else { of.sd_n.max(of.innovation_n) };
            let sd_n = if b.doubt_n[k] > 0.0 { libm::hypot(sd, b.doubt_n[k]) } else { sd };
            Row { bin: bin as u32, run: run as u32, sd_n }
        });
        Laid { rows: rows.collect(), wander: self.bins.iter().any(|b| b.slow != [0.0; SLOW.len()]) }
    }

    /// Normalised innovations of residuals `e` (N) of a recording; blocks that are not compared give zero.
    #[must_use]
    pub fn whiten(&self, laid: &Laid, e: &[f64]) -> Vec<f64> {
        let sums = if laid.wander { sums(e) } else { Vec::new() };
        let one = |(k, row): (usize, &Row)| {
            if row.sd_n == f64::INFINITY {
                return 0.0;
            }
            let (bin, run) = (&self.bins[row.bin as usize], row.run as usize);
            let mut w = e[k];
            if run >= ORDER {
                for (a, before) in bin.a.iter().zip(e[k - ORDER..k].iter().rev()) {
                    w -= a * before;
                }
                if laid.wander {
                    for (mean, slow) in slow_means(&sums, k, run).iter().zip(&bin.slow) {
                        w -= slow * mean;
                    }
                }
            }
            w / row.sd_n
        };
        laid.rows.iter().enumerate().map(one).collect()
    }

    /// Sum of the logarithms of the innovations' standard deviations, `ln(s/N)`, over the blocks compared.
    #[must_use]
    pub fn ln_sizes(&self, blocks: &[Blocks]) -> f64 {
        let mut sum = 0.0;
        for b in blocks {
            let mut run = 0;
            for k in 0..b.len() {
                run = if b.restart[k] { 0 } else { run + 1 };
                if b.used[k] {
                    let bin = &self.bins[self.bin(b.size_n[k]).min(self.bins.len() - 1)];
                    sum += libm::log(if run >= ORDER {
                        bin.innovation_n
                    } else {
                        bin.sd_n.max(bin.innovation_n)
                    });
                }
            }
        }
        sum
    }

    /// Standard deviation in N over all ranges, root mean square.
    #[must_use]
    pub fn sd_n(&self) -> f64 {
        let n = self.bins.len().max(1) as f64;
        (self.bins.iter().map(|b| b.sd_n * b.sd_n).sum::<f64>() / n).sqrt()
    }
}

/// Running sums of a column; what is not finite counts as nothing.
fn sums(e: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(e.len() + 1);
    let mut sum = 0.0;
    out.push(sum);
    for e in e {
        sum += if e.is_finite() { *e } else { 0.0 };
        out.push(sum);
    }
    out
}

/// Means of the slow stretches before block `k`, as far as the memory of `run` blocks reaches.
fn slow_means(sums: &[f64], k: usize, run: usize) -> [f64; SLOW.len()] {
    core::array::from_fn(|i| {
        let (from, to) = SLOW[i];
        let (lo, hi) = (k - to.min(run), k - from.min(run));
        (sums[hi] - sums[lo]) / (to - from) as f64
    })
}

fn row(e: &[f64], sums: &[f64], k: usize, run: usize) -> [f64; ROW] {
    let slow = slow_means(sums, k, run);
    core::array::from_fn(|i| if i <= ORDER { e[k - i] } else { slow[i - ORDER - 1] })
}

fn innovation(row: &[f64; ROW], a: &[f64; ROW - 1]) -> f64 {
    let mut w = row[0];
    for (i, a) in a.iter().enumerate() {
        w -= a * row[i + 1];
    }
    w
}

/// Scale of the innovations under Huber's loss: the root of `sum weight w^2 / n` over its value for normal noise.
fn scale(rows: &[[f64; ROW]], a: &[f64; ROW - 1]) -> f64 {
    let mut size: Vec<f64> = rows.iter().map(|row| innovation(row, a).abs()).collect();
    let mut s = (median(&mut size) * 1.4826).max(1e-300);
    for _ in 0..6 {
        let sum: f64 = rows
            .iter()
            .map(|row| {
                let w = innovation(row, a) / s;
                weight(w) * w * w
            })
            .sum();
        // For normal noise E[min(|w|, k)|w|] = erf(k/sqrt 2).
        let expected = libm::erf(HUBER * core::f64::consts::FRAC_1_SQRT_2);
        s *= (sum / (rows.len() as f64 * expected)).sqrt();
    }
    s
}

/// Whether the process has a finite variance (Schur-Cohn by Levinson's recursion downwards).
fn stationary(a: &[f64]) -> bool {
    let mut a = a.to_vec();
    while let Some(k) = a.pop() {
        if k.abs() >= 0.999 {
            return false;
        }
        let rest = a.clone();
        let m = rest.len();
        for i in 0..m {
            a[i] = (rest[i] + k * rest[m - 1 - i]) / (1.0 - k * k);
        }
    }
    true
}

/// Seconds of the windows in which a residual's smooth course is taken away.
const CALM_S: f64 = 1.0;

/// Residuals less a parabola in windows of about a second; the rougher half of the windows of each half minute is left
/// out as not a number.
fn calm(b: &Blocks, e: &[f64]) -> Vec<f64> {
    let length = (CALM_S / (b.step_s * b.samples as f64)).round().max(8.0) as usize;
    let n = b.len();
    let mut out = vec![f64::NAN; n];
    let mut windows: Vec<(usize, usize, f64)> = Vec::new();
    let mut from = 0;
    while from < n {
        let to = (from + length).min(n);
        if 2 * (to - from) >= length {
            let m = to - from;
            let x = |k: usize| 2.0 * (k - from) as f64 / m as f64 - 1.0;
            let mut h = Symmetric::zeros(3);
            let mut g = vec![0.0; 3];
            for k in (from..to).filter(|k| b.used[*k]) {
                let row = [1.0, x(k), x(k) * x(k)];
                for i in 0..3 {
                    g[i] += row[i] * e[k];
                    for j in 0..=i {
                        h.add(i, j, row[i] * row[j]);
                    }
                }
            }
            let c = h.factor().solve(&g);
            let mut square = 0.0;
            for k in from..to {
                out[k] = e[k] - c[0] - x(k) * (c[1] + x(k) * c[2]);
                square += out[k] * out[k];
            }
            // Three numbers were fitted.
            let lost = (m as f64 / (m as f64 - 3.0)).sqrt();
            out[from..to].iter_mut().for_each(|o| *o *= lost);
            windows.push((from, to, square / m as f64));
        }
        from = to;
    }
    // Rougher than four times the median of the neighbours' variance: not calm.
    let variances: Vec<f64> = windows.iter().map(|w| w.2).collect();
    for (k, (from, to, variance)) in windows.iter().enumerate() {
        let (lo, hi) = (k.saturating_sub(8), (k + 9).min(windows.len()));
        let mut around: Vec<f64> = variances[lo..hi].to_vec();
        if *variance > 2.5 * median(&mut around) {
            out[*from..*to].fill(f64::NAN);
        }
    }
    out
}
