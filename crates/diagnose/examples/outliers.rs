//! What remains of a drawn case under its truth, and what the search says of it: for finding where replay and
//! generator part. `cargo run --release -p stylet-diagnose --features own_world --example outliers -- two 15 22`
use stylet_diagnose::benchmark::aim;
use stylet_diagnose::fit::{Data, Residuals, residuals};
use stylet_diagnose::hidden::{self, Kind};
use stylet_diagnose::model::Choice;
use stylet_diagnose::refine::refine;
use stylet_diagnose::search::{Search, Settings};
use stylet_diagnose::track::Track;
use stylet_tissue::{AnyEffect, Effect};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let kind = match args.get(1).map(String::as_str) {
        Some("clean") => Kind::Clean,
        Some("two") => Kind::Two,
        Some("outside") => Kind::Outside,
        _ => Kind::Single,
    };
    let number = |k: usize| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(1);
    let drawn = aim(&hidden::sketch_of(number(3), number(2), kind, number(2)));
    let case = hidden::case(&drawn);
    let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
    let Some(mut search) = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default())
    else {
        return;
    };
    let mut truth = search.base.model.clone();
    truth.tissue = case.truth.clone();
    truth.effects = drawn.effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    let mut data = search.data.clone();
    let delay: f64 =
        drawn.effects.iter().map(|e| if let AnyEffect::TimeDelay(d) = e { d.delay_s } else { 0.0 }).sum();
    data.ruptures = case.ruptures.iter().map(|r| r.iter().map(|t| t + delay).collect()).collect();
    let Some(fit) = refine(&truth, &mut data, 3, 8, false) else { return };
    println!("truth {:?}", drawn.effects);
    println!(
        "fitted from it: {:.1} nats of {} samples: {:?}",
        fit.nats,
        data.samples(),
        fit.model.effects.iter().map(|e| &e.values).collect::<Vec<_>>()
    );
    let mut r = Residuals::default();
    residuals(&fit.model, &data, &mut r);
    println!("events {:?}", r.events.iter().map(|e| (e.u * 10.0).round() / 10.0).collect::<Vec<_>>());
    let mut from = 0;
    for (k, track) in data.tracks.iter().enumerate() {
        println!("{k}: ruptures {:?}", data.ruptures[k]);
        println!(
            "   jumps of the velocity {:?}",
            track.kinks.iter().map(|k| (k.t * 1e4).round() / 1e4).collect::<Vec<_>>()
        );
        for i in (0..track.len()).filter(|i| r.w[from + i].abs() > 4.2) {
            let (t, z, v, f) = (track.t[i], track.z[i], track.v[i], track.f[i]);
            println!("   t {t:.3} z {z:.5} v {v:.5} f {f:.3} e {:.3} w {:.1}", r.e[from + i], r.w[from + i]);
        }
        from += track.len();
    }
    search.run(|_| {});
    for s in &search.stages {
        println!("on {:?}: needed {:.1}, taken {:?}", s.stood, s.needed, s.taken);
        println!(
            "  screened {:?}",
            s.screened.iter().map(|(n, g)| format!("{n} {g:.1}")).collect::<Vec<_>>()
        );
        println!(
            "  rivals {:?}",
            s.rivals.iter().map(|(n, g, p)| format!("{n} {g:.1} ({p})")).collect::<Vec<_>>()
        );
    }
    println!(
        "found {:.1} nats: {:?}",
        search.best.nats,
        search.best.model.effects.iter().map(|e| (e.info.id, &e.values)).collect::<Vec<_>>()
    );
    println!("ruptures {:?}", search.best.ruptures);
    // The truth under the search's noise, and the search's model without its last effect.
    let mut there = Data { ruptures: data.ruptures.clone(), ..search.data.clone() };
    if let Some(f) = refine(&fit.model, &mut there, 3, 8, true) {
        println!(
            "truth under this noise: {:.1} {:?} F {:?} K {:?}",
            f.nats,
            f.model.effects.iter().map(|e| &e.values).collect::<Vec<_>>(),
            f.model.tissue.layers.iter().map(|l| l.puncture_n).collect::<Vec<_>>(),
            f.model.tissue.layers.iter().map(|l| l.stiffness_n_per_m).collect::<Vec<_>>()
        );
        println!("ruptures {:?}", there.ruptures);
    }
    for (k, e) in search.best.model.effects.iter().enumerate() {
        let mut there = search.data_of(&search.best);
        if let Some(f) = refine(&search.best.model.without(k), &mut there, 4, 8, true) {
            println!(
                "without {}: {:.1} {:?} F {:?} K {:?}",
                e.info.id,
                f.nats,
                f.model.effects.iter().map(|e| &e.values).collect::<Vec<_>>(),
                f.model.tissue.layers.iter().map(|l| l.puncture_n).collect::<Vec<_>>(),
                f.model.tissue.layers.iter().map(|l| l.stiffness_n_per_m).collect::<Vec<_>>()
            );
            println!("ruptures {:?}", there.ruptures);
        }
    }
}
