//! The examination: diagnoses drawn cases and compares with what was hidden.

use crate::base::{Prepared, base};
use crate::diagnose::{Evidence, Options, belief, diagnose};
use crate::held_out::{by_its_own, rms};
use crate::hidden::{self, Drawn, Kind, Size, Sketch};
use crate::outcome::{Estimate, Verdict};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;
use stylet_identify::blocks::{BLOCK_S, Blocks};
use stylet_identify::fit::Fit;
use stylet_identify::model::{Choice, Model};
use stylet_identify::objective::Data;
use stylet_tissue::{AnyEffect, Effect};

/// What came of one case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Result {
    /// Index of the case.
    pub index: u64,
    /// Kind.
    pub kind: Kind,
    /// What was hidden.
    pub hidden: Vec<String>,
    /// Its parameters.
    pub values: Vec<Vec<f64>>,
    /// Its strength in noise standard deviations after re-fitting the base.
    pub strength: f64,
    /// Class of the strength.
    pub size: Size,
    /// Pole of the noise.
    pub ar: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// What was named, with its class.
    pub named: Vec<Vec<String>>,
    /// Confidence of each.
    pub confidence: Vec<f64>,
    /// Invisible effects.
    pub invisible: Vec<String>,
    /// Whether it was right.
    pub right: bool,
    /// Nats by which the true model beats the base (NaN when not worked out).
    pub truth_nats: Option<f64>,
    /// Relative errors of the parameters of the truth, when named, and whether the interval holds it.
    pub errors: Vec<(String, f64, bool)>,
    /// Held-out gain over the possible one.
    pub gain: Option<f64>,
    /// Residual before, after, with the truth (N).
    pub rms_n: [f64; 3],
    /// Leftover p-value and nats.
    pub leftover: (f64, f64),
    /// Nats explained.
    pub explained: f64,
    /// Seconds.
    pub seconds: f64,
    /// Samples.
    pub samples: usize,
}

/// Strength of what is hidden after re-fitting the base law.
fn strength(drawn: &Drawn) -> Option<f64> {
    let case = hidden::case(drawn);
    let blocks = case.recordings.iter().map(|r| Blocks::new(r, &[], BLOCK_S)).collect();
    let (fit, data) = base(&Prepared::new(Arc::new(belief(&case.believed)), blocks, 0.0))?;
    Some(size_of(&fit, &data, drawn))
}

/// Root mean square of what the fitted base law leaves of the force without noise, in standard deviations of the noise.
fn size_of(fit: &Fit, data: &Data, drawn: &Drawn) -> f64 {
    let mut clean = data.clone();
    let mut blocks = clean.blocks.to_vec();
    for (b, f) in blocks.iter_mut().zip(&hidden::clean_force(drawn)) {
        let mut sums = vec![(0.0, 0.0); b.len()];
        for (f, k) in f.iter().zip(b.raw_block.iter()) {
            sums[*k as usize].0 += f;
            sums[*k as usize].1 += 1.0;
        }
        b.f = sums.iter().map(|(s, n)| s / f64::max(*n, 1.0)).collect();
    }
    clean.blocks = Arc::new(blocks);
    let (mut square, mut n) = (0.0, 0.0);
    for r in 0..clean.recordings() {
        let Some(left) = by_its_own(&fit.model, &clean, r) else { continue };
        let b = &clean.blocks[r];
        // A rupture early or late by a part of a sample says nothing of an effect.
        let near = |k: usize| left.instants.iter().any(|t| t.is_finite() && b.at(*t).abs_diff(k) <= 1);
        for k in (0..b.len()).filter(|k| b.used[*k] && !near(*k)) {
            square += left.e[k] * left.e[k];
            n += 1.0;
        }
    }
    let mut square = square / f64::max(n, 1.0);
    for e in &drawn.effects {
        if let AnyEffect::ForceSpikes(s) = e {
            square += s.rate_hz / hidden::SAMPLE_HZ * s.size_n * s.size_n;
        }
    }
    square.sqrt() / drawn.noise_n
}

