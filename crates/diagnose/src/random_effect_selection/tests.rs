use super::*;
use crate::test_fixtures::{assumed_layers, fit_simulated};
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::noise::Noise;
use stylet_record::Recording;

#[test]
fn penalty_counts_one_parameter_less_than_recordings() {
    let t: Vec<f64> = (0..400).map(|k| f64::from(k) / 100.0).collect();
    let z = t.iter().map(|t| 1e-3 * t).collect();
    let r = Recording::new(t, z, vec![0.0; 400]).expect("a recording");
    let data = FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S); 4]), Noise::white(0.02), 0.0);
    let each = 0.5 * (data.compared_block_count() as f64).ln();
    for (own_surface, own_friction, wanted) in [
        (false, false, 0.0),
        (true, false, 3.0 * each + 4.0),
        (false, true, 3.0 * each + 4.0),
        (true, true, 6.0 * each + 8.0),
    ] {
        let free = FreeParameters {
            recording_surface: own_surface,
            recording_friction: own_friction,
            ..FreeParameters::default()
        };
        assert!(
            (penalty_nats(free, &data) - wanted).abs() < 1e-9,
            "{} for {wanted}",
            penalty_nats(free, &data)
        );
    }
}

#[test]
fn removed_random_effects_are_zero() {
    let assumed = assumed_layers(&[]);
    let mut m = Model::base(assumed, 2);
    m.free.thickness = true;
    m.per_recording[1] = RecordingParameters { surface_m: 2e-3, ln_friction: 0.3, varying: [0.7; 8] };
    for (surface, friction) in [(false, false), (true, false), (false, true), (true, true)] {
        let out = with_random_effects(&m, surface, friction);
        assert_eq!(
            (out.free.recording_surface, out.free.recording_friction, out.free.thickness),
            (surface, friction, true)
        );
        let wanted = RecordingParameters {
            surface_m: if surface { 2e-3 } else { 0.0 },
            ln_friction: if friction { 0.3 } else { 0.0 },
            varying: [0.7; 8],
        };
        assert_eq!(out.per_recording[1], wanted);
    }
}

/// Random effects selected for recordings with these surface shifts, starting from a model with both or none.
fn chosen(moved_m: &[f64], start_with_both: bool) -> (bool, bool) {
    let at: Vec<[f64; 2]> = moved_m.iter().zip([4e-3, 5e-3, 6e-3]).map(|(m, v)| [v, *m]).collect();
    let f = fit_simulated(&[], &[], &at, |_| 0.0);
    let start = with_random_effects(&f.fit.model, start_with_both, start_with_both);
    let start = fit(&start, &f.data, Effort::FULL).expect("a fit");
    let data = f.data.with_estimated_noise(&start.residuals.residual_n, NoiseSource::Detrended);
    let start = fit(&start.model, &data, Effort::FULL).expect("a fit");
    let free = select_random_effects(start, data).0.model.free;
    (free.recording_surface, free.recording_friction)
}

#[test]
fn different_surfaces_get_a_random_effect() {
    assert_eq!(chosen(&[8e-4, -8e-4, 0.0], false), (true, false));
    assert_eq!(chosen(&[8e-4, -8e-4, 0.0], true), (true, false));
}

#[test]
fn equal_recordings_get_no_random_effect() {
    assert_eq!((chosen(&[0.0; 3], true), chosen(&[0.0; 3], false)), ((false, false), (false, false)));
}

#[test]
fn single_recording_keeps_its_random_effects() {
    assert_eq!((chosen(&[8e-4], true), chosen(&[8e-4], false)), ((true, true), (false, false)));
}
