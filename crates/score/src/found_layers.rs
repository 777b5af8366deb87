//! Layers of the tissue as the online algorithm found them in one recording.

use crate::enhancement_trace::Trace;
use stylet_record::Recording;

/// Distance in m from which a rupture before the next layer's front counts as one inside the layer.
const MIN_GAP_M: f64 = 5e-4;

/// Elastic force of the last layer at the deepest point, relative to the largest force, below which the tip has left the tissue.
pub const MIN_FORCE_SHARE: f64 = 0.01;

/// A layer that the online algorithm found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundLayer {
    /// Position of its front in m.
    pub front_m: f64,
    /// Thickness in m; for the last one, the depth that the needle reached in it.
    pub thickness_m: f64,
    /// Stiffness in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction in N s/m².
    pub friction_ns_per_m2: f64,
    /// Position of its rupture in m; `None` for the last one.
    pub rupture_m: Option<f64>,
}

impl FoundLayer {
    /// Elastic force at the rupture in N.
    #[must_use]
    pub fn rupture_force_n(&self) -> Option<f64> {
        self.rupture_m.map(|m| self.stiffness_n_per_m * (m - self.front_m))
    }

    /// Whether it ruptured before its far face.
    #[must_use]
    pub fn is_ruptured_by_force(&self) -> bool {
        self.rupture_m.is_some_and(|m| m < self.front_m + self.thickness_m - 1e-9)
    }
}

/// The layers from the contact to the deepest position, in order. `None` without a contact.
///
/// A layer ends at its rupture, or where the next one begins if that is further on: the tip was free between them. A last one without
/// elastic force is the space behind the tissue and is left out.
#[must_use]
pub fn found_layers(trace: &Trace, recording: &Recording) -> Option<Vec<FoundLayer>> {
    let position_m = &recording.position_m;
    let mut front_m = trace.contact_m?;
    let deepest = (0..position_m.len()).max_by(|a, b| position_m[*a].total_cmp(&position_m[*b]))?;
    let estimate = |layer: usize| trace.estimates.iter().find(|e| e.layer == layer);
    let mut layers = Vec::new();
    for (k, detection) in trace.detections.iter().enumerate() {
        let Some(e) = estimate(detection.layer) else { continue };
        let next_m = trace.detections.get(k + 1).and_then(|next| Some(estimate(next.layer)?.start_m));
        let back_m = next_m.filter(|m| *m > detection.located_m + MIN_GAP_M).unwrap_or(detection.located_m);
        layers.push(FoundLayer {
            front_m,
            thickness_m: back_m - front_m,
            stiffness_n_per_m: e.stiffness_n_per_m,
            friction_ns_per_m2: e.friction,
            rupture_m: Some(detection.located_m),
        });
        front_m = back_m;
    }
    let last = |column: &[f64]| column.iter().take(deepest + 1).rev().copied().find(|v| v.is_finite());
    let [stiffness, friction] = [&trace.stiffness_n_per_m, &trace.friction].map(|c| last(c).unwrap_or(0.0));
    let thickness_m = position_m[deepest] - front_m;
    let peak_n = recording.force_n.iter().copied().fold(0.0, f64::max);
    if stiffness * thickness_m >= MIN_FORCE_SHARE * peak_n {
        layers.push(FoundLayer {
            front_m,
            thickness_m,
            stiffness_n_per_m: stiffness,
            friction_ns_per_m2: friction,
            rupture_m: None,
        });
    }
    Some(layers)
}
