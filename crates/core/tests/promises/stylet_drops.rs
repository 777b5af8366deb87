//! Promise of `algorithm: Stylet` for falls of the force: a fall within 0.1 s is one rupture, located at its start and reported with
//! its size; up to three outliers are a spike.

use crate::support::{Insertion, enhance, gels, insertion, lasting, stylet};
use stylet_core::{CompletedDrop, Detection, Output, Sample};

/// The paper's three gels with drops that last `drop_s`.
fn soft(seed: u64, drop_s: f64) -> Insertion {
    lasting(insertion(&gels(), -0.005, 50.0, 200.0, 0.02, seed, |_| 0.0023), drop_s)
}

fn found(outputs: &[Output]) -> Vec<Detection> {
    outputs.iter().filter_map(|o| o.detection).collect()
}

#[test]
fn a_drop_is_located_within_a_step_and_reported_with_its_size() {
    for seed in 0..10 {
        let data = soft(seed, 0.0);
        let found = found(&enhance(&stylet(), &data.samples));
        assert_eq!(found.len(), 3, "seed {seed}");
        for (d, rupture) in found.iter().zip(&data.ruptures) {
            assert!((d.located_m - rupture.position_m).abs() <= 0.0023 * 0.005, "{d:?} for {rupture:?}");
            assert!((d.drop_n - rupture.released_n).abs() < 4.0 * 0.02, "{d:?} for {rupture:?}");
            assert!((0.01..=0.03).contains(&d.drop_sd_n), "at most the noise of one sample: {d:?}");
            assert!(d.confidence > 0.99 && d.confidence <= 1.0, "{d:?}");
        }
    }
}

#[test]
fn a_drop_that_takes_up_to_a_tenth_of_a_second_is_one_rupture() {
    for seed in 0..10 {
        for drop_s in [0.02, 0.05, 0.08] {
            let data = soft(seed, drop_s);
            let outputs = enhance(&stylet(), &data.samples);
            let found = found(&outputs);
            assert_eq!(found.len(), 3, "seed {seed}, {drop_s} s: {found:?}");
            for (d, rupture) in found.iter().zip(&data.ruptures) {
                let delay_s = d.time_s - rupture.time_s;
                assert!((0.0..=drop_s).contains(&delay_s), "seed {seed}, {drop_s} s: {delay_s} s late");
            }
            let whole: Vec<CompletedDrop> = outputs.iter().filter_map(|o| o.completed_drop).collect();
            assert_eq!(whole.len(), 3, "seed {seed}, {drop_s} s: {whole:?}");
            for (w, rupture) in whole.iter().zip(&data.ruptures) {
                assert!((w.drop_n - rupture.released_n).abs() < 5.0 * 0.02, "{w:?} for {rupture:?}");
            }
            // Half a second after the drop friction is compensated.
            for rupture in &data.ruptures {
                let at = (200.0 * (rupture.time_s + drop_s + 0.5)) as usize;
                let noise_n = data.samples[at].force_n - data.truth[at].total_n;
                let off_n = outputs[at].enhanced_n - noise_n - data.truth[at].tip_n;
                assert!(off_n.abs() < 0.1, "seed {seed}, {drop_s} s: {off_n} N");
            }
        }
    }
}

#[test]
fn friction_that_a_stop_takes_away_is_no_part_of_the_drop() {
    let rupture = soft(1, 0.0).ruptures[0];
    let velocity = |t: f64| if t < rupture.time_s + 0.05 { 0.0023 } else { 0.0 };
    let data = insertion(&gels(), -0.005, rupture.time_s + 1.0, 200.0, 0.02, 1, velocity);
    let outputs = enhance(&stylet(), &data.samples);
    let whole: Vec<CompletedDrop> = outputs.iter().filter_map(|o| o.completed_drop).collect();
    assert_eq!(whole.len(), 1, "{whole:?}");
    assert!((whole[0].drop_n - rupture.released_n).abs() < 4.0 * 0.02, "{whole:?} for {rupture:?}");
}

#[test]
fn rises_and_spikes_of_up_to_three_samples_are_no_ruptures() {
    let data = soft(1, 0.0);
    let plain = enhance(&stylet(), &data.samples);
    for length in 1..=3 {
        let mut samples = data.samples.clone();
        for k in (1000..9000).step_by(500) {
            for sample in &mut samples[k..k + length] {
                sample.force_n += 5.0;
            }
        }
        let outputs = enhance(&stylet(), &samples);
        assert_eq!(found(&outputs).len(), 3, "{length} samples");
        // A tenth of a second after the last spike the friction is unchanged.
        let (now, before) = (&outputs[8700], &plain[8700]);
        let off = now.cumulative_friction_ns_per_m - before.cumulative_friction_ns_per_m;
        assert!(off.abs() < 0.01 * before.cumulative_friction_ns_per_m, "{length} samples: {off} N s/m");
    }
}

#[test]
fn weaker_drops_have_lower_confidence() {
    // Soft layers, so that drops are a few standard deviations of the noise.
    let mut confidences = Vec::new();
    for stiffness in [2.0, 5.0, 40.0] {
        let mut tissue = gels();
        for layer in &mut tissue.layers {
            layer.stiffness_n_per_m = stiffness;
        }
        let (mut sum, mut count) = (0.0, 0);
        for seed in 0..10 {
            let data = insertion(&tissue, -0.005, 50.0, 200.0, 0.02, seed, |_| 0.0023);
            let found = found(&enhance(&stylet(), &data.samples));
            assert_eq!(found.len(), 3, "{stiffness} N/m, seed {seed}");
            for (d, rupture) in found.iter().zip(&data.ruptures) {
                assert!((0.0..0.2).contains(&(d.time_s - rupture.time_s)), "{stiffness} N/m: {d:?}");
                assert!((0.5..=1.0).contains(&d.confidence), "{d:?}");
                sum += d.confidence;
                count += 1;
            }
        }
        confidences.push(sum / f64::from(count));
    }
    assert!(confidences.is_sorted() && confidences[2] > 0.999 && confidences[0] < 0.999, "{confidences:?}");
}

#[test]
fn a_lasting_upward_jump_is_followed_without_a_rupture() {
    let data = insertion(&gels(), -0.005, 14.0, 200.0, 0.02, 1, |_| 0.0023);
    let mut samples: Vec<Sample> = data.samples.clone();
    for sample in &mut samples[1800..] {
        sample.force_n += 2.0;
    }
    let outputs = enhance(&stylet(), &samples);
    assert!(found(&outputs).is_empty());
    let last = outputs.last().expect("some");
    assert!(last.error_n.abs() < 0.1, "predicted again: {last:?}");
}
