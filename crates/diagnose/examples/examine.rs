//! Examines drawn cases of one kind and prints each:
//! `cargo run --release -p stylet-diagnose --features own_world --example examine -- single 0 54 [seed [ar2|scatter|velocity|and_outside|one]]`
use rayon::prelude::*;
use stylet_diagnose::Verdict;
use stylet_diagnose::benchmark::run;
use stylet_diagnose::hidden::{Harder, Kind, sketch_of};
use stylet_diagnose::search::Settings;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let kind = match args.get(1).map(String::as_str) {
        Some("clean") => Kind::Clean,
        Some("two") => Kind::Two,
        Some("outside") => Kind::Outside,
        _ => Kind::Single,
    };
    let number = |k: usize, default: u64| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(default);
    let (from, to, seed) = (number(2, 0), number(3, 27), number(4, 1));
    let harder = match args.get(5).map(String::as_str) {
        Some("ar2") => Some(Harder::Ar2),
        Some("scatter") => Some(Harder::Scatter),
        Some("velocity") => Some(Harder::Velocity),
        Some("and_outside") => Some(Harder::AndOutside),
        Some("one") => Some(Harder::One),
        _ => None,
    };
    let indices: Vec<u64> = (from..to).collect();
    let results: Vec<_> = indices
        .par_iter()
        .map(|&i| {
            let sketch = sketch_of(seed, i, kind, i);
            let sketch = harder.map_or(sketch.clone(), |h| h.make(sketch));
            let r = run(i, &sketch, Settings::default());
            if let Some(r) = &r {
                println!(
                    "{:>3} {} {:?} {:.2} sd ar {} {:?}: {:?} {:?} truth {:?} gain {:?} rms {:.4?} left {:.1e} {:.0} expl {:.0} err {:?} {:.1} s",
                    i, if r.right { "ok  " } else { "MISS" }, r.hidden, r.strength, r.ar, r.values, r.verdict, r.named,
                    r.truth_nats.map(f64::round), r.gain.map(|g| (g * 1e3).round() / 1e3), r.rms_n, r.leftover.0, r.leftover.1, r.explained,
                    r.errors.iter().map(|e| format!("{} {:.4}{}", e.0.rsplit('.').next().unwrap_or(""), e.1, if e.2 { "" } else { "!" })).collect::<Vec<_>>(), r.seconds
                );
            }
            r
        })
        .collect();
    let done: Vec<_> = results.into_iter().flatten().collect();
    println!("right {} of {}", done.iter().filter(|r| r.right).count(), done.len());
    let said = |v: Verdict| done.iter().filter(|r| r.verdict == v).count();
    println!(
        "said: none {}, named {}, ambiguous {}, unknown {}; the one hidden is among those named in {}",
        said(Verdict::None),
        said(Verdict::Named),
        said(Verdict::Ambiguous),
        said(Verdict::Unknown),
        done.iter().filter(|r| r.hidden.iter().all(|h| r.named.iter().flatten().any(|n| n == h))).count()
    );
}
