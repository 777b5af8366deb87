//! The online core over a whole recording.

use crate::error::Error;
use crate::identified_model::IdentifiedModel;
use crate::run_report::AlgorithmRun;
use stylet_core::config::Model;
use stylet_record::Recording;
use stylet_scenario::EnhancerConfigFile;
use stylet_score::{Trace, algorithm_name, model_name};

/// What the core made of a recording: one value per sample in [`Ran::trace`].
pub type Enhanced = AlgorithmRun;

/// Runs the core over a recording, with the model of the configuration.
#[must_use]
pub fn enhance(recording: &Recording, config: &EnhancerConfigFile) -> Enhanced {
    enhance_as(recording, config, config.enhance.model)
}

/// The same with what a law says of friction that was fitted to other insertions: enhanced force and its band are those of
/// [`Enhancer::with_law`](stylet_core::Enhancer::with_law), causally, each layer punctured from the sample on at which the core says so.
///
/// # Errors
/// [`Error::Request`] when the configuration's algorithm takes no law.
pub fn enhance_with_model(
    recording: &Recording,
    config: &EnhancerConfigFile,
    law: &IdentifiedModel,
) -> Result<Enhanced, Error> {
    law.check_algorithm(&config.enhance)?;
    Ok(run_enhancer(recording, config, config.enhance.model, Some(law)))
}

/// As [`enhance`] with another model.
#[must_use]
pub fn enhance_as(recording: &Recording, config: &EnhancerConfigFile, model: Model) -> Enhanced {
    run_enhancer(recording, config, model, None)
}

/// With another model, and with a law where the algorithm takes one.
pub(crate) fn run_enhancer(
    recording: &Recording,
    config: &EnhancerConfigFile,
    model: Model,
    law: Option<&IdentifiedModel>,
) -> Enhanced {
    let ran = empty_run(config, model);
    let (force_n, surface_m) = (&recording.force_n, config.surface_m);
    let trace = match law {
        Some(law) => {
            let mut shaft = law.shaft_friction(recording.sample_hz());
            Trace::run_with_model(recording, force_n, &ran.config, surface_m, |s, ruptured| {
                shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured)
            })
        }
        None => Trace::run(recording, force_n, &ran.config, surface_m, |_, _| {}),
    };
    AlgorithmRun { trace, ..ran }
}

/// A model before it has heard anything.
pub(crate) fn empty_run(config: &EnhancerConfigFile, model: Model) -> AlgorithmRun {
    let mut enhance = config.enhance.clone();
    enhance.model = model;
    AlgorithmRun {
        name: format!("{}/{}/force_torque", algorithm_name(enhance.active_algorithm()), model_name(model)),
        sensor: "force_torque",
        trace: Trace::default(),
        config: enhance,
        score: None,
    }
}
