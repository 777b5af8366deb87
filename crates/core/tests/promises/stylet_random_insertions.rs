//! Promise of `algorithm: Stylet` on random insertions, in which tissue, motion, sensor and recording vary together: ruptures and contacts
//! are found, the enhanced force follows the tip force, and every event and estimate is that of the table beside this file. A change of
//! the algorithm that moves one of them shows there; `STYLET_BLESS=1` writes the table again.

use crate::support::{Insertion, detections, enhance, insertion_into, lasting, stylet};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use stylet_core::config::{Contact, FrictionLaw};
use stylet_core::{EnhanceConfig, Enhancer, LayerEstimate, Output, Sample};
use stylet_tissue::{AnyEffect, CoulombFriction, ForceLaw, Rupture, Tissue};

const INSERTIONS: u64 = 36;
/// Table rows per insertion, beside those of events.
const ROWS: usize = 4;
/// Relative difference of two numbers of six digits that are rounded differently.
const TOLERANCE: f64 = 1.1e-5;
const TABLE: &str = "tests/promises/stylet_random_insertions.txt";

struct Draw(ChaCha8Rng);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// Zero in two of three insertions.
    fn sometimes(&mut self, low: f64, high: f64) -> f64 {
        let x = self.between(low, high);
        if self.0.random_range(0..3) == 0 { x } else { 0.0 }
    }

    fn tissue(&mut self) -> Tissue {
        let mut tissue = Tissue::three_gels();
        for layer in &mut tissue.layers {
            layer.thickness_m = self.between(0.006, 0.018);
            layer.stiffness_n_per_m = self.between(40.0, 250.0);
            layer.friction_ns_per_m2 = self.between(5e3, 2e4);
            let share = self.sometimes(0.4, 0.8);
            let most_n = layer.stiffness_n_per_m * layer.thickness_m;
            layer.puncture_n = (share > 0.0).then_some(share * most_n);
        }
        tissue
    }
}

/// An insertion from 3 to 12 mm above three layers, with ripple, perhaps a hold and a retraction; forces of the law, white noise.
fn random_insertion(draw: &mut Draw, seed: u64, dry_n_per_m: f64) -> (Insertion, f64) {
    let tissue = draw.tissue();
    let (start_m, speed_mps) = (draw.between(-0.012, -0.003), draw.between(0.002, 0.006));
    let (ripple, ripple_hz) = (draw.sometimes(0.1, 0.6), draw.between(0.1, 1.0));
    let travel_s = (tissue.end_m() - start_m + 0.003) / speed_mps;
    let (hold_s, from_s) = (draw.sometimes(0.2, 2.0), draw.between(0.3, 0.9) * travel_s);
    let back_s = draw.sometimes(1.0, 4.0);
    let turn_s = travel_s + hold_s;
    let speed = move |t: f64| match t {
        t if t >= turn_s => -speed_mps,
        t if (from_s..from_s + hold_s).contains(&t) => 0.0,
        t => speed_mps * (1.0 + ripple * (TAU * ripple_hz * t).sin()),
    };
    let dry = [AnyEffect::CoulombFriction(CoulombFriction { c_n_per_m: dry_n_per_m })];
    let law = ForceLaw::new(&tissue, if dry_n_per_m > 0.0 { &dry } else { &[] }).expect("an effect");
    let (hz, noise_n) = ([200.0, 500.0][usize::from(seed.is_multiple_of(5))], draw.between(0.003, 0.03));
    let data = insertion_into(&law, start_m, turn_s + back_s, hz, noise_n, seed, speed);
    (lasting(data, draw.sometimes(0.02, 0.5)), turn_s)
}

