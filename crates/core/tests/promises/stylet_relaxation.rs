//! Promise of `algorithm: Stylet`: the contact is where the load begins, also in tissue that relaxes, where the loading curve of the layer
//! does not extrapolate to it.

use crate::support::{Insertion, detections, enhance, insertion_into, stylet};
use stylet_tissue::{ForceLaw, PronyTerm, StressRelaxation, Tissue};

const INSERTIONS: u64 = 20;
/// Smallest number with the contact within 0.5 mm of the surface.
const NEAR: usize = 19;

/// Three gels that relax by `fraction`, at a constant 3 mm/s.
fn relaxing(fraction: f64, time_constant_s: f64, seed: u64) -> Insertion {
    let terms = vec![PronyTerm { fraction, time_constant_s }];
    let law = ForceLaw::new(&Tissue::three_gels(), &[StressRelaxation { terms }.into()]).expect("one effect");
    insertion_into(&law, -0.005, 14.0, 200.0, 0.015, seed, |_| 0.003)
}

#[test]
fn relaxation_does_not_move_the_contact() {
    for (fraction, time_constant_s) in [(0.0, 1.0), (0.85, 1.0), (0.85, 3.0), (0.6, 2.0)] {
        let (mut near, mut covered) = (0, 0);
        let mut all = Vec::new();
        for seed in 0..INSERTIONS {
            let data = relaxing(fraction, time_constant_s, seed);
            let outputs = enhance(&stylet(), &data.samples);
            assert!(!detections(&outputs).is_empty(), "a rupture, which revises the contact");
            let last = outputs.last().expect("outputs");
            let contact_m = last.contact_m.expect("a contact");
            near += usize::from(contact_m.abs() < 0.5e-3);
            covered += usize::from(contact_m.abs() < 3.0 * last.contact_sd_m);
            all.push(1e3 * contact_m);
        }
        assert!(near >= NEAR, "{fraction} in {time_constant_s} s: {near} of {INSERTIONS}: {all:.2?} mm");
        assert!(covered >= NEAR, "{fraction} in {time_constant_s} s: {covered} within 3 sd: {all:.2?} mm");
    }
}
