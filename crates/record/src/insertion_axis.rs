//! The axis of a motion in space.

/// An axis fitted to points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FittedAxis {
    /// Unit vector in the direction of the largest displacement from the first point.
    pub axis: [f64; 3],
    /// Share of the variance along the axis.
    pub share: f64,
}

/// Iterations of the power method; the ratio of the two largest variances of an insertion makes a few enough.
const ITERATIONS: usize = 100;

/// The principal axis of the points, components in columns; NaN values are left out.
pub(crate) fn fit_axis(components: &[Vec<f64>]) -> FittedAxis {
    let [x, y, z] = components else { return FittedAxis { axis: [0.0, 0.0, 1.0], share: 0.0 } };
    let points = || {
        let points = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
        points.filter(|p| p.iter().all(|c| c.is_finite()))
    };
    let Some(first) = points().next() else { return FittedAxis { axis: [0.0, 0.0, 1.0], share: 0.0 } };
    // Scaled by the largest displacement, so that nothing overflows.
    let reach = points().flat_map(|p| [0, 1, 2].map(|k| (p[k] - first[k]).abs())).fold(0.0, f64::max);
    if reach == 0.0 || !reach.is_finite() {
        return FittedAxis { axis: [0.0, 0.0, 1.0], share: 0.0 };
    }
    let (mut count, mut sum, mut products) = (0.0, [0.0; 3], [[0.0; 3]; 3]);
    for point in points() {
        let d = [0, 1, 2].map(|k| (point[k] - first[k]) / reach);
        count += 1.0;
        for i in 0..3 {
            sum[i] += d[i];
            for j in 0..3 {
                products[i][j] += d[i] * d[j];
            }
        }
    }
    let covariance =
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| products[i][j] / count - sum[i] / count * (sum[j] / count)));
    let trace = covariance[0][0] + covariance[1][1] + covariance[2][2];
    // The column of the largest variance is not orthogonal to the principal axis.
    let start = (0..3).max_by(|a, b| covariance[*a][*a].total_cmp(&covariance[*b][*b])).unwrap_or(2);
    let mut axis = normalised(covariance[start]);
    let mut variance = 0.0;
    for _ in 0..ITERATIONS {
        let next = [0, 1, 2].map(|i| (0..3).map(|j| covariance[i][j] * axis[j]).sum::<f64>());
        variance = next.iter().map(|c| c * c).sum::<f64>().sqrt();
        axis = normalised(next);
    }
    let along = |p: [f64; 3]| (0..3).map(|k| (p[k] - first[k]) / reach * axis[k]).sum::<f64>();
    let farthest = points().map(along).fold(0.0, |most: f64, s| if s.abs() > most.abs() { s } else { most });
    if farthest < 0.0 {
        axis = axis.map(|c| -c);
    }
    FittedAxis {
        axis: axis.map(|c| if c == 0.0 { 0.0 } else { c }),
        share: if trace > 0.0 { variance / trace } else { 0.0 },
    }
}

fn normalised(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}

/// The components along an axis of any length.
pub(crate) fn project([x, y, z]: [&Vec<f64>; 3], axis: [f64; 3]) -> Vec<f64> {
    let [a, b, c] = normalised(axis);
    x.iter().zip(y).zip(z).map(|((x, y), z)| a * x + b * y + c * z).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_line_points_to_its_far_end() {
        let s: Vec<f64> = (0..500).map(|k| 0.08 * (f64::from(k) / 200.0).sin()).collect();
        let [x, y, z] = [0.0, -0.6, 0.8].map(|c| {
            s.iter()
                .enumerate()
                .map(|(k, s)| 0.3 + c * s + 1e-6 * f64::from(k as u32 % 3))
                .collect::<Vec<f64>>()
        });
        let fitted = fit_axis(&[x.clone(), y.clone(), z.clone()]);
        assert!(
            fitted.share > 0.999
                && (fitted.axis[1] + 0.6).abs() < 1e-3
                && (fitted.axis[2] - 0.8).abs() < 1e-3,
            "{fitted:?}"
        );
        let along = project([&x, &y, &z], fitted.axis);
        assert!((along[499] - along[0] - s[499]).abs() < 1e-5);
    }

    #[test]
    fn points_at_rest_and_without_values_have_an_axis() {
        let rest = fit_axis(&[vec![1.0; 5], vec![f64::NAN; 5], vec![2.0; 5]]);
        assert_eq!(rest.share, 0.0);
        assert_eq!(fit_axis(&[vec![1.0; 5], vec![2.0; 5], vec![2.0; 5]]).axis, [0.0, 0.0, 1.0]);
    }
}
