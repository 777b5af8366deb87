//! One case drawn, diagnosed, and compared with what was hidden.

use super::strength::{aim, size_of};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;
use stylet_diagnose::diagnosis_json::Estimate;
use stylet_diagnose::held_out::{pooled_rms, predict_free_run};
use stylet_diagnose::{NamedRecording, Options, Verdict, assumptions_of, diagnose};
use stylet_identify::model::{EffectTerm, Model};
use stylet_own_world::{Drawn, Kind, Size, Sketch};
use stylet_tissue::{AnyEffect, Effect, ForceGain};

/// What came of one case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Case {
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

/// Runs one case.
#[must_use]
pub fn run(index: u64, sketch: &Sketch) -> Option<Case> {
    examine(index, sketch.kind, &aim(sketch))
}

/// Runs one case whose strengths are drawn already.
#[must_use]
pub fn examine(index: u64, kind: Kind, drawn: &Drawn) -> Option<Case> {
    let case = stylet_own_world::case(drawn);
    let evidence: Vec<NamedRecording> = case
        .recordings
        .iter()
        .enumerate()
        .map(|(k, r)| NamedRecording { name: format!("{k}.csv"), recording: r.clone(), notes: Vec::new() })
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
        _ if hidden_ids == [ForceGain::ID] => {
            d.not_identifiable.contains(&hidden_ids[0]) && d.verdict == Verdict::None
        }
        // What a single recording cannot show has to be listed as invisible.
        _ if drawn.motions == stylet_own_world::Motions::One && d.verdict == Verdict::None => {
            hidden_ids.iter().all(|h| d.not_identifiable.contains(h))
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
            if p.integer {
                continue;
            }
            let (error, held) = error(p.unit, found, truth);
            errors.push((format!("{}.{}", effect.id(), p.path), error, held));
        }
    }
    // What the truth would leave.
    let choices: Vec<EffectTerm> =
        drawn.effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    let mut truth = Model::base(Arc::new(assumptions_of(&case.believed)), case.recordings.len());
    truth.tissue = case.truth.clone();
    truth.effects = choices;
    let left: Vec<_> =
        (0..case.recordings.len()).map(|r| predict_free_run(&truth, &search.data, r)).collect();
    let after_true = pooled_rms(&left, &search.data);
    let (before, after) = (d.gain.rmse_before_n, d.gain.rmse_after_n);
    let gain = (before - after_true > 0.03 * before).then(|| (before - after) / (before - after_true));
    Some(Case {
        index,
        kind,
        hidden: if let Some(o) = &drawn.outside {
            vec![stylet_own_world::OUTSIDE[o.kind].to_owned()]
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
        invisible: d.not_identifiable.clone(),
        right,
        truth_nats: None,
        errors,
        gain,
        rms_n: [before, after, after_true],
        leftover: (d.residual_structure.p_value, d.residual_structure.nats),
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

#[cfg(test)]
mod tests {
    use super::super::strength::tests::drawn;
    use super::*;
    use stylet_own_world::Outside;
    use stylet_tissue::CoulombFriction;

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
