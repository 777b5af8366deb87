//! Time of a replay, a Jacobian and a fit, per sample.
use std::time::Instant;
use stylet_diagnose::fit::{Residuals, fit, jacobian, residuals};
use stylet_diagnose::hidden::{self, Kind};
use stylet_diagnose::search::{Search, Settings, choice};
use stylet_diagnose::track::Track;

fn main() {
    let sketch = hidden::sketch_of(1, 0, Kind::Clean, 0);
    let case = hidden::case(&sketch.drawn);
    let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
    let t = Instant::now();
    let Some(search) = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default()) else {
        return;
    };
    println!("base fit {:.3} s, {} samples", t.elapsed().as_secs_f64(), search.data.samples());
    let data = &search.data;
    let coarse = data.blocks(search.q, data.noise.blocks(search.q));
    for (id, v) in [
        ("", vec![]),
        ("coulomb_friction", vec![1.0]),
        ("stress_relaxation", vec![0.2, 2.0]),
        ("low_pass_lag", vec![0.05]),
        ("needle_compliance", vec![800.0]),
        ("hidden_membrane", vec![0.02, 60.0, 0.3]),
    ] {
        let mut model = search.base.model.clone();
        if let Some(c) = choice(id, &v) {
            model = model.with(c);
        }
        let (mut a, mut b) = (Residuals::default(), Residuals::default());
        residuals(&model, data, &mut a);
        let t = Instant::now();
        for _ in 0..5 {
            residuals(&model, data, &mut a);
        }
        let full = t.elapsed().as_secs_f64() / 5.0;
        let t = Instant::now();
        residuals(&model, &coarse, &mut a);
        let small = t.elapsed().as_secs_f64();
        let t = Instant::now();
        let _ = jacobian(&model, &coarse, &a, &mut b, None);
        let jac = t.elapsed().as_secs_f64();
        let t = Instant::now();
        let f = fit(&model, &coarse, 7, 0.1);
        println!(
            "{id:<20} full {:.1} ns/sample; coarse replay {:.2} ms, jacobian {:.2} ms, fit {:.1} ms, {:?}",
            full / data.samples() as f64 * 1e9,
            small * 1e3,
            jac * 1e3,
            t.elapsed().as_secs_f64() * 1e3,
            f.map(|f| f.nats)
        );
    }
}
