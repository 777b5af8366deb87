//! Planning examined: realities whose first insertion leaves the cause open, inserted into again as planned.

use super::engine::{answer, given};
use super::journal::Journal;
use super::pool;
use crate::error::Error;
use crate::folder::Claim;
use crate::output::Output;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::Path as File;
use std::time::Instant;
use stylet_diagnose::Options;
use stylet_examine::reality::motion::{Path, Piece};
use stylet_examine::stats::{Rate, quantile};
use stylet_examine::{Again, Answer, CaseId, Hide, Wrong};
use stylet_plan::Limits;
use stylet_scenario::{Motion, Segment};

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

/// An examination of planning in its folder, which it alone writes to.
pub struct Planning {
    rows: Vec<(String, Vec<Case>)>,
    text: String,
    journal: Journal<Case>,
    pool: rayon::ThreadPool,
    claim: Claim,
}

impl Planning {
    /// Claims the folder. 0 threads are one per core.
    ///
    /// # Errors
    /// [`Error::Output`], [`Error::Busy`].
    pub fn new(folder: &File, threads: usize) -> Result<Self, Error> {
        let claim = Claim::new(folder)?;
        let journal = Journal::open(&folder.join("cases.jsonl"))?;
        Ok(Self { rows: Vec::new(), text: String::new(), journal, pool: pool(threads)?, claim })
    }

    /// Draws cases like `base` until so many are left open by one insertion, and lets each be inserted into again. With `look` those
    /// alone that the journal holds. `done` is told of open cases.
    pub fn row(&mut self, base: &CaseId, wanted: u64, look: bool, done: &dyn Fn(u64)) {
        let mut cases: Vec<Case> = Vec::new();
        let (mut next, most) = (0, wanted * DRAWS);
        let open = |cases: &[Case]| cases.iter().filter(|c| c.open.is_some()).count() as u64;
        while open(&cases) < wanted && next < most {
            let batch: Vec<CaseId> =
                (next..next + 8).map(|index| CaseId { index, hide: Hide::One, ..*base }).collect();
            next += 8;
            let new: Vec<Case> =
                self.pool.install(|| batch.par_iter().filter_map(|id| self.case(id, look)).collect());
            let before = open(&cases);
            cases.extend(new);
            done(open(&cases) - before);
        }
        // The first so many open ones, whatever the size of the batches.
        let mut left = wanted;
        cases.retain(|c| {
            let keep = left > 0;
            left -= u64::from(c.open.is_some() && keep);
            keep
        });
        let grade = if base.wrong == Wrong::Nothing { String::new() } else { format!(", {}", base.grade) };
        let name = format!("{}: {}{grade}", base.world, base.wrong.word());
        table(&mut self.text, &name, &cases);
        self.rows.push((name, cases));
    }

    /// A case of the journal, else a new one.
    fn case(&self, id: &CaseId, look: bool) -> Option<Case> {
        if let Some(known) = self.journal.done.iter().find(|d| d.id == *id) {
            return Some(known.clone());
        }
        if look {
            return None;
        }
        let case = one(id);
        self.journal.note(&case);
        Some(case)
    }

    /// Writes the cases and their table, and gives the table in words.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self) -> Result<&str, Error> {
        let json = serde_json::to_vec_pretty(&self.rows).map_err(Error::internal)?;
        let mut output = Output::default();
        output.add("table.txt", self.text.clone());
        output.add("cases.json", json);
        output.write_to(&self.claim)?;
        Ok(&self.text)
    }
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
        let answer = answer(&reality.question())?;
        Ok(said(&reality, &answer, &case.hidden))
    };
    let path = path_of(&plan.motion).ok_or_else(|| "the plan is no program".to_owned())?;
    let (planned, sinusoid) = rayon::join(|| second(path), || second(first.sinusoid()));
    (case.planned, case.sinusoid) = (Some(planned?), Some(sinusoid?));
    Ok(())
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
    let seconds: Vec<f64> = open.iter().map(|c| c.plan_s).collect();
    let all: Vec<f64> = open.iter().map(|c| c.seconds).collect();
    let _ = writeln!(
        out,
        "  seconds of planning: median {:.1}, p90 {:.1}, longest {:.1}; of a whole case: median {:.1}",
        quantile(&seconds, 0.5),
        quantile(&seconds, 0.9),
        quantile(&seconds, 1.0),
        quantile(&all, 0.5)
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
