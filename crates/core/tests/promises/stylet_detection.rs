//! Promise of `algorithm: Stylet` on simulated insertions: every rupture is detected within a few samples without false alarms,
//! with large noise, rippled speed and holds; stiffness and friction lie in their intervals; friction is compensated soon after a
//! drop.

use crate::support::{Insertion, constant, enhance, gels, insertion, last_estimates, sinusoid, stylet};
use stylet_core::{Output, Sample};
use stylet_tissue::Rupture;

/// Asserts that exactly the true ruptures are detected, each at most `latest_s` late.
fn assert_found(name: &str, ruptures: &[Rupture], outputs: &[Output], latest_s: f64) {
    let found: Vec<f64> = outputs.iter().filter_map(|o| o.detection).map(|d| d.time_s).collect();
    assert_eq!(found.len(), ruptures.len(), "{name}: {found:.3?} for {ruptures:?}");
    for (found, rupture) in found.iter().zip(ruptures) {
        let delay_s = found - rupture.time_s;
        assert!(
            (0.0..=latest_s).contains(&delay_s),
            "{name}: layer {} found {delay_s} s late",
            rupture.layer
        );
    }
}

#[test]
fn every_rupture_is_detected_without_false_alarms_where_the_papers_algorithm_breaks_down() {
    let hold = |t: f64| if (22.6..27.6).contains(&t) { 0.0 } else { 0.0023 };
    let ripple = |t: f64| 0.0023 * (1.0 + 0.6 * (std::f64::consts::TAU * 0.25 * t).sin());
    for seed in 0..10 {
        let cases: [(&str, Insertion); 6] = [
            ("0.02 N", constant(0.02, seed)),
            ("sinusoid", sinusoid(0.02, seed)),
            ("0.1 N", constant(0.1, seed)),
            ("sinusoid, 0.1 N", sinusoid(0.1, seed)),
            ("hold", insertion(&gels(), -0.005, 55.0, 200.0, 0.02, seed, hold)),
            ("ripple", insertion(&gels(), -0.005, 50.0, 200.0, 0.02, seed, ripple)),
        ];
        for (name, data) in &cases {
            assert_eq!(data.ruptures.len(), 3, "{name}");
            assert_found(name, &data.ruptures, &enhance(&stylet(), &data.samples), 0.011);
        }
    }
}

#[test]
fn a_drop_of_twice_the_noise_is_detected_before_the_predictor_absorbs_it() {
    // Drops of 0.1, 0.2 and 0.3 N with 0.05 N of noise.
    let mut tissue = gels();
    for (layer, drop_n) in tissue.layers.iter_mut().zip([0.1, 0.2, 0.3]) {
        layer.stiffness_n_per_m = drop_n / layer.thickness_m;
    }
    let mut delays_s = Vec::new();
    for seed in 0..60 {
        let data = insertion(&tissue, -0.005, 50.0, 200.0, 0.05, seed, |_| 0.0023);
        let outputs = enhance(&stylet(), &data.samples);
        assert_found("weak", &data.ruptures, &outputs, 0.2);
        let found = outputs.iter().find_map(|o| o.detection).expect("the first");
        delays_s.push(found.time_s - data.ruptures[0].time_s);
    }
    // The predictor alone takes two samples more.
    let mean_s = delays_s.iter().sum::<f64>() / delays_s.len() as f64;
    println!("mean delay of the first drop: {:.0} ms", 1e3 * mean_s);
    assert!(mean_s < 0.048, "{mean_s} s");
}

/// Velocities averaged over a tenth of a second, or with a first-order lag.
fn smoothed(samples: &[Sample], lagging: bool) -> Vec<Sample> {
    let mut lagged = samples[0].velocity_mps;
    (0..samples.len())
        .map(|k| {
            lagged += 0.1 * (samples[k].velocity_mps - lagged);
            let window = &samples[k.saturating_sub(10)..(k + 11).min(samples.len())];
            let mean = window.iter().map(|s| s.velocity_mps).sum::<f64>() / window.len() as f64;
            Sample { velocity_mps: if lagging { lagged } else { mean }, ..samples[k] }
        })
        .collect()
}

