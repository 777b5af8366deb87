//! Custom effects hidden in cases of the independent simulator. Only the library can evaluate their equations, so the force law of these
//! cases is that of the library; tissue, motion, sensor, noise and wrong assumptions are the simulator's.

use std::sync::Arc;
use stylet_examine::CustomEffect;
use stylet_examine::simulator::force_law::{ForceKnot, ForceLaw as SimulatedLaw};
use stylet_examine::simulator::motion_path::MotionState;
use stylet_examine::simulator::tissue::Tissue as SimulatedTissue;
use stylet_tissue::{
    AnyEffect, Effect as _, ForceLaw, ForceLawState, Layer, MeasurementChain, MeasurementState, SensorInput,
    Tissue,
};

/// Largest factor between a hidden shape parameter (a time constant, a length) and its typical value.
const SHAPE_FACTOR: f64 = 1.5;

/// A custom effect that a case can hide.
#[derive(Clone, Debug)]
pub(super) struct HiddenEffect(pub AnyEffect);

impl HiddenEffect {
    /// The effect with each parameter changed by `change(parameter is a strength, distance from its inactive value or from zero)`, within
    /// its allowed range.
    fn changed(&self, mut change: impl FnMut(bool, f64) -> f64) -> Self {
        let info = self.0.info();
        let values: Vec<f64> = info
            .parameters
            .iter()
            .zip(self.0.parameters())
            .map(|(p, value)| {
                let zero = if p.strength { p.inactive } else { 0.0 };
                (zero + change(p.strength, value - zero)).clamp(p.low, p.high)
            })
            .collect();
        Self(info.with_parameters(&values).unwrap_or_else(|| self.0.clone()))
    }
}

impl CustomEffect for HiddenEffect {
    fn id(&self) -> &str {
        self.0.id()
    }

    fn parameters(&self) -> Vec<(String, f64)> {
        let paths = self.0.info().parameters.iter().map(|p| p.path.to_owned());
        paths.zip(self.0.parameters()).collect()
    }

    fn with_random_parameters(&self, uniform: &mut dyn FnMut() -> f64) -> Arc<dyn CustomEffect> {
        Arc::new(self.changed(|is_strength, value| {
            value * if is_strength { 1.0 } else { SHAPE_FACTOR.powf(2.0 * uniform() - 1.0) }
        }))
    }

    fn scaled(&self, factor: f64) -> Arc<dyn CustomEffect> {
        Arc::new(self.changed(|is_strength, value| value * if is_strength { factor } else { 1.0 }))
    }

    fn law(&self, tissue: &SimulatedTissue) -> Box<dyn SimulatedLaw> {
        let layer = |l: &stylet_examine::simulator::tissue::Layer| Layer {
            thickness_m: l.thickness_m,
            stiffness_n_per_m: l.stiffness_n_per_m,
            friction_ns_per_m2: l.friction_ns_per_m2,
            puncture_n: l.puncture_n,
            name: String::new(),
        };
        let tissue =
            Tissue { surface_m: tissue.surface_m, layers: tissue.layers.iter().map(layer).collect() };
        let effects = core::slice::from_ref(&self.0);
        let chain = MeasurementChain::new(effects);
        Box::new(LibraryLaw {
            // One effect is never too many.
            law: ForceLaw::new(&tissue, effects).unwrap_or_else(|_| ForceLaw::base(&tissue)),
            state: ForceLawState::default(),
            sensor: chain.start(0.0),
            chain,
            tip_n: 0.0,
            ruptures_s: Vec::new(),
            released_n: Vec::new(),
        })
    }
}

/// The library's force law along a simulated motion.
struct LibraryLaw {
    law: ForceLaw,
    state: ForceLawState,
    chain: MeasurementChain,
    sensor: MeasurementState,
    tip_n: f64,
    ruptures_s: Vec<f64>,
    released_n: Vec<f64>,
}

impl LibraryLaw {
    fn step(&mut self, at: &MotionState) -> f64 {
        let (ruptures_s, released_n) = (&mut self.ruptures_s, &mut self.released_n);
        let force = self.law.step(&mut self.state, at.t, at.z, at.v, |r| {
            ruptures_s.push(r.time_s);
            released_n.push(r.released_n);
        });
        self.tip_n = force.elastic_n + force.tip_extra_n;
        let reading = SensorInput {
            time_s: at.t,
            position_m: at.z,
            velocity_mps: at.v,
            acceleration_mps2: at.a,
            tissue_n: force.total_n,
            noise_n: 0.0,
        };
        self.chain.step(&mut self.sensor, &reading)
    }
}

impl SimulatedLaw for LibraryLaw {
    fn start(&mut self, at: &MotionState) -> f64 {
        self.step(at)
    }

    fn advance(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        let force_n = self.step(to);
        knots.push(ForceKnot { t: to.t, force_n });
    }

    fn jump(&mut self, to: &MotionState, knots: &mut Vec<ForceKnot>) {
        self.advance(to, knots);
    }

    fn ruptures(&self) -> &[f64] {
        &self.ruptures_s
    }

    fn released_n(&self) -> &[f64] {
        &self.released_n
    }

    fn tip_n(&self) -> f64 {
        self.tip_n
    }
}
