//! `stylet effects`: the library of effects that extend the base law.

use crate::cli::args::EffectsArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print;
use std::fmt::Write as _;
use stylet_api::reference_insertion::{ReferenceInsertion, reference_insertion};
use stylet_report::significant;
use stylet_scenario::{closest_name, effect_line, load_effects, renamed_ron_name};
use stylet_tissue::{Effect, EffectInfo, general_effects, per_layer_effects};

/// Lists the effects, or shows one.
///
/// # Errors
/// [`Failure::Check`] for an effect that is not in the library.
pub fn effects(args: &EffectsArgs) -> Result<(), Failure> {
    let mut own = Vec::new();
    for file in &args.effects {
        own.extend(load_effects(file)?.iter().map(Effect::info));
    }
    let library = || general_effects().chain(per_layer_effects()).chain(own.iter().copied());
    let Some(name) = &args.name else {
        let mut text = String::new();
        for effect in library() {
            let _ =
                writeln!(text, "{:<26} {}\n{:<26} {}\n", effect.id, effect.equation, "", effect.signature);
        }
        text += "stylet effects NAME shows one: parameters, source, a line to paste, the force of a reference insertion.\n";
        return print(&text);
    };
    let id = snake_case(name);
    match library().find(|e| e.id == id) {
        Some(effect) => print(&describe(effect)),
        None => {
            let known: Vec<&str> = library().map(|e| e.id).collect();
            let hint = renamed_ron_name(&id, &known)
                .map(|renamed| format!(": {renamed}"))
                .or_else(|| Some(format!("; did you mean `{}`?", closest_id(&id, &known)?)))
                .unwrap_or_default();
            Err(Failure::Check(format!("there is no effect `{name}`{hint}; `stylet effects` lists them")))
        }
    }
}

/// Converts a name such as `CoulombFriction` to an id.
fn snake_case(name: &str) -> String {
    let mut id = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !id.is_empty() {
            id.push('_');
        }
        id.push(c.to_ascii_lowercase());
    }
    id
}

/// Suggestion for a misspelt id: the closest id, or the one with the closest word.
fn closest_id<'a>(wrong: &str, known: &[&'a str]) -> Option<&'a str> {
    let words: Vec<&str> = known.iter().flat_map(|id| id.split('_')).collect();
    closest_name(wrong, known).or_else(|| known.iter().find(|id| id.contains(wrong)).copied()).or_else(|| {
        let word = closest_name(wrong, &words)?;
        known.iter().find(|id| id.split('_').any(|w| w == word)).copied()
    })
}

fn describe(effect: &'static EffectInfo) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}\n\n  {}\n\n  source     {}\n  signature  {}\n",
        effect.id, effect.equation, effect.source, effect.signature
    );
    for p in effect.parameters {
        let unit = if p.unit.is_empty() { "-" } else { p.unit };
        let _ = writeln!(
            out,
            "  {:<24} {:<8} {}; {} to {}, inactive {}, typical {}",
            p.path,
            unit,
            p.meaning,
            significant(p.low, 3),
            significant(p.high, 3),
            significant(p.inactive, 3),
            significant(p.start, 3)
        );
    }
    let _ = writeln!(out, "\n  in a scenario: effects: [{}]", effect_line(effect).trim_end_matches(','));
    out.push_str(&reference_plot(effect));
    out
}

/// Text plot of the force over time, with (`#`) and without (`.`) the effect.
fn reference_plot(entry: &'static EffectInfo) -> String {
    const WIDTH: usize = 90;
    const HEIGHT: usize = 18;
    let ReferenceInsertion { parameters, base_n: base, with_effect_n: changed } = reference_insertion(entry);
    let all = || base.iter().chain(&changed).copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let mut rows = vec![vec![' '; WIDTH]; HEIGHT];
    for (curve, mark) in [(&base, '.'), (&changed, '#')] {
        for (i, f) in curve.iter().enumerate() {
            let column = i * WIDTH / curve.len().max(1);
            let row = ((high - f) / (high - low).max(1e-12) * (HEIGHT - 1) as f64).round() as usize;
            if let Some(cell) = rows.get_mut(row).and_then(|r| r.get_mut(column)) {
                *cell = mark;
            }
        }
    }
    let mut out = format!(
        "\n  force at the needle's base (N) against time, 25 s: ripple, hold at 10 s, advance at 14 s, retraction at 20 s\n  `.` base law, `#` with {} = {}\n\n",
        entry.parameters.iter().map(|p| p.path).collect::<Vec<_>>().join(", "),
        parameters.iter().map(|x| significant(*x, 3)).collect::<Vec<_>>().join(", ")
    );
    for (k, row) in rows.iter().enumerate() {
        let value = high - (high - low) * k as f64 / (HEIGHT - 1) as f64;
        let _ = writeln!(out, "  {value:>7.2} |{}", row.iter().collect::<String>().trim_end());
    }
    out
}
