use super::*;
use crate::test_noise::uniform;

#[test]
fn notes_serialise_with_kinds_in_snake_case() -> Result<(), serde_json::Error> {
    let note = repaired_rows(vec![4, 9], 100);
    let text = serde_json::to_string(&note)?;
    assert!(text.contains(r#""kind":"repaired_rows""#) && text.contains(r#""lines":[4,9]"#), "{text}");
    assert_eq!(serde_json::from_str::<QualityNote>(&text)?, note);
    assert!(note.message.contains("line(s) 4, 9"), "{}", note.message);
    Ok(())
}

#[test]
fn notes_are_sorted_by_consequence() -> Result<(), RecordError> {
    // In millimetres, with a gap, irregular.
    let time_s: Vec<f64> = (0..400)
        .map(|i| 0.01 * (f64::from(i) + 0.3 * f64::from(i % 3)) + if i > 200 { 1.0 } else { 0.0 })
        .collect();
    let position_m: Vec<f64> = time_s.iter().map(|t| 2.3 * t).collect();
    let force_n = time_s.iter().map(|t| t * 0.1).collect();
    let kinds: Vec<QualityKind> =
        assess(&Recording::new(time_s, position_m, force_n)?).iter().map(|note| note.kind).collect();
    use QualityKind::{Gaps, Jitter, UnitMixUp};
    assert_eq!(kinds, [UnitMixUp, UnitMixUp, Gaps, Jitter]);
    Ok(())
}

fn time_s() -> Vec<f64> {
    (0..1000).map(|i| f64::from(i) * 0.01).collect()
}

/// A load that rises to about 5 N, drops to half at rupture (t = 6 s), rises again; noise of 0.01 N sd.
fn force_n() -> Vec<f64> {
    let mut uniform = uniform(1);
    let noise = |uniform: &mut dyn FnMut() -> f64| (0..12).map(|_| uniform()).sum::<f64>() * 0.01;
    let load = |t: f64| {
        if t < 6.0 { t * 0.8 } else { 2.4 + (t - 6.0) * 0.3 }
    };
    time_s().into_iter().map(|t| load(t) + noise(&mut uniform)).collect()
}

fn recording(force_n: Vec<f64>) -> Result<Recording, RecordError> {
    Recording::new(time_s(), time_s().iter().map(|t| t * 0.002).collect(), force_n)
}

fn of_kind(kind: QualityKind, force_n: Vec<f64>) -> Result<Vec<QualityNote>, RecordError> {
    Ok(assess(&recording(force_n)?).into_iter().filter(|note| note.kind == kind).collect())
}

#[test]
fn a_noisy_insertion_with_a_rupture_has_no_note_on_its_values() -> Result<(), RecordError> {
    assert_eq!(of_kind(QualityKind::Saturation, force_n())?, []);
    assert_eq!(of_kind(QualityKind::Spikes, force_n())?, []);
    assert_eq!(
        of_kind(QualityKind::Quantisation, force_n())?
            .iter()
            .filter(|n| n.message.starts_with("force_n"))
            .count(),
        0
    );
    Ok(())
}

#[test]
fn a_noiseless_insertion_with_hold_and_retraction_has_no_note_on_its_values() -> Result<(), RecordError> {
    let profile = |t: f64| match t {
        t if t < 2.0 => 0.0,
        t if t < 6.0 => (t - 2.0) * 1.2,
        t if t < 8.0 => 0.6,
        _ => 0.0,
    };
    let force_n: Vec<f64> = time_s().into_iter().map(profile).collect();
    assert_eq!(of_kind(QualityKind::Spikes, force_n.clone())?, []);
    assert_eq!(of_kind(QualityKind::Saturation, force_n)?, []);
    Ok(())
}

#[test]
fn a_clipped_force_is_reported_as_saturated_with_its_value() -> Result<(), RecordError> {
    let clipped = force_n().into_iter().map(|f| f.min(3.0)).collect();
    let notes = of_kind(QualityKind::Saturation, clipped)?;
    assert_eq!(notes.len(), 1);
    assert_eq!(notes[0].numbers["value"], 3.0);
    assert!(notes[0].message.contains("largest value 3.0000 N"), "{}", notes[0].message);
    Ok(())
}

#[test]
fn lost_bits_are_reported_as_spikes_with_count_and_time() -> Result<(), RecordError> {
    let mut force_n = force_n();
    force_n[300] += 1.5;
    force_n[700] -= 1.0;
    force_n[701] -= 1.0;
    let notes = of_kind(QualityKind::Spikes, force_n)?;
    let note = notes.first().expect("three spiked samples");
    assert_eq!(note.numbers["count"], 3.0);
    assert!((note.numbers["at_s"] - 3.0).abs() < 1e-9, "{}", note.message);
    Ok(())
}

#[test]
fn a_coarse_resolution_is_reported_with_its_step() -> Result<(), RecordError> {
    let coarse: Vec<f64> = force_n().iter().map(|f| (f / 0.05).round() * 0.05).collect();
    let notes = of_kind(QualityKind::Quantisation, coarse)?;
    let note = notes.first().expect("steps of 0.05 N");
    assert!((note.numbers["smallest_step"] - 0.05).abs() < 1e-9, "{}", note.message);
    Ok(())
}
