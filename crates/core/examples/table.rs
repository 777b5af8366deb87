//! The table of `docs/explanation/enhancer_accuracy.md`: detection, delay, stiffness errors, enhancement, coverage of the 95 % intervals, and false
//! alarms per hour of insertion, from the core and the tissue law.
//!
//! ```sh
//! cargo run --release -p stylet-core --example table -- [SEEDS] [ROW] [FALSE ALARMS PER HOUR]
//! ```
#![allow(clippy::unwrap_used, reason = "an example that stops is its own message")]
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use stylet_core::config::{Algorithm, Contact, StyletConfig};
use stylet_core::{EnhanceConfig, Enhancer, LayerEstimate, Sample};
use stylet_tissue::SoftBoundary;
use stylet_tissue::{AnyEffect, ForceLaw, ForceLawState, Tissue};

struct Row {
    name: &'static str,
    tissue: Tissue,
    effects: Vec<AnyEffect>,
    fs: f64,
    noise: f64,
    rho: f64,
    dur: f64,
    v: fn(f64) -> f64,
}

/// Three layers without latex at 2.3 mm/s and 200 Hz with white noise of 20 mN, for 50 s.
fn plain(name: &'static str) -> Row {
    Row { name, tissue: gels(), effects: vec![], fs: 200.0, noise: 0.02, rho: 0.0, dur: 50.0, v: constant }
}
fn gels() -> Tissue {
    let mut t = Tissue::three_gels();
    for l in &mut t.layers {
        l.puncture_n = None;
    }
    t
}
fn weak() -> Tissue {
    let mut t = gels();
    for (l, d) in t.layers.iter_mut().zip([0.1, 0.2, 0.3]) {
        l.stiffness_n_per_m = d / l.thickness_m;
    }
    t
}
/// Each layer ruptures 6 to 9 mm before its far face.
fn gaps() -> Tissue {
    let mut t = gels();
    for (l, n) in t.layers.iter_mut().zip([0.9, 1.7, 2.1]) {
        l.puncture_n = Some(n);
    }
    t
}
fn constant(_t: f64) -> f64 {
    0.0023
}
fn sinus(t: f64) -> f64 {
    let w = std::f64::consts::TAU * 0.0167;
    0.12 * w * (w * t).cos()
}
fn sinus_rest(t: f64) -> f64 {
    let w = std::f64::consts::TAU * 0.0167;
    0.12 * w * (w * t).sin()
}
fn hold(t: f64) -> f64 {
    // middle of the second layer: z = 47 mm after 52 mm of travel
    let t0 = 0.05205 / 0.0023;
    if t > t0 && t < t0 + 5.0 { 0.0 } else { 0.0023 }
}
fn ripple(t: f64) -> f64 {
    0.0023 * (1.0 + 0.6 * (std::f64::consts::TAU * 0.25 * t).sin())
}

fn main() {
    let seeds: u64 = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(50);
    let rate: f64 = std::env::args()
        .nth(3)
        .and_then(|s| s.parse().ok())
        .unwrap_or(StyletConfig::default().false_alarms_per_hour);
    let only = std::env::args().nth(2).unwrap_or_default();
    let thin = {
        let mut t = gels();
        t.layers[1].thickness_m = 0.004;
        t
    };
    let soft = vec![AnyEffect::SoftBoundary(SoftBoundary { width_m: 0.002 })];
    let rows = vec![
        plain("constant .02"),
        Row { dur: 15.0, v: sinus, ..plain("sinus .02") },
        Row { dur: 15.0, v: sinus_rest, ..plain("sinus rest .02") },
        Row { noise: 0.1, ..plain("constant .1") },
        Row { noise: 0.1, dur: 15.0, v: sinus, ..plain("sinus .1") },
        Row { noise: 0.05, rho: 0.9, ..plain("const AR .05") },
        Row { noise: 0.05, rho: 0.9, dur: 15.0, v: sinus, ..plain("sinus AR .05") },
        Row { tissue: weak(), ..plain("weak .02") },
        Row { tissue: weak(), noise: 0.05, ..plain("weak .05") },
        Row { effects: soft, ..plain("soft") },
        Row { tissue: thin, dur: 36.0, ..plain("thin") },
        Row { dur: 55.0, v: hold, ..plain("hold") },
        Row { v: ripple, ..plain("ripple") },
        Row { fs: 1000.0, noise: 0.1, ..plain("1kHz .1") },
        Row { tissue: gaps(), ..plain("gaps .02") },
        Row { tissue: gaps(), noise: 0.1, ..plain("gaps .1") },
        Row { tissue: gaps(), dur: 15.0, v: sinus, ..plain("gaps sinus") },
    ];
    println!(
        "{:16} {:>10} {:>12} {:>14} {:>8} cover K b D band",
        "row", "miss/false", "delay ms", "K %", "enh"
    );
    for row in rows.iter().filter(|r| only.is_empty() || r.name.contains(&only)) {
        run(row, seeds, rate);
    }
}

fn median(v: &mut [f64], q: f64) -> f64 {
    if v.is_empty() {
        return f64::NAN;
    }
    v.sort_by(f64::total_cmp);
    v[((v.len() - 1) as f64 * q).round() as usize]
}

