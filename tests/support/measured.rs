//! Recordings of measured insertions, which stay outside the repository.

use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

static SKIPPED: AtomicUsize = AtomicUsize::new(0);

/// The folder of measured data, when it holds `part`; else says loudly that `test` is skipped, and which of the
/// `of` tests in this file it is.
pub fn measured(test: &str, part: &str, of: usize) -> Option<PathBuf> {
    let folder = std::env::var_os("STYLET_MEASURED")
        .map_or_else(|| super::root().join("../shared/measured"), PathBuf::from);
    if folder.join(part).is_dir() {
        return Some(folder);
    }
    let skipped = SKIPPED.fetch_add(1, Ordering::Relaxed) + 1;
    // Not captured by the test harness.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED {skipped} of {of} tests on measured recordings: {test}: there is no {}; set STYLET_MEASURED to the folder that holds it",
        folder.join(part).display()
    );
    None
}
