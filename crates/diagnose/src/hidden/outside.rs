//! Effects that the library lacks.

/// Kinds of them.
pub const OUTSIDE: [&str; 8] = [
    "ripple_in_depth",
    "lump_at_depth",
    "steps_in_bias",
    "chirp",
    "friction_fades_with_time",
    "slack_on_return",
    "force_with_acceleration_squared",
    "corrugated_friction",
];

/// One of them, with its numbers.
#[derive(Clone, Debug)]
pub struct Outside {
    /// Which of [`OUTSIDE`].
    pub kind: usize,
    /// Numbers in 0..1.
    pub u: [f64; 4],
    /// Size in N.
    pub size_n: f64,
    /// Deepest position so far.
    walk: f64,
}

impl Outside {
    /// An effect of this kind.
    #[must_use]
    pub fn new(kind: usize, u: [f64; 4], size_n: f64) -> Self {
        Self { kind: kind % OUTSIDE.len(), u, size_n, walk: 0.0 }
    }

    /// The force at an instant, `inside` being the length of needle in tissue (m), every millisecond.
    pub fn force(&mut self, t: f64, z: f64, v: f64, a: f64, inside: f64) -> f64 {
        let tau = core::f64::consts::TAU;
        let u = self.u;
        let shape = match self.kind {
            0 if z > 0.0 => (tau * z / (0.004 + 0.01 * u[0]) + tau * u[1]).sin(),
            1 => [0.2 + 0.1 * u[0], 0.45 + 0.1 * u[1], 0.75 + 0.1 * u[2]]
                .iter()
                .map(|at| {
                    let x = (z - 0.1 * at) / (0.0015 + 0.002 * u[3]);
                    2.0 * (-x * x).exp()
                })
                .sum(),
            2 => {
                let k = (t / (5.0 + 6.0 * u[0])).floor();
                (k * 2.4 + 6.0 * u[1]).sin().signum() * (0.5 + 0.5 * (k * 1.7).cos().abs())
            }
            3 => (tau * (0.05 + 0.4 * u[0]) * t * (1.0 + t / (20.0 + 20.0 * u[1]))).sin(),
            4 => 20.0 * inside * (v / 3e-3).tanh() * (-t / (6.0 + 8.0 * u[0])).exp(),
            5 => {
                self.walk = self.walk.max(z);
                -2.0 * ((self.walk - z) / (0.002 + 0.004 * u[0])).min(1.0)
            }
            6 => (a / 5e-3).abs().min(3.0) * (v / 3e-3).abs(),
            _ if z > 0.0 => v / 3e-3 * (tau * z / (0.006 + 0.012 * u[0])).sin() * inside / 0.05,
            _ => 0.0,
        };
        self.size_n * shape
    }

    /// Back to the start of a recording.
    pub fn restart(&mut self) {
        self.walk = 0.0;
    }
}
