//! Offline estimate: least squares over all samples of a layer (supplement sec. IV), `y = f - D v`, `phi = [dz, dz v]`. At constant
//! velocity the columns are collinear; the split between stiffness and friction is then that of the prior variances, as online,
//! and is reported as not separable.

use nalgebra::{Matrix2, Vector2};

/// Smallest reciprocal condition number of the scaled normal matrix at which the columns are separable.
const MIN_RECIPROCAL_CONDITION: f64 = 1e-4;

/// A sample of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerSample {
    /// Depth below the layer's start, `dz`, in m.
    pub depth_m: f64,
    /// Velocity in m/s.
    pub velocity_mps: f64,
    /// Force less the cumulative friction of the previous layers, `y`, in N.
    pub force_n: f64,
}

/// Stiffness and friction of a layer from all of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OfflineEstimate {
    /// Stiffness `K` in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction `b` in N s/m².
    pub friction_ns_per_m2: f64,
    /// The data alone separate the two.
    pub separable: bool,
}

/// Least squares of the multi-layer model over `samples`. `ratio` is the ratio of the prior standard deviations, friction over
/// stiffness in (m/s)⁻¹, and decides the split where the data do not. `None` with fewer than two samples inside the layer.
#[must_use]
pub fn fit_layer_offline(samples: impl Iterator<Item = LayerSample>, ratio: f64) -> Option<OfflineEstimate> {
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
    let mut count = 0usize;
    for s in samples.filter(|s| s.depth_m > 0.0) {
        // Scaled by the ratio, so that the minimum-norm solution is that of the prior.
        let phi = Vector2::new(s.depth_m, s.depth_m * s.velocity_mps * ratio);
        normal += phi * phi.transpose();
        right += phi * s.force_n;
        count += 1;
    }
    if count < 2 || !normal.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = normal.symmetric_eigen();
    let (small, large) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    if large <= 0.0 {
        return None;
    }
    let separable = small > MIN_RECIPROCAL_CONDITION * large;
    let mut theta = Vector2::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if separable || *value == large {
            theta += vector * (vector.dot(&right) / value);
        }
    }
    Some(OfflineEstimate { stiffness_n_per_m: theta[0], friction_ns_per_m2: theta[1] * ratio, separable })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(velocity: impl Fn(f64) -> f64) -> Vec<LayerSample> {
        (1..1000)
            .map(|i| {
                let depth_m = 3e-5 * f64::from(i);
                let velocity_mps = velocity(depth_m);
                LayerSample { depth_m, velocity_mps, force_n: depth_m * (40.0 + 9000.0 * velocity_mps) }
            })
            .collect()
    }

    #[test]
    fn a_varying_velocity_separates_stiffness_from_friction_for_any_prior() {
        for ratio in [100.0, 1000.0] {
            let data = samples(|z| 0.002 + 0.1 * z);
            let found = fit_layer_offline(data.into_iter(), ratio).expect("enough samples");
            assert!(found.separable);
            assert!((found.stiffness_n_per_m - 40.0).abs() < 1e-6, "{found:?}");
            assert!((found.friction_ns_per_m2 - 9000.0).abs() < 1e-3, "{found:?}");
        }
    }

    #[test]
    fn at_constant_velocity_the_prior_determines_the_split() {
        // Elastic share kappa = 40/(40 + 9000 v), prior ratio sqrt((1 - kappa)/(kappa v²)).
        let v = 0.0023_f64;
        let kappa = 40.0 / (40.0 + 9000.0 * v);
        let ratio: f64 = ((1.0 - kappa) / (kappa * v * v)).sqrt();
        let found = fit_layer_offline(samples(|_| v).into_iter(), ratio).expect("enough samples");
        assert!(!found.separable);
        assert!((found.stiffness_n_per_m - 40.0).abs() < 1e-6, "{found:?}");
        assert!((found.friction_ns_per_m2 - 9000.0).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn a_layer_without_two_samples_inside_it_has_no_estimate() {
        assert!(fit_layer_offline(std::iter::empty(), 1.0).is_none());
        let at = |depth_m| LayerSample { depth_m, velocity_mps: 0.002, force_n: 1.0 };
        assert!(fit_layer_offline([at(-0.01), at(0.0), at(0.01)].into_iter(), 1.0).is_none());
        assert!(fit_layer_offline([at(0.01), at(0.02)].into_iter(), 1.0).is_some());
        // Nor one with infinite values.
        let wild = LayerSample { velocity_mps: f64::INFINITY, ..at(0.01) };
        assert!(fit_layer_offline([at(0.01), at(0.02), wild].into_iter(), 1.0).is_none());
    }

    #[test]
    fn samples_before_the_layer_do_not_count() {
        let inside = samples(|z| 0.002 + 0.1 * z);
        let before = inside.iter().map(|s| LayerSample { depth_m: -s.depth_m, force_n: 7.0, ..*s });
        let found = fit_layer_offline(before.chain(inside.clone()), 1000.0).expect("enough samples");
        assert!((found.stiffness_n_per_m - 40.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn a_nearly_constant_velocity_is_not_separable() {
        // With ratio x v near one the ratio of the eigenvalues is a quarter of the relative variance of v: the limit of 1e-4 lies at
        // velocities that differ by 2 %.
        for (spread, separable) in [(0.03, true), (0.015, false)] {
            let mut sign = 1.0;
            let alternating: Vec<LayerSample> = samples(|_| 0.002)
                .into_iter()
                .map(|s| {
                    sign = -sign;
                    let velocity_mps = 0.002 * (1.0 + sign * spread);
                    LayerSample { velocity_mps, force_n: s.depth_m * (40.0 + 9000.0 * velocity_mps), ..s }
                })
                .collect();
            // Independent of the scale: a layer a thousand times as deep.
            for scale in [1.0, 1000.0] {
                let data = alternating.iter().map(|s| LayerSample { depth_m: s.depth_m * scale, ..*s });
                let found = fit_layer_offline(data, 1.0 / 0.002).expect("enough samples");
                assert_eq!(found.separable, separable, "{spread} {scale}: {found:?}");
            }
        }
    }
}
