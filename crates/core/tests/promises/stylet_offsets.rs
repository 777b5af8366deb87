//! Promise: outputs of `algorithm: Stylet` are invariant to offsets of sensor, clock and position.

use crate::support::{enhance, insertion, stylet};
use stylet_core::Sample;
use stylet_tissue::Tissue;

/// Insertions with retraction: by the base law, with gaps, and with dry friction, curved loading and texture.
fn insertions() -> Vec<(&'static str, Vec<Sample>)> {
    let with_retraction = |t: f64| match t {
        t if t < 15.0 => 0.0023 + 0.0005 * t.sin(),
        t if t < 16.0 => 0.0,
        t if t < 32.0 => 0.0023,
        _ => -0.003,
    };
    let mut gels = Tissue::three_gels();
    for layer in &mut gels.layers {
        layer.puncture_n = None;
    }
    let mut gaps = Tissue::three_gels();
    for (layer, drop_n) in gaps.layers.iter_mut().zip([0.9, 1.7, 2.1]) {
        layer.puncture_n = Some(drop_n);
    }
    let law = |tissue: &Tissue| insertion(tissue, -0.005, 45.0, 200.0, 0.02, 3, with_retraction).samples;
    let mut rough = law(&gels);
    let (mut friction_n, mut last_m) = (0.0, 0.0_f64);
    for s in &mut rough {
        let z = s.position_m.max(0.0);
        // Dry friction of 40 N/m that builds up over 2 mm.
        let dz = z - last_m;
        last_m = z;
        friction_n += dz.abs() / 0.002 * (40.0 * z * dz.signum() - friction_n);
        let tip_n = if dz < 0.0 { 0.0 } else { 3.0 * (z % 0.02 / 0.02).powf(2.5) };
        s.force_n = tip_n + friction_n;
    }
    for (k, s) in rough.iter_mut().enumerate() {
        s.force_n += 0.004 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
    }
    vec![("law", law(&gels)), ("gaps", law(&gaps)), ("rough", rough)]
}

#[test]
fn offsets_of_sensor_clock_and_position_shift_the_output_and_change_nothing_else() {
    let config = stylet();
    // Powers of two, to limit rounding.
    for (force_n, time_s, position_m) in
        [(2.0, 0.0, 0.0), (-4.0, 0.0, 0.0), (0.0, 64.0, 0.0), (0.0, 0.0, 0.5)]
    {
        for (name, samples) in insertions() {
            let shifted: Vec<Sample> = samples
                .iter()
                .map(|s| Sample {
                    time_s: s.time_s + time_s,
                    position_m: s.position_m + position_m,
                    force_n: s.force_n + force_n,
                    ..*s
                })
                .collect();
            let (plain, moved) = (enhance(&config, &samples), enhance(&config, &shifted));
            assert!(plain.iter().filter(|o| o.detection.is_some()).count() >= 2, "{name}");
            let what = format!("{name} by {force_n} N, {time_s} s, {position_m} m");
            for (a, b) in plain.iter().zip(&moved) {
                assert!((b.enhanced_n - force_n - a.enhanced_n).abs() < 1e-3, "{what}: {a:?} {b:?}");
                assert_eq!((a.state, a.ruptures, a.used), (b.state, b.ruptures, b.used), "{what}");
                if let (Some([low, high]), Some([moved_low, moved_high])) = (a.band_n, b.band_n) {
                    let wider = (moved_high - moved_low) / (high - low) - 1.0;
                    assert!(wider.abs() < 0.01, "{what}: {a:?} {b:?}");
                }
                if let (Some(a), Some(b)) = (a.estimate, b.estimate) {
                    assert!((b.start_m - position_m - a.start_m).abs() < 1e-6, "{what}: {a:?} {b:?}");
                    assert!((b.stiffness_n_per_m / a.stiffness_n_per_m - 1.0).abs() < 1e-3, "{what}");
                }
            }
        }
    }
}
