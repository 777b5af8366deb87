use super::*;

const DT_S: f64 = 0.005;
const SPEED_MPS: f64 = 0.0023;

/// Status per sample for 40 N/m from the surface at zero, with bias and noise, starting 5 mm before.
fn search(
    config: &ContactConfig,
    bias_n: f64,
    noise_n: f64,
    drift_n_per_s: f64,
) -> alloc::vec::Vec<ContactStatus> {
    let mut search = ContactDetector::new(config);
    (0..1000_u64)
        .map(|k| {
            let time_s = DT_S * k as f64;
            let position_m = -0.005 + SPEED_MPS * time_s;
            let noise = noise_n * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
            let drift_n = drift_n_per_s * time_s.min(0.005 / SPEED_MPS);
            let force_n = bias_n + drift_n + noise + 40.0 * position_m.max(0.0);
            search.update(config, DT_S, Sample { time_s, position_m, velocity_mps: SPEED_MPS, force_n }, k)
        })
        .collect()
}

/// Samples of declaration and settlement, and the surface.
fn found(all: &[ContactStatus]) -> (usize, usize, f64) {
    let declared = all.iter().position(|f| *f != ContactStatus::InAir).expect("a contact");
    let settled = all.iter().position(|f| matches!(f, ContactStatus::Settled { .. })).expect("settled");
    let ContactStatus::Settled { surface_m, .. } = all[settled] else { unreachable!() };
    (declared, settled, surface_m)
}

#[test]
fn the_surface_is_where_the_loading_line_starts_for_any_bias_and_noise() {
    let config = ContactConfig::default();
    for (bias_n, noise_n) in [(0.0, 0.0), (0.0, 0.02), (-1.5, 0.02), (3.0, 0.005)] {
        let (declared, settled, surface_m) = found(&search(&config, bias_n, noise_n, 0.0));
        assert!(surface_m.abs() < 1e-4 + 5e-3 * noise_n, "{surface_m} m at {bias_n} N, {noise_n} N");
        // Not in air, and settled a millimetre after the declaration.
        assert!(DT_S * declared as f64 * SPEED_MPS > 0.005, "declared at {declared}");
        let travel_m = (settled - declared) as f64 * DT_S * SPEED_MPS;
        assert!((0.001..0.001 + 2.0 * DT_S * SPEED_MPS).contains(&travel_m), "{travel_m} m");
    }
}

#[test]
fn a_slow_drift_in_air_is_tracked_and_is_no_contact() {
    // 10 mN/s: twice the noise within the two seconds in air.
    let (declared, _, surface_m) = found(&search(&ContactConfig::default(), 0.0, 0.01, 0.01));
    assert!(DT_S * declared as f64 * SPEED_MPS > 0.005 && surface_m.abs() < 1e-3, "{surface_m} m");
}

#[test]
fn without_extrapolation_the_surface_is_where_contact_was_declared() {
    let config = ContactConfig { extrapolate_over_m: 0.0, ..ContactConfig::default() };
    let all = search(&config, 0.0, 0.02, 0.0);
    let (declared, settled, surface_m) = found(&all);
    assert_eq!(surface_m, -0.005 + SPEED_MPS * (DT_S * declared as f64));
    assert_eq!(settled, declared + 1);
}

#[test]
fn a_higher_threshold_or_more_samples_delay_the_contact() {
    let declared = |noise_sds: f64, samples: usize| {
        found(&search(&ContactConfig { noise_sds, samples, ..ContactConfig::default() }, 0.0, 0.02, 0.0)).0
    };
    let usual = declared(5.0, 5);
    assert_eq!(declared(5.0, 25), usual + 20);
    // Five more standard deviations, 0.02/sqrt(3) N each, at 40 N/m are 1.44 mm: 125 samples.
    assert!((115..=135).contains(&(declared(10.0, 5) - usual)), "{} {usual}", declared(10.0, 5));
}

#[test]
fn contact_is_not_declared_while_bias_and_noise_are_learned() {
    // Starting at the surface, the load of the first second counts as bias.
    let config = ContactConfig { learn_s: 1.0, ..ContactConfig::default() };
    let mut search = ContactDetector::new(&config);
    for k in 0..190_u64 {
        let force_n = if k < 20 { 0.0 } else { 0.5 };
        let found = search.update(&config, DT_S, Sample { force_n, ..Sample::default() }, k);
        assert_eq!(found, ContactStatus::InAir, "sample {k}");
    }
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
}

/// Noise of 0.1 N and bias 0.3 N from twenty samples, with this low-passed force.
fn known(force_n: f64) -> (ContactConfig, ContactDetector) {
    let config = ContactConfig::default();
    let mut search = ContactDetector::new(&config);
    (search.count, search.mean_n, search.m2) = (20.0, 0.3, 0.19);
    (search.elapsed_s, search.force_n) = (1.0, force_n);
    (config, search)
}

fn at(position_m: f64, force_n: f64) -> Sample {
    Sample { position_m, force_n, ..Sample::default() }
}

