//! Singular values of the tip Jacobian: distance from singular poses.

use crate::arm_posture::Posture;
use nalgebra::SVector;

/// Singular values of the tip Jacobian, metres and radians weighing the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularValues {
    /// From the largest to the smallest; for an arm of fewer than six joints the last ones are zero.
    pub sorted: [f64; 6],
    rank: usize,
}

impl SingularValues {
    /// The smallest of six, or of as many as there are joints.
    pub fn smallest(&self) -> f64 {
        self.sorted[self.rank - 1]
    }
}

impl<const N: usize> Posture<'_, N> {
    /// Singular values by one-sided Jacobi rotations (Hestenes 1958): accurate for small ones, and free of
    /// allocation.
    pub fn singular_values(&self) -> SingularValues {
        let j = self.jacobian();
        let mut columns: [SVector<f64, N>; 6] = std::array::from_fn(|k| j.row(k).transpose());
        for _ in 0..30 {
            let mut largest_cosine = 0.0_f64;
            for a in 0..5 {
                for b in a + 1..6 {
                    let (aa, bb, ab) =
                        (columns[a].norm_squared(), columns[b].norm_squared(), columns[a].dot(&columns[b]));
                    if ab == 0.0 {
                        continue;
                    }
                    largest_cosine = largest_cosine.max(ab.abs() / libm::sqrt(aa * bb));
                    let zeta = (bb - aa) / (2.0 * ab);
                    let t = 1.0_f64.copysign(zeta) / (zeta.abs() + libm::sqrt(1.0 + zeta * zeta));
                    let c = 1.0 / libm::sqrt(1.0 + t * t);
                    let s = c * t;
                    let (old_a, old_b) = (columns[a], columns[b]);
                    columns[a] = old_a * c - old_b * s;
                    columns[b] = old_a * s + old_b * c;
                }
            }
            if largest_cosine < 1e-15 {
                break;
            }
        }
        let mut sorted = columns.map(|column| column.norm());
        sorted.sort_by(|a, b| b.total_cmp(a));
        SingularValues { sorted, rank: N.clamp(1, 6) }
    }
}
