//! Model of an arm: links, limits, flange and tool.

use crate::error::{Error, check};
use crate::pose::Pose;
use crate::rigid_body::RigidBody;

/// Range of a joint. Velocity and torque limits hold in both directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Smallest angle.
    pub lower_rad: f64,
    /// Largest angle.
    pub upper_rad: f64,
    /// Largest rate.
    pub velocity_radps: f64,
    /// Largest torque.
    pub torque_nm: f64,
}

/// One link and its joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// The link's frame in the frame of the link before it (or the base) at joint angle zero. The joint turns
    /// about the link's z.
    pub placement: Pose,
    /// The moving body, in the link's frame.
    pub body: RigidBody,
    /// The joint's range.
    pub limits: JointLimits,
}

/// Tool on the flange.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tool {
    /// The tool's frame in the flange's.
    pub mount: Pose,
    /// Payload, in the tool's frame.
    pub payload: RigidBody,
    /// The tip's frame in the tool's.
    pub tip: Pose,
}

/// An arm of `N` revolute joints in series. Plain data: [`crate::Arm::new`] checks it and computes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmModel<const N: usize> {
    /// From the base outwards.
    pub links: [Link; N],
    /// The flange's frame in the last link's.
    pub flange: Pose,
    /// The tool.
    pub tool: Tool,
}

impl<const N: usize> ArmModel<N> {
    /// The same arm with another tool.
    pub fn with_tool(mut self, tool: Tool) -> Self {
        self.tool = tool;
        self
    }

    /// The same arm with masses and inertias of all links (not of the tool) multiplied: a model error for an
    /// observer.
    pub fn with_link_mass_scaled(mut self, factor: f64) -> Self {
        for link in &mut self.links {
            link.body.mass_kg *= factor;
            link.body.inertia_kgm2 *= factor;
        }
        self
    }

    /// `Ok` if every number is finite, rotations are rotations, bodies are physical and limits are ordered.
    pub fn validate(&self) -> Result<(), Error> {
        for (i, link) in self.links.iter().enumerate() {
            let joint = Some(i + 1);
            link.placement.validate("placement", joint)?;
            link.body.validate(joint)?;
            let JointLimits { lower_rad, upper_rad, velocity_radps, torque_nm } = link.limits;
            check("lower_rad", joint, lower_rad, lower_rad < upper_rad, "below `upper_rad`")?;
            check("upper_rad", joint, upper_rad, true, "")?;
            check("velocity_radps", joint, velocity_radps, velocity_radps > 0.0, "positive")?;
            check("torque_nm", joint, torque_nm, torque_nm > 0.0, "positive")?;
        }
        self.flange.validate("flange", None)?;
        self.tool.mount.validate("tool.mount", None)?;
        self.tool.payload.validate(None)?;
        self.tool.tip.validate("tool.tip", None)
    }
}
