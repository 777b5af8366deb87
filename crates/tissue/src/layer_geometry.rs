//! A layer as the law sees it: faces instead of thicknesses, no names.

use crate::layer::Tissue;
use alloc::vec::Vec;

/// A layer placed in space. Infinite puncture force means: only the far face ruptures it.
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
    /// How far in metres the tip may push the layer beyond its far face before that ruptures it.
    pub reach_m: f64,
    /// Stiffening of this layer alone in 1/m: `K_i kappa_i x^2` is added to its elastic force.
    pub kappa_per_m: f64,
    /// Share of the friction that effects have taken over from `b_i l_i v`, 0 to 1.
    pub replaced_friction_share: f64,
    /// Curvature of this layer alone in N/m²: `b_i x^2` is added to its elastic force.
    pub curvature_n_per_m2: f64,
    /// Compliance in m/N of the ground that the layer presses into.
    pub foundation_compliance_m_per_n: f64,
    /// Where the layer lets go of the shaft on the way back, in metres beyond its front face.
    pub release_m: f64,
}

impl Slab {
    /// Whether effects have left the layer as the base law has it.
    #[must_use]
    pub(crate) fn is_plain(&self) -> bool {
        self.reach_m == 0.0
            && !self.is_curved()
            && self.foundation_compliance_m_per_n == 0.0
            && self.release_m == 0.0
    }

    /// Whether the layer's own spring is curved.
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

    /// Position of the tip in metres at which the layer gives way whatever its force: the far face,
    /// and as much beyond as the layer can be pushed.
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
        // Written so that it compiles to a maximum and a minimum, without branches.
        let inside = if depth > 0.0 { depth } else { 0.0 };
        if inside < self.thickness_m { inside } else { self.thickness_m }
    }

    /// How far in metres the layer itself is indented when the tip is `x_m` beyond its front face: less than that when
    /// its ground gives.
    #[must_use]
    #[inline]
    pub fn indentation_m(&self, x_m: f64) -> f64 {
        let c = self.foundation_compliance_m_per_n;
        if c == 0.0 {
            return x_m;
        }
        let slope = 1.0 + c * self.stiffness_n_per_m;
        let curve = c * (self.curvature_n_per_m2 + self.stiffness_n_per_m * self.kappa_per_m);
        // c b x'^2 + (1 + c K) x' = x, written so that it holds for b = 0.
        2.0 * x_m / (slope + libm::sqrt((slope * slope + 4.0 * curve * x_m).max(0.0)))
    }

    /// Length of needle in metres that rubs against the layer once it has ruptured: nothing beyond where it lets go on the way back.
    #[must_use]
    #[inline]
    pub fn contact_length_m(&self, z_m: f64, v_mps: f64) -> f64 {
        if v_mps < 0.0 && z_m < self.front_m + self.release_m { 0.0 } else { self.length_inside_m(z_m) }
    }

    /// Places the layers of a tissue in space.
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
    fn a_layer_is_plain_until_an_effect_gives_it_something_of_its_own() {
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
    fn a_layer_gives_way_as_far_behind_its_far_face_as_it_can_be_pushed() {
        let slab = Slab { reach_m: 0.005, ..PLAIN };
        assert!((slab.far_m() - 0.03).abs() < 1e-17 && (slab.rupture_position_m() - 0.035).abs() < 1e-17);
    }

    #[test]
    fn the_length_inside_a_layer_ends_at_its_faces() {
        for (z, inside) in [(-1.0, 0.0), (0.01, 0.0), (0.012, 0.002), (0.03, 0.02), (0.5, 0.02)] {
            assert!((PLAIN.length_inside_m(z) - inside).abs() < 1e-17, "{z}");
        }
    }

    #[test]
    fn a_shaft_rubs_on_the_way_back_until_the_layer_lets_go() {
        let slab = Slab { release_m: 0.004, ..PLAIN };
        // Just inside, on the way in, at rest, out; on the place where it lets go it still rubs.
        for (z, v, rubs) in [
            (0.013, 0.002, 0.003),
            (0.013, 0.0, 0.003),
            (0.013, -0.002, 0.0),
            (0.010 + 0.004, -0.002, 0.004),
            (0.025, -0.002, 0.015),
        ] {
            assert!(
                (slab.contact_length_m(z, v) - rubs).abs() < 1e-17,
                "{z} {v}: {}",
                slab.contact_length_m(z, v)
            );
        }
    }

    #[test]
    fn a_layer_on_ground_that_gives_is_indented_by_what_the_ground_leaves() {
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
                    // The layer's own force, K x' (1 + kappa x') + b x'^2, pushes the ground by the rest of the way.
                    let own = slab.indentation_m(x);
                    let force = 50.0 * own * (1.0 + kappa_per_m * own) + curvature_n_per_m2 * own * own;
                    assert!((own + ground_m_per_n * force - x).abs() < 1e-15, "{slab:?} {x}: {own}");
                    assert!((0.0..=x).contains(&own));
                }
            }
        }
    }
}
