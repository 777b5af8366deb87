//! Cases drawn with the diagnosis' own law, for comparison with older tables.

mod case;
mod strength;
mod summary;

pub use case::{Case, examine, run};
pub use strength::aim;
pub use summary::summary;

use super::case_journal::CaseJournal;
use crate::error::Error;
use crate::output_folder::{OutputLock, write_file_atomically};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use stylet_own_world::sketch;

/// Diagnoses so many cases, writes them to `folder`, and gives the table in words. `done` is told how many there are.
///
/// # Errors
/// [`Error::Output`], [`Error::Busy`].
pub fn own(folder: &Path, seed: u64, cases: u64, done: &(dyn Fn(usize) + Sync)) -> Result<String, Error> {
    let _claim = OutputLock::new(folder)?;
    let mut journal: CaseJournal<Case> = CaseJournal::open(&folder.join("cases.jsonl"))?;
    let missing: Vec<u64> = (0..cases).filter(|i| !journal.completed.iter().any(|d| d.index == *i)).collect();
    let count = AtomicUsize::new(journal.completed.len());
    let new: Vec<Option<Case>> = missing
        .par_iter()
        .map(|&index| {
            let case = run(index, &sketch(seed, index))?;
            journal.append(&case);
            done(count.fetch_add(1, Ordering::Relaxed) + 1);
            Some(case)
        })
        .collect();
    let mut all = std::mem::take(&mut journal.completed);
    all.extend(new.into_iter().flatten());
    all.retain(|d| d.index < cases);
    all.sort_by_key(|d| d.index);
    let text = summary(&all);
    write_file_atomically(&folder.join("summary.txt"), text.as_bytes())?;
    Ok(text)
}
