//! `stylet sweep map`: the robustness map of several sweeps, as a table on the terminal and as SVG.

use super::args::MapArgs;
use super::with_threads;
use crate::exit::Failure;
use crate::progress::Progress;
use std::fmt::Write as _;
use stylet_pages::sweep::map_svg;
use stylet_sweep::{Columns, MapRow, Overrides, Sweep, map_rows, rows};

/// The command.
pub fn map(args: &MapArgs) -> Result<(), Failure> {
    let overrides = Overrides { trials: args.trials, seed: None };
    let sweeps: Vec<Sweep> =
        args.sweeps.iter().map(|file| Sweep::load(file, overrides)).collect::<Result<_, _>>()?;
    let progress = Progress::new(sweeps.iter().map(Sweep::trials).sum(), "trials", false);
    let mut map = Vec::new();
    for sweep in &sweeps {
        let columns = Columns::new(sweep);
        let rows = with_threads(0, || rows(sweep, &columns, 0..sweep.trials(), &|n| progress.advance(n)))??;
        map.push((sweep.name.clone(), map_rows(sweep, &columns, &rows)));
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
    let map: Vec<MapRow> = map.into_iter().flat_map(|(_, rows)| rows).collect();
    stylet_api::folder::write_file(&args.svg, map_svg(&map).as_bytes())?;
    crate::terminal::say(&format!("{text}{}\n", args.svg.display()))
}
