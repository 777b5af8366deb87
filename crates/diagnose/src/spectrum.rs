//! Periodogram of residuals: which frequencies stand out.

/// In-place radix-2 Fourier transform; the length is a power of two.
fn transform(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let mut j = 0;
    for i in 1..n {
        let mut bit = n >> 1;
        while j & bit != 0 {
            j ^= bit;
            bit >>= 1;
        }
        j |= bit;
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let mut size = 2;
    while size <= n {
        let half = size / 2;
        let twiddles: Vec<(f64, f64)> =
            (0..half).map(|k| libm::sincos(-core::f64::consts::TAU * k as f64 / size as f64)).collect();
        for start in (0..n).step_by(size) {
            for (k, (sin, cos)) in twiddles.iter().enumerate() {
                let (a, b) = (start + k, start + k + half);
                let (x, y) = (re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos);
                (re[b], im[b]) = (re[a] - x, im[a] - y);
                re[a] += x;
                im[a] += y;
            }
        }
        size *= 2;
    }
}

/// Periodogram `|sum w exp(-i omega k)|^2 / n` on a grid at least twice as fine as the data's own: for
/// white noise of unit variance every value is exponential with mean one, and a sinusoid's value is
/// the nats it explains. Returns frequencies (Hz) and values.
#[must_use]
pub fn periodogram(w: &[f64], sample_hz: f64, length: usize) -> (Vec<f64>, Vec<f64>) {
    let size = length.max(w.len()).next_power_of_two();
    let (mut re, mut im) = (w.to_vec(), vec![0.0; size]);
    re.resize(size, 0.0);
    transform(&mut re, &mut im);
    let n = w.len().max(1) as f64;
    (0..size / 2).map(|k| (k as f64 * sample_hz / size as f64, (re[k] * re[k] + im[k] * im[k]) / n)).unzip()
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
