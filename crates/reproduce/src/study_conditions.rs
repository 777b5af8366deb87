//! Conditions under which a claim evaluates the study.

use crate::algorithm_variant::{Ablation, Sensor, Setup, Variant};
use crate::all_runs::{NOISE_MN, RecordingKey, RunKey, Study};
use crate::assumed_value_changes::{AssumedValue, Change};
use crate::paper_experiments::Case;
use crate::run_outcome::{Offline, Outcome};

/// Number of seeds for a halved or doubled assumed value.
pub const CHANGED_SEEDS: u64 = 12;
/// The same for experiments on the arm.
pub const CHANGED_SEEDS_ARM: u64 = 2;
/// Number of seeds for sensitivity conditions that need separate simulations of the arm.
pub const SENSITIVITY_SEEDS_ARM: u64 = 4;

/// The study under one condition: changed value, noise, prior knowledge of the algorithm, number of seeds.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The study.
    pub study: &'a Study,
    /// Assumed value that is halved or doubled.
    pub change: Option<Change>,
    /// Noise of the force/torque sensor in mN.
    pub noise_mn: u32,
    /// Prior knowledge of the algorithm.
    pub setup: Setup,
    /// Seeds.
    pub seeds: u64,
}

impl<'a> View<'a> {
    /// The paper's own protocol over all seeds: the primary condition.
    #[must_use]
    pub const fn primary(study: &'a Study) -> Self {
        Self { study, change: None, noise_mn: NOISE_MN, setup: Setup::Tuned, seeds: study.seeds }
    }

    /// Another setup.
    #[must_use]
    pub const fn setup(self, setup: Setup) -> Self {
        Self { setup, ..self }
    }

    /// Another noise.
    #[must_use]
    pub const fn noise(self, noise_mn: u32) -> Self {
        Self { noise_mn, ..self }
    }

    /// Fewer seeds.
    #[must_use]
    pub fn fewer(self, seeds: u64) -> Self {
        Self { seeds: self.seeds.min(seeds), ..self }
    }

    /// An assumed value halved or doubled, on fewer seeds.
    #[must_use]
    pub fn changed(self, change: Change, with_arm: bool) -> Self {
        let fewer = self.fewer(if with_arm { CHANGED_SEEDS_ARM } else { CHANGED_SEEDS });
        if change.value == AssumedValue::Noise {
            let noise_mn = if change.doubled { 2 * NOISE_MN } else { NOISE_MN / 2 };
            return Self { noise_mn, ..fewer };
        }
        Self { change: Some(change), ..fewer }
    }

    /// The recording of an experiment under this condition.
    #[must_use]
    pub fn recording_key(&self, case: Case) -> RecordingKey {
        RecordingKey { case, change: self.change.filter(|c| c.value.enters(case)), noise_mn: self.noise_mn }
    }

    /// The outcomes by seed.
    #[must_use]
    pub fn runs(&self, case: Case, sensor: Sensor, kelvin_voigt: bool, ablation: Ablation) -> &'a [Outcome] {
        let mut recording_key = self.recording_key(case);
        if sensor == Sensor::Virtual {
            // The force/torque sensor's noise does not reach the virtual one.
            recording_key.noise_mn = NOISE_MN;
        }
        let setup = match self.change {
            Some(Change { value: AssumedValue::VirtualSigma, doubled })
                if sensor == Sensor::Virtual && self.setup == Setup::Tuned =>
            {
                if doubled {
                    Setup::SigmaDoubled
                } else {
                    Setup::SigmaHalved
                }
            }
            _ => self.setup,
        };
        let variant = Variant { kelvin_voigt, setup, ablation };
        self.study.runs(RunKey { recording_key, sensor, variant }, self.seeds)
    }

    /// Multi-layer model, force/torque sensor.
    #[must_use]
    pub fn ml(&self, case: Case) -> &'a [Outcome] {
        self.runs(case, Sensor::ForceTorque, false, Ablation::None)
    }

    /// Kelvin-Voigt model, force/torque sensor.
    #[must_use]
    pub fn kv(&self, case: Case) -> &'a [Outcome] {
        self.runs(case, Sensor::ForceTorque, true, Ablation::None)
    }

    /// Multi-layer model, force/torque sensor, something left out.
    #[must_use]
    pub fn without(&self, case: Case, ablation: Ablation) -> &'a [Outcome] {
        self.runs(case, Sensor::ForceTorque, false, ablation)
    }

    /// The offline estimates by seed.
    #[must_use]
    pub fn offline(&self, case: Case) -> &'a [Offline] {
        self.study.offline(self.recording_key(case), self.seeds)
    }
}
