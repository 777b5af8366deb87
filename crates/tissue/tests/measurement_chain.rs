//! Promise: the recorded force is the tissue's force through tool and sensor in the order of
//! docs/reference/model.md (Measurement chain), at any sampling, without allocation per sample.

use crate::common;
use common::*;
use proptest::prelude::*;
use stylet_tissue::*;

/// Records a force given as a function of time, sampled at `times`.
fn record(effects: &[AnyEffect], times: &[f64], force: impl Fn(f64) -> f64) -> Vec<f64> {
    let chain = MeasurementChain::new(effects);
    let mut state = chain.start(times.len() as f64 / (times[times.len() - 1] - times[0]));
    times
        .iter()
        .map(|&time_s| {
            chain.step(&mut state, &SensorInput { time_s, tissue_n: force(time_s), ..SensorInput::default() })
        })
        .collect()
}

fn regular(rate: f64, seconds: f64) -> Vec<f64> {
    (0..=(rate * seconds) as usize).map(|k| k as f64 / rate).collect()
}

#[test]
fn tool_effects_follow_the_bases_motion_in_air_too() {
    let chain =
        MeasurementChain::new(&[ToolInertia { mass_kg: 0.3 }.into(), DriveFriction { force_n: 0.5 }.into()]);
    let mut state = chain.start(200.0);
    for (v, a, expected) in [(0.002, 1.0, 0.8), (-0.002, -1.0, -0.8), (0.0, 2.0, 0.6), (1e-5, 0.0, 0.0)] {
        let reading = SensorInput { velocity_mps: v, acceleration_mps2: a, ..SensorInput::default() };
        near(chain.step(&mut state, &reading), expected, 1e-15);
    }
}

#[test]
fn a_force_linear_in_position_is_zero_at_its_rest_position_in_air_too() {
    let chain =
        MeasurementChain::new(&[PositionDependentForce { stiffness_n_per_m: -20.0, rest_m: -0.01 }.into()]);
    let mut state = chain.start(200.0);
    for (position_m, expected) in [(-0.01, 0.0), (0.0, -0.2), (0.04, -1.0), (-0.02, 0.2)] {
        let reading = SensorInput { position_m, velocity_mps: 0.01, ..SensorInput::default() };
        near(chain.step(&mut state, &reading), expected, 1e-15);
    }
}

#[test]
fn steps_of_the_zero_add_up_and_count_in_a_mean_by_the_time_after_them() {
    let step = |time_s: f64, step_n: f64| ZeroStep { time_s, step_n }.into();
    let chain = MeasurementChain::new(&[step(1.0, 0.3), step(2.0, -0.5)]);
    let mut state = chain.start(200.0);
    let mean = |time_s, state: &mut _| {
        chain.mean_force(state, &AveragingInterval { time_s, span_s: 0.02, ..AveragingInterval::default() })
    };
    for (time_s, expected) in
        [(0.9, 0.0), (0.995, 0.075), (1.0, 0.15), (1.5, 0.3), (2.005, -0.075), (3.0, -0.2)]
    {
        near(mean(time_s, &mut state), expected, 1e-12);
    }
}

#[test]
fn each_effect_of_the_sensor_is_its_equation() {
    let times = regular(100.0, 2.0);
    let force = |t: f64| 3.0 * (2.0 * t).sin();
    type Expected<'a> = &'a dyn Fn(f64, f64) -> f64; // of force and time
    let checks: [(AnyEffect, Expected); 7] = [
        (ForceGain { eps: 0.1 }.into(), &|f, _| 1.1 * f),
        (ForceBias { force_n: -0.2 }.into(), &|f, _| f - 0.2),
        (ForceDrift { rate_n_per_s: 0.05 }.into(), &|f, t| f + 0.05 * t),
        (ZeroStep { time_s: 0.795, step_n: -0.4 }.into(), &|f, t| if t < 0.795 { f } else { f - 0.4 }),
        (PeriodicInterference { amplitude_n: 0.3, frequency_hz: 7.0, phase_rad: 0.5 }.into(), &|f, t| {
            f + 0.3 * (std::f64::consts::TAU * 7.0 * t + 0.5).sin()
        }),
        (Saturation { limit_n: 1.5 }.into(), &|f, _| f.clamp(-1.5, 1.5)),
        (Quantisation { step_n: 0.25 }.into(), &|f, _| (f / 0.25).round() * 0.25),
    ];
    for (effect, expected) in checks {
        for (&t, f) in times.iter().zip(record(std::slice::from_ref(&effect), &times, force)) {
            near(f, expected(force(t), t), 1e-12);
        }
    }
}