/// Draws the strengths that a sketch aims at.
#[must_use]
pub fn aim(sketch: &Sketch) -> Drawn {
    let mut drawn = sketch.drawn.clone();
    if drawn.effects.is_empty() {
        return drawn;
    }
    let target = sketch.target / (drawn.effects.len() as f64).sqrt();
    let largest = hidden::largest_force(&drawn);
    let all = drawn.effects.clone();
    let mut made = Vec::new();
    for effect in all {
        let mut e = effect;
        if e.id() == gain() {
            made.push(e);
            continue;
        }
        for _ in 0..4 {
            let one = Drawn { effects: vec![e.clone()], ..drawn.clone() };
            let Some(s) = strength(&one) else { break };
            let factor = target / s.max(1e-3);
            if (0.8..1.25).contains(&factor) {
                break;
            }
            let Some(next) = hidden::scaled(&e, factor.clamp(0.02, 30.0), largest) else { break };
            e = next;
        }
        made.push(e);
    }
    drawn.effects = made;
    drawn
}

/// Runs one case.
#[must_use]
pub fn run(index: u64, sketch: &Sketch) -> Option<Result> {
    examine(index, sketch.kind, &aim(sketch))
}

/// Runs one case whose strengths are drawn already.
#[must_use]
pub fn examine(index: u64, kind: Kind, drawn: &Drawn) -> Option<Result> {
    let case = hidden::case(drawn);
    let evidence: Vec<Evidence> = case
        .recordings
        .iter()
        .enumerate()
        .map(|(k, r)| Evidence { name: format!("{k}.csv"), recording: r.clone(), notes: Vec::new() })
        .collect();
    let start = Instant::now();
    let examined = diagnose(&case.believed, &evidence, &Options::default(), |_| {}).ok()?;
    let seconds = start.elapsed().as_secs_f64();
    let (d, search) = (&examined.diagnosis, &examined.search);
    let strength = size_of(&search.base, &search.data, drawn);
    let hidden_ids: Vec<String> = drawn.effects.iter().map(|e| e.id().to_owned()).collect();
    let named: Vec<Vec<String>> = d
        .causes
        .iter()
        .map(|c| std::iter::once(c.effect.clone()).chain(c.equivalent.iter().cloned()).collect())
        .collect();
    let right = match kind {
        Kind::Clean => d.verdict == Verdict::None,
        Kind::Outside => d.verdict == Verdict::Unknown,
        _ if hidden_ids == [gain()] => d.invisible.contains(&hidden_ids[0]) && d.verdict == Verdict::None,
        // What a single recording cannot show has to be listed as invisible.
        _ if drawn.motions == hidden::Motions::One && d.verdict == Verdict::None => {
            hidden_ids.iter().all(|h| d.invisible.contains(h))
        }
        _ => {
            named.len() == hidden_ids.len()
                && hidden_ids.iter().all(|h| named.iter().any(|class| class.contains(h)))
        }
    };
    let mut errors = Vec::new();
    for effect in &drawn.effects {
        let Some(cause) = d.causes.iter().find(|c| c.effect == effect.id()) else { continue };
        for (p, truth) in effect.info().parameters.iter().zip(effect.parameters()) {
            let Some(found) = cause.parameters.get(p.path) else { continue };
            if p.whole {
                continue;
            }
            let (error, held) = error(p.unit, found, truth);
            errors.push((format!("{}.{}", effect.id(), p.path), error, held));
        }
    }
    // What the truth would leave.
    let choices: Vec<Choice> = drawn.effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    let mut truth = Model::base(Arc::new(belief(&case.believed)), case.recordings.len());
    truth.tissue = case.truth.clone();
    truth.effects = choices;
    let left: Vec<_> = (0..case.recordings.len()).map(|r| by_its_own(&truth, &search.data, r)).collect();
    let after_true = rms(&left, &search.data);
    let (before, after) = (d.gain.rmse_before_n, d.gain.rmse_after_n);
    let gain = (before - after_true > 0.03 * before).then(|| (before - after) / (before - after_true));
    Some(Result {
        index,
        kind,
        hidden: if let Some(o) = &drawn.outside {
            vec![hidden::OUTSIDE[o.kind].to_owned()]
        } else {
            hidden_ids
        },
        values: drawn.effects.iter().map(AnyEffect::parameters).collect(),
        strength,
        size: Size::of(strength),
        ar: drawn.ar[0],
        verdict: d.verdict,
        named,
        confidence: d.causes.iter().map(|c| c.confidence).collect(),
        invisible: d.invisible.clone(),
        right,
        truth_nats: None,
        errors,
        gain,
        rms_n: [before, after, after_true],
        leftover: (d.leftover.p_value, d.leftover.nats),
        explained: search.base.nats() - search.best.nats(),
        seconds,
        samples: case.recordings.iter().map(stylet_record::Recording::len).sum(),
    })
}

