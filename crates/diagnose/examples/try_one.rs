//! Diagnoses one drawn case and prints what the search did:
//! `cargo run --release -p stylet-diagnose --features own_world --example try_one -- coulomb_friction 3.0 seed ar`
use std::time::Instant;
use stylet_diagnose::hidden::{self, Drawn, Motions};
use stylet_diagnose::search::{Search, Settings};
use stylet_diagnose::track::Track;
use stylet_tissue::AnyEffect;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let id = args.get(1).cloned().unwrap_or_default();
    let values: Vec<f64> = args.get(2).map_or("", |s| s).split(',').filter_map(|x| x.parse().ok()).collect();
    let seed = args.get(3).and_then(|s| s.parse().ok()).unwrap_or(1);
    let ar = args.get(4).and_then(|s| s.parse().ok()).unwrap_or(0.0);
    let drawn = Drawn {
        seed,
        effects: AnyEffect::from_parameters(&id, &values).into_iter().collect(),
        outside: None,
        noise_n: 0.02,
        ar: [ar, 0.0],
        off: 0.15,
        motions: Motions::Rich,
        scatter: 0.0,
        velocity_noise_mps: 0.0,
    };
    let drawn = match args.get(5).and_then(|s| s.parse().ok()) {
        Some(index) => {
            let seed = args.get(6).and_then(|s| s.parse().ok()).unwrap_or(1);
            Drawn {
                effects: drawn.effects,
                ..hidden::sketch_of(seed, index, hidden::Kind::Single, index).drawn
            }
        }
        None => drawn,
    };
    let case = hidden::case(&drawn);
    println!("samples {:?}", case.recordings.iter().map(|r| r.len()).collect::<Vec<_>>());
    println!("true ruptures {:?}", case.ruptures);
    let start = Instant::now();
    let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
    let Some(mut search) = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default())
    else {
        println!("no base fit");
        return;
    };
    println!(
        "base {:.2} s, nats {:.1} of {}",
        start.elapsed().as_secs_f64(),
        search.base.nats,
        search.data.samples()
    );
    println!("ruptures      {:?}", search.base.ruptures);
    println!("noise {:?} air {:?}", search.data.noise, search.air);
    for (l, (fitted, truth)) in search.base.model.tissue.layers.iter().zip(&case.truth.layers).enumerate() {
        println!(
            "  layer {l}: K {:.3} ({:.3}) b {:.1} ({:.1}) F {:?} ({:?})",
            fitted.stiffness_n_per_m,
            truth.stiffness_n_per_m,
            fitted.friction_ns_per_m2,
            truth.friction_ns_per_m2,
            fitted.puncture_n,
            truth.puncture_n
        );
    }
    search.run(|_| {});
    println!("search {:.2} s", start.elapsed().as_secs_f64());
    for s in &search.stages {
        println!("stage on {:?}: needed {:.1} taken {:?}", s.stood, s.needed, s.taken);
        println!(
            "  screened {:?}",
            s.screened.iter().map(|(n, g)| format!("{n} {g:.1}")).collect::<Vec<_>>()
        );
        println!(
            "  rivals {:?}",
            s.rivals.iter().map(|(n, g, p)| format!("{n} {g:.1} ({p})")).collect::<Vec<_>>()
        );
    }
    for e in &search.best.model.effects {
        println!("{} {:?}", e.info.id, e.values);
    }
    let choices: Vec<_> = drawn
        .effects
        .iter()
        .map(|e| {
            use stylet_tissue::Effect;
            stylet_diagnose::model::Choice::new(e.info(), &e.parameters())
        })
        .collect();
    let mut truth = search.base.model.clone();
    truth.tissue = case.truth.clone();
    truth.effects = choices;
    let mut data = search.data.clone();
    data.ruptures = case.ruptures.clone();
    println!("truth as drawn {:.1}", stylet_diagnose::search::nats(&truth, &data));
    if let Some(f) = stylet_diagnose::refine::refine(&truth, &mut data, 3, 8, false) {
        println!(
            "truth refined {:.1}: {:?} {:?}",
            f.nats,
            f.model.effects.iter().map(|e| &e.values).collect::<Vec<_>>(),
            data.ruptures
        );
        println!("  K {:?}", f.model.tissue.layers.iter().map(|l| l.stiffness_n_per_m).collect::<Vec<_>>());
    }
    println!(
        "found K {:?}",
        search.best.model.tissue.layers.iter().map(|l| l.stiffness_n_per_m).collect::<Vec<_>>()
    );
    println!("nats {:.1}; ruptures {:?}", search.best.nats, search.best.ruptures);
}
