//! The paper's experiments and their shipped scenarios.

use stylet_scenario::{ArmFriction, InputError, Robot, Scenario};
use stylet_tissue::{AnyEffect, NonlinearElasticity};

/// An experiment of the paper, or one added to test what a claim depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Case {
    /// Isinglass 25 %, constant velocity (supplement Fig. 3).
    Gel25Constant,
    /// Isinglass 25 %, sinusoidal velocity (supplement Fig. 5).
    Gel25Sinusoidal,
    /// Isinglass 50 %, constant velocity (supplement Fig. 4).
    Gel50Constant,
    /// Isinglass 50 %, sinusoidal velocity (supplement Fig. 6).
    Gel50Sinusoidal,
    /// Isinglass 70 %, constant velocity (supplement Fig. 10).
    Gel70Constant,
    /// Isinglass 70 %, sinusoidal velocity (supplement Fig. 13).
    Gel70Sinusoidal,
    /// Three gels, latex around the second, constant velocity (main paper Fig. 12).
    LatexConstant,
    /// Three gels, latex around the second, sinusoidal velocity (supplement Figs 7, 11, 14).
    LatexSinusoidal,
    /// Bovine liver, constant velocity (supplement Figs 8, 12, 15).
    Liver,
    /// Abdominal phantom, sinusoidal velocity (supplement Fig. 9).
    Abdomen,
    /// Bovine liver on the arm, with both sensors (main paper Fig. 13).
    LiverArm,
    /// Abdominal phantom on the arm, with both sensors (main paper Fig. 14).
    AbdomenArm,
    /// Ours: the liver on the arm with the joint friction measured on a Panda.
    LiverArmFriction,
    /// Ours: the abdomen on the arm with the joint friction measured on a Panda.
    AbdomenArmFriction,
    /// Ours: the liver with the quadratic elasticity that Okamura 2004 measured.
    LiverQuadratic,
}

macro_rules! scenario {
    ($name:literal) => {
        ($name, include_str!(concat!("../scenarios/", $name)))
    };
}

impl Case {
    /// The six insertions into one gel, by concentration.
    pub const GELS: [[Case; 2]; 3] = [
        [Case::Gel25Constant, Case::Gel25Sinusoidal],
        [Case::Gel50Constant, Case::Gel50Sinusoidal],
        [Case::Gel70Constant, Case::Gel70Sinusoidal],
    ];

    /// All.
    pub const ALL: [Case; 15] = [
        Case::Gel25Constant,
        Case::Gel25Sinusoidal,
        Case::Gel50Constant,
        Case::Gel50Sinusoidal,
        Case::Gel70Constant,
        Case::Gel70Sinusoidal,
        Case::LatexConstant,
        Case::LatexSinusoidal,
        Case::Liver,
        Case::Abdomen,
        Case::LiverArm,
        Case::AbdomenArm,
        Case::LiverArmFriction,
        Case::AbdomenArmFriction,
        Case::LiverQuadratic,
    ];

    /// One gel.
    #[must_use]
    pub const fn is_gel(self) -> bool {
        matches!(
            self,
            Case::Gel25Constant
                | Case::Gel25Sinusoidal
                | Case::Gel50Constant
                | Case::Gel50Sinusoidal
                | Case::Gel70Constant
                | Case::Gel70Sinusoidal
        )
    }

    /// The stack of three gels.
    #[must_use]
    pub const fn is_stack(self) -> bool {
        matches!(self, Case::LatexConstant | Case::LatexSinusoidal)
    }

    /// Liver.
    #[must_use]
    pub const fn is_liver(self) -> bool {
        matches!(self, Case::Liver | Case::LiverArm | Case::LiverArmFriction | Case::LiverQuadratic)
    }

    /// Abdomen.
    #[must_use]
    pub const fn is_abdomen(self) -> bool {
        matches!(self, Case::Abdomen | Case::AbdomenArm | Case::AbdomenArmFriction)
    }

