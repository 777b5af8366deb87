//! Cases of the own world through the engine. Arguments: kind (0 clean, 1 single, 2 two, 3 outside), first turn, count, seed.
use std::sync::Arc;
use stylet_diagnose::benchmark::aim;
use stylet_diagnose::engine::{base::{Prepared, base}, select::Search};
use stylet_diagnose::hidden::{Kind, case, sketch_of};
use stylet_identify::blocks::{BLOCK_S, Blocks};
use stylet_identify::model::Belief;
use stylet_tissue::Effect;

fn main() {
    let args: Vec<u64> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let kind = [Kind::Clean, Kind::Single, Kind::Two, Kind::Outside][args[0] as usize];
    let (mut right, mut n, mut time) = (0, 0, 0.0);
    for turn in args[1]..args[1] + args[2] {
        let sketch = sketch_of(args[3], turn, kind, turn);
        let mut drawn = aim(&sketch);
        if let Ok(off) = std::env::var("OFF") { drawn.off = off.parse().unwrap_or(0.15); }
        let c = case(&drawn);
        let start = std::time::Instant::now();
        let mut tissue = c.believed.tissue.clone();
        if let Ok(x) = std::env::var("THICK") { let x: f64 = x.parse().unwrap_or(0.0); for (k, l) in tissue.layers.iter_mut().enumerate() { l.thickness_m *= 1.0 + x * [1.0, -0.7, 0.8][k % 3]; } }
        if let Ok(x) = std::env::var("SURFACE") { tissue.surface_m += x.parse::<f64>().unwrap_or(0.0); }
        let layers = tissue.layers.len();
        let belief = Arc::new(Belief { tissue, given: vec![], tolerance: vec![0.3; layers], thickness_tolerance: vec![0.1; layers], surface_tolerance_m: 0.002 });
        let blocks: Vec<Blocks> = c.recordings.iter().map(|r| Blocks::new(r, &[], BLOCK_S)).collect();
        let samples: usize = c.recordings.iter().map(|r| r.len()).sum();
        let prepared = Prepared::new(belief, blocks);
        let t0 = start.elapsed().as_secs_f64();
        let Some((fit, data)) = base(&prepared) else { println!("{turn}: no base"); continue };
        let t1 = start.elapsed().as_secs_f64();
        let base_nats = fit.nats();
        let compared = data.compared();
        let search = Search::run(&prepared, fit, data);
        let t2 = start.elapsed().as_secs_f64();
        let mut hidden: Vec<&str> = drawn.effects.iter().map(|e| e.id()).collect();
        let mut named: Vec<&str> = search.best.model.effects.iter().map(|e| e.info.id).collect();
        hidden.sort_unstable(); named.sort_unstable();
        let ok = hidden == named;
        right += usize::from(ok); n += 1; time += t2;
        println!("{turn} {} target {:.2} {hidden:?} -> {named:?}  base/n {:.3} best/n {:.3} sd {:.4} {samples} samples, prep {t0:.2} base {t1:.2} all {t2:.2} s",
            if ok { "ok " } else { "BAD" }, sketch.target, base_nats / compared as f64, search.best.nats() / compared as f64, search.data.noise.sd_n());
        if !ok || std::env::var("LOUD").is_ok() {
            for e in &drawn.effects { println!("     truth {:?}", e); }
            for (r, i) in search.best.model.instants.iter().enumerate() { println!("     instants {:?} truth {:?}", i.iter().map(|t| (t*1e3).round()/1e3).collect::<Vec<_>>(), c.ruptures[r].iter().map(|t| (t*1e3).round()/1e3).collect::<Vec<_>>()); }
            for e in &search.best.model.effects { println!("     found {} {:?}", e.info.id, e.values); }
            let t = &search.best.model.tissue;
            println!("     surface {:.5} {:?} scatter {:?}", t.surface_m, t.layers.iter().zip(&c.truth.layers).map(|(a, b)| [a.stiffness_n_per_m / b.stiffness_n_per_m, a.friction_ns_per_m2 / b.friction_ns_per_m2, a.puncture_n.unwrap_or(1.0) / b.puncture_n.unwrap_or(1.0), a.thickness_m - b.thickness_m]).collect::<Vec<_>>(), search.best.model.scatter);
            if let Some(e) = drawn.effects.first() { use stylet_identify::{fit::{fit, Effort}, model::Choice};
                let m = search.base.model.with(Choice::new(e.info(), &e.parameters()));
                if let Some(f) = fit(&m, &search.data, Effort::FULL) { println!("     with truth: base {:.1} truth {:.1} values {:?} scatter {:?}", search.base.nats(), f.nats(), f.model.effects.last().map(|e| e.values.clone()), f.model.scatter);
                    for ev in f.residuals.events.iter().flatten() { println!("        {ev:?}"); } } }
            for s in &search.stages { println!("     {:?} {:?} -> {:?}", s.stood, s.rivals, s.taken); }
        }
    }
    println!("{right} of {n}, {:.2} s per case", time / n as f64);
}
