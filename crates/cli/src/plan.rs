//! `stylet plan` and `stylet identifiability`: which insertion to make next, and what one can show.

use crate::args::{IdentifiabilityArgs, PlanArgs};
use crate::exit::Failure;
use crate::{limits, plan_report};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use stylet_api::{Diagnosed, Evidence};
use stylet_plan::identifiability::Identifiability;
use stylet_plan::{Ground, Limits, Plan, PlanError};
use stylet_record::{ReadOptions, read_csv_with_holes};
use stylet_report::significant;
use stylet_scenario::{Motion, Scenario};

/// What a diagnosis was made of: `inputs.json` of its folder. Paths as they were given.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Inputs {
    /// Scenario.
    pub scenario: PathBuf,
    /// Recordings.
    pub data: Vec<PathBuf>,
    /// Column map.
    pub columns: Option<PathBuf>,
    /// Whether rows with backward time stamps were dropped.
    pub repair: bool,
}

/// The file in which a diagnosis names its inputs.
pub const INPUTS: &str = "inputs.json";

impl Inputs {
    /// The inputs with absolute paths, so that the folder can be used from anywhere.
    pub fn absolute(&self) -> Self {
        let full = |p: &PathBuf| std::path::absolute(p).unwrap_or_else(|_| p.clone());
        Self {
            scenario: full(&self.scenario),
            data: self.data.iter().map(full).collect(),
            columns: self.columns.as_ref().map(full),
            repair: self.repair,
        }
    }

    /// As a file.
    ///
    /// # Errors
    /// When a path is no text.
    pub fn json(&self) -> Result<Vec<u8>, Failure> {
        let mut json = serde_json::to_vec_pretty(self).map_err(|e| Failure::Internal(e.to_string()))?;
        json.push(b'\n');
        Ok(json)
    }

    /// What the diagnosis in a folder was made of.
    ///
    /// # Errors
    /// When the folder does not say.
    pub fn of_folder(folder: &Path) -> Result<Self, Failure> {
        let path = folder.join(INPUTS);
        let text = std::fs::read_to_string(&path).map_err(|_| {
            Failure::Check(format!(
                "{}: holds no {INPUTS}; name the folder that `stylet diagnose` wrote, or a scenario file",
                folder.display()
            ))
        })?;
        serde_json::from_str(&text)
            .map_err(|e| Failure::Check(format!("{}: {e}; make the diagnosis anew", path.display())))
    }

    fn evidence(&self) -> Result<Vec<Evidence>, Failure> {
        let columns = match &self.columns {
            Some(path) => Some(stylet_scenario::load(path)?),
            None => None,
        };
        let options = ReadOptions { columns, repair: self.repair };
        read_all(&self.data, &options)
    }
}

/// Reads recordings, several at once.
///
/// # Errors
/// [`Failure`] with file and line.
pub fn read_all(data: &[PathBuf], options: &ReadOptions) -> Result<Vec<Evidence>, Failure> {
    let read: Vec<_> = data.par_iter().map(|path| read_csv_with_holes(path, options)).collect();
    let named = data.iter().zip(read).map(|(path, read)| {
        let (recording, notes) = read?;
        Ok(Evidence { name: stylet_api::name_of(path, data), recording, notes })
    });
    named.collect()
}

/// Where planning stands.
struct Stand {
    scenario: Scenario,
    evidence: Vec<Evidence>,
    diagnosed: Option<Diagnosed>,
    ground: Ground,
    begin: stylet_plan::draw::Begin,
}

fn failed(at: &Path, why: PlanError) -> Failure {
    match why {
        PlanError::Diagnose(e) => Failure::Diagnose(e),
        PlanError::Simulate(why) => Failure::Simulate { file: at.display().to_string(), why },
        other => Failure::Check(format!("{}: {other}", at.display())),
    }
}

fn stand(inputs: &Inputs, made: Option<&Motion>, talk: &dyn Fn(&str)) -> Result<Stand, Failure> {
    let scenario = Scenario::load(&inputs.scenario)?;
    let evidence = inputs.evidence()?;
    let at = &inputs.scenario;
    if evidence.is_empty() {
        let (ground, begin) = stylet_plan::from_scenario(&scenario, made).map_err(|e| failed(at, e))?;
        return Ok(Stand { scenario, evidence, diagnosed: None, ground, begin });
    }
    let diagnosed = stylet_api::diagnose(&scenario, &evidence, |what| talk(what))?;
    let (ground, begin) =
        stylet_plan::from_diagnosis(&scenario, &diagnosed.examined).map_err(|e| failed(at, e))?;
    Ok(Stand { scenario, evidence, diagnosed: Some(diagnosed), ground, begin })
}

