//! What the instrument does by itself: a motion in air and a known load show which effects of the sensor
//! and the drive cannot explain a residual.

use crate::stats::{mean_sd, median, rms};
use serde::{Deserialize, Serialize};
use stylet_record::{DEFAULT_HALF_WIDTH_S, Recording};

/// Amplitudes (N) below this share of the residual to be explained explain nothing of it.
pub const NOTHING: f64 = 0.2;

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
        let mut exclude = |effect: &str, size_n: Option<f64>, evidence: String| {
            if let Some(size_n) = size_n.filter(|s| s.abs() < NOTHING * residual_n) {
                out.excluded.push(Excluded { effect: effect.to_owned(), size_n: size_n.abs(), evidence });
            }
        };
        let mn = |x: Option<f64>| format!("{:.1} mN", 1e3 * x.unwrap_or(0.0));
        let gain = out.gain;
        exclude(
            "force_gain",
            gain.map(|g| g * force_n),
            format!("a known load is measured {:+.2} % off", 100.0 * gain.unwrap_or(0.0)),
        );
        exclude("force_bias", out.bias_n, format!("mean force in air {}", mn(out.bias_n)));
        exclude("force_drift", out.drift_n, format!("change over the recording in air {}", mn(out.drift_n)));
        exclude(
            "periodic_interference",
            out.line.map(|l| l.0),
            format!(
                "strongest line in air {} at {:.1} Hz",
                mn(out.line.map(|l| l.0)),
                out.line.map_or(0.0, |l| l.1)
            ),
        );
        exclude(
            "drive_friction",
            out.drive_n,
            format!("half the difference between in and out, in air, {}", mn(out.drive_n)),
        );
        out
    }

    fn in_air(&mut self, air: &Recording) {
        let (t, f) = (&air.time_s, &air.force_n);
        let (mean, _) = mean_sd(f);
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
            (moving.len() > 20).then(|| mean_sd(&moving).0)
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