#[test]
fn a_stop_or_start_with_smoothed_or_delayed_velocity_is_no_rupture() {
    // Stops, starts and speed steps within one sample: friction changes at once.
    let speed = |t: f64| match t % 10.0 {
        t if t < 4.0 => 0.0023 + 0.001 * (1.3 * t).sin(),
        t if t < 5.0 => 0.0,
        t if t < 8.0 => 0.0035,
        _ => 0.0015,
    };
    for seed in 0..10 {
        // No layer ends within 0.3 s of a change, where log and positions disagree and nothing is declared.
        let data = insertion(&gels(), -0.006, 50.0, 200.0, 0.02, seed, speed);
        assert_eq!(data.ruptures.len(), 3);
        for late in [false, true] {
            let outputs = enhance(&stylet(), &smoothed(&data.samples, late));
            assert_found(if late { "late" } else { "smoothed" }, &data.ruptures, &outputs, 0.011);
        }
    }
}

#[test]
fn stiffness_and_friction_lie_in_their_intervals() {
    let tissue = gels();
    let (mut inside, mut of) = (0, 0);
    for seed in 0..20 {
        let data = insertion(&tissue, -0.005, 50.0, 200.0, 0.1, seed, |_| 0.0023);
        let found = last_estimates(&enhance(&stylet(), &data.samples));
        assert_eq!(found.len(), 3, "seed {seed}");
        for (e, layer) in found.iter().zip(&tissue.layers) {
            let k = (e.stiffness_n_per_m - layer.stiffness_n_per_m, e.stiffness_sd, layer.stiffness_n_per_m);
            let b = (e.friction - layer.friction_ns_per_m2, e.friction_sd, layer.friction_ns_per_m2);
            for (off, sd, truth) in [k, b] {
                assert!(off.abs() < 0.05 * truth, "seed {seed}: {e:?}");
                inside += usize::from(off.abs() <= 1.96 * sd);
                of += 1;
            }
        }
    }
    assert!((103..=120).contains(&inside), "{inside} of {of} in their 95 % intervals");
}

#[test]
fn friction_is_compensated_a_twentieth_of_a_second_after_the_drop() {
    let data = insertion(&gels(), -0.005, 50.0, 200.0, 0.02, 1, |_| 0.0023);
    let outputs = enhance(&stylet(), &data.samples);
    for rupture in &data.ruptures {
        let at = data.samples.iter().position(|s| s.time_s > rupture.time_s + 0.05).expect("it goes on");
        let off =
            outputs[at].enhanced_n - data.samples[at].force_n + data.truth[at].total_n - data.truth[at].tip_n;
        assert!(off.abs() < 0.05, "layer {}: friction is off by {off} N", rupture.layer);
    }
}

#[test]
fn an_impact_gives_no_layer_estimate() {
    // A step up and back: a knock against the robot.
    let mut data = insertion(&gels(), -0.005, 14.0, 200.0, 0.02, 1, |_| 0.0023);
    assert!(data.ruptures.is_empty());
    for s in &mut data.samples[1800..2000] {
        s.force_n += 1.0;
    }
    let found = last_estimates(&enhance(&stylet(), &data.samples));
    assert!(found.iter().all(|e| e.drop_n > 1.96 * e.drop_sd_n && e.drop_n > 0.0), "{found:?}");
}

#[test]
fn spikes_of_ten_newton_are_no_ruptures() {
    let mut data = constant(0.02, 4);
    for k in (900..9900).step_by(450) {
        data.samples[k].force_n += if k % 900 == 0 { 10.0 } else { -10.0 };
    }
    assert_found("spikes", &data.ruptures, &enhance(&stylet(), &data.samples), 0.016);
}