/// How far a number is off, relative to the truth or, for an angle, in radians, and whether its interval holds the truth. An angle may be
/// told whole turns away.
fn error(unit: &str, found: &Estimate, truth: f64) -> (f64, bool) {
    const TURN: f64 = core::f64::consts::TAU;
    let angle = unit == "rad";
    let turns = if angle { ((truth - found.value) / TURN).round() * TURN } else { 0.0 };
    let size = if angle { 1.0 } else { truth.abs().max(1e-12) };
    let held = found.low + turns <= truth && truth <= found.high + turns;
    ((found.value + turns - truth).abs() / size, held)
}

/// Wilson's 95 % interval of a rate, in per cent.
fn wilson(right: usize, of: usize) -> String {
    if of == 0 {
        return "-".to_owned();
    }
    let rate = stylet_stats::wilson(right, of);
    format!(
        "{right}/{of} = {:.1} % ({:.1} to {:.1})",
        100.0 * rate.value,
        100.0 * rate.low,
        100.0 * rate.high
    )
}

/// Rates, confusion matrix, power and calibration of examined cases, as text.
#[must_use]
pub fn summary(cases: &[Result]) -> String {
    use std::collections::BTreeMap;
    use std::fmt::Write as _;
    let mut out = String::new();
    let line = |out: &mut String, name: &str, chosen: Vec<&Result>| {
        let right = chosen.iter().filter(|c| c.right).count();
        let _ = writeln!(out, "{name:<44} {}", wilson(right, chosen.len()));
    };
    let of = |kind: Kind| cases.iter().filter(move |c| c.kind == kind);
    let _ = writeln!(out, "{} cases\n", cases.len());
    line(&mut out, "clean, called clean", of(Kind::Clean).collect());
    for size in [Size::Strong, Size::Medium, Size::Faint] {
        let single: Vec<&Result> = of(Kind::Single)
            .filter(|c| c.size == size && c.hidden != [gain()])
            .filter(|c| size != Size::Faint || c.right || c.truth_nats.is_none_or(|n| n > 20.0))
            .collect();
        line(&mut out, &format!("one effect, {size:?}: named, or in its class"), single);
    }
    line(
        &mut out,
        &format!("{}: listed as invisible", gain()),
        of(Kind::Single).filter(|c| c.hidden == [gain()]).collect(),
    );
    line(&mut out, "two effects, both named", of(Kind::Two).collect());
    for size in [Size::Strong, Size::Medium, Size::Faint] {
        let outside: Vec<&Result> = of(Kind::Outside).filter(|c| c.size == size).collect();
        let named =
            outside.iter().filter(|c| matches!(c.verdict, Verdict::Named | Verdict::Ambiguous)).count();
        let _ = writeln!(
            out,
            "{:<44} {}",
            format!("outside the library, {size:?}: wrongly named"),
            wilson(named, outside.len())
        );
        line(&mut out, &format!("outside the library, {size:?}: unknown"), outside);
    }
    let strong = || of(Kind::Single).filter(|c| c.size == Size::Strong && c.right);
    let mut errors: Vec<f64> = strong().flat_map(|c| c.errors.iter().map(|e| e.1)).collect();
    let _ = writeln!(
        out,
        "\nparameter error, strong: median {:.3} %, p90 {:.3} %",
        100.0 * stylet_stats::quantile(&mut errors, 0.5),
        100.0 * stylet_stats::quantile(&mut errors, 0.9)
    );
    for size in [Size::Strong, Size::Medium, Size::Faint] {
        let held: Vec<bool> = of(Kind::Single)
            .filter(|c| c.size == size && c.right)
            .flat_map(|c| c.errors.iter().map(|e| e.2))
            .collect();
        let _ = writeln!(
            out,
            "95 % intervals, {size:?}: hold the truth in {}",
            wilson(held.iter().filter(|h| **h).count(), held.len())
        );
    }
    let mut by_parameter: BTreeMap<&str, (usize, usize, f64)> = BTreeMap::new();
    for e in of(Kind::Single).filter(|c| c.right).flat_map(|c| &c.errors) {
        let slot = by_parameter.entry(&e.0).or_default();
        slot.0 += usize::from(e.2);
        slot.1 += 1;
        slot.2 = slot.2.max(e.1);
    }
    for (name, (held, all, worst)) in by_parameter {
        let _ = writeln!(out, "    {name:<48} held {held}/{all}, worst error {:.2} %", 100.0 * worst);
    }
    let mut gains: Vec<f64> = strong().filter_map(|c| c.gain).collect();
    let _ = writeln!(
        out,
        "held-out gain over the possible one, strong: p10 {:.4}, median {:.4}",
        stylet_stats::quantile(&mut gains, 0.1),
        stylet_stats::quantile(&mut gains, 0.5)
    );
    let worse = of(Kind::Clean).filter(|c| c.rms_n[1] > 1.01 * c.rms_n[0]).count();
    let _ = writeln!(
        out,
        "clean data, worse than the base by more than 1 %: {}",
        wilson(worse, of(Kind::Clean).count())
    );
    let mut seconds: Vec<f64> = cases.iter().map(|c| c.seconds).collect();
    let _ = writeln!(
        out,
        "seconds per case (cases run side by side): median {:.2}, p90 {:.2}",
        stylet_stats::quantile(&mut seconds, 0.5),
        stylet_stats::quantile(&mut seconds, 0.9)
    );
    // Confidence.
    let _ = writeln!(out, "\nconfidence against truth (one effect):");
    for (lo, hi) in [(0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)] {
        let bin: Vec<&Result> =
            of(Kind::Single).filter(|c| c.confidence.first().is_some_and(|p| *p >= lo && *p < hi)).collect();
        let first =
            bin.iter().filter(|c| c.named.first().and_then(|n| n.first()) == c.hidden.first()).count();
        let _ = writeln!(
            out,
            "    said {lo:.2} to {:.2}: the first named is it in {}",
            hi.min(1.0),
            wilson(first, bin.len())
        );
    }
    // Power.
    let _ = writeln!(
        out,
        "\npower (named or in its class, by strength in noise sd) and the smallest strength from which 80 % are named:"
    );
    let mut names: Vec<&str> =
        of(Kind::Single).filter_map(|c| c.hidden.first().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let mut own: Vec<&Result> = of(Kind::Single).filter(|c| c.hidden == [name]).collect();
        own.sort_by(|a, b| b.strength.total_cmp(&a.strength));
        let (mut right, mut least) = (0, f64::NAN);
        for (k, c) in own.iter().enumerate() {
            right += usize::from(c.right);
            if right as f64 >= 0.8 * (k + 1) as f64 {
                least = c.strength;
            }
        }
        let per = |size: Size| {
            let of_size: Vec<&&Result> = own.iter().filter(|c| c.size == size).collect();
            format!("{}/{}", of_size.iter().filter(|c| c.right).count(), of_size.len())
        };
        let _ = writeln!(
            out,
            "    {name:<26} strong {:>6}  medium {:>6}  faint {:>6}  below {:>6}  80 % from {least:.2} sd",
            per(Size::Strong),
            per(Size::Medium),
            per(Size::Faint),
            per(Size::Below)
        );
    }
    // Confusion.
    let _ = writeln!(out, "\nconfusion: hidden -> said (cases)");
    let mut matrix: BTreeMap<(String, String), usize> = BTreeMap::new();
    for c in cases.iter().filter(|c| c.kind != Kind::Two) {
        let hidden = c.hidden.first().cloned().unwrap_or_else(|| "(clean)".to_owned());
        let said = match c.verdict {
            Verdict::None => "none".to_owned(),
            Verdict::Unknown => "unknown".to_owned(),
            _ => c.named.iter().map(|n| n.join("|")).collect::<Vec<_>>().join(" + "),
        };
        *matrix.entry((hidden, said)).or_default() += 1;
    }
    for ((hidden, said), n) in matrix {
        let _ = writeln!(out, "    {hidden:<34} -> {said:<60} {n}");
    }
    out
}

