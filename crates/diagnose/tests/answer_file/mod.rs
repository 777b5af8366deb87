//! Results kept in a text file, and their comparison with the current ones.

#![allow(dead_code, reason = "every test uses a part")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use stylet_diagnose::diagnosis_json::Diagnosis;

/// Relative tolerance: what a reader of three digits notices.
const RELATIVE_TOLERANCE: f64 = 1e-2;
/// Smaller numbers count as zero.
const ZERO: f64 = 1e-9;

/// Serialises writing.
static FILE: Mutex<()> = Mutex::new(());

/// Lines of one case: path and value.
#[derive(Default)]
pub struct AnswerLines(Vec<String>);

impl AnswerLines {
    /// A number, to three digits.
    pub fn number(&mut self, path: &str, x: f64) {
        self.0.push(format!("{path} {}", digits(x)));
    }

    /// A text.
    pub fn words(&mut self, path: &str, text: &str) {
        self.0.push(format!("{path} {}", text.split_whitespace().collect::<Vec<_>>().join(" ")));
    }

    /// Several numbers on one line.
    pub fn numbers(&mut self, path: &str, all: &[f64]) {
        let all: Vec<String> = all.iter().map(|x| digits(*x)).collect();
        self.0.push(format!("{path} {}", all.join(" ")));
    }

    /// Verdict, effects and parameters of a diagnosis.
    pub fn diagnosis(&mut self, found: &Diagnosis) {
        self.words("verdict", &format!("{:?}", found.verdict).to_lowercase());
        for cause in &found.causes {
            self.words("cause", &cause.effect);
            for (path, estimate) in &cause.parameters {
                self.number(&format!("{}.{path}", cause.effect), estimate.value);
            }
        }
        found.negligible.iter().for_each(|n| self.words("negligible", &n.effect));
        for b in &found.base_parameters {
            self.number(&format!("layer {}.{}", b.layer, b.name), b.value);
        }
    }

    /// Compares with the recorded section of this name, or records it when `STYLET_RECORD` is set.
    pub fn compare(self, file: &str, name: &str) {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests").join(file);
        if std::env::var_os("STYLET_RECORD").is_some() {
            let _one = FILE.lock().unwrap_or_else(|e| e.into_inner());
            let mut kept = sections(&std::fs::read_to_string(&path).unwrap_or_default());
            kept.insert(name.to_owned(), self.0);
            let mut text = String::new();
            for (name, lines) in kept {
                let _ = writeln!(text, "[{name}]\n{}\n", lines.join("\n"));
            }
            std::fs::write(&path, text).expect("the file of recorded answers");
            return;
        }
        let kept = sections(&std::fs::read_to_string(&path).expect("the file of recorded answers"));
        let kept = kept.get(name).expect("recorded under this name");
        let differ: Vec<String> = (0..kept.len().max(self.0.len()))
            .map(|k| (kept.get(k).map_or("", String::as_str), self.0.get(k).map_or("", String::as_str)))
            .filter(|(was, is)| !lines_agree(was, is))
            .map(|(was, is)| format!("  was {was}\n  is  {is}"))
            .take(12)
            .collect();
        assert!(differ.is_empty(), "{name}: results changed\n{}", differ.join("\n"));
    }
}

fn digits(x: f64) -> String {
    if x == 0.0 || x.abs() < ZERO { "0".to_owned() } else { format!("{x:.2e}") }
}

fn sections(text: &str) -> BTreeMap<String, Vec<String>> {
    let mut out: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut name = String::new();
    for line in text.lines().filter(|l| !l.is_empty()) {
        match line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            Some(next) => name = next.to_owned(),
            None => out.entry(name.clone()).or_default().push(line.to_owned()),
        }
    }
    out
}

/// Whether two lines agree, number by number and word by word.
fn lines_agree(was: &str, is: &str) -> bool {
    let (was, is): (Vec<&str>, Vec<&str>) = (was.split(' ').collect(), is.split(' ').collect());
    was.len() == is.len()
        && was.iter().zip(&is).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) if a.is_finite() && b.is_finite() => {
                (a - b).abs() <= RELATIVE_TOLERANCE * a.abs().max(b.abs()) + ZERO
            }
            _ => a == b,
        })
}
