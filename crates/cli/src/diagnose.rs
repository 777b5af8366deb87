//! `stylet diagnose`: compare what a scenario believes with what was measured.

use crate::args::DiagnoseArgs;
use crate::diagnose_report;
use crate::exit::Failure;
use crate::limits;
use crate::output::Output;
use crate::terminal::say;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use stylet_diagnose::Diagnosis;
use stylet_diagnose::outcome::Verdict;
use stylet_record::ReadOptions;
use stylet_report::significant;
use stylet_scenario::Scenario;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    if args.repeats || stylet_diagnose::set::dataset::is_dataset(&args.scenario)? {
        return crate::sets::diagnose(args);
    }
    if args.data.is_empty() {
        return Err(Failure::Argument(
            "no recordings: name them with --data A.csv B.csv, or give a data set in place of the scenario"
                .to_owned(),
        ));
    }
    let scenario = Scenario::load(&args.scenario)?;
    args.limits.allow(&args.scenario, &limits::of_diagnose(&args.data), args.results.quiet)?;
    let columns = match &args.columns {
        Some(path) => Some(stylet_scenario::load(path)?),
        None => None,
    };
    let options = ReadOptions { columns, repair: args.repair };
    let evidence = crate::plan::read_all(&args.data, &options)?;
    let talk = !args.results.quiet && std::io::stderr().is_terminal();
    let found = stylet_api::diagnose(&scenario, &evidence, |what| {
        if talk {
            crate::terminal::tell(&format!("  {what} ...\n"));
        }
    })?;
    let d = &found.diagnosis;
    let mut output = Output::default();
    output.add("report.html", diagnose_report::page(&scenario, args, &found.examined).to_html());
    output.add("diagnosis.json", found.json()?);
    let inputs = crate::plan::Inputs {
        scenario: args.scenario.clone(),
        data: args.data.clone(),
        columns: args.columns.clone(),
        repair: args.repair,
    };
    output.add(crate::plan::INPUTS, inputs.absolute().json()?);
    output.add("extended.ron", found.extended_ron(&args.scenario.display().to_string())?);
    let folder = args.results.out.clone().unwrap_or_else(|| {
        let stem =
            args.scenario.file_stem().unwrap_or(args.scenario.as_os_str()).to_string_lossy().into_owned();
        PathBuf::from("stylet-out").join(format!("{stem}-diagnosis"))
    });
    output.write(&folder)?;
    if !args.results.quiet {
        say(&format!("{}\nReport: {}\n", summary(d), folder.join("report.html").display()))?;
    }
    Ok(())
}

/// The verdict in a sentence.
pub fn sentence(d: &Diagnosis) -> String {
    let names = || d.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>().join(" and ");
    match d.verdict {
        Verdict::None => {
            "The simulation agrees with the data: no effect is needed beyond the base law.".to_owned()
        }
        Verdict::Named => format!("The simulation lacks {}.", names()),
        Verdict::Ambiguous => {
            let class = |c: &stylet_diagnose::outcome::Cause| {
                std::iter::once(c.effect.as_str())
                    .chain(c.equivalent.iter().map(String::as_str))
                    .collect::<Vec<_>>()
                    .join(" or ")
            };
            format!(
                "The simulation lacks {}: these recordings cannot tell them apart.",
                d.causes.iter().map(class).collect::<Vec<_>>().join(", and ")
            )
        }
        Verdict::Unknown => {
            let on = if d.leftover.depends_on.is_empty() {
                String::new()
            } else {
                format!(" (it depends on {})", d.leftover.depends_on.join(", "))
            };
            format!("The data hold structure that no effect of the library explains{on}.")
        }
    }
}

/// What differs from insertion to insertion so much that a simulation of the next one will miss it.
pub fn differ(d: &Diagnosis) -> Option<String> {
    let x = &d.differences;
    let mut what = Vec::new();
    let percent = |share: f64| significant(100.0 * share, 2);
    let millimetres = |m: f64| significant(1e3 * m, 2);
    if x.puncture >= 0.01 {
        what.push(format!("puncture forces by {} %", percent(x.puncture)));
    }
    if x.face_m >= 1e-4 {
        what.push(format!("places at which layers give way by {} mm", millimetres(x.face_m)));
    }
    if x.surface_m >= 1e-4 {
        what.push(format!("the surface by {} mm", millimetres(x.surface_m)));
    }
    if x.friction >= 0.01 {
        what.push(format!("friction by {} %", percent(x.friction)));
    }
    let differ = format!("from insertion to insertion differ (one standard deviation): {}", what.join(", "));
    (!what.is_empty()).then_some(differ)
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
            "  what remains still depends on {} (p = {:.1e})",
            d.leftover.depends_on.join(", "),
            d.leftover.p_value
        );
    }
    if !d.invisible.is_empty() {
        let _ = writeln!(out, "  these recordings cannot show: {}", d.invisible.join(", "));
    }
    for q in &d.data_quality {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}
