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
        let mut noise = Self { edges_n, bins: Vec::new(), lasting: from.lasts() };
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
            return Bin::white(if sd_n.is_finite() { sd_n } else { 1.0 });
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
        Laid { rows: rows.collect(), wander: self.bins.iter().any(Bin::wanders) }
    }

    /// Normalised innovations of residuals `e` (N) of a recording; blocks that are not compared give zero.
    #[must_use]
    pub fn whiten(&self, laid: &Laid, e: &[f64]) -> Vec<f64> {
        let sums = match (laid.wander, self.lasting) {
            (false, _) => Vec::new(),
            (true, false) => sums(e, |_| true),
            (true, true) => sums(e, |k| laid.rows[k].sd_n.is_finite()),
        };
        let one = |(k, row): (usize, &Row)| {
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
        laid.rows.iter().enumerate().map(one).collect()
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
        let mut h = Symmetric::zeros(columns.len());
        let mut g = vec![0.0; columns.len()];
        for row in rows {
            let w = weight(innovation(row, &a) / s);
            for (i, x) in columns.iter().enumerate() {
                g[i] += w * row[x + 1] * row[0];
                for (j, y) in columns.iter().enumerate().take(i + 1) {
                    h.add(i, j, w * row[x + 1] * row[y + 1]);
                }
            }
        }
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
    use super::{From, Noise};
    use crate::blocks::{BLOCK_S, Blocks};
    use stylet_record::Recording;

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
