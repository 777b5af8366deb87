//! `stylet benchmark plan`: realities whose first insertion leaves the cause open, inserted into again as planned.

use super::{engine, examine};
use crate::args::{BenchmarkPlanArgs, CaseArgs};
use crate::exit::Failure;
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;
use stylet_diagnose::{Evidence, Options};
use stylet_examine::reality::motion::{Path, Piece};
use stylet_examine::stats::Rate;
use stylet_examine::{Again, Answer, CaseId, Hide, Question};
use stylet_plan::Limits;
use stylet_scenario::{Motion, Scenario, Segment};

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Case {
    id: CaseId,
    hidden: String,
    /// How the first diagnosis leaves the cause open: `class`, `invisible`, or not at all.
    open: Option<String>,
    /// Predicted probability that the diagnosis decides after the planned insertion.
    predicted: f64,
    planned: Option<Said>,
    sinusoid: Option<Said>,
    plan_s: f64,
    seconds: f64,
    failed: Option<String>,
}

/// What was said after a second insertion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Said {
    /// Causes, each with its class.
    causes: Vec<Vec<String>>,
    /// The right single cause by the referee's rules, no class.
    right: bool,
    /// The hidden effect itself is named (the rules let some pass unsaid).
    named: bool,
    unknown: bool,
}

/// Draws of a reality per case asked for, at most.
const DRAWS: u64 = 6;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn plan(args: &BenchmarkPlanArgs) -> Result<(), Failure> {
    let words = CaseArgs {
        world: args.world.clone(),
        wrong: args.wrong.clone(),
        grade: vec![args.grade.clone()],
        hide: vec!["one".to_owned()],
        size: "strong".to_owned(),
        cases: 1,
        seed: args.seed,
    };
    let asked = examine::plan(&words)?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-plan-{}-{}", asked.world, args.seed))
    });
    let failed = |why| Failure::Output { path: folder.display().to_string(), why };
    let claim = stylet_api::Claim::new(&folder)?;
    let journal = folder.join("cases.jsonl");
    let mut done: Vec<Case> = Vec::new();
    if let Ok(file) = std::fs::File::open(&journal) {
        // A line that was cut off when the run was stopped is run again.
        let lines = std::io::BufReader::new(file).lines().map_while(Result::ok);
        done.extend(lines.filter_map(|l| serde_json::from_str(&l).ok()));
    }
    let kept: String = done.iter().filter_map(|d| serde_json::to_string(d).ok()).map(|l| l + "\n").collect();
    stylet_api::folder::write_file(&journal, kept.as_bytes())?;
    let file = Mutex::new(std::fs::OpenOptions::new().append(true).open(&journal).map_err(failed)?);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.unwrap_or(0))
        .build()
        .map_err(|e| Failure::Internal(e.to_string()))?;
    let mut text = String::new();
    let mut rows = Vec::new();
    for base in asked.cases() {
        let bar = Progress::new(args.cases, "open cases", false);
        let mut cases: Vec<Case> = Vec::new();
        let (mut next, most) = (0, args.cases * DRAWS);
        let open = |cases: &[Case]| cases.iter().filter(|c| c.open.is_some()).count() as u64;
        while open(&cases) < args.cases && next < most {
            let batch: Vec<CaseId> =
                (next..next + 8).map(|index| CaseId { index, hide: Hide::One, ..base }).collect();
            next += 8;
            let new: Vec<Case> = pool.install(|| {
                batch
                    .par_iter()
                    .filter_map(|id| {
                        if let Some(known) = done.iter().find(|d| d.id == *id) {
                            return Some(known.clone());
                        }
                        if args.look {
                            return None;
                        }
                        let case = one(id);
                        if let (Ok(mut file), Ok(line)) = (file.lock(), serde_json::to_string(&case)) {
                            let _ = writeln!(file, "{line}");
                        }
                        Some(case)
                    })
                    .collect()
            });
            let before = open(&cases);
            cases.extend(new);
            bar.advance(open(&cases) - before);
        }
        bar.finish();
        // The first so many open ones, whatever the size of the batches.
        let mut left = args.cases;
        cases.retain(|c| {
            let keep = left > 0;
            left -= u64::from(c.open.is_some() && keep);
            keep
        });
        let row = format!(
            "{}: {}{}",
            base.world,
            base.wrong.word(),
            if base.wrong == stylet_examine::Wrong::Nothing {
                String::new()
            } else {
                format!(", {}", base.grade)
            }
        );
        table(&mut text, &row, &cases);
        rows.push((row, cases));
    }
    let json = serde_json::to_vec_pretty(&rows).map_err(|e| Failure::Internal(e.to_string()))?;
    let mut output = stylet_api::Output::default();
    output.add("table.txt", text.clone());
    output.add("cases.json", json);
    output.write_to(&claim)?;
    crate::terminal::say(&format!("{text}\nCases: {}\n", journal.display()))
}

