//! The motions of a case.

/// What the four recordings do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motions {
    /// Constant speed with retraction, sinusoid, two programs with ripple, holds and retraction.
    Rich,
    /// Four advances at one constant speed.
    Constant,
    /// One program only.
    One,
}

/// A motion: position by pieces of (duration s, mean speed m/s, ripple m/s, ripple Hz) from a start, or a
/// sinusoid.
#[derive(Clone, Debug)]
pub enum Path {
    /// Pieces.
    Pieces(f64, Vec<[f64; 4]>),
    /// Start (m), amplitude (m), frequency (Hz), duration (s).
    Sinusoid(f64, f64, f64, f64),
}

impl Path {
    /// Duration in s.
    pub fn duration(&self) -> f64 {
        match self {
            Path::Pieces(_, pieces) => pieces.iter().map(|p| p[0]).sum(),
            Path::Sinusoid(.., d) => *d,
        }
    }

    /// Position, velocity, acceleration.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let tau = core::f64::consts::TAU;
        match self {
            Path::Sinusoid(start, a, f, _) => {
                let w = tau * f;
                [start + a * (1.0 - (w * t).cos()), a * w * (w * t).sin(), a * w * w * (w * t).cos()]
            }
            Path::Pieces(start, pieces) => {
                let (mut z, mut t) = (*start, t);
                for (k, p) in pieces.iter().enumerate() {
                    let last = k + 1 == pieces.len();
                    let here = if last { t } else { t.min(p[0]) };
                    let w = tau * p[3].max(1e-9);
                    let there = z + p[1] * here + p[2] / w * (1.0 - (w * here).cos());
                    if here < p[0] || last {
                        return [there, p[1] + p[2] * (w * here).sin(), p[2] * w * (w * here).cos()];
                    }
                    z = there;
                    t -= p[0];
                }
                [z, 0.0, 0.0]
            }
        }
    }
}

/// The motions of a case; `u` draws uniform numbers in 0..1.
pub fn paths(which: Motions, u: &mut dyn FnMut() -> f64) -> Vec<Path> {
    let mut between = |lo: f64, hi: f64| lo + (hi - lo) * u();
    let depth = 0.103;
    let start = -0.005;
    let constant = |v: f64, back: f64| {
        Path::Pieces(
            start,
            vec![[(depth - start) / v, v, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [back, -v * 1.5, 0.0, 0.0]],
        )
    };
    match which {
        Motions::Constant => {
            (0..4).map(|_| Path::Pieces(start, vec![[(depth - start) / 0.0023, 0.0023, 0.0, 0.0]])).collect()
        }
        Motions::One => vec![program(&mut between, start, depth)],
        Motions::Rich => {
            let v = between(0.0021, 0.0035);
            let back = between(3.0, 8.0);
            let f = between(0.011, 0.0167);
            vec![
                constant(v, back),
                Path::Sinusoid(start, 0.5 * (depth - start) + 0.002, f, between(0.7, 0.95) / f),
                program(&mut between, start, depth),
                program(&mut between, start, depth),
            ]
        }
    }
}

fn program(between: &mut dyn FnMut(f64, f64) -> f64, start: f64, depth: f64) -> Path {
    let mut pieces = Vec::new();
    let mut z = start;
    let mut first = true;
    while z < depth {
        let v = between(0.0015, 0.006);
        let travel = if first { between(0.012, 0.02) } else { between(0.01, 0.03) };
        first = false;
        let kind = between(0.0, 1.0);
        if kind < 0.55 {
            pieces.push([travel / v, v, v * between(0.2, 0.8), between(0.2, 1.0)]);
        } else {
            pieces.push([travel / v, v, 0.0, 0.0]);
        }
        z += travel;
        let pause = between(0.0, 1.0);
        if pause < 0.5 {
            pieces.push([between(0.8, 3.0), 0.0, 0.0, 0.0]);
        }
        if between(0.0, 1.0) < 0.3 {
            let back = between(0.002, 0.006);
            pieces.push([back / 0.003, -0.003, 0.0, 0.0]);
            z -= back;
        }
    }
    pieces.push([between(1.0, 2.0), 0.0, 0.0, 0.0]);
    let v = between(0.003, 0.008);
    pieces.push([between(0.3, 0.8) * depth / v, -v, 0.0, 0.0]);
    Path::Pieces(start, pieces)
}
