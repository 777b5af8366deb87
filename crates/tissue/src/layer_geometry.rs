//! Layers in space: faces and coefficients as the force law uses them, after geometric effects.

use crate::layer::Tissue;
use alloc::vec::Vec;

/// A layer in space. With an infinite puncture force only its far face ruptures it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Front face `s_i` in metres.
    pub front_m: f64,
    /// Thickness `d_i` in metres.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: f64,
    /// Viscous friction per metre `b_i` in N s/m².
    pub friction_ns_per_m2: f64,
    /// Puncture force `F_i` in N, or infinity.
    pub puncture_n: f64,
    /// Indentation in metres beyond the far face at which the layer ruptures without its puncture force.
    pub reach_m: f64,
    /// Stiffening of this layer alone in 1/m: `K_i kappa_i x^2` is added to its elastic force.
    pub kappa_per_m: f64,
    /// Share of the viscous friction `b_i l_i v` that effects replace, 0 to 1.
    pub replaced_friction_share: f64,
    /// Curvature of this layer alone in N/m²: `b_i x^2` is added to its elastic force.
    pub curvature_n_per_m2: f64,
    /// Compliance in m/N of the foundation under the layer.
    pub foundation_compliance_m_per_n: f64,
    /// Depth in metres beyond the front face at which the layer releases the shaft in retraction.
    pub release_m: f64,
}

impl Slab {
    /// Whether no geometric effect has changed the layer.
    #[must_use]
    pub(crate) fn is_plain(&self) -> bool {
        self.reach_m == 0.0
            && !self.is_curved()
            && self.foundation_compliance_m_per_n == 0.0
            && self.release_m == 0.0
    }

    /// Whether the layer's spring is nonlinear.
    #[must_use]
    #[inline]
    pub(crate) fn is_curved(&self) -> bool {
        self.kappa_per_m != 0.0 || self.curvature_n_per_m2 != 0.0
    }

    /// Far face in metres.
    #[must_use]
    #[inline]
    pub fn far_m(&self) -> f64 {
        self.front_m + self.thickness_m
    }

    /// Tip position in metres at which the layer ruptures without its puncture force.
    #[must_use]
    #[inline]
    pub fn rupture_position_m(&self) -> f64 {
        self.far_m() + self.reach_m
    }

    /// Length of needle inside the layer, `l_i = clamp(z - s_i, 0, d_i)`, in metres.
    #[must_use]
    #[inline]
    pub fn length_inside_m(&self, z_m: f64) -> f64 {
        let depth = z_m - self.front_m;
        // Compiles to a maximum and a minimum, without branches.
        let inside = if depth > 0.0 { depth } else { 0.0 };
        if inside < self.thickness_m { inside } else { self.thickness_m }
    }

    /// Indentation in metres of the layer itself when the tip is `x_m` beyond its front face: less than `x_m` on a
    /// compliant foundation.
    #[must_use]
    #[inline]
    pub fn indentation_m(&self, x_m: f64) -> f64 {
        let c = self.foundation_compliance_m_per_n;
        if c == 0.0 {
            return x_m;
        }
        let slope = 1.0 + c * self.stiffness_n_per_m;
        let curve = c * (self.curvature_n_per_m2 + self.stiffness_n_per_m * self.kappa_per_m);
        // c b x'^2 + (1 + c K) x' = x, in a form that holds for b = 0.
        2.0 * x_m / (slope + libm::sqrt((slope * slope + 4.0 * curve * x_m).max(0.0)))
    }

    /// Length of needle in metres in contact with the layer after its rupture: zero in retraction in front of the release
    /// depth.
    #[must_use]
    #[inline]
    pub fn contact_length_m(&self, z_m: f64, v_mps: f64) -> f64 {
        if v_mps < 0.0 && z_m < self.front_m + self.release_m { 0.0 } else { self.length_inside_m(z_m) }
    }

