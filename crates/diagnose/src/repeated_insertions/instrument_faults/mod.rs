//! What the instrument does by itself, seen without a law: a motion in air, a known load, the air before an insertion reaches the
//! tissue and the corner where its way back begins. What it shows is undone before any law is fitted; what it does not show
//! explains no residual.

mod air_baseline;
mod calibration;
mod sensor_lag;

pub use calibration::CalibratedRecordings;

use crate::diagnosis_json::{Cause, Estimate};
use crate::repeated_insertions::start_values::SegmentedRecording;
pub(crate) use air_baseline::fit_trend;
use air_baseline::{AirAnalysis, LinearTrend, consensus, pre_contact_trends};
use sensor_lag::LagModel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_record::{DEFAULT_HALF_WIDTH_S, Recording};
use stylet_stats::{mean_interval, median};
use stylet_tissue::{
    AnyEffect, DriveFriction, Effect, ForceBias, ForceDrift, ForceGain, LowPassLag, PeriodicInterference,
    TimeDelay,
};

/// Forces below this share of the largest one explain nothing: laws of insertions leave several times as much.
pub const NEGLIGIBLE_SHARE: f64 = 0.02;
/// A load of which so large a share reads the same is at the end of what the sensor can show, or of its steps.
const STUCK: f64 = 0.3;

/// Confidence in what a check of the instrument shows by itself.
const SEEN: f64 = 0.99;

/// What the instrument was seen to do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InstrumentReport {
    /// Standard deviation of the noise in air (N).
    pub noise_n: Option<f64>,
    /// Correlation of neighbouring noise samples.
    pub ar1: Option<f64>,
    /// Force in air where a recording begins (N).
    pub bias_n: Option<f64>,
    /// Change of the force in air over an insertion (N).
    pub drift_n: Option<f64>,
    /// The same of each insertion that begins and ends in air (N/s).
    #[serde(skip)]
    pub drifts_n_per_s: Vec<Option<f64>>,
    /// Amplitude (N) and frequency (Hz) of the strongest line in air.
    pub tone: Option<(f64, f64)>,
    /// Half the difference (N) between moving in and moving out, in air.
    pub drive_friction_n: Option<f64>,
    /// Measured over known force, less one.
    pub gain: Option<f64>,
    /// By how much the force comes late at corners of the motion, all of it (s).
    #[serde(default)]
    pub delay_s: Option<f64>,
    /// The same, rounded (s).
    #[serde(default)]
    pub lag_s: Option<f64>,
    /// Effects that this excludes, with what was found.
    pub excluded: Vec<ExcludedFault>,
    /// Effects that this shows.
    #[serde(default)]
    pub detected: Vec<DetectedFault>,
}

/// An effect that the instrument's checks show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectedFault {
    /// Effect, by its id.
    pub effect: String,
    /// Its parameters by their paths.
    pub parameters: BTreeMap<String, Estimate>,
    /// Largest force in N that it makes here.
    pub max_force_n: f64,
    /// What was found.
    pub evidence: String,
    /// The effect itself, which is undone.
    #[serde(skip)]
    pub effect_model: Option<AnyEffect>,
}

impl DetectedFault {
    /// As a cause: it was seen without a law.
    #[must_use]
    pub fn cause(&self) -> Cause {
        Cause {
            effect: self.effect.clone(),
            equivalent: Vec::new(),
            confidence: SEEN,
            parameters: self.parameters.clone(),
            gain_nats: 0.0,
            share: 0.0,
        }
    }
}

/// An effect that the instrument's checks exclude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExcludedFault {
    /// Effect, by its id.
    pub effect: String,
    /// Largest force in N that it can make here.
    pub max_force_n: f64,
    /// What was found.
    pub evidence: String,
}

/// Recordings of the instrument by itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReferenceRecordings<'a> {
    /// A motion in air.
    pub air: Option<&'a Recording>,
    /// A load of so many newtons.
    pub load: Option<(&'a Recording, f64)>,
}

