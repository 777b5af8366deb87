//! Assumed values of the phantoms, which the paper does not give, and scenarios in which they are halved or doubled.

use crate::paper_experiments::Case;
use serde::Serialize;
use stylet_scenario::{Motion, Scenario, Sensor};

/// A value that the paper does not give: assumed, or taken from another source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AssumedValue {
    /// Noise of the force/torque sensor.
    Noise,
    /// K of the three single gels.
    GelStiffness,
    /// b of the three single gels.
    GelFriction,
    /// Ratio of b between neighbouring single gels.
    GelContrast,
    /// K of the stack's three layers.
    StackStiffness,
    /// b of the stack's three layers.
    StackFriction,
    /// Puncture force of the latex.
    LatexPuncture,
    /// K of both layers of the liver.
    LiverStiffness,
    /// b of both layers of the liver.
    LiverFriction,
    /// Both puncture forces of the liver.
    LiverPuncture,
    /// Thicknesses of both layers of the liver.
    LiverThickness,
    /// K of the abdomen's three layers.
    AbdomenStiffness,
    /// b of the abdomen's three layers.
    AbdomenFriction,
    /// Travel in air between start and contact.
    TravelInAir,
    /// Duration of the motion after the target is passed.
    TimeBehindTarget,
    /// Noise of the arm's joint torques.
    TorqueNoise,
    /// `s1` for the virtual sensor.
    VirtualSigma,
}

/// A halved or doubled assumed value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Change {
    /// The assumed value.
    pub value: AssumedValue,
    /// Doubled instead of halved.
    pub doubled: bool,
}

impl Serialize for Change {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.words())
    }
}

impl AssumedValue {
    /// All.
    pub const ALL: [AssumedValue; 17] = [
        AssumedValue::Noise,
        AssumedValue::GelStiffness,
        AssumedValue::GelFriction,
        AssumedValue::GelContrast,
        AssumedValue::StackStiffness,
        AssumedValue::StackFriction,
        AssumedValue::LatexPuncture,
        AssumedValue::LiverStiffness,
        AssumedValue::LiverFriction,
        AssumedValue::LiverPuncture,
        AssumedValue::LiverThickness,
        AssumedValue::AbdomenStiffness,
        AssumedValue::AbdomenFriction,
        AssumedValue::TravelInAir,
        AssumedValue::TimeBehindTarget,
        AssumedValue::TorqueNoise,
        AssumedValue::VirtualSigma,
    ];

    /// Name as in the protocols.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            AssumedValue::Noise => "noise of the force sensor",
            AssumedValue::GelStiffness => "K of the single gels",
            AssumedValue::GelFriction => "b of the single gels",
            AssumedValue::GelContrast => "contrast of b between the single gels",
            AssumedValue::StackStiffness => "K of the stack",
            AssumedValue::StackFriction => "b of the stack",
            AssumedValue::LatexPuncture => "puncture force of the latex",
            AssumedValue::LiverStiffness => "K of the liver",
            AssumedValue::LiverFriction => "b of the liver",
            AssumedValue::LiverPuncture => "puncture forces of the liver",
            AssumedValue::LiverThickness => "thicknesses of the liver",
            AssumedValue::AbdomenStiffness => "K of the abdomen",
            AssumedValue::AbdomenFriction => "b of the abdomen",
            AssumedValue::TravelInAir => "way in air before contact",
            AssumedValue::TimeBehindTarget => "time behind the target",
            AssumedValue::TorqueNoise => "noise of the joint torques",
            AssumedValue::VirtualSigma => "s1 for the virtual sensor",
        }
    }

    /// Halved and doubled.
    #[must_use]
    pub const fn changes(self) -> [Change; 2] {
        [Change { value: self, doubled: false }, Change { value: self, doubled: true }]
    }

    /// Whether the value affects a recording. The noise of the force/torque sensor is a separate key, and `s1` belongs to
    /// the algorithm.
    #[must_use]
    pub const fn enters(self, case: Case) -> bool {
        match self {
            AssumedValue::Noise | AssumedValue::VirtualSigma => false,
            AssumedValue::GelStiffness | AssumedValue::GelFriction | AssumedValue::GelContrast => {
                case.is_gel()
            }
            AssumedValue::StackStiffness | AssumedValue::StackFriction | AssumedValue::LatexPuncture => {
                case.is_stack()
            }
            AssumedValue::LiverStiffness
            | AssumedValue::LiverFriction
            | AssumedValue::LiverPuncture
            | AssumedValue::LiverThickness => case.is_liver(),
            AssumedValue::AbdomenStiffness | AssumedValue::AbdomenFriction => case.is_abdomen(),
            AssumedValue::TravelInAir => true,
            // The abdomen's motion ends in the kidney.
            AssumedValue::TimeBehindTarget => !case.is_abdomen(),
            AssumedValue::TorqueNoise => case.on_arm(),
        }
    }
}

