//! Reports tones that were removed from the samples as a cause, and identifies mains hum by its frequency.

use crate::diagnosis_json::{Cause, Estimate};
use crate::fast_tones::{FastTone, WithSd};
use crate::mains_frequency::mains_remark;
use crate::selection_state::Search;
use core::f64::consts::PI;
use stylet_identify::model::Assumptions;
use stylet_record::Recording;
use stylet_stats::Z95;
use stylet_stats::number_format::significant;
use stylet_tissue::{AnyEffect, Effect, EffectInfo, Proposal, general_effects};

/// Largest frequency difference (Hz) between a tone and a known effect: mains drifts by as much.
const SAME_TONE_HZ: f64 = 0.3;
/// Confidence in a tone that passed its test.
const TONE_CONFIDENCE: f64 = 0.99;

/// Value of a parameter with this unit.
fn parameter(effect: &AnyEffect, unit: &str) -> f64 {
    let values = effect.parameters();
    effect.info().parameters.iter().zip(values).find(|(p, _)| p.unit == unit).map_or(f64::NAN, |(_, x)| x)
}

fn is_tone(effect: &AnyEffect, tone: &FastTone) -> bool {
    effect.info().proposal == Proposal::SpectralTone
        && (parameter(effect, "Hz") - tone.frequency_hz.0).abs() < SAME_TONE_HZ
}

/// Assumptions without the known tones that were removed from the samples.
pub(crate) fn without_removed_tones(mut assumed: Assumptions, tones: &[FastTone]) -> Assumptions {
    assumed.known_effects.retain(|effect| !tones.iter().any(|t| is_tone(effect, t)));
    assumed
}

/// The strongest removed tone that is not in the scenario, as a cause; its remark lists the others.
pub(crate) fn fast_tone_cause(
    tones: &[FastTone],
    known: &[AnyEffect],
    recordings: &[Recording],
) -> Option<Cause> {
    let info: &'static EffectInfo = general_effects().find(|i| i.proposal == Proposal::SpectralTone)?;
    let mut new: Vec<&FastTone> =
        tones.iter().filter(|t| !known.iter().any(|effect| is_tone(effect, t))).collect();
    new.sort_by(|a, b| b.amplitude_n.0.total_cmp(&a.amplitude_n.0));
    let (first, others) = new.split_first()?;
    let (sample_hz, resolution_hz) = sampling(recordings.first()?);
    let mut remarks: Vec<String> =
        mains_remark(first.frequency_hz.0, sample_hz, resolution_hz).into_iter().collect();
    if first.phase_rad.1.is_infinite() {
        remarks.push("its phase differs between recordings or drifts".to_owned());
    }
    for tone in others {
        let (hz, amplitude_n) = (tone.frequency_hz.0, tone.amplitude_n.0);
        let name = mains_remark(hz, sample_hz, resolution_hz).map_or_else(String::new, |n| format!(" ({n})"));
        remarks.push(format!(
            "another tone of {} N at {} Hz{name}",
            significant(amplitude_n, 2),
            significant(hz, 4)
        ));
    }
    let estimate = |unit: &str, low: f64, high: f64| {
        let (value, sd) = match unit {
            "N" => first.amplitude_n,
            "Hz" => first.frequency_hz,
            _ => first.phase_rad,
        };
        let half = if sd.is_finite() { Z95 * sd } else { PI };
        Estimate { value, low: (value - half).max(low), high: (value + half).min(high) }
    };
    Some(Cause {
        effect: info.id.to_owned(),
        confidence: TONE_CONFIDENCE,
        parameters: info
            .parameters
            .iter()
            .map(|p| (p.path.to_owned(), estimate(p.unit, p.low, p.high)))
            .collect(),
        gain_nats: first.gain_nats,
        remark: (!remarks.is_empty()).then(|| remarks.join("; ")),
        ..Cause::default()
    })
}

/// Sampling rate and frequency resolution in Hz.
fn sampling(r: &Recording) -> (f64, f64) {
    let step_s =
        stylet_stats::order_statistics::median_of(r.time_s.windows(2).map(|w| w[1] - w[0])).max(1e-9);
    (1.0 / step_s, 1.0 / (step_s * r.len().max(1) as f64))
}

/// Mean square (N²) of the force of a removed tone; 0 for other causes.
pub(crate) fn tone_mean_square_n2(cause: &Cause) -> f64 {
    let info = stylet_tissue::effect_info(&cause.effect).filter(|i| i.proposal == Proposal::SpectralTone);
    let amplitude = info.and_then(|i| i.parameters.iter().find(|p| p.unit == "N"));
    let value: WithSd =
        amplitude.and_then(|p| cause.parameters.get(p.path)).map_or((0.0, 0.0), |e| (e.value, 0.0));
    0.5 * value.0 * value.0
}

/// Adds a remark on mains to tones that the search found.
pub(crate) fn mark_mains(causes: &mut [Cause], search: &Search) {
    let Some(b) = search.data.recordings.first() else { return };
    let (start_s, end_s) = b.span_s();
    for cause in causes {
        let info = stylet_tissue::effect_info(&cause.effect).filter(|i| i.proposal == Proposal::SpectralTone);
        let frequency = info.and_then(|i| i.parameters.iter().find(|p| p.unit == "Hz"));
        if let Some(e) = frequency.and_then(|p| cause.parameters.get(p.path)) {
            cause.remark = mains_remark(e.value, 1.0 / b.sample_step_s, 1.0 / (end_s - start_s).max(1e-9));
        }
    }
}
