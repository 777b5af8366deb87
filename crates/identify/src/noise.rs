//! The noise of measured force: autoregressive, one set of coefficients and one size per range of the force.
//!
//! Growth with the force, tails and missing air need no special case then. Residuals are means over blocks.

use crate::blocks::Blocks;
use crate::linear::Symmetric;
use rayon::prelude::*;
use stylet_stats::order::{median, quantile_of_sorted};

/// Highest order.
pub const ORDER: usize = 4;
/// Most ranges of the force.
const BINS: usize = 5;
/// Turns of robust least squares.
const TURNS: usize = 4;
/// Fewest blocks of a range: a size is then known to a twentieth.
const LEAST: usize = 220;
/// Beyond so many standard deviations a residual counts linearly (Huber).
pub const HUBER: f64 = 2.5;
/// Smallest noise in N: rounding of numbers in files.
const FLOOR_N: f64 = 1e-6;

/// Stretches of blocks before those of the autoregression whose means a slow wander is told by: some tenths of a second,
/// some seconds, ten seconds (a heterogeneous autoregression: Corsi 2009).
const SLOW: [(usize, usize); 3] = [(ORDER, 24), (24, 124), (124, 624)];
/// So many of them hold what a search calls noise; a law that moves over tens of seconds would be lost in the others.
const SEARCHED: usize = 2;
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
    fn unknown(sd_n: f64) -> Self {
        Self { a: [0.0; ORDER], slow: [0.0; SLOW.len()], sd_n }
    }
}

impl Bin {
    /// Independent noise of one size.
    fn white(sd_n: f64) -> Self {
        let none = First::unknown(sd_n);
        Self { a: none.a, slow: none.slow, innovation_n: sd_n, sd_n, first: [none; ORDER] }
    }

    /// Whether it has a slow wander.
    fn wanders(&self) -> bool {
        let none = [0.0; SLOW.len()];
        self.slow != none || self.first.iter().any(|f| f.slow != none)
    }

    /// Standard deviation in N of what is not foretold of a block with so many before it since a break.
    fn size_n(&self, run: usize) -> f64 {
        self.first.get(run).map_or(self.innovation_n, |f| f.sd_n)
    }
}

/// The noise of a set of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Upper edges in N of all ranges but the last.
    pub edges_n: Vec<f64>,
    /// The ranges.
    pub bins: Vec<Bin>,
    /// The memory of a slow wander reaches through breaks of the recording, such as jumps of the speed.
    pub lasting: bool,
}

/// How the blocks of one recording are whitened.
#[derive(Clone, Debug, PartialEq)]
pub struct Laid {
    rows: Vec<Row>,
    /// Some range has a slow wander.
    wander: bool,
    /// Blocks one after the other of one range, all with [`ORDER`] before them and without a wander: first, end, range.
    even: Vec<(usize, usize, u32)>,
}

/// How one block is whitened.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// Range of the force.
    bin: u32,
    /// Blocks that are known before it, without a break.
    run: u32,
    /// Blocks before it to which the memory of a slow wander reaches.
    reach: u32,
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
    /// As they are, and however slow: what intervals have to reckon with.
    Lasting,
    /// The same of noise that was drawn: it is normal, so that plain least squares do.
    Drawn,
    /// Less what is smooth over a second, in the calmer windows: structure that a law lacks is no noise.
    Calm,
}

impl From {
    /// Whether a wander's memory reaches through breaks of the recording.
    fn lasts(self) -> bool {
        matches!(self, Self::Lasting | Self::Drawn)
    }
}

impl Noise {
    /// Independent noise of one size.
    #[must_use]
    pub fn white(sd_n: f64) -> Self {
        Self { edges_n: Vec::new(), bins: vec![Bin::white(sd_n)], lasting: false }
    }