/// Sensor and recorder: slow noise, offset, drift, line, steps of the zero in air and in tissue, spikes, a late force, rounded positions,
/// smoothed velocities.
fn disturb(draw: &mut Draw, samples: &mut [Sample], turn_s: f64) {
    let (rho, slow_n) = (draw.sometimes(0.5, 0.9), draw.between(0.002, 0.01));
    let (offset_n, drift, line) =
        (draw.between(-1.0, 1.0), draw.sometimes(-0.03, 0.03), draw.sometimes(-20.0, 20.0));
    let (air_n, air_s) = (draw.sometimes(-1.0, 1.0), draw.between(0.5, 1.5));
    let (tissue_n, tissue_s) = (draw.sometimes(-1.5, 1.5), draw.between(0.3, 1.0) * turn_s);
    let (spike_n, late) = (draw.sometimes(-8.0, 8.0), draw.sometimes(1.0, 6.0) as usize);
    let (rounded_m, half) = (draw.sometimes(2e-6, 2e-5), draw.sometimes(3.0, 12.0) as usize);
    let original = samples.to_vec();
    let mut slow = 0.0;
    for (k, s) in samples.iter_mut().enumerate() {
        let w: f64 = StandardNormal.sample(&mut draw.0);
        slow = rho * slow + slow_n * w;
        s.force_n = original[k.saturating_sub(late)].force_n
            + offset_n
            + drift * s.time_s
            + line * s.position_m
            + if s.time_s > air_s { air_n } else { 0.0 }
            + if s.time_s > tissue_s { tissue_n } else { 0.0 }
            + if k % 701 < 2 { spike_n } else { 0.0 }
            + if rho > 0.0 { slow } else { 0.0 };
        let window = &original[k.saturating_sub(half)..(k + half + 1).min(original.len())];
        s.velocity_mps = window.iter().map(|s| s.velocity_mps).sum::<f64>() / window.len() as f64;
        if rounded_m > 0.0 {
            s.position_m = rounded_m * (s.position_m / rounded_m).round();
        }
    }
}

/// Contact and friction law: as by default in most insertions.
fn config(draw: &mut Draw, dry_n_per_m: f64) -> EnhanceConfig {
    let mut config = stylet();
    config.contact = match draw.0.random_range(0..10) {
        0 => Contact::Known,
        1 => Contact::None,
        _ => Contact::Detected,
    };
    // The mean of the drawn viscous friction is 12.5 kN s/m².
    let (dry_mps, travel_m) = (dry_n_per_m / 12.5e3, 0.001);
    config.stylet.friction_law = match draw.0.random_range(0..6) {
        0 => FrictionLaw::CoulombViscous { dry_mps },
        1 => FrictionLaw::Presliding { dry_mps, travel_m },
        2 => FrictionLaw::Viscous,
        _ => FrictionLaw::Auto,
    };
    config.stylet.derived_velocity = draw.0.random_range(0..3) == 0;
    config
}

fn insertion(seed: u64) -> (EnhanceConfig, Insertion) {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed));
    let dry_n_per_m = draw.sometimes(5.0, 60.0);
    let (mut data, turn_s) = random_insertion(&mut draw, seed, dry_n_per_m);
    let config = config(&mut draw, dry_n_per_m);
    disturb(&mut draw, &mut data.samples, turn_s);
    (config, data)
}

/// Six digits each.
fn digits<const N: usize>(values: [f64; N]) -> String {
    values.map(|x| if x == 0.0 { "0".into() } else { format!("{x:.5e}") }).join(" ")
}

/// Force, parameters and their standard deviations, contact, baseline, work of one sample.
fn row(s: &Sample, o: &Output, operations: u32) -> String {
    let [low, high] = o.band_n.unwrap_or_default();
    let (b, contact_m) = (&o.baseline, o.contact_m.unwrap_or(-1.0));
    let numbers = [
        digits([o.enhanced_n, low, high, o.reconstructed_n, o.error_n, o.cusum_n2]),
        digits([o.theta[0], o.theta[1], o.cumulative_friction_ns_per_m, o.sd[0], o.sd[1], o.sd[2]]),
        digits([contact_m, o.contact_sd_m, o.contact_probability]),
        digits([b.offset_n, b.drift_n_per_s, b.line_n_per_m, b.sd[0], b.sd[1], b.sd[2]]),
    ];
    let numbers = numbers.join(" ");
    format!("{} {:?} {} {numbers} {:?} {} {operations}", s.time_s, o.state, o.ruptures, b.kind, b.zero_steps)
}

