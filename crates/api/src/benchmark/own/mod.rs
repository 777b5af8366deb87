//! Cases drawn with the diagnosis' own law, for comparison with older tables.

mod case;
mod strength;
mod summary;

pub use case::{Case, examine, run};
pub use strength::aim;
pub use summary::summary;

use super::journal::Journal;
use crate::error::Error;
use crate::folder::{Claim, write_file};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use stylet_own_world::sketch;

/// Diagnoses so many cases, writes them to `folder`, and gives the table in words. `done` is told how many there are.
///
/// # Errors
/// [`Error::Output`], [`Error::Busy`].
pub fn own(folder: &Path, seed: u64, cases: u64, done: &(dyn Fn(usize) + Sync)) -> Result<String, Error> {
    let _claim = Claim::new(folder)?;
    let mut journal: Journal<Case> = Journal::open(&folder.join("cases.jsonl"))?;
    let missing: Vec<u64> = (0..cases).filter(|i| !journal.done.iter().any(|d| d.index == *i)).collect();
    let count = AtomicUsize::new(journal.done.len());
    let new: Vec<Option<Case>> = missing
        .par_iter()
        .map(|&index| {
            let case = run(index, &sketch(seed, index))?;
            journal.note(&case);
            done(count.fetch_add(1, Ordering::Relaxed) + 1);
            Some(case)
        })
        .collect();
    let mut all = std::mem::take(&mut journal.done);
    all.extend(new.into_iter().flatten());
    all.retain(|d| d.index < cases);
    all.sort_by_key(|d| d.index);
    let text = summary(&all);
    write_file(&folder.join("summary.txt"), text.as_bytes())?;
    Ok(text)
}
