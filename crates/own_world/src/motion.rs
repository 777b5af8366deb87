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

#[cfg(test)]
mod tests {
    use super::Path;

    #[test]
    fn a_sinusoid_begins_at_rest_and_turns_after_half_a_period() {
        let path = Path::Sinusoid(-0.003, 0.02, 0.25, 9.0);
        assert_eq!(path.duration(), 9.0);
        let w = 0.5 * std::f64::consts::PI;
        for t in [0.0, 0.7, 2.0, 5.3] {
            let [z, v, a] = path.at(t);
            assert!((z - (-0.003 + 0.02 * (1.0 - (w * t).cos()))).abs() < 1e-15);
            assert!((v - 0.02 * w * (w * t).sin()).abs() < 1e-15);
            assert!((a - 0.02 * w * w * (w * t).cos()).abs() < 1e-15);
        }
        assert!((path.at(2.0)[0] - 0.037).abs() < 1e-12);
    }

    /// Pieces follow one another without a jump of the position; each has a mean speed and a ripple that begins at nothing; the last one
    /// goes on.
    #[test]
    fn pieces_follow_one_another() {
        let pieces = vec![[2.0, 0.004, 0.003, 0.7], [1.5, 0.0, 0.0, 0.0], [3.0, -0.002, 0.001, 1.3]];
        let path = Path::Pieces(0.01, pieces.clone());
        assert_eq!(path.duration(), 6.5);
        let way = |p: &[f64; 4], t: f64| {
            let w = std::f64::consts::TAU * p[3].max(1e-9);
            p[1] * t + p[2] / w * (1.0 - (w * t).cos())
        };
        let first = 0.01 + way(&pieces[0], 2.0);
        for (t, piece, since, begins) in [
            (0.0, 0, 0.0, 0.01),
            (1.3, 0, 1.3, 0.01),
            (2.0, 1, 0.0, first),
            (3.1, 1, 1.1, first),
            (3.5, 2, 0.0, first),
            (5.9, 2, 2.4, first),
            (8.0, 2, 4.5, first),
        ] {
            let p = &pieces[piece];
            let w = std::f64::consts::TAU * p[3];
            let [z, v, a] = path.at(t);
            assert!((z - begins - way(p, since)).abs() < 1e-12, "{t}: {z}");
            assert!((v - p[1] - p[2] * (w * since).sin()).abs() < 1e-12, "{t}: {v}");
            assert!((a - p[2] * w * (w * since).cos()).abs() < 1e-9, "{t}: {a}");
        }
        assert_eq!(Path::Pieces(0.3, Vec::new()).at(1.0), [0.3, 0.0, 0.0]);
    }
}