/// Friction of the middle gel: the contrast is changed about it.
const MIDDLE_NS_PER_M2: f64 = 12_000.0;

impl Change {
    /// ½ or 2.
    #[must_use]
    pub const fn factor(self) -> f64 {
        if self.doubled { 2.0 } else { 0.5 }
    }

    /// `K of the stack halved`.
    #[must_use]
    pub fn words(self) -> String {
        format!("{} {}", self.value.name(), if self.doubled { "doubled" } else { "halved" })
    }

    /// Changes a scenario.
    pub fn apply(self, scenario: &mut Scenario) {
        let factor = self.factor();
        for layer in &mut scenario.tissue.layers {
            match self.value {
                AssumedValue::GelStiffness
                | AssumedValue::StackStiffness
                | AssumedValue::LiverStiffness
                | AssumedValue::AbdomenStiffness => layer.stiffness_n_per_m *= factor,
                AssumedValue::GelFriction
                | AssumedValue::StackFriction
                | AssumedValue::LiverFriction
                | AssumedValue::AbdomenFriction => layer.friction_ns_per_m2 *= factor,
                AssumedValue::GelContrast => {
                    let ratio = layer.friction_ns_per_m2 / MIDDLE_NS_PER_M2;
                    layer.friction_ns_per_m2 = MIDDLE_NS_PER_M2 * libm::pow(ratio, factor);
                }
                AssumedValue::LatexPuncture | AssumedValue::LiverPuncture => {
                    layer.puncture_n = layer.puncture_n.map(|f| f * factor);
                }
                AssumedValue::LiverThickness => layer.thickness_m *= factor,
                AssumedValue::Noise
                | AssumedValue::TravelInAir
                | AssumedValue::TimeBehindTarget
                | AssumedValue::TorqueNoise
                | AssumedValue::VirtualSigma => {}
            }
        }
        if let (
            AssumedValue::TravelInAir,
            Motion::Constant { start_m, .. } | Motion::Sinusoidal { start_m, .. },
        ) = (self.value, &mut scenario.motion)
        {
            *start_m *= factor;
        }
        if let (AssumedValue::TimeBehindTarget, Some(out_s)) = (self.value, out_of_the_target_s(scenario))
            && let Motion::Constant { duration_s, .. } | Motion::Sinusoidal { duration_s, .. } =
                &mut scenario.motion
        {
            *duration_s = out_s + factor * (*duration_s - out_s);
        }
        if let (
            AssumedValue::TorqueNoise,
            Sensor::Both { virtual_sensor, .. } | Sensor::Virtual(virtual_sensor),
        ) = (self.value, &mut scenario.sensor)
        {
            virtual_sensor.torque_noise_nm *= factor;
        }
    }
}

/// Time in s at which the ideal motion passes the last far face; `None` if it never does.
fn out_of_the_target_s(scenario: &Scenario) -> Option<f64> {
    let tissue = &scenario.tissue;
    let far_m = tissue.surface_m + tissue.layers.iter().map(|l| l.thickness_m).sum::<f64>();
    let plan = scenario.motion.plan()?;
    let end_s = plan.duration_s();
    if plan.at(end_s).position_m <= far_m {
        return None;
    }
    let (mut before_s, mut after_s) = (0.0, end_s);
    for _ in 0..60 {
        let mid_s = 0.5 * (before_s + after_s);
        *if plan.at(mid_s).position_m > far_m { &mut after_s } else { &mut before_s } = mid_s;
    }
    Some(after_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_makes_another_valid_scenario_of_the_experiments_that_it_enters() {
        for case in Case::ALL {
            let plain = case.scenario().expect("valid");
            for change in AssumedValue::ALL.into_iter().flat_map(AssumedValue::changes) {
                if !change.value.enters(case) {
                    continue;
                }
                let mut changed = plain.clone();
                change.apply(&mut changed);
                // The middle gel stays where it is when the contrast changes.
                if change.value != AssumedValue::GelContrast {
                    assert_ne!(changed, plain, "{case:?} {}", change.words());
                }
                let checked = changed.check().map_err(|p| p.message);
                assert_eq!(checked, Ok(()), "{case:?} {}", change.words());
            }
        }
    }
}
