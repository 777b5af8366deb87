//! Development aid: the search over recordings given on the command line.
use std::time::Instant;
use stylet_record::{Column, ColumnMap, ReadOptions, read_csv};
use stylet_repeats::fit::Effort;
use stylet_repeats::run::Run;
use stylet_repeats::stats::mean_sd;
use stylet_repeats::{frame, gain, ladder};
use stylet_tissue::{Layer, Tissue};

fn main() {
    let mut args = std::env::args().skip(1);
    let layers: usize = args.next().and_then(|x| x.parse().ok()).expect("number of layers");
    let map = ColumnMap {
        time: Column::scaled("time", 1e-6),
        position: Column::scaled("pz", 1e-3),
        force: Column::si("fz"),
        ..ColumnMap::default()
    };
    let options = ReadOptions { columns: Some(map), repair: false };
    let runs: Vec<Run> = args
        .map(|path| {
            let (r, notes) = read_csv(&path, &options).expect("readable");
            Run::new(path, r, notes, layers)
        })
        .collect();
    let runs: Vec<&Run> = runs.iter().collect();
    for run in &runs {
        let z: Vec<_> = run
            .ruptures
            .iter()
            .map(|r| r.map(|i| (run.recording.position_m[i] * 1e5).round() / 100.0))
            .collect();
        let x: Vec<_> = run.releases_m.iter().map(|r| r.map(|z| (z * 1e5).round() / 100.0)).collect();
        println!(
            "{:.2} mm/s contact {:.2} ruptures {z:?} releases {x:?}",
            run.speed_mps * 1e3,
            run.contact_m * 1e3
        );
    }
    let layer = Layer {
        name: String::new(),
        thickness_m: 0.011,
        stiffness_n_per_m: 300.0,
        friction_ns_per_m2: 1e4,
        puncture_n: None,
    };
    let believed = Tissue { surface_m: 0.004, layers: vec![layer; layers] };
    let t = Instant::now();
    let l = ladder::climb(frame::frame(&believed, &runs), &runs, |what| {
        println!("{:6.2} s {what}", t.elapsed().as_secs_f64())
    })
    .expect("a fit");
    for (n, x) in l.best.shape.numbers().iter().zip(&l.best.x) {
        println!("{} = {:.5}", n.name, n.value(*x));
    }
    println!("spread {:?} rms {:.4}", l.best.spread, l.best.rms_n);
    for (i, e) in &l.without {
        println!("without {}: {e:.4}", i.label());
    }
    let floor = gain::floor(&runs);
    let single: Vec<Vec<usize>> = (0..runs.len()).map(|i| vec![i]).collect();
    let groups: Vec<Vec<usize>> = gain::speeds(&runs).into_iter().map(|g| g.1).collect();
    let effort = Effort { steps: 6, rounds: 1 };
    for (what, fit, groups) in
        [("base", &l.base, &single), ("extended", &l.best, &single), ("speed out", &l.best, &groups)]
    {
        if groups.len() < 2 {
            continue;
        }
        let mut all: Vec<_> =
            gain::leave_out(fit, &runs, groups, effort).into_iter().flat_map(|g| g.1).collect();
        all.sort_by_key(|a| a.0);
        let e: Vec<f64> = all.iter().map(|a| a.1.rmse_n).collect();
        let c: Vec<f64> = all.iter().map(|a| a.1.covered).collect();
        println!(
            "{what}: {:.4} covered {:.3} {:.3?} {:.2?} at {:.1} s",
            mean_sd(&e).0,
            mean_sd(&c).0,
            e,
            c,
            t.elapsed().as_secs_f64()
        );
    }
    let f: Vec<f64> = floor.iter().map(|f| f.unwrap_or(f64::NAN)).collect();
    println!("floor {:.4} {:.3?}", mean_sd(&f).0, f);
}