fn one(id: &CaseId) -> Case {
    let begun = Instant::now();
    let mut case = Case {
        id: *id,
        hidden: String::new(),
        open: None,
        predicted: 0.0,
        planned: None,
        sinusoid: None,
        plan_s: 0.0,
        seconds: 0.0,
        failed: None,
    };
    if let Err(why) = go_through(id, &mut case) {
        case.failed = Some(why);
    }
    case.seconds = begun.elapsed().as_secs_f64();
    case
}

fn go_through(id: &CaseId, case: &mut Case) -> Result<(), String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let mut first = Again::new(id);
    case.hidden = first.hidden().join("+");
    // A gain cannot be seen in any motion.
    if case.hidden == "force_gain" {
        return Ok(());
    }
    first.insert(first.constant()).map_err(|e| text(&e))?;
    let (scenario, evidence) = given(&first.question())?;
    let examined =
        stylet_diagnose::diagnose(&scenario, &evidence, &Options::default(), |_| {}).map_err(|e| text(&e))?;
    let d = &examined.diagnosis;
    let in_class = d.causes.iter().any(|c| {
        !c.equivalent.is_empty() && (c.effect == case.hidden || c.equivalent.contains(&case.hidden))
    });
    case.open = if in_class {
        Some("class".to_owned())
    } else {
        d.invisible.contains(&case.hidden).then(|| "invisible".to_owned())
    };
    if case.open.is_none() {
        return Ok(());
    }
    let begun = Instant::now();
    let limits = Limits {
        depth_m: first.depth_m(),
        speed_mps: 0.008,
        acceleration_mps2: 0.1,
        duration_s: 90.0,
        force_n: 30.0,
    };
    let (ground, begin) = stylet_plan::from_diagnosis(&scenario, &examined).map_err(|e| text(&e))?;
    let (plan, _) = stylet_plan::plan(&ground, &limits, &begin).map_err(|e| text(&e))?;
    case.plan_s = begun.elapsed().as_secs_f64();
    case.predicted = plan.probability_decided;
    let second = |path: Path| -> Result<Said, String> {
        let mut reality = first.clone();
        reality.insert(path).map_err(|e| e.to_string())?;
        let answer = engine::answer(&reality.question())?;
        Ok(said(&reality, &answer, &case.hidden))
    };
    let path = path_of(&plan.motion).ok_or_else(|| "the plan is no program".to_owned())?;
    let (planned, sinusoid) = rayon::join(|| second(path), || second(first.sinusoid()));
    (case.planned, case.sinusoid) = (Some(planned?), Some(sinusoid?));
    Ok(())
}

fn given(question: &Question) -> Result<(Scenario, Vec<Evidence>), String> {
    let scenario = Scenario::parse(&question.name, &question.believed_ron).map_err(|e| e.to_string())?;
    let evidence = question
        .recordings
        .iter()
        .map(|r| Evidence { name: r.name.clone(), recording: r.recording.clone(), notes: Vec::new() })
        .collect();
    Ok((scenario, evidence))
}

fn said(reality: &Again, answer: &Answer, hidden: &str) -> Said {
    let worth = reality.judge(answer);
    Said {
        causes: answer
            .causes
            .iter()
            .map(|c| std::iter::once(&c.effect).chain(&c.equivalent).cloned().collect())
            .collect(),
        right: worth.right && answer.causes.iter().all(|c| c.equivalent.is_empty()),
        named: answer.causes.iter().any(|c| c.effect == hidden && c.equivalent.is_empty()),
        unknown: answer.verdict == stylet_examine::Verdict::Unknown,
    }
}

