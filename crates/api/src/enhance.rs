//! The online core over a whole recording.

use crate::error::Error;
use crate::law::FittedLaw;
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

/// The same with what a law says of friction that was fitted to other insertions: enhanced force and its band are those of
/// [`Enhancer::with_law`](stylet_core::Enhancer::with_law), causally, each layer punctured from the sample on at which the core says so.
///
/// # Errors
/// [`Error::Request`] when the configuration's algorithm takes no law.
pub fn enhance_with_law(
    recording: &Recording,
    config: &EnhanceFile,
    law: &FittedLaw,
) -> Result<Enhanced, Error> {
    law.fits(&config.enhance)?;
    Ok(listen_told(recording, config, config.enhance.model, Some(law)))
}

/// As [`enhance`] with another model.
#[must_use]
pub fn listen(recording: &Recording, config: &EnhanceFile, model: Model) -> Enhanced {
    listen_told(recording, config, model, None)
}

/// With another model, and with a law where the algorithm takes one.
pub(crate) fn listen_told(
    recording: &Recording,
    config: &EnhanceFile,
    model: Model,
    law: Option<&FittedLaw>,
) -> Enhanced {
    let ran = combination(config, model);
    let (force_n, surface_m) = (&recording.force_n, config.surface_m);
    let trace = match law {
        Some(law) => {
            let mut shaft = law.shaft(recording.sample_hz());
            Trace::with_law(recording, force_n, &ran.config, surface_m, |s, ruptured| {
                shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured)
            })
        }
        None => Trace::record(recording, force_n, &ran.config, surface_m, |_, _| {}),
    };
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
