//! `stylet compare-models`: whether two diagnoses found the same model.

use crate::cli::args::CompareModelsArgs;
use crate::cli::exit_codes::Failure;
use std::fmt::Write as _;
use stylet_api::compare_models::{compare_models, diagnosis_file};
use stylet_api::output_folder::check_folder;
use stylet_diagnose::model_consistency::Consistency;
use stylet_report::pages::model_consistency::summary_sentence;
use stylet_report::significant;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn run(args: &CompareModelsArgs) -> Result<(), Failure> {
    let folder = args.results.output_folder(&args.first, "-compared");
    let read = args.results.inputs(&diagnosis_file(&args.first), [&diagnosis_file(&args.second)]);
    check_folder(&folder, "consistency.json", &read)?;
    let (found, output) = compare_models(&args.first, &args.second)?;
    args.results.write_and_print(&folder, &output.with_inputs(read), || text(&found))
}

fn text(c: &Consistency) -> String {
    let mut out = format!("{}\n", summary_sentence(c));
    let _ = writeln!(
        out,
        "\n  {:<36} {:>10} {:>10} {:>12} {:>8}",
        "parameter", "first", "second", "difference", "sd"
    );
    for p in &c.parameters {
        let mark = if p.differs { "  differs" } else { "" };
        let _ = writeln!(
            out,
            "  {:<36} {:>10} {:>10} {:>12} {:>8}{mark}",
            p.parameter,
            significant(p.values[0], 4),
            significant(p.values[1], 4),
            significant(p.values[1] - p.values[0], 2),
            significant(p.sd, 2),
        );
    }
    out
}
