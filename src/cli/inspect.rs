//! `stylet inspect`: contents of a file.

use crate::cli::args::InspectArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::{print, print_error};
use crate::cli::text_plot::plot;
use std::fmt::Write as _;
use stylet_api::output_folder::write_file_atomically;
use stylet_record::inspect::{InspectOptions, Inspection};
use stylet_record::{RecordError, inspect_and_read};
use stylet_report::significant;

/// Columns that the terminal lists.
const MAX_COLUMNS: usize = 40;
/// Findings that the terminal lists.
const MAX_FINDINGS: usize = 30;
/// Size of a plot in characters.
const PLOT: (usize, usize) = (64, 6);

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let options =
        InspectOptions { columns: stylet_api::read_options(args.columns.as_deref(), false)?.columns };
    if let Some(map) = &options.columns {
        map.check()?;
    }
    let (mut inspections, mut failed): (Vec<Inspection>, Vec<RecordError>) = (Vec::new(), Vec::new());
    for file in &args.files {
        match inspect_and_read(file, &options) {
            Ok(inspection) => {
                if !args.json {
                    print(&summary(&inspection, args))?;
                }
                inspections.push(inspection);
            }
            Err(error) => failed.push(error),
        }
    }
    if args.json {
        let json = match inspections.as_slice() {
            [one] if args.files.len() == 1 => serde_json::to_string_pretty(one),
            several => serde_json::to_string_pretty(several),
        };
        print(&(json.map_err(Failure::internal)? + "\n"))?;
    }
    if let Some(path) = &args.page {
        let page = stylet_report::pages::inspection::page(&inspections);
        write_file_atomically(path, page.to_html().as_bytes())?;
    }
    if let (Some(path), Some(first)) = (&args.write_map, inspections.first()) {
        write_file_atomically(path, first.to_ron().as_bytes())?;
        if !args.json {
            print(&format!("map written to {}: use it with --columns {}\n", path.display(), path.display()))?;
        }
    }
    let last = failed.pop();
    for error in failed {
        print_error(&format!("{error}\n"));
    }
    last.map_or(Ok(()), |error| Err(error.into()))
}

fn summary(inspection: &Inspection, args: &InspectArgs) -> String {
    let mut out = format!("{}\n", inspection.path.display());
    let _ = writeln!(out, "  {}, {} bytes, {} rows", inspection.format, inspection.bytes, inspection.rows);
    if let Some(text) = &inspection.text {
        let line = |line: Option<u64>| line.map_or_else(|| "none".to_owned(), |line| format!("line {line}"));
        let _ = writeln!(
            out,
            "  {}, separated by {}, decimal sign '{}'; names: {}, units: {}, values from line {}",
            text.encoding,
            text.delimiter,
            text.decimal,
            line(text.names_line),
            line(text.units_line),
            text.data_line
        );
    }
    if let Some(sampling) = &inspection.sampling {
        let _ = writeln!(
            out,
            "  {} samples over {} s, {} Hz",
            sampling.samples,
            significant(sampling.duration_s, 4),
            significant(sampling.rate_hz, 3)
        );
    }
    let _ = writeln!(out, "\n  column  used as   unit   range");
    for column in inspection.columns.iter().take(MAX_COLUMNS) {
        let candidate = inspection.candidates.iter().find(|c| c.columns.contains(&column.number));
        let role = candidate.map_or("", |c| c.role.name());
        let unit = candidate.map(|c| c.unit.clone()).or_else(|| column.unit.clone()).unwrap_or_default();
        let range = column.range.map_or_else(
            || "no numbers".to_owned(),
            |(low, high)| format!("{} to {}", significant(low, 4), significant(high, 4)),
        );
        let sure = if candidate.is_some_and(|c| !c.certain) { "?" } else { "" };
        let _ = writeln!(
            out,
            "  {:>6}  {:<9} {unit:<6} {range:<24} {}",
            column.number,
            format!("{role}{sure}"),
            column.name
        );
    }
    if inspection.columns.len() > MAX_COLUMNS {
        let _ =
            writeln!(out, "  and {} more columns (--json lists all)", inspection.columns.len() - MAX_COLUMNS);
    }
    if !inspection.findings.is_empty() {
        out.push('\n');
    }
    for finding in inspection.findings.iter().take(MAX_FINDINGS) {
        let _ =
            writeln!(out, "  {}: {}", if finding.obstacle { "obstacle" } else { "remark" }, finding.message);
    }
    for (name, unit, y) in
        [("force", "N", &inspection.curves.force_n), ("position", "m", &inspection.curves.position_m)]
    {
        let drawn =
            plot(&inspection.curves.time_s, y, PLOT.0, PLOT.1, |v| format!("{} {unit}", significant(v, 3)));
        if !drawn.is_empty() && y.iter().any(|v| Some(v) != y.first()) {
            let _ = write!(out, "\n  {name}\n{drawn}");
        }
    }
    let file = inspection.path.display();
    let _ = match (inspection.is_readable(), inspection.map_needed, &args.columns) {
        (true, _, None) => writeln!(out, "\n  Every command reads this file as it is."),
        (true, _, Some(map)) => {
            writeln!(out, "\n  Every command reads this file with --columns {}.", map.display())
        }
        (false, true, _) if args.write_map.is_none() => {
            writeln!(
                out,
                "\n  Proposed column map (stylet inspect {file} --write-map map.ron):\n\n{}",
                inspection.map.to_ron()
            )
        }
        (false, true, _) => writeln!(out, "\n  Proposed column map:\n\n{}", inspection.map.to_ron()),
        (false, false, _) => writeln!(out, "\n  The obstacles need no column map."),
    };
    out
}
