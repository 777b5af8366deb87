//! Whitened residuals beyond 4 of a drawn case under its truth.
use stylet_diagnose::fit::{Residuals, residuals};
use stylet_diagnose::hidden::{self, Drawn, Kind};
use stylet_diagnose::model::Choice;
use stylet_diagnose::refine::refine;
use stylet_diagnose::search::{Search, Settings};
use stylet_diagnose::track::Track;
use stylet_tissue::{AnyEffect, Effect};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let id = args.get(1).cloned().unwrap_or_default();
    let values: Vec<f64> = args.get(2).map_or("", |s| s).split(',').filter_map(|x| x.parse().ok()).collect();
    let number = |k: usize| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(1);
    let drawn = Drawn {
        effects: AnyEffect::from_parameters(&id, &values).into_iter().collect(),
        ..hidden::sketch_of(number(4), number(3), Kind::Single, number(3)).drawn
    };
    let case = hidden::case(&drawn);
    let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
    let Some(search) = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default()) else {
        return;
    };
    let mut truth = search.base.model.clone();
    truth.tissue = case.truth.clone();
    truth.effects = drawn.effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    let mut data = search.data.clone();
    let delay = if id == "time_delay" { values[0] } else { 0.0 };
    data.ruptures = case.ruptures.iter().map(|r| r.iter().map(|t| t + delay).collect()).collect();
    let Some(fit) = refine(&truth, &mut data, 3, 8, false) else { return };
    println!("nats {:.1} of {}: {:?}", fit.nats, data.samples(), fit.model.effects[0].values);
    let mut r = Residuals::default();
    residuals(&fit.model, &data, &mut r);
    println!("events {:?}", r.events.iter().map(|e| (e.u * 10.0).round() / 10.0).collect::<Vec<_>>());
    let mut from = 0;
    for (k, track) in data.tracks.iter().enumerate() {
        println!(
            "ruptures {:?} kinks {:?}",
            data.ruptures[k],
            track.kinks.iter().map(|k| (k.t * 1e3).round() / 1e3).collect::<Vec<_>>()
        );
        for i in 0..track.len() {
            if r.w[from + i].abs() > 4.2 {
                println!(
                    "  t {:.3} z {:.5} v {:.5} f {:.3} e {:.3} w {:.1}",
                    track.t[i],
                    track.z[i],
                    track.v[i],
                    track.f[i],
                    r.e[from + i],
                    r.w[from + i]
                );
            }
        }
        from += track.len();
    }
}
