//! Development aid: one form fitted directly.
use stylet_record::{Column, ColumnMap, ReadOptions, read_csv};
use stylet_repeats::fit::{Effort, Spread, fit};
use stylet_repeats::population::Population;
use stylet_repeats::run::Run;
use stylet_repeats::shape::{Ingredient as I, Shape};
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
    let layer = Layer {
        name: String::new(),
        thickness_m: 0.011,
        stiffness_n_per_m: 300.0,
        friction_ns_per_m2: 1e4,
        puncture_n: None,
    };
    let believed = Tissue { surface_m: 0.004, layers: vec![layer; layers] };
    let frame = frame::frame(&believed, &runs);
    println!("{:?} {:?} {:?}", frame.fronts_m, frame.loads, frame.unseen);
    let sets: Vec<Vec<I>> = vec![vec![
        I::Presliding,
        I::PowerLaw,
        I::Indentation,
        I::Nonlinear,
        I::PerLayer,
        I::Relaxation,
        I::SecondTerm,
        I::RatePuncture,
    ]];
    let _x: Vec<Vec<I>> = vec![
        vec![],
        vec![I::Indentation],
        vec![I::Presliding, I::PowerLaw, I::Indentation],
        vec![I::Presliding, I::PowerLaw, I::Indentation, I::Nonlinear],
        vec![I::Presliding, I::PowerLaw, I::Indentation, I::Nonlinear, I::PerLayer],
        vec![I::Presliding, I::PowerLaw, I::Indentation, I::Nonlinear, I::Relaxation],
        vec![I::Presliding, I::PowerLaw, I::Indentation, I::Nonlinear, I::PerLayer, I::Relaxation],
        vec![
            I::Presliding,
            I::PowerLaw,
            I::Indentation,
            I::Nonlinear,
            I::PerLayer,
            I::Relaxation,
            I::SecondTerm,
        ],
        vec![
            I::Presliding,
            I::PowerLaw,
            I::Indentation,
            I::Nonlinear,
            I::PerLayer,
            I::Relaxation,
            I::SecondTerm,
            I::RatePuncture,
        ],
    ];
    for with in sets {
        let shape = Shape { with, ..Shape::base(frame.clone()) };
        let start: Vec<f64> = shape.numbers().iter().map(|n| n.start).collect();
        let t = std::time::Instant::now();
        let f =
            fit(&shape, start, None, &runs, Spread::default(), Effort { steps: 40, rounds: 3 }).expect("fit");
        let p = Population::of(&f, &runs);
        let insample: f64 = runs.iter().map(|r| gain::thin_error(&f, &p, r)).sum::<f64>() / runs.len() as f64;
        let q = gain::quick(&f, &runs, &ladder::folds(&runs), Effort { steps: 6, rounds: 1 });
        println!(
            "{:?}\n   cond {:.4} mean {insample:.4} left out {q:.4?} cost {:.1} {:.1} s",
            f.shape.with.iter().map(|i| i.label()).collect::<Vec<_>>(),
            f.rms_n,
            f.cost,
            t.elapsed().as_secs_f64()
        );
        let text: Vec<String> = f
            .shape
            .numbers()
            .iter()
            .zip(&f.x)
            .map(|(n, x)| format!("{}={:.4}", n.name, n.value(*x)))
            .collect();
        for (i, run) in runs.iter().enumerate() {
            println!(
                "   {:.2} shift {:.3} mm friction {:.3} at {:.2?} error {:.3}",
                run.speed_mps * 1e3,
                f.own[i].shift_m * 1e3,
                f.own[i].friction_log,
                f.at_rupture[i],
                gain::thin_error(&f, &p, run)
            );
        }
        println!("{p:?}");
        println!("   {}\n   {:?}", text.join(" "), f.spread);
    }
}
