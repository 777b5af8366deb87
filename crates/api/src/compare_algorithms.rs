//! The same insertions, heard by several algorithms: replayed scenarios, and the referee's cases. The only place where those cases and the
//! online core meet; neither knows of the other.

use crate::benchmark::parse_word;
use crate::error::Error;
use crate::output_files::OutputFiles;
use rayon::prelude::*;
use stylet_core::EnhanceConfig;
use stylet_core::config::Algorithm;
use stylet_examine::{Case, CaseId, Hide, Plan, Severity, Size, World, Wrong};
use stylet_record::TrueRupture;
use stylet_scenario::Scenario;
use stylet_score::{Trace, match_ruptures};
use stylet_sweep::algorithm_comparison::{ComparisonRow, DetectionCounts, algorithm_name, compare_algorithm};

/// The row of a scenario, which was read from `file`, over so many noise seeds; `done` is told of each insertion.
///
/// # Errors
/// [`Error::Simulate`] when it cannot be replayed.
pub fn compare_on_scenario(
    scenario: &Scenario,
    file: &str,
    algorithm: Algorithm,
    seeds: u64,
    done: &(dyn Fn(u64) + Sync),
) -> Result<ComparisonRow, Error> {
    compare_algorithm(scenario, algorithm, seeds, done)
        .map_err(|why| Error::Simulate { file: file.to_owned(), why })
}

/// All files that `stylet compare` writes, of rows over `seeds` insertions.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn output_files(rows: &[ComparisonRow], seeds: u64) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    output.add_json("compare.json", &rows)?;
    output.add("report.html", stylet_report::pages::algorithm_comparison::page(rows, seeds).to_html());
    Ok(output)
}

/// Cases of one kind: a row per algorithm.
pub struct CaseGroup {
    name: String,
    cases: Vec<CaseId>,
}

/// Kinds of so many cases of a world, drawn with a seed, in which nothing that is believed is wrong; one per word of what departs from the base
/// law.
///
/// # Errors
/// [`Error::Request`] for a word that there is not, with those that there are.
pub fn case_groups(world: &str, hide: &[String], cases: u64, seed: u64) -> Result<Vec<CaseGroup>, Error> {
    let world = parse_word("--world", world, World::ALL, World::parse, World::as_str)?;
    hide.iter()
        .map(|given| {
            let hide = parse_word("--hide", given, Hide::ALL, Hide::parse, Hide::as_str)?;
            let plan = Plan {
                world,
                wrong: vec![Wrong::Nothing],
                severities: vec![Severity::Large],
                hide: vec![hide],
                size: Size::Strong,
                cases,
                seed,
                only: Vec::new(),
            };
            Ok(CaseGroup { name: format!("{world} world, {hide}"), cases: plan.cases() })
        })
        .collect()
}

impl CaseGroup {
    /// Draws each case once and lets every algorithm hear it; `done` is told of the insertions that were heard.
    ///
    /// # Errors
    /// [`Error::Internal`] when a case cannot be drawn, which is a mistake of the referee.
    pub fn run_algorithms(
        &self,
        algorithms: &[Algorithm],
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<ComparisonRow>, Error> {
        // In the order of the cases, whatever the threads: the same bytes.
        let heard: Vec<Vec<DetectionCounts>> = self
            .cases
            .par_iter()
            .map(|id| {
                let case = stylet_examine::make_case(id)
                    .map_err(|e| Error::internal(format!("{}: {e}", id.name())))?;
                let scored = algorithms.iter().map(|a| listen(&case, *a)).collect();
                done(algorithms.len() as u64);
                Ok(scored)
            })
            .collect::<Result<_, Error>>()?;
        let row = |(k, algorithm): (usize, &Algorithm)| {
            let mut all = DetectionCounts::default();
            for one in heard.iter().filter_map(|of| of.get(k)) {
                all.missed += one.missed;
                all.false_alarms += one.false_alarms;
                all.ruptures += one.ruptures;
                all.delays_s.extend(&one.delays_s);
            }
            ComparisonRow::new(&self.name, algorithm_name(*algorithm), self.cases.len() as u64, &all)
        };
        Ok(algorithms.iter().enumerate().map(row).collect())
    }
}

/// What an algorithm makes of all recordings of a case.
fn listen(case: &Case, algorithm: Algorithm) -> DetectionCounts {
    let config = EnhanceConfig { algorithm, ..EnhanceConfig::default() };
    let surface_m = case.setup.assumed.surface_m;
    let mut all = DetectionCounts::default();
    for (named, there) in case.question.recordings.iter().zip(&case.there) {
        let recording = &named.recording;
        let trace = Trace::run(recording, &recording.force_n, &config, surface_m, |_, _| {});
        let last_s = recording.time_s.last().copied().unwrap_or(0.0);
        let truth: Vec<TrueRupture> = there
            .ruptures_s
            .iter()
            .filter(|t| **t < last_s)
            .enumerate()
            .map(|(i, &time_s)| TrueRupture { layer: i + 1, time_s, position_m: 0.0, by_force: false })
            .collect();
        let (ruptures, is_false) = match_ruptures(&truth, &trace.detections);
        all.ruptures += ruptures.len();
        all.missed += ruptures.iter().filter(|r| r.detected_s.is_none()).count();
        all.false_alarms += is_false.iter().filter(|f| **f).count();
        all.delays_s.extend(ruptures.iter().filter_map(|r| r.delay_s));
    }
    all
}
