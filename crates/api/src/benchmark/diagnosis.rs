//! Accuracy of the diagnosis on cases of the independent simulator.

use super::custom_effects::HiddenEffect;
use super::{answer_question, parse_word, thread_pool};
use crate::error::Error;
use crate::output_files::OutputFiles;
use crate::output_folder::{OutputLock, write_file_atomically};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_examine::cases::hide_effects::{hidden_name, hidden_names};
use stylet_examine::{CaseId, CustomEffect, Hide, Plan, Severity, Size, World, Wrong, results_table};
use stylet_report::pages::examination::{accuracy_maps, page};
use stylet_scenario::effects_to_ron;
use stylet_tissue::AnyEffect;

/// Selection of cases in words; `all` stands for all words of a list.
#[derive(Clone, Debug)]
pub struct CaseSelection<'a> {
    /// Tissue model of the independent simulator.
    pub world: &'a str,
    /// Wrong assumptions about tissue or sensor.
    pub misspecification: &'a [String],
    /// Severity of the wrong assumptions.
    pub severity: &'a [String],
    /// What the cases hide.
    pub hide: &'a [String],
    /// Size of the hidden effects.
    pub size: &'a str,
    /// Cases per cell.
    pub cases: u64,
    /// Seed of the cases.
    pub seed: u64,
    /// Only cases that hide one of these; empty: all.
    pub effect: &'a [String],
    /// Whether custom effects are given, one of which a case may hide.
    pub custom: bool,
}

/// Parses a list of words, or gives all of them for `all`.
fn parse_words<T: Copy + PartialEq>(
    what: &str,
    given: &[String],
    all: &[T],
    parse: fn(&str) -> Option<T>,
    word: fn(T) -> &'static str,
) -> Result<Vec<T>, Error> {
    if given.iter().any(|g| g == "all") {
        return Ok(all.to_vec());
    }
    given.iter().map(|g| parse_word(what, g.trim(), all, parse, word)).collect()
}

impl CaseSelection<'_> {
    /// The plan of the cases.
    ///
    /// # Errors
    /// [`Error::Request`] for an unknown word, with the known ones.
    pub fn plan(&self) -> Result<Plan, Error> {
        let one = |given: &str| vec![given.to_owned()];
        let hides_custom = self.hide.iter().any(|word| word.trim() == Hide::Custom.as_str());
        if hides_custom && !self.custom {
            return Err(Error::Request(
                "--hide custom: hides one of your own effects; give `stylet benchmark diagnose` their files with --effects"
                    .to_owned(),
            ));
        }
        let hides = if self.custom { Hide::ALL } else { Hide::BUILT_IN };
        let world = parse_words("--world", &one(self.world), World::ALL, World::parse, World::as_str)?;
        let size = parse_words("--size", &one(self.size), Size::ALL, Size::parse, Size::as_str)?;
        let (Some(&world), Some(&size)) = (world.first(), size.first()) else {
            return Err(Error::internal("a list of words is empty"));
        };
        if hides_custom && world != World::Plain {
            return Err(Error::Request(
                "--hide custom: only the plain world has custom effects; leave out --world".to_owned(),
            ));
        }
        let mut plan = Plan {
            world,
            wrong: parse_words("--wrong", self.misspecification, Wrong::ALL, Wrong::parse, Wrong::as_str)?,
            severities: parse_words(
                "--severity",
                self.severity,
                Severity::ALL,
                Severity::parse,
                Severity::as_str,
            )?,
            hide: parse_words("--hide", self.hide, hides, Hide::parse, Hide::as_str)?,
            size,
            cases: self.cases,
            seed: self.seed,
            only: parse_words("--effect", self.effect, &hidden_names(), hidden_name, |t| t)?,
        };
        // Without a scenario there is nothing that could name custom effects as candidates.
        plan.wrong.retain(|wrong| !self.custom || *wrong != Wrong::NoScenario);
        if !plan.only.is_empty() && plan.cases().is_empty() {
            return Err(Error::Request(format!(
                "--effect {}: none of these cases hides it; effects are hidden by `--hide one` in the plain world, other shapes by `--hide \
                 outside`, and each of the 30 effects (16 shapes) once in as many cases of a row",
                plan.only.join(",")
            )));
        }
        Ok(plan)
    }
}

/// A benchmark of the diagnosis, with its locked output folder.
pub struct DiagnosisBenchmark {
    /// The cases.
    pub cases: Vec<CaseId>,
    plan: Plan,
    custom: Vec<AnyEffect>,
    journal: PathBuf,
    lock: OutputLock,
}

impl DiagnosisBenchmark {
    /// Locks the folder. The effects `custom` are candidates of every diagnosis, and cases with [`Hide::Custom`] hide one of them. With
    /// `from_journal` only the cases in the folder's journal are selected.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`]; [`Error::Request`] when the journal belongs to other custom effects.
    pub fn new(plan: Plan, custom: Vec<AnyEffect>, folder: &Path, from_journal: bool) -> Result<Self, Error> {
        let lock = OutputLock::new(folder)?;
        let journal = folder.join("cases.jsonl");
        if !from_journal {
            store_custom_effects(&custom, folder, journal.exists())?;
        }
        let mut cases = plan.cases();
        if from_journal {
            let completed = stylet_examine::run_cases::read_journal(&journal)
                .map_err(|why| Error::output(folder, why))?;
            cases.retain(|id| completed.contains_key(id));
        }
        Ok(Self { cases, plan, custom, journal, lock })
    }

    /// Diagnoses the cases, scores the answers, writes table, page and maps, and returns the table as text. `progress` is called with the
    /// numbers of completed and of all cases. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Internal`] when a case cannot be simulated, [`Error::Output`].
    pub fn run(&self, threads: usize, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<String, Error> {
        let Self { cases, plan, custom, journal, lock } = self;
        let hidden: Vec<Arc<dyn CustomEffect>> =
            custom.iter().map(|effect| Arc::new(HiddenEffect(effect.clone())) as _).collect();
        let engine = |question: &_| answer_question::answer_question(question, custom);
        let outcomes = thread_pool(threads)?
            .install(|| stylet_examine::run_cases_with(cases, &hidden, Some(journal), &engine, progress))
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
        output.write_locked(lock)?;
        Ok(text)
    }
}

/// Keeps the custom effects beside the journal, whose answers depend on them. A file that is there is never replaced.
fn store_custom_effects(custom: &[AnyEffect], folder: &Path, has_journal: bool) -> Result<(), Error> {
    let path = folder.join("effects.ron");
    let text = effects_to_ron(custom).map_err(Error::internal)?;
    let kept = std::fs::read_to_string(&path).ok();
    if (has_journal || kept.is_some()) && kept.as_deref().unwrap_or("[]") != text {
        return Err(Error::Request(format!(
            "{}: holds other custom effects; name the same files with --effects, or another folder with --out",
            folder.display()
        )));
    }
    if custom.is_empty() || kept.is_some() { Ok(()) } else { write_file_atomically(&path, text.as_bytes()) }
}

/// File name of a map.
fn map_name(hide: Hide) -> &'static str {
    match hide {
        Hide::Clean => "map_clean.svg",
        Hide::One => "map_one.svg",
        Hide::Two => "map_two.svg",
        Hide::Three => "map_three.svg",
        Hide::Outside => "map_outside.svg",
        Hide::Mixed => "map_beside.svg",
        Hide::Instrument => "map_instrument.svg",
        Hide::Custom => "map_custom.svg",
    }
}