    /// Name and text of its scenario file.
    #[must_use]
    pub const fn file(self) -> (&'static str, &'static str) {
        match self {
            Case::Gel25Constant => scenario!("isinglass_25_constant.ron"),
            Case::Gel25Sinusoidal => scenario!("isinglass_25_sinusoidal.ron"),
            Case::Gel50Constant => scenario!("isinglass_50_constant.ron"),
            Case::Gel50Sinusoidal => scenario!("isinglass_50_sinusoidal.ron"),
            Case::Gel70Constant => scenario!("isinglass_70_constant.ron"),
            Case::Gel70Sinusoidal => scenario!("isinglass_70_sinusoidal.ron"),
            Case::LatexConstant => scenario!("three_layer_latex_constant.ron"),
            Case::LatexSinusoidal => scenario!("three_layer_latex_sinusoidal.ron"),
            Case::Liver | Case::LiverQuadratic => scenario!("bovine_liver_constant.ron"),
            Case::Abdomen => scenario!("abdomen_sinusoidal.ron"),
            Case::LiverArm | Case::LiverArmFriction => scenario!("bovine_liver_constant_virtual.ron"),
            Case::AbdomenArm | Case::AbdomenArmFriction => scenario!("abdomen_sinusoidal_virtual.ron"),
        }
    }

    /// Name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Case::Gel25Constant => "isinglass 25 %, constant",
            Case::Gel25Sinusoidal => "isinglass 25 %, sinusoidal",
            Case::Gel50Constant => "isinglass 50 %, constant",
            Case::Gel50Sinusoidal => "isinglass 50 %, sinusoidal",
            Case::Gel70Constant => "isinglass 70 %, constant",
            Case::Gel70Sinusoidal => "isinglass 70 %, sinusoidal",
            Case::LatexConstant => "latex stack, constant",
            Case::LatexSinusoidal => "latex stack, sinusoidal",
            Case::Liver => "bovine liver, constant",
            Case::Abdomen => "abdomen, sinusoidal",
            Case::LiverArm => "bovine liver on the arm",
            Case::AbdomenArm => "abdomen on the arm",
            Case::LiverArmFriction => "bovine liver on the arm, joint friction of a Panda",
            Case::AbdomenArmFriction => "abdomen on the arm, joint friction of a Panda",
            Case::LiverQuadratic => "bovine liver, quadratic elasticity",
        }
    }

    /// Whether the arm carries the needle: every seed is then a separate simulation, because the noise of the joint torques
    /// moves the arm.
    #[must_use]
    pub const fn on_arm(self) -> bool {
        matches!(self, Case::LiverArm | Case::AbdomenArm | Case::LiverArmFriction | Case::AbdomenArmFriction)
    }

    /// The scenario as it is simulated.
    ///
    /// # Errors
    /// [`InputError`] when the shipped scenario is wrong, which a test excludes.
    pub fn scenario(self) -> Result<Scenario, InputError> {
        let (file, text) = self.file();
        let mut scenario = Scenario::parse(&format!("scenarios/{file}"), text)?;
        match self {
            Case::LiverArmFriction | Case::AbdomenArmFriction => {
                if let Robot::Arm(arm) = &mut scenario.robot {
                    arm.joint_friction = ArmFriction::MeasuredDirectional;
                    arm.friction_scale = 1.0;
                }
            }
            Case::LiverQuadratic => quadratic(&mut scenario),
            _ => {}
        }
        Ok(scenario)
    }
}

/// Okamura 2004, liver: `f = a1 z + a2 z²`, `a1` = 48 N/m and `a2` = 5200 N/m², for the first layer, whose
/// puncture force of 2.3 N then lies 17 mm deep as before; the second bends in the same way.
fn quadratic(scenario: &mut Scenario) {
    if let Some(first) = scenario.tissue.layers.first_mut() {
        first.stiffness_n_per_m = 48.0;
    }
    scenario.effects.push(AnyEffect::NonlinearElasticity(NonlinearElasticity { kappa_per_m: 5200.0 / 48.0 }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_a_valid_scenario() {
        for case in Case::ALL {
            case.scenario().expect("a valid file").check().expect("valid numbers");
            assert_eq!(
                case.on_arm(),
                matches!(case.scenario().expect("valid").robot, Robot::Arm(_)),
                "{case:?}"
            );
        }
    }
}
