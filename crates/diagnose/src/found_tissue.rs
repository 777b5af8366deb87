//! Layers of a tissue from the recordings alone, found by the online algorithm; the input when there is no scenario.

use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_score::{FoundLayer, Trace, found_layers};
use stylet_stats::median_of;
use stylet_stats::parallel::*;
use stylet_tissue::{Layer, Tissue};

/// Smallest thickness of a layer in m.
pub(crate) const MIN_THICKNESS_M: f64 = 5e-4;

/// Layers that the online algorithm found in several recordings: medians over those with the same number of layers.
pub(crate) struct FoundTissue {
    /// Position of the surface in m.
    pub surface_m: f64,
    /// The layers.
    pub layers: Vec<MedianLayer>,
}

/// Median of a layer over the recordings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MedianLayer {
    /// Stiffness in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction in N s/m².
    pub friction_ns_per_m2: f64,
    /// Thickness in m; without a rupture, the reached part of it.
    pub thickness_m: f64,
    /// Elastic force in N at the rupture; `None` without a rupture.
    pub rupture_n: Option<f64>,
}

impl FoundTissue {
    /// Tissue with the most frequent number of layers, or with `count` layers if a recording shows at least as many. `None` without a
    /// contact, or if the recordings begin in tissue.
    pub(crate) fn new(recordings: &[Recording], count: Option<usize>) -> Option<Self> {
        let config = EnhanceConfig::default();
        let layers = |r: &Recording| {
            let trace = Trace::run_measured(r, &r.force_n, &config, 0.0, None::<fn(&Sample, usize) -> f64>);
            if trace.contact.is_loaded_unexpectedly() {
                return None;
            }
            found_layers(&trace, r).filter(|found| !found.is_empty())
        };
        let all: Vec<Vec<FoundLayer>> = recordings.par_iter().filter_map(layers).collect();
        let all: Vec<Vec<FoundLayer>> = match count {
            Some(count) if all.iter().any(|found| found.len() >= count) => {
                all.into_iter().map(|found| with_at_most(count, found)).collect()
            }
            _ => all,
        };
        let has = |n: &usize| all.iter().any(|found| found.len() == *n);
        let count = count.filter(has).or_else(|| most_frequent(all.iter().map(Vec::len)))?;
        let chosen: Vec<&Vec<FoundLayer>> = all.iter().filter(|found| found.len() == count).collect();
        let surface_m = median_of(chosen.iter().map(|found| found[0].front_m));
        let layer = |k: usize| {
            let median =
                |value: fn(&FoundLayer) -> f64| median_of(chosen.iter().map(|found| value(&found[k])));
            let ruptures: Vec<f64> = chosen.iter().filter_map(|found| found[k].rupture_force_n()).collect();
            MedianLayer {
                stiffness_n_per_m: median(|l| l.stiffness_n_per_m),
                friction_ns_per_m2: median(|l| l.friction_ns_per_m2),
                thickness_m: median(|l| l.thickness_m).max(MIN_THICKNESS_M),
                rupture_n: (!ruptures.is_empty()).then(|| median_of(ruptures)),
            }
        };
        Some(Self { surface_m, layers: (0..count).map(layer).collect() })
    }

    /// The found layers in place of assumed ones. The thickness found for a layer that did not rupture is only a lower bound.
    pub(crate) fn layers_for(&self, assumed: &[Layer]) -> Vec<Layer> {
        let layer = |(l, assumed): (&MedianLayer, &Layer)| Layer {
            stiffness_n_per_m: l.stiffness_n_per_m,
            friction_ns_per_m2: l.friction_ns_per_m2,
            thickness_m: if l.rupture_n.is_some() {
                l.thickness_m
            } else {
                assumed.thickness_m.max(l.thickness_m)
            },
            puncture_n: l.rupture_n.or(assumed.puncture_n),
            ..assumed.clone()
        };
        self.layers.iter().zip(assumed).map(layer).collect()
    }

    /// The tissue for a scenario. The last layer continues below the deepest point.
    pub(crate) fn tissue(&self) -> Tissue {
        /// Thickness of the last layer below the deepest point, as a share of the reached part.
        const BEYOND_SHARE: f64 = 0.2;
        let layer = |(k, l): (usize, &MedianLayer)| Layer {
            name: format!("layer {}", k + 1),
            thickness_m: if l.rupture_n.is_some() {
                l.thickness_m
            } else {
                (1.0 + BEYOND_SHARE) * l.thickness_m
            },
            stiffness_n_per_m: l.stiffness_n_per_m.max(1e-9),
            friction_ns_per_m2: l.friction_ns_per_m2.max(1e-9),
            puncture_n: l.rupture_n.filter(|force_n| *force_n > 0.0),
        };
        Tissue { surface_m: self.surface_m, layers: self.layers.iter().enumerate().map(layer).collect() }
    }
}

/// The first `count` layers; the last of them continues to the deepest position.
fn with_at_most(count: usize, mut found: Vec<FoundLayer>) -> Vec<FoundLayer> {
    if found.len() > count {
        let beyond_m: f64 = found.drain(count..).map(|l| l.thickness_m).sum();
        if let Some(last) = found.last_mut() {
            last.thickness_m += beyond_m;
            last.rupture_m = None;
        }
    }
    found
}

/// The most frequent value, the largest of several.
fn most_frequent(values: impl Iterator<Item = usize>) -> Option<usize> {
    let values: Vec<usize> = values.collect();
    values.iter().copied().max_by_key(|v| (values.iter().filter(|x| *x == v).count(), *v))
}
