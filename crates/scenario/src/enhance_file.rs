//! The configuration of `stylet enhance`: how the core is set for measured data.

use crate::error::InputError;
use crate::load::{parse, read_text};
use crate::scenario::Scenario;
use crate::validate_enhance::enhance;
use serde::{Deserialize, Serialize};
use std::path::Path;
use stylet_core::EnhanceConfig;

/// `Enhance(...)`: where the surface is, and the core's configuration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Enhance", default, deny_unknown_fields)]
pub struct EnhanceFile {
    /// Position of the surface in m, for `contact: Known`.
    pub surface_m: f64,
    /// The core.
    pub enhance: EnhanceConfig,
}

impl EnhanceFile {
    /// Loads an `Enhance(...)` file, or takes what it needs from a `Scenario(...)` file.
    ///
    /// # Errors
    /// [`InputError`] with file, line and column.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let file = path.display().to_string();
        let text = read_text(path)?;
        if text.contains("tissue") {
            let scenario = Scenario::parse(&file, &text)?;
            return Ok(Self { surface_m: scenario.tissue.surface_m, enhance: scenario.enhance });
        }
        let loaded: Self = parse(&file, &text)?;
        enhance("enhance", &loaded.enhance).map_err(|p| p.in_file(&file, &text))?;
        Ok(loaded)
    }
}