/// What no law of the tissue can tell from a stiffer tissue.
fn gain() -> &'static str {
    stylet_tissue::ForceGain { eps: 0.0 }.info().id
}

#[cfg(test)]
mod tests {
    use super::{Result, aim, error, examine, gain, strength, summary, wilson};
    use crate::hidden::{Drawn, Kind, Motions, Outside, Size, Sketch};
    use crate::outcome::{Estimate, Verdict};
    use stylet_tissue::{AnyEffect, CoulombFriction, ForceGain, ForceSpikes, PeriodicInterference};

    #[test]
    fn a_rate_is_told_in_per_cent_with_its_interval() {
        assert_eq!(wilson(0, 0), "-");
        // Wilson's interval of 7 of 9, by hand.
        let (n, p, z) = (9.0, 7.0 / 9.0, 1.959_963_984_540_054_f64);
        let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt() / (1.0 + z * z / n);
        let wanted =
            format!("7/9 = 77.8 % ({:.1} to {:.1})", 100.0 * (middle - half), 100.0 * (middle + half));
        assert_eq!(wilson(7, 9), wanted);
    }

    fn one(kind: Kind, hidden: &[&str], named: &[&[&str]], right: bool, strength: f64) -> Result {
        let owned = |all: &[&str]| all.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
        Result {
            index: 0,
            kind,
            hidden: owned(hidden),
            values: Vec::new(),
            strength,
            size: Size::of(strength),
            ar: 0.0,
            verdict: if named.is_empty() { Verdict::None } else { Verdict::Named },
            named: named.iter().map(|n| owned(n)).collect(),
            confidence: named.iter().map(|_| 0.97).collect(),
            invisible: Vec::new(),
            right,
            truth_nats: None,
            errors: Vec::new(),
            gain: None,
            rms_n: [0.02; 3],
            leftover: (1.0, 0.0),
            explained: 0.0,
            seconds: 1.0,
            samples: 10,
        }
    }

