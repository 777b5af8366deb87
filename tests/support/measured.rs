//! Recordings of measured insertions, which stay outside the repository.

use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

static SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// The folder of measured data named by `STYLET_MEASURED`, when it holds `part`; otherwise reports that `test` is skipped, of the `of` tests
/// in this file.
pub fn measured(test: &str, part: &str, of: usize) -> Option<PathBuf> {
    let folder = std::env::var_os("STYLET_MEASURED").map(PathBuf::from);
    let missing = match folder {
        Some(folder) if folder.join(part).is_dir() => return Some(folder),
        Some(folder) => format!("there is no {}", folder.join(part).display()),
        None => "STYLET_MEASURED is not set".to_owned(),
    };
    let skipped = SKIPPED.fetch_add(1, Ordering::Relaxed) + 1;
    // Not captured by the test harness.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED {skipped} of {of} tests on measured recordings: {test}: {missing}; set STYLET_MEASURED to the folder of the recordings"
    );
    None
}
