//! `stylet gate`: bounds on scores, a baseline, exit code 1 when a bound does not hold.

use super::args::GateArgs;
use super::with_threads;
use crate::exit::Failure;
use crate::progress::Progress;
use std::path::{Path, PathBuf};
use stylet_sweep::gate::{Baseline, Judged, baseline, changes, describe, junit, load};

/// The command.
///
/// # Errors
/// [`Failure::Gate`] when a bound does not hold, others when an input is wrong.
pub fn gate(args: &GateArgs) -> Result<(), Failure> {
    let gates = load(&args.gates, args.seed)?;
    let at = args.baseline.clone().unwrap_or_else(|| args.gates.with_extension("baseline.json"));
    let old = read(&at)?;
    let progress = Progress::new(gates.iter().map(|g| g.trials()).sum(), "trials", false);
    let judged: Vec<Judged> = with_threads(args.threads.unwrap_or(0), || {
        let all: Result<Vec<Vec<Judged>>, _> =
            gates.iter().map(|gate| gate.judge(&|n| progress.advance(n))).collect();
        all.map(|all| all.concat())
    })??;
    progress.finish();
    let mut heading = String::new();
    for j in &judged {
        if j.gate != heading {
            heading.clone_from(&j.gate);
            println!("{heading}");
        }
        println!("  {} {}", if j.passed { "pass" } else { "FAIL" }, describe(j));
    }
    let new = baseline(&judged);
    if let Some(old) = &old {
        let changes = changes(old, &new);
        if changes.is_empty() {
            println!("No number differs from {}.", at.display());
        } else {
            println!("Against {}:", at.display());
            changes.iter().for_each(|line| println!("  {line}"));
        }
    } else if !args.update {
        println!("There is no baseline {}; --update writes one.", at.display());
    }
    if args.update {
        write(&at, &json(&new)?)?;
        println!("{} is the baseline now.", at.display());
    }
    if let Some(path) = &args.junit {
        write(path, junit(&judged).as_bytes())?;
    }
    if let Some(path) = &args.json {
        write(path, &json(&judged)?)?;
    }
    let failed = judged.iter().filter(|j| !j.passed).count();
    if failed > 0 { Err(Failure::Gate { failed, of: judged.len() }) } else { Ok(()) }
}

fn json(value: &impl serde::Serialize) -> Result<Vec<u8>, Failure> {
    let mut json = serde_json::to_vec_pretty(value).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    Ok(json)
}

fn read(path: &Path) -> Result<Option<Baseline>, Failure> {
    if !path.exists() {
        return Ok(None);
    }
    let wrong = |why: String| {
        Failure::Check(format!("{}: is no baseline: {why}; write it anew with --update", path.display()))
    };
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    serde_json::from_slice(&bytes).map(Some).map_err(|e| wrong(e.to_string()))
}

/// Beside its place, then renamed.
fn write(path: &PathBuf, content: &[u8]) -> Result<(), Failure> {
    let part = path.with_extension(format!("{}.part", std::process::id()));
    let failed = |why| {
        let _ = std::fs::remove_file(&part);
        Failure::Output { path: path.display().to_string(), why }
    };
    std::fs::write(&part, content).and_then(|()| std::fs::rename(&part, path)).map_err(failed)
}
