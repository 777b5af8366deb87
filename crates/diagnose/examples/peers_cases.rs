//! Draws cases for sparse regressions and writes what they are given, the truth, and this diagnosis's own
//! answer: `cargo run --release -p stylet-diagnose --features own_world --example peers_cases -- DIR CASES SEED`
//!
//! Of ten cases three are clean, five have one effect, one has two, one has an effect outside the library;
//! effects and strengths go round. Per case `SEED-INDEX.json` (truth, names of the columns) with `SEED-INDEX.f32`
//! (little-endian, column after column, the residual first), and `SEED-INDEX.stylet.json` (the answer). Files that are there
//! stay: an interrupted run goes on where it stopped.
use serde_json::json;
use std::path::Path;
use std::time::Instant;
use stylet_diagnose::benchmark::{aim, examine};
use stylet_diagnose::hidden::{self, Drawn, Kind, SAMPLE_HZ, Sketch, sketch_of};
use stylet_diagnose::search::{Search, Settings};
use stylet_diagnose::terms::Terms;
use stylet_diagnose::track::Track;
use stylet_tissue::Effect;

/// Samples per row.
const MEAN_OF: usize = 2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, dir, cases, seed] = &args[..] else { return Err("peers_cases DIR CASES SEED".into()) };
    let (dir, cases, seed) = (Path::new(dir), cases.parse::<u64>()?, seed.parse::<u64>()?);
    std::fs::create_dir_all(dir)?;
    for index in 0..cases {
        let stem = dir.join(format!("{seed}-{index:04}"));
        let (about, answer) = (stem.with_extension("json"), stem.with_extension("stylet.json"));
        if about.exists() && answer.exists() {
            continue;
        }
        let sketch = spread(seed, index);
        let drawn = aim(&sketch);
        if !about.exists() {
            write_terms(&stem, seed, index, sketch.kind, &drawn)?;
        }
        if !answer.exists() {
            let (start, used) = (Instant::now(), processor_s());
            let result = examine(index, sketch.kind, &drawn, Settings::default())
                .ok_or_else(|| format!("case {index} of seed {seed} cannot be fitted"))?;
            // Of the diagnosis alone: its own time by the share of the processor that it got.
            let share = (processor_s() - used) / start.elapsed().as_secs_f64();
            let mut said = serde_json::to_value(&result)?;
            said["processor_s"] = json!(result.seconds * if share > 0.0 { share } else { 1.0 });
            put(&answer, &serde_json::to_vec(&said)?)?;
            println!(
                "{seed}-{index} {:?} {:?} {:.2} sd: {:?} {:?} {}, {:.1} s",
                result.kind,
                result.hidden,
                result.strength,
                result.verdict,
                result.named,
                if result.right { "ok" } else { "MISS" },
                result.seconds
            );
        }
    }
    Ok(())
}

/// The sketch of a case: every effect comes round before one comes again, then with another strength.
fn spread(seed: u64, index: u64) -> Sketch {
    let round = index / 10;
    let (kind, turn) = match index % 10 {
        0..3 => (Kind::Clean, index),
        k @ 3..8 => {
            let effects = hidden::library_ids().len() as u64;
            let single = round * 5 + k - 3;
            let (effect, size) = (single % effects, (single + single / effects) % 3);
            (Kind::Single, effects * size + effect)
        }
        8 => (Kind::Two, round),
        _ => (Kind::Outside, 3 * (round % 8) + (round + round / 8) % 3),
    };
    sketch_of(seed, index, kind, turn)
}

fn write_terms(
    stem: &Path,
    seed: u64,
    index: u64,
    kind: Kind,
    drawn: &Drawn,
) -> Result<(), Box<dyn std::error::Error>> {
    let case = hidden::case(drawn);
    let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
    let start = Instant::now();
    let search =
        Search::base(&case.believed.tissue, case.believed.tolerance, &[], tracks, 0.0, Settings::default())
            .ok_or("no base fit")?;
    let base_s = start.elapsed().as_secs_f64();
    let terms = Terms::of(&search, MEAN_OF).ok_or("no terms")?;
    let terms_s = start.elapsed().as_secs_f64() - base_s;
    let noise = search.data.noise.blocks(MEAN_OF);
    let hidden: Vec<&str> = match &drawn.outside {
        Some(o) => vec![hidden::OUTSIDE[o.kind]],
        None => drawn.effects.iter().map(Effect::id).collect(),
    };
    let about = json!({
        "seed": seed,
        "index": index,
        "kind": kind,
        "hidden": hidden,
        "values": drawn.effects.iter().map(|e| e.parameters()).collect::<Vec<_>>(),
        "recordings": case.recordings.len(),
        "sample_hz": SAMPLE_HZ / MEAN_OF as f64,
        "rows": terms.y.len(),
        "noise_sd_n": noise.marginal_n,
        "noise_ar": noise.a,
        "base_s": base_s,
        "terms_s": terms_s,
        "recording": terms.recording,
        "columns": terms.columns.iter().map(|c| json!({"effect": c.effect, "values": c.values})).collect::<Vec<_>>(),
    });
    let all = std::iter::once(&terms.y).chain(terms.columns.iter().map(|c| &c.x)).flatten();
    let bytes: Vec<u8> = all.flat_map(|x| (*x as f32).to_le_bytes()).collect();
    put(&stem.with_extension("f32"), &bytes)?;
    put(&stem.with_extension("json"), &serde_json::to_vec(&about)?)
}

/// Processor time (s) of this process so far, in all its threads; zero where the system does not tell.
fn processor_s() -> f64 {
    const TICK_HZ: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|x| x.parse::<f64>().ok());
    ticks.sum::<f64>() / TICK_HZ
}

/// Written beside, then renamed.
fn put(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn std::error::Error>> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    std::fs::write(&beside, bytes)?;
    std::fs::rename(&beside, path)?;
    Ok(())
}
