//! `stylet compare`: several algorithms on the same simulated insertions.

use crate::cli::args::{AlgorithmArg, CompareArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use std::path::Path;
use stylet_api::compare_algorithms::{case_groups, compare_on_scenario, output_files};
use stylet_core::config::Algorithm;
use stylet_report::pages::formatting::significant_or_dash;
use stylet_scenario::Scenario;
use stylet_sweep::algorithm_comparison::ComparisonRow;

impl From<AlgorithmArg> for Algorithm {
    fn from(algorithm: AlgorithmArg) -> Self {
        match algorithm {
            AlgorithmArg::Paper => Self::Paper,
            AlgorithmArg::Literal => Self::Literal,
            AlgorithmArg::Stylet => Self::Stylet,
        }
    }
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let algorithms: Vec<Algorithm> = args.algorithms.iter().map(|algorithm| (*algorithm).into()).collect();
    let scenarios = args.scenarios.iter().map(|path| Scenario::load(path)).collect::<Result<Vec<_>, _>>()?;
    let groups = match &args.world {
        Some(world) => case_groups(world, &args.hide, args.seeds, args.seed)?,
        None => Vec::new(),
    };
    let progress = Progress::new(
        ((scenarios.len() + groups.len()) * algorithms.len()) as u64 * args.seeds,
        "insertions",
        args.results.quiet,
    );
    let done = |n| progress.advance(n);
    let mut rows = Vec::new();
    for (scenario, path) in scenarios.iter().zip(&args.scenarios) {
        for algorithm in &algorithms {
            rows.push(compare_on_scenario(
                scenario,
                &path.display().to_string(),
                *algorithm,
                args.seeds,
                &done,
            )?);
        }
    }
    for group in &groups {
        rows.extend(group.run_algorithms(&algorithms, &done)?);
    }
    progress.finish();
    let folder = args.results.output_folder(Path::new("compare"), "");
    args.results.write_and_print(&folder, &output_files(&rows, args.seeds)?, || {
        let head = format!(
            "{:44} {:8} {:>13} {:>13} {:>18} {:>9}  covered K b D band %",
            "", "", "missed/false", "delay ms", "K error %", "enh. %"
        );
        std::iter::once(head).chain(rows.iter().map(table_line)).collect::<Vec<_>>().join("\n")
    })
}

fn table_line(r: &ComparisonRow) -> String {
    let list =
        |v: &[Option<f64>]| v.iter().map(|x| significant_or_dash(*x, 100.0, 2)).collect::<Vec<_>>().join("/");
    let c = &r.coverage;
    let covered = [c.stiffness, c.friction, c.cumulative_friction, c.tip_force]
        .map(|x| significant_or_dash(x, 100.0, 3));
    format!(
        "{:44} {:8} {:>13} {:>13} {:>18} {:>9}  {}",
        r.scenario,
        r.algorithm,
        format!("{}/{} of {}", r.missed, r.false_alarms, r.ruptures),
        format!(
            "{}/{}",
            significant_or_dash(r.delay_s.median, 1e3, 2),
            significant_or_dash(r.delay_s.p95, 1e3, 2)
        ),
        list(&r.stiffness_error),
        significant_or_dash(r.enhancement_rms_relative, 100.0, 2),
        covered.join(" ")
    )
}
