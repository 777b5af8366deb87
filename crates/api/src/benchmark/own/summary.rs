//! Rates, confusion matrix, power and calibration of examined cases.

use super::case::Case;
use stylet_diagnose::Verdict;
use stylet_own_world::{Kind, Size};
use stylet_tissue::ForceGain;

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
pub fn summary(cases: &[Case]) -> String {
    use std::collections::BTreeMap;
    use std::fmt::Write as _;
    let mut out = String::new();
    let line = |out: &mut String, name: &str, chosen: Vec<&Case>| {
        let right = chosen.iter().filter(|c| c.right).count();
        let _ = writeln!(out, "{name:<44} {}", wilson(right, chosen.len()));
    };
    let of = |kind: Kind| cases.iter().filter(move |c| c.kind == kind);
    let _ = writeln!(out, "{} cases\n", cases.len());
    line(&mut out, "clean, called clean", of(Kind::Clean).collect());
    for size in [Size::Strong, Size::Medium, Size::Faint] {
        let single: Vec<&Case> = of(Kind::Single)
            .filter(|c| c.size == size && c.hidden != [ForceGain::ID])
            .filter(|c| size != Size::Faint || c.right || c.truth_nats.is_none_or(|n| n > 20.0))
            .collect();
        line(&mut out, &format!("one effect, {size:?}: named, or in its class"), single);
    }
    line(
        &mut out,
        &format!("{}: listed as invisible", ForceGain::ID),
        of(Kind::Single).filter(|c| c.hidden == [ForceGain::ID]).collect(),
    );
    line(&mut out, "two effects, both named", of(Kind::Two).collect());
    for size in [Size::Strong, Size::Medium, Size::Faint] {
        let outside: Vec<&Case> = of(Kind::Outside).filter(|c| c.size == size).collect();
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
        let bin: Vec<&Case> =
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
        let mut own: Vec<&Case> = of(Kind::Single).filter(|c| c.hidden == [name]).collect();
        own.sort_by(|a, b| b.strength.total_cmp(&a.strength));
        let (mut right, mut least) = (0, f64::NAN);
        for (k, c) in own.iter().enumerate() {
            right += usize::from(c.right);
            if right as f64 >= 0.8 * (k + 1) as f64 {
                least = c.strength;
            }
        }
        let per = |size: Size| {
            let of_size: Vec<&&Case> = own.iter().filter(|c| c.size == size).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

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

    fn one(kind: Kind, hidden: &[&str], named: &[&[&str]], right: bool, strength: f64) -> Case {
        let owned = |all: &[&str]| all.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
        Case {
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
    }
}
