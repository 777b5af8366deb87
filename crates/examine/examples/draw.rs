//! Draws cases and prints what is in them and what the drawing costs:
//! `cargo run --release -p stylet-examine --example draw -- WRONG GRADE HIDE SIZE CASES SEED WORLD`

use stylet_examine::{CaseId, Grade, Hide, Size, World, Wrong, case};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| args.get(k).map_or("", String::as_str);
    let cases = word(4).parse().unwrap_or(27);
    let seed = word(5).parse().unwrap_or(1);
    let mut seconds = 0.0;
    for index in 0..cases {
        let id = CaseId {
            world: World::parse(word(6)).unwrap_or(World::Plain),
            wrong: Wrong::parse(word(0)).unwrap_or(Wrong::Nothing),
            grade: Grade::parse(word(1)).unwrap_or(Grade::Large),
            hide: Hide::parse(word(2)).unwrap_or(Hide::One),
            size: Size::parse(word(3)).unwrap_or(Size::Strong),
            seed,
            index,
        };
        let start = std::time::Instant::now();
        let case = case(&id)?;
        let took = start.elapsed().as_secs_f64();
        seconds += took;
        let hidden: Vec<String> =
            case.setup.effects.iter().map(|e| format!("{} {:?}", e.id(), e.parameters())).collect();
        println!(
            "{index:3} {:6.2} sd {:6} samples {took:.3} s  {} {} {:?} layers {}",
            case.setup.strength_sd,
            case.samples(),
            hidden.join(" + "),
            case.setup.shape.as_ref().map_or("", |s| s.name()),
            stylet_examine::world::ingredients::names(&case.setup.rich),
            case.setup.truth.layers.len()
        );
    }
    println!("{:.3} s per case", seconds / cases as f64);
    Ok(())
}
