//! Arguments of `stylet completions` and `man`.

use clap::Args;

/// Arguments of `stylet completions`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet completions bash > ~/.local/share/bash-completion/completions/stylet
  stylet completions zsh > ~/.zfunc/_stylet
  stylet completions fish > ~/.config/fish/completions/stylet.fish")]
pub struct CompletionsArgs {
    /// Shell.
    pub shell: clap_complete::Shell,
}

/// Arguments of `stylet man`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet man | man -l -
  stylet man diagnose > stylet-diagnose.1")]
pub struct ManArgs {
    /// Command [default: stylet itself].
    pub command: Option<String>,
}
