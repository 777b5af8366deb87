//! The command line and the Python lines that reproduce the actions of the page.

use crate::messages::CommandView;
use std::path::{Path, PathBuf};
use stylet_api::{DiagnosisInputs, OutputFiles};

/// Quotes a word for the shell.
fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// `stylet NAME`, with the options that have values.
fn shell(name: &str, options: &[(&str, &[&Path])]) -> String {
    let mut line = format!("stylet {name}");
    for (option, values) in options.iter().filter(|(_, values)| !values.is_empty()) {
        let words = values.iter().map(|value| word(&value.display().to_string()));
        let option = (!option.is_empty()).then(|| (*option).to_owned());
        option.into_iter().chain(words).for_each(|word| line += &format!(" {word}"));
    }
    line
}

/// A Python string literal.
fn text(of: &Path) -> String {
    format!("{:?}", of.display().to_string())
}

fn list(of: &[PathBuf]) -> String {
    format!("[{}]", of.iter().map(|p| text(p)).collect::<Vec<_>>().join(", "))
}

/// `, columns=FILE` for Python, when there is a map.
fn columns(map: Option<&Path>) -> String {
    map.map_or_else(String::new, |map| format!(", columns={}", text(map)))
}

pub fn written(folder: &Path, output: &OutputFiles) -> Vec<String> {
    output.files().map(|(name, _)| folder.join(name).display().to_string()).collect()
}

fn command(shell: String, python: &str, files: Vec<String>) -> CommandView {
    CommandView { shell, python: format!("import stylet\n{python}"), files }
}

pub fn open_again(folder: &Path) -> CommandView {
    let python = "# the studio is a page; its files are the interface to Python".to_owned();
    CommandView { shell: shell("studio", &[("--out", &[folder])]), python, files: Vec::new() }
}

pub fn run(scenario: &Path, folder: &Path, output: &OutputFiles) -> CommandView {
    command(
        shell("run", &[("", &[scenario]), ("--out", &[folder])]),
        &format!("stylet.simulate({}).write({})", text(scenario), text(folder)),
        written(folder, output),
    )
}

pub fn enhance(data: &Path, map: Option<&Path>, config: Option<&Path>, folder: &Path) -> CommandView {
    let config_text = config.map_or_else(String::new, |c| format!(", {}", text(c)));
    command(
        shell(
            "enhance",
            &[
                ("", &[data]),
                ("--columns", map.as_slice()),
                ("--config", config.as_slice()),
                ("--out", &[folder]),
            ],
        ),
        &format!("stylet.enhance(stylet.read_csv({}{}){config_text}).plot()", text(data), columns(map)),
        Vec::new(),
    )
}

/// A command on a scenario and recordings, with these further options.
fn on_data(name: &str, scenario: &Path, inputs: &DiagnosisInputs, further: &[(&str, &[&Path])]) -> String {
    let data: Vec<&Path> = inputs.data.iter().map(PathBuf::as_path).collect();
    let map = inputs.columns.as_deref();
    let options: [(&str, &[&Path]); 3] =
        [("", &[scenario]), ("--data", data.as_slice()), ("--columns", map.as_slice())];
    shell(name, &[&options, further].concat())
}

pub fn diagnose(inputs: &DiagnosisInputs, folder: &Path, output: &OutputFiles) -> CommandView {
    let (scenario, data) = (text(&inputs.scenario), list(&inputs.data));
    let map = columns(inputs.columns.as_deref());
    command(
        on_data("diagnose", &inputs.scenario, inputs, &[("--out", &[folder])]),
        &format!("found = stylet.diagnose({scenario}, {data}{map})\nfound.write({})", text(folder)),
        written(folder, output),
    )
}

pub fn plan(inputs: &DiagnosisInputs, limits: &Path, motion: &Path) -> CommandView {
    let (scenario, data) = (text(&inputs.scenario), list(&inputs.data));
    let (map, limits_text) = (columns(inputs.columns.as_deref()), text(limits));
    let further: [(&str, &[&Path]); 2] = [("--limits", &[limits]), ("--quick --out", &[motion])];
    command(
        on_data("plan", &inputs.scenario, inputs, &further),
        &format!("plan = stylet.plan({scenario}, {data}, limits={limits_text}{map}, simulated=False)"),
        ["ron", "json", "html"].map(|end| motion.with_extension(end).display().to_string()).to_vec(),
    )
}

pub fn predict(model: &Path, inputs: &DiagnosisInputs, folder: &Path, output: &OutputFiles) -> CommandView {
    let data = inputs.data.first().map(|d| text(d)).unwrap_or_default();
    let map = columns(inputs.columns.as_deref());
    command(
        on_data("predict", model, inputs, &[("--out", &[folder])]),
        &format!("found.predict(stylet.read_csv({data}{map}))   # `found` of stylet.diagnose"),
        written(folder, output),
    )
}
