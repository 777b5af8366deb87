//! Promise: the outputs of `algorithm: Paper` stay bitwise the same. The hashes date from before `Stylet` existed.

use crate::support::{Insertion, constant, enhance, insertion, sinusoid};
use stylet_core::config::{Algorithm, Contact, EnhanceConfig, Model};
use stylet_core::{Output, Sample};

/// FNV-1a over the bits of all outputs.
fn hash(outputs: &[Output]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bits: u64| {
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for o in outputs {
        for x in [
            o.enhanced_n,
            o.reconstructed_n,
            o.error_n,
            o.theta[0],
            o.theta[1],
            o.cusum_n2,
            o.derivative_n_per_s,
            o.cumulative_friction_ns_per_m,
            o.contact_m.unwrap_or(-1.0),
        ] {
            add(x.to_bits());
        }
        add(o.state as u64);
        add(o.ruptures as u64);
        add(u64::from(o.used));
        if let Some(d) = o.detection {
            add(d.time_s.to_bits());
            add(d.located_m.to_bits());
        }
        if let Some(e) = o.estimate {
            for x in [e.start_m, e.thickness_m, e.stiffness_n_per_m, e.friction, e.drop_n, e.elastic_share] {
                add(x.to_bits());
            }
        }
    }
    hash
}

fn cases() -> Vec<(&'static str, Insertion)> {
    let tissue = stylet_tissue::Tissue::three_gels();
    let speed = |t: f64| if (10.0..13.0).contains(&t) { 0.0 } else { 0.0023 + 0.001 * (1.5 * t).sin() };
    let back = |t: f64| if t < 40.0 { 0.0024 } else { -0.004 };
    let mut corrupted = constant(0.02, 7);
    for (k, s) in corrupted.samples.iter_mut().enumerate() {
        match k % 997 {
            3 => s.force_n = f64::NAN,
            5 => s.time_s -= 1.0,
            8 => s.force_n += 10.0,
            _ => {}
        }
    }
    vec![
        ("constant, 0.02 N", constant(0.02, 1)),
        ("constant, 0.1 N, surface known", constant(0.1, 2)),
        ("sinusoid, 0.02 N", sinusoid(0.02, 3)),
        ("ripple and hold", insertion(&tissue, -0.005, 45.0, 200.0, 0.03, 4, speed)),
        ("retraction", insertion(&tissue, -0.005, 50.0, 200.0, 0.02, 5, back)),
        ("corrupted samples, surface known", corrupted),
    ]
}

#[test]
fn the_papers_algorithm_reproduces_its_golden_hashes() {
    let expected: [[u64; 3]; 6] = GOLDEN;
    let mut found = Vec::new();
    for (name, data) in cases() {
        let samples: &[Sample] = &data.samples;
        let contact = if name.ends_with("surface known") { Contact::Known } else { Contact::Detected };
        let paper = EnhanceConfig { algorithm: Algorithm::Paper, contact, ..EnhanceConfig::default() };
        let kelvin = EnhanceConfig { model: Model::KelvinVoigt, ..paper.clone() };
        let literal = EnhanceConfig { algorithm: Algorithm::Literal, ..paper.clone() };
        let row = [&paper, &kelvin, &literal].map(|c| hash(&enhance(c, samples)));
        println!("    [{:#018x}, {:#018x}, {:#018x}], // {name}", row[0], row[1], row[2]);
        found.push(row);
    }
    assert_eq!(found, expected);
    let mut all: Vec<u64> = found.concat();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), 18, "every case has its own result");
}

const GOLDEN: [[u64; 3]; 6] = [
    [0x5ca68ff1dcd20f14, 0x70d108d4b7177c26, 0x7e73f282e4025c31], // constant, 0.02 N
    [0x2491199f878bd1a4, 0x34dad8b5426e9126, 0x106f688a0a5c7052], // constant, 0.1 N, surface known
    [0x727f8dabe8e46d44, 0x97f834cb58ca67d9, 0xc99f532f9629e6b8], // sinusoid, 0.02 N
    [0x5e24389830ab0710, 0xf152bea89d7cb7d0, 0x59db90b0c7bbbde9], // ripple and hold
    [0x3e651da869f3ae99, 0xa7d69d25b342a88f, 0xb650ce44b756e142], // retraction
    [0xc5db1eef08bab7c8, 0x016a0074f6fd88f0, 0x4c5375ed89ba911e], // corrupted samples, surface known
];
