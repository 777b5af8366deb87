//! The online core over a whole recording.

use crate::picture::Ran;
use stylet_core::config::Model;
use stylet_record::Recording;
use stylet_scenario::EnhanceFile;
use stylet_score::{Trace, algorithm_name, model_name};

/// What the core made of a recording: one value per sample in [`Ran::trace`].
pub type Enhanced = Ran;

/// Runs the core over a recording, with the model of the configuration.
#[must_use]
pub fn enhance(recording: &Recording, config: &EnhanceFile) -> Enhanced {
    listen(recording, config, config.enhance.model)
}

/// The same with another model.
#[must_use]
pub fn listen(recording: &Recording, config: &EnhanceFile, model: Model) -> Enhanced {
    let ran = combination(config, model);
    let trace = Trace::record(recording, &recording.force_n, &ran.config, config.surface_m, |_, _| {});
    Ran { trace, ..ran }
}

/// A model before it has heard anything.
pub(crate) fn combination(config: &EnhanceFile, model: Model) -> Ran {
    let mut enhance = config.enhance.clone();
    enhance.model = model;
    Ran {
        name: format!("{}/{}/force_torque", algorithm_name(enhance.in_force()), model_name(model)),
        sensor: "force_torque",
        trace: Trace::default(),
        config: enhance,
        score: None,
    }
}
