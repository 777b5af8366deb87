//! The enhanced force is scored against the tip force from the surface to the deepest point, inside the tissue and beyond it.

use crate::support::{LAYERS, near};
use stylet_core::config::Model;
use stylet_score::{EnhancedSample, Score, Scorer, TrueSample};

/// A sample: tip position, tip force, error of the enhanced force, and sensor error.
struct At {
    z: f64,
    tip: f64,
    miss: f64,
    sensor: f64,
}

const fn at(z: f64, tip: f64, miss: f64, sensor: f64) -> At {
    At { z, tip, miss, sensor }
}

/// True total force at a tip force, with arbitrary friction.
fn total(tip: f64) -> f64 {
    tip + 0.7
}

fn scored(samples: &[At], band_n: impl Fn(&At) -> Option<[f64; 2]>) -> Score {
    let mut scorer = Scorer::new(LAYERS.to_vec(), Model::MultiLayer);
    for s in samples {
        let truth = TrueSample {
            position_m: s.z,
            force_n: total(s.tip) + s.sensor,
            tip_n: s.tip,
            total_n: total(s.tip),
        };
        let output = EnhancedSample { enhanced_n: s.tip + s.miss, error_n: 10.0 * s.miss, band_n: band_n(s) };
        scorer.add_sample(&truth, &output);
    }
    scorer.finish()
}

/// In air, at the surface, in the last layer, at its far face, deeper, held there.
const INSERTION: [At; 6] = [
    at(0.009, 50.0, 70.0, 90.0),
    at(0.010, 0.5, 0.3, 0.1),
    at(0.024, 2.0, 0.4, -0.2),
    at(0.025, 3.0, -0.6, 0.3),
    at(0.030, 0.25, 1.2, 0.5),
    at(0.030, 4.0, 0.1, -0.4),
];

/// The scores of [`INSERTION`] computed by hand; the sample in air does not count.
fn assert_insertion_scores(score: &Score) {
    let tip2: f64 = 0.5 * 0.5 + 2.0 * 2.0 + 3.0 * 3.0 + 0.25 * 0.25 + 4.0 * 4.0;
    let miss2 = 0.09 + 0.16 + 0.36 + 1.44 + 0.01;
    near(score.enhancement.rms_relative, (miss2 / tip2).sqrt());
    // Less the sensor error: 0.2, 0.6, -0.9, 0.7, 0.5.
    near(score.enhancement.friction_rms_relative, ((0.04 + 0.36 + 0.81 + 0.49 + 0.25) / tip2).sqrt());
    near(score.enhancement.in_tissue_relative, ((0.09 + 0.16) / (0.5 * 0.5 + 2.0 * 2.0_f64)).sqrt());
    // At and beyond the far face the enhanced force is 2.4, 1.45 and 4.1 N of 4.0, 1.45 and 4.3 N.
    let enhanced2: f64 = 2.4 * 2.4 + 1.45 * 1.45 + 4.1 * 4.1;
    near(score.enhancement.after_exit_relative, (enhanced2 / (4.0 * 4.0 + 1.45 * 1.45 + 4.3 * 4.3)).sqrt());
    near(score.reconstruction_rms_n, (100.0 * miss2 / 5.0).sqrt());
}

#[test]
fn insertion_is_scored_from_the_surface_to_the_end_of_the_hold() {
    assert_insertion_scores(&scored(&INSERTION, |_| None));
}

#[test]
fn retraction_is_not_scored() {
    let mut samples = Vec::from(INSERTION);
    samples.extend([at(0.029, 7.0, 9.0, 3.0), at(0.015, -8.0, 9.0, 5.0), at(0.001, 1.0, 1.0, 1.0)]);
    assert_insertion_scores(&scored(&samples, |_| None));
}

#[test]
fn a_step_back_counts_once_the_needle_goes_deeper() {
    let samples = [at(0.012, 1.0, 0.1, 0.0), at(0.011, 2.0, 0.5, 0.0), at(0.013, 3.0, 0.2, 0.0)];
    near(scored(&samples[..2], |_| None).enhancement.rms_relative, 0.1);
    near(scored(&samples, |_| None).enhancement.rms_relative, ((0.01 + 0.25 + 0.04) / 14.0_f64).sqrt());
}

#[test]
fn phases_that_a_recording_lacks_have_no_score() {
    let air = scored(&INSERTION[..1], |_| None);
    assert_eq!(air.enhancement.rms_relative, None);
    assert_eq!(air.enhancement.friction_rms_relative, None);
    assert_eq!(air.enhancement.in_tissue_relative, None);
    assert_eq!(air.reconstruction_rms_n, None);
    // A run that ends inside the tissue has no exit.
    assert_eq!(scored(&INSERTION[..3], |_| None).enhancement.after_exit_relative, None);
}

#[test]
fn a_force_on_the_edge_lies_in_the_band_and_samples_without_band_do_not_count() {
    let band = |s: &At| match s.tip {
        0.5 => Some([0.5, 0.9]),
        2.0 => Some([1.0, 2.0]),
        3.0 => Some([3.1, 9.0]),
        0.25 => Some([-1.0, 0.2]),
        _ => None,
    };
    assert_eq!(scored(&INSERTION, band).coverage.band, [2.0, 4.0]);
    assert_eq!(scored(&INSERTION, |_| None).coverage.band, [0.0, 0.0]);
}
