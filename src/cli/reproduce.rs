//! `stylet reproduce`: figures and claims of the paper.

use crate::cli::args::ReproduceArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::print;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;
use stylet_api::OutputFiles;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn reproduce(args: &ReproduceArgs) -> Result<(), Failure> {
    let folder = args.results.output_folder(Path::new("reproduce"), "");
    let started = Instant::now();
    let plan = stylet_reproduce::plan(args.first_seed, args.seeds);
    let progress = Progress::new(plan.recording_count(), "recordings", args.results.quiet);
    let made = stylet_reproduce::reproduce(&plan, &|| progress.advance(1));
    progress.finish();
    let made = made.map_err(Failure::internal)?;
    let mut output = OutputFiles::default();
    let mut text = String::new();
    for claim in &made.claims {
        let _ = writeln!(
            text,
            "({}) {}: {}\n    {}",
            claim.id,
            claim.claim,
            claim.verdict.as_str(),
            claim.reason
        );
    }
    output.add("claims.json", made.claims_json);
    output.add("switches.json", made.switches_json);
    for (name, svg) in made.pictures {
        output.add(name, svg);
    }
    output.add("index.html", made.html);
    output.write(&folder)?;
    if !args.results.quiet {
        let _ = writeln!(
            text,
            "\n{} noise seeds, {} recordings, {} runs of the algorithm in {:.0} s\nPage: {}",
            args.seeds,
            plan.recording_count(),
            plan.run_count(),
            started.elapsed().as_secs_f64(),
            folder.join("index.html").display()
        );
        print(&text)?;
    }
    Ok(())
}