/// A program as the referee's path: both have the same segments.
fn path_of(motion: &Motion) -> Option<Path> {
    let Motion::Program { start_m, segments } = motion else { return None };
    let piece = |s: &Segment| match *s {
        Segment::Move { velocity_mps, duration_s } => Piece::steady(velocity_mps, duration_s),
        Segment::Hold { duration_s } => Piece::steady(0.0, duration_s),
        Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s } => Piece::Move {
            speed_mps: velocity_mps,
            ripple_mps: amplitude_mps,
            ripple_hz: frequency_hz,
            duration_s,
        },
    };
    Some(Path::new(*start_m, segments.iter().map(piece).collect()))
}

fn table(out: &mut String, row: &str, cases: &[Case]) {
    let open: Vec<&Case> = cases.iter().filter(|c| c.open.is_some()).collect();
    let rate = |of: &[&Case], holds: &dyn Fn(&Case) -> bool| Rate::of(of.iter().copied(), |c| holds(c));
    let planned = |c: &Case| c.planned.as_ref().is_some_and(|s| s.right);
    let sinusoid = |c: &Case| c.sinusoid.as_ref().is_some_and(|s| s.right);
    let _ = writeln!(out, "{row}");
    let _ = writeln!(
        out,
        "  {} realities drawn, {} left open by one insertion at constant speed (class {}, invisible {})",
        cases.len(),
        open.len(),
        open.iter().filter(|c| c.open.as_deref() == Some("class")).count(),
        open.iter().filter(|c| c.open.as_deref() == Some("invisible")).count()
    );
    let predicted: Vec<f64> = open.iter().filter(|c| c.planned.is_some()).map(|c| c.predicted).collect();
    let mean = predicted.iter().sum::<f64>() / predicted.len().max(1) as f64;
    let _ = writeln!(out, "  right single cause, planned second insertion   {}", rate(&open, &planned));
    let _ = writeln!(out, "  right single cause, the paper's sinusoid       {}", rate(&open, &sinusoid));
    let named = |c: &Case| c.planned.as_ref().is_some_and(|s| s.right && s.named);
    let _ = writeln!(out, "  ... and by its name (planned)                  {}", rate(&open, &named));
    let _ = writeln!(out, "  predicted for the planned one                  {:.0} %", 100.0 * mean);
    let mut seconds: Vec<f64> = open.iter().map(|c| c.plan_s).collect();
    let mut all: Vec<f64> = open.iter().map(|c| c.seconds).collect();
    let _ = writeln!(
        out,
        "  seconds of planning: median {:.1}, p90 {:.1}, longest {:.1}; of a whole case: median {:.1}",
        stylet_stats::quantile(&mut seconds, 0.5),
        stylet_stats::quantile(&mut seconds, 0.9),
        stylet_stats::quantile(&mut seconds, 1.0),
        stylet_stats::quantile(&mut all, 0.5)
    );
    let failed = cases.iter().filter(|c| c.failed.is_some()).count();
    if failed > 0 {
        let _ = writeln!(out, "  no answer: {failed}");
    }
    let mut names: Vec<&str> = open.iter().map(|c| c.hidden.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let _ = writeln!(out, "  {:<26} {:<28} sinusoid", "hidden", "planned");
    for name in names {
        let of: Vec<&Case> = open.iter().copied().filter(|c| c.hidden == name).collect();
        let wrong: Vec<String> = of
            .iter()
            .filter(|c| !planned(c))
            .map(|c| match &c.planned {
                None => "no answer".to_owned(),
                Some(s) if s.unknown => "unknown".to_owned(),
                Some(s) if s.causes.is_empty() => "none".to_owned(),
                Some(s) => s.causes.iter().map(|c| c.join("|")).collect::<Vec<_>>().join(" + "),
            })
            .collect();
        let line = format!(
            "  {name:<26} {:<28} {:<28} {}",
            rate(&of, &planned).to_string(),
            rate(&of, &sinusoid).to_string(),
            if wrong.is_empty() { String::new() } else { format!("said {}", wrong.join("; ")) }
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
}
