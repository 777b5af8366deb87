use crate::effect::{Effect, Place};

/// Mass of the tool beyond the sensor: `+ m a`.
///
/// Signature: spikes at start and stop, also in air, proportional to the acceleration.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ToolInertia {
    /// Mass in kg, zero or positive. Neutral: 0.
    pub mass_kg: f64,
}

impl Effect for ToolInertia {
    fn id(&self) -> &'static str {
        "tool_inertia"
    }
    fn place(&self) -> Place {
        Place::Tool
    }
    fn is_neutral(&self) -> bool {
        self.mass_kg == 0.0
    }
    fn tool_force(&self, _v_mps: f64, a_mps2: f64) -> f64 {
        self.mass_kg * a_mps2
    }
}
