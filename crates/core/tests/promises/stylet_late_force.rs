//! Promise of `algorithm: Stylet` for a force that is recorded late: the friction that it loses after a stop is no rupture.

use crate::support::{Insertion, detections, enhance, gels, insertion, stylet};

const HZ: f64 = 200.0;

/// The paper's gels at 2.3 mm/s, with a stop of 3 s in the second layer.
fn with_stop(seed: u64) -> Insertion {
    let speed = |t: f64| if (18.0..21.0).contains(&t) { 0.0 } else { 0.0023 };
    insertion(&gels(), -0.005, 52.0, HZ, 0.02, seed, speed)
}

/// Records the force `samples` later.
fn late(mut data: Insertion, samples: usize) -> Insertion {
    for k in (samples..data.samples.len()).rev() {
        data.samples[k].force_n = data.samples[k - samples].force_n;
    }
    data
}

#[test]
fn friction_that_a_late_force_loses_after_a_stop_is_no_rupture() {
    for seed in 0..10 {
        for samples in [0, 1, 3, 6] {
            let data = late(with_stop(seed), samples);
            let found = detections(&enhance(&stylet(), &data.samples));
            assert_eq!(found.len(), 3, "seed {seed}, {samples} samples late: {found:?}");
        }
    }
}
