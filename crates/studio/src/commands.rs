//! The command line and the Python lines that repeat what the page did.

use crate::messages::CommandView;
use std::path::{Path, PathBuf};
use stylet_api::{DiagnosisInputs, OutputFiles};

/// A word for the shell.
fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

fn path(path: &Path) -> String {
    word(&path.display().to_string())
}

fn paths(paths: &[PathBuf]) -> String {
    paths.iter().map(|p| path(p)).collect::<Vec<_>>().join(" ")
}

/// A text for Python.
fn text(of: &Path) -> String {
    format!("{:?}", of.display().to_string())
}

fn list(of: &[PathBuf]) -> String {
    format!("[{}]", of.iter().map(|p| text(p)).collect::<Vec<_>>().join(", "))
}

pub fn written(folder: &Path, output: &OutputFiles) -> Vec<String> {
    output.files().map(|(name, _)| folder.join(name).display().to_string()).collect()
}

fn command(shell: String, python: String, files: Vec<String>) -> CommandView {
    CommandView { shell, python: format!("import stylet\n{python}"), files }
}

/// `--columns FILE`, and the same for Python.
fn columns(file: Option<&Path>) -> (String, String) {
    file.map_or_else(Default::default, |f| {
        (format!(" --columns {}", path(f)), format!(", columns={}", text(f)))
    })
}

pub fn open_again(folder: &str) -> CommandView {
    let shell = format!("stylet studio --out {}", word(folder));
    CommandView {
        shell,
        python: "# the studio is a page; its files are the interface to Python".to_owned(),
        files: Vec::new(),
    }
}

pub fn run(scenario: &Path, folder: &Path, output: &OutputFiles) -> CommandView {
    command(
        format!("stylet run {} --out {}", path(scenario), path(folder)),
        format!("stylet.simulate({}).write({})", text(scenario), text(folder)),
        written(folder, output),
    )
}

pub fn enhance(
    data: &Path,
    map: Option<&Path>,
    config: Option<&Path>,
    folder: &Path,
    output: &OutputFiles,
) -> CommandView {
    let (shell_map, python_map) = columns(map);
    let shell_config = config.map(|c| format!(" --config {}", path(c))).unwrap_or_default();
    let python_config = config.map(|c| format!(", {}", text(c))).unwrap_or_default();
    command(
        format!("stylet enhance {}{shell_map}{shell_config} --out {}", path(data), path(folder)),
        format!("stylet.enhance(stylet.read_csv({}{python_map}){python_config}).plot()", text(data)),
        written(folder, output),
    )
}

pub fn diagnose(inputs: &DiagnosisInputs, folder: &Path, output: &OutputFiles) -> CommandView {
    let (shell_map, python_map) = columns(inputs.columns.as_deref());
    command(
        format!(
            "stylet diagnose {} --data {}{shell_map} --out {}",
            path(&inputs.scenario),
            paths(&inputs.data),
            path(folder)
        ),
        format!(
            "found = stylet.diagnose({}, {}{python_map})\nfound.write({})",
            text(&inputs.scenario),
            list(&inputs.data),
            text(folder)
        ),
        written(folder, output),
    )
}

pub fn plan(inputs: &DiagnosisInputs, limits: &Path, motion: &Path) -> CommandView {
    let (shell_map, python_map) = columns(inputs.columns.as_deref());
    let data =
        if inputs.data.is_empty() { String::new() } else { format!(" --data {}", paths(&inputs.data)) };
    command(
        format!(
            "stylet plan {}{data}{shell_map} --limits {} --quick --out {}",
            path(&inputs.scenario),
            path(limits),
            path(motion)
        ),
        format!(
            "plan = stylet.plan({}, {}, limits={}{python_map}, simulated=False)",
            text(&inputs.scenario),
            list(&inputs.data),
            text(limits)
        ),
        ["ron", "json", "html"].map(|end| motion.with_extension(end).display().to_string()).to_vec(),
    )
}

pub fn predict(model: &Path, inputs: &DiagnosisInputs, folder: &Path, output: &OutputFiles) -> CommandView {
    let (shell_map, python_map) = columns(inputs.columns.as_deref());
    command(
        format!(
            "stylet predict {} --data {}{shell_map} --out {}",
            path(model),
            paths(&inputs.data),
            path(folder)
        ),
        format!(
            "found.predict(stylet.read_csv({}{python_map}))   # `found` of stylet.diagnose",
            inputs.data.first().map(|d| text(d)).unwrap_or_default()
        ),
        written(folder, output),
    )
}