fn talker(quiet: bool) -> impl Fn(&str) {
    let talk = !quiet && std::io::stderr().is_terminal();
    move |what| {
        if talk {
            crate::terminal::tell(&format!("  {what} ...\n"));
        }
    }
}

/// `stylet plan`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &PlanArgs) -> Result<(), Failure> {
    let bounds: Limits = stylet_scenario::load(&args.limits)?;
    bounds.check().map_err(|e| failed(&args.limits, e))?;
    let inputs = if args.from.is_dir() {
        Inputs::of_folder(&args.from)?
    } else {
        Inputs {
            scenario: args.from.clone(),
            data: args.data.clone(),
            columns: args.columns.clone(),
            repair: args.repair,
        }
    };
    args.resources.allow(&inputs.scenario, &limits::of_diagnose(&inputs.data), args.quiet)?;
    let tell = talker(args.quiet);
    let stand = stand(&inputs, None, &tell)?;
    tell("looking for the motion that tells most");
    let (mut plan, found) =
        stylet_plan::plan(&stand.ground, &bounds, &stand.begin).map_err(|e| failed(&args.limits, e))?;
    if !args.quick {
        plan = stylet_plan::check(&found, &bounds, &stand.scenario, &stand.ground, &stand.evidence, &tell)
            .map_err(|e| failed(&inputs.scenario, e))?;
    }
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = args.from.file_stem().unwrap_or(args.from.as_os_str()).to_string_lossy().into_owned();
        PathBuf::from("stylet-out").join(format!("{stem}-plan")).join("plan.ron")
    });
    write(&out, &stand, &plan)?;
    if !args.quiet {
        crate::terminal::say(&format!(
            "{}\nMotion: {}\nReport: {}\n",
            summary(&plan),
            out.display(),
            out.with_extension("html").display()
        ))?;
    }
    Ok(())
}

fn write(out: &Path, stand: &Stand, plan: &Plan) -> Result<(), Failure> {
    let problem = |why| Failure::Output { path: out.display().to_string(), why };
    if let Some(folder) = out.parent().filter(|p| !p.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(problem)?;
    }
    let internal = |e: &dyn std::fmt::Display| Failure::Internal(e.to_string());
    let pretty = ron_pretty(&plan.motion).map_err(|e| internal(&e))?;
    let motion = format!(
        "// The next insertion, planned by stylet {}: a motion for `stylet run SCENARIO.ron --motion {}`.\n{pretty}\n",
        env!("CARGO_PKG_VERSION"),
        out.file_name().unwrap_or(out.as_os_str()).to_string_lossy()
    );
    let mut json = serde_json::to_vec_pretty(plan).map_err(|e| internal(&e))?;
    json.push(b'\n');
    let verdict = stand.diagnosed.as_ref().map(|d| crate::diagnose::sentence(&d.diagnosis));
    let page = plan_report::page(&stand.scenario, verdict, &stand.ground, plan);
    stylet_api::folder::write_file(&out.with_extension("json"), &json)?;
    stylet_api::folder::write_file(&out.with_extension("html"), page.to_html().as_bytes())?;
    stylet_api::folder::write_file(out, motion.as_bytes())?;
    Ok(())
}

/// A motion as RON, in the dialect of scenarios.
fn ron_pretty(motion: &Motion) -> Result<String, Failure> {
    let scenario = stylet_scenario::motion_to_ron(motion);
    scenario.map_err(|e| Failure::Internal(e.to_string()))
}

