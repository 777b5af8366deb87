//! `stylet diagnose`: compare what a scenario believes with what was measured.

use crate::args::DiagnoseArgs;
use crate::exit::Failure;
use crate::terminal::teller;
use std::fmt::Write as _;
use stylet_api::folder::settle_beside;
use stylet_api::{Inputs, need};
use stylet_diagnose::Diagnosis;
use stylet_pages::diagnosis::{differ, sentence};
use stylet_report::significant;
use stylet_scenario::Scenario;

impl DiagnoseArgs {
    /// What the diagnosis is made of.
    pub fn inputs(&self) -> Inputs {
        Inputs {
            scenario: self.scenario.clone(),
            data: self.data.clone(),
            columns: self.columns.clone(),
            repair: self.repair,
        }
    }
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    // It may be what an earlier diagnosis extended.
    settle_beside(&args.scenario)?;
    if args.repeats || stylet_diagnose::set::dataset::is_dataset(&args.scenario)? {
        return crate::repeats::diagnose(args);
    }
    if args.data.is_empty() {
        return Err(Failure::Check(
            "no recordings: name them with --data A.csv B.csv, or give a data set in place of the scenario"
                .to_owned(),
        ));
    }
    let scenario = Scenario::load(&args.scenario)?;
    args.limits.allow(&args.scenario, &need::of_diagnose(&args.data), args.results.quiet)?;
    let inputs = args.inputs();
    let tell = teller(args.results.quiet, " ...");
    let found = stylet_api::diagnose(&scenario, &inputs.evidence()?, tell)?;
    let folder = args.results.folder(&args.scenario, "-diagnosis");
    args.results.conclude(&folder, &found.output(&scenario, &inputs)?, || summary(&found.diagnosis))
}

fn summary(d: &Diagnosis) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", sentence(d));
    for c in &d.causes {
        let _ = writeln!(out, "\n  {}, confidence {}", c.effect, significant(c.confidence, 3));
        for (path, e) in &c.parameters {
            let _ = writeln!(
                out,
                "    {path} = {} (95 %: {} to {})",
                significant(e.value, 4),
                significant(e.low, 4),
                significant(e.high, 4)
            );
        }
        if !c.equivalent.is_empty() {
            let _ = writeln!(out, "    as good: {}", c.equivalent.join(", "));
        }
    }
    let g = &d.gain;
    let what = if g.held_out {
        "on recordings left out of the fit"
    } else {
        "on the one recording, which was also fitted"
    };
    let _ = writeln!(
        out,
        "\n  residual {what}: {} N before, {} N after, noise {} N",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        significant(g.floor_n, 3)
    );
    if let Some(differ) = differ(d) {
        let _ = writeln!(out, "  {differ}");
    }
    if d.leftover.p_value < 1e-3 {
        let _ = writeln!(
            out,
            "  what remains still depends on {} ({})",
            d.leftover.depends_on.join(", "),
            stylet_report::chance(d.leftover.p_value)
        );
    }
    let imitated = d.traces.iter().filter(|t| t.why == stylet_diagnose::IMITATED);
    let imitated: Vec<&str> = imitated.map(|t| t.effect.as_str()).collect();
    if !imitated.is_empty() {
        let _ =
            writeln!(out, "  the library's nearest, which may only look like it: {}", imitated.join(", "));
    }
    if !d.invisible.is_empty() {
        let _ = writeln!(out, "  these recordings cannot show: {}", d.invisible.join(", "));
    }
    for q in &d.data_quality {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}
