//! Draws cases and prints what is in them and what the drawing costs:
//! `cargo run --release -p stylet-examine --example draw -- WRONG GRADE HIDE SIZE CASES SEED WORLD`

use stylet_examine::{CaseId, Hide, Severity, Size, World, Wrong, make_case};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| args.get(k).map_or("", String::as_str);
    let cases = word(4).parse().unwrap_or(27);
    let seed = word(5).parse().unwrap_or(1);
    let mut seconds = Vec::new();
    for index in 0..cases {
        let id = CaseId {
            world: World::parse(word(6)).unwrap_or(World::Plain),
            wrong: Wrong::parse(word(0)).unwrap_or(Wrong::Nothing),
            severity: Severity::parse(word(1)).unwrap_or(Severity::Large),
            hide: Hide::parse(word(2)).unwrap_or(Hide::One),
            size: Size::parse(word(3)).unwrap_or(Size::Strong),
            seed,
            index,
        };
        let start = processor_s();
        let case = make_case(&id)?;
        let took = processor_s() - start;
        seconds.push(took);
        let hidden: Vec<String> =
            case.setup.effects.iter().map(|e| format!("{} {:?}", e.id(), e.parameters())).collect();
        println!(
            "{index:3} {:6.2} sd {:6} samples {took:.3} s  {} {} {:?} layers {}",
            case.setup.strength_sd,
            case.samples(),
            hidden.join(" + "),
            case.setup.shape.as_ref().map_or("", |s| s.name()),
            stylet_examine::cases::rich_world_effects::names(&case.setup.rich),
            case.setup.truth.layers.len()
        );
    }
    let mean = seconds.iter().sum::<f64>() / cases as f64;
    println!(
        "processor time per case: mean {mean:.3} s, p90 {:.2} s",
        stylet_stats::quantile_of(seconds.iter().copied(), 0.9)
    );
    Ok(())
}

/// Processor time (s) of this process so far; zero where the system does not report it.
fn processor_s() -> f64 {
    const TICK_HZ: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|x| x.parse::<f64>().ok());
    ticks.sum::<f64>() / TICK_HZ
}