fn summary(plan: &Plan) -> String {
    let mut out = String::new();
    let told: Vec<_> = plan.pairs.iter().filter(|p| p.told).collect();
    let percent = |p: f64| format!("{:.0} %", 100.0 * p);
    let Motion::Program { start_m, segments } = &plan.motion else { return out };
    let _ = writeln!(
        out,
        "The next insertion: {} segments from {:.1} mm, {} s, to {:.1} mm, at most {} N expected",
        segments.len(),
        1e3 * start_m,
        significant(plan.duration_s, 3),
        1e3 * plan.depth_m,
        significant(plan.force_n, 3)
    );
    if told.is_empty() {
        let _ = writeln!(
            out,
            "  nothing is left to tell apart that a motion within these limits could; intervals become sharper:"
        );
        for i in plan.intervals.iter().filter(|i| i.after < 0.98 * i.before) {
            let _ = writeln!(
                out,
                "    {:<32} +-{} -> +-{}",
                i.name,
                significant(i.before, 2),
                significant(i.after, 2)
            );
        }
    } else {
        let _ = writeln!(
            out,
            "  the next diagnosis names the right single cause with probability {} (now {}), by {}",
            percent(plan.probability_decided),
            percent(plan.probability_now),
            if plan.probability_from == "simulated" {
                "simulated insertions and expected gaps"
            } else {
                "expected gaps"
            }
        );
        for t in &plan.simulated {
            let _ = writeln!(
                out,
                "    simulated with {:<26} right and alone in {} of {}",
                t.candidate, t.decided, t.of
            );
        }
        let mut worst = told.clone();
        worst.sort_by(|a, b| a.nats_after.total_cmp(&b.nats_after));
        let _ =
            writeln!(out, "  hardest pairs                                              nats now    then");
        for p in worst.iter().take(6) {
            let _ = writeln!(
                out,
                "    {:<54} {:>8} {:>7}",
                format!("{} | {}", p.a, p.b),
                significant(p.nats_before, 2),
                significant(p.nats_after, 3)
            );
        }
    }
    if !plan.never.is_empty() {
        let _ = writeln!(out, "  no motion within these limits shows: {}", plan.never.join(", "));
    }
    if let Some(r) = &plan.repeats {
        let _ = writeln!(
            out,
            "  forces at rupture scatter by {:.1} %: {} insertions, half at {} and half at {} mm/s, give their mean to {:.1} %",
            100.0 * r.scatter,
            r.insertions,
            significant(1e3 * r.speeds_mps[0], 2),
            significant(1e3 * r.speeds_mps[1], 2),
            100.0 * r.mean_within
        );
    }
    out
}

/// `stylet identifiability`.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn identifiability(args: &IdentifiabilityArgs) -> Result<(), Failure> {
    let inputs = Inputs {
        scenario: args.scenario.clone(),
        data: args.data.clone(),
        columns: args.columns.clone(),
        repair: args.repair,
    };
    args.resources.allow(&inputs.scenario, &limits::of_diagnose(&inputs.data), args.results.quiet)?;
    let scenario = Scenario::load(&args.scenario)?;
    let mut scenario = scenario;
    if let Some(path) = &args.motion {
        scenario.motion = load_motion(path)?;
        scenario.check().map_err(|p| Failure::Check(format!("{}: {p}", path.display())))?;
    }
    let evidence = inputs.evidence()?;
    if evidence.is_empty() && scenario.motion.plan().is_none() {
        return Err(Failure::Argument(
            "the scenario's motion is `Recorded`: give recordings with --data, or a motion with --motion"
                .to_owned(),
        ));
    }
    let tell = talker(args.results.quiet);
    let ground = if evidence.is_empty() {
        stylet_plan::from_scenario(&scenario, None).map_err(|e| failed(&args.scenario, e))?.0
    } else {
        let found = stylet_api::diagnose(&scenario, &evidence, |what| tell(what))?;
        stylet_plan::start::of_recordings(&scenario, &found.examined)
            .map_err(|e| failed(&args.scenario, e))?
    };
    let shown = stylet_plan::identifiability(&ground);
    let mut json = serde_json::to_vec_pretty(&shown).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    let mut output = stylet_api::Output::default();
    output.add("report.html", plan_report::identifiability_page(&scenario, &shown).to_html());
    output.add("identifiability.json", json);
    output.add("matrix.svg", plan_report::matrix(&scenario, &shown));
    let folder = args.results.out.clone().unwrap_or_else(|| {
        let stem =
            args.scenario.file_stem().unwrap_or(args.scenario.as_os_str()).to_string_lossy().into_owned();
        PathBuf::from("stylet-out").join(format!("{stem}-identifiability"))
    });
    output.write(&folder)?;
    if !args.results.quiet {
        crate::terminal::say(&format!(
            "{}\nReport: {}\n",
            words(&shown),
            folder.join("report.html").display()
        ))?;
    }
    Ok(())
}

/// A motion from a file of its own.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn load_motion(path: &Path) -> Result<Motion, Failure> {
    Ok(stylet_scenario::load(path)?)
}

fn words(shown: &Identifiability) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{:<26} {:>10}  {:<44} as well", "effect", "nats", "seen from");
    for e in &shown.effects {
        let from = match &e.smallest {
            Some(numbers) => plan_report::numbers(&e.effect, numbers),
            None => "at no plausible size".to_owned(),
        };
        let line =
            format!("{:<26} {:>10}  {from:<44} {}", e.effect, significant(e.nats, 3), e.like.join(", "));
        let _ = writeln!(out, "{}", line.trim_end());
    }
    if !shown.invisible.is_empty() {
        let _ = writeln!(out, "\ninvisible at their typical size: {}", shown.invisible.join(", "));
    }
    for c in &shown.classes {
        let _ = writeln!(out, "cannot be told apart: {}", c.join(", "));
    }
    out
}
