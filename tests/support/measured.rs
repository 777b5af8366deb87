//! Access to measured recordings outside the repository.

use std::io::Write;
use std::path::PathBuf;

/// The folder that `STYLET_MEASURED` names if it contains `part`; otherwise prints that `test` is skipped.
pub fn measured(test: &str, part: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("STYLET_MEASURED").map(PathBuf::from);
    let reason = match &folder {
        None => "STYLET_MEASURED is not set".to_owned(),
        Some(folder) if !folder.join(part).is_dir() => format!("there is no {}", folder.join(part).display()),
        Some(_) => return folder,
    };
    // Written to stderr directly, because the test harness captures `eprintln!`.
    let _ = writeln!(std::io::stderr(), "{test}: skipped: {reason}");
    None
}
