//! Accuracy of planning: cases in which the first insertion leaves the cause open, with a planned second insertion.

mod second_insertion;
mod summary_table;

use super::case_journal::CaseJournal;
use super::thread_pool;
use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::OutputLock;
use second_insertion::{PlanningCase, run_case};
use std::path::Path;
use stylet_examine::{CaseId, Hide, Wrong};
use stylet_stats::parallel::*;
use summary_table::write_table;

/// Upper bound of simulated cases per open case wanted.
const MAX_CASES_PER_OPEN_CASE: u64 = 6;

/// A benchmark of planning, with its locked output folder.
pub struct PlanningBenchmark {
    rows: Vec<(String, Vec<PlanningCase>)>,
    text: String,
    journal: CaseJournal<PlanningCase>,
    pool: rayon::ThreadPool,
    lock: OutputLock,
}

impl PlanningBenchmark {
    /// Locks the folder. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`].
    pub fn new(folder: &Path, threads: usize) -> Result<Self, Error> {
        let lock = OutputLock::new(folder)?;
        let journal = CaseJournal::open(&folder.join("cases.jsonl"))?;
        Ok(Self { rows: Vec::new(), text: String::new(), journal, pool: thread_pool(threads)?, lock })
    }

    /// Simulates cases like `base` until `wanted` of them are open after one insertion, and gives each open case a second insertion. With
    /// `from_journal` only the cases in the journal are used. `done` is called with the number of new open cases.
    pub fn run_row(&mut self, base: &CaseId, wanted: u64, from_journal: bool, done: &dyn Fn(u64)) {
        let mut cases: Vec<PlanningCase> = Vec::new();
        let (mut next, most) = (0, wanted * MAX_CASES_PER_OPEN_CASE);
        let open = |cases: &[PlanningCase]| cases.iter().filter(|c| c.open_because.is_some()).count() as u64;
        while open(&cases) < wanted && next < most {
            let batch: Vec<CaseId> =
                (next..next + 8).map(|index| CaseId { index, hide: Hide::One, ..*base }).collect();
            next += 8;
            let new: Vec<PlanningCase> =
                self.pool.install(|| batch.par_iter().filter_map(|id| self.case(id, from_journal)).collect());
            let before = open(&cases);
            cases.extend(new);
            done(open(&cases) - before);
        }
        // The first `wanted` open cases, independent of the batch size.
        let mut remaining = wanted;
        cases.retain(|c| {
            let keep = remaining > 0;
            remaining -= u64::from(c.open_because.is_some() && keep);
            keep
        });
        let severity =
            if base.wrong == Wrong::Nothing { String::new() } else { format!(", {}", base.severity) };
        let name = format!("{}: {}{severity}", base.world, base.wrong.as_str());
        write_table(&mut self.text, &name, &cases);
        self.rows.push((name, cases));
    }

    /// The case from the journal; if it is not there, a new one.
    fn case(&self, id: &CaseId, from_journal: bool) -> Option<PlanningCase> {
        if let Some(known) = self.journal.completed.iter().find(|d| d.id == *id) {
            return Some(known.clone());
        }
        if from_journal {
            return None;
        }
        let case = run_case(id);
        self.journal.append(&case);
        Some(case)
    }

    /// Writes the cases and their table, and returns the table as text.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self) -> Result<&str, Error> {
        let json = serde_json::to_vec_pretty(&self.rows).map_err(Error::internal)?;
        let mut output = OutputFiles::default();
        output.add("table.txt", self.text.clone());
        output.add("cases.json", json);
        output.write_locked(&self.lock)?;
        Ok(&self.text)
    }
}
