//! `stylet completions` and `stylet man`: what a shell and a package need, from the definitions of the arguments.

use crate::cli::args::{Cli, CompletionsArgs, ManArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print;
use clap::CommandFactory;

/// Prints the completions for a shell.
///
/// # Errors
/// [`Failure`] when standard output cannot be written.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    print(&completions_for(args.shell))
}

fn completions_for(shell: clap_complete::Shell) -> String {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "stylet", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

/// Prints the manual page of a command.
///
/// # Errors
/// [`Failure::Check`] for a command that does not exist.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    print(&manual_page(args.command.as_deref())?)
}

fn manual_page(name: Option<&str>) -> Result<String, Failure> {
    let mut command = Cli::command();
    command.build();
    if let Some(name) = name {
        let found = command.get_subcommands().find(|c| c.get_name() == name).cloned();
        let found = found.ok_or_else(|| {
            Failure::Check(format!("there is no command `{name}`; `stylet --help` lists them"))
        })?;
        command = found.display_name(format!("stylet-{name}"));
    }
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text).map_err(Failure::internal)?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn every_command_has_a_manual_page_and_completions_in_every_shell() {
        let names: Vec<String> = Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
        let completions: Vec<String> =
            clap_complete::Shell::value_variants().iter().map(|shell| completions_for(*shell)).collect();
        for name in &names {
            let page = manual_page(Some(name)).expect("a page");
            assert!(page.contains(&format!("stylet\\-{}", name.replace('-', "\\-"))), "{name}: {page}");
            assert!(completions.iter().all(|text| text.contains(name.as_str())), "{name}");
        }
        assert!(names.len() > 15 && manual_page(None).expect("a page").contains("medical device"));
        assert!(manual_page(Some("diagnos")).is_err());
    }
}
