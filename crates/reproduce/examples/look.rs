use stylet_reproduce::{claims, study::Study};
fn main() {
    let a: Vec<u64> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let asking = Study::asking(a[0], a[1]);
    let _ = claims::all(&asking);
    let plan = asking.plan();
    eprintln!("{} recordings {} runs", plan.recordings_in_all(), plan.runs_in_all());
    let t = std::time::Instant::now();
    let study = Study::run(&plan, &|| {}).unwrap();
    eprintln!("{:?}", t.elapsed());
    for c in claims::all(&study) { println!("({}) {} — {}\n    {}\n", c.id, c.claim, c.verdict.word(), c.reason); }
    for ((r, s), t) in study.tunings().filter(|x| x.0.0.change.is_none()) { println!("{} {} {:?} s1 {} beta {} wrong {} trace {}", r.case.name(), r.noise_mn, s, t.sigma_rupture_n, t.on_n_per_s, t.wrong, t.trace_below); }
}
