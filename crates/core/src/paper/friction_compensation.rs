//! Friction of traversed layers, subtracted from the measured force.

use crate::bounds::{at_least, at_most};
use crate::sample::{LayerEstimate, MAX_LAYERS};

/// Estimates of the traversed layers and their cumulative friction `D`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrictionCompensation {
    layers: [LayerEstimate; MAX_LAYERS],
    count: usize,
    cumulative_ns_per_m: f64,
    end_m: f64,
}

impl Default for FrictionCompensation {
    fn default() -> Self {
        Self {
            layers: [LayerEstimate::default(); MAX_LAYERS],
            count: 0,
            cumulative_ns_per_m: 0.0,
            end_m: f64::NEG_INFINITY,
        }
    }
}

impl FrictionCompensation {
    #[inline]
    pub(crate) fn cumulative_ns_per_m(&self) -> f64 {
        self.cumulative_ns_per_m
    }

    pub(crate) fn add_layer(&mut self, layer: LayerEstimate) {
        self.end_m = self.end_m.max(layer.start_m + layer.thickness_m);
        self.cumulative_ns_per_m = (self.cumulative_ns_per_m + layer.added_friction_ns_per_m).max(0.0);
        if let Some(slot) = self.layers.get_mut(self.count) {
            *slot = layer;
            self.count += 1;
        } else if let Some(last) = self.layers.last_mut() {
            last.thickness_m = layer.start_m + layer.thickness_m - last.start_m;
            last.added_friction_ns_per_m += layer.added_friction_ns_per_m;
        }
    }

    /// Friction of the compensated layers with the tip at `z_m`: all of it beyond their end, the part around the shaft
    /// before, as during retraction or re-insertion.
    #[inline]
    pub(crate) fn friction_at_ns_per_m(&self, z_m: f64) -> f64 {
        if z_m >= self.end_m { self.cumulative_ns_per_m } else { self.partial_ns_per_m(z_m) }
    }

    /// `sum b_i l_i(z)`: friction of the layer parts around the shaft, spread evenly over each layer's thickness.
    #[cold]
    #[inline(never)]
    fn partial_ns_per_m(&self, z_m: f64) -> f64 {
        self.layers[..self.count]
            .iter()
            .map(|layer| {
                if layer.thickness_m > 0.0 {
                    let inside = at_least(0.0, at_most(layer.thickness_m, z_m - layer.start_m));
                    layer.added_friction_ns_per_m * inside / layer.thickness_m
                } else {
                    0.0
                }
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(start_m: f64, thickness_m: f64, added_friction_ns_per_m: f64) -> LayerEstimate {
        LayerEstimate { start_m, thickness_m, added_friction_ns_per_m, ..LayerEstimate::default() }
    }

    #[test]
    fn friction_is_uniform_over_each_layer_and_complete_beyond_all_layers() {
        let mut compensation = FrictionCompensation::default();
        assert_eq!(compensation.friction_at_ns_per_m(0.05), 0.0);
        compensation.add_layer(layer(0.0, 0.02, 100.0));
        compensation.add_layer(layer(0.02, 0.01, 300.0));
        assert_eq!(compensation.cumulative_ns_per_m(), 400.0);
        for (z, expected) in
            [(-0.01, 0.0), (0.005, 25.0), (0.02, 100.0), (0.0275, 325.0), (0.03, 400.0), (0.1, 400.0)]
        {
            assert!((compensation.friction_at_ns_per_m(z) - expected).abs() < 1e-9, "at {z} m");
        }
    }

    #[test]
    fn layers_beyond_the_maximum_merge_into_the_last() {
        let mut compensation = FrictionCompensation::default();
        for i in 0..MAX_LAYERS + 4 {
            compensation.add_layer(layer(0.01 * i as f64, 0.01, 10.0));
        }
        let whole = 10.0 * (MAX_LAYERS + 4) as f64;
        assert_eq!(compensation.cumulative_ns_per_m(), whole);
        let end_m = 0.01 * (MAX_LAYERS + 4) as f64;
        assert!((compensation.friction_at_ns_per_m(end_m) - whole).abs() < 1e-9);
        // The last five are merged: 50 mm with 50 N s/m.
        let merged_m = 0.01 * (MAX_LAYERS - 1) as f64;
        let found = compensation.friction_at_ns_per_m(merged_m + 0.02);
        assert!((found - (10.0 * (MAX_LAYERS - 1) as f64 + 20.0)).abs() < 1e-9, "{found}");
    }

    #[test]
    fn negative_friction_counts_as_zero_and_a_layer_without_thickness_acts_beyond_it() {
        let mut compensation = FrictionCompensation::default();
        compensation.add_layer(layer(0.0, 0.01, -5.0));
        assert_eq!(compensation.cumulative_ns_per_m(), 0.0);
        let mut compensation = FrictionCompensation::default();
        compensation.add_layer(layer(0.01, 0.0, 7.0));
        assert_eq!(compensation.friction_at_ns_per_m(0.005), 0.0);
        assert_eq!(compensation.friction_at_ns_per_m(0.01), 7.0);
    }
}