fn run(row: &Row, seeds: u64, rate: f64) {
    let law = ForceLaw::new(&row.tissue, &row.effects).expect("few effects");
    let dt = 1.0 / row.fs;
    let n = (row.dur * row.fs) as usize;
    let (mut missed, mut fals, mut total) = (0, 0, 0);
    let mut delays = vec![];
    let mut errors: Vec<Vec<f64>> = vec![vec![]; row.tissue.layers.len()];
    let mut enh = vec![];
    let mut cover = [[0.0; 2]; 4];
    let mut verbose = if std::env::var_os("VERBOSE").is_some() { 5 } else { 0 };
    for seed in 0..seeds {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let mut state = ForceLawState::default();
        let config = EnhanceConfig {
            algorithm: Algorithm::Stylet,
            contact: Contact::Detected,
            stylet: StyletConfig { false_alarms_per_hour: rate, ..StyletConfig::default() },
            ..EnhanceConfig::default()
        };
        let mut core = Enhancer::new(config, 0.0, []);
        // The start of the motion is drawn within a sampling interval.
        let mut clock = ChaCha8Rng::seed_from_u64(1000 + seed);
        clock.set_stream(1);
        let offset_s = clock.random::<f64>() * dt;
        let mut z = -0.005 + 0.5 * ((row.v)(0.0) + (row.v)(offset_s)) * offset_s;
        let mut noise: f64 = {
            let w: f64 = StandardNormal.sample(&mut rng);
            w * row.noise
        };
        let mut ruptures: Vec<(f64, f64)> = vec![];
        let mut det: Vec<f64> = vec![];
        let mut est: Vec<LayerEstimate> = vec![];
        let (mut miss2, mut tip2) = (0.0, 0.0);
        for k in 0..n {
            let t = offset_s + k as f64 * dt;
            let v = (row.v)(t);
            let mut now = vec![];
            let f = law.step(&mut state, t, z, v, |r| now.push((r.time_s, r.position_m)));
            ruptures.extend(now);
            let out =
                core.step(Sample { time_s: t, position_m: z, velocity_mps: v, force_n: f.total_n + noise });
            if let Some(d) = out.detection {
                det.push(d.time_s);
            }
            if let Some(e) = out.estimate {
                est.retain(|x| x.layer != e.layer);
                est.push(e);
            }
            if z > 0.0 {
                let e = out.enhanced_n - (f.tip_n + noise);
                miss2 += e * e;
                tip2 += f.tip_n * f.tip_n;
                if let Some([lo, hi]) = out.band_n {
                    cover[3][1] += 1.0;
                    if f.tip_n >= lo && f.tip_n <= hi {
                        cover[3][0] += 1.0;
                    }
                }
            }
            let w: f64 = StandardNormal.sample(&mut rng);
            noise = row.rho * noise + (1.0 - row.rho * row.rho).sqrt() * row.noise * w;
            z += 0.5 * (v + (row.v)(t + dt)) * dt;
        }
        enh.push((miss2 / tip2).sqrt());
        let mut used = vec![false; det.len()];
        let mut dsum = 0.0;
        for (i, (tr, zr)) in ruptures.iter().enumerate() {
            total += 1;
            let l = &row.tissue.layers[i];
            let behind = dsum + l.friction_ns_per_m2 * (zr - row.tissue.front_m(i));
            dsum += l.friction_ns_per_m2 * l.thickness_m;
            let hit = (0..det.len()).find(|&j| !used[j] && det[j] >= tr - 0.05 && det[j] <= tr + 1.0);
            match hit {
                None => {
                    missed += 1;
                    if verbose > 0 {
                        verbose -= 1;
                        println!("   missed seed {seed} t {tr:.3} z {zr:.4} det {det:?}");
                    }
                }
                Some(j) => {
                    used[j] = true;
                    delays.push(1e3 * (det[j] - tr));
                    if let Some(e) = est.iter().find(|e| e.layer == j + 1) {
                        errors[i].push(100.0 * (e.stiffness_n_per_m / l.stiffness_n_per_m - 1.0).abs());
                        let mut c = |k: usize, x: f64, sd: f64| {
                            cover[k][1] += 1.0;
                            if x.abs() <= 1.96 * sd {
                                cover[k][0] += 1.0;
                            }
                        };
                        c(0, e.stiffness_n_per_m - l.stiffness_n_per_m, e.stiffness_sd);
                        c(1, e.friction - l.friction_ns_per_m2, e.friction_sd);
                        c(2, e.cumulative_ns_per_m - behind, e.cumulative_sd);
                    }
                }
            }
        }
        for (j, u) in used.iter().enumerate() {
            if !u {
                fals += 1;
                if verbose > 0 {
                    verbose -= 1;
                    println!("   false seed {seed} t {:.3}", det[j]);
                }
            }
        }
    }
    let ks: Vec<String> = errors.iter_mut().map(|e| format!("{:.2}", median(e, 0.5))).collect();
    let cv: Vec<String> = cover.iter().map(|c| format!("{:.1}", 100.0 * c[0] / c[1])).collect();
    let hours = seeds as f64 * row.dur / 3600.0;
    println!(
        "{:16} {missed:>4}/{fals:<4} of {total:<5} {:>5.1}/{:<5.1} {:>16} {:.4} {}  {:.2}/h over {hours:.1} h",
        row.name,
        median(&mut delays.clone(), 0.5),
        median(&mut delays, 0.95),
        ks.join(","),
        median(&mut enh, 0.5),
        cv.join(" "),
        f64::from(fals) / hours
    );
}
