//! The causal residual and the peak of a statistic, as in `entrant.py`.

/// The force less its own straight line, extrapolated by one sample, in noise standard deviations.
///
/// Level and slope follow the force with a time constant. A deviation beyond four standard deviations does not drag them
/// along; where it lasts longer than the time constant, they start again. The noise is the mean absolute residual of the last second.
pub struct Residual {
    gain_level: f64,
    gain_slope: f64,
    patience: f64,
    longest: f64,
    count: f64,
    scale: f64,
    level: Option<f64>,
    slope: f64,
    outside: f64,
    /// The last deviation of the force from the line, in N.
    pub deviation: f64,
}

impl Residual {
    pub fn new(rate: f64, time_constant: f64) -> Self {
        let patience = (time_constant * rate).max(3.0);
        let memory = (-1.0 / patience).exp();
        Self {
            gain_level: 1.0 - memory * memory,
            gain_slope: (1.0 - memory) * (1.0 - memory),
            patience,
            longest: rate.max(50.0),
            count: 0.0,
            scale: 0.0,
            level: None,
            slope: 0.0,
            outside: 0.0,
            deviation: 0.0,
        }
    }

    pub fn restart(&mut self, level: f64) {
        self.level = Some(level);
        self.slope = 0.0;
        self.outside = 0.0;
    }

    pub fn next(&mut self, force: f64) -> f64 {
        let predicted = self.level.unwrap_or(force) + self.slope;
        self.deviation = force - predicted;
        self.count = (self.count + 1.0).min(self.longest);
        let known = self.count > 20.0;
        let mut size = self.deviation.abs();
        if known {
            size = size.min(4.0 * self.scale);
        }
        self.scale = (self.scale + (size - self.scale) / self.count).max(1e-4);
        let limit = 5.0 * self.scale; // four standard deviations
        if self.deviation.abs() < limit {
            self.outside = 0.0;
        } else {
            self.outside += 1.0;
            if self.outside > self.patience || !known {
                self.restart(force);
                return 0.0;
            }
        }
        let followed = self.deviation.clamp(-limit, limit);
        self.level = Some(predicted + self.gain_level * followed);
        self.slope += self.gain_slope * followed;
        if known {
            self.deviation / (1.25 * self.scale)
        } else {
            0.0
        }
    }
}

/// When a statistic has risen above its threshold: reports its largest value once it has not grown for 4 ms, at the latest
/// after 20 ms.
pub struct Peak {
    threshold: f64,
    patience: u32,
    longest: u32,
    largest: f64,
    age: u32,
    held: u32,
}

impl Peak {
    pub fn new(rate: f64, threshold: f64) -> Self {
        let samples = |time: f64| (time * rate + 0.5) as u32;
        let (patience, longest) = (samples(0.004), samples(0.02));
        Self { threshold, patience, longest, largest: threshold, age: 0, held: 0 }
    }

    pub fn next(&mut self, statistic: f64) -> Option<f64> {
        if statistic > self.largest {
            self.largest = statistic;
            self.age = 0;
        } else if self.largest == self.threshold {
            return None;
        } else {
            self.age += 1;
        }
        self.held += 1;
        if self.age < self.patience && self.held < self.longest {
            return None;
        }
        let peak = self.largest;
        (self.largest, self.age, self.held) = (self.threshold, 0, 0);
        Some(peak)
    }
}
