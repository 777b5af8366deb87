//! A scenario, simulated once: its sensor readings, and traces of the online algorithm on them.

use crate::algorithm_variant::{Sensor, Variant};
use crate::tuned_thresholds::Tuning;
use stylet_core::Sample;
use stylet_scenario::Scenario;
use stylet_score::{LayerTruth, Trace, score_run};
use stylet_testbed::{ForceSensor, InsertionSample, SimulateError, Simulation, simulate};
use stylet_tissue::TissueForce;

/// A simulated scenario with its layers.
#[derive(Clone, Debug)]
pub struct Insertion {
    /// The scenario.
    pub scenario: Scenario,
    /// Recording and truth.
    pub simulation: Simulation,
    /// The true layers.
    pub layers: Vec<LayerTruth>,
}

impl Insertion {
    /// Simulates a scenario with the noise of a seed.
    ///
    /// # Errors
    /// [`SimulateError`] when it cannot be simulated.
    pub fn of(scenario: &Scenario, seed: u64) -> Result<Self, SimulateError> {
        let simulation = simulate(scenario, seed)?;
        let layers = simulation
            .slabs
            .iter()
            .map(|s| LayerTruth {
                front_m: s.front_m,
                thickness_m: s.thickness_m,
                stiffness_n_per_m: s.stiffness_n_per_m,
                friction_ns_per_m2: s.friction_ns_per_m2,
            })
            .collect();
        Ok(Self { scenario: scenario.clone(), simulation, layers })
    }

    /// Force in N that the force/torque sensor reads with the noise of another seed, white noise of `noise_mn` in mN. The noise does not
    /// affect the motion, so the insertion need not be simulated again.
    #[must_use]
    pub fn reading(&self, seed: u64, noise_mn: u32) -> Vec<f64> {
        let Some(sensor) = self.scenario.sensor.force_torque() else { return Vec::new() };
        let mut sensor = sensor.clone();
        sensor.noise_n = f64::from(noise_mn) * 1e-3;
        let mut measuring = ForceSensor::new(&self.scenario.effects, &sensor, seed, self.scenario.sample_hz);
        let Simulation { recording, truth, .. } = &self.simulation;
        let samples = recording.samples().zip(&truth.tissue_force_n);
        samples
            .map(|(s, &total_n)| {
                measuring.measure(&InsertionSample {
                    time_s: s.time_s,
                    position_m: s.position_m,
                    velocity_mps: s.velocity_mps,
                    acceleration_mps2: 0.0,
                    force: TissueForce { total_n, ..TissueForce::default() },
                })
            })
            .collect()
    }

    /// The samples of the recording with the given force, as input of the core.
    #[must_use]
    pub fn samples(&self, force_n: &[f64]) -> Vec<Sample> {
        let recording = self.simulation.recording.samples().zip(force_n);
        recording
            .map(|(s, &force_n)| Sample {
                time_s: s.time_s,
                position_m: s.position_m,
                velocity_mps: s.velocity_mps,
                force_n,
            })
            .collect()
    }

    /// Position of the surface in m.
    #[must_use]
    pub fn surface_m(&self) -> f64 {
        self.layers.first().map_or(0.0, |l| l.front_m)
    }

    /// Runs the algorithm and keeps every sample's output, for a figure.
    #[must_use]
    pub fn trace(&self, force_n: &[f64], sensor: Sensor, variant: Variant, tuning: &Tuning) -> Trace {
        let Simulation { recording, truth, .. } = &self.simulation;
        let config = variant.config(&self.scenario, sensor, tuning);
        score_run(recording, force_n, truth, &self.layers, &config).0
    }

    /// Force in N that a sensor recorded.
    #[must_use]
    pub fn force_n(&self, sensor: Sensor) -> &[f64] {
        self.simulation.readings.iter().find(|r| r.sensor == sensor.key()).map_or(&[], |r| &r.force_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper_experiments::Case;

    #[test]
    fn noise_drawn_apart_is_the_noise_of_a_simulation_of_its_own() {
        let scenario = Case::Gel25Constant.scenario().expect("valid");
        let once = Insertion::of(&scenario, 1).expect("a simulation");
        for seed in [1, 7] {
            let whole = simulate(&scenario, seed).expect("a simulation");
            assert_eq!(once.reading(seed, 20), whole.recording.force_n, "seed {seed}");
        }
        assert_ne!(once.reading(1, 20), once.reading(2, 20));
    }
}