    /// The layers of a tissue in space.
    #[must_use]
    pub fn stack(tissue: &Tissue) -> Vec<Slab> {
        tissue
            .layers
            .iter()
            .enumerate()
            .map(|(i, layer)| Slab {
                front_m: tissue.front_m(i),
                thickness_m: layer.thickness_m,
                stiffness_n_per_m: layer.stiffness_n_per_m,
                friction_ns_per_m2: layer.friction_ns_per_m2,
                puncture_n: layer.puncture_n.unwrap_or(f64::INFINITY),
                reach_m: 0.0,
                kappa_per_m: 0.0,
                replaced_friction_share: 0.0,
                curvature_n_per_m2: 0.0,
                foundation_compliance_m_per_n: 0.0,
                release_m: 0.0,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 10 to 30 mm, plain.
    const PLAIN: Slab = Slab {
        front_m: 0.01,
        thickness_m: 0.02,
        stiffness_n_per_m: 50.0,
        friction_ns_per_m2: 9000.0,
        puncture_n: f64::INFINITY,
        reach_m: 0.0,
        kappa_per_m: 0.0,
        replaced_friction_share: 0.0,
        curvature_n_per_m2: 0.0,
        foundation_compliance_m_per_n: 0.0,
        release_m: 0.0,
    };

    #[test]
    fn a_layer_is_plain_until_an_effect_changes_it() {
        assert!(PLAIN.is_plain() && !PLAIN.is_curved());
        let stiffening = Slab { kappa_per_m: 3.0, ..PLAIN };
        let curved = Slab { curvature_n_per_m2: 3.0, ..PLAIN };
        assert!(stiffening.is_curved() && curved.is_curved());
        for slab in [
            stiffening,
            curved,
            Slab { reach_m: 0.001, ..PLAIN },
            Slab { foundation_compliance_m_per_n: 0.001, ..PLAIN },
            Slab { release_m: 0.001, ..PLAIN },
        ] {
            assert!(!slab.is_plain(), "{slab:?}");
        }
    }

    #[test]
    fn the_rupture_position_is_the_far_face_plus_the_reach() {
        let slab = Slab { reach_m: 0.005, ..PLAIN };
        assert!((slab.far_m() - 0.03).abs() < 1e-17 && (slab.rupture_position_m() - 0.035).abs() < 1e-17);
    }

    #[test]
    fn the_length_inside_a_layer_is_clamped_to_its_faces() {
        for (z, inside) in [(-1.0, 0.0), (0.01, 0.0), (0.012, 0.002), (0.03, 0.02), (0.5, 0.02)] {
            assert!((PLAIN.length_inside_m(z) - inside).abs() < 1e-17, "{z}");
        }
    }

    #[test]
    fn in_retraction_the_contact_ends_at_the_release_depth() {
        let slab = Slab { release_m: 0.004, ..PLAIN };
        // Advancing, at rest and in retraction; at the release depth itself there is still contact.
        for (z, v, contact_m) in [
            (0.013, 0.002, 0.003),
            (0.013, 0.0, 0.003),
            (0.013, -0.002, 0.0),
            (0.010 + 0.004, -0.002, 0.004),
            (0.025, -0.002, 0.015),
        ] {
            assert!(
                (slab.contact_length_m(z, v) - contact_m).abs() < 1e-17,
                "{z} {v}: {}",
                slab.contact_length_m(z, v)
            );
        }
    }

    #[test]
    fn a_layer_on_a_compliant_foundation_is_in_series_with_it() {
        let plain = Slab { foundation_compliance_m_per_n: 0.0, ..PLAIN };
        assert_eq!(plain.indentation_m(0.007), 0.007);
        for (kappa_per_m, curvature_n_per_m2) in [(0.0, 0.0), (20.0, 0.0), (0.0, 3000.0), (-15.0, 2500.0)] {
            for ground_m_per_n in [0.001, 0.02, 0.2] {
                let slab = Slab {
                    kappa_per_m,
                    curvature_n_per_m2,
                    foundation_compliance_m_per_n: ground_m_per_n,
                    ..PLAIN
                };
                for x in [0.0, 0.003, 0.015] {
                    // The layer's force K x' (1 + kappa x') + b x'^2 compresses the foundation by the rest of the travel.
                    let layer_m = slab.indentation_m(x);
                    let force = 50.0 * layer_m * (1.0 + kappa_per_m * layer_m)
                        + curvature_n_per_m2 * layer_m * layer_m;
                    assert!((layer_m + ground_m_per_n * force - x).abs() < 1e-15, "{slab:?} {x}: {layer_m}");
                    assert!((0.0..=x).contains(&layer_m));
                }
            }
        }
    }
}
