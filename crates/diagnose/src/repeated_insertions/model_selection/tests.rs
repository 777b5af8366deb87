use super::{MIN_IMPROVEMENT, best_candidate, search_subset};
use crate::base_law_fit::PreparedRecordings;
use crate::repeated_insertions::ablation::tests::{friction, stick_slip};
use crate::repeated_insertions::multistart_fit::set_blocks;
use crate::repeated_insertions::scored_model::{ModelFamily, ScoredModel};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures;
use crate::test_fixtures::{assumed_layers, simulated_recordings};
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{AnyEffect, ForceDrift, PowerLawFriction};

#[test]
fn the_best_candidate_must_improve_by_its_margin() {
    let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.1 }.into();
    let bend: AnyEffect = PowerLawFriction { exponent: 0.5 }.into();
    let base = test_fixtures::unmeasured_candidate(ModelFamily::Base, &[], &[0.9, 1.1], 0.0);
    let slip =
        |e: f64| test_fixtures::unmeasured_candidate(ModelFamily::ShaftSlip, &[stick_slip(1)], &[e, e], 0.0);
    let library = |e: f64| {
        test_fixtures::unmeasured_candidate(
            ModelFamily::Library,
            &[friction(3.0), drift.clone()],
            &[e, e],
            0.0,
        )
    };
    let many = |e: f64| {
        test_fixtures::unmeasured_candidate(
            ModelFamily::Library,
            &[friction(3.0), drift.clone(), bend.clone()],
            &[e, e],
            0.0,
        )
    };
    let kind = |slip: Option<ScoredModel>, library: Option<ScoredModel>| {
        best_candidate(&base, slip.as_ref(), library.as_ref()).family
    };
    assert_eq!(kind(None, None), ModelFamily::Base);
    // Two per cent of the base law's 1 N.
    assert_eq!(kind(Some(slip(0.985)), Some(library(0.985))), ModelFamily::Base);
    assert_eq!(kind(Some(slip(0.975)), None), ModelFamily::ShaftSlip);
    assert_eq!(kind(None, Some(library(0.975))), ModelFamily::Library);
    assert_eq!(kind(None, Some(many(0.975))), ModelFamily::Library);
    // One or two library effects compete with stick-slip on equal terms; three need 10 % less.
    assert_eq!(kind(Some(slip(0.5)), Some(library(0.49))), ModelFamily::Library);
    assert_eq!(kind(Some(slip(0.5)), Some(library(0.51))), ModelFamily::ShaftSlip);
    assert_eq!(kind(Some(slip(0.5)), Some(many(0.46))), ModelFamily::ShaftSlip);
    assert_eq!(kind(Some(slip(0.5)), Some(many(0.44))), ModelFamily::Library);
    assert_eq!(kind(Some(slip(1.0 - MIN_IMPROVEMENT)), None), ModelFamily::Base);
    assert_eq!(kind(Some(slip(0.5)), Some(library(0.5))), ModelFamily::ShaftSlip);
    let base = test_fixtures::unmeasured_candidate(ModelFamily::Base, &[], &[2.0, 2.0], 0.0);
    assert_eq!(best_candidate(&base, Some(&slip(1.9)), None).family, ModelFamily::ShaftSlip);
    assert_eq!(kind(Some(slip(f64::INFINITY)), Some(many(0.97))), ModelFamily::Library);
}

#[test]
fn the_library_search_uses_equally_many_recordings_of_every_group() {
    let one = simulated_recordings(&[], &[[0.008, 0.0]]).remove(0);
    let of = |speeds: &[f64]| {
        let recordings: Vec<SegmentedRecording> =
            speeds.iter().map(|v| SegmentedRecording { speed_mps: *v, ..one.clone() }).collect();
        let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
        let mut all = set_blocks(&recordings, &SensorArtefacts::default());
        all.iter_mut().enumerate().for_each(|(k, b)| b.force_n[0] = k as f64);
        let prepared = PreparedRecordings::new(assumed_layers(&[[0.05, 250.0, 2e4]]), all, 0.3);
        let (part, which) = search_subset(&prepared, &recordings);
        assert_eq!(part.blocks.iter().map(|b| b.force_n[0] as usize).collect::<Vec<_>>(), which);
        assert_eq!((part.drops.len(), part.min_noise_sd_n), (which.len(), prepared.min_noise_sd_n));
        which
    };
    assert_eq!(of(&[1.0; 9]), [0, 1, 2, 3, 4, 5]);
    assert_eq!(of(&[1.0; 2]), [0, 1]);
    assert_eq!(of(&[3.0, 1.0, 1.0, 3.0, 2.0, 3.0, 2.0, 1.0, 2.0]), [0, 1, 2, 3, 4, 6]);
    assert_eq!(of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0]), [0, 1, 2, 3, 4, 5, 6]);
}
