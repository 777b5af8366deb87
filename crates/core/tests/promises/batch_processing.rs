//! Promise: batches give bitwise the results of single steps, for any block size and with unusable samples among them.

use crate::support;
use stylet_core::{EnhanceConfig, Enhancer, Output, Sample};

/// Fields that every step updates, as bits.
type StepBits = (u64, u64, String);

fn bits_of(out: &Output) -> StepBits {
    let rest = format!(
        "{:?} {} {:?} {:?} {:?} {}",
        out.state, out.ruptures, out.contact_m, out.detection, out.estimate, out.used
    );
    (out.enhanced_n.to_bits(), out.error_n.to_bits(), rest)
}

fn core() -> Enhancer<Vec<Sample>> {
    Enhancer::new(EnhanceConfig::paper(), 0.0, vec![Sample::default(); 10_000])
}

/// Makes some samples unusable: not finite, not later than the previous one, or out of range.
fn with_unusable(mut samples: Vec<Sample>) -> Vec<Sample> {
    for (k, sample) in samples.iter_mut().enumerate() {
        match k % 997 {
            0 => sample.time_s = f64::NAN,
            200 => sample.force_n = f64::INFINITY,
            400 => sample.time_s -= 1.0,
            600 => sample.position_m = 2e3,
            800 => sample.time_s = f64::INFINITY,
            _ => {}
        }
    }
    samples
}

#[test]
fn batches_give_bitwise_the_results_of_single_steps() {
    for samples in [support::constant(0.02, 1).samples, support::sinusoid(0.02, 2).samples] {
        for samples in [samples.clone(), with_unusable(samples)] {
            let mut one_by_one = core();
            let expected: Vec<StepBits> = samples.iter().map(|s| bits_of(&one_by_one.step(*s))).collect();
            for cut in [1, 7, 64, 65, 1000, samples.len()] {
                let mut at_once = core();
                let mut found = Vec::new();
                for piece in samples.chunks(cut) {
                    let last = bits_of(at_once.run(piece, |out| found.push(bits_of(out))));
                    assert_eq!(Some(&last), found.last());
                }
                assert_eq!(found, expected, "in pieces of {cut}");
            }
            let ruptures = expected.last().map(|(_, _, rest)| rest.split(' ').nth(1) != Some("0"));
            assert_eq!(ruptures, Some(true), "the run must have ruptures");
        }
    }
}

#[test]
fn an_estimate_that_overflows_restarts_and_outputs_stay_finite() {
    // Forgetting without resets lets the covariance grow without bound at standstill.
    let config = EnhanceConfig {
        forgetting: 0.5,
        reset: stylet_core::config::Reset::Ruptures,
        ..EnhanceConfig::paper()
    };
    let mut core = Enhancer::new(config, 0.0, vec![Sample::default(); 10_000]);
    let mut restarts = 0;
    let mut before = [0.0; 2];
    for k in 0..20_000 {
        let time_s = f64::from(k) / 200.0;
        let moving = time_s.min(10.0);
        let out = core.step(Sample {
            time_s,
            position_m: -0.005 + 0.002 * moving,
            velocity_mps: if time_s < 10.0 { 0.002 } else { 0.0 },
            force_n: 40.0 * (0.002 * moving - 0.005).max(0.0),
        });
        let numbers = [out.enhanced_n, out.error_n, out.theta[0], out.theta[1], out.reconstructed_n];
        assert!(numbers.iter().all(|x| x.is_finite()), "at {time_s} s: {numbers:?}");
        restarts += usize::from(out.theta == [0.0; 2] && before != [0.0; 2]);
        before = out.theta;
    }
    assert!(restarts > 0, "the estimate must have overflowed");
}