    /// Each line of the summary counts what it says.
    #[test]
    fn the_summary_counts_cases_by_what_was_hidden_and_said() {
        let mut all = vec![
            one(Kind::Clean, &[], &[], true, 0.0),
            one(Kind::Clean, &[], &[], true, 0.0),
            one(Kind::Clean, &[], &[&["time_delay"]], false, 0.0),
            one(Kind::Single, &["force_drift"], &[&["force_drift"]], true, 9.0),
            one(Kind::Single, &["force_drift"], &[&["force_bias", "force_drift"]], true, 7.0),
            one(Kind::Single, &["force_drift"], &[&["time_delay"], &["force_bias"]], false, 6.0),
            one(Kind::Single, &["force_drift"], &[], false, 1.0),
            one(Kind::Single, &["force_bias"], &[&["force_bias"]], true, 2.0),
            one(Kind::Single, &["force_bias"], &[], false, 0.3),
            one(Kind::Single, &["force_bias"], &[], false, 0.2),
            one(Kind::Single, &["force_bias"], &[&["force_bias"]], true, 0.1),
            one(Kind::Single, &["force_gain"], &[], true, 0.4),
            one(Kind::Single, &["force_gain"], &[], true, 6.4),
            one(Kind::Two, &["force_bias", "time_delay"], &[&["force_bias"]], false, 9.0),
            one(Kind::Outside, &["chirp"], &[], true, 8.0),
            one(Kind::Outside, &["chirp"], &[&["force_drift"]], false, 7.0),
            one(Kind::Outside, &["chirp"], &[&["force_drift"]], false, 0.3),
        ];
        all[14].verdict = Verdict::Unknown;
        all[1].rms_n = [0.02, 0.0203, 0.02];
        all[2].rms_n = [0.02, 0.0201, 0.02];
        // What is too small to be told from the truth's own likelihood does not count as a miss.
        all[8].truth_nats = Some(19.0);
        all[9].truth_nats = Some(21.0);
        all[3].errors =
            vec![("force_drift.rate".to_owned(), 0.01, true), ("force_drift.x".to_owned(), 0.04, false)];
        all[4].errors = vec![("force_drift.rate".to_owned(), 0.02, true)];
        all[5].errors = vec![("force_drift.rate".to_owned(), 9.0, false)];
        all[7].errors = vec![("force_bias.f".to_owned(), 0.3, true)];
        (all[3].gain, all[4].gain, all[5].gain) = (Some(0.9), Some(0.7), Some(0.1));
        all[5].confidence = vec![0.6, 0.97];
        all[4].confidence = vec![0.8];
        all[7].confidence = vec![0.4];
        all[0].seconds = 5.0;
        let text = summary(&all);
        let has = |wanted: &str| {
            let squeezed = |t: &str| t.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(text.lines().any(|l| squeezed(l).starts_with(&squeezed(wanted))), "{wanted}\n{text}");
        };
        has("17 cases");
        has("clean, called clean 2/3 = 66.7 %");
        has("one effect, Strong: named, or in its class 2/3");
        has("one effect, Medium: named, or in its class 1/2");
        has("one effect, Faint: named, or in its class 0/1");
        has("force_gain: listed as invisible 2/2");
        has("two effects, both named 0/1");
        has("outside the library, Strong: wrongly named 1/2");
        has("outside the library, Strong: unknown 1/2");
        has("outside the library, Medium: unknown -");
        has("outside the library, Faint: wrongly named 1/1");
        has("outside the library, Faint: unknown 0/1");
        // The median of 1, 2, 4 per cent.
        has("parameter error, strong: median 2.000 %, p90 3.600 %");
        has("95 % intervals, Strong: hold the truth in 2/3");
        has("95 % intervals, Medium: hold the truth in 1/1");
        has("95 % intervals, Faint: hold the truth in -");
        has("force_drift.rate held 2/2, worst error 2.00 %");
        has("force_drift.x held 0/1, worst error 4.00 %");
        has("force_bias.f held 1/1, worst error 30.00 %");
        has("held-out gain over the possible one, strong: p10 0.7200, median 0.8000");
        has("clean data, worse than the base by more than 1 %: 1/3");
        has("seconds per case (cases run side by side): median 1.00, p90 1.00");
        has("said 0.00 to 0.50: the first named is it in 1/1");
        has("said 0.50 to 0.80: the first named is it in 0/1");
        has("said 0.80 to 0.95: the first named is it in 0/1");
        has("said 0.95 to 1.00: the first named is it in 2/2");
        // By strength 9, 7, 6 (missed), 1 (missed): four fifths hold down to 7. Of 2, 0.3, 0.2, 0.1: down to 2.
        has("force_drift strong 2/3 medium 0/1 faint 0/0 below 0/0 80 % from 7.00 sd");
        has("force_bias strong 0/0 medium 1/1 faint 0/2 below 1/1 80 % from 2.00 sd");
        has("(clean) -> none 2");
        has("(clean) -> time_delay 1");
        has("force_drift -> force_bias|force_drift 1");
        has("force_drift -> time_delay + force_bias 1");
        has("chirp -> unknown 1");
        has("chirp -> force_drift 2");
        has("force_gain -> none 2");
        assert!(
            !text.contains("force_bias, time_delay")
                && !text.contains("force_bias                         -> force_bias   2\n")
        );
        assert_eq!(gain(), "force_gain");
    }

