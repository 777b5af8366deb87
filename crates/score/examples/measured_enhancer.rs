//! The core on the measured insertions in the folder `STYLET_MEASURED`: detections, and the enhanced force where nothing acts at
//! the tip.
//!
//! ```sh
//! cargo run --release -p stylet-score --example measured_enhancer -- [--force-noise N] [--ar R] [--scale S] [--every K] [--warp W] [-v]
//! ```
#![allow(clippy::unwrap_used, clippy::needless_range_loop, reason = "a table for developers")]
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::PathBuf;
use stylet_core::config::{Algorithm, EnhanceConfig};
use stylet_record::{Column, ColumnMap, ReadOptions, differentiate, read_csv};
use stylet_score::{CLEAR_FALL_RATIO, ForceFall, MINOR_FALL_RATIO, Trace, deepest_samples, force_falls};

fn rms(v: impl Iterator<Item = f64>) -> f64 {
    let (mut n, mut s) = (0.0, 0.0);
    for x in v {
        n += 1.0;
        s += x * x;
    }
    (s / f64::max(n, 1.0)).sqrt()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let value = |name: &str, default: f64| {
        args.iter()
            .position(|a| a == name)
            .and_then(|i| args.get(i + 1))
            .and_then(|s| s.parse().ok())
            .unwrap_or(default)
    };
    let (noise, ar, scale, every, warp) = (
        value("--force-noise", 0.0),
        value("--ar", 0.0),
        value("--scale", 1.0),
        value("--every", 1.0) as usize,
        value("--warp", 1.0),
    );
    let paper = args.iter().any(|a| a == "--paper");
    let verbose = args.iter().any(|a| a == "-v");
    let dump = args.iter().position(|a| a == "--dump").and_then(|i| args.get(i + 1)).cloned();
    let measured =
        std::env::var("STYLET_MEASURED").expect("STYLET_MEASURED names the folder of the measured data");
    let folder = PathBuf::from(measured).join("needle_phantom");
    let mut files: Vec<_> = std::fs::read_dir(&folder)
        .expect("folder")
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.to_string_lossy().contains("_run"))
        .collect();
    files.sort();
    let map = ColumnMap {
        time: Column::scaled("time", 1e-6),
        position: Column::scaled("pz", 1e-3),
        force: Column::si("fz"),
        ..ColumnMap::open()
    };
    let mut config = EnhanceConfig {
        algorithm: if paper { Algorithm::Paper } else { Algorithm::Stylet },
        ..EnhanceConfig::default()
    };
    config.stylet.track_retraction = !args.iter().any(|a| a == "--untracked");
    let (mut n_falls, mut found, mut big, mut big_found, mut smaller, mut groundless, mut retraction) =
        (0, 0, 0, 0, 0, 0, 0);
    let (mut delays, mut drops, mut covered) = (vec![], vec![], 0);
    let (mut alone, mut behind, mut muscles, mut pulses, mut steps) =
        (vec![], vec![], vec![], vec![], vec![]);
    let mut muscle: Option<(Vec<f64>, Vec<f64>)> = None;
    let mut sets: Vec<(String, Vec<f64>, Vec<f64>, f64)> = vec![];
    let mut rng = ChaCha8Rng::seed_from_u64(value("--seed", 1.0) as u64);
    for file in &files {
        let (mut r, _) =
            read_csv(file, &ReadOptions { columns: Some(map.clone()), repair: true }).expect("recording");
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for f in &mut r.force_n {
            *f *= scale;
        }
        for t in &mut r.time_s {
            *t *= warp;
        }
        if every > 1 {
            let keep = |v: &Vec<f64>| v.iter().copied().step_by(every).collect::<Vec<_>>();
            r.time_s = keep(&r.time_s);
            r.position_m = keep(&r.position_m);
            r.force_n = keep(&r.force_n);
        }
        r.velocity_mps = differentiate(&r.time_s, &r.position_m, 0.05);
        let Some((stop, turn)) = deepest_samples(&r.position_m) else {
            eprintln!("{name}: no position");
            continue;
        };
        let falls = |ratio| force_falls(&r, ratio, scale).into_iter().filter(|f| f.at < turn);
        let all: Vec<ForceFall> = falls(1.0).collect();
        let less: Vec<ForceFall> = falls(MINOR_FALL_RATIO).collect();
        let mut noisy = r.clone();
        let mut w = 0.0;
        for f in &mut noisy.force_n {
            let x: f64 = StandardNormal.sample(&mut rng);
            w = ar * w + (1.0 - ar * ar).sqrt() * x;
            *f += noise * w;
        }
        let mut sigma = vec![];
        let trace = Trace::run(&noisy, &noisy.force_n, &config, 0.0, |_, o| {
            sigma.push(o.band_n.map_or(f64::NAN, |b| (b[1] - b[0]) / 3.92))
        });
        let mut taken = vec![false; trace.detections.len()];
        let mut line = String::new();
        for f in &all {
            n_falls += 1;
            let large = f.ratio >= CLEAR_FALL_RATIO;
            big += usize::from(large);
            let (from, at) = (r.time_s[f.from], r.time_s[f.at]);
            let hit = trace
                .detections
                .iter()
                .enumerate()
                .position(|(k, d)| !taken[k] && d.time_s >= from - 0.05 && d.time_s <= at + 0.3);
            match hit {
                Some(k) => {
                    taken[k] = true;
                    found += 1;
                    big_found += usize::from(large);
                    let d = &trace.detections[k];
                    delays.push(1e3 * (d.time_s - at));
                    if verbose {
                        println!(
                            "   fall {:.3} drop {:.3} ± {:.3} at {:.3} s",
                            f.size_n, d.drop_n, d.drop_sd_n, d.time_s
                        );
                    }
                    drops.push(d.drop_n / f.size_n);
                    covered += usize::from((d.drop_n - f.size_n).abs() <= 1.96 * d.drop_sd_n);
                }
                None => {
                    line += &format!(
                        "\n    missed {:.2} N ({:.2}) at {:.3} s {:.2} mm v {:.2}",
                        f.size_n,
                        f.ratio,
                        at,
                        1e3 * r.position_m[f.at],
                        1e3 * r.velocity_mps[f.at]
                    )
                }
            }
        }
        for (k, d) in trace.detections.iter().enumerate() {
            if taken[k] {
                continue;
            }
            let i = r.time_s.iter().position(|t| *t >= d.time_s).unwrap_or(0);
            let small =
                less.iter().find(|f| d.time_s >= r.time_s[f.from] - 0.05 && d.time_s <= r.time_s[f.at] + 0.3);
            let what = if i > turn {
                retraction += 1;
                "during retraction"
            } else if small.is_some() {
                smaller += 1;
                "smaller"
            } else {
                groundless += 1;
                "GROUNDLESS"
            };
            line += &format!(
                "\n    {what} {:.3} s {:.2} mm F {:.2} (fall {:.2})",
                d.time_s,
                1e3 * d.position_m,
                r.force_n[i],
                small.map_or(0.0, |f| f.size_n)
            );
        }
        if name.starts_with("skin") {
            if let Some(first) = all.first() {
                let from = (first.at..r.len())
                    .min_by(|a, b| {
                        let f = |i: &usize| {
                            if r.time_s[*i] <= r.time_s[first.from] + 0.15 { r.force_n[*i] } else { f64::MAX }
                        };
                        f(a).total_cmp(&f(b))
                    })
                    .unwrap_or(first.at);
                if name.starts_with("skin_") {
                    alone.push((
                        rms((from..turn).map(|i| trace.enhanced_n[i])),
                        rms((from..turn).map(|i| r.force_n[i])),
                    ));
                } else if let Some(muscle) = &muscle {
                    let to = all.get(1).map_or(stop, |f| f.from);
                    let of = |z: f64| {
                        let k = muscle.0.partition_point(|x| *x < z).clamp(1, muscle.0.len() - 1);
                        let (a, b) = (muscle.0[k - 1], muscle.0[k]);
                        muscle.1[k - 1]
                            + (muscle.1[k] - muscle.1[k - 1]) * ((z - a) / (b - a)).clamp(0.0, 1.0)
                    };
                    let z = |i: usize| r.position_m[i];
                    behind.push((
                        rms((from..to).map(|i| trace.enhanced_n[i] - scale * of(z(i)))),
                        rms((from..to).map(|i| r.force_n[i] - scale * of(z(i)))),
                    ));
                }
            }
        } else {
            muscles.push((
                r.position_m[..stop].to_vec(),
                r.force_n[..stop].iter().map(|f| f / scale).collect::<Vec<_>>(),
            ));
            let grid: Vec<f64> = (0..1400).map(|k| 0.0108 + 1e-5 * k as f64).collect();
            let mean = grid
                .iter()
                .map(|z| {
                    muscles.iter().map(|(p, f)| f[p.partition_point(|x| x < z).min(f.len() - 1)]).sum::<f64>()
                        / muscles.len() as f64
                })
                .collect::<Vec<_>>();
            muscle = Some((grid, mean));
        }
        // A pulled tip: a half sine of -0.5 N over 2 mm, and a step.
        if !args.iter().any(|a| a == "--no-tip") {
            for at in [0.004, 0.007, 0.012] {
                let x = |i: usize| if i > turn { r.position_m[turn] - r.position_m[i] } else { 0.0 };
                if x(r.len() - 1) < at + 0.003 {
                    continue;
                }
                let enhanced_with = |add: &dyn Fn(f64) -> f64| {
                    let f: Vec<f64> = (0..r.len()).map(|i| noisy.force_n[i] + add(x(i))).collect();
                    Trace::run(&noisy, &f, &config, 0.0, |_, _| {}).enhanced_n
                };
                let pulsed = enhanced_with(&|x| {
                    if x > at && x < at + 0.002 {
                        -0.5 * scale * (std::f64::consts::PI * (x - at) / 0.002).sin()
                    } else {
                        0.0
                    }
                });
                let stepped = enhanced_with(&|x| if x > at { -0.5 * scale } else { 0.0 });
                pulses.push(
                    (0..r.len()).map(|i| (pulsed[i] - trace.enhanced_n[i]).abs()).fold(0.0, f64::max)
                        / 0.5
                        / scale,
                );
                if let Some(i) = (turn..r.len()).find(|&i| x(i) >= at + 0.001) {
                    steps.push((stepped[i] - trace.enhanced_n[i]) / -0.5 / scale);
                }
            }
        }
        let contact = trace.contact_m.unwrap_or(f64::NAN);
        let inside: Vec<usize> = (turn..r.len()).filter(|&i| r.position_m[i] > contact).collect();
        let raw = rms(inside.iter().map(|&i| r.force_n[i]));
        let enh = rms(inside.iter().map(|&i| trace.enhanced_n[i]));
        let spike = inside.iter().map(|&i| trace.enhanced_n[i].abs()).fold(0.0, f64::max);
        let set = name.split("_run").next().unwrap_or("").to_owned();
        if sets.last().is_none_or(|s| s.0 != set) {
            sets.push((set, vec![], vec![], 0.0));
        }
        if let Some(last) = sets.last_mut() {
            last.1.push(raw);
            last.2.push(enh);
            last.3 = last.3.max(spike);
        }
        if verbose || !line.is_empty() {
            println!(
                "{name}: contact {:.2} mm, {} detections, retraction raw {raw:.3} enh {enh:.3} spike {spike:.2}{line}",
                1e3 * contact,
                trace.detections.len()
            );
        }
        if let Some(dir) = &dump {
            let mut s = String::from("t,z,f,e,state,d,sd\n");
            for i in 0..r.len() {
                s += &format!(
                    "{},{},{},{},{},{},{}\n",
                    r.time_s[i],
                    r.position_m[i],
                    noisy.force_n[i],
                    trace.enhanced_n[i],
                    trace.state[i] as u8,
                    trace.cumulative_friction_ns_per_m[i],
                    sigma[i]
                );
            }
            let path = format!("{dir}/{name}.csv");
            if let Err(why) = std::fs::write(&path, s) {
                eprintln!("{path}: {why}");
            }
        }
    }
    delays.sort_by(f64::total_cmp);
    let q = |p: f64| delays.get(((delays.len().max(1) - 1) as f64 * p) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "falls {n_falls}: found {found}; of {big} large ones {big_found}; on smaller falls {smaller}, groundless {groundless}, during retraction {retraction}; delay median {:.0} p95 {:.0} ms",
        q(0.5),
        q(0.95)
    );
    drops.sort_by(f64::total_cmp);
    println!(
        "  {covered} of {found} falls inside the 95 % interval of the drop, which is {:.2} of the fall (median)",
        drops.get(drops.len() / 2).copied().unwrap_or(f64::NAN)
    );
    let root = |v: &[(f64, f64)], k: usize| rms(v.iter().map(|x| if k == 0 { x.0 } else { x.1 }));
    println!(
        "  insertion: behind the skin against muscle alone {:.3} (raw {:.3}); punctured skin with its hold {:.3} (raw {:.3})",
        root(&behind, 0),
        root(&behind, 1),
        root(&alone, 0),
        root(&alone, 1)
    );
    pulses.sort_by(f64::total_cmp);
    steps.sort_by(f64::total_cmp);
    let p =
        |v: &[f64], q: f64| v.get(((v.len().max(1) - 1) as f64 * q) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "  tip during retraction: a pulse keeps {:.2} (least {:.2}), a step after 1 mm {:.2} (least {:.2})",
        p(&pulses, 0.5),
        p(&pulses, 0.0),
        p(&steps, 0.5),
        p(&steps, 0.0)
    );
    for (set, raw, enh, spike) in &sets {
        let m = |v: &Vec<f64>| rms(v.iter().copied());
        println!("  {set}: retraction raw {:.3} enhanced {:.3} spike {spike:.2}", m(raw), m(enh));
    }
}
