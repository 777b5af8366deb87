//! Comparison of online algorithms on the same insertions: replayed scenarios, and cases of the independent simulator.

use crate::benchmark::parse_word;
use crate::error::Error;
use crate::output_files::OutputFiles;
use stylet_core::EnhanceConfig;
use stylet_core::config::Algorithm;
use stylet_examine::{Case, CaseId, Hide, Plan, Severity, Size, World, Wrong};
use stylet_record::TrueRupture;
use stylet_scenario::Scenario;
use stylet_score::{Trace, match_ruptures};
use stylet_stats::parallel::*;
use stylet_sweep::algorithm_comparison::{ComparisonRow, DetectionCounts, algorithm_name, compare_algorithm};

/// The row of a scenario read from `file`, over this many noise seeds; `done` is called after each insertion.
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

/// All files that `stylet compare` writes, for rows of `seeds` insertions.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn output_files(rows: &[ComparisonRow], seeds: u64) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    output.add_json("compare.json", &rows)?;
    output.add("report.html", stylet_report::pages::algorithm_comparison::page(rows, seeds).to_html());
    Ok(output)
}

/// Cases that hide the same kind of departure: one row of the table per algorithm.
pub struct CaseGroup {
    name: String,
    cases: Vec<CaseId>,
}

/// One group of `cases` cases per word of `hide`, with this tissue model and seed, and without wrong assumptions.
///
/// # Errors
/// [`Error::Request`] for an unknown word, with the known ones.
pub fn case_groups(world: &str, hide: &[String], cases: u64, seed: u64) -> Result<Vec<CaseGroup>, Error> {
    let world = parse_word("--world", world, World::ALL, World::parse, World::as_str)?;
    hide.iter()
        .map(|word| {
            let hide = parse_word("--hide", word, Hide::BUILT_IN, Hide::parse, Hide::as_str)?;
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
    /// Simulates each case once and runs every algorithm on it; `done` is called with the number of insertions processed.
    ///
    /// # Errors
    /// [`Error::Internal`] when a case cannot be simulated.
    pub fn run_algorithms(
        &self,
        algorithms: &[Algorithm],
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<ComparisonRow>, Error> {
        // In the order of the cases, so that the bytes do not depend on the number of threads.
        let counts: Vec<Vec<DetectionCounts>> = self
            .cases
            .par_iter()
            .map(|id| {
                let case = stylet_examine::make_case(id)
                    .map_err(|e| Error::internal(format!("{}: {e}", id.name())))?;
                let counts = algorithms.iter().map(|a| count_detections(&case, *a)).collect();
                done(algorithms.len() as u64);
                Ok(counts)
            })
            .collect::<Result<_, Error>>()?;
        let row = |(k, algorithm): (usize, &Algorithm)| {
            let mut sum = DetectionCounts::default();
            for one in counts.iter().filter_map(|case| case.get(k)) {
                sum.missed += one.missed;
                sum.false_alarms += one.false_alarms;
                sum.ruptures += one.ruptures;
                sum.delays_s.extend(&one.delays_s);
            }
            ComparisonRow::new(&self.name, algorithm_name(*algorithm), self.cases.len() as u64, &sum)
        };
        Ok(algorithms.iter().enumerate().map(row).collect())
    }
}

/// Runs an algorithm on all recordings of a case and counts its detections.
fn count_detections(case: &Case, algorithm: Algorithm) -> DetectionCounts {
    let config = EnhanceConfig { algorithm, ..EnhanceConfig::default() };
    let surface_m = case.setup.assumed.surface_m;
    let mut all = DetectionCounts::default();
    for (named, insertion) in case.question.recordings.iter().zip(&case.insertions) {
        let recording = &named.recording;
        let trace = Trace::run(recording, &recording.force_n, &config, surface_m, |_, _| {});
        let last_s = recording.time_s.last().copied().unwrap_or(0.0);
        let truth: Vec<TrueRupture> = insertion
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