    fn drawn(effects: Vec<AnyEffect>) -> Drawn {
        Drawn {
            seed: 21,
            effects,
            outside: None,
            noise_n: 0.02,
            ar: [0.0; 2],
            off: 0.1,
            motions: Motions::One,
            scatter: 0.0,
            velocity_noise_mps: 0.0,
        }
    }

    fn tone(amplitude_n: f64) -> AnyEffect {
        PeriodicInterference { amplitude_n, frequency_hz: 5.0, phase_rad: 0.3 }.into()
    }

    #[test]
    fn strengths_are_what_the_refitted_base_law_leaves_over_the_noise() {
        let nothing = strength(&drawn(Vec::new())).expect("a fit");
        assert!(nothing < 0.05, "{nothing}");
        // Spikes leave what they are by themselves: so many a second of so much.
        let spikes = ForceSpikes { rate_hz: 0.5, size_n: 0.8 };
        let told = strength(&drawn(vec![spikes.into()])).expect("a fit");
        let wanted = (0.5 / 200.0 * 0.8 * 0.8_f64).sqrt() / 0.02;
        assert!((told / wanted - 1.0).abs() < 0.02, "{told} for {wanted}");
        // A tone that no number of the base law follows, its mean over blocks of 20 ms.
        let of = |a: f64| strength(&drawn(vec![tone(a)])).expect("a fit");
        let (little, much) = (of(0.05), of(0.1));
        let seen = (0.1 * std::f64::consts::PI).sin() / (0.1 * std::f64::consts::PI);
        let wanted = 0.05 / 2.0_f64.sqrt() * seen / 0.02;
        assert!((little / wanted - 1.0).abs() < 0.02, "{little} for {wanted}");
        assert!((much / little - 2.0).abs() < 0.02, "{little} {much}");
    }

