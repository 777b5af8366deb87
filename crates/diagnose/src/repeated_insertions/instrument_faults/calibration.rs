//! Corrects detected instrument faults in the recordings.

use super::air_baseline::fit_trend;
use super::assessment::NEGLIGIBLE_SHARE;
use super::instrument_report::InstrumentReport;
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::Recording;
use stylet_record::sensor_artefacts::{self, SensorArtefacts};
use stylet_tissue::AnyEffect;

/// Samples on either side in the slope of the force.
const SLOPE_HALF_WINDOW: usize = 3;

/// Recordings with detected faults corrected, and the sensor artefacts of the raw forces.
#[derive(Clone, Debug)]
pub struct CalibratedRecordings {
    /// Corrected recordings.
    pub recordings: Vec<SegmentedRecording>,
    /// Artefacts of the raw force; its limits and steps are those of the sensor.
    pub artefacts: SensorArtefacts,
}

impl InstrumentReport {
    /// Corrects the detected faults: delay, then lag, then drift, bias and gain.
    #[must_use]
    pub fn calibrate(&self, recordings: &[&SegmentedRecording]) -> CalibratedRecordings {
        let of = |e: &AnyEffect| if let AnyEffect::TimeDelay(d) = e { d.delay_s } else { 0.0 };
        let delay_s: f64 = self.correctable_effects().iter().map(of).sum();
        let shifted: Vec<Recording> =
            recordings.iter().map(|r| remove_delay(&r.recording, delay_s)).collect();
        let notes: Vec<_> = recordings.iter().map(|r| r.notes.clone()).collect();
        let mut artefacts =
            sensor_artefacts::find_sensor_artefacts(&shifted.iter().collect::<Vec<_>>(), &notes);
        let force_n = shifted.iter().flat_map(|r| &r.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        artefacts.spikes = artefacts.spikes.filter(|s| s.size_n > NEGLIGIBLE_SHARE * force_n);
        let layers = recordings.first().map_or(0, |r| r.ruptures_s.len());
        let recordings = recordings
            .iter()
            .zip(shifted)
            .enumerate()
            .map(|(k, (run, mut recording))| {
                let limit_n = artefacts.limit_n.map(|limit| self.calibrated_n(limit));
                if self.detected.is_empty() {
                    return SegmentedRecording { limit_n, ..(*run).clone() };
                }
                self.calibrate_force(&mut recording, self.drifts_n_per_s.get(k).copied().flatten());
                let notes = run.notes.clone();
                SegmentedRecording {
                    notes,
                    limit_n,
                    ..SegmentedRecording::new(run.name.clone(), recording, layers)
                }
            })
            .collect();
        CalibratedRecordings { recordings, artefacts }
    }

    /// Corrected faults as effects of a simulation, without tones (which block means remove) and drive friction.
    pub(crate) fn correctable_effects(&self) -> Vec<AnyEffect> {
        self.detected.iter().filter(|s| s.is_corrected()).filter_map(|s| s.effect_model.clone()).collect()
    }

    /// Corrects the force of a recording; `drift_n_per_s` is its own drift, if known.
    fn calibrate_force(&self, recording: &mut Recording, drift_n_per_s: Option<f64>) {
        let effects = self.correctable_effects();
        for e in &effects {
            if let AnyEffect::LowPassLag(lag) = e {
                remove_lag(recording, lag.time_constant_s);
            }
        }
        let of = |e: &AnyEffect| if let AnyEffect::ForceDrift(d) = e { d.rate_n_per_s } else { 0.0 };
        let detected_rate: f64 = effects.iter().map(of).sum();
        let rate = if detected_rate == 0.0 { 0.0 } else { drift_n_per_s.unwrap_or(detected_rate) };
        let start_s = recording.time_s[0];
        for (f, t) in recording.force_n.iter_mut().zip(&recording.time_s) {
            *f = self.calibrated_n(*f - rate * (t - start_s));
        }
    }

    fn calibrated_n(&self, force_n: f64) -> f64 {
        let (mut bias_n, mut gain) = (0.0, 0.0);
        for e in self.detected.iter().filter_map(|s| s.effect_model.as_ref()) {
            match e {
                AnyEffect::ForceBias(b) => bias_n = b.force_n,
                AnyEffect::ForceGain(g) => gain = g.eps,
                _ => {}
            }
        }
        (force_n - bias_n) / (1.0 + gain)
    }
}

/// The recording with its force shifted forward by a delay to the nearest sample; samples at the end without a value are dropped.
fn remove_delay(recording: &Recording, delay_s: f64) -> Recording {
    let mut out = recording.clone();
    if delay_s <= 0.0 {
        return out;
    }
    let t = &recording.time_s;
    let last = t[t.len() - 1];
    let kept = t.partition_point(|t| t + delay_s <= last).max(2);
    out.force_n = (0..kept)
        .map(|i| {
            let wanted = t[i] + delay_s;
            let k = t.partition_point(|t| *t < wanted).min(t.len() - 1);
            let nearer = k > 0 && wanted - t[k - 1] < t[k] - wanted;
            recording.force_n[if nearer { k - 1 } else { k }]
        })
        .collect();
    out.time_s.truncate(kept);
    out.position_m.truncate(kept);
    out.velocity_mps.truncate(kept);
    out.joint_torque_nm.truncate(kept);
    if let Some(f) = &mut out.force_virtual_n {
        f.truncate(kept);
    }
    out
}

/// Inverts a first-order lag: force plus time constant times its slope.
fn remove_lag(recording: &mut Recording, lag_s: f64) {
    if lag_s <= 0.0 {
        return;
    }
    let (t, f) = (&recording.time_s, &recording.force_n);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(SLOPE_HALF_WINDOW), (i + SLOPE_HALF_WINDOW).min(f.len() - 1));
        fit_trend(&t[a..=b], &f[a..=b]).rate_n_per_s
    };
    recording.force_n = (0..f.len()).map(|i| f[i] + lag_s * slope(i)).collect();
}

#[cfg(test)]
mod tests;