#[test]
fn the_lag_is_first_order_exactly_at_any_sampling() {
    let tau = 0.2;
    let lag = [LowPassLag { time_constant_s: tau }.into()];
    for rate in [4.0, 30.0, 1000.0] {
        let times = regular(rate, 3.0);
        // A ramp from rest.
        for (&t, f) in times.iter().zip(record(&lag, &times, |t| 2.0 * t)) {
            near(f, 2.0 * (t - tau * (1.0 - (-t / tau).exp())), 1e-12);
        }
    }
    // After a jump, held: y += (1 - exp(-dt/tau)) (f - y) from the sample behind the jump on.
    let times = regular(50.0, 2.0);
    let y = record(&lag, &times, |t| if t < 1.0 { 0.0 } else { 1.0 });
    for k in 51..times.len() {
        near(y[k], y[k - 1] + (1.0 - (-0.02f64 / tau).exp()) * (1.0 - y[k - 1]), 1e-12);
    }
    near(record(&lag, &times, |_| 3.0)[0], 3.0, 0.0);
}

#[test]
fn a_delay_is_exact_for_a_force_that_is_linear_between_samples() {
    let delay = [TimeDelay { delay_s: 0.0337 }.into()];
    for rate in [20.0, 30.0, 200.0, 1234.5] {
        let times = regular(rate, 2.0);
        for (&t, f) in times.iter().zip(record(&delay, &times, |t| 1.0 + 2.0 * t)) {
            near(f, 1.0 + 2.0 * (t - 0.0337).max(0.0), 1e-12);
        }
    }
    // Two delays add up; irregular samples; a history too short gives the oldest it has.
    let two = [TimeDelay { delay_s: 0.02 }.into(), TimeDelay { delay_s: 0.0137 }.into()];
    let mut times = regular(100.0, 1.0);
    times.iter_mut().enumerate().for_each(|(k, t)| *t += 0.004 * (k as f64 * 1.7).sin());
    let chain = MeasurementChain::new(&two);
    let mut state = chain.start(200.0);
    let mut short = chain.start(1.0);
    for (k, &t) in times.iter().enumerate() {
        let reading = SensorInput { time_s: t, tissue_n: t, ..SensorInput::default() };
        near(chain.step(&mut state, &reading), (t - 0.0337).max(times[0]), 1e-12);
        near(chain.step(&mut short, &reading), (t - 0.0337).max(times[k.saturating_sub(3)]), 1e-12);
    }
}

#[test]
fn the_order_of_the_chain_does_not_depend_on_the_order_of_the_list() {
    let mut effects: Vec<AnyEffect> = vec![
        Quantisation { step_n: 0.5 }.into(),
        Saturation { limit_n: 4.2 }.into(),
        ForceBias { force_n: 1.0 }.into(),
        ForceGain { eps: 1.0 }.into(),
        ToolInertia { mass_kg: 1.0 }.into(),
        ForceSpikes { rate_hz: 1.0, size_n: 5.0 }.into(),
    ];
    for _ in 0..effects.len() {
        effects.rotate_left(1);
        let chain = MeasurementChain::new(&effects);
        let mut state = chain.start(200.0);
        let mut at = |tissue_n, acceleration_mps2, noise_n| {
            chain.step(
                &mut state,
                &SensorInput { tissue_n, acceleration_mps2, noise_n, ..SensorInput::default() },
            )
        };
        near(at(1.0, 0.1, 0.0), 3.0, 1e-12); // (1 + 0.1) 2 + 1 = 3.2 -> 3.0
        near(at(1.0, 0.1, 0.2), 3.5, 1e-12); // the noise is rounded as well
        near(at(3.0, 0.0, 9.0), 4.0, 1e-12); // cut at 4.2, then rounded
    }
}

#[test]
fn recorded_positions_are_scaled_and_can_be_scaled_back() {
    let chain = MeasurementChain::new(&[PositionScale { eps: -0.02 }.into()]);
    near(chain.recorded_position(0.1), 0.098, 1e-15);
    near(chain.true_position(chain.recorded_position(0.0437)), 0.0437, 1e-15);
    assert!(chain.is_plain(), "positions do not touch the force");
}

proptest! {
    /// Lag and delay together at a random jitter stay within the force's range: no overshoot.
    #[test]
    fn lag_and_delay_never_leave_the_range_of_the_force(
        steps in proptest::collection::vec((0.0f64..0.05, -5.0f64..5.0), 2..300), tau in 0.0f64..1.0, delay in 0.0f64..0.3,
    ) {
        let chain = MeasurementChain::new(&[LowPassLag { time_constant_s: tau }.into(), TimeDelay { delay_s: delay }.into()]);
        let mut state = chain.start(200.0);
        let mut time_s = 0.0;
        for (dt, tissue_n) in steps {
            time_s += dt;
            let f = chain.step(&mut state, &SensorInput { time_s, tissue_n, ..SensorInput::default() });
            prop_assert!(f.abs() <= 5.0 + 1e-12);
        }
    }
}

