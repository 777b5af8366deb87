use super::{DayParameters, EffectTerm, Model, RecordingParameters};
use crate::motion::MotionPiece;
use stylet_tissue::{ChainStage, Effect, ForceLaw, MeasurementChain};

/// A model ready to be replayed over one recording.
pub struct CompiledModel {
    /// The tissue model.
    pub law: ForceLaw,
    /// The measurement chain.
    pub chain: MeasurementChain,
    /// Whether the measurement chain changes the force.
    pub has_measurement_chain: bool,
    /// True position over recorded position.
    pub true_over_recorded: f64,
    /// Delay of the force in s.
    pub delay_s: f64,
    /// Whether velocity jumps are low-pass filtered before sampling, by a lagging sensor or a compliant needle.
    pub smears_jumps: bool,
    /// As in [`Model::jump_delay_s`].
    pub jump_delay_s: Option<f64>,
    /// Positions (m) at which the force may jump: interfaces if an effect acts at the tip, and break depths of effects.
    pub break_positions_m: Vec<f64>,
    /// Puncture force of every layer in N; infinite for a layer that ruptures only at its far interface.
    pub puncture_n: Vec<f64>,
    /// Stiffness of every layer in N/m.
    pub stiffness_n_per_m: Vec<f64>,
}

impl CompiledModel {
    /// True position (m) and velocity (m/s) at a time of a piece.
    pub(crate) fn true_motion(&self, piece: &MotionPiece, at_s: f64) -> (f64, f64) {
        let (z, v) = piece.at(at_s);
        (z * self.true_over_recorded, v * self.true_over_recorded)
    }
}

impl Model {
    /// Tissue model and measurement chain of a recording; `None` when the parameter values are invalid.
    #[must_use]
    pub fn compile(&self, recording: usize) -> Option<CompiledModel> {
        let mut effects = self.assumed.known_effects.clone();
        let parameters = self.per_recording.get(recording).copied().unwrap_or_default();
        let day = self.day_parameters(recording);
        for term in &self.effects {
            effects.push(term.effect()?);
        }
        if self.free.recording_effects {
            let given = self.assumed.known_effects.len();
            for ((effect, parameter), deviation) in self.varying_parameters().zip(parameters.varying) {
                let mut term = self.effects[effect].clone();
                term.values[parameter] += deviation;
                effects[given + effect] = term.effect()?;
            }
        }
        let law = if parameters == RecordingParameters::default() && day == DayParameters::default() {
            ForceLaw::new(&self.tissue, &effects).ok()?
        } else {
            let mut tissue = self.tissue.clone();
            tissue.surface_m += parameters.surface_m + day.surface_m;
            let factor = libm::exp(parameters.ln_friction + day.ln_friction);
            effects.iter_mut().for_each(|e| e.scale_friction(factor));
            tissue.layers.iter_mut().for_each(|l| l.friction_ns_per_m2 *= factor);
            ForceLaw::new(&tissue, &effects).ok()?
        };
        let chain = MeasurementChain::new(&effects);
        let surface = law.slabs().first().map_or(0.0, |s| s.front_m);
        Some(CompiledModel {
            true_over_recorded: chain.true_position(1.0),
            delay_s: chain.delay_s(),
            smears_jumps: chain.has_lag() || law.has_compliant_needle(),
            jump_delay_s: self.jump_delay_s,
            has_measurement_chain: !chain.is_plain(),
            break_positions_m: {
                let mut places: Vec<f64> =
                    effects.iter().filter_map(Effect::membrane_depth_m).map(|d| surface + d).collect();
                if effects.iter().any(|e| e.stage() == ChainStage::Tip && !e.is_inactive()) {
                    places.extend(law.slabs().iter().map(stylet_tissue::Slab::far_m));
                }
                places
            },
            puncture_n: law.slabs().iter().map(|s| s.puncture_n).collect(),
            stiffness_n_per_m: law.slabs().iter().map(|s| s.stiffness_n_per_m).collect(),
            law,
            chain,
        })
    }

    /// Whether an effect acts on the friction along the shaft.
    pub(crate) fn has_friction_effects(&self) -> bool {
        self.effects
            .iter()
            .filter_map(EffectTerm::effect)
            .chain(self.assumed.known_effects.iter().cloned())
            .any(|e| e.stage() == ChainStage::Friction)
    }
}
