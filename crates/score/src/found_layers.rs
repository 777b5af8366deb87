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

/// The layers from the contact to the deepest position, in order. `None` without a contact. After a restart of the core because of
/// a new clock only what followed counts: layers and contact are found again from there.
///
/// A layer ends at its rupture, or where the next one begins if that is further on: the tip was free between them. A last one without
/// elastic force is the space behind the tissue and is left out.
#[must_use]
pub fn found_layers(trace: &Trace, recording: &Recording) -> Option<Vec<FoundLayer>> {
    let position_m = &recording.position_m;
    let mut front_m = trace.contact_m?;
    let deepest =
        (trace.first_sample..position_m.len()).max_by(|a, b| position_m[*a].total_cmp(&position_m[*b]))?;
    let estimate = |layer: usize| trace.estimates_since_restart().iter().find(|e| e.layer == layer);
    let mut layers = Vec::new();
    let detections = trace.detections_since_restart();
    for (k, detection) in detections.iter().enumerate() {
        let Some(e) = estimate(detection.layer) else { continue };
        let next_m = detections.get(k + 1).and_then(|next| Some(estimate(next.layer)?.start_m));
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
    let until_deepest = trace.first_sample..deepest + 1;
    let last =
        |column: &[f64]| column.get(until_deepest.clone())?.iter().rev().copied().find(|v| v.is_finite());
    let [stiffness, friction] = [&trace.stiffness_n_per_m, &trace.friction].map(|c| last(c).unwrap_or(0.0));
    let thickness_m = position_m[deepest] - front_m;
    let peak_n = recording.force_n.iter().skip(trace.first_sample).copied().fold(0.0, f64::max);
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

#[cfg(test)]
mod tests {
    use super::found_layers;
    use crate::enhancement_trace::Trace;
    use stylet_core::{EnhanceConfig, Sample};
    use stylet_record::Recording;

    /// A clock that is set by an hour: the first insertion was into a tissue twice as stiff and further away.
    #[test]
    fn layers_from_before_a_new_clock_are_not_taken_for_those_after_it() {
        let insertion = |stiffness: f64, surface_m: f64, from_s: f64| {
            (0..3000).map(move |k| {
                let time_s = 0.005 * f64::from(k);
                let position_m = -0.01 + 0.005 * time_s;
                let depth_m = (position_m - surface_m).max(0.0);
                // Half of the force at the rupture stays as friction.
                let force_n =
                    stiffness * if depth_m < 0.02 { depth_m } else { 0.01 + 0.5 * (depth_m - 0.02) };
                let noise_n = 0.01 * (12.9898 * f64::from(k)).sin();
                (from_s + time_s, position_m, force_n + noise_n)
            })
        };
        let recording = |insertions: &[(f64, f64, f64)]| {
            let mut recording = Recording::default();
            for (stiffness, surface_m, from_s) in insertions {
                for (time_s, position_m, force_n) in insertion(*stiffness, *surface_m, *from_s) {
                    recording.time_s.push(time_s);
                    recording.position_m.push(position_m);
                    recording.velocity_mps.push(0.005);
                    recording.force_n.push(force_n);
                }
            }
            recording
        };
        let found = |recording: &Recording| {
            let model = None::<fn(&Sample, usize) -> f64>;
            let trace =
                Trace::run_measured(recording, &recording.force_n, &EnhanceConfig::default(), 0.0, model);
            (trace.restarts, found_layers(&trace, recording))
        };
        let (_, alone) = found(&recording(&[(100.0, 0.0, 4000.0)]));
        let (restarts, after) = found(&recording(&[(200.0, 0.01, 0.0), (100.0, 0.0, 4000.0)]));
        assert_eq!(restarts, 1);
        let (alone, after) = (alone.unwrap_or_default(), after.unwrap_or_default());
        assert_eq!((alone.len(), after.len()), (1, 1), "{after:?}");
        for (a, b) in alone.iter().zip(&after) {
            assert!((a.front_m - b.front_m).abs() < 2e-4, "{a:?} {b:?}");
            assert!((a.stiffness_n_per_m / b.stiffness_n_per_m - 1.0).abs() < 0.02, "{a:?} {b:?}");
        }
    }
}
