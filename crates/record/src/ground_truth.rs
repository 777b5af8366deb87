//! Ground truth of a simulated recording.

use serde::{Deserialize, Serialize};

use crate::error::RecordError;
use crate::recording::{check_finite, check_length};

/// True properties of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayerTruth {
    /// Front face (m).
    pub front_m: f64,
    /// Thickness (m).
    pub thickness_m: f64,
    /// Stiffness (N/m).
    pub stiffness_n_per_m: f64,
    /// Friction (N s/m²).
    pub friction_ns_per_m2: f64,
}

impl LayerTruth {
    /// Length of needle inside the layer (m) with the tip at `z_m`.
    #[must_use]
    pub fn length_inside_m(&self, z_m: f64) -> f64 {
        (z_m - self.front_m).min(self.thickness_m).max(0.0)
    }
}

/// A true rupture in the simulated tissue.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueRupture {
    /// The layer that ruptured, 1-based.
    pub layer: usize,
    /// Time (s), interpolated between samples.
    pub time_s: f64,
    /// Tip position at that time (m).
    pub position_m: f64,
    /// Whether the puncture force was reached; otherwise the tip reached the far face.
    pub by_force: bool,
}

/// Ground truth, one value per sample of the [`crate::Recording`] it belongs to.
///
/// With the base law `f = f_K + f_B`, `f_B = v sum(b_i l_i)`: `tip_force_n` is `f - D v`, the force of tip and active layer,
/// which force enhancement estimates; `D v` is the friction of the ruptured layers.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Tip force (N): tissue force less cumulative friction, `f - D v`.
    pub tip_force_n: Vec<f64>,
    /// Elastic force of the active layer (N), `f_K`.
    pub elastic_n: Vec<f64>,
    /// Friction over all layers (N), `f_B`.
    pub friction_n: Vec<f64>,
    /// Total force of the tissue on the needle (N): elastic, friction and effects, without sensor effects.
    pub tissue_force_n: Vec<f64>,
    /// Cumulative friction `D` of the ruptured layers (N s/m).
    pub cumulative_friction_ns_per_m: Vec<f64>,
    /// Active layer, 1-based; one more than the number of layers after the last rupture.
    pub active_layer: Vec<usize>,
    /// Time of the first contact (s); `None` without contact.
    pub surface_contact_s: Option<f64>,
    /// Ruptures in time order.
    pub ruptures: Vec<TrueRupture>,
}

impl Truth {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.tip_force_n.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.tip_force_n.is_empty()
    }

    /// Checks that the columns are finite and as long as a recording of `samples` samples.
    ///
    /// # Errors
    /// [`RecordError::LengthMismatch`] or [`RecordError::NotFiniteAt`], naming the column.
    pub fn check(&self, samples: usize) -> Result<(), RecordError> {
        check_length("true_active_layer", self.active_layer.len(), samples)?;
        for (name, values) in [
            ("true_tip_force_n", &self.tip_force_n),
            ("true_elastic_n", &self.elastic_n),
            ("true_friction_n", &self.friction_n),
            ("true_tissue_force_n", &self.tissue_force_n),
            ("true_cumulative_friction_ns_per_m", &self.cumulative_friction_ns_per_m),
        ] {
            check_length(name, values.len(), samples)?;
            check_finite(name, values)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layer_without_thickness_holds_no_needle() {
        for thickness_m in [0.0, -0.001, f64::NAN] {
            let layer =
                LayerTruth { front_m: 0.01, thickness_m, stiffness_n_per_m: 1.0, friction_ns_per_m2: 1.0 };
            assert_eq!(layer.length_inside_m(0.005), 0.0);
            assert!(thickness_m.is_nan() || layer.length_inside_m(0.02) == 0.0);
        }
    }

    #[test]
    fn ground_truth_of_another_length_than_the_recording_is_refused() {
        let truth = Truth { active_layer: vec![1; 3], tip_force_n: vec![0.0; 2], ..Truth::default() };
        let message = truth.check(3).expect_err("two values for three samples").to_string();
        assert!(message.contains("true_tip_force_n has 2 values and the recording 3 samples"), "{message}");
    }
}
