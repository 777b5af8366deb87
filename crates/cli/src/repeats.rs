//! `stylet diagnose` on repeated insertions and on specimens: a data set, or a scenario with `--repeats`.

use crate::args::DiagnoseArgs;
use crate::exit::Failure;
use crate::terminal::teller;
use std::fmt::Write as _;
use stylet_api::need;
use stylet_api::repeats::{data_set, files, repeats};
use stylet_api::specimens::{Indented, specimens};
use stylet_diagnose::set::study::Study;
use stylet_pages::repeats::{online, sentence};
use stylet_pages::words::three;
use stylet_record::QualityKind;
use stylet_report::significant;

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn diagnose(args: &DiagnoseArgs) -> Result<(), Failure> {
    let (inputs, results) = (args.inputs(), &args.results);
    let set = data_set(&inputs)?;
    let files = files(&set, &args.data)?;
    args.limits.allow(&args.scenario, &need::of_diagnose(&files), results.quiet)?;
    let runs = set.runs(&files, set.tissue.layers.len())?;
    let folder = results.folder(&args.scenario, "-diagnosis");
    if !set.split_by.is_empty() {
        let found = specimens(&set, &runs)?;
        return results.conclude(&folder, &found.output(&set, &inputs)?, || indented(&found));
    }
    let mut tell = teller(results.quiet, "");
    let found = repeats(&set, &runs, !args.data.is_empty(), &mut tell)?;
    results.conclude(&folder, &found.output(&set, &inputs)?, || {
        format!("{}{}", summary(&found.study), online::summary(&found.online))
    })
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
        "\n  each run predicted without it (N rms)\n    {:>10} {:>5} {:>8} {:>8} {:>9} {:>9} {:>9} {:>16}",
        "mm/s", "runs", "floor", "base", "extended", "and alike", "in band", "speed left out"
    );
    let mut line = |name: String, runs: usize, floor, errors: [f64; 3], covered: f64, speed| {
        let [base, law, alike] = errors;
        let _ = writeln!(
            out,
            "    {name:>10} {runs:>5} {:>8} {base:>8.3} {law:>9.3} {alike:>9.3} {:>8.1}% {:>16}",
            three(floor),
            100.0 * covered,
            three(speed)
        );
    };
    for s in &r.speeds {
        line(
            format!("{:.2}", 1e3 * s.speed_mps),
            s.runs,
            s.floor_n,
            [s.base_n, s.law_n, s.extended_n],
            s.covered,
            s.speed_left_out_n,
        );
    }
    let m = &r.mean;
    line(
        "mean".to_owned(),
        r.runs.len(),
        m.floor_n,
        [m.base_n, m.law_n, m.extended_n],
        m.covered,
        m.speed_left_out_n,
    );
    let _ = writeln!(
        out,
        "  and alike: with what the law leaves alike of the other runs of a speed, learned beside it; it names no cause"
    );
    if let Some(nested) = &r.nested {
        let _ = writeln!(
            out,
            "  parts of the set left out: {:.3} N by the law, {:.3} N by laws chosen without them",
            nested.chosen_with_n, nested.chosen_without_n
        );
    }
    let _ = writeln!(out, "  base law with a whole speed left out: {} N", three(m.base_speed_left_out_n));
    let _ = writeln!(
        out,
        "  the floor is the mean of the others, which scatters itself; without that: {} N",
        three(m.floor_bare_n)
    );
    if let Some(covered) = m.speed_covered {
        let _ = writeln!(out, "  in the band of a speed that took no part: {:.1} %", 100.0 * covered);
    }
    for p in &r.parts_of_insertion {
        let _ = writeln!(
            out,
            "  {:<28} law {:.3} N, and alike {:.3} N, floor {}",
            p.part,
            p.law_n,
            p.extended_n,
            three(p.floor_n)
        );
    }
    if r.starts.0 > 1 {
        let _ = writeln!(out, "  {} of {} starts of the fit agree", r.starts.1, r.starts.0);
    }
    for said in &d.advice {
        let _ = writeln!(out, "  {said}");
    }
    if let Some(parts) = &r.parts {
        for (name, floor, error) in &parts.alone {
            let _ = writeln!(out, "  {name}: {error:.3} N on runs left out, floor {}", three(*floor));
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

fn indented(Indented { found, diagnosis: d }: &Indented) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}\n", stylet_pages::specimens::sentence(found));
    let _ = writeln!(
        out,
        "    {:<36} {:>10} {:>16} {:>8}",
        "median error, mN", "fitted", "rest of hold", "better"
    );
    for r in &found.rungs {
        let _ = writeln!(
            out,
            "    {:<36} {:>10.2} {:>16.2} {:>7.0} % {}",
            r.step,
            1e3 * r.fitted_n,
            1e3 * r.left_out_n,
            100.0 * r.better,
            if r.kept { "" } else { "not kept" }
        );
    }
    for n in &found.numbers {
        let _ = writeln!(
            out,
            "    {} = {} (95 %: {} to {}; nine of ten specimens {} to {})",
            n.name,
            significant(n.mean, 3),
            significant(n.low, 3),
            significant(n.high, 3),
            significant(n.nine_of_ten.0, 2),
            significant(n.nine_of_ten.1, 2)
        );
    }
    let _ = writeln!(
        out,
        "    noise {} mN; punctures {}",
        significant(1e3 * d.noise.sd_n, 2),
        found.punctured.len()
    );
    for (name, why) in &found.unused {
        let _ = writeln!(out, "  not used: {name}: {why}");
    }
    out
}
