//! Assesses the instrument: bias, drift, noise, tone, drive friction, gain, delay and lag of the force.

use super::air_baseline::{
    AirAnalysis, LinearTrend, air_drift_n_per_s, consensus, fit_trend, pre_contact_trends,
};
use super::instrument_report::{DetectedFault, ExcludedFault, InstrumentReport};
use super::sensor_lag::{DetectedLag, LagModel, detect_lag};
use crate::diagnosis_json::Estimate;
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::Recording;
use stylet_stats::median;
use stylet_tissue::{
    AnyEffect, DriveFriction, Effect, ForceBias, ForceDrift, ForceGain, LowPassLag, PeriodicInterference,
    TimeDelay,
};

/// Share of the largest force below which a fault is negligible: residuals of fitted models are several times larger.
pub const NEGLIGIBLE_SHARE: f64 = 0.02;
/// Share of equal extreme readings from which a known load is saturated or quantised.
const MAX_EQUAL_SHARE: f64 = 0.3;

/// Recordings of the instrument without tissue.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReferenceRecordings<'a> {
    /// Motion in air.
    pub air: Option<&'a Recording>,
    /// Known load and its force (N).
    pub load: Option<(&'a Recording, f64)>,
}

impl InstrumentReport {
    /// Assesses the instrument from reference recordings and from insertions into a tissue whose surface is
    /// assumed at `surface_m`.
    #[must_use]
    pub fn assess(
        references: &ReferenceRecordings,
        recordings: &[&SegmentedRecording],
        surface_m: f64,
    ) -> Self {
        let force_n =
            recordings.iter().flat_map(|r| &r.recording.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        let duration_s = stylet_stats::median_of(recordings.iter().map(|r| r.recording.duration_s()));
        let mut out = Self::default();
        let air = references.air.map(AirAnalysis::new);
        let lines = pre_contact_trends(recordings, surface_m);
        let trends = (2 * lines.len() >= recordings.len().max(2)).then_some(lines.as_slice());
        out.set_baseline(air.as_ref(), trends, duration_s, force_n);
        out.drifts_n_per_s = recordings.iter().map(|run| air_drift_n_per_s(run, surface_m)).collect();
        let drifts: Vec<f64> = out.drifts_n_per_s.iter().copied().flatten().collect();
        if 2 * drifts.len() >= recordings.len().max(2) {
            out.drift_n = Some(consensus(&drifts) * duration_s);
        }
        out.gain = references.load.and_then(|(recording, known)| {
            let zero = air.as_ref().map_or(out.bias_n.unwrap_or(0.0), |a| a.trend.start_n);
            load_gain_error(
                recording,
                known,
                zero,
                out.drift_n.is_some_and(|d| d.abs() > NEGLIGIBLE_SHARE * force_n),
            )
        });
        let lag = detect_lag(recordings);
        match lag.map(|l| (l.model, l.value_s)) {
            Some((LagModel::PureDelay, by_s)) => out.delay_s = Some(by_s),
            Some((LagModel::LowPass, by_s)) => out.lag_s = Some(by_s),
            None => {}
        }
        out.classify(force_n, duration_s, references.air.is_some(), lag);
        out
    }

    /// Sets bias, drift, noise and tone, from the insertions where possible, else from the recording in air.
    fn set_baseline(
        &mut self,
        air: Option<&AirAnalysis>,
        before: Option<&[LinearTrend]>,
        duration_s: f64,
        force_n: f64,
    ) {
        if let Some(air) = air {
            (self.noise_n, self.ar1) = (Some(air.trend.sd_n), Some(air.ar1));
            (self.bias_n, self.drift_n) =
                (Some(air.trend.start_n), Some(air.trend.rate_n_per_s * duration_s));
            (self.tone, self.drive_friction_n) = (air.tone, air.drive_friction_n);
        }
        let Some(lines) = before else { return };
        let of = |what: fn(&LinearTrend) -> f64| lines.iter().map(what).collect::<Vec<_>>();
        let bias = consensus(&of(|l| l.start_n));
        if air.is_none() || bias.abs() > NEGLIGIBLE_SHARE * force_n {
            self.bias_n = Some(bias);
        }
        if air.is_none() {
            // The slope of the short time in air is no drift of a whole recording: the search finds that.
            self.noise_n = Some(stylet_stats::median_of(lines.iter().map(|l| l.sd_n)));
        }
    }

    /// Classifies the faults as excluded or detected.
    fn classify(&mut self, force_n: f64, duration_s: f64, has_air_recording: bool, lag: Option<DetectedLag>) {
        let (mut excluded, mut detected) = (Vec::new(), Vec::new());
        let mut classify = |effect_model: AnyEffect, max_force_n: f64, reported: usize, evidence: String| {
            if max_force_n.abs() < NEGLIGIBLE_SHARE * force_n {
                let effect = effect_model.info().id.to_owned();
                excluded.push(ExcludedFault { effect, max_force_n: max_force_n.abs(), evidence });
                return;
            }
            // The interval is omitted: the standard error of a mean is far below the threshold.
            let of = |value: f64| Estimate { value, low: value, high: value };
            let values = effect_model.parameters().into_iter().map(of).take(reported);
            detected.push(DetectedFault::new(effect_model, values, max_force_n.abs(), evidence));
        };
        let mn = |x: f64| format!("{:.1} mN", 1e3 * x);
        if let Some(eps) = self.gain {
            let evidence = format!("known load measured with an error of {:+.2} %", 100.0 * eps);
            classify(ForceGain { eps }.into(), eps * force_n, 1, evidence);
        }
        if let Some(bias_n) = self.bias_n {
            classify(ForceBias { force_n: bias_n }.into(), bias_n, 1, format!("force in air {}", mn(bias_n)));
        }
        if let Some(drift_n) = self.drift_n {
            let rate_n_per_s = drift_n / duration_s.max(1e-9);
            let evidence = format!("drift in air over an insertion {}", mn(drift_n));
            classify(ForceDrift { rate_n_per_s }.into(), drift_n, 1, evidence);
        }
        if let Some((amplitude_n, frequency_hz)) = self.tone.filter(|_| has_air_recording) {
            let tone = PeriodicInterference { amplitude_n, frequency_hz, phase_rad: 0.0 };
            let evidence = format!("strongest tone in air {} at {frequency_hz:.1} Hz", mn(amplitude_n));
            // The phase, which differs between recordings, is not reported.
            classify(tone.into(), amplitude_n, 2, evidence);
        }
        if let Some(drive_n) = self.drive_friction_n.filter(|_| has_air_recording) {
            let evidence =
                format!("half the force difference between advance and retraction in air {}", mn(drive_n));
            classify(DriveFriction { force_n: drive_n }.into(), drive_n, 1, evidence);
        }
        if let Some(lag) = lag {
            let (effect_model, how): (AnyEffect, _) = match lag.model {
                LagModel::PureDelay => (TimeDelay { delay_s: lag.value_s }.into(), "a delay of"),
                LagModel::LowPass => {
                    (LowPassLag { time_constant_s: lag.value_s }.into(), "a low-pass time constant of")
                }
            };
            let estimate = Estimate { value: lag.value_s, low: lag.low_s, high: lag.high_s };
            let evidence = format!(
                "the force at stops and reversals of the needle has {how} {:.2} s ({:.2} to {:.2} s)",
                lag.value_s, lag.low_s, lag.high_s
            );
            detected.push(DetectedFault::new(effect_model, [estimate], force_n, evidence));
        }
        (self.excluded, self.detected) = (excluded, detected);
    }
}

/// Measured over known force minus one; `None` when the sensor is saturated or too coarse.
fn load_gain_error(recording: &Recording, known: f64, zero_n: f64, drifts: bool) -> Option<f64> {
    let f = &recording.force_n;
    let most = f.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = f.iter().copied().fold(f64::INFINITY, f64::min);
    let same = |at: f64| f.iter().filter(|f| (**f - at).abs() <= 1e-12).count() as f64;
    if same(most).max(same(least)) > MAX_EQUAL_SHARE * f.len() as f64 {
        return None;
    }
    let level = if drifts { fit_trend(&recording.time_s, f).start_n } else { median(&mut f.clone()) };
    Some((level - zero_n) / known - 1.0)
}

#[cfg(test)]
mod tests;