#[test]
fn retraction_raises_no_alarm_and_friction_is_compensated() {
    let back = |t: f64| if t < 25.0 { 0.0023 } else { -0.003 };
    let data = insertion(&gels(), -0.005, 42.0, 200.0, 0.01, 5, back);
    let outputs = enhance(&stylet(), &data.samples);
    let turn = 25 * 200;
    assert!(outputs[turn..].iter().all(|o| o.detection.is_none()));
    let rms = |v: &dyn Fn(usize) -> f64| {
        ((turn + 200..8000).map(|i| v(i) * v(i)).sum::<f64>() / (8000 - turn - 200) as f64).sqrt()
    };
    let raw = rms(&|i| data.samples[i].force_n - data.truth[i].tip_n);
    let residual = rms(&|i| outputs[i].enhanced_n - data.truth[i].tip_n);
    assert!(residual < 0.05 * raw, "{residual} N of {raw} N remains");
}

#[test]
fn a_configured_friction_law_compensates_dry_friction_in_a_hold() {
    let law = stylet_tissue::ForceLaw::new(
        &gels(),
        &[stylet_tissue::AnyEffect::CoulombFriction(stylet_tissue::CoulombFriction { c_n_per_m: 20.0 })],
    )
    .expect("one effect");
    let mut state = stylet_tissue::ForceLawState::default();
    let mut samples = Vec::new();
    let mut tip_n = Vec::new();
    let mut z = -0.005;
    for k in 0..9000 {
        let time_s = 0.005 * f64::from(k);
        let velocity_mps = 0.0023 + if time_s > 20.0 { 0.001 * (time_s - 20.0).sin() } else { 0.0 };
        let force = law.step(&mut state, time_s, z, velocity_mps, |_| {});
        let noise = 0.01 * (f64::from(k * 7919 % 101) / 50.0 - 1.0);
        samples.push(stylet_core::Sample {
            time_s,
            position_m: z,
            velocity_mps,
            force_n: force.total_n + noise,
        });
        tip_n.push(force.tip_n);
        z += velocity_mps * 0.005;
    }
    let mut config = stylet();
    let mean_b = (9000.0 * 28.2 + 12000.0 * 37.7 + 16000.0 * 32.2) / 98.1;
    config.stylet.friction_law = stylet_core::config::FrictionLaw::CoulombViscous { dry_mps: 20.0 / mean_b };
    let outputs = enhance(&config, &samples);
    let last = 6000..6500;
    let off = last.clone().map(|i| (outputs[i].enhanced_n - tip_n[i]).abs()).sum::<f64>() / 500.0;
    let raw = last.map(|i| (samples[i].force_n - tip_n[i]).abs()).sum::<f64>() / 500.0;
    assert!(off < 0.15 * raw, "{off} N off, {raw} N of friction");
}

#[test]
fn a_cable_that_moves_in_air_is_no_contact() {
    for seed in 0..20 {
        // 80 mN more from 2 mm before the surface on.
        let mut data = insertion(&gels(), -0.005, 50.0, 200.0, 0.01, seed, |_| 0.0023);
        for sample in data.samples.iter_mut().filter(|s| s.position_m > -0.002) {
            sample.force_n += 0.08;
        }
        let outputs = enhance(&stylet(), &data.samples);
        let steps: Vec<_> = outputs.iter().filter_map(|o| o.zero_step).collect();
        assert_eq!(steps.len(), 1, "seed {seed}: {steps:?}");
        assert!((steps[0].size_n - 0.08).abs() < 0.02 && !steps[0].in_tissue, "seed {seed}: {steps:?}");
        let before = data.samples.iter().zip(&outputs).filter(|(s, _)| s.position_m < -2e-4);
        assert!(
            before.clone().all(|(_, o)| o.contact_m.is_none()),
            "seed {seed}: the cable counts as contact"
        );
        let contact_m = outputs.last().and_then(|o| o.contact_m).expect("a contact");
        assert!(contact_m.abs() < 2e-4, "seed {seed}: {contact_m} m");
        assert_eq!(outputs.iter().filter(|o| o.detection.is_some()).count(), 3, "seed {seed}");
        let (first, stiffness) = (last_estimates(&outputs)[0], gels().layers[0].stiffness_n_per_m);
        let off = first.stiffness_n_per_m / stiffness - 1.0;
        assert!(off.abs() < 0.05, "seed {seed}: {off} of the first layer's stiffness");
    }
}
