//! `stylet gate`: compares scores with bounds and a baseline; exit code 1 if a bound is violated.

use super::thread_pool::with_threads;
use crate::cli::args::GateArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::print;
use std::fmt::Write as _;
use std::path::Path;
use stylet_api::output_files::to_json_bytes;
use stylet_api::output_folder::{check_own_file, write_file_atomically};
use stylet_sweep::score_gate::{
    Baseline, GateResult, baseline, baseline_changes, describe_result, junit_xml, load,
};

/// The command.
///
/// # Errors [`Failure::Gate`] if a bound is violated, others if an input is wrong.
pub fn gate(args: &GateArgs) -> Result<(), Failure> {
    let gates = load(&args.gates, args.seed)?;
    let at = args.baseline.clone().unwrap_or_else(|| args.gates.with_extension("baseline.json"));
    let old = read(&at)?;
    check_outputs(args, &at)?;
    let progress = Progress::new(gates.iter().map(|g| g.trials()).sum(), "trials", args.quiet);
    let judged: Vec<GateResult> = with_threads(args.threads.unwrap_or(0), || {
        let all: Result<Vec<Vec<GateResult>>, _> =
            gates.iter().map(|gate| gate.run(&|n| progress.advance(n))).collect();
        all.map(|all| all.concat())
    })??;
    progress.finish();
    let mut text = String::new();
    let mut heading = String::new();
    for j in judged.iter().filter(|j| !(args.quiet && j.passed)) {
        if j.gate != heading {
            heading.clone_from(&j.gate);
            let _ = writeln!(text, "{heading}");
        }
        let _ = writeln!(text, "  {} {}", if j.passed { "pass" } else { "FAIL" }, describe_result(j));
    }
    let new = baseline(&judged);
    if args.update {
        write_file_atomically(&at, &to_json_bytes(&new)?)?;
    }
    if !args.quiet {
        text.push_str(&baseline_comparison(old.as_ref(), &new, &at, args.update));
    }
    if let Some(path) = &args.junit {
        write_file_atomically(path, junit_xml(&judged).as_bytes())?;
    }
    if let Some(path) = &args.json {
        write_file_atomically(path, &to_json_bytes(&judged)?)?;
    }
    let printed = if text.is_empty() { Ok(()) } else { print(&text) };
    let failed = judged.iter().filter(|j| !j.passed).count();
    // A violated bound takes precedence over an output that cannot be printed.
    if failed > 0 { Err(Failure::Gate { failed, of: judged.len() }) } else { printed }
}

/// Checks before the trials that the results replace no foreign files.
fn check_outputs(args: &GateArgs, baseline: &Path) -> Result<(), Failure> {
    let inputs = [args.gates.as_path(), baseline];
    if args.update {
        // A file that is not a baseline was rejected when it was read.
        check_own_file(baseline, &inputs[..1], None, |_| true)?;
    }
    if let Some(junit) = &args.junit {
        let own = b"<testsuite name=\"stylet gate\"";
        check_own_file(junit, &inputs, None, |bytes| bytes.windows(own.len()).any(|part| part == own))?;
    }
    if let Some(json) = &args.json {
        check_own_file(json, &inputs, None, is_gate_results)?;
    }
    Ok(())
}

/// A list of results that an earlier gate has written.
fn is_gate_results(bytes: &[u8]) -> bool {
    let results: Vec<serde_json::Value> = serde_json::from_slice(bytes).unwrap_or_default();
    let keys = ["gate", "score", "statistic", "passed"];
    !results.is_empty() && results.iter().all(|result| keys.iter().all(|key| result.get(key).is_some()))
}

/// The differences from the baseline, and whether it was replaced.
fn baseline_comparison(old: Option<&Baseline>, new: &Baseline, at: &Path, updated: bool) -> String {
    let at = at.display();
    let mut text = String::new();
    if let Some(old) = old {
        let changes = baseline_changes(old, new);
        if changes.is_empty() {
            let _ = writeln!(text, "No value differs from {at}.");
        } else {
            let _ = writeln!(text, "Against {at}:");
            for line in changes {
                let _ = writeln!(text, "  {line}");
            }
        }
    } else if !updated {
        let _ = writeln!(text, "There is no baseline {at}; --update writes one.");
    }
    if updated {
        let _ = writeln!(text, "{at} is the baseline now.");
    }
    text
}

fn read(path: &Path) -> Result<Option<Baseline>, Failure> {
    if !path.exists() {
        return Ok(None);
    }
    let wrong = |why: String| {
        Failure::Check(format!("{}: is no baseline: {why}; replace it with --update", path.display()))
    };
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    serde_json::from_slice(&bytes).map(Some).map_err(|e| wrong(e.to_string()))
}
