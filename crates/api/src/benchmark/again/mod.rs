//! Planning examined: realities whose first insertion leaves the cause open, inserted into again as planned.

mod case;
mod table;

use super::journal::Journal;
use super::pool;
use crate::error::Error;
use crate::folder::Claim;
use crate::output::Output;
use case::{Case, one};
use rayon::prelude::*;
use std::path::Path;
use stylet_examine::{CaseId, Hide, Wrong};
use table::table;

/// Draws of a reality per case asked for, at most.
const DRAWS: u64 = 6;

/// An examination of planning in its folder, which it alone writes to.
pub struct Planning {
    rows: Vec<(String, Vec<Case>)>,
    text: String,
    journal: Journal<Case>,
    pool: rayon::ThreadPool,
    claim: Claim,
}

impl Planning {
    /// Claims the folder. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`].
    pub fn new(folder: &Path, threads: usize) -> Result<Self, Error> {
        let claim = Claim::new(folder)?;
        let journal = Journal::open(&folder.join("cases.jsonl"))?;
        Ok(Self { rows: Vec::new(), text: String::new(), journal, pool: pool(threads)?, claim })
    }

    /// Draws cases like `base` until so many are left open by one insertion, and lets each be inserted into again. With `look` those
    /// alone that the journal holds. `done` is told of open cases.
    pub fn row(&mut self, base: &CaseId, wanted: u64, look: bool, done: &dyn Fn(u64)) {
        let mut cases: Vec<Case> = Vec::new();
        let (mut next, most) = (0, wanted * DRAWS);
        let open = |cases: &[Case]| cases.iter().filter(|c| c.open.is_some()).count() as u64;
        while open(&cases) < wanted && next < most {
            let batch: Vec<CaseId> =
                (next..next + 8).map(|index| CaseId { index, hide: Hide::One, ..*base }).collect();
            next += 8;
            let new: Vec<Case> =
                self.pool.install(|| batch.par_iter().filter_map(|id| self.case(id, look)).collect());
            let before = open(&cases);
            cases.extend(new);
            done(open(&cases) - before);
        }
        // The first so many open ones, whatever the size of the batches.
        let mut left = wanted;
        cases.retain(|c| {
            let keep = left > 0;
            left -= u64::from(c.open.is_some() && keep);
            keep
        });
        let grade = if base.wrong == Wrong::Nothing { String::new() } else { format!(", {}", base.grade) };
        let name = format!("{}: {}{grade}", base.world, base.wrong.word());
        table(&mut self.text, &name, &cases);
        self.rows.push((name, cases));
    }

    /// A case of the journal, else a new one.
    fn case(&self, id: &CaseId, look: bool) -> Option<Case> {
        if let Some(known) = self.journal.done.iter().find(|d| d.id == *id) {
            return Some(known.clone());
        }
        if look {
            return None;
        }
        let case = one(id);
        self.journal.note(&case);
        Some(case)
    }

    /// Writes the cases and their table, and gives the table in words.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self) -> Result<&str, Error> {
        let json = serde_json::to_vec_pretty(&self.rows).map_err(Error::internal)?;
        let mut output = Output::default();
        output.add("table.txt", self.text.clone());
        output.add("cases.json", json);
        output.write_to(&self.claim)?;
        Ok(&self.text)
    }
}