impl InstrumentReport {
    /// Looks at the checks and at what insertions show by themselves of a tissue that is believed to begin at `surface_m`.
    #[must_use]
    pub fn assess(checks: &ReferenceRecordings, runs: &[&SegmentedRecording], surface_m: f64) -> Self {
        let force_n =
            runs.iter().flat_map(|r| &r.recording.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        let duration_s = stylet_stats::median_of(runs.iter().map(|r| r.recording.duration_s()));
        let mut out = Self::default();
        let air = checks.air.map(AirAnalysis::new);
        let lines = pre_contact_trends(runs, surface_m);
        let seen = (2 * lines.len() >= runs.len().max(2)).then_some(lines.as_slice());
        out.of_sensor(air.as_ref(), seen, duration_s, force_n);
        out.drifts_n_per_s = runs.iter().map(|run| air_baseline::air_drift_n_per_s(run, surface_m)).collect();
        let told: Vec<f64> = out.drifts_n_per_s.iter().copied().flatten().collect();
        if 2 * told.len() >= runs.len().max(2) {
            out.drift_n = Some(consensus(&told) * duration_s);
        }
        out.gain = checks.load.and_then(|(recording, known)| {
            let zero = air.as_ref().map_or(out.bias_n.unwrap_or(0.0), |a| a.trend.start_n);
            load(recording, known, zero, out.drift_n.is_some_and(|d| d.abs() > NEGLIGIBLE_SHARE * force_n))
        });
        let late = sensor_lag::detect_lag(runs);
        match late.map(|l| (l.model, l.value_s)) {
            Some((LagModel::PureDelay, by_s)) => out.delay_s = Some(by_s),
            Some((LagModel::LowPass, by_s)) => out.lag_s = Some(by_s),
            None => {}
        }
        out.judge(force_n, duration_s, checks.air.is_some(), late);
        out
    }

    /// Bias, drift, noise and tones: of the insertions themselves where they tell them, of the check in air otherwise.
    fn of_sensor(
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
            self.noise_n = Some(stylet_stats::median_of(lines.iter().map(|l| l.sd_n)));
            // A short stretch of air tells a slope, but not what becomes of it until the end.
            let rates = of(|l| l.rate_n_per_s);
            self.drift_n = mean_interval(&rates)
                .filter(|i| 0.5 * (i.high - i.low) * duration_s < NEGLIGIBLE_SHARE * force_n)
                .map(|_| consensus(&rates) * duration_s);
        }
    }

