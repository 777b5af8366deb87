//! The online core over a recording in memory.

use super::identified_model::IdentifiedModel;
use crate::error::Error;
use crate::run_report::AlgorithmRun;
use stylet_core::config::{Contact, Model};
use stylet_core::{EnhanceConfig, Sample};
use stylet_record::Recording;
use stylet_scenario::EnhancerConfigFile;
use stylet_score::{Trace, algorithm_name, model_name};

/// Runs the core over a recording with the regressor of the configuration; outputs per sample are in [`AlgorithmRun::trace`].
#[must_use]
pub fn enhance(recording: &Recording, config: &EnhancerConfigFile) -> AlgorithmRun {
    enhance_as(recording, config, config.enhance.model)
}

/// As [`enhance`], with the shaft friction of an identified model: enhanced force and band are those of
/// [`Enhancer::apply_model_friction`](stylet_core::Enhancer::apply_model_friction). A layer counts as punctured from the sample
/// of its detection on.
///
/// # Errors
/// [`Error::Request`] when the configured algorithm takes no model.
pub fn enhance_with_model(
    recording: &Recording,
    config: &EnhancerConfigFile,
    model: &IdentifiedModel,
) -> Result<AlgorithmRun, Error> {
    model.check_algorithm(&config.enhance)?;
    Ok(run_enhancer(recording, config, config.enhance.model, Some(model)))
}

/// As [`enhance`] with another regressor.
#[must_use]
pub fn enhance_as(recording: &Recording, config: &EnhancerConfigFile, regressor: Model) -> AlgorithmRun {
    run_enhancer(recording, config, regressor, None)
}

/// With an identified model where the algorithm takes one.
pub(super) fn run_enhancer(
    recording: &Recording,
    config: &EnhancerConfigFile,
    regressor: Model,
    model: Option<&IdentifiedModel>,
) -> AlgorithmRun {
    let mut run = empty_run(config, regressor);
    let trace = |enhance: &EnhanceConfig| {
        let shaft = model.map(|model| model.shaft_friction(recording.sample_hz()));
        let friction = shaft.map(|mut shaft| {
            move |s: &Sample, ruptures| shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptures)
        });
        Trace::run_measured(recording, &recording.force_n, enhance, config.surface_m, friction)
    };
    run.trace = trace(&run.config);
    if run.trace.contact.is_loaded_unexpectedly() {
        let contact = run.trace.contact.without_contact();
        run.config.contact = Contact::None;
        run.trace = Trace { contact, ..trace(&run.config) };
    }
    run
}

/// A run without outputs yet.
pub(super) fn empty_run(config: &EnhancerConfigFile, regressor: Model) -> AlgorithmRun {
    let mut enhance = config.enhance.clone();
    enhance.model = regressor;
    AlgorithmRun {
        name: format!(
            "{}/{}/force_torque",
            algorithm_name(enhance.active_algorithm()),
            model_name(regressor)
        ),
        sensor: "force_torque",
        trace: Trace::default(),
        config: enhance,
        score: None,
    }
}