    /// The noise of residuals `e` (N), one column per recording; nowhere less than `floor_n`.
    #[must_use]
    pub fn estimate(blocks: &[Blocks], e: &[Vec<f64>], from: From, floor_n: f64) -> Self {
        let columns: Vec<Vec<f64>> = match from {
            From::Whole | From::Lasting | From::Drawn => e.to_vec(),
            From::Calm => blocks.par_iter().zip(e).map(|(b, e)| calm(b, e)).collect(),
        };
        let mut sizes: Vec<f64> = Vec::new();
        for b in blocks {
            sizes.extend(b.size_n.iter().zip(&b.used).filter(|(_, u)| **u).map(|(s, _)| *s));
        }
        sizes.sort_unstable_by(f64::total_cmp);
        let count = (sizes.len() / LEAST).clamp(1, BINS);
        let edges_n: Vec<f64> =
            (1..count).map(|k| quantile_of_sorted(&sizes, k as f64 / count as f64)).collect();
        let mut noise = Self { edges_n, bins: Vec::new(), lasting: from.lasts() };
        noise.bins = (0..count)
            .into_par_iter()
            .map(|bin| noise.fit(blocks, &columns, bin, from, floor_n.max(FLOOR_N)))
            .collect();
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
            let columns: Vec<usize> = (0..order).collect();
            let (a, s) = foretold(&rows, &columns, (sd_n, floor_n), turns);
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
                let columns: Vec<usize> = (0..run).chain(ORDER..ORDER + SLOW.len()).collect();
                let (a, s) = foretold(&rows, &columns, (sd_n, floor_n), turns);
                let (near, slow) = a.split_at(ORDER);
                *first = First {
                    a: core::array::from_fn(|i| near[i]),
                    slow: core::array::from_fn(|i| slow[i]),
                    sd_n: s.max(best.innovation_n),
                };
            }
        }
        best
    }

    /// How the blocks of a recording are whitened.
    #[must_use]
    pub fn laid(&self, b: &Blocks) -> Laid {
        let mut run = 0;
        let lasting = self.lasting;
        let rows = (0..b.len()).map(|k| {
            run = if b.restart[k] { 0 } else { run + 1 };
            if !b.used[k] {
                return Row { bin: 0, run: 0, reach: 0, sd_n: f64::INFINITY };
            }
            let bin = self.bin(b.size_n[k]).min(self.bins.len() - 1);
            let of = &self.bins[bin];
            let sd = of.size_n(run);
            let sd_n = if b.doubt_n[k] > 0.0 { libm::hypot(sd, b.doubt_n[k]) } else { sd };
            Row { bin: bin as u32, run: run as u32, reach: if lasting { k as u32 } else { run as u32 }, sd_n }
        });
        let rows: Vec<Row> = rows.collect();
        let mut even: Vec<(usize, usize, u32)> = Vec::new();
        for (k, row) in rows.iter().enumerate() {
            if row.sd_n == f64::INFINITY
                || (row.run as usize) < ORDER
                || self.bins[row.bin as usize].wanders()
            {
                continue;
            }
            match even.last_mut() {
                Some((_, end, bin)) if *end == k && *bin == row.bin => *end += 1,
                _ => even.push((k, k + 1, row.bin)),
            }
        }
        Laid { rows, wander: self.bins.iter().any(Bin::wanders), even }
    }

    /// Normalised innovations of residuals `e` (N) of a recording; blocks that are not compared give zero.
    #[must_use]
    pub fn whiten(&self, laid: &Laid, e: &[f64]) -> Vec<f64> {
        let sums = match (laid.wander, self.lasting) {
            (false, _) => Vec::new(),
            (true, false) => sums(e, |_| true),
            (true, true) => sums(e, |k| laid.rows[k].sd_n.is_finite()),
        };
        let one = |k: usize, row: &Row| {
            if row.sd_n == f64::INFINITY {
                return 0.0;
            }
            let (near, slow) = self.memory(row);
            let mut w = e[k];
            for (a, before) in near.iter().zip(e[k - ORDER.min(row.run as usize)..k].iter().rev()) {
                w -= a * before;
            }
            if laid.wander && *slow != [0.0; SLOW.len()] {
                for (mean, slow) in slow_means(&sums, k, row.reach as usize).iter().zip(slow) {
                    w -= slow * mean;
                }
            }
            w / row.sd_n
        };
        let mut out = vec![0.0; e.len()];
        // Where there is nothing, and nothing is remembered, nothing comes out.
        let reach = if laid.wander { SLOW[SLOW.len() - 1].1 } else { ORDER };
        let first = e.iter().position(|e| *e != 0.0).unwrap_or(e.len());
        let end = e.iter().rposition(|e| *e != 0.0).map_or(0, |k| (k + 1 + reach).min(e.len()));
        let mut at = first;
        for &(from, to, bin) in laid.even.iter().chain([&(e.len(), e.len(), 0)]) {
            let (from, to) = (from.clamp(first, end.max(first)), to.min(end));
            for k in at..from {
                out[k] = one(k, &laid.rows[k]);
            }
            if from >= to {
                at = at.max(from);
                continue;
            }
            let a = &self.bins[bin as usize].a;
            let rows = &laid.rows[from..to];
            for ((out, row), e) in
                out[from..to].iter_mut().zip(rows).zip(e[from - ORDER..to].windows(ORDER + 1))
            {
                let mut w = e[ORDER];
                for i in 0..ORDER {
                    w -= a[i] * e[ORDER - 1 - i];
                }
                *out = w / row.sd_n;
            }
            at = to;
        }
        out
    }

    /// Residuals (N) of a recording whose normalised innovations are `w`: the inverse of [`whiten`](Self::whiten), nothing where blocks
    /// are not compared.
    #[must_use]
    pub fn colour(&self, laid: &Laid, w: &[f64]) -> Vec<f64> {
        let mut e = vec![0.0; w.len()];
        let mut sums = vec![0.0; w.len() + 1];
        for (k, row) in laid.rows.iter().enumerate() {
            if row.sd_n.is_finite() {
                let (near, slow) = self.memory(row);
                let run = ORDER.min(row.run as usize);
                let mut x = w[k] * row.sd_n;
                for (a, before) in near.iter().zip(e[k - run..k].iter().rev()) {
                    x += a * before;
                }
                if laid.wander {
                    let means = slow_means(&sums, k, row.reach as usize);
                    x += means.iter().zip(slow).map(|(mean, slow)| slow * mean).sum::<f64>();
                }
                e[k] = x;
            }
            sums[k + 1] = sums[k] + e[k];
        }
        e
    }

    /// How a block is foretold: coefficients of those before it, and of the means of stretches further back.
    fn memory(&self, row: &Row) -> (&[f64; ORDER], &[f64; SLOW.len()]) {
        let bin = &self.bins[row.bin as usize];
        bin.first.get(row.run as usize).map_or((&bin.a, &bin.slow), |f| (&f.a, &f.slow))
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
                    sum += libm::log(bin.size_n(run));
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

/// Running sums of a column; what is not finite or not used counts as nothing.
fn sums(e: &[f64], used: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut out = Vec::with_capacity(e.len() + 1);
    let mut sum = 0.0;
    out.push(sum);
    for (k, e) in e.iter().enumerate() {
        sum += if e.is_finite() && used(k) { *e } else { 0.0 };
        out.push(sum);
    }
    out
}

/// Means of the slow stretches before block `k`, as far as a memory of `reach` blocks goes.
fn slow_means(sums: &[f64], k: usize, reach: usize) -> [f64; SLOW.len()] {
    core::array::from_fn(|i| {
        let (from, to) = SLOW[i];
        let (lo, hi) = (k - to.min(reach), k - from.min(reach));
        (sums[hi] - sums[lo]) / (to - from) as f64
    })
}

fn row(e: &[f64], sums: &[f64], k: usize, reach: usize) -> [f64; ROW] {
    let slow = slow_means(sums, k, reach);
    core::array::from_fn(|i| if i <= ORDER { e[k - i] } else { slow[i - ORDER - 1] })
}

fn innovation(row: &[f64; ROW], a: &[f64; ROW - 1]) -> f64 {
    let mut w = row[0];
    for (i, a) in a.iter().enumerate() {
        w -= a * row[i + 1];
    }
    w
}

/// Coefficients of some columns of rows, and the standard deviation in N of what they do not foretell, by robust least squares; the
/// noise is nowhere less than `floor_n`. With one turn by plain least squares.
fn foretold(
    rows: &[[f64; ROW]],
    columns: &[usize],
    (sd_n, floor_n): (f64, f64),
    turns: usize,
) -> ([f64; ROW - 1], f64) {
    let mut a = [0.0; ROW - 1];
    let mut s = if turns == 1 { f64::INFINITY } else { sd_n };
    for _ in 0..turns {
        let mut sums = [[0.0; ROW]; ROW - 1];
        for row in rows {
            let w = weight(innovation(row, &a) / s);
            for (sums, i) in sums.iter_mut().zip(columns) {
                let x = w * row[i + 1];
                sums[0] += x * row[0];
                for (sum, j) in sums[1..].iter_mut().zip(columns) {
                    *sum += x * row[j + 1];
                }
            }
        }
        let mut h = Symmetric::zeros(columns.len());
        for (i, sums) in sums.iter().enumerate().take(columns.len()) {
            (0..=i).for_each(|j| h.add(i, j, sums[j + 1]));
        }
        let g: Vec<f64> = sums.iter().take(columns.len()).map(|sums| sums[0]).collect();
        for (x, value) in columns.iter().zip(h.factor().solve(&g)) {
            a[*x] = value;
        }
        s = if turns == 1 { plain_scale(rows, &a) } else { scale(rows, &a) }.max(floor_n);
    }
    (a, s)
}

/// Root mean square of the innovations.
fn plain_scale(rows: &[[f64; ROW]], a: &[f64; ROW - 1]) -> f64 {
    (rows.iter().map(|row| innovation(row, a).powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
}

/// Scale of the innovations under Huber's loss: the root of `sum weight w^2 / n` over its value for normal noise.
fn scale(rows: &[[f64; ROW]], a: &[f64; ROW - 1]) -> f64 {
    let mut size: Vec<f64> = rows.iter().map(|row| innovation(row, a).abs()).collect();
    let mut s = (median(&mut size) * stylet_stats::MAD_TO_SD).max(1e-300);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocks::BLOCK_S;
    use stylet_record::Recording;
    use stylet_stats::Ar;

    /// Blocks of a needle at rest; of none is anything known but its time.
    fn still(blocks: usize) -> Blocks {
        let t: Vec<f64> = (0..4 * blocks).map(|k| k as f64 / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let b = Blocks::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        assert_eq!(b.len(), blocks);
        b
    }

    /// Normal numbers: twelve even ones of a linear congruence (Knuth's MMIX) each.
    fn normal(seed: u64, n: usize) -> Vec<f64> {
        let mut state = seed;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..n).map(|_| (0..12).map(|_| even()).sum::<f64>() - 6.0).collect()
    }

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    #[test]
    fn a_loss_is_a_square_near_zero_and_a_line_beyond() {
        near(rho(1.3), 0.845);
        near(rho(-2.4), 2.88);
        near(rho(4.0), 6.875);
        near(rho(-7.5), 15.625);
        near(weight(-2.4), 1.0);
        near(weight(2.5), 1.0);
        near(weight(-4.0), 0.625);
        // The weight is the slope of the loss over the deviate.
        for w in [-6.3, -1.1, 0.4, 2.2, 3.7] {
            let slope = (rho(w + 1e-6) - rho(w - 1e-6)) / 2e-6;
            assert!((weight(w) * w - slope).abs() < 1e-6, "{w}");
        }
    }

    /// Bins whose first blocks after a break are foretold as those of an autoregressive process of a known covariance are.
    fn of_process(ar: &Ar) -> (Bin, Vec<f64>) {
        let mut c = vec![0.0; 12];
        ar.autocovariance(&mut c);
        let mut bin = Bin::white(c[0].sqrt());
        for run in 0..=ORDER {
            let mut h = Symmetric::zeros(run);
            for i in 0..run {
                for j in 0..=i {
                    h.add(i, j, c[i - j]);
                }
            }
            let a = h.factor().solve(&c[1..=run]);
            let left = c[0] - a.iter().zip(&c[1..]).map(|(a, c)| a * c).sum::<f64>();
            let mut padded = [0.0; ORDER];
            padded[..run].copy_from_slice(&a);
            if run == ORDER {
                (bin.a, bin.innovation_n) = (padded, left.sqrt());
            } else {
                bin.first[run] = First { a: padded, slow: [0.0; SLOW.len()], sd_n: left.sqrt() };
            }
        }
        (bin, c)
    }

    /// The logarithm of the density of a normal vector with this covariance, by a naive factor.
    fn ln_density(e: &[f64], covariance: impl Fn(usize, usize) -> f64) -> f64 {
        let n = e.len();
        let mut l = vec![vec![0.0; n]; n];
        let (mut y, mut sum) = (vec![0.0; n], -0.5 * n as f64 * libm::log(core::f64::consts::TAU));
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
                let left = covariance(i, j) - known;
                l[i][j] = if i == j { left.sqrt() } else { left / l[j][j] };
            }
            let known: f64 = (0..i).map(|k| l[i][k] * y[k]).sum();
            y[i] = (e[i] - known) / l[i][i];
            sum -= 0.5 * y[i] * y[i] + libm::log(l[i][i]);
        }
        sum
    }

    #[test]
    fn whitened_noise_has_the_likelihood_of_the_dense_covariance() {
        let ar = Ar::from_reflection(&[0.6, -0.35, 0.2, 0.1], 0.03);
        let (bin, c) = of_process(&ar);
        let mut b = still(12);
        // A block that is not compared ends the memory.
        b.used[7] = false;
        b.restart[8] = true;
        let noise = Noise { edges_n: Vec::new(), bins: vec![bin], lasting: false };
        let e: Vec<f64> = normal(5, 12).into_iter().map(|x| 0.03 * x).collect();
        let w = noise.whiten(&noise.laid(&b), &e);
        let told: f64 = -w.iter().map(|w| 0.5 * w * w).sum::<f64>()
            - noise.ln_sizes(std::slice::from_ref(&b))
            - 0.5 * 11.0 * libm::log(core::f64::consts::TAU);
        let toeplitz = |i: usize, j: usize| c[i.abs_diff(j)];
        near(told, ln_density(&e[..7], toeplitz) + ln_density(&e[8..], toeplitz));
        assert_eq!(w[7], 0.0);
        // What sampling leaves open of a block is added to its own size alone.
        b.doubt_n[4] = 0.05;
        let doubted = noise.whiten(&noise.laid(&b), &e);
        near(doubted[4], w[4] * bin.innovation_n / (bin.innovation_n * bin.innovation_n + 0.0025).sqrt());
        assert_eq!([doubted[3], doubted[5]], [w[3], w[5]]);
    }

    /// Two ranges with a slow wander of their own, breaks, and blocks that are not compared.
    fn wandering(lasting: bool) -> (Noise, Blocks) {
        let mut b = still(900);
        for k in 0..900 {
            b.size_n[k] = if k % 7 < 3 { 0.4 } else { 1.1 };
            b.used[k] = k % 53 != 0;
            b.restart[k] = k % 53 == 1 || k == 300;
        }
        let bin = |x: f64| {
            let mut bin = Bin::white(0.02 * x);
            bin.a = [0.3 * x, 0.1, -0.05 * x, 0.02];
            bin.slow = [0.2, 0.1 * x, 0.15];
            bin.innovation_n = 0.015 * x;
            for (k, first) in bin.first.iter_mut().enumerate() {
                first.a[..k].copy_from_slice(&[0.31 * x, 0.11, 0.05][..k]);
                first.slow = [0.25, 0.11, 0.05 * x];
                first.sd_n = 0.03 - 0.002 * k as f64;
            }
            bin
        };
        (Noise { edges_n: vec![0.9], bins: vec![bin(1.0), bin(1.3)], lasting }, b)
    }

    /// One block by the definition: those before it since the break, and the means of stretches before those.
    fn innovation_of(noise: &Noise, b: &Blocks, e: &[f64], k: usize) -> f64 {
        let since = (0..=k).rev().find(|j| b.restart[*j]).unwrap_or(0);
        let bin = &noise.bins[usize::from(b.size_n[k] >= 0.9)];
        let run = k - since;
        let (a, slow, sd) = match bin.first.get(run) {
            Some(f) => (f.a, f.slow, f.sd_n),
            None => (bin.a, bin.slow, bin.innovation_n),
        };
        let mut w = e[k];
        for i in 1..=run.min(4) {
            w -= a[i - 1] * e[k - i];
        }
        let begin = if noise.lasting { 0 } else { since };
        for (slow, (from, to)) in slow.iter().zip([(4, 24), (24, 124), (124, 624)]) {
            let counts = |j: &usize| *j >= begin && (!noise.lasting || b.used[*j]);
            let stretch = (k.saturating_sub(to)..k.saturating_sub(from)).filter(counts);
            w -= slow * stretch.map(|j| e[j]).sum::<f64>() / (to - from) as f64;
        }
        w / sd
    }

    /// By the definition, wherever they begin and end.
    #[test]
    fn residuals_that_are_nothing_at_their_ends_leave_nothing_beyond_their_memory() {
        let normals = normal(9, 900);
        for wanders in [false, true] {
            let (mut noise, b) = wandering(false);
            for bin in noise.bins.iter_mut().filter(|_| !wanders) {
                bin.slow = [0.0; SLOW.len()];
                bin.first.iter_mut().for_each(|f| f.slow = bin.slow);
            }
            let laid = noise.laid(&b);
            assert_eq!(laid.even.is_empty(), wanders);
            for something in [0..900, 0..1, 299..303, 411..640, 898..900, 500..500] {
                let e: Vec<f64> =
                    (0..900).map(|k| if something.contains(&k) { normals[k] } else { 0.0 }).collect();
                let w = noise.whiten(&laid, &e);
                for k in 0..900 {
                    let wanted = if b.used[k] { innovation_of(&noise, &b, &e, k) } else { 0.0 };
                    assert!((w[k] - wanted).abs() < 1e-9, "{} for {wanted} at {k}", w[k]);
                }
            }
        }
    }

    #[test]
    fn a_slow_wander_is_foretold_from_the_means_of_stretches_before() {
        for lasting in [false, true] {
            let (noise, b) = wandering(lasting);
            let e = normal(7, b.len());
            let laid = noise.laid(&b);
            let w = noise.whiten(&laid, &e);
            for k in 0..b.len() {
                near(w[k], if b.used[k] { innovation_of(&noise, &b, &e, k) } else { 0.0 });
            }
            let sizes = |k: usize| {
                let since = (0..=k).rev().find(|j| b.restart[*j]).unwrap_or(0);
                let bin = &noise.bins[usize::from(b.size_n[k] >= 0.9)];
                libm::log(bin.first.get(k - since).map_or(bin.innovation_n, |f| f.sd_n))
            };
            near(
                noise.ln_sizes(&[b.clone(), b.clone()]),
                2.0 * (0..b.len()).filter(|k| b.used[*k]).map(sizes).sum::<f64>(),
            );
            // Coloured again it is what it was, where it is compared; what is not is nothing.
            let bare: Vec<f64> =
                e.iter().zip(&b.used).map(|(e, used)| if *used { *e } else { 0.0 }).collect();
            let again = noise.colour(&laid, &noise.whiten(&laid, &bare));
            for (told, wanted) in again.iter().zip(&bare) {
                assert!((told - wanted).abs() < 1e-9, "{told} for {wanted}");
            }
        }
    }

    #[test]
    fn a_size_of_the_force_lies_in_the_range_that_begins_there() {
        let mut noise = Noise::white(0.3);
        assert_eq!((noise.bin(0.0), noise.bin(9.0)), (0, 0));
        near(noise.sd_n(), 0.3);
        noise.edges_n = vec![0.5, 1.5];
        noise.bins = vec![Bin::white(0.3), Bin::white(0.5), Bin::white(1.1)];
        assert_eq!([0.49, 0.5, 1.49, 1.5, 7.0].map(|s| noise.bin(s)), [0, 1, 1, 2, 2]);
        near(noise.sd_n(), ((0.09 + 0.25 + 1.21) / 3.0_f64).sqrt());
        let bin = &noise.bins[1];
        assert_eq!((bin.size_n(0), bin.size_n(3), bin.size_n(4), bin.a), (0.5, 0.5, 0.5, [0.0; ORDER]));
        assert!(!bin.wanders());
        assert!(Bin { slow: [0.0, 0.0, 0.1], ..*bin }.wanders());
        let mut first = *bin;
        first.first[2].slow[1] = 0.2;
        assert!(first.wanders());
    }

    /// Ranges have the same number of blocks, of which a size needs 220; no more than five ranges.
    #[test]
    fn ranges_hold_as_many_blocks_each_as_a_size_needs() {
        for (blocks, ranges) in [(219, 1), (439, 1), (440, 2), (659, 2), (660, 3), (1100, 5), (1500, 5)] {
            let mut b = still(blocks + 1);
            b.used[0] = false;
            b.size_n = (0..=blocks).map(|k| (k * 7919 % (blocks + 1)) as f64).collect();
            b.size_n[0] = 1e6;
            let e: Vec<f64> = normal(3, blocks + 1);
            let noise = Noise::estimate(&[b.clone()], &[e], From::Whole, 0.0);
            assert_eq!(noise.bins.len(), ranges, "{blocks}");
            let mut sizes: Vec<f64> = b.size_n[1..].to_vec();
            sizes.sort_unstable_by(f64::total_cmp);
            for (k, edge) in noise.edges_n.iter().enumerate() {
                near(*edge, quantile_of_sorted(&sizes, (k + 1) as f64 / ranges as f64));
            }
        }
    }

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

    #[test]
    fn running_sums_and_means_of_stretches_are_naive_ones() {
        let mut e = normal(2, 700);
        e[13] = f64::NAN;
        let of = sums(&e, |k| k % 5 != 2);
        let kept = |k: usize| if k % 5 != 2 && k != 13 { e[k] } else { 0.0 };
        assert_eq!(of.len(), 701);
        for k in [0, 1, 2, 3, 14, 650, 700] {
            near(of[k], (0..k).map(kept).sum());
        }
        for (k, reach) in [(690, 690), (690, 130), (690, 60), (690, 17), (690, 3), (3, 3), (200, 200)] {
            let means = slow_means(&of, k, reach);
            for (mean, (from, to)) in means.into_iter().zip([(4, 24), (24, 124), (124, 624)]) {
                let sum: f64 = (k - reach.min(to)..k - reach.min(from)).map(kept).sum();
                near(mean, sum / (to - from) as f64);
            }
        }
        let e = normal(2, 700);
        let of = sums(&e, |_| true);
        let told = row(&e, &of, 650, 650);
        assert_eq!(told[..5], [e[650], e[649], e[648], e[647], e[646]]);
        assert_eq!(told[5..], slow_means(&of, 650, 650));
        let a = [0.3, -0.2, 0.7, 0.11, 0.5, -0.4, 0.9];
        let wanted = told[0] - a.iter().zip(&told[1..]).map(|(a, x)| a * x).sum::<f64>();
        near(innovation(&told, &a), wanted);
    }

    /// By plain least squares what is left is orthogonal to every column.
    #[test]
    fn what_plain_least_squares_do_not_foretell_is_orthogonal_to_what_does() {
        let numbers = normal(21, 60 * ROW);
        let rows: Vec<[f64; ROW]> =
            numbers.chunks_exact(ROW).map(|c| core::array::from_fn(|i| c[i])).collect();
        let columns = [0, 2, 5];
        let (a, s) = foretold(&rows, &columns, (1.0, 1e-6), 1);
        for x in 0..ROW - 1 {
            let along: f64 = rows.iter().map(|r| r[x + 1] * innovation(r, &a)).sum();
            assert_eq!(columns.contains(&x), along.abs() < 1e-9, "{x}: {along}");
            assert_eq!(columns.contains(&x), a[x] != 0.0);
        }
        near(s, (rows.iter().map(|r| innovation(r, &a).powi(2)).sum::<f64>() / 60.0).sqrt());
        assert_eq!(foretold(&rows, &columns, (1.0, 5.0), 1).1, 5.0);
        // Robust ones are not led astray by a few that are far off.
        let mut led = rows.clone();
        led[10][0] = 30.0;
        let (robust, s) = foretold(&led, &columns, (1.0, 1e-6), 4);
        assert!((0..ROW - 1).all(|x| (robust[x] - a[x]).abs() < 0.4), "{robust:?} {a:?}");
        assert!(s > 0.9 && s < 2.2, "{s}");
    }

    #[test]
    fn a_scale_is_the_size_of_normal_noise_and_known_for_residuals_all_alike() {
        let rows = |x: &[f64]| -> Vec<[f64; ROW]> {
            x.iter().map(|x| core::array::from_fn(|i| if i == 0 { *x } else { 0.0 })).collect()
        };
        let none = [0.0; ROW - 1];
        // Every weight is one: the root of their square over its expectation under Huber's loss.
        let alike: Vec<f64> = (0..50).map(|k| if k % 3 == 0 { 0.7 } else { -0.7 }).collect();
        near(scale(&rows(&alike), &none), 0.7 / libm::erf(2.5 / core::f64::consts::SQRT_2).sqrt());
        near(plain_scale(&rows(&alike), &none), 0.7);
        let drawn: Vec<f64> = normal(4, 20_000).into_iter().map(|x| 0.03 * x).collect();
        assert!((scale(&rows(&drawn), &none) / 0.03 - 1.0).abs() < 0.02);
        // One in fifty twelve times as large: the size under which the squares that Huber's weights leave are as many as expected.
        let tails: Vec<f64> =
            drawn.iter().enumerate().map(|(k, x)| if k % 50 == 0 { 12.0 * x } else { *x }).collect();
        let told = scale(&rows(&tails), &none);
        let counted = |x: &f64| (x / told).abs() * (x / told).abs().min(2.5);
        let share = tails.iter().map(counted).sum::<f64>() / 20_000.0;
        assert!((share - libm::erf(2.5 / core::f64::consts::SQRT_2)).abs() < 1e-3, "{share}");
        assert!(told / 0.03 > 1.1 && told / 0.03 < 1.4, "{told}");
    }

    /// The roots of the characteristic polynomial all lie inside the unit circle.
    #[test]
    fn a_process_is_stationary_when_its_roots_are_inside_the_unit_circle() {
        // Coefficients of `(1 - p z)(1 - q z)(1 - r z)`.
        let product = |p: f64, q: f64, r: f64| [p + q + r, -(p * q + p * r + q * r), p * q * r];
        for (p, q, r, wanted) in [
            (0.5, 0.3, -0.4, true),
            (0.95, 0.9, 0.85, true),
            (0.95, -0.97, 0.3, true),
            (1.05, 0.4, 0.2, false),
            (0.5, -1.02, 0.1, false),
            (0.2, 1.2, 0.9, false),
            (0.2, 1.2, 0.7, false),
        ] {
            assert_eq!(stationary(&product(p, q, r)), wanted, "{p} {q} {r}");
        }
        // The triangle of two coefficients.
        for (a, b, wanted) in [
            (0.5, 0.45, true),
            (0.5, 0.55, false),
            (-1.4, -0.6, true),
            (-1.7, -0.6, false),
            (0.2, -0.998, true),
            (0.2, -0.9995, false),
            (1.5, -0.6, true),
        ] {
            assert_eq!(stationary(&[a, b]), wanted, "{a} {b}");
        }
        assert!(stationary(&[]) && stationary(&[0.998]) && !stationary(&[0.999]) && !stationary(&[-1.0]));
    }

    /// What is smooth over a second is no noise, and a window that is rougher than its neighbours is left out.
    #[test]
    fn calm_residuals_are_without_their_smooth_course_and_without_rough_windows() {
        let mut b = still(1020);
        b.used[130] = false;
        let draw = normal(6, 1020);
        let bent = |k: usize| {
            let s = k as f64 / 50.0;
            0.3 + 0.5 * s - 0.7 * (s - 3.0) * (s - 3.0)
        };
        let rough = |k: usize| if k / 50 == 7 { 1.9 } else { 1.0 };
        let e: Vec<f64> = (0..1020).map(|k| bent(k) + 0.01 * rough(k) * draw[k]).collect();
        let told = calm(&b, &e);
        // Three numbers by naive normal equations (Cramer) in every second.
        for window in 0..20 {
            let (from, to) = (50 * window, 50 * window + 50);
            let inside: Vec<usize> = (from..to).filter(|k| b.used[*k]).collect();
            let x = |k: usize| (k - from) as f64;
            let sum = |f: &dyn Fn(usize) -> f64| inside.iter().map(|k| f(*k)).sum::<f64>();
            let s: Vec<f64> = (0..5).map(|p| sum(&|k| x(k).powi(p))).collect();
            let g: Vec<f64> = (0..3).map(|p| sum(&|k| x(k).powi(p) * (e[k] - bent(k)))).collect();
            let det = |m: [[f64; 3]; 3]| {
                m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
                    - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                    + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
            };
            let m = [[s[0], s[1], s[2]], [s[1], s[2], s[3]], [s[2], s[3], s[4]]];
            let c: Vec<f64> = (0..3)
                .map(|p| {
                    let mut with = m;
                    (0..3).for_each(|i| with[i][p] = g[i]);
                    det(with) / det(m)
                })
                .collect();
            for k in from..to {
                let left = e[k] - bent(k) - c[0] - c[1] * x(k) - c[2] * x(k) * x(k);
                if window == 7 {
                    assert!(told[k].is_nan(), "{k}");
                } else {
                    let wanted = left * (50.0 / 47.0_f64).sqrt();
                    assert!((told[k] - wanted).abs() < 1e-8, "{k}: {} for {wanted}", told[k]);
                }
            }
        }
        // Less than half a second is left at the end.
        assert!(told[1000..].iter().all(|x| x.is_nan()));
        assert!(calm(&still(1025), &vec![0.1; 1025])[1000..].iter().all(|x| x.abs() < 1e-12));
    }

    /// A wander that lasts some seconds goes on after a break: what is left of the first blocks there is small, and those of one
    /// break know nothing of one another. As if they began anew they would count as many times what they tell.
    #[test]
    fn a_slow_wander_lasts_through_a_break() {
        let n = 12_000;
        let t: Vec<f64> = (0..4 * n).map(|k| f64::from(k) / 200.0).collect();
        let zero = vec![0.0; t.len()];
        let r = Recording::new(t, zero.clone(), zero).expect("a recording");
        let mut b = Blocks::new(&r, &vec![false; r.time_s.len()], BLOCK_S);
        for k in (0..b.len()).filter(|k| k % 40 == 0) {
            b.used[k] = false;
            b.restart[k + 1] = true;
        }
        // Twelve even numbers of a linear congruence (Knuth's MMIX) make a normal one.
        let mut state = 11_u64;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| even()).sum::<f64>() - 6.0;
        let mut slow = 0.0;
        let e: Vec<f64> = (0..b.len())
            .map(|_| {
                slow = 0.998 * slow + 0.063 * 0.03 * normal();
                slow + 0.01 * normal()
            })
            .collect();
        let spread = |from: From| {
            let blocks = [b.clone()];
            let noise = Noise::estimate(&blocks, std::slice::from_ref(&e), from, 0.0);
            let w = noise.whiten(&noise.laid(&b), &e);
            let sums: Vec<f64> =
                (0..b.len() / 40).map(|k| w[40 * k + 1..40 * k + 5].iter().sum::<f64>()).collect();
            sums[20..].iter().map(|s| s * s / 4.0).sum::<f64>() / (sums.len() - 20) as f64
        };
        let (anew, lasting) = (spread(From::Whole), spread(From::Lasting));
        assert!(anew > 2.0, "{anew}");
        assert!(lasting > 0.6 && lasting < 1.5, "{lasting}");
    }
}
