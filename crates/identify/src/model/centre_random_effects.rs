//! Random effects of mean zero.

use super::{Model, RecordingParameters};
use stylet_tissue::Effect;

impl Model {
    /// Moves the means of surface and friction over the recordings to the shared parameters. The forces are the same, but what all
    /// recordings have in common is no difference between them, and a fit makes little progress along this valley of the objective.
    pub fn centre_random_effects(&mut self) {
        let count = self.per_recording.len().max(1) as f64;
        let mean =
            |x: &dyn Fn(&RecordingParameters) -> f64| self.per_recording.iter().map(x).sum::<f64>() / count;
        let (surface_m, ln_friction) = (mean(&|p| p.surface_m), mean(&|p| p.ln_friction));
        for own in &mut self.per_recording {
            own.surface_m -= surface_m;
            own.ln_friction -= ln_friction;
        }
        let factor = libm::exp(ln_friction);
        self.tissue.surface_m += surface_m;
        self.tissue.layers.iter_mut().for_each(|layer| layer.friction_ns_per_m2 *= factor);
        for term in &mut self.effects {
            if let Some(mut effect) = term.effect() {
                effect.scale_friction(factor);
                term.values = effect.parameters();
            }
        }
    }
}
