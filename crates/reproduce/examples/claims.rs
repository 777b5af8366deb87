fn main() {
    let seeds = std::env::args().nth(1).map_or(6, |s| s.parse().unwrap());
    let t = std::time::Instant::now();
    let study = stylet_reproduce::study::Study::run(seeds, &|| {}).unwrap();
    eprintln!("{:?}", t.elapsed());
    for c in stylet_reproduce::claims::all(&study).unwrap() {
        println!("({}) {} -> {}", c.id, c.claim, c.verdict.words());
        for k in &c.conditions { println!("     {:>3}/{:<3} {}", k.holds, k.of, k.name); }
        for (n, s) in &c.numbers { println!("        {n}: {:.5} [{:.5}, {:.5}] n {}/{}", s.median, s.p5, s.p95, s.n, s.of); }
    }
}
