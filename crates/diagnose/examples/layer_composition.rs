//! Composition of layers measured alone: how well does it predict the whole stack?
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example layer_composition -- scenarios/measured/skin_on_muscle.ron
//! ```
//!
//! Every layer is fitted by the stick-slip model. Only the surface of the stack is fitted, to the loading
//! of the recordings that are not predicted.

use std::error::Error;
use std::path::Path;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, find_files};
use stylet_diagnose::repeated_insertions::layer_composition::compose_layers;
use stylet_diagnose::repeated_insertions::scored_model::ModelFamily;
use stylet_diagnose::repeated_insertions::segmented_recording::mean_speeds;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name a data set with single layers")?;
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
        let part =
            set.parts.iter().find(|p| p.layer == layer).ok_or("a layer has no recordings of its own")?;
        alone.push((part.name.clone(), read(&part.recordings, 1)?));
    }
    let composition =
        compose_layers(ModelFamily::ShaftSlip, &set.tissue, &alone, &whole).ok_or("no model")?;
    for (name, floor_n, error_n) in &composition.single_layers {
        println!("{name}: {error_n:.3} N held out, floor {:.3} N", floor_n.unwrap_or(f64::NAN));
    }
    for ((speed_mps, _), error_n) in mean_speeds(&whole).iter().zip(&composition.composed_n) {
        println!("stack at {:.2} mm/s: {error_n:.3} N", 1e3 * speed_mps);
    }
    println!("stack: {:.3} N", composition.mean_n);
    Ok(())
}
