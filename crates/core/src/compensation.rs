//! The friction of traversed layers: what is subtracted from the measured force.

use crate::sample::LayerEstimate;

/// How many layers the core keeps apart while retracting. Beyond, layers are still compensated
/// while advancing, but merge into the last one kept.
pub const MAX_LAYERS: usize = 16;

/// Estimates of the traversed layers and their cumulative friction `D`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Compensation {
    layers: [LayerEstimate; MAX_LAYERS],
    count: usize,
    cumulative_ns_per_m: f64,
    end_m: f64,
}

impl Default for Compensation {
    fn default() -> Self {
        Self {
            layers: [LayerEstimate::default(); MAX_LAYERS],
            count: 0,
            cumulative_ns_per_m: 0.0,
            end_m: f64::NEG_INFINITY,
        }
    }
}

impl Compensation {
    #[inline]
    pub(crate) fn cumulative_ns_per_m(&self) -> f64 {
        self.cumulative_ns_per_m
    }

    pub(crate) fn add(&mut self, layer: LayerEstimate) {
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

    /// Friction of the compensated layers with the tip at `z_m`: all of it beyond their end, the part
    /// that is around the shaft before, as on the way back or when going in again.
    #[inline]
    pub(crate) fn around_shaft_ns_per_m(&self, z_m: f64) -> f64 {
        if z_m >= self.end_m { self.cumulative_ns_per_m } else { self.along_shaft_ns_per_m(z_m) }
    }

    /// `sum b_i l_i(z)`: the part of the compensated layers that is still around the shaft, with
    /// each layer's friction spread evenly over its thickness.
    #[cold]
    #[inline(never)]
    fn along_shaft_ns_per_m(&self, z_m: f64) -> f64 {
        self.layers[..self.count]
            .iter()
            .map(|layer| {
                let inside = (z_m - layer.start_m).clamp(0.0, layer.thickness_m);
                if layer.thickness_m > 0.0 {
                    layer.added_friction_ns_per_m * inside / layer.thickness_m
                } else {
                    0.0
                }
            })
            .sum()
    }
}
