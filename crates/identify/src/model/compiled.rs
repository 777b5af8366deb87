use super::{Choice, Day, Model, Own};
use stylet_tissue::{Effect, Law, Measurement, Place};

/// A model ready to be replayed over one recording.
pub struct Compiled {
    /// The law.
    pub law: Law,
    /// The measuring chain.
    pub chain: Measurement,
    /// Whether the chain changes the force.
    pub measures: bool,
    /// True position over recorded one.
    pub to_true: f64,
    /// Delay in s.
    pub delay_s: f64,
    /// A jump of the speed is smeared before it is sampled.
    pub smears: bool,
    /// As in [`Model::placed_s`].
    pub placed_s: Option<f64>,
    /// Positions (m) at which a force at the tip may jump: faces, and where something of an effect's own breaks.
    pub breaks_m: Vec<f64>,
    /// Own puncture force of every layer in N, infinite when only its far face ruptures it.
    pub puncture_n: Vec<f64>,
    /// Stiffness of every layer in N/m.
    pub stiffness: Vec<f64>,
}

impl Model {
    /// Law and chain for a recording; `None` when the library refuses the values.
    #[must_use]
    pub fn compile(&self, recording: usize) -> Option<Compiled> {
        let mut effects = self.belief.given.clone();
        let own = self.own.get(recording).copied().unwrap_or_default();
        let day = self.day(recording);
        for choice in &self.effects {
            effects.push(choice.effect()?);
        }
        if self.free.own_effects {
            let given = self.belief.given.len();
            for ((effect, parameter), beyond) in self.differing().zip(own.differing) {
                let mut choice = self.effects[effect].clone();
                choice.values[parameter] += beyond;
                effects[given + effect] = choice.effect()?;
            }
        }
        let law = if own == Own::default() && day == Day::default() {
            Law::new(&self.tissue, &effects).ok()?
        } else {
            let mut tissue = self.tissue.clone();
            tissue.surface_m += own.surface_m + day.surface_m;
            let factor = libm::exp(own.friction + day.friction);
            effects.iter_mut().for_each(|e| e.rubbed(factor));
            tissue.layers.iter_mut().for_each(|l| l.friction_ns_per_m2 *= factor);
            Law::new(&tissue, &effects).ok()?
        };
        let chain = Measurement::new(&effects);
        let surface = law.slabs().first().map_or(0.0, |s| s.front_m);
        Some(Compiled {
            to_true: chain.true_position(1.0),
            delay_s: chain.delay_s(),
            smears: chain.smears() || law.bends(),
            placed_s: self.placed_s,
            measures: !chain.is_plain(),
            breaks_m: {
                let mut places: Vec<f64> =
                    effects.iter().filter_map(Effect::break_depth_m).map(|d| surface + d).collect();
                if effects.iter().any(|e| e.place() == Place::Tip && !e.is_neutral()) {
                    places.extend(law.slabs().iter().map(stylet_tissue::Slab::far_m));
                }
                places
            },
            puncture_n: law.slabs().iter().map(|s| s.puncture_n).collect(),
            stiffness: law.slabs().iter().map(|s| s.stiffness_n_per_m).collect(),
            law,
            chain,
        })
    }

    /// Whether some effect acts along the shaft.
    #[must_use]
    pub fn has_friction_effects(&self) -> bool {
        self.effects
            .iter()
            .filter_map(Choice::effect)
            .chain(self.belief.given.iter().cloned())
            .any(|e| e.place() == Place::Friction)
    }
}
