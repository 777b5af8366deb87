//! Planning examined: realities whose first insertion leaves the cause open, inserted into again as planned.

mod second_insertion;
mod summary_table;

use super::case_journal::CaseJournal;
use super::thread_pool;
use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::OutputLock;
use rayon::prelude::*;
use second_insertion::{PlanningCase, run_case};
use std::path::Path;
use stylet_examine::{CaseId, Hide, Wrong};
use summary_table::write_table;

/// Draws of a reality per case asked for, at most.
const DRAWS: u64 = 6;

/// An examination of planning in its folder, which it alone writes to.
pub struct PlanningBenchmark {
    rows: Vec<(String, Vec<PlanningCase>)>,
    text: String,
    journal: CaseJournal<PlanningCase>,
    pool: rayon::ThreadPool,
    claim: OutputLock,
}

impl PlanningBenchmark {
    /// Claims the folder. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`].
    pub fn new(folder: &Path, threads: usize) -> Result<Self, Error> {
        let claim = OutputLock::new(folder)?;
        let journal = CaseJournal::open(&folder.join("cases.jsonl"))?;
        Ok(Self { rows: Vec::new(), text: String::new(), journal, pool: thread_pool(threads)?, claim })
    }

    /// Draws cases like `base` until so many are left open by one insertion, and lets each be inserted into again. With `look` those
    /// alone that the journal holds. `done` is told of open cases.
    pub fn run_row(&mut self, base: &CaseId, wanted: u64, look: bool, done: &dyn Fn(u64)) {
        let mut cases: Vec<PlanningCase> = Vec::new();
        let (mut next, most) = (0, wanted * DRAWS);
        let open = |cases: &[PlanningCase]| cases.iter().filter(|c| c.open_because.is_some()).count() as u64;
        while open(&cases) < wanted && next < most {
            let batch: Vec<CaseId> =
                (next..next + 8).map(|index| CaseId { index, hide: Hide::One, ..*base }).collect();
            next += 8;
            let new: Vec<PlanningCase> =
                self.pool.install(|| batch.par_iter().filter_map(|id| self.case(id, look)).collect());
            let before = open(&cases);
            cases.extend(new);
            done(open(&cases) - before);
        }
        // The first so many open ones, whatever the size of the batches.
        let mut left = wanted;
        cases.retain(|c| {
            let keep = left > 0;
            left -= u64::from(c.open_because.is_some() && keep);
            keep
        });
        let severity =
            if base.wrong == Wrong::Nothing { String::new() } else { format!(", {}", base.severity) };
        let name = format!("{}: {}{severity}", base.world, base.wrong.as_str());
        write_table(&mut self.text, &name, &cases);
        self.rows.push((name, cases));
    }

    /// A case of the journal, else a new one.
    fn case(&self, id: &CaseId, look: bool) -> Option<PlanningCase> {
        if let Some(known) = self.journal.completed.iter().find(|d| d.id == *id) {
            return Some(known.clone());
        }
        if look {
            return None;
        }
        let case = run_case(id);
        self.journal.append(&case);
        Some(case)
    }

    /// Writes the cases and their table, and gives the table in words.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self) -> Result<&str, Error> {
        let json = serde_json::to_vec_pretty(&self.rows).map_err(Error::internal)?;
        let mut output = OutputFiles::default();
        output.add("table.txt", self.text.clone());
        output.add("cases.json", json);
        output.write_locked(&self.claim)?;
        Ok(&self.text)
    }
}
