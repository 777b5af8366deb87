//! A command that forks before it writes its results, so that a fault can be injected at any call. See `shim.c`.

use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};

/// The library that injects the faults, compiled into `folder`; `None`, with a message, where there is no `cc`.
pub fn shim(folder: &Path) -> Option<PathBuf> {
    preloaded(folder, "shim")
}

/// The library of `tests/disk_faults/NAME.c`, if there is a compiler.
pub fn preloaded(folder: &Path, name: &str) -> Option<PathBuf> {
    let library = folder.join(format!("{name}.so"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/disk_faults/{name}.c"));
    let made = Command::new("cc")
        .args(["-O1", "-shared", "-fPIC", "-o"])
        .args([&library, &source])
        .arg("-ldl")
        .status();
    match made {
        Ok(status) => {
            assert!(status.success(), "tests/disk_faults/{name}.c compiles");
            Some(library)
        }
        Err(why) => {
            let _ = writeln!(std::io::stderr(), "SKIPPED faults: cc does not run: {why}");
            None
        }
    }
}

/// Outcome of a child process.
pub struct Outcome {
    pub status: ExitStatus,
    /// Calls that change the disk.
    pub calls: u64,
    /// What the fault hit; empty when there was none.
    pub hit: String,
    /// Standard error in one line.
    pub stderr_text: String,
}

pub struct Server {
    child: Child,
    orders: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    stderr_text: PathBuf,
}

impl Server {
    /// Starts the command; it stops before the first change of the disk at or below `out`.
    pub fn new(shim: &Path, out: &Path, arguments: &[String]) -> Self {
        let stderr_text = out.with_extension("stderr");
        let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(arguments)
            .env("NO_COLOR", "1")
            .env("RAYON_NUM_THREADS", "1")
            .env("LD_PRELOAD", shim)
            .env("STYLET_FAULT_BELOW", out)
            .env("STYLET_FAULT_STDERR", &stderr_text)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let orders = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().expect("a pipe"));
        Self { child, orders, answers, stderr_text }
    }

    /// Continues the command, with a fault of this `mode` at its call number `at`.
    pub fn strike(&mut self, mode: char, at: u64) -> Outcome {
        let orders = self.orders.as_mut().expect("a pipe");
        writeln!(orders, "{mode} {at}").and_then(|()| orders.flush()).expect("it waits for orders");
        let mut line = String::new();
        self.answers.read_line(&mut line).expect("an answer");
        let mut words = line.trim_end().splitn(3, ' ');
        let status = words.next().and_then(|w| w.parse().ok()).expect("a status");
        let calls = words.next().and_then(|w| w.parse().ok()).expect("a number of calls");
        let stderr_text = std::fs::read(&self.stderr_text).unwrap_or_default();
        let stderr_text = String::from_utf8_lossy(&stderr_text).replace('│', " ");
        Outcome {
            status: ExitStatus::from_raw(status),
            calls,
            hit: words.next().unwrap_or_default().to_owned(),
            stderr_text: stderr_text.split_whitespace().collect::<Vec<_>>().join(" "),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // No more orders: it ends.
        drop(self.orders.take());
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.stderr_text);
    }
}
