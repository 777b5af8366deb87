//! Promise: the same phantom in other sizes and forces has the same answers, in the units of [`Units::for_extent`].

use crate::support::{constant, insertion, stylet};
use stylet_core::{Enhancer, Output, Sample, Units};
use stylet_tissue::Tissue;

fn run(samples: &[Sample]) -> (Units, Vec<Output>) {
    let z = |s: &Sample| s.position_m;
    let travel_m =
        samples.iter().map(z).fold(f64::MIN, f64::max) - samples.iter().map(z).fold(f64::MAX, f64::min);
    let change_n =
        samples.iter().map(|s| (s.force_n - samples[0].force_n).abs()).sum::<f64>() / samples.len() as f64;
    let units = Units::for_extent(travel_m, change_n);
    let mut core = Enhancer::with_units(stylet(), 0.0, units, []);
    (units, samples.iter().map(|s| core.step(*s)).collect())
}

fn near(a: f64, b: f64, what: &str) {
    assert!((a - b).abs() <= 1e-6 * a.abs().max(b.abs()).max(1e-9), "{what}: {a} and {b}");
}

#[test]
fn lengths_and_forces_of_any_size_give_the_same_answers() {
    let ripple = |t: f64| 0.0023 + 0.001 * (0.7 * t).sin();
    for data in [constant(0.02, 1), insertion(&Tissue::three_gels(), -0.005, 45.0, 200.0, 0.02, 2, ripple)] {
        let (si, plain) = run(&data.samples);
        assert_eq!(si, Units::default());
        assert_eq!(plain.iter().filter(|o| o.detection.is_some()).count(), 3);
        for (length, force) in [(1e-3, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-3, 1e-3), (1e-3, 1e3)] {
            let samples: Vec<Sample> = data
                .samples
                .iter()
                .map(|s| Sample {
                    time_s: s.time_s,
                    position_m: length * s.position_m,
                    velocity_mps: length * s.velocity_mps,
                    force_n: force * s.force_n,
                })
                .collect();
            let (units, scaled) = run(&samples);
            assert_eq!(units, Units { length_m: length, force_n: force });
            let what = format!("{length} and {force}");
            for (a, b) in plain.iter().zip(&scaled) {
                assert_eq!((a.state, a.ruptures, a.used), (b.state, b.ruptures, b.used), "{what}");
                near(force * a.enhanced_n, b.enhanced_n, &what);
                near(length * a.contact_m.unwrap_or(0.0), b.contact_m.unwrap_or(0.0), &what);
                if let (Some(a), Some(b)) = (a.estimate, b.estimate) {
                    near(force / length * a.stiffness_n_per_m, b.stiffness_n_per_m, &what);
                    near(force / length * a.stiffness_sd, b.stiffness_sd, &what);
                    near(force / (length * length) * a.friction, b.friction, &what);
                    near(length * a.thickness_m, b.thickness_m, &what);
                }
            }
        }
    }
}
