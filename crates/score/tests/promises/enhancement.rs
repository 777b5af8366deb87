//! The enhanced force is judged from the surface to the deepest point: against the tip's force, inside the tissue and behind it.

use crate::support::{LAYERS, near};
use stylet_core::config::Model;
use stylet_score::{EnhancedSample, Score, Scorer, TrueSample};

/// A sample: where the tip is, its force, by how much the core misses that, and the sensor's own error.
struct At {
    z: f64,
    tip: f64,
    miss: f64,
    sensor: f64,
}

const fn at(z: f64, tip: f64, miss: f64, sensor: f64) -> At {
    At { z, tip, miss, sensor }
}

/// Friction of the passed layers that the sensor feels at the tip's force `tip` (any numbers do).
fn felt(tip: f64) -> f64 {
    tip + 0.7
}

fn scored(samples: &[At], band_n: impl Fn(&At) -> Option<[f64; 2]>) -> Score {
    let mut scorer = Scorer::new(LAYERS.to_vec(), Model::MultiLayer);
    for s in samples {
        let moment = TrueSample {
            position_m: s.z,
            force_n: felt(s.tip) + s.sensor,
            tip_n: s.tip,
            total_n: felt(s.tip),
        };
        let heard = EnhancedSample { enhanced_n: s.tip + s.miss, error_n: 10.0 * s.miss, band_n: band_n(s) };
        scorer.add_sample(&moment, &heard);
    }
    scorer.finish()
}

/// In the air, on the surface, in the last layer, on its far face, deeper, held there.
const ADVANCE: [At; 6] = [
    at(0.009, 50.0, 70.0, 90.0),
    at(0.010, 0.5, 0.3, 0.1),
    at(0.024, 2.0, 0.4, -0.2),
    at(0.025, 3.0, -0.6, 0.3),
    at(0.030, 0.25, 1.2, 0.5),
    at(0.030, 4.0, 0.1, -0.4),
];

/// The scores of [`ADVANCE`] by hand; the sample in the air counts nowhere.
fn is_that_of_the_advance(score: &Score) {
    let tip2: f64 = 0.5 * 0.5 + 2.0 * 2.0 + 3.0 * 3.0 + 0.25 * 0.25 + 4.0 * 4.0;
    let miss2 = 0.09 + 0.16 + 0.36 + 1.44 + 0.01;
    near(score.enhancement.rms_relative, (miss2 / tip2).sqrt());
    // Less the sensor's error: 0.2, 0.6, -0.9, 0.7, 0.5.
    near(score.enhancement.friction_rms_relative, ((0.04 + 0.36 + 0.81 + 0.49 + 0.25) / tip2).sqrt());
    near(score.enhancement.in_tissue_relative, ((0.09 + 0.16) / (0.5 * 0.5 + 2.0 * 2.0_f64)).sqrt());
    // On the far face and behind it the core leaves 2.4, 1.45 and 4.1 N of 4.0, 1.45 and 4.3 N.
    let left: f64 = 2.4 * 2.4 + 1.45 * 1.45 + 4.1 * 4.1;
    near(score.enhancement.after_exit_relative, (left / (4.0 * 4.0 + 1.45 * 1.45 + 4.3 * 4.3)).sqrt());
    near(score.reconstruction_rms_n, (100.0 * miss2 / 5.0).sqrt());
}

#[test]
fn the_advance_counts_from_the_surface_on_and_a_hold_at_its_end_belongs_to_it() {
    is_that_of_the_advance(&scored(&ADVANCE, |_| None));
}

#[test]
fn the_way_back_is_not_scored() {
    let mut samples = Vec::from(ADVANCE);
    samples.extend([at(0.029, 7.0, 9.0, 3.0), at(0.015, -8.0, 9.0, 5.0), at(0.001, 1.0, 1.0, 1.0)]);
    is_that_of_the_advance(&scored(&samples, |_| None));
}

#[test]
fn a_step_back_on_the_way_in_belongs_to_the_advance_once_the_needle_goes_deeper() {
    let samples = [at(0.012, 1.0, 0.1, 0.0), at(0.011, 2.0, 0.5, 0.0), at(0.013, 3.0, 0.2, 0.0)];
    near(scored(&samples[..2], |_| None).enhancement.rms_relative, 0.1);
    near(scored(&samples, |_| None).enhancement.rms_relative, ((0.01 + 0.25 + 0.04) / 14.0_f64).sqrt());
}

#[test]
fn what_a_run_never_does_has_no_score() {
    let air = scored(&ADVANCE[..1], |_| None);
    assert_eq!(air.enhancement.rms_relative, None);
    assert_eq!(air.enhancement.friction_rms_relative, None);
    assert_eq!(air.enhancement.in_tissue_relative, None);
    assert_eq!(air.reconstruction_rms_n, None);
    // Nor does a run that ends inside the tissue leave it.
    assert_eq!(scored(&ADVANCE[..3], |_| None).enhancement.after_exit_relative, None);
}

#[test]
fn the_band_holds_a_force_on_its_edge_and_samples_without_a_band_are_not_asked() {
    let band = |s: &At| match s.tip {
        0.5 => Some([0.5, 0.9]),
        2.0 => Some([1.0, 2.0]),
        3.0 => Some([3.1, 9.0]),
        0.25 => Some([-1.0, 0.2]),
        _ => None,
    };
    assert_eq!(scored(&ADVANCE, band).coverage.band, [2.0, 4.0]);
    assert_eq!(scored(&ADVANCE, |_| None).coverage.band, [0.0, 0.0]);
}
