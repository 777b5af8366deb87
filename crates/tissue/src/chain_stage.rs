//! Stages of the chain from the tissue to the recording.

/// Where in the chain from tissue to recording an effect acts (docs/reference/model.md, Measurement chain). The order of
/// the variants is the order of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum ChainStage {
    /// Changes the layers before the insertion starts.
    Geometry,
    /// Changes depth and velocity of the tip relative to the tissue.
    Kinematics,
    /// Changes the elastic force as a function of depth.
    Elastic,
    /// Changes the elastic force as a function of its history.
    Relaxation,
    /// Changes the force at which a layer ruptures.
    Puncture,
    /// Changes how a rupture releases the elastic force.
    Release,
    /// Changes or adds to the friction along the shaft.
    Friction,
    /// Adds a force at the tip.
    Tip,
    /// Acts between tissue and sensor: arm and tool.
    Tool,
    /// Acts in the force sensor.
    Sensor,
    /// Acts on the recorded position.
    Position,
}