    /// What is excluded, and what is shown.
    fn judge(&mut self, force_n: f64, duration_s: f64, in_air: bool, late: Option<sensor_lag::DetectedLag>) {
        let (mut excluded, mut shown) = (Vec::new(), Vec::new());
        let mut judge = |itself: AnyEffect, size_n: f64, told: usize, evidence: String| {
            let effect = itself.info().id.to_owned();
            if size_n.abs() < NEGLIGIBLE_SHARE * force_n {
                excluded.push(ExcludedFault { effect, max_force_n: size_n.abs(), evidence });
                return;
            }
            // What noise leaves open of a mean is far below what is worth a word.
            let of = |value: f64| Estimate { value, low: value, high: value };
            let values = itself.parameters();
            let named = itself.info().parameters.iter().zip(values).take(told);
            let parameters = named.map(|(p, x)| (p.path.to_owned(), of(x))).collect();
            shown.push(DetectedFault {
                effect,
                parameters,
                max_force_n: size_n.abs(),
                evidence,
                effect_model: Some(itself),
            });
        };
        let mn = |x: f64| format!("{:.1} mN", 1e3 * x);
        if let Some(eps) = self.gain {
            let said = format!("a known load is measured {:+.2} % off", 100.0 * eps);
            judge(ForceGain { eps }.into(), eps * force_n, 1, said);
        }
        if let Some(bias_n) = self.bias_n {
            judge(ForceBias { force_n: bias_n }.into(), bias_n, 1, format!("force in air {}", mn(bias_n)));
        }
        if let Some(drift_n) = self.drift_n {
            let rate_n_per_s = drift_n / duration_s.max(1e-9);
            let said = format!("change in air over an insertion {}", mn(drift_n));
            judge(ForceDrift { rate_n_per_s }.into(), drift_n, 1, said);
        }
        if let Some((amplitude_n, frequency_hz)) = self.tone.filter(|_| in_air) {
            let tone = PeriodicInterference { amplitude_n, frequency_hz, phase_rad: 0.0 };
            let said = format!("strongest line in air {} at {frequency_hz:.1} Hz", mn(amplitude_n));
            // Its phase is every recording's own.
            judge(tone.into(), amplitude_n, 2, said);
        }
        if let Some(drive_n) = self.drive_friction_n.filter(|_| in_air) {
            let said = format!("half the difference between in and out, in air, {}", mn(drive_n));
            judge(DriveFriction { force_n: drive_n }.into(), drive_n, 1, said);
        }
        if let Some(late) = late {
            let (itself, how): (AnyEffect, _) = match late.model {
                LagModel::PureDelay => (TimeDelay { delay_s: late.value_s }.into(), "later"),
                LagModel::LowPass => {
                    (LowPassLag { time_constant_s: late.value_s }.into(), "rounded, by a time constant of")
                }
            };
            let estimate = Estimate { value: late.value_s, low: late.low_s, high: late.high_s };
            shown.push(DetectedFault {
                effect: itself.info().id.to_owned(),
                parameters: itself.info().parameters.iter().map(|p| (p.path.to_owned(), estimate)).collect(),
                max_force_n: force_n,
                evidence: format!(
                    "where the needle stops or its way back begins the force answers {how} {:.2} s ({:.2} to {:.2} s)",
                    late.value_s, late.low_s, late.high_s
                ),
                effect_model: Some(itself),
            });
        }
        (self.excluded, self.detected) = (excluded, shown);
    }
}

/// Measured over known force, less one; nothing when the sensor cannot show the load.
fn load(recording: &Recording, known: f64, zero_n: f64, drifts: bool) -> Option<f64> {
    let f = &recording.force_n;
    let most = f.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = f.iter().copied().fold(f64::INFINITY, f64::min);
    let same = |at: f64| f.iter().filter(|f| (**f - at).abs() <= 1e-12).count() as f64;
    if same(most).max(same(least)) > STUCK * f.len() as f64 {
        return None;
    }
    let level = if drifts { fit_trend(&recording.time_s, f).start_n } else { median(&mut f.clone()) };
    Some((level - zero_n) / known - 1.0)
}

/// Remarks on the timing and the stroke of a run, for the data-quality section.
#[must_use]
pub fn sampling_summary(recording: &Recording) -> String {
    let n = recording.len();
    let mean_hz = (n - 1) as f64 / recording.duration_s();
    let largest = recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
    let deepest = recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let first = recording.position_m[0];
    format!(
        "{n} samples kept at their own instants: {mean_hz:.1} Hz on the average (median interval {:.2} ms), largest gap {:.1} ms; stroke \
         ends at {:.1} mm; velocity is the slope of the position within {:.0} ms",
        1e3 * recording.median_interval_s(),
        1e3 * largest,
        1e3 * (deepest - first),
        1e3 * DEFAULT_HALF_WIDTH_S
    )
}