    #[test]
    fn strengths_are_drawn_to_the_target_and_what_the_base_law_swallows_is_left() {
        let sketch = |effects: Vec<AnyEffect>, target: f64| Sketch {
            kind: Kind::Single,
            target,
            drawn: drawn(effects),
        };
        for target in [3.0, 8.0] {
            let made = aim(&sketch(vec![tone(0.01)], target));
            let told = strength(&made).expect("a fit");
            assert!((0.8..1.25).contains(&(target / told)), "{told} for {target}");
        }
        let same = aim(&sketch(vec![ForceGain { eps: 0.02 }.into()], 8.0));
        assert_eq!(same.effects[0].parameters(), [0.02]);
        assert!(aim(&sketch(Vec::new(), 8.0)).effects.is_empty());
        // Two share the square of the strength.
        let two = aim(&sketch(vec![tone(0.01), ForceGain { eps: 0.02 }.into()], 8.0));
        let alone = Drawn { effects: vec![two.effects[0].clone()], ..two };
        let told = strength(&alone).expect("a fit") * 2.0_f64.sqrt();
        assert!((0.8..1.25).contains(&(8.0 / told)), "{told}");
    }

    #[test]
    fn a_case_examined_says_what_was_hidden_named_and_right() {
        let case = drawn(vec![CoulombFriction { c_n_per_m: 9.0 }.into()]);
        let r = examine(7, Kind::Single, &case).expect("a diagnosis");
        assert_eq!(
            (r.index, r.hidden.as_slice(), r.values.as_slice()),
            (7, &["coulomb_friction".to_owned()][..], &[vec![9.0]][..])
        );
        assert_eq!(r.named, [["coulomb_friction"]]);
        assert!(r.right && r.verdict == Verdict::Named && r.size == Size::of(r.strength) && r.strength > 5.0);
        let (name, error, _) = &r.errors[0];
        assert_eq!(name, "coulomb_friction.c_n_per_m");
        assert!(*error < 0.1, "{error}");
        assert!(r.gain.is_some_and(|g| (0.9..1.1).contains(&g)), "{:?}", r.gain);
        assert!(r.rms_n[1] < 0.03 && r.rms_n[2] < 0.03 && r.rms_n[0] > 2.0 * r.rms_n[1], "{:?}", r.rms_n);
        assert!(r.explained > 50.0 && r.seconds > 0.0 && r.samples > 1000);
        let clean = examine(1, Kind::Clean, &drawn(Vec::new())).expect("a diagnosis");
        assert!(clean.right && clean.gain.is_none() && clean.errors.is_empty() && clean.hidden.is_empty());
        let wrong = examine(1, Kind::Outside, &drawn(Vec::new())).expect("a diagnosis");
        assert!(!wrong.right);
        let missed = examine(1, Kind::Clean, &case).expect("a diagnosis");
        assert!(!missed.right);
        let scaled =
            examine(1, Kind::Single, &drawn(vec![ForceGain { eps: 0.03 }.into()])).expect("a diagnosis");
        assert!(scaled.right && scaled.verdict == Verdict::None, "{:?}", scaled.verdict);
        let outside = Drawn { outside: Some(Outside::new(3, [0.2; 4], 0.01)), ..drawn(Vec::new()) };
        assert_eq!(examine(1, Kind::Outside, &outside).expect("a diagnosis").hidden, ["chirp"]);
    }

    #[test]
    fn a_number_is_off_by_its_share_and_an_angle_by_what_is_left_of_whole_turns() {
        let said = |value: f64, half: f64| Estimate { value, low: value - half, high: value + half };
        let near = |(error, held): (f64, bool), wanted: f64, holds: bool| {
            assert!((error - wanted).abs() < 1e-12 && held == holds, "{error} {held}");
        };
        near(error("N", &said(2.2, 0.3), 2.0), 0.1, true);
        near(error("N", &said(-2.2, 0.1), -2.0), 0.1, false);
        near(error("N", &said(1.8, 0.1), 2.0), 0.1, false);
        near(error("N", &said(2.0, 0.0), 2.0), 0.0, true);
        let turn = std::f64::consts::TAU;
        near(error("rad", &said(0.3, 0.2), 0.5 + turn), 0.2, true);
        near(error("rad", &said(0.3 + 2.0 * turn, 0.1), 0.5), 0.2, false);
        near(error("rad", &said(6.2, 0.2), 0.1), 0.1 + turn - 6.2, true);
        near(error("rad", &said(0.1, 0.2), 6.2), 0.1 + turn - 6.2, true);
    }
}
