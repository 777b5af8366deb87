//! Peers written in other languages, run in the same benchmark so that ratios mean something.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Python with the peers installed: `$STYLET_PEERS_PYTHON`, or what `benches/peers/setup.sh` made.
pub fn python() -> Option<PathBuf> {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers/bin/python");
    std::env::var_os("STYLET_PEERS_PYTHON").map(PathBuf::from).or(Some(made)).filter(|p| p.exists())
}

/// Runs a script of `benches/peers` and returns the number it prints.
pub fn number(script: &str, arguments: &[&Path]) -> Option<f64> {
    let Some(python) = python() else {
        println!("SKIPPED: no Python peers; run benches/peers/setup.sh first");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers").join(script);
    let output = Command::new(python).arg(&script).args(arguments).output().ok()?;
    if !output.status.success() {
        println!("SKIPPED: {} failed: {}", script.display(), String::from_utf8_lossy(&output.stderr));
        return None;
    }
    String::from_utf8_lossy(&output.stdout).trim().parse().ok()
}
