//! `stylet diagnose` on repeated insertions: a data set, or a scenario with `--repeats`.

use crate::args::DiagnoseArgs;
use crate::exit::Failure;
use crate::limits;
use crate::output::Output;
use crate::set_online;
use crate::set_report;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use stylet_diagnose::outcome::{Diagnosis, Verdict};
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::compose::compose;
use stylet_diagnose::set::dataset::{Dataset, DatasetError, find, is_dataset};
use stylet_diagnose::set::instrument::Checks;
use stylet_diagnose::set::repeats::{Alone, Repeats};
use stylet_diagnose::set::study::{Study, study};
use stylet_record::{QualityKind, Recording, read_csv};
use stylet_report::significant;
use stylet_scenario::Scenario;

/// `diagnosis.json`.
#[derive(serde::Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    repeats: &'a Repeats,
    online: &'a [set_online::Online],
}

/// Fewest recordings that can be told from a law.
const FEWEST: usize = 3;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let set = description(args)?;
    let files = files(args, &set)?;
    args.limits.allow(&args.scenario, &limits::of_diagnose(&files), args.results.quiet)?;
    let talk = !args.results.quiet && std::io::stderr().is_terminal();
    let mut say = |what: &str| {
        if talk {
            crate::terminal::tell(&format!("  {what}\n"));
        }
    };
    let layers = set.tissue.layers.len();
    let runs = set.runs(&files, layers)?;
    if !set.split_by.is_empty() {
        return crate::specimens::diagnose(args, &set, &runs);
    }
    if runs.len() < FEWEST {
        return Err(DatasetError::TooLittle(format!(
            "{} recording(s): repeats are told from the law with {FEWEST} or more; without --repeats single recordings are diagnosed",
            runs.len()
        ))
        .into());
    }
    let given = !args.data.is_empty();
    let air = optional(&set, set.air.as_deref(), given)?;
    let load = optional(&set, set.load.as_ref().map(|l| l.file.as_str()), given)?;
    let known = load.as_ref().zip(set.load.as_ref()).map(|(r, l)| (r, l.force_n));
    let refs: Vec<&Insertion> = runs.iter().collect();
    let checks = Checks { air: air.as_ref(), load: known };
    let mut study = study(&set.name, &set.tissue, &refs, &checks, &mut say)
        .ok_or_else(|| Failure::Internal("no law could be fitted to these recordings".to_owned()))?;
    if !set.parts.is_empty() {
        say("layers measured alone, put together");
        study.repeats.parts = parts(&set, &study, given)?;
    }
    let studied: Vec<&Insertion> = study.runs.iter().collect();
    write(args, &set, &studied, &study)
}

