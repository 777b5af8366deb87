//! Writes a drawn case as files: `draw_case DIR EFFECT VALUES SEED AR`, or that of the benchmark:
//! `draw_case DIR sketch INDEX SEED`.
use stylet_api::benchmark::own::aim;
use stylet_own_world::{self as hidden, Drawn, Motions};
use stylet_tissue::AnyEffect;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let text = |k: usize| args.get(k).map_or("", String::as_str);
    let values: Vec<f64> = text(3).split(',').filter_map(|x| x.parse().ok()).collect();
    let own = Drawn {
        seed: text(4).parse().unwrap_or(1),
        effects: AnyEffect::from_parameters(text(2), &values).into_iter().collect(),
        outside: None,
        noise_n: 0.02,
        ar: [text(5).parse().unwrap_or(0.0), 0.0],
        off: 0.15,
        motions: Motions::Rich,
        scatter: 0.0,
        velocity_noise_mps: 0.0,
    };
    let index = values.first().map_or(0, |v| *v as u64);
    let drawn = if text(2) == "sketch" { aim(&hidden::sketch(own.seed, index)) } else { own };
    let case = hidden::case(&drawn);
    let dir = std::path::Path::new(text(1));
    std::fs::create_dir_all(dir)?;
    std::fs::write(dir.join("assumed.ron"), case.believed.to_ron()?)?;
    for (k, r) in case.recordings.iter().enumerate() {
        let mut csv = Vec::new();
        stylet_record::write_csv(r, None, &[], &mut csv)?;
        std::fs::write(
            dir.join(format!("{}.csv", ["constant", "sinusoid", "program_1", "program_2"][k % 4])),
            csv,
        )?;
    }
    Ok(())
}
