//! Periodogram of residuals: which frequencies stand out.

use crate::track::Track;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex;

/// Periodogram `|sum w exp(-i omega k)|^2 / n` on a grid at least twice as fine as the data's own: for
/// white noise of unit variance every value is exponential with mean one, and a sinusoid's value is
/// the nats it explains. Returns frequencies (Hz) and values.
#[must_use]
pub fn periodogram(w: &[f64], sample_hz: f64, length: usize) -> (Vec<f64>, Vec<f64>) {
    let size = length.max(w.len()).next_power_of_two();
    let mut values: Vec<Complex<f64>> = w.iter().map(|w| Complex::new(*w, 0.0)).collect();
    values.resize(size, Complex::new(0.0, 0.0));
    // The scalar planner: the same bytes on every machine.
    FftPlannerScalar::new().plan_fft_forward(size).process(&mut values);
    let n = w.len().max(1) as f64;
    let half = values.iter().take(size / 2).enumerate();
    half.map(|(k, x)| (k as f64 * sample_hz / size as f64, x.norm_sqr() / n)).unzip()
}

/// The highest separate peaks above `low_hz`: (frequency, value).
#[must_use]
pub fn peaks(frequency: &[f64], value: &[f64], low_hz: f64, count: usize) -> Vec<(f64, f64)> {
    let mut found: Vec<(f64, f64)> = (1..value.len().saturating_sub(1))
        .filter(|&k| frequency[k] >= low_hz && value[k] >= value[k - 1] && value[k] > value[k + 1])
        .map(|k| (frequency[k], value[k]))
        .collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.truncate(count);
    found
}

/// The frequency (Hz) near `about_hz` of the sinusoid, the same in all recordings with time from their
/// starts, that explains most of `e`; `span_s` is the longest duration. A peak of a periodogram is known to
/// a fraction of `1/span_s`, the phase at the end of a recording asks for a tenth of that.
#[must_use]
pub fn sharpen(tracks: &[Track], e: &[f64], about_hz: f64, span_s: f64) -> f64 {
    const REACH: i32 = 12;
    let explained = |f: f64| {
        let (mut ss, mut sc, mut cc, mut es, mut ec) = (1e-300, 0.0, 1e-300, 0.0, 0.0);
        let mut from = 0;
        for track in tracks {
            for (i, &t) in track.t.iter().enumerate().filter(|(i, _)| track.used[*i]) {
                let (s, c) = libm::sincos(core::f64::consts::TAU * f * t);
                let e = e[from + i];
                ss += s * s;
                sc += s * c;
                cc += c * c;
                es += e * s;
                ec += e * c;
            }
            from += track.len();
        }
        let det = (ss * cc - sc * sc).max(1e-300);
        (es * es * cc - 2.0 * es * ec * sc + ec * ec * ss) / det
    };
    (-REACH..=REACH)
        .map(|k| about_hz + f64::from(k) / (f64::from(REACH) * span_s))
        .filter(|f| *f > 0.0)
        .map(|f| (explained(f), f))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(about_hz, |best| best.1)
}
