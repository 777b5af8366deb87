//! `stylet studio`: the local page.

use crate::cli::args::StudioArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::{print, print_error};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use stylet_studio::{Server, Studio};

/// Runs the command until it is interrupted.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn studio(args: &StudioArgs) -> Result<(), Failure> {
    let folder = args.out.clone().unwrap_or_else(new_folder);
    let studio = Studio::open(&folder, &args.files).map_err(|problem| Failure::Check(problem.error))?;
    let server = Server::start(studio, args.port).map_err(|why| {
        Failure::Check(format!("--port {}: cannot serve there: {why}; try --port 0", args.port))
    })?;
    let url = server.url();
    print(&format!(
        "Stylet Studio: {url}\nworkspace: {} (stylet studio --out {} opens it again)\nCtrl-C ends it.\n",
        folder.display(),
        folder.display()
    ))?;
    if !args.no_open && !open_browser(&url) {
        print_error("no browser could be started: open the address above\n");
    }
    let (ended, end) = channel();
    // The first signal ends it.
    ctrlc::set_handler(move || ended.send(()).unwrap_or_default()).map_err(Failure::internal)?;
    end.recv().map_err(Failure::internal)
}

/// The first folder `stylet-out/studio`, `stylet-out/studio-2`, ... that does not exist.
fn new_folder() -> PathBuf {
    let named = |number: u64| match number {
        1 => Path::new("stylet-out").join("studio"),
        _ => Path::new("stylet-out").join(format!("studio-{number}")),
    };
    (1..).map(named).find(|folder| !folder.exists()).unwrap_or_else(|| named(1))
}

/// Opens an address in the user's browser; false when there is none.
fn open_browser(url: &str) -> bool {
    let (program, before): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("rundll32", &["url.dll,FileProtocolHandler"])
    } else {
        ("xdg-open", &[])
    };
    Command::new(program)
        .args(before)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .is_ok()
}
