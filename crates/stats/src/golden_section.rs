//! Golden-section search for the minimum of a function of one variable (Kiefer 1953).

/// Ratio of the golden section.
const RATIO: f64 = 0.618_033_988_749_894_9;

/// Middle of the interval that encloses a minimum of `f` between `low` and `high`, after `steps` evaluations beyond the first two; each
/// shortens the interval by 0.618. Of several minima, any one.
pub fn golden_section(f: impl Fn(f64) -> f64, (mut low, mut high): (f64, f64), steps: usize) -> f64 {
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    for _ in 0..steps {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - RATIO * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + RATIO * (high - low);
            fb = f(b);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::golden_section;

    #[test]
    fn the_minimum_of_a_parabola_is_found_inside_and_at_the_border() {
        let parabola = |x: f64| (x - 0.3) * (x - 0.3);
        assert!((golden_section(parabola, (-1.0, 2.0), 30) - 0.3).abs() < 3e-6);
        assert!((golden_section(parabola, (1.0, 2.0), 30) - 1.0).abs() < 3e-6);
    }
}