/// Events and some outputs of one insertion.
fn rows(seed: u64) -> String {
    let (config, data) = insertion(seed);
    let mut core = Enhancer::new(config, 0.0, []);
    let every = data.samples.len() / ROWS;
    let mut text = format!("insertion {seed}\n");
    let mut line = |event: String| {
        text += &event;
        text.push('\n');
    };
    let (mut in_tissue, mut layers) = (false, Vec::new());
    for (k, s) in data.samples.iter().enumerate() {
        let o = core.step(*s);
        let changed = o.contact_m.is_some() != in_tissue;
        in_tissue = o.contact_m.is_some();
        if let Some(d) = &o.detection {
            let numbers = digits([d.located_m, d.drop_n, d.drop_sd_n, d.confidence]);
            line(format!("rupture {} {} {numbers}", d.layer, s.time_s));
        }
        if let Some(z) = &o.zero_step {
            let numbers = digits([z.time_s, z.position_m, z.size_n, z.sd_n]);
            line(format!("step {} {:?} {:?} {numbers}", s.time_s, z.in_tissue, z.withdrawn));
        }
        if let Some(e) = o.estimate {
            layers.retain(|x: &LayerEstimate| x.layer != e.layer);
            layers.push(e);
        }
        if k % every == every - 1 || changed || o.zero_step.is_some() {
            line(row(s, &o, core.operation_count()));
        }
    }
    for e in &layers {
        let place = digits([e.start_m, e.thickness_m, e.drop_n, e.drop_sd_n, e.time_s]);
        let law = digits([e.stiffness_n_per_m, e.stiffness_sd, e.friction, e.friction_sd]);
        let friction = digits([e.added_friction_ns_per_m, e.cumulative_ns_per_m, e.cumulative_sd]);
        line(format!("layer {} {place} {law} {friction}", e.layer));
    }
    text
}

/// Equal words, or numbers that differ by rounding.
fn same(found: &str, expected: &str) -> bool {
    let close = |(a, b): (&str, &str)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => (x - y).abs() <= TOLERANCE * y.abs() + 1e-9,
        _ => a == b,
    };
    let (a, b) = (found.split_whitespace(), expected.split_whitespace());
    a.clone().count() == b.clone().count() && a.zip(b).all(close)
}

#[test]
fn events_and_estimates_are_those_of_the_table() {
    let found: String = (0..INSERTIONS).map(rows).collect();
    if std::env::var_os("STYLET_BLESS").is_some() {
        std::fs::write(TABLE, &found).expect("a table that can be written");
    }
    let table = std::fs::read_to_string(TABLE).expect("the table");
    for (n, (found, expected)) in found.lines().zip(table.lines()).enumerate() {
        assert!(same(found, expected), "{TABLE}, line {}: found\n{found}\nfor\n{expected}", n + 1);
    }
    assert_eq!(found.lines().count(), table.lines().count(), "lines of {TABLE}");
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn most_ruptures_and_contacts_are_found_and_most_friction_is_compensated() {
    let (mut hits, mut of, mut false_alarms) = (0, 0, 0);
    let (mut near, mut contacts) = (0, 0);
    let (mut off_n, mut raw_n) = (Vec::new(), Vec::new());
    for seed in 0..INSERTIONS {
        let (config, data) = insertion(seed);
        let outputs = enhance(&config, &data.samples);
        let found = detections(&outputs);
        // Drops last up to half a second.
        let is_of = |found_s: f64, rupture: &Rupture| (0.0..0.6).contains(&(found_s - rupture.time_s));
        of += data.ruptures.len();
        hits += data.ruptures.iter().filter(|r| found.iter().any(|f| is_of(*f, r))).count();
        false_alarms += found.iter().filter(|f| !data.ruptures.iter().any(|r| is_of(**f, r))).count();
        if config.contact == Contact::Detected {
            contacts += 1;
            let contact_m = outputs.last().and_then(|o| o.contact_m);
            near += usize::from(contact_m.is_some_and(|m| m.abs() < 1e-3));
        }
        // The initial offset of the sensor stays in the enhanced force.
        let rms = |off: &dyn Fn(usize) -> f64| {
            let off: Vec<f64> = (0..outputs.len()).map(off).collect();
            let constant = median(off.clone());
            (off.iter().map(|x| (x - constant) * (x - constant)).sum::<f64>() / off.len() as f64).sqrt()
        };
        off_n.push(rms(&|k| outputs[k].enhanced_n - data.truth[k].tip_n));
        raw_n.push(rms(&|k| data.samples[k].force_n - data.truth[k].tip_n));
    }
    let (off_n, raw_n) = (median(off_n), median(raw_n));
    println!(
        "{hits} of {of} ruptures, {false_alarms} false, {near} of {contacts} contacts, {off_n} of {raw_n} N"
    );
    assert!(hits * 100 >= of * 90, "{hits} of {of} ruptures");
    assert!(false_alarms * 100 <= of * 15, "{false_alarms} false alarms for {of} ruptures");
    assert!(near * 100 >= contacts * 85, "{near} of {contacts} contacts");
    assert!(off_n < 0.5 * raw_n, "{off_n} N of {raw_n} N");
}
