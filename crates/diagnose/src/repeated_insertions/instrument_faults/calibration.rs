//! Insertions as an instrument without its faults would have measured them.

use super::{InstrumentReport, NEGLIGIBLE_SHARE};
use crate::repeated_insertions::start_values::SegmentedRecording;
use stylet_record::Recording;
use stylet_record::sensor_artefacts::{self, SensorArtefacts};
use stylet_tissue::AnyEffect;

/// The slope of the force is taken over so many samples to either side.
const SLOPE: usize = 3;

/// Insertions with what the instrument shows undone, and what their raw force says.
#[derive(Clone, Debug)]
pub struct CalibratedRecordings {
    /// The insertions.
    pub recordings: Vec<SegmentedRecording>,
    /// What the force says as it was written down: limits and steps are the sensor's, not the tissue's.
    pub raw: SensorArtefacts,
}

impl InstrumentReport {
    /// Undoes what it shows: a delay first, the lag, then drift, bias and gain. Without anything shown the insertions stay as they are.
    #[must_use]
    pub fn calibrate(&self, runs: &[&SegmentedRecording]) -> CalibratedRecordings {
        let of = |e: &AnyEffect| if let AnyEffect::TimeDelay(d) = e { d.delay_s } else { 0.0 };
        let delay_s: f64 = self.correctable_effects().iter().map(of).sum();
        let shifted: Vec<Recording> = runs.iter().map(|r| earlier(&r.recording, delay_s)).collect();
        let notes: Vec<_> = runs.iter().map(|r| r.notes.clone()).collect();
        let mut raw = sensor_artefacts::find_sensor_artefacts(&shifted.iter().collect::<Vec<_>>(), &notes);
        let force_n = shifted.iter().flat_map(|r| &r.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        raw.spikes = raw.spikes.filter(|s| s.size_n > NEGLIGIBLE_SHARE * force_n);
        let layers = runs.first().map_or(0, |r| r.ruptures_s.len());
        let runs = runs
            .iter()
            .zip(shifted)
            .enumerate()
            .map(|(k, (run, mut recording))| {
                let limit_n = raw.limit_n.map(|limit| self.without_gain(limit));
                if self.detected.is_empty() {
                    return SegmentedRecording { limit_n, ..(*run).clone() };
                }
                self.undo_force(&mut recording, self.drifts_n_per_s.get(k).copied().flatten());
                let notes = run.notes.clone();
                SegmentedRecording {
                    notes,
                    limit_n,
                    ..SegmentedRecording::new(run.name.clone(), recording, layers)
                }
            })
            .collect();
        CalibratedRecordings { recordings: runs, raw }
    }

    /// What is undone, as effects of a simulation; tones, which blocks average away, and the drive stay out of it.
    pub(crate) fn correctable_effects(&self) -> Vec<AnyEffect> {
        let undone =
            |e: &AnyEffect| !matches!(e, AnyEffect::PeriodicInterference(_) | AnyEffect::DriveFriction(_));
        self.detected.iter().filter_map(|s| s.effect_model.clone()).filter(undone).collect()
    }

    /// `drift_n_per_s` is the recording's own, where it tells it.
    fn undo_force(&self, recording: &mut Recording, drift_n_per_s: Option<f64>) {
        let effects = self.correctable_effects();
        for e in &effects {
            if let AnyEffect::LowPassLag(lag) = e {
                quick(recording, lag.time_constant_s);
            }
        }
        let of = |e: &AnyEffect| if let AnyEffect::ForceDrift(d) = e { d.rate_n_per_s } else { 0.0 };
        let shown: f64 = effects.iter().map(of).sum();
        let rate = if shown == 0.0 { 0.0 } else { drift_n_per_s.unwrap_or(shown) };
        let began = recording.time_s[0];
        for (f, t) in recording.force_n.iter_mut().zip(&recording.time_s) {
            *f = self.without_gain(*f - rate * (t - began));
        }
    }

    fn without_gain(&self, force_n: f64) -> f64 {
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

/// The same recording, its force so much earlier: every sample keeps its place and takes the force that was written down a delay later,
/// as it was written down; those at the end that would need what comes after the recording go.
fn earlier(recording: &Recording, delay_s: f64) -> Recording {
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

/// Undoes a lag: the force and its time constant times its slope.
fn quick(recording: &mut Recording, lag_s: f64) {
    if lag_s <= 0.0 {
        return;
    }
    let (t, f) = (&recording.time_s, &recording.force_n);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(SLOPE), (i + SLOPE).min(f.len() - 1));
        super::fit_trend(&t[a..=b], &f[a..=b]).rate_n_per_s
    };
    recording.force_n = (0..f.len()).map(|i| f[i] + lag_s * slope(i)).collect();
}

#[cfg(test)]
mod tests {
    use super::{earlier, quick};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::instrument_faults::{DetectedFault, InstrumentReport};
    use std::collections::BTreeMap;
    use stylet_record::Recording;
    use stylet_tissue::{
        AnyEffect, DriveFriction, Effect, ForceBias, ForceDrift, ForceGain, LowPassLag, PeriodicInterference,
        TimeDelay,
    };

    /// Forces that name their samples: 3 k + 1, at instants 0.1 s apart from 2 s on.
    fn numbered(n: usize) -> Recording {
        let t: Vec<f64> = (0..n).map(|k| 2.0 + 0.1 * k as f64).collect();
        let z = (0..n).map(|k| 1e-3 * k as f64).collect();
        Recording::new(t, z, (0..n).map(|k| 3.0 * k as f64 + 1.0).collect()).expect("clean columns")
    }

    #[test]
    fn a_force_undelayed_stands_where_it_was_made_and_the_end_goes() {
        let r = numbered(30);
        for (delay_s, by) in [(0.3, 3), (0.34, 3), (0.36, 4), (0.04, 0), (0.06, 1)] {
            let out = earlier(&r, delay_s);
            // What would need samples after the last one goes.
            let kept = 30 - (delay_s * 10.0 - 1e-9).ceil() as usize;
            assert_eq!(out.len(), kept, "{delay_s}");
            for i in 0..kept {
                assert_eq!(out.force_n[i], r.force_n[i + by], "{delay_s}, sample {i}");
                assert_eq!((out.time_s[i], out.position_m[i]), (r.time_s[i], r.position_m[i]));
            }
            assert_eq!(out.velocity_mps.len(), kept);
        }
        assert_eq!(earlier(&r, 0.0), r);
        assert_eq!(earlier(&r, -0.3), r);
        // Of two as near the later one.
        let quarters = Recording { time_s: (0..30).map(|k| 0.25 * f64::from(k)).collect(), ..r.clone() };
        assert_eq!(earlier(&quarters, 0.125).force_n[3], r.force_n[4]);
        // A delay longer than the recording leaves two samples.
        assert_eq!(earlier(&r, 9.0).len(), 2);
    }

    #[test]
    fn a_lag_undone_adds_the_slope_times_its_time_constant() {
        let mut r = numbered(30);
        let before = r.force_n.clone();
        quick(&mut r, 0.25);
        // 3 N in a tenth of a second: 30 N/s, at the ends too.
        for (f, b) in r.force_n.iter().zip(&before) {
            assert!((f - b - 0.25 * 30.0).abs() < 1e-9, "{f} {b}");
        }
        // A bend counts over three samples to either side: the line of 0 0 0 0 1 2 3 has the slope 14/28 per sample.
        let mut bent = numbered(30);
        bent.force_n = (0..30).map(|k| f64::from((k - 15).max(0))).collect();
        quick(&mut bent, 0.1);
        assert!((bent.force_n[15] - 14.0 / 28.0).abs() < 1e-9, "{}", bent.force_n[15]);
        assert!(bent.force_n[12].abs() < 1e-12 && (bent.force_n[18] - 4.0).abs() < 1e-9);
        let kept = bent.force_n.clone();
        quick(&mut bent, 0.0);
        assert_eq!(bent.force_n, kept);
    }

    /// A fiftieth of the largest force is nothing worth a word, a spike's too.
    #[test]
    fn spikes_count_from_a_fiftieth_of_the_largest_force_on() {
        let spikes = |size: f64| {
            let mut f: Vec<f64> = (0..600).map(|k| 10.0 + if k % 2 == 0 { 1e-3 } else { -1e-3 }).collect();
            for k in [100, 250, 400] {
                f[k] = 10.0 + size;
            }
            let t = (0..600).map(|k| 0.01 * f64::from(k)).collect();
            let r = Recording::new(t, vec![0.0; 600], f).expect("clean columns");
            let run = SegmentedRecording::new("one".to_owned(), r, 1);
            InstrumentReport::default().calibrate(&[&run]).raw.spikes.map(|s| s.count)
        };
        assert_eq!((spikes(0.2), spikes(0.21)), (None, Some(3)));
    }

    fn shows(all: Vec<AnyEffect>) -> InstrumentReport {
        let shown = all.into_iter().map(|e| DetectedFault {
            effect: e.id().to_owned(),
            parameters: BTreeMap::new(),
            max_force_n: 1.0,
            evidence: String::new(),
            effect_model: Some(e),
        });
        InstrumentReport { detected: shown.collect(), ..InstrumentReport::default() }
    }

    #[test]
    fn drift_bias_and_gain_are_undone_in_the_order_in_which_the_sensor_made_them() {
        let run = SegmentedRecording::new("one".to_owned(), numbered(40), 1);
        let (bias, gain, rate) = (0.7, 0.25, 0.4);
        let all: Vec<AnyEffect> = vec![
            ForceBias { force_n: bias }.into(),
            ForceGain { eps: gain }.into(),
            ForceDrift { rate_n_per_s: rate }.into(),
            PeriodicInterference { amplitude_n: 1.0, frequency_hz: 3.0, phase_rad: 0.0 }.into(),
            DriveFriction { force_n: 0.5 }.into(),
        ];
        let mut seen = shows(all);
        let ids: Vec<&str> = seen.correctable_effects().iter().map(Effect::id).collect();
        assert_eq!(ids, ["force_bias", "force_gain", "force_drift"], "tones and the drive stay");
        for (own, rate) in [(None, rate), (Some(-0.15), -0.15)] {
            seen.drifts_n_per_s = vec![own];
            let out = seen.calibrate(&[&run]);
            for (k, f) in out.recordings[0].recording.force_n.iter().enumerate() {
                let wanted = (3.0 * k as f64 + 1.0 - rate * 0.1 * k as f64 - bias) / (1.0 + gain);
                assert!((f - wanted).abs() < 1e-9, "{k}: {f} for {wanted}");
            }
        }
        // An own drift counts only where a drift is shown at all.
        let mut biased = shows(vec![ForceBias { force_n: bias }.into()]);
        biased.drifts_n_per_s = vec![Some(9.0)];
        let out = biased.calibrate(&[&run]);
        assert!((out.recordings[0].recording.force_n[20] - 61.0 + bias).abs() < 1e-12);
    }

    #[test]
    fn a_delay_and_a_lag_are_undone_before_the_rest_and_a_limit_is_told_in_true_newtons() {
        let mut r = numbered(60);
        r.force_n.iter_mut().for_each(|f| *f = f.min(100.0));
        let run = SegmentedRecording::new("one".to_owned(), r.clone(), 2);
        let seen = shows(vec![
            TimeDelay { delay_s: 0.2 }.into(),
            LowPassLag { time_constant_s: 0.05 }.into(),
            ForceBias { force_n: 1.0 }.into(),
            ForceGain { eps: 0.1 }.into(),
        ]);
        let out = seen.calibrate(&[&run]);
        assert_eq!(out.raw.limit_n, Some(100.0));
        assert!((out.recordings[0].limit_n.expect("a limit") - 90.0).abs() < 1e-9);
        assert_eq!(out.recordings[0].recording.len(), 58);
        assert_eq!(out.recordings[0].ruptures_s.len(), 2);
        let wanted = (3.0 * 12.0 + 1.0 + 0.05 * 30.0 - 1.0) / 1.1;
        assert!((out.recordings[0].recording.force_n[10] - wanted).abs() < 1e-9);
        // Without anything shown the insertion stays as it is, but for the limit.
        let same = InstrumentReport::default().calibrate(&[&run]);
        assert_eq!(same.recordings[0].recording, r);
        assert_eq!(same.recordings[0].limit_n, Some(100.0));
    }
}
