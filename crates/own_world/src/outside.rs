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

#[cfg(test)]
mod tests {
    use super::{OUTSIDE, Outside};

    /// Python's numbers for the formulas as they were written down, at six instants of a way in and out: time, position, velocity,
    /// acceleration, length inside.
    #[test]
    fn each_shape_is_the_one_that_was_written_down() {
        let instants: [[f64; 5]; 6] = [
            [0.3, -0.004, 0.0021, 0.0004, 0.0],
            [2.7, 0.0213, 0.0034, -0.0071, 0.0213],
            [7.9, 0.0466, -0.0012, 0.0213, 0.0466],
            [8.4, 0.0452, -0.0027, -0.0019, 0.0452],
            [13.6, 0.0789, 0.0051, 0.0008, 0.0789],
            [31.3, 0.0718, -0.0044, -0.0333, 0.0718],
        ];
        let wanted: [[f64; 6]; 8] = [
            [0.0, 1.398587461755, -1.253397504937, 0.524009413174, -1.506117406623, -0.958408060802],
            [0.0, 0.712678716314, 0.028399582961, 0.000687004983, 0.017810614495, 0.0],
            [-1.7, -1.7, -0.959517820151, -0.959517820151, -0.959517820151, 1.588987866797],
            [
                0.625453441385,
                -0.821580709142,
                -0.471719972346,
                1.044610807501,
                -1.364408037031,
                1.457993513332,
            ],
            [0.0, 0.43513951929, -0.249272404394, -0.431082045489, 0.54999724708, -0.066713149721],
            [-3.4, 0.0, 0.0, -1.367816091954, 0.0, -3.4],
            [0.0952, 2.735866666667, 2.04, 0.5814, 0.4624, 7.48],
            [0.0, 0.205262767647, -0.143679681795, -1.214116652003, -1.611223485754, 2.493366377021],
        ];
        for (kind, wanted) in wanted.iter().enumerate() {
            let mut shape = Outside::new(kind, [0.37, 0.58, 0.83, 0.21], 1.7);
            for round in 0..2 {
                shape.restart();
                for ([t, z, v, a, inside], wanted) in instants.iter().zip(wanted) {
                    let f = shape.force(*t, *z, *v, *a, *inside);
                    assert!(
                        (f - wanted).abs() < 1e-9,
                        "{} at {t} s: {f} for {wanted} (round {round})",
                        OUTSIDE[kind]
                    );
                }
            }
        }
        assert_eq!(Outside::new(11, [0.0; 4], 1.0).kind, 3);
        // What lies at a depth begins behind the surface.
        assert_eq!(Outside::new(0, [0.25; 4], 1.0).force(0.0, 0.0, 1e-3, 0.0, 0.0), 0.0);
        assert_eq!(Outside::new(7, [0.25; 4], 1.0).force(0.0, -0.004, 1e-3, 0.0, 0.01), 0.0);
    }
}
