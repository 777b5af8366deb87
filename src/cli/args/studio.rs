//! Arguments of `stylet studio`.

use clap::Args;
use std::path::PathBuf;

/// Arguments of `stylet studio`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet studio
  stylet studio log.csv
  stylet studio monday.csv tuesday.csv --out work/phantom
  stylet studio --out work/phantom --no-open --port 8080

Opens a page in the browser. Everything it does is a file in the workspace and a command that it shows. The
page is served to this computer only, at an address with a random token, and loads nothing from the network.")]
pub struct StudioArgs {
    /// Recordings to open; they are copied into the workspace.
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Port on this computer (0: any free one).
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    pub port: u16,
    /// Do not start a browser.
    #[arg(long)]
    pub no_open: bool,
    /// Folder of the workspace; one that exists is opened again [default: a new one, stylet-out/studio].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
