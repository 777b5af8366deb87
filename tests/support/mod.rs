//! The `stylet` binary and temporary folders for the integration tests.
#![allow(dead_code)]

pub mod measured;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The shortest insertion: two seconds into one layer.
pub const ONE_GEL: &str = r#"Scenario(
    name: "one gel",
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]),
    motion: Constant(start_m: -0.004, velocity_mps: 0.008, duration_s: 2.0),
    robot: Replay,
)"#;

/// A path as an argument.
pub fn text(path: &Path) -> String {
    path.to_str().expect("a path").to_owned()
}

/// A temporary folder, removed on drop.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(name: &str) -> Self {
        Self::below(&std::env::temp_dir(), name)
    }

    /// The same in memory, on systems that support it.
    pub fn in_memory(name: &str) -> Self {
        let memory = Path::new("/dev/shm");
        if memory.is_dir() { Self::below(memory, name) } else { Self::new(name) }
    }

    fn below(place: &Path, name: &str) -> Self {
        let folder = place.join(format!("stylet-test-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a scratch folder");
        Self(folder)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Writes a file and returns its path.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("a scratch file");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The repository's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A shipped scenario.
pub fn scenario(name: &str) -> PathBuf {
    root().join("scenarios").join(format!("{name}.ron"))
}

/// Runs `stylet` with arguments.
pub fn stylet<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(arguments)
        .env("NO_COLOR", "1")
        .output()
        .expect("the binary starts")
}

/// Standard error as text, without line breaks and frames.
pub fn stderr_text(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}