#[test]
fn bias_and_noise_are_sample_moments_at_first_and_then_forget_slowly() {
    let config = ContactConfig::default();
    let mut search = ContactDetector::new(&config);
    assert_eq!(search.noise_n(&config), f64::INFINITY);
    let forces_n = [0.7, 0.4, 0.9, 0.1, 0.6];
    search.learn(0.1, true, forces_n[0]);
    assert_eq!(search.noise_n(&config), f64::INFINITY);
    forces_n[1..].iter().for_each(|f| search.learn(0.1, true, *f));
    near(search.mean_n, 0.54);
    let squares: f64 = forces_n.iter().map(|f| (f - 0.54) * (f - 0.54)).sum();
    near(search.noise_n(&config), (squares / 4.0).sqrt());
    let (config, mut search) = known(0.3);
    near(search.noise_n(&config), 0.1);
    search.learn(0.1, false, 0.5);
    near(search.mean_n, 0.32);
    // The variance moves by a tenth from 0.01 towards 0.04.
    near(search.noise_n(&config), 0.013_f64.sqrt());
    assert_eq!(search.count, 20.0);
    search.m2 = 0.0;
    assert_eq!(search.noise_n(&config), 1e-4);
}

#[test]
fn the_force_is_low_passed_from_the_first_sample_on() {
    let (config, mut search) = known(0.3);
    search.update(&config, 0.005, at(0.001, 0.4), 7);
    near(search.force_n, 0.3 + 0.1 * (1.0 - (-0.1_f64).exp()));
    near(search.elapsed_s, 1.005);
    let mut fresh = ContactDetector::new(&config);
    fresh.update(&config, 0.0, at(0.0, 5.0), 0);
    assert_eq!((fresh.force_n, fresh.mean_n), (5.0, 5.0));
}

#[test]
fn a_loading_line_begins_at_two_standard_deviations_and_contact_is_counted_from_five() {
    // Rise over the bias, and whether it belongs to the line and counts towards contact.
    for (lift_n, line, above) in
        [(0.19, 0.0, 0), (0.21, 1.0, 0), (0.49, 1.0, 0), (0.51, 1.0, 1), (-0.6, 0.0, 0)]
    {
        let force_n = 0.3 + lift_n;
        let (config, mut search) = known(force_n);
        assert_eq!(search.update(&config, 0.005, at(0.001, force_n), 7), ContactStatus::InAir);
        assert_eq!((search.line.count, search.samples_above), (line, above), "{lift_n} N");
        assert_eq!(search.first, if line > 0.0 { 7 } else { 0 });
        // Samples of the line are not learned as noise.
        assert_eq!(search.mean_n == 0.3, line > 0.0);
        // The line continues, or is discarded.
        search.force_n = force_n;
        search.update(&config, 0.005, at(0.001, force_n), 8);
        assert!(search.line.count == 2.0 * line && search.samples_above == 2 * above);
        search.force_n = 0.3;
        search.update(&config, 0.005, at(0.001, 0.3), 9);
        assert_eq!((search.line.count, search.samples_above), (0.0, 0));
    }
    // Learning lasts for a quarter of a second and ten samples.
    for (elapsed_s, count, learning) in
        [(0.24, 20.0, true), (0.246, 20.0, false), (1.0, 9.0, true), (1.0, 10.0, false)]
    {
        let (config, mut search) = known(0.9);
        (search.elapsed_s, search.count) = (elapsed_s, count);
        search.m2 = 0.01 * (count - 1.0);
        search.update(&config, 0.005, at(0.001, 0.9), 7);
        assert_eq!(
            (search.samples_above == 0, search.count > count),
            (learning, learning),
            "{elapsed_s} {count}"
        );
    }
}

#[test]
fn contact_is_declared_after_enough_samples_and_final_after_the_travel() {
    for (samples, needed) in [(3, 3), (1, 1), (0, 1)] {
        let (mut config, mut search) = known(0.9);
        config.samples = samples;
        for k in 1..needed {
            assert_eq!(search.update(&config, 0.005, at(0.001, 0.9), k), ContactStatus::InAir);
        }
        let found = search.update(&config, 0.005, at(0.0012, 0.9), needed);
        assert!(matches!(found, ContactStatus::Provisional { first: 1, .. }), "{found:?}");
        assert_eq!(search.declared_m, Some(0.0012));
        for (position_m, settled) in
            [(0.0015, false), (0.002, false), (0.0003, false), (0.0023, true), (0.0001, true)]
        {
            let mut search = search;
            let found = search.update(&config, 0.005, at(position_m, 1.3), 9);
            assert_eq!(matches!(found, ContactStatus::Settled { first: 1, .. }), settled, "{position_m} m");
            assert_eq!(search.mean_n, 0.3, "nothing more is learned of the air");
        }
    }
}

#[test]
fn the_surface_is_where_the_line_meets_the_bias_at_most_five_millimetres_back() {
    // Slope, where the line reaches 0.3 N, and the surface for a contact declared at 10 mm.
    for (slope, zero_m, surface_m) in [
        (40.0, 0.0083, 0.0083),
        (40.0, 0.001, 0.005),
        (40.0, 0.012, 0.01),
        (-40.0, 0.0083, 0.01),
        (0.0, 0.0, 0.01),
    ] {
        let (mut config, mut search) = known(0.3);
        assert_eq!(search.surface_m(&config, 0.01), 0.01, "no line");
        for x in [0.0097, 0.0101, 0.0109] {
            search.line.add(x, 0.3 + slope * (x - zero_m));
        }
        assert!((search.surface_m(&config, 0.01) - surface_m).abs() < 1e-12);
        config.extrapolate_over_m = 0.0;
        assert_eq!(search.surface_m(&config, 0.01), 0.01);
    }
}