#[test]
fn the_mean_over_intervals_is_that_of_many_samples() {
    let effects: Vec<AnyEffect> = vec![
        ToolInertia { mass_kg: 0.3 }.into(),
        DriveFriction { force_n: 0.2 }.into(),
        ForceGain { eps: 0.1 }.into(),
        LowPassLag { time_constant_s: 0.03 }.into(),
        ForceBias { force_n: -0.4 }.into(),
        ForceDrift { rate_n_per_s: 0.05 }.into(),
        PeriodicInterference { amplitude_n: 0.3, frequency_hz: 7.0, phase_rad: 0.5 }.into(),
    ];
    let chain = MeasurementChain::new(&effects);
    let (mut fine, mut coarse) = (chain.start(1e5), chain.start(50.0));
    // Spans of 20 ms in which the force stays what it is; many readings in each.
    let (span_s, readings) = (0.02, 4000);
    for k in 0..30 {
        let (tissue_n, acceleration_mps2) = (if k < 10 { 1.0 } else { 3.0 }, if k < 20 { 0.5 } else { -1.0 });
        let mut sum = 0.0;
        for i in 0..readings {
            let time_s = span_s * (f64::from(k) + (f64::from(i) + 0.5) / f64::from(readings));
            sum += chain.step(
                &mut fine,
                &SensorInput {
                    time_s,
                    position_m: 0.0,
                    velocity_mps: 0.01,
                    acceleration_mps2,
                    tissue_n,
                    noise_n: 0.0,
                },
            );
        }
        let cell = AveragingInterval {
            position_m: 0.0,
            time_s: span_s * (f64::from(k) + 0.5),
            span_s,
            samples: f64::from(readings),
            velocity_mps: 0.01,
            acceleration_mps2,
            tissue_n,
        };
        near(chain.mean_force(&mut coarse, &cell), sum / f64::from(readings), 5e-4);
    }
}

#[test]
fn a_chain_reports_its_delay_and_whether_it_has_a_lag() {
    let two =
        MeasurementChain::new(&[TimeDelay { delay_s: 0.02 }.into(), TimeDelay { delay_s: 0.0137 }.into()]);
    near(two.delay_s(), 0.0337, 1e-17);
    assert!(!two.has_lag() && !two.is_plain());
    let lag =
        MeasurementChain::new(&[LowPassLag { time_constant_s: 0.1 }.into(), ForceGain { eps: 0.1 }.into()]);
    assert!(lag.has_lag() && lag.delay_s() == 0.0);
    assert!(!MeasurementChain::new(&[ForceGain { eps: 0.1 }.into()]).has_lag());
    for effect in [
        AnyEffect::from(ToolInertia { mass_kg: 0.3 }),
        ForceGain { eps: 0.1 }.into(),
        TimeDelay { delay_s: 0.01 }.into(),
        ForceBias { force_n: 0.1 }.into(),
        Saturation { limit_n: 5.0 }.into(),
    ] {
        assert!(!MeasurementChain::new(&[effect]).is_plain());
    }
    assert!(
        MeasurementChain::new(&[CoulombFriction { c_n_per_m: 5.0 }.into()]).is_plain(),
        "that acts in the tissue"
    );
}

#[test]
fn the_delay_buffer_is_sized_by_the_rate_and_a_repeated_time_stamp_is_a_zero_step() {
    // 0.1 s at 100 Hz, exactly at a sample and between two; jumps are sharp to one sample.
    for (delay_s, at) in [(0.1, 60), (0.105, 61)] {
        let times = regular(100.0, 1.0);
        let force = |t: f64| if t < 0.5 { 0.0 } else { 1.0 };
        let late = record(&[TimeDelay { delay_s }.into()], &times, force);
        assert_eq!(late.iter().filter(|f| **f == 1.0).count(), times.len() - at, "{delay_s}");
        near(late[60], if delay_s > 0.1 { 0.5 } else { 1.0 }, 1e-9);
    }
    let lag = MeasurementChain::new(&[LowPassLag { time_constant_s: 0.1 }.into()]);
    let mut state = lag.start(100.0);
    let mut at =
        |time_s, tissue_n| lag.step(&mut state, &SensorInput { time_s, tissue_n, ..SensorInput::default() });
    assert_eq!([at(5.0, 1.0), at(5.0, 9.0), at(4.0, 9.0)], [1.0; 3]);
}
