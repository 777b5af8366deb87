//! What the instrument does by itself: a motion in air and a known load show which effects of the sensor
//! and the drive cannot explain a residual.

use crate::outcome::{Cause, Estimate};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stylet_record::{DEFAULT_HALF_WIDTH_S, Recording};
use stylet_stats::{mean, median, rms};

/// Amplitudes (N) below this share of the residual to be explained explain nothing of it.
pub const NOTHING: f64 = 0.2;

/// Confidence in what a check of the instrument shows by itself.
const SEEN: f64 = 0.99;

/// What the instrument was seen to do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Instrument {
    /// Standard deviation of the noise in air (N).
    pub noise_n: Option<f64>,
    /// Correlation of neighbouring noise samples.
    pub ar1: Option<f64>,
    /// Mean force in air (N).
    pub bias_n: Option<f64>,
    /// Change of the force over the recording in air (N).
    pub drift_n: Option<f64>,
    /// Amplitude (N) and frequency (Hz) of the strongest line in air.
    pub line: Option<(f64, f64)>,
    /// Half the difference (N) between moving in and moving out, in air.
    pub drive_n: Option<f64>,
    /// Measured over known force, less one.
    pub gain: Option<f64>,
    /// Effects that this excludes, with what was found.
    pub excluded: Vec<Excluded>,
    /// Effects that this shows.
    #[serde(default)]
    pub shown: Vec<Shown>,
}

/// An effect that the instrument's checks show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Effect, by its id.
    pub effect: String,
    /// Its parameters by their paths.
    pub parameters: BTreeMap<String, Estimate>,
    /// Largest force in N that it makes here.
    pub size_n: f64,
    /// What was found.
    pub evidence: String,
}

impl Shown {
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
pub struct Excluded {
    /// Effect, by its id.
    pub effect: String,
    /// Largest force in N that it can make here.
    pub size_n: f64,
    /// What was found.
    pub evidence: String,
}

impl Instrument {
    /// Looks at the checks; `force_n` is the largest force of the insertions and `residual_n` what has to be explained.
    #[must_use]
    pub fn look(
        air: Option<&Recording>,
        load: Option<(&Recording, f64)>,
        force_n: f64,
        residual_n: f64,
    ) -> Self {
        let mut out = Self::default();
        if let Some(air) = air {
            out.in_air(air);
        }
        if let Some((recording, known)) = load {
            let mut force = recording.force_n.clone();
            out.gain = Some(median(&mut force) / known - 1.0);
        }
        let (mut excluded, mut shown) = (Vec::new(), Vec::new());
        let mut judge = |effect: &str, size_n: Option<f64>, numbers: &[(&str, f64)], evidence: String| {
            let Some(size_n) = size_n else { return };
            let effect = effect.to_owned();
            if size_n.abs() < NOTHING * residual_n {
                excluded.push(Excluded { effect, size_n: size_n.abs(), evidence });
            } else {
                // What noise leaves open of a mean is far below what is worth a word.
                let of = |value: f64| Estimate { value, low: value, high: value };
                let parameters = numbers.iter().map(|(k, x)| ((*k).to_owned(), of(*x))).collect();
                shown.push(Shown { effect, parameters, size_n: size_n.abs(), evidence });
            }
        };
        let mn = |x: Option<f64>| format!("{:.1} mN", 1e3 * x.unwrap_or(0.0));
        let gain = out.gain;
        judge(
            "force_gain",
            gain.map(|g| g * force_n),
            &[("eps", gain.unwrap_or(0.0))],
            format!("a known load is measured {:+.2} % off", 100.0 * gain.unwrap_or(0.0)),
        );
        let bias = out.bias_n.unwrap_or(0.0);
        judge(
            "force_bias",
            out.bias_n,
            &[("force_n", bias)],
            format!("mean force in air {}", mn(out.bias_n)),
        );
        let rate = out.drift_n.unwrap_or(0.0) / air.map_or(1.0, Recording::duration_s).max(1e-9);
        judge(
            "force_drift",
            out.drift_n,
            &[("rate_n_per_s", rate)],
            format!("change over the recording in air {}", mn(out.drift_n)),
        );
        let (amplitude_n, hz) = out.line.unwrap_or((0.0, 0.0));
        judge(
            "periodic_interference",
            out.line.map(|l| l.0),
            &[("amplitude_n", amplitude_n), ("frequency_hz", hz)],
            format!("strongest line in air {} at {hz:.1} Hz", mn(Some(amplitude_n))),
        );
        judge(
            "drive_friction",
            out.drive_n,
            &[("force_n", out.drive_n.unwrap_or(0.0))],
            format!("half the difference between in and out, in air, {}", mn(out.drive_n)),
        );
        (out.excluded, out.shown) = (excluded, shown);
        out
    }

    fn in_air(&mut self, air: &Recording) {
        let (t, f) = (&air.time_s, &air.force_n);
        let mean = mean(f);
        self.bias_n = Some(mean);
        let middle = 0.5 * (t[0] + t[t.len() - 1]);
        let (tt, tf) = t.iter().zip(f).fold((0.0, 0.0), |(tt, tf), (t, f)| {
            (tt + (t - middle) * (t - middle), tf + (t - middle) * (f - mean))
        });
        let slope = tf / tt.max(1e-12);
        self.drift_n = Some(slope * (t[t.len() - 1] - t[0]));
        let rest: Vec<f64> = t.iter().zip(f).map(|(t, f)| f - mean - slope * (t - middle)).collect();
        let sd = rms(&rest);
        self.noise_n = Some(sd);
        let lagged: f64 = rest.windows(2).map(|p| p[0] * p[1]).sum();
        self.ar1 = Some(lagged / rest.iter().map(|x| x * x).sum::<f64>().max(1e-300));
        self.line = line(t, &rest);
        let of = |sign: f64| {
            let moving: Vec<f64> =
                air.velocity_mps.iter().zip(f).filter(|(v, _)| **v * sign > 2e-4).map(|(_, f)| *f).collect();
            (moving.len() > 20).then(|| stylet_stats::mean(&moving))
        };
        if let (Some(to), Some(fro)) = (of(1.0), of(-1.0)) {
            self.drive_n = Some(0.5 * (to - fro));
        }
    }
}

/// The strongest sinusoid (amplitude, frequency) up to the half sampling rate, on the time stamps as they are.
fn line(t: &[f64], e: &[f64]) -> Option<(f64, f64)> {
    let duration = t[t.len() - 1] - t[0];
    if duration <= 0.0 || t.len() < 20 {
        return None;
    }
    let most = 0.5 * t.len() as f64 / duration;
    let step = 0.5 / duration;
    let mut best = (0.0, 0.0);
    let mut k = 2.0;
    while k * step < most {
        let omega = std::f64::consts::TAU * k * step;
        let (mut c, mut s) = (0.0, 0.0);
        for (at, e) in t.iter().zip(e) {
            let (sin, cos) = libm::sincos(omega * (at - t[0]));
            c += e * cos;
            s += e * sin;
        }
        let amplitude = 2.0 * libm::sqrt(c * c + s * s) / t.len() as f64;
        if amplitude > best.0 {
            best = (amplitude, k * step);
        }
        k += 1.0;
    }
    Some(best)
}

/// Remarks on the timing and the stroke of a run, for the data-quality section.
#[must_use]
pub fn timing(recording: &Recording) -> String {
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
