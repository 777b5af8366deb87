//! Samples of a recording in blocks, in memory or on disk, so that the checks of both are the same code.

use crate::recording::Recording;
use std::convert::Infallible;
use stylet_stats::quantiles_of_stream;

/// A column that every recording has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Time in s.
    Time,
    /// Position in m.
    Position,
    /// Velocity in m/s, measured or differentiated.
    Velocity,
    /// Force in N.
    Force,
}

/// Samples in time order, in blocks, for any number of passes.
pub(crate) trait SampleStream {
    /// Error of a pass.
    type Error;
    /// Sorted values, in memory or on disk.
    type Sorted: SortedValues<Error = Self::Error>;

    /// Number of samples.
    fn len(&self) -> usize;

    /// Whether the velocity was measured.
    fn velocity_measured(&self) -> bool;

    /// Calls `each` with all samples, block by block.
    fn for_each_block<const N: usize>(
        &self,
        which: [Quantity; N],
        each: impl FnMut([&[f64]; N]),
    ) -> Result<(), Self::Error>;

    /// The quantity of one sample (0-based).
    fn at(&self, which: Quantity, sample: usize) -> Result<f64, Self::Error>;

    /// Stores the values that `fill` passes on, in ascending order.
    fn sorted_values(
        &self,
        fill: impl FnOnce(&mut dyn FnMut(f64)) -> Result<(), Self::Error>,
    ) -> Result<Self::Sorted, Self::Error>;

    /// Calls `each` with one quantity, sample by sample.
    fn for_each_value(&self, which: Quantity, mut each: impl FnMut(f64)) -> Result<(), Self::Error> {
        self.for_each_block([which], |[block]| block.iter().for_each(|x| each(*x)))
    }

    /// Calls `each` with one quantity of every two consecutive samples.
    fn for_each_pair(&self, which: Quantity, mut each: impl FnMut(f64, f64)) -> Result<(), Self::Error> {
        let mut before = None;
        self.for_each_value(which, |x| {
            if let Some(before) = before.replace(x) {
                each(before, x);
            }
        })
    }

    /// Smallest and largest value.
    fn extremes(&self, which: Quantity) -> Result<(f64, f64), Self::Error> {
        let mut found = (f64::NAN, f64::NAN);
        self.for_each_value(which, |x| found = (found.0.min(x), found.1.max(x)))?;
        Ok(found)
    }

    /// Median interval between samples (s).
    fn median_interval_s(&self) -> Result<f64, Self::Error> {
        let of = quantiles_of_stream(&[0.5], |take| self.for_each_pair(Quantity::Time, |a, b| take(b - a)))?;
        Ok(of.first().copied().unwrap_or(f64::NAN))
    }

    /// Time from the first to the last sample (s).
    fn duration_s(&self) -> Result<f64, Self::Error> {
        match self.len() {
            0 => Ok(0.0),
            n => Ok(self.at(Quantity::Time, n - 1)? - self.at(Quantity::Time, 0)?),
        }
    }
}

/// Values in ascending order.
pub(crate) trait SortedValues {
    /// Error of a pass.
    type Error;

    /// Number of values.
    fn len(&self) -> usize;

    /// Calls `each` with every value.
    fn for_each(&self, each: impl FnMut(f64)) -> Result<(), Self::Error>;
}

impl SortedValues for Vec<f64> {
    type Error = Infallible;

    fn len(&self) -> usize {
        Vec::len(self)
    }

    fn for_each(&self, each: impl FnMut(f64)) -> Result<(), Infallible> {
        self.iter().copied().for_each(each);
        Ok(())
    }
}

impl SampleStream for Recording {
    type Error = Infallible;
    type Sorted = Vec<f64>;

    fn len(&self) -> usize {
        self.time_s.len()
    }

    fn velocity_measured(&self) -> bool {
        self.velocity_measured
    }

    fn for_each_block<const N: usize>(
        &self,
        which: [Quantity; N],
        mut each: impl FnMut([&[f64]; N]),
    ) -> Result<(), Infallible> {
        each(which.map(|which| self.column(which)));
        Ok(())
    }

    fn at(&self, which: Quantity, sample: usize) -> Result<f64, Infallible> {
        Ok(self.column(which).get(sample).copied().unwrap_or(f64::NAN))
    }

    fn sorted_values(
        &self,
        fill: impl FnOnce(&mut dyn FnMut(f64)) -> Result<(), Infallible>,
    ) -> Result<Vec<f64>, Infallible> {
        let mut kept = Vec::with_capacity(self.time_s.len());
        fill(&mut |x| kept.push(x))?;
        kept.sort_unstable_by(f64::total_cmp);
        Ok(kept)
    }
}

impl Recording {
    fn column(&self, which: Quantity) -> &[f64] {
        match which {
            Quantity::Time => &self.time_s,
            Quantity::Position => &self.position_m,
            Quantity::Velocity => &self.velocity_mps,
            Quantity::Force => &self.force_n,
        }
    }
}
