//! `stylet effects`: the library by which reality departs from the base law.

use crate::args::EffectsArgs;
use crate::exit::Failure;
use crate::terminal::say;
use std::fmt::Write as _;
use stylet_report::significant;
use stylet_tissue::{
    AnyEffect, EffectInfo, Law, LawState, Layer, Measurement, Reading, Tissue, info, library, per_layer,
};

/// The command.
///
/// # Errors
/// [`Failure::Argument`] for an effect that is not in the library.
pub fn effects(args: &EffectsArgs) -> Result<(), Failure> {
    match &args.name {
        None => {
            let mut text = String::new();
            for entry in library().chain(per_layer()) {
                let _ =
                    writeln!(text, "{:<26} {}\n{:<26} {}\n", entry.id, entry.equation, "", entry.signature);
            }
            text +=
                "stylet effects NAME shows one: its parameters, its source, what it does to an insertion.\n";
            say(&text)
        }
        Some(name) => match info(name) {
            Some(entry) => say(&one(entry)),
            None => {
                let known: Vec<&str> = library().chain(per_layer()).map(|e| e.id).collect();
                let hint = stylet_scenario::closest(name, &known)
                    .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
                Err(Failure::Argument(format!(
                    "there is no effect `{name}`{hint} `stylet effects` lists them"
                )))
            }
        },
    }
}

fn one(entry: &EffectInfo) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}\n\n  {}\n\n  source     {}\n  signature  {}\n",
        entry.id, entry.equation, entry.source, entry.signature
    );
    for p in entry.parameters {
        let unit = if p.unit.is_empty() { "-" } else { p.unit };
        let _ = writeln!(
            out,
            "  {:<24} {:<8} {}; {} to {}, neutral {}, typical {}",
            p.path,
            unit,
            p.meaning,
            significant(p.low, 3),
            significant(p.high, 3),
            significant(p.neutral, 3),
            significant(p.start, 3)
        );
    }
    out.push_str(&picture(entry));
    out
}

/// A reference insertion with ripple, hold and retraction: (t, z, v, a).
fn motion() -> Vec<[f64; 4]> {
    let (mut z, dt) = (-0.002, 0.005);
    (0..5000)
        .map(|i| {
            let t = f64::from(i) * dt;
            let w = core::f64::consts::TAU * 0.4;
            let (v, a) = match t {
                t if t < 10.0 => (0.003 + 0.0015 * (w * t).sin(), 0.0015 * w * (w * t).cos()),
                t if t < 14.0 => (0.0, 0.0),
                t if t < 20.0 => (0.004, 0.0),
                _ => (-0.008, 0.0),
            };
            z += v * dt;
            [t, z, v, a]
        })
        .collect()
}

fn force(effects: &[AnyEffect]) -> Vec<f64> {
    let layer = |d: f64, k: f64, b: f64, f: Option<f64>| Layer {
        name: String::new(),
        thickness_m: d,
        stiffness_n_per_m: k,
        friction_ns_per_m2: b,
        puncture_n: f,
    };
    let tissue = Tissue {
        surface_m: 0.0,
        layers: vec![
            layer(0.015, 60.0, 6000.0, None),
            layer(0.02, 90.0, 9000.0, Some(1.4)),
            layer(0.03, 70.0, 7000.0, None),
        ],
    };
    let Ok(law) = Law::new(&tissue, effects) else { return Vec::new() };
    let chain = Measurement::new(effects);
    let (mut state, mut measuring) = (LawState::default(), chain.start(200.0));
    motion()
        .into_iter()
        .map(|[t, z, v, a]| {
            let tissue_n = law.step(&mut state, t, z, v, |_| {}).total_n;
            chain.step(
                &mut measuring,
                &Reading { time_s: t, velocity_mps: v, acceleration_mps2: a, tissue_n, noise_n: 0.0 },
            )
        })
        .collect()
}

/// Force against time with (`#`) and without (`.`) the effect.
fn picture(entry: &EffectInfo) -> String {
    const WIDE: usize = 90;
    const HIGH: usize = 18;
    let typical: Vec<f64> = entry
        .parameters
        .iter()
        .map(|p| match (entry.id, p.path) {
            ("saturation", _) => 1.6,
            ("hidden_membrane", "depth_m") => 0.005,
            _ => p.start,
        })
        .collect();
    let with: Vec<AnyEffect> = AnyEffect::from_parameters(entry.id, &typical).into_iter().collect();
    let (base, changed) = (force(&[]), force(&with));
    let all = || base.iter().chain(&changed).copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let mut rows = vec![vec![' '; WIDE]; HIGH];
    for (curve, mark) in [(&base, '.'), (&changed, '#')] {
        for (i, f) in curve.iter().enumerate() {
            let column = i * WIDE / curve.len().max(1);
            let row = ((high - f) / (high - low).max(1e-12) * (HIGH - 1) as f64).round() as usize;
            if let Some(cell) = rows.get_mut(row).and_then(|r| r.get_mut(column)) {
                *cell = mark;
            }
        }
    }
    let mut out = format!(
        "\n  force at the needle's base (N) against time, 25 s: ripple, hold at 10 s, advance at 14 s, retraction at 20 s\n  `.` base law, `#` with {} = {}\n\n",
        entry.parameters.iter().map(|p| p.path).collect::<Vec<_>>().join(", "),
        typical.iter().map(|x| significant(*x, 3)).collect::<Vec<_>>().join(", ")
    );
    for (k, row) in rows.iter().enumerate() {
        let value = high - (high - low) * k as f64 / (HIGH - 1) as f64;
        let _ = writeln!(out, "  {value:>7.2} |{}", row.iter().collect::<String>().trim_end());
    }
    out
}
