//! Parallel maps over slices, vectors and ranges, in order.
//!
//! The methods have the names of rayon's and run on its current thread pool. Each step is a whole parallel map whose loop is
//! compiled once for all types; rayon compiles its scheduler for every chain of adapters, which took a quarter of the build time
//! of the diagnosis. Meant for tasks of microseconds and more; results keep the order of the items, so that they do not depend on
//! the number of threads.
//!
//! ```
//! use stylet_stats::parallel::*;
//! let squares: Vec<u64> = [1_u64, 2, 3].par_iter().map(|x| x * x).collect();
//! assert_eq!(squares, [1, 4, 9]);
//! ```

use std::sync::{Mutex, PoisonError};

/// Items that the next `map` or `filter_map` treats in parallel; all other methods of iterators work one item after the other.
#[derive(Clone, Debug)]
pub struct ParallelItems<I> {
    items: Vec<I>,
}

/// Values that can be treated in parallel.
pub trait IntoParallelItems {
    /// One of the values.
    type Item: Send;
    /// The values, to be treated in parallel.
    fn into_par_iter(self) -> ParallelItems<Self::Item>;
}

impl<C: IntoIterator> IntoParallelItems for C
where
    C::Item: Send,
{
    type Item = C::Item;
    fn into_par_iter(self) -> ParallelItems<C::Item> {
        ParallelItems { items: self.into_iter().collect() }
    }
}

/// Slices whose entries can be treated in parallel.
pub trait ParallelSlice<T: Sync> {
    /// References to the entries, to be treated in parallel.
    fn par_iter(&self) -> ParallelItems<&T>;
}

impl<T: Sync> ParallelSlice<T> for [T] {
    fn par_iter(&self) -> ParallelItems<&T> {
        ParallelItems { items: self.iter().collect() }
    }
}

impl<I: Send> ParallelItems<I> {
    /// `f` of every item, computed in parallel.
    #[must_use]
    pub fn map<R: Send>(self, f: impl Fn(I) -> R + Sync) -> ParallelItems<R> {
        let slots: Vec<Mutex<(Option<I>, Option<R>)>> =
            self.items.into_iter().map(|item| Mutex::new((Some(item), None))).collect();
        run(slots.len(), &|k| {
            let item = slots[k].lock().unwrap_or_else(PoisonError::into_inner).0.take();
            let result = item.map(&f);
            slots[k].lock().unwrap_or_else(PoisonError::into_inner).1 = result;
        });
        let results =
            slots.into_iter().filter_map(|s| s.into_inner().unwrap_or_else(PoisonError::into_inner).1);
        ParallelItems { items: results.collect() }
    }

    /// The values of `f` that are not `None`, computed in parallel.
    #[must_use]
    pub fn filter_map<R: Send>(self, f: impl Fn(I) -> Option<R> + Sync) -> ParallelItems<R> {
        ParallelItems { items: self.map(f).into_iter().flatten().collect() }
    }

    /// Calls `f` with every item, in parallel.
    pub fn for_each(self, f: impl Fn(I) + Sync) {
        drop(self.map(f));
    }

    /// Pairs with the items of another sequence, up to the shorter of both.
    #[must_use]
    pub fn zip<O: IntoIterator>(self, other: O) -> ParallelItems<(I, O::Item)> {
        ParallelItems { items: self.items.into_iter().zip(other).collect() }
    }

    /// The items with their indices.
    #[must_use]
    pub fn enumerate(self) -> ParallelItems<(usize, I)> {
        ParallelItems { items: self.items.into_iter().enumerate().collect() }
    }

    /// Collects the items in order.
    pub fn collect<C: FromIterator<I>>(self) -> C {
        self.items.into_iter().collect()
    }
}

impl<I> IntoIterator for ParallelItems<I> {
    type Item = I;
    type IntoIter = std::vec::IntoIter<I>;
    fn into_iter(self) -> Self::IntoIter {
        self.items.into_iter()
    }
}

/// Runs `f(0)` to `f(n - 1)` in parallel.
fn run(n: usize, f: &(dyn Fn(usize) + Sync)) {
    use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator, ParallelIterator as _};
    // One task each: items may differ much in cost.
    IntoParallelIterator::into_par_iter(0..n).with_max_len(1).for_each(f);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_keep_the_order_of_the_items() {
        let doubled: Vec<usize> = (0..1000_usize).into_par_iter().map(|k| 2 * k).collect();
        assert_eq!(doubled, (0..1000).map(|k| 2 * k).collect::<Vec<_>>());
    }

    #[test]
    fn filtered_and_zipped_items_are_those_of_the_sequential_iterator() {
        let values = [3.0, 1.0, 2.0];
        let kept: Vec<(usize, f64)> = values
            .par_iter()
            .zip(["a", "b", "c"])
            .enumerate()
            .filter_map(|(k, (x, name))| (*x > 1.0 && name != "b").then_some((k, *x)))
            .collect();
        assert_eq!(kept, [(0, 3.0), (2, 2.0)]);
    }

    #[test]
    fn a_map_inside_a_map_ends_on_one_thread() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let sums: Vec<u64> = pool.install(|| {
            (0..4_u64).into_par_iter().map(|i| (0..i).into_par_iter().map(|j| j).into_iter().sum()).collect()
        });
        assert_eq!(sums, [0, 0, 1, 3]);
    }

    #[test]
    fn the_first_error_in_order_is_returned() {
        let all: Result<Vec<i32>, i32> =
            vec![1, -2, 3, -4].into_par_iter().map(|x| if x < 0 { Err(x) } else { Ok(x) }).collect();
        assert_eq!(all, Err(-2));
    }
}