fn write(args: &DiagnoseArgs, set: &Dataset, runs: &[&Insertion], study: &Study) -> Result<(), Failure> {
    let internal = |e: &dyn std::fmt::Display| Failure::Internal(e.to_string());
    let online = set_online::listen(runs, study);
    let written = Written { diagnosis: &study.diagnosis, repeats: &study.repeats, online: &online };
    let mut json = serde_json::to_vec_pretty(&written).map_err(|e| internal(&e))?;
    json.push(b'\n');
    let ron = format!(
        "// {}: the law that stylet diagnose {} found, with the mean of what varies from run to run.\n{}",
        args.scenario.display(),
        env!("CARGO_PKG_VERSION"),
        study.extended.to_ron().map_err(|e| internal(&e))?
    );
    let mut output = Output::default();
    output.add("report.html", set_report::page(args, set, runs, study, &online).to_html());
    output.add("diagnosis.json", json);
    output.add("extended.ron", ron);
    output.add("gain.svg", set_report::gain_figure(study));
    let folder = args.results.out.clone().unwrap_or_else(|| {
        let stem =
            args.scenario.file_stem().unwrap_or(args.scenario.as_os_str()).to_string_lossy().into_owned();
        PathBuf::from("stylet-out").join(format!("{stem}-diagnosis"))
    });
    output.write(&folder)?;
    if !args.results.quiet {
        crate::terminal::say(&format!(
            "{}{}\nReport: {}\n",
            summary(study),
            set_online::summary(&online),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

fn description(args: &DiagnoseArgs) -> Result<Dataset, Failure> {
    let mut set = if is_dataset(&args.scenario)? {
        Dataset::load(&args.scenario)?
    } else {
        let scenario = Scenario::load(&args.scenario)?;
        if !scenario.effects.is_empty() {
            use stylet_tissue::Effect as _;
            let names: Vec<&str> = scenario.effects.iter().map(|e| e.info().id).collect();
            return Err(Failure::Check(format!(
                "{}: believes in {}, and repeats are held against the base law alone: take `effects` out of the scenario, or diagnose \
                 the recordings without --repeats",
                args.scenario.display(),
                names.join(", ")
            )));
        }
        Dataset {
            name: scenario.name,
            source: scenario.source,
            columns: None,
            tissue: scenario.tissue,
            recordings: Vec::new(),
            split_by: Vec::new(),
            air: None,
            load: None,
            parts: Vec::new(),
            repair: false,
        }
    };
    set.repair = args.repair;
    if let Some(path) = &args.columns {
        set.columns = Some(stylet_scenario::load(path)?);
    }
    Ok(set)
}

fn files(args: &DiagnoseArgs, set: &Dataset) -> Result<Vec<PathBuf>, Failure> {
    if !args.data.is_empty() {
        return Ok(args.data.clone());
    }
    if set.recordings.is_empty() {
        return Err(Failure::Argument(
            "no recordings: name them with --data A.csv B.csv, or in the data set's `recordings`".to_owned(),
        ));
    }
    let mut out = Vec::new();
    for pattern in &set.recordings {
        out.extend(find(pattern)?);
    }
    Ok(out)
}

/// A recording that a data set names; with recordings given by hand it may be missing.
fn optional(set: &Dataset, file: Option<&str>, given: bool) -> Result<Option<Recording>, Failure> {
    let Some(file) = file else { return Ok(None) };
    let found = match find(file) {
        Ok(found) => found,
        Err(DatasetError::NoFile { .. }) if given => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let first: &Path = &found[0];
    Ok(Some(read_csv(first, &set.options())?.0))
}

fn parts(set: &Dataset, study: &Study, given: bool) -> Result<Option<Alone>, Failure> {
    let mut alone: Vec<(String, Vec<Insertion>)> = Vec::new();
    for layer in 1..=set.tissue.layers.len() {
        let Some(part) = set.parts.iter().find(|p| p.layer == layer) else { return Ok(None) };
        let mut files = Vec::new();
        for pattern in &part.recordings {
            match find(pattern) {
                Ok(found) => files.extend(found),
                Err(DatasetError::NoFile { .. }) if given => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
        let runs = set.runs(&files, 1)?;
        let undone = study.repeats.instrument.undo(&runs.iter().collect::<Vec<_>>());
        alone.push((part.name.clone(), undone.runs));
    }
    let whole: Vec<&Insertion> = study.runs.iter().collect();
    Ok(compose(study.laws.best.kind, &set.tissue, &alone, &whole))
}

/// The verdict in a sentence.
pub fn sentence(study: &Study) -> String {
    let d = &study.diagnosis;
    let names: Vec<&str> = d.causes.iter().map(|c| c.effect.as_str()).collect();
    match (d.verdict, names.is_empty()) {
        (Verdict::Unknown, true) => {
            "The insertions hold structure that no effect of the library explains.".to_owned()
        }
        (Verdict::Unknown, false) => format!(
            "The insertions hold structure that no effect of the library explains; beside it the simulation lacks {}.",
            names.join(", ")
        ),
        (_, true) => "The base law predicts new insertions as well as any extension of it.".to_owned(),
        (_, false) => format!("The simulation lacks {}.", names.join(", ")),
    }
}

/// Three digits, or a dash.
pub fn or_dash(x: Option<f64>) -> String {
    x.filter(|x| x.is_finite()).map_or("-".to_owned(), |x| format!("{x:.3}"))
}

fn summary(study: &Study) -> String {
    let mut out = String::new();
    let (d, r) = (&study.diagnosis, &study.repeats);
    let _ = writeln!(out, "{}\n", sentence(study));
    let _ = writeln!(
        out,
        "  what each law and each part of the best one buys (N on parts of the set left out)\n    {:<40} {:.3}",
        "base law",
        study.laws.base.left_out_n()
    );
    for b in &r.bought {
        let line = match b.without_n {
            None => format!("{:<40} {:.3}", b.step, b.left_out_n),
            Some(e) => format!(
                "{:<40}       {e:.3} without it{}",
                format!("  {}", b.step),
                if b.kept { "" } else { ", so that it was left out" }
            ),
        };
        let _ = writeln!(out, "    {line}");
    }
    for c in &d.causes {
        let _ = writeln!(out, "\n  {}", c.effect);
        for (path, e) in &c.parameters {
            let (value, low, high) = (significant(e.value, 4), significant(e.low, 3), significant(e.high, 3));
            let _ = writeln!(out, "    {path} = {value} (95 %: {low} to {high})");
        }
    }
    let _ = writeln!(
        out,
        "\n  each run predicted without it (N rms)\n    {:>10} {:>5} {:>8} {:>8} {:>9} {:>9} {:>16}",
        "mm/s", "runs", "floor", "base", "extended", "in band", "speed left out"
    );
    let mut line = |name: String, runs: usize, floor, base: f64, extended: f64, covered: f64, speed| {
        let _ = writeln!(
            out,
            "    {name:>10} {runs:>5} {:>8} {base:>8.3} {extended:>9.3} {:>8.1}% {:>16}",
            or_dash(floor),
            100.0 * covered,
            or_dash(speed)
        );
    };
    for s in &r.speeds {
        line(
            format!("{:.2}", 1e3 * s.speed_mps),
            s.runs,
            s.floor_n,
            s.base_n,
            s.extended_n,
            s.covered,
            s.speed_left_out_n,
        );
    }
    let m = &r.mean;
    line("mean".to_owned(), r.runs.len(), m.floor_n, m.base_n, m.extended_n, m.covered, m.speed_left_out_n);
    let _ = writeln!(out, "  base law with a whole speed left out: {} N", or_dash(m.base_speed_left_out_n));
    let _ = writeln!(
        out,
        "  the floor is the mean of the others, which scatters itself; without that: {} N",
        or_dash(m.floor_bare_n)
    );
    if let Some(covered) = m.speed_covered {
        let _ = writeln!(out, "  in the band of a speed that took no part: {:.1} %", 100.0 * covered);
    }
    for p in &r.parts_of_insertion {
        let _ = writeln!(out, "  {:<28} {:.3} N, floor {}", p.part, p.extended_n, or_dash(p.floor_n));
    }
    if r.starts.0 > 1 {
        let _ = writeln!(out, "  {} of {} starts of the fit agree", r.starts.1, r.starts.0);
    }
    for said in &d.advice {
        let _ = writeln!(out, "  {said}");
    }
    if let Some(parts) = &r.parts {
        for (name, floor, error) in &parts.alone {
            let _ = writeln!(out, "  {name}: {error:.3} N on runs left out, floor {}", or_dash(*floor));
        }
        let _ = writeln!(out, "  put together, on the whole: {:.3} N", parts.mean_n);
    }
    for e in &r.instrument.shown {
        let _ = writeln!(out, "  shown by the instrument: {}: {}", e.effect, e.evidence);
    }
    for e in &r.instrument.excluded {
        let _ = writeln!(out, "  excluded: {}: {}", e.effect, e.evidence);
    }
    for q in d.data_quality.iter().filter(|q| q.recording.starts_with("all at")) {
        let _ = writeln!(out, "  data: {}", q.note.message);
    }
    for q in d.data_quality.iter().filter(|q| q.note.kind == QualityKind::NotLikeTheOthers) {
        let _ = writeln!(out, "  note: {}: {}", q.recording, q.note.message);
    }
    out
}
