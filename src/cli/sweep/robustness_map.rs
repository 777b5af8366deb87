//! `stylet sweep map`: the robustness map of several sweeps, as a table on the terminal and as SVG.

use super::thread_pool::with_threads;
use crate::cli::args::MapArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_api::output_folder::check_own_file;
use stylet_report::pages::sweep::{MAP_TITLE, failure_map_svg};
use stylet_sweep::{Columns, FailureMapRow, Overrides, Sweep, failure_map_rows, run_trials};

/// Runs the sweeps, prints the failure rates and writes the map.
///
/// # Errors
/// [`Failure`] when a sweep is wrong or the picture cannot be written.
pub fn map(args: &MapArgs) -> Result<(), Failure> {
    let inputs: Vec<&Path> = args.sweeps.iter().map(PathBuf::as_path).collect();
    let own = |bytes: &[u8]| bytes.windows(MAP_TITLE.len()).any(|part| part == MAP_TITLE.as_bytes());
    check_own_file(&args.svg, &inputs, None, own)?;
    let overrides = Overrides { trials: args.trials, seed: None };
    let sweeps: Vec<Sweep> =
        args.sweeps.iter().map(|file| Sweep::load(file, overrides)).collect::<Result<_, _>>()?;
    let progress = Progress::new(sweeps.iter().map(Sweep::trials).sum(), "trials", false);
    let mut map = Vec::new();
    for sweep in &sweeps {
        let columns = Columns::new(sweep);
        let rows =
            with_threads(0, || run_trials(sweep, &columns, 0..sweep.trials(), &|n| progress.advance(n)))??;
        map.push((sweep.name.clone(), failure_map_rows(sweep, &columns, &rows)));
    }
    progress.finish();
    let mut text = String::new();
    for (name, rows) in &map {
        let _ = writeln!(text, "{name}");
        for row in rows {
            let cells: String = row.failed_percent.iter().map(|percent| format!("{percent:>4}")).collect();
            let _ = writeln!(text, "  {:<62}{cells} %", row.name);
        }
    }
    let map: Vec<FailureMapRow> = map.into_iter().flat_map(|(_, rows)| rows).collect();
    stylet_api::output_folder::write_file_atomically(&args.svg, failure_map_svg(&map).as_bytes())?;
    crate::cli::terminal_output::print(&format!("{text}{}\n", args.svg.display()))
}
