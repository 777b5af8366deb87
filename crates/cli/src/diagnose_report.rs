//! The report of a diagnosis: what was measured, what the base law cannot say, why, and what it gains.

use crate::args::DiagnoseArgs;
use crate::diagnose::sentence;
use stylet_diagnose::Examined;
use stylet_report::{Page, Section};
use stylet_scenario::Scenario;

/// The page.
pub fn page(scenario: &Scenario, _args: &DiagnoseArgs, examined: &Examined) -> Page {
    let d = &examined.diagnosis;
    Page::new(format!("Diagnosis: {}", scenario.name)).section(Section::new("Verdict").text(sentence(d)))
}