#[cfg(test)]
mod tests {
    use super::{
        AirAnalysis, InstrumentReport, LinearTrend, NEGLIGIBLE_SHARE, ReferenceRecordings, consensus, load,
        sampling_summary,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use stylet_record::Recording;

    fn still(f: Vec<f64>) -> Recording {
        let t = (0..f.len()).map(|k| 0.1 * k as f64).collect();
        Recording::new(t, vec![0.0; f.len()], f).expect("clean columns")
    }

    #[test]
    fn a_load_tells_the_gain_unless_the_sensor_is_at_its_end() {
        let wobble = |k: usize| 1e-3 * ((k * 37) % 11) as f64;
        let f: Vec<f64> = (0..50).map(|k| 5.5 + wobble(k)).collect();
        let middle = stylet_stats::median(&mut f.clone());
        let gain = load(&still(f.clone()), 5.0, 0.2, false).expect("a gain");
        assert!((gain - ((middle - 0.2) / 5.0 - 1.0)).abs() < 1e-12, "{gain}");
        // Where the zero drifts the first instant counts.
        let drifting: Vec<f64> = (0..50).map(|k| 5.5 + 0.03 * k as f64).collect();
        let gain = load(&still(drifting), 5.0, 0.2, true).expect("a gain");
        assert!((gain - (5.3 / 5.0 - 1.0)).abs() < 1e-9, "{gain}");
        // 15 of 50 samples at one end may be chance, 16 are not; from below as from above.
        for sign in [1.0, -1.0] {
            for (count, told) in [(15, true), (16, false)] {
                let f = (0..50).map(|k| sign * if k < count { 6.0 } else { 5.5 + wobble(k) }).collect();
                assert_eq!(load(&still(f), 5.0, 0.0, false).is_some(), told, "{count}");
            }
        }
    }

    #[test]
    fn insertions_that_agree_tell_bias_and_drift_and_the_check_in_air_what_they_do_not() {
        let line =
            |first_n: f64, rate_n_per_s: f64| LinearTrend { start_n: first_n, rate_n_per_s, sd_n: 0.013 };
        let lines = [line(0.31, 0.010), line(0.3, 0.011), line(0.32, 0.0102)];
        let air = AirAnalysis {
            trend: line(0.05, 0.02),
            ar1: 0.4,
            tone: Some((0.1, 7.0)),
            drive_friction_n: Some(0.2),
        };
        let mut only = InstrumentReport::default();
        only.of_sensor(None, Some(&lines), 20.0, 10.0);
        assert_eq!((only.bias_n, only.noise_n, only.ar1), (Some(0.31), Some(0.013), None));
        assert!((only.drift_n.expect("a drift") - 0.0102 * 20.0).abs() < 1e-12);
        // Slopes that say little of the end say nothing: half of their interval over the insertion against 2 % of the force.
        let mut unsure = InstrumentReport::default();
        unsure.of_sensor(None, Some(&lines), 20.0, 1.0);
        assert_eq!(unsure.drift_n, None);
        // Beside no force at all nothing is small.
        let mut nothing = InstrumentReport::default();
        nothing.of_sensor(None, Some(&[lines[0]; 3]), 20.0, 0.0);
        assert_eq!(nothing.drift_n, None);
        let mut both = InstrumentReport::default();
        both.of_sensor(Some(&air), Some(&lines), 20.0, 10.0);
        assert_eq!((both.bias_n, both.drift_n), (Some(0.31), Some(0.4)));
        assert_eq!((both.noise_n, both.ar1), (Some(0.013), Some(0.4)));
        assert_eq!((both.tone, both.drive_friction_n), (Some((0.1, 7.0)), Some(0.2)));
        // A bias of nothing beside the force leaves the check's.
        let mut small = InstrumentReport::default();
        small.of_sensor(Some(&air), Some(&lines), 20.0, 20.0);
        assert_eq!(small.bias_n, Some(0.05));
        let just = line(NEGLIGIBLE_SHARE * 10.0, 0.01);
        small.of_sensor(Some(&air), Some(&[just; 3]), 20.0, 10.0);
        assert_eq!(small.bias_n, Some(0.05));
        let mut none = InstrumentReport::default();
        none.of_sensor(Some(&air), None, 20.0, 10.0);
        assert_eq!(none.bias_n, Some(0.05));
    }

    #[test]
    fn what_makes_less_than_a_fiftieth_of_the_force_is_excluded_and_the_rest_shown() {
        let mut seen = InstrumentReport {
            gain: Some(-0.03),
            bias_n: Some(-0.19),
            drift_n: Some(0.21),
            tone: Some((0.25, 7.5)),
            drive_friction_n: Some(-0.22),
            ..InstrumentReport::default()
        };
        seen.judge(10.0, 20.0, true, None);
        let excluded: Vec<(&str, f64)> =
            seen.excluded.iter().map(|e| (e.effect.as_str(), e.max_force_n)).collect();
        assert_eq!(excluded, [("force_bias", 0.19)]);
        let shown: Vec<&str> = seen.detected.iter().map(|e| e.effect.as_str()).collect();
        assert_eq!(shown, ["force_gain", "force_drift", "periodic_interference", "drive_friction"]);
        let of = |k: usize, path: &str| seen.detected[k].parameters[path];
        assert!((seen.detected[0].max_force_n - 0.3).abs() < 1e-12 && of(0, "eps").value == -0.03);
        assert!((of(1, "rate_n_per_s").value - 0.0105).abs() < 1e-12);
        assert_eq!((of(2, "amplitude_n").value, of(2, "frequency_hz").low), (0.25, 7.5));
        // The phase is nobody's.
        assert_eq!(seen.detected[2].parameters.len(), 2);
        assert!(seen.detected[0].evidence.contains("-3.00 %"), "{}", seen.detected[0].evidence);
        assert!(seen.excluded[0].evidence.contains("-190.0 mN"), "{}", seen.excluded[0].evidence);
        let cause = seen.detected[3].cause();
        assert_eq!(
            (cause.effect.as_str(), cause.confidence, cause.parameters["force_n"].value),
            ("drive_friction", 0.99, -0.22)
        );
        // Just a fiftieth is shown.
        let mut just =
            InstrumentReport { bias_n: Some(NEGLIGIBLE_SHARE * 10.0), ..InstrumentReport::default() };
        just.judge(10.0, 20.0, true, None);
        assert_eq!((just.detected.len(), just.excluded.len()), (1, 0));
        // Without a check in air neither tones nor the drive are told.
        seen.judge(10.0, 20.0, false, None);
        assert_eq!(seen.detected.len(), 2);
    }

    #[test]
    fn insertions_without_checks_are_looked_at_by_themselves() {
        let run = |k: usize, ahead_m: f64| {
            let t: Vec<f64> = (0..1000).map(|i| 0.02 * i as f64).collect();
            let z: Vec<f64> = t
                .iter()
                .map(|t| if *t < 12.0 { 0.002 * t - ahead_m } else { 0.024 - ahead_m - 0.004 * (t - 12.0) })
                .collect();
            let noise = |i: usize| 1e-3 * (((i * 7919 + 31 * k) % 101) as f64 / 101.0 - 0.5);
            let f = z.iter().enumerate().map(|(i, z)| 0.2 + 150.0 * z.max(0.0) + noise(i)).collect();
            SegmentedRecording::new(format!("{k}"), Recording::new(t, z, f).expect("clean columns"), 1)
        };
        let runs: Vec<SegmentedRecording> = (0..3).map(|k| run(k, 0.008)).collect();
        let refs: Vec<&SegmentedRecording> = runs.iter().collect();
        let seen = InstrumentReport::assess(&ReferenceRecordings::default(), &refs, 0.0);
        assert!((seen.bias_n.expect("a bias") - 0.2).abs() < 1e-3, "{seen:?}");
        assert!(seen.drift_n.expect("no drift").abs() < 1e-3, "{seen:?}");
        assert_eq!(seen.detected.iter().map(|s| s.effect.as_str()).collect::<Vec<_>>(), ["force_bias"]);
        assert_eq!(seen.drifts_n_per_s.len(), 3);
        // A load over a zero that the insertions tell.
        let f = (0..40).map(|k| 0.2 + 5.5 + 1e-3 * ((k * 37) % 11) as f64).collect();
        let weight = still(f);
        let checks = ReferenceRecordings { load: Some((&weight, 5.0)), ..ReferenceRecordings::default() };
        let seen = InstrumentReport::assess(&checks, &refs, 0.0);
        assert!((seen.gain.expect("a gain") - 0.1).abs() < 2e-3, "{:?}", seen.gain);
        // Half of the insertions with air are enough, fewer are not.
        let bias = |which: &[&SegmentedRecording]| {
            InstrumentReport::assess(&ReferenceRecordings::default(), which, 0.0).bias_n
        };
        let (late, later) = (run(3, -0.001), run(4, -0.001));
        assert!(bias(&[refs[0], &late]).is_some() && bias(&refs[..1]).is_some());
        assert_eq!(bias(&[refs[0], &late, &later]), None);
    }

    /// An insertion from so far before a surface at 0 and back, 20 s, with a force in air that changes at this rate (N/s).
    fn drifting(k: usize, ahead_m: f64, rate_n_per_s: f64) -> SegmentedRecording {
        let t: Vec<f64> = (0..1000).map(|i| 0.02 * i as f64).collect();
        let at = |t: f64| if t < 12.0 { 0.002 * t - ahead_m } else { 0.024 - ahead_m - 0.004 * (t - 12.0) };
        let z: Vec<f64> = t.iter().map(|t| at(*t)).collect();
        let noise = |i: usize| 1e-3 * (((i * 7919 + 31 * k) % 101) as f64 / 101.0 - 0.5);
        let f = t
            .iter()
            .enumerate()
            .map(|(i, t)| 0.2 + rate_n_per_s * t + 150.0 * at(*t).max(0.0) + noise(i))
            .collect();
        SegmentedRecording::new(format!("{k}"), Recording::new(t, z, f).expect("clean columns"), 1)
    }

    #[test]
    fn half_of_the_insertions_tell_a_drift_over_an_insertion() {
        let (run, deep) = (drifting(0, 0.008, 0.02), drifting(1, -0.001, 0.02));
        let drift = |with: usize, without: usize| {
            let all: Vec<&SegmentedRecording> =
                std::iter::repeat_n(&run, with).chain(std::iter::repeat_n(&deep, without)).collect();
            let seen = InstrumentReport::assess(&ReferenceRecordings::default(), &all, 0.0);
            // From before to after tells more than a slope before.
            let rates: Vec<f64> = seen.drifts_n_per_s.iter().copied().flatten().collect();
            if seen.drift_n.is_some() {
                assert_eq!(seen.drift_n, Some(consensus(&rates) * run.recording.duration_s()));
            }
            seen.drift_n
        };
        // 20 mN/s over 19.98 s.
        for (with, without) in [(1, 0), (2, 0), (1, 1), (2, 2)] {
            let told = drift(with, without);
            assert_eq!(told.is_some(), with >= 1 && 2 * with >= (with + without).max(2));
            assert!(told.is_none_or(|d| (d - 0.3996).abs() < 0.01), "{told:?}");
        }
        assert_eq!((drift(1, 2), drift(2, 3)), (None, None));
    }

    /// A drift worth a word makes of a load what it was at first; one that is nothing leaves its median.
    #[test]
    fn a_load_is_read_at_its_beginning_where_the_sensor_drifts() {
        let f = (0..200).map(|k| 5.7 + 0.01 * f64::from(k) + 1e-3 * f64::from((k * 37) % 11)).collect();
        let weight = still(f);
        for (rate, level) in [(0.02, 5.5), (1e-3, 5.5 + 0.995)] {
            let run = drifting(0, 0.008, rate);
            let checks = ReferenceRecordings { load: Some((&weight, 5.0)), ..ReferenceRecordings::default() };
            let seen = InstrumentReport::assess(&checks, &[&run, &run], 0.0);
            let gain = seen.gain.expect("a gain");
            assert!((gain - (level / 5.0 - 1.0)).abs() < 4e-3, "{rate}: {gain}");
        }
    }

    #[test]
    fn the_timing_of_a_run_is_told_as_it_is() {
        let t = vec![0.0, 0.01, 0.02, 0.035, 0.05];
        let z = vec![0.002, 0.003, 0.0075, 0.006, 0.005];
        let text = sampling_summary(&Recording::new(t, z, vec![0.0; 5]).expect("clean columns"));
        for part in ["5 samples", "80.0 Hz", "largest gap 15.0 ms", "ends at 5.5 mm"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
