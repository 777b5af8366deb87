//! Layers measured alone, put together: how well they predict the whole.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example composed -- scenarios/measured/skin_on_muscle.ron
//! ```
//! Every part is fitted by the law of a shaft that slips. Of the whole one number is fitted: where its surface lies, by the loading of the
//! runs that are not predicted.

use std::error::Error;
use std::path::Path;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, find_files};
use stylet_diagnose::repeated_insertions::diagnose_set::mean_speeds;
use stylet_diagnose::repeated_insertions::layer_composition::compose_layers;
use stylet_diagnose::repeated_insertions::model_selection::ModelFamily;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name a data set with parts")?;
    let set = Dataset::load(Path::new(&file))?;
    let read = |patterns: &[String], layers: usize| -> Result<Vec<SegmentedRecording>, Box<dyn Error>> {
        let mut files = Vec::new();
        for pattern in patterns {
            files.extend(find_files(pattern)?);
        }
        Ok(set.load_recordings(&files, layers)?)
    };
    let whole = read(&set.recordings, set.tissue.layers.len())?;
    let whole: Vec<&SegmentedRecording> = whole.iter().collect();
    let mut alone = Vec::new();
    for layer in 1..=set.tissue.layers.len() {
        let part = set.parts.iter().find(|p| p.layer == layer).ok_or("a layer has no runs of its own")?;
        alone.push((part.name.clone(), read(&part.recordings, 1)?));
    }
    let told = compose_layers(ModelFamily::ShaftSlip, &set.tissue, &alone, &whole).ok_or("no law")?;
    for (name, floor_n, error_n) in &told.single_layers {
        println!("{name}: {error_n:.3} N on runs left out, floor {:.3} N", floor_n.unwrap_or(f64::NAN));
    }
    for ((speed_mps, _), error_n) in mean_speeds(&whole).iter().zip(&told.composed_n) {
        println!("together at {:.2} mm/s: {error_n:.3} N", 1e3 * speed_mps);
    }
    println!("together: {:.3} N", told.mean_n);
    Ok(())
}
