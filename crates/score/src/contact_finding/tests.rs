use super::*;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// One layer of 60 N/m whose surface is at zero and that ruptures at 18 mm, behind which only half of the force is left; 2 mm/s
/// from `start_m` on, with noise of 20 mN and what is added at a time and place.
fn finding(start_m: f64, end_m: f64, contact: Contact, added: impl Fn(f64, f64) -> f64) -> ContactFinding {
    let config = EnhanceConfig { contact, ..EnhanceConfig::default() };
    let mut assessor = ContactAssessor::new(&config, 0.0, Units::default());
    let mut core = Enhancer::new(config, 0.0, []);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for k in 0..((end_m - start_m) / 1e-5) as u32 {
        let (time_s, position_m) = (0.005 * f64::from(k), start_m + 1e-5 * f64::from(k));
        let z = position_m.max(0.0);
        let tissue_n = if z < 0.018 { 60.0 * z } else { 0.54 };
        let w: f64 = StandardNormal.sample(&mut rng);
        let force_n = tissue_n + 0.02 * w + added(time_s, position_m);
        let sample = Sample { time_s, position_m, velocity_mps: 0.002, force_n };
        let out = core.step(sample);
        assessor.push(&sample, &out);
    }
    assessor.finish(contact)
}

#[test]
fn every_beginning_has_its_hypothesis_and_the_setting_is_named() {
    use ContactHypothesis as H;
    let auto = Contact::Detected;
    let none = |_: f64, _: f64| 0.0;
    let cases: [(ContactFinding, &[H], &str); 7] = [
        (finding(-0.01, 0.015, auto, none), &[H::ConstantOffset], "--contact auto"),
        (finding(-0.01, 0.015, auto, |t, _| 0.02 * t), &[H::DriftOrLine], "one speed"),
        (finding(-0.01, 0.015, auto, |t, _| if t < 2.0 { 1.0 } else { 0.0 }), &[H::ZeroStep], "1 step(s)"),
        (finding(0.002, 0.03, auto, none), &[H::BeginsLoaded], "as with --contact none"),
        (finding(0.002, 0.03, Contact::None, none), &[H::BeginsLoaded], "--contact none"),
        (finding(-0.02, -0.005, auto, |t, _| 0.02 * t), &[H::NeverTouches], "never touches"),
        (finding(-0.01, 0.015, Contact::Known, none), &[H::ConstantOffset], "--contact known"),
    ];
    for (found, expected, words) in cases {
        assert!(expected.contains(&found.hypothesis), "{found:?}");
        assert!(found.sentence().contains(words), "{}", found.sentence());
        let touches = [H::ConstantOffset, H::DriftOrLine, H::ZeroStep].contains(&found.hypothesis);
        if touches {
            let contact_m = found.contact_m.expect("a contact");
            assert!(contact_m.abs() < 5e-4, "{contact_m} in {found:?}");
        }
        if touches && found.setting == "auto" {
            let [low, high] = found.contact_interval_m.expect("an interval");
            assert!(low < high && high - low < 2e-3, "{found:?}");
            assert!(found.probability.is_some_and(|p| p > 0.99), "{found:?}");
        }
    }
}

/// The inputs that gave wrong contacts: a sensor zeroed in air, a drift, a cable, a sensor that was not zeroed.
#[test]
fn steps_drifts_lines_and_offsets_leave_the_contact_where_it_is() {
    use ContactHypothesis as H;
    type Added = Box<dyn Fn(f64, f64) -> f64>;
    let mut cases: Vec<(String, Added, &[H])> = Vec::new();
    for size_n in [0.3, 1.0, -4.0] {
        cases.push((
            format!("step {size_n}"),
            Box::new(move |t, _| if t < 2.0 { size_n } else { 0.0 }),
            &[H::ZeroStep],
        ));
    }
    for rate in [0.01, 0.026, -0.026] {
        cases.push((format!("drift {rate}"), Box::new(move |t, _| rate * t), &[H::DriftOrLine]));
    }
    for slope in [5.0, 20.0] {
        cases.push((format!("line {slope}"), Box::new(move |_, z| slope * z), &[H::DriftOrLine]));
    }
    for offset_n in [-8.0, 20.0] {
        cases.push((format!("offset {offset_n}"), Box::new(move |_, _| offset_n), &[H::ConstantOffset]));
    }
    for (name, added, expected) in cases {
        let found = finding(-0.01, 0.0185, Contact::Detected, added);
        assert!(expected.contains(&found.hypothesis), "{name}: {found:?}");
        let contact_m = found.contact_m.expect("a contact");
        assert!(contact_m.abs() < 3e-4, "{name}: {contact_m} m");
    }
}

#[test]
fn a_step_of_the_zero_in_tissue_is_reported_and_no_contact() {
    for size_n in [0.3, -0.9, 2.0] {
        let found = finding(-0.01, 0.015, Contact::Detected, move |t, _| if t < 9.0 { 0.0 } else { size_n });
        assert_eq!(found.hypothesis, ContactHypothesis::ConstantOffset, "{found:?}");
        assert_eq!(found.zero_steps.len(), 1, "{size_n}: {:?}", found.zero_steps);
        let step = found.zero_steps[0];
        assert!(step.in_tissue && (step.size_n - size_n).abs() < 0.1, "{step:?}");
        assert!((step.time_s - 9.0).abs() < 0.02, "{step:?}");
        assert!(found.contact_m.is_some_and(|z| z.abs() < 5e-4), "{found:?}");
    }
}

#[test]
fn the_sampling_rate_does_not_decide_whether_a_recording_begins_loaded() {
    let nats = |count: u32, interval_s: f64| {
        let mut errors = Errors::default();
        (0..count).for_each(|_| errors.push(0.0103, 0.0, 0.01, interval_s));
        errors.nats(errors.air_n2)
    };
    let (usual, fast) = (nats(2000, 5e-3), nats(100_000, 1e-4));
    assert!(usual > MIN_LOADED_NATS && (usual / fast - 1.0).abs() < 1e-6, "{usual} and {fast}");
}
