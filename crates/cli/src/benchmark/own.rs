//! `stylet benchmark diagnose --world own`: cases drawn with the diagnosis' own law, for comparison with older tables.

use crate::args::BenchmarkDiagnoseArgs;
use crate::exit::Failure;
use rayon::prelude::*;
use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use stylet_diagnose::benchmark::{Result as Case, run, summary};
use stylet_diagnose::hidden::sketch;

/// The command in this world.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &BenchmarkDiagnoseArgs) -> Result<(), Failure> {
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-diagnose-own-{}", args.cases.seed))
    });
    let failed = |why| Failure::Output { path: folder.display().to_string(), why };
    let _claim = stylet_api::Claim::new(&folder)?;
    let path = folder.join("cases.jsonl");
    let mut done: Vec<Case> = Vec::new();
    if let Ok(file) = std::fs::File::open(&path) {
        // A line that was cut off when the run was stopped is run again.
        done.extend(
            std::io::BufReader::new(file)
                .lines()
                .map_while(Result::ok)
                .filter_map(|l| serde_json::from_str(&l).ok()),
        );
    }
    let missing: Vec<u64> = (0..args.cases.cases).filter(|i| !done.iter().any(|d| d.index == *i)).collect();
    let kept: String = done.iter().filter_map(|d| serde_json::to_string(d).ok()).map(|l| l + "\n").collect();
    stylet_api::folder::write_file(&path, kept.as_bytes())?;
    let file = std::fs::OpenOptions::new().append(true).open(&path).map_err(failed)?;
    let file = Mutex::new((file, done.len()));
    let new: Vec<Option<Case>> = missing
        .par_iter()
        .map(|&index| {
            let case = run(index, &sketch(args.cases.seed, index))?;
            if let (Ok(mut file), Ok(line)) = (file.lock(), serde_json::to_string(&case)) {
                let _ = writeln!(file.0, "{line}");
                file.1 += 1;
                if file.1 % 20 == 0 {
                    crate::terminal::tell(&format!("  {} of {} cases\n", file.1, args.cases.cases));
                }
            }
            Some(case)
        })
        .collect();
    done.extend(new.into_iter().flatten());
    done.retain(|d| d.index < args.cases.cases);
    done.sort_by_key(|d| d.index);
    let text = summary(&done);
    stylet_api::folder::write_file(&folder.join("summary.txt"), text.as_bytes())?;
    crate::terminal::say(&format!("{text}\nCases: {}\n", path.display()))
}
