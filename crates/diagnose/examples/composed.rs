//! Layers measured alone, put together: how well they predict the whole.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example composed -- scenarios/measured/skin_on_muscle.ron
//! ```
//! Every part is fitted by the law of a shaft that slips. Of the whole one number is fitted: where its surface lies, by the loading of the
//! runs that are not predicted.

use std::error::Error;
use std::path::Path;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::compose::compose;
use stylet_diagnose::set::dataset::{Dataset, find};
use stylet_diagnose::set::laws::Kind;
use stylet_diagnose::set::study::speeds;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name a data set with parts")?;
    let set = Dataset::load(Path::new(&file))?;
    let read = |patterns: &[String], layers: usize| -> Result<Vec<Insertion>, Box<dyn Error>> {
        let mut files = Vec::new();
        for pattern in patterns {
            files.extend(find(pattern)?);
        }
        Ok(set.runs(&files, layers)?)
    };
    let whole = read(&set.recordings, set.tissue.layers.len())?;
    let whole: Vec<&Insertion> = whole.iter().collect();
    let mut alone = Vec::new();
    for layer in 1..=set.tissue.layers.len() {
        let part = set.parts.iter().find(|p| p.layer == layer).ok_or("a layer has no runs of its own")?;
        alone.push((part.name.clone(), read(&part.recordings, 1)?));
    }
    let told = compose(Kind::Slip, &set.tissue, &alone, &whole).ok_or("no law")?;
    for (name, floor_n, error_n) in &told.alone {
        println!("{name}: {error_n:.3} N on runs left out, floor {:.3} N", floor_n.unwrap_or(f64::NAN));
    }
    for ((speed_mps, _), error_n) in speeds(&whole).iter().zip(&told.composed_n) {
        println!("together at {:.2} mm/s: {error_n:.3} N", 1e3 * speed_mps);
    }
    println!("together: {:.3} N", told.mean_n);
    Ok(())
}
