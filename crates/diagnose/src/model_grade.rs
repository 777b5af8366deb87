//! Grade of the extended model: one letter, that of its worst part.
//!
//! | part | A | B | C | D |
//! |---|---|---|---|---|
//! | prediction error given the scatter between recordings, over noise or repeatability | at most 1.25 | 2 | 4 | more |
//! | residual | noise | | depends on a feature | unknown effect |
//! | share of determined parameters | at least 2/3 | 1/2 | 1/4 | fewer |
//! | causes | unique | equivalent ones | one at a bound | |
//! | recordings | different motions, each predicted from the others | one motion | one recording | |

use crate::claims::SIGNIFICANT_P_VALUE;
use crate::diagnosis_json::{Diagnosis, FindingKind, Grade, GradePart, Letter, ParameterLabel, Verdict};
use stylet_stats::number_format::significant;

/// Largest ratio of the prediction error to the noise for grades A, B and C.
const MAX_ERROR: [f64; 3] = [1.25, 2.0, 4.0];
/// Smallest share of determined parameters for grades A, B and C.
const MIN_DETERMINED: [f64; 3] = [2.0 / 3.0, 0.5, 0.25];

/// Grade of a finished diagnosis; errors up to `resolution_n` (N) are not a misfit.
pub fn grade(d: &Diagnosis, resolution_n: f64) -> Grade {
    let mut parts = Vec::new();
    let mut add = |part: &str, letter: Letter, reason: String| {
        parts.push(GradePart { part: part.to_owned(), letter, reason });
    };
    let g = &d.gain;
    let noise_n = g.floor_n.max(resolution_n).max(f64::MIN_POSITIVE);
    let ratio = g.misfit_n() / noise_n;
    let what = if g.held_out { "held-out recordings are predicted" } else { "the recording is fitted" };
    // For repeats the floor is their repeatability.
    let floor = if g.floor_n > d.noise.sd_n { "repeatability" } else { "noise" };
    let scatter = if g.is_worse() {
        ", worse than by the base law"
    } else if floor == "noise" && g.rmse_after_n > MAX_ERROR[0] * g.rmse_given_scatter_n.max(noise_n) {
        ", given the ruptures, surface and friction of each"
    } else {
        ""
    };
    add(
        "error",
        of_rank(rank(ratio, MAX_ERROR)),
        format!("{what} to {} times the {floor}{scatter}", significant(ratio, 2)),
    );
    let depends = d.residual_structure.depends_on.join(", ");
    match (d.verdict, d.residual_structure.p_value < SIGNIFICANT_P_VALUE) {
        (Verdict::Unknown, _) => {
            add("residual", Letter::D, "an effect is missing that the library does not contain".to_owned());
        }
        (_, true) => add("residual", Letter::C, format!("the residual depends on {depends}")),
        (_, false) => add("residual", Letter::A, "the residual is noise".to_owned()),
    }
    let total = d.parameters.len();
    let determined = d.parameters.iter().filter(|p| p.label == ParameterLabel::Determined).count();
    if total > 0 {
        let letter = of_rank(rank(-(determined as f64) / total as f64, MIN_DETERMINED.map(|x| -x)));
        add("parameters", letter, format!("{determined} of {total} parameters are determined"));
    }
    let at_bound = d.findings.iter().find(|f| f.kind == FindingKind::AtBound);
    match at_bound {
        Some(finding) => add("causes", Letter::C, finding.message.clone()),
        None if d.verdict == Verdict::Ambiguous => {
            add("causes", Letter::B, "other causes explain the recordings as well".to_owned());
        }
        None => {}
    }
    let has = |kind: FindingKind| d.findings.iter().any(|f| f.kind == kind);
    let (letter, reason) = if !g.held_out {
        (Letter::C, "one recording: the model predicted no other".to_owned())
    } else if has(FindingKind::OneMotion) {
        (Letter::B, "all recordings have the same motion".to_owned())
    } else {
        (Letter::A, format!("{} recordings, each predicted from the others", g.recordings.len()))
    };
    add("recordings", letter, reason);
    if has(FindingKind::Scatter) {
        add("recordings", Letter::C, "recordings differ too much for one model".to_owned());
    }
    let letter = parts.iter().map(|p| p.letter).max().unwrap_or_default();
    Grade { letter, parts }
}

/// Number of limits that a value exceeds.
fn rank(value: f64, limits: [f64; 3]) -> usize {
    limits.iter().filter(|limit| value.is_nan() || value > **limit).count()
}

fn of_rank(rank: usize) -> Letter {
    [Letter::A, Letter::B, Letter::C].get(rank).copied().unwrap_or(Letter::D)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_predicts_worse_than_the_base_law_has_no_good_grade() {
        let text = r#"{"verdict": "named", "causes": [], "not_identifiable": [], "data_quality": [], "search_steps": [], "advice": [],
            "base_parameters": [], "gain": {"held_out": true, "recordings": ["a", "b"], "rmse_before_n": 0.182, "rmse_after_n": 0.2,
            "rmse_given_scatter_n": 0.0093, "floor_n": 0.0093, "per_recording_n": []},
            "residual_structure": {"p_value": 0.4, "depends_on": [], "nats": 0}, "noise": {"sd_n": 0.0093, "ar": [0, 0], "from_air": false}}"#;
        let mut d: Diagnosis = serde_json::from_str(text).expect("a diagnosis");
        let of = |d: &Diagnosis| {
            let g = grade(d, 0.0);
            (g.letter, g.parts[0].reason.clone())
        };
        let known = "held-out recordings are predicted to 1 times the noise, given the ruptures, surface and friction of each";
        assert_eq!(of(&d), (Letter::A, known.to_owned()));
        d.gain.rmse_after_n = 0.388;
        let worse = "held-out recordings are predicted to 42 times the noise, worse than by the base law";
        assert_eq!(of(&d), (Letter::D, worse.to_owned()));
    }

    #[test]
    fn a_grade_is_as_good_as_its_worst_part() {
        assert_eq!(
            [1.0, 1.3, 2.1, 5.0, f64::NAN].map(|x| of_rank(rank(x, MAX_ERROR))),
            [Letter::A, Letter::B, Letter::C, Letter::D, Letter::D]
        );
        let part =
            |letter, reason: &str| GradePart { part: String::new(), letter, reason: reason.to_owned() };
        let parts = vec![part(Letter::A, "fine"), part(Letter::C, "one recording")];
        assert_eq!(Grade { letter: Letter::C, parts }.sentence(), "grade C: one recording");
        assert_eq!(Grade { letter: Letter::A, parts: vec![part(Letter::A, "fine")] }.sentence(), "grade A");
    }
}
