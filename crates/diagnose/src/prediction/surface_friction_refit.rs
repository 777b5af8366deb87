//! Refit of surface and friction to new recordings, all other parameters fixed.

use crate::base_law_fit::roughness;
use serde::{Deserialize, Serialize};
use stylet_identify::fit::{Effort, fit};
use stylet_identify::force_drops::detect_force_drops;
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{Assumptions, FreeParameters, Model, RecordingParameters};
use stylet_identify::rupture_assignment::assign_ruptures;
use stylet_identify::update_event_times::update_event_times;

/// A parameter that may be refitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refit {
    /// Position of the surface.
    Surface,
    /// Friction: one factor for all layers.
    Friction,
}

/// Relative tolerance of fixed parameters.
const FIXED_TOLERANCE: f64 = 1e-7;
/// Prior standard deviation of the surface in m.
const SURFACE_PRIOR_SD_M: f64 = 5e-3;
/// Prior standard deviation of the logarithm of friction.
const FRICTION_PRIOR_SD: f64 = 0.7;

/// Random effects of every recording.
pub fn fit_recording_offsets(
    model: &Model,
    data: &FitData,
    refit: &[Refit],
) -> Option<Vec<RecordingParameters>> {
    if refit.is_empty() {
        return Some(model.per_recording.clone());
    }
    let layers = model.layers();
    let belief = Assumptions {
        tolerance: vec![FIXED_TOLERANCE; layers],
        thickness_tolerance: vec![0.0; layers],
        surface_tolerance_m: 0.0,
        ..Assumptions::clone(&model.assumed)
    };
    let mut model = Model::base(belief.into(), data.recording_count());
    model.free = FreeParameters {
        recording_surface: refit.contains(&Refit::Surface),
        recording_friction: refit.contains(&Refit::Friction),
        ..FreeParameters::default()
    };
    (model.scatter.surface_m, model.scatter.ln_friction) = (SURFACE_PRIOR_SD_M, FRICTION_PRIOR_SD);
    let noise_n = roughness(&data.recordings);
    let found: Vec<_> = data.recordings.iter().map(detect_force_drops).collect();
    model.rupture_times_s = assign_ruptures(&model, &data.recordings, &found, 0.5, noise_n);
    let times: Vec<Vec<f64>> = found.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect();
    let first = fit(&model, data, Effort { max_iterations: 6, min_gain_nats: 0.3 })?;
    let mut model = first.model;
    update_event_times(&mut model, data, &times);
    Some(fit(&model, data, Effort::FULL)?.model.per_recording)
}

/// Values for predicting recording `r`: mean of the other recordings, or its own if it is alone.
pub fn held_out_mean(own: &[RecordingParameters], r: usize) -> RecordingParameters {
    let others = own.iter().enumerate().filter(|(k, _)| own.len() == 1 || *k != r).map(|(_, o)| o);
    let (mut sum, mut n) = (RecordingParameters::default(), 0.0);
    for o in others {
        sum.surface_m += o.surface_m;
        sum.ln_friction += o.ln_friction;
        n += 1.0;
    }
    RecordingParameters {
        surface_m: sum.surface_m / f64::max(n, 1.0),
        ln_friction: sum.ln_friction / f64::max(n, 1.0),
        ..RecordingParameters::default()
    }
}

#[cfg(test)]
mod tests {
    use super::held_out_mean;
    use stylet_identify::model::RecordingParameters;

    #[test]
    fn a_recording_uses_the_mean_of_the_others_or_its_own_if_alone() {
        let own = |surface_m: f64, friction: f64| RecordingParameters {
            surface_m,
            ln_friction: friction,
            varying: [3.0; 8],
        };
        let all = [own(1e-3, 0.2), own(4e-3, -0.5), own(-3e-4, 0.7)];
        let l = held_out_mean(&all, 1);
        assert!((l.surface_m - 3.5e-4).abs() < 1e-15 && (l.ln_friction - 0.45).abs() < 1e-15);
        assert_eq!(l.varying, [0.0; 8]);
        let l = held_out_mean(&all[..2], 0);
        assert_eq!((l.surface_m, l.ln_friction), (4e-3, -0.5));
        let l = held_out_mean(&all[..1], 0);
        assert_eq!((l.surface_m, l.ln_friction), (1e-3, 0.2));
    }
}
