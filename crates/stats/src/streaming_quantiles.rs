//! Exact quantiles of more values than fit into memory, in a few passes: radix selection on the bits of the values.

use crate::order_statistics::{interpolate_between, interpolation_position, quantile};

/// Most values that are kept in memory, where [`crate::quantile`] applies.
const MAX_IN_MEMORY: usize = 1 << 19;
/// Bits that one pass resolves.
const BITS: u32 = 18;

/// The quantiles at each of `qs` (0 to 1), bit for bit those of [`crate::quantile`]. `NaN` without values.
///
/// `pass` calls its argument with every value; it is called one to five times and must give the same values every time.
/// Takes some ten megabytes of memory for any number of values.
///
/// # Errors
/// The error of `pass`.
pub fn quantiles_of_stream<E>(
    qs: &[f64],
    mut pass: impl FnMut(&mut dyn FnMut(f64)) -> Result<(), E>,
) -> Result<Vec<f64>, E> {
    let (mut count, mut few, mut first) = (0_usize, Vec::new(), Histogram::default());
    pass(&mut |x| {
        count += 1;
        if count <= MAX_IN_MEMORY {
            few.push(x);
            return;
        }
        if count == MAX_IN_MEMORY + 1 {
            few.iter().for_each(|x| first.add(key(*x), 0));
            few = Vec::new();
        }
        first.add(key(x), 0);
    })?;
    if count <= MAX_IN_MEMORY {
        return Ok(qs.iter().map(|q| quantile(&mut few, *q)).collect());
    }
    let places: Vec<_> = qs.iter().map(|q| interpolation_position(count, *q)).collect();
    let ranks = places.iter().flatten().flat_map(|(below, share)| {
        [Some(*below as u64), (*share > 0.0).then_some(*below as u64 + 1)].into_iter().flatten()
    });
    let mut search = RankSearch::default();
    ranks.for_each(|rank| search.narrow(&first, 0, 0, rank, rank));
    drop(first);
    while !search.open.is_empty() {
        let mut open = std::mem::take(&mut search.open);
        pass(&mut |x| open.iter_mut().for_each(|range| range.add(key(x))))?;
        for range in open {
            range.close(&mut search);
        }
    }
    let at = |rank: usize| {
        let found = search.found.iter().find(|(of, _)| *of == rank as u64);
        found.map_or(f64::NAN, |(_, key)| value_of(*key))
    };
    let value = |place: &Option<(usize, f64)>| match *place {
        None => f64::NAN,
        Some((below, share)) if share > 0.0 => interpolate_between(at(below), at(below + 1), share),
        Some((below, _)) => at(below),
    };
    Ok(places.iter().map(value).collect())
}

/// An integer whose order is that of [`f64::total_cmp`].
fn key(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// The value of a key.
fn value_of(key: u64) -> f64 {
    f64::from_bits(if key >> 63 == 1 { key & !(1 << 63) } else { !key })
}

/// Counts of keys by their next bits.
#[derive(Default)]
struct Histogram(Vec<u64>);

impl Histogram {
    /// Counts a key by the bits behind its first `known` ones.
    #[inline]
    fn add(&mut self, key: u64, known: u32) {
        if self.0.is_empty() {
            self.0 = vec![0; 1 << BITS];
        }
        // In the last pass fewer bits remain; zeros are shifted in.
        self.0[((key << known) >> (64 - BITS)) as usize] += 1;
    }
}

/// Keys with the same leading bits that contain the ranks sought.
struct Range {
    first: u64,
    known: u32,
    /// The rank among all, and among these.
    ranks: Vec<(u64, u64)>,
    within: RangeRefinement,
}

enum RangeRefinement {
    Many(Histogram),
    Few(Vec<u64>),
}

impl Range {
    #[inline]
    fn add(&mut self, key: u64) {
        if (key ^ self.first) >> (64 - self.known) == 0 {
            match &mut self.within {
                RangeRefinement::Many(histogram) => histogram.add(key, self.known),
                RangeRefinement::Few(keys) => keys.push(key),
            }
        }
    }

    fn close(self, search: &mut RankSearch) {
        match self.within {
            RangeRefinement::Many(histogram) => {
                for (rank, here) in self.ranks {
                    search.narrow(&histogram, self.first, self.known, rank, here);
                }
            }
            RangeRefinement::Few(mut keys) => {
                keys.sort_unstable();
                let here = |at: u64| keys.get(at as usize).copied().unwrap_or_default();
                search.found.extend(self.ranks.iter().map(|(rank, at)| (*rank, here(*at))));
            }
        }
    }
}

#[derive(Default)]
struct RankSearch {
    open: Vec<Range>,
    /// Ranks and their keys.
    found: Vec<(u64, u64)>,
}

impl RankSearch {
    /// Narrows the search to the bin that contains the rank, which is the rank `here` within the range.
    fn narrow(&mut self, histogram: &Histogram, first: u64, known: u32, rank: u64, mut here: u64) {
        for (bin, count) in histogram.0.iter().enumerate() {
            if here >= *count {
                here -= count;
                continue;
            }
            let first = first | ((bin as u64) << (64 - BITS)) >> known;
            let known = known + BITS;
            if known >= 64 {
                self.found.push((rank, first));
            } else if let Some(range) = self.open.iter_mut().find(|r| r.known == known && r.first == first) {
                range.ranks.push((rank, here));
            } else {
                let few = *count <= MAX_IN_MEMORY as u64 / 2;
                let within = if few {
                    RangeRefinement::Few(Vec::new())
                } else {
                    RangeRefinement::Many(Histogram::default())
                };
                self.open.push(Range { first, known, ranks: vec![(rank, here)], within });
            }
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order_statistics::quantile_of;
    use std::convert::Infallible;

    fn compare_with_quantile_of(values: &[f64]) {
        let qs = [0.0, 0.02, 0.05, 0.5, 0.731, 0.95, 0.99, 1.0, 1.5];
        let found = quantiles_of_stream(&qs, |take| -> Result<(), Infallible> {
            values.iter().for_each(|x| take(*x));
            Ok(())
        });
        let Ok(found) = found;
        for (q, found) in qs.iter().zip(found) {
            let expected = quantile_of(values.iter().copied(), *q);
            assert_eq!(
                found.to_bits(),
                expected.to_bits(),
                "{} values at {q}: {found} {expected}",
                values.len()
            );
        }
    }

    /// Uniform numbers in -0.5 to 0.5 with a fixed seed.
    fn scatter(count: usize) -> Vec<f64> {
        let mut state: u64 = 7;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn quantiles_of_a_stream_are_bit_for_bit_those_of_a_slice() {
        let many = MAX_IN_MEMORY + 70_001;
        compare_with_quantile_of(&[]);
        compare_with_quantile_of(&scatter(101));
        compare_with_quantile_of(&scatter(many));
        // Nearly all values in one bin of the first pass and of the second, like intervals of a regular clock.
        compare_with_quantile_of(&scatter(many).iter().map(|x| 0.005 + 1e-9 * x).collect::<Vec<_>>());
        compare_with_quantile_of(&scatter(many).iter().map(|x| 0.005 + 1e-17 * x).collect::<Vec<_>>());
        // Few values, both zeros, both signs, huge ones.
        compare_with_quantile_of(
            &scatter(many).iter().map(|x| (4.0 * x).round() * 1e300).collect::<Vec<_>>(),
        );
        compare_with_quantile_of(&vec![-0.0; many]);
    }
}
