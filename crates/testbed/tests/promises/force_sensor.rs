//! The noise has the standard deviation and autocorrelation of the scenario, limits hold, effects of tool, sensor and position act, and the same
//! seed gives the same readings.

use stylet_scenario::ForceTorque;
use stylet_testbed::{ForceSensor, InsertionSample};
use stylet_tissue::*;

const HZ: f64 = 200.0;

fn read(effects: &[AnyEffect], sensor: &ForceTorque, seed: u64, force_n: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut force_sensor = ForceSensor::new(effects, sensor, seed, HZ);
    (0..40_000)
        .map(|k| {
            let time_s = f64::from(k) / HZ;
            force_sensor.measure(&InsertionSample {
                time_s,
                position_m: 0.0,
                velocity_mps: 0.002,
                acceleration_mps2: 0.5,
                force: TissueForce { total_n: force_n(time_s), ..TissueForce::default() },
            })
        })
        .collect()
}

fn still() -> ForceTorque {
    ForceTorque { noise_n: 0.0, ..ForceTorque::default() }
}

fn sd(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

fn lag_one(values: &[f64]) -> f64 {
    values.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / values.iter().map(|x| x * x).sum::<f64>()
}

#[test]
fn noise_has_its_standard_deviation_and_autocorrelation() {
    for ar1 in [0.0, 0.5, 0.9] {
        let noise = read(&[], &ForceTorque { noise_n: 0.05, ar1, ..ForceTorque::default() }, 3, |_| 0.0);
        assert!((sd(&noise) / 0.05 - 1.0).abs() < 0.05, "ar1 {ar1}: sd {}", sd(&noise));
        assert!((lag_one(&noise) - ar1).abs() < 0.03, "ar1 {ar1}: lag-one correlation {}", lag_one(&noise));
    }
}

#[test]
fn the_same_seed_gives_the_same_readings_and_another_one_others() {
    let sensor = ForceTorque::default();
    assert_eq!(read(&[], &sensor, 7, |_| 1.0), read(&[], &sensor, 7, |_| 1.0));
    assert_ne!(read(&[], &sensor, 7, |_| 1.0), read(&[], &sensor, 8, |_| 1.0));
}

#[test]
fn bias_drift_range_and_quantisation_act_in_the_order_of_the_chain() {
    let sensor =
        ForceTorque { bias_n: 0.5, drift_n_per_s: 0.01, quantisation_n: 0.25, range_n: Some(2.0), ..still() };
    let readings = read(&[], &sensor, 1, |t| 0.01 * t);
    assert_eq!(readings[0], 0.5);
    // 0.5 + 0.02 t N: 1.0 N at 25 s; from 75 s on the range ends it at 2 N.
    assert_eq!(readings[25 * 200], 1.0);
    assert_eq!(readings[35 * 200], 1.25, "1.2 N rounds to a multiple of 0.25 N");
    assert!(readings[80 * 200..].iter().all(|f| *f == 2.0));
}

#[test]
fn effects_of_tool_and_sensor_act_on_the_reading() {
    let tool = read(&[ToolInertia { mass_kg: 0.3 }.into()], &still(), 1, |_| 1.0);
    assert!((tool[10] - 1.15).abs() < 1e-12, "1 N and 0.3 kg times 0.5 m/s²: {}", tool[10]);
    let gain = read(&[ForceGain { eps: 0.1 }.into()], &still(), 1, |_| 2.0);
    assert!((gain[10] - 2.2).abs() < 1e-12);
    let late = read(&[TimeDelay { delay_s: 0.1 }.into()], &still(), 1, |t| t);
    assert!((late[4000] - 19.9).abs() < 1e-9, "{}", late[4000]);
}

#[test]
fn spikes_come_at_their_rate_with_their_size_and_leave_the_noise_alone() {
    let sensor = ForceTorque { noise_n: 0.01, ..ForceTorque::default() };
    let spikes = ForceSpikes { rate_hz: 2.0, size_n: 1.0 };
    let with = read(&[spikes.into()], &sensor, 5, |_| 0.0);
    let without = read(&[], &sensor, 5, |_| 0.0);
    let hits: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).filter(|d| d.abs() > 1e-9).collect();
    assert!((300..500).contains(&hits.len()), "{} spikes in 200 s at 2 Hz", hits.len());
    assert!(hits.iter().all(|d| (d.abs() - 1.0).abs() < 1e-9));
    assert!(hits.iter().any(|d| *d > 0.0) && hits.iter().any(|d| *d < 0.0));
}

#[test]
fn a_wrong_position_scale_stretches_the_recorded_position() {
    let force_sensor = ForceSensor::new(&[PositionScale { eps: 0.02 }.into()], &still(), 1, HZ);
    assert!((force_sensor.position(0.05) - 0.051).abs() < 1e-15);
}
