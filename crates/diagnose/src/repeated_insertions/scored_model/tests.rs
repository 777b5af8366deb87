use super::{DRAWS, REFIT_ITERATIONS, active_effects, cross_validate, rms_errors_n, with_coarse_blocks};
use crate::repeated_insertions::ablation::tests::{delayed, model, stick_slip};
use crate::repeated_insertions::cross_validation::{population_without, score_prediction};
use crate::repeated_insertions::multistart_fit::{SET_BLOCK_S, SetFit};
use crate::repeated_insertions::population_prediction::predict_force;
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use crate::test_fixtures::{fit_from_truth, simulated_recordings};
use stylet_tissue::{AnyEffect, CoulombFriction};

#[test]
fn active_effects_are_listed_once() {
    let nothing: AnyEffect = CoulombFriction { c_n_per_m: 0.0 }.into();
    assert_eq!(
        active_effects(&model(&[stick_slip(1), delayed(1, 1.5), stick_slip(2), nothing])),
        ["shaft_slip", "delayed_puncture"]
    );
}

#[test]
fn cross_validation_uses_coarse_blocks() {
    let recordings = simulated_recordings(&[], &[[0.004, 0.0], [0.008, 1e-4]]);
    let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
    let fine = fit_from_truth(&[], &recordings);
    let long = with_coarse_blocks(&fine);
    for (a, b) in fine.data.recordings.iter().zip(long.data.recordings.iter()) {
        assert!(
            (b.end_s[3] - b.start_s[3] - 0.24).abs() < 1e-9 && b.len() == a.len().div_ceil(3),
            "{}",
            b.len()
        );
    }
    let again = with_coarse_blocks(&long);
    assert_eq!(again.data.recordings[0].len(), long.data.recordings[0].len());
    let mut blocks = fine.data.recordings.to_vec();
    blocks.iter_mut().for_each(|b| (b.samples_per_block, b.sample_step_s) = (1, 1.5 * SET_BLOCK_S));
    let half_more = SetFit { data: fine.data.with_recordings(blocks), ..fine.clone() };
    assert_eq!(with_coarse_blocks(&half_more).data.recordings[0].len(), long.data.recordings[0].len());
}

#[test]
fn cross_validation_scores_held_out_recordings() {
    let speeds = [0.008, 0.016];
    for (count, fold) in [(4, vec![1]), (8, vec![1]), (9, vec![1, 4, 7])] {
        let all: Vec<[f64; 2]> = (0..count).map(|k| [speeds[k % 2], 1e-4 * (k % 3) as f64]).collect();
        let recordings = simulated_recordings(&[], &all);
        let recordings: Vec<&SegmentedRecording> = recordings.iter().collect();
        let fitted = fit_from_truth(&[], &recordings);
        let result = cross_validate(&fitted, &recordings);
        assert_eq!(result.len(), count);
        let others =
            population_without(&with_coarse_blocks(&fitted), &recordings, &fold, &[REFIT_ITERATIONS])
                .expect("a fit");
        for r in fold {
            let wanted = score_prediction(recordings[r], &predict_force(&others, recordings[r], None, DRAWS));
            assert_eq!(result[r], Some(wanted), "{r} of {count}");
        }
        assert!(rms_errors_n(&result).iter().all(|e| *e > 0.0 && *e < 0.5), "{result:?}");
    }
}
