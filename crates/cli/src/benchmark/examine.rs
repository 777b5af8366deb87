//! `stylet benchmark diagnose` in the referee's worlds.

use super::{engine, page};
use crate::args::{BenchmarkDiagnoseArgs, CaseArgs};
use crate::exit::Failure;
use crate::output::Output;
use crate::progress::Progress;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use stylet_examine::{Grade, Hide, Plan, Size, World, Wrong, table};

/// The words of a list, or all of them.
fn words<T: Copy>(
    what: &str,
    given: &[String],
    all: &[T],
    parse: fn(&str) -> Option<T>,
    word: fn(T) -> &'static str,
) -> Result<Vec<T>, Failure> {
    if given.iter().any(|g| g == "all") {
        return Ok(all.to_vec());
    }
    given
        .iter()
        .map(|g| {
            parse(g.trim()).ok_or_else(|| {
                let known: Vec<&str> = all.iter().map(|x| word(*x)).collect();
                Failure::Argument(format!("{what}: there is no `{g}`; there are {}", known.join(", ")))
            })
        })
        .collect()
}

/// What the arguments ask for.
///
/// # Errors
/// A word that there is not, with those that there are.
pub fn plan(args: &CaseArgs) -> Result<Plan, Failure> {
    let one = |given: &String| std::slice::from_ref(given).to_vec();
    let world = words("--world", &one(&args.world), World::ALL, World::parse, World::word)?;
    let size = words("--size", &one(&args.size), Size::ALL, Size::parse, Size::word)?;
    let (Some(&world), Some(&size)) = (world.first(), size.first()) else {
        return Err(Failure::Internal("a list of words is empty".to_owned()));
    };
    Ok(Plan {
        world,
        wrong: words("--wrong", &args.wrong, Wrong::ALL, Wrong::parse, Wrong::word)?,
        grades: words("--grade", &args.grade, Grade::ALL, Grade::parse, Grade::word)?,
        hide: words("--hide", &args.hide, Hide::ALL, Hide::parse, Hide::word)?,
        size,
        cases: args.cases,
        seed: args.seed,
    })
}

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &BenchmarkDiagnoseArgs) -> Result<(), Failure> {
    let plan = plan(&args.cases)?;
    let folder = args.out.clone().unwrap_or_else(|| {
        PathBuf::from("stylet-out").join(format!("benchmark-diagnose-{}-{}", plan.world, plan.seed))
    });
    let failed = |why| Failure::Output { path: folder.display().to_string(), why };
    let claim = stylet_api::Claim::new(&folder)?;
    let journal = folder.join("cases.jsonl");
    let mut cases = plan.cases();
    if args.look {
        let there = stylet_examine::run::read(&journal).map_err(failed)?;
        cases.retain(|id| there.contains_key(id));
    }
    let bar = Progress::new(cases.len() as u64, "cases", false);
    let before = AtomicUsize::new(0);
    let tell = |done: usize, of: usize| {
        let last = before.swap(done, Ordering::Relaxed);
        if last == 0 && done > 1 {
            bar.skip(done as u64);
        } else {
            bar.advance(done.saturating_sub(last) as u64);
        }
        if done.is_multiple_of(20) && done > 0 {
            crate::terminal::tell(&format!("  {done} of {of} cases\n"));
        }
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.unwrap_or(0))
        .build()
        .map_err(|e| Failure::Internal(e.to_string()))?;
    let outcomes = pool
        .install(|| stylet_examine::run(&cases, Some(&journal), &engine::answer, &tell))
        .map_err(|e| Failure::Internal(e.to_string()))?;
    bar.finish();
    let text = table::text(&outcomes);
    let cells = table::cells(&outcomes);
    let mut json = serde_json::to_vec_pretty(&cells).map_err(|e| Failure::Internal(e.to_string()))?;
    json.push(b'\n');
    let mut output = Output::default();
    output.add("table.txt", text.clone());
    output.add("table.json", json);
    output.add("report.html", page::page(&plan, &cells, &text).to_html());
    for (hide, svg) in page::maps(&plan, &cells) {
        output.add(map_name(hide), svg);
    }
    output.write_to(&claim)?;
    crate::terminal::say(&format!("{text}\nReport: {}\n", folder.join("report.html").display()))
}

/// The file of a map.
fn map_name(hide: Hide) -> &'static str {
    match hide {
        Hide::Clean => "map_clean.svg",
        Hide::One => "map_one.svg",
        Hide::Two => "map_two.svg",
        Hide::Three => "map_three.svg",
        Hide::Outside => "map_outside.svg",
        Hide::Beside => "map_beside.svg",
        Hide::Instrument => "map_instrument.svg",
    }
}
