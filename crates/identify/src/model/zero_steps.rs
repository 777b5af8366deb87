//! Steps of the sensor zero: a piecewise constant offset of the force of each recording.

/// A step of the zero in one recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroStep {
    /// Time in s, between two samples.
    pub time_s: f64,
    /// Size in N: the zero after minus the zero before.
    pub size_n: f64,
}

impl ZeroStep {
    /// Adds `factor` times the step to the means `force_n` of blocks with these limits.
    pub fn add_to(&self, start_s: &[f64], end_s: &[f64], force_n: &mut [f64], factor: f64) {
        let first = end_s.partition_point(|end| *end <= self.time_s);
        for (k, force) in force_n.iter_mut().enumerate().skip(first) {
            let after = ((end_s[k] - self.time_s) / (end_s[k] - start_s[k])).clamp(0.0, 1.0);
            *force += factor * self.size_n * after;
        }
    }
}
