//! The diagnosis examined in the referee's worlds.

use super::{answer_question, parse_word, thread_pool};
use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::OutputLock;
use std::path::{Path, PathBuf};
use stylet_examine::cases::hide_effects::{hidden_name, hidden_names};
use stylet_examine::{CaseId, Hide, Plan, Severity, Size, World, Wrong, results_table};
use stylet_report::pages::examination::{accuracy_maps, page};

/// Which cases are asked for, in words; `all` stands for all words of a list.
#[derive(Clone, Debug)]
pub struct CaseSelection<'a> {
    /// World of the referee.
    pub world: &'a str,
    /// What the believed simulation or the sensor has wrong.
    pub misspecification: &'a [String],
    /// How much of it.
    pub severity: &'a [String],
    /// What is hidden.
    pub hide: &'a [String],
    /// How strong it is.
    pub size: &'a str,
    /// Cases per cell.
    pub cases: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// Of these cases those alone that hide one of these; empty: all.
    pub effect: &'a [String],
}

/// The words of a list, or all of them.
fn words<T: Copy>(
    what: &str,
    given: &[String],
    all: &[T],
    parse: fn(&str) -> Option<T>,
    says: fn(T) -> &'static str,
) -> Result<Vec<T>, Error> {
    if given.iter().any(|g| g == "all") {
        return Ok(all.to_vec());
    }
    given.iter().map(|g| parse_word(what, g.trim(), all, parse, says)).collect()
}

impl CaseSelection<'_> {
    /// The plan of the cases.
    ///
    /// # Errors
    /// [`Error::Request`] for a word that there is not, with those that there are.
    pub fn plan(&self) -> Result<Plan, Error> {
        let one = |given: &str| vec![given.to_owned()];
        let world = words("--world", &one(self.world), World::ALL, World::parse, World::as_str)?;
        let size = words("--size", &one(self.size), Size::ALL, Size::parse, Size::as_str)?;
        let (Some(&world), Some(&size)) = (world.first(), size.first()) else {
            return Err(Error::internal("a list of words is empty"));
        };
        let plan = Plan {
            world,
            wrong: words("--wrong", self.misspecification, Wrong::ALL, Wrong::parse, Wrong::as_str)?,
            severities: words("--severity", self.severity, Severity::ALL, Severity::parse, Severity::as_str)?,
            hide: words("--hide", self.hide, Hide::ALL, Hide::parse, Hide::as_str)?,
            size,
            cases: self.cases,
            seed: self.seed,
            only: words("--effect", self.effect, &hidden_names(), hidden_name, |t| t)?,
        };
        if !plan.only.is_empty() && plan.cases().is_empty() {
            return Err(Error::Request(format!(
                "--effect {}: none of these cases hides it; effects are hidden by `--hide one` in the plain world, other shapes by `--hide \
                 outside`, and every one of 27 effects (16 shapes) once in so many cases of a row",
                plan.only.join(",")
            )));
        }
        Ok(plan)
    }
}

/// An examination in its folder, which it alone writes to.
pub struct DiagnosisBenchmark {
    /// The cases.
    pub cases: Vec<CaseId>,
    plan: Plan,
    journal: PathBuf,
    claim: OutputLock,
}

impl DiagnosisBenchmark {
    /// Claims the folder. With `look` the cases are those alone that its journal holds.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`].
    pub fn new(plan: Plan, folder: &Path, look: bool) -> Result<Self, Error> {
        let claim = OutputLock::new(folder)?;
        let journal = folder.join("cases.jsonl");
        let mut cases = plan.cases();
        if look {
            let there = stylet_examine::run_cases::read_journal(&journal)
                .map_err(|why| Error::output(folder, why))?;
            cases.retain(|id| there.contains_key(id));
        }
        Ok(Self { cases, plan, journal, claim })
    }

    /// Asks the engine, judges its answers, writes table, page and maps, and gives the table in words. `tell` is told how many of how
    /// many cases are done. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Internal`] for a mistake of the referee, [`Error::Output`].
    pub fn run(&self, threads: usize, tell: &(dyn Fn(usize, usize) + Sync)) -> Result<String, Error> {
        let Self { cases, plan, journal, claim } = self;
        let outcomes = thread_pool(threads)?
            .install(|| {
                stylet_examine::run_cases(cases, Some(journal), &answer_question::answer_question, tell)
            })
            .map_err(Error::internal)?;
        let text = results_table::results_text(&outcomes);
        let cells = results_table::table_cells(&outcomes);
        let mut output = OutputFiles::default();
        output.add("table.txt", text.clone());
        output.add_json("table.json", &cells)?;
        output.add("report.html", page(plan, &cells, &text).to_html());
        for (hide, svg) in accuracy_maps(plan, &cells) {
            output.add(map_name(hide), svg);
        }
        output.write_locked(claim)?;
        Ok(text)
    }
}

/// The file of a map.
fn map_name(hide: Hide) -> &'static str {
    match hide {
        Hide::Clean => "map_clean.svg",
        Hide::One => "map_one.svg",
        Hide::Two => "map_two.svg",
        Hide::Three => "map_three.svg",
        Hide::Outside => "map_outside.svg",
        Hide::Mixed => "map_beside.svg",
        Hide::Instrument => "map_instrument.svg",
    }
}
