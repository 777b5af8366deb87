//! How often `identify` finds the layers of a clean phantom without a scenario.
//!
//! ```sh
//! cargo run --release -p stylet-diagnose --example identified_layers -- CASES SEED
//! ```
//!
//! Draws phantoms of the independent simulator until there are `CASES` (default 60) with each of one to four layers. Per number of layers it
//! prints how often that number is found and no cause is named, how often the surface and all faces between layers are then within 0.3 mm, and
//! how many of the stiffnesses with the label `determined` are within 5 %. Ends with the median time of an identification.

use std::error::Error;
use std::time::Instant;
use stylet_diagnose::diagnosis_json::ParameterLabel;
use stylet_diagnose::{DiagnosisResult, NamedRecording, Options, Verdict, identify};
use stylet_examine::simulator::tissue::Tissue;
use stylet_examine::{Case, CaseId, Hide, NamedFile, Severity, Size, World, Wrong, make_case};
use stylet_stats::wilson;

/// Largest number of layers.
const MAX_LAYERS: usize = 4;
/// Largest error of a face in m that counts as right.
const MAX_FACE_ERROR_M: f64 = 0.3e-3;
/// Largest relative error of a stiffness that counts as right.
const MAX_STIFFNESS_ERROR: f64 = 0.05;

/// Counts for one number of layers.
#[derive(Clone, Default)]
struct Counts {
    cases: usize,
    right_number: usize,
    clean: usize,
    right_faces: usize,
    determined: usize,
    right_stiffness: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let word = |k: usize| args.get(k).map_or("", String::as_str);
    let (cases, seed) = (word(0).parse().unwrap_or(60), word(1).parse().unwrap_or(1));
    let mut all = vec![Counts::default(); MAX_LAYERS];
    let mut times_s = Vec::new();
    for index in 0.. {
        if all.iter().all(|c| c.cases >= cases) {
            break;
        }
        // One or two layers, and two to four.
        for severity in [Severity::Small, Severity::Medium] {
            let case = make_case(&case_id(severity, seed, index))?;
            let layers = case.setup.truth.layers.len();
            let Some(counts) = all.get_mut(layers - 1).filter(|c| c.cases < cases) else { continue };
            let started = Instant::now();
            let found = identified(&case);
            times_s.push(started.elapsed().as_secs_f64());
            counts.add(&case.setup.truth, found.as_ref());
            if found.is_none_or(|f| f.extended_scenario.tissue.layers.len() != layers) {
                println!("{}: not {layers} layers", case.id.name());
            }
        }
    }
    for (k, c) in all.iter().enumerate() {
        let share = |right: usize, of: usize| {
            let i = wilson(right, of);
            format!("{right} of {of} ({:.1} to {:.1} %)", 100.0 * i.low, 100.0 * i.high)
        };
        println!(
            "{} layers: right number {}; no cause {}; all faces within 0.3 mm {}; stiffness within 5 % {}",
            k + 1,
            share(c.right_number, c.cases),
            share(c.clean, c.cases),
            share(c.right_faces, c.right_number),
            share(c.right_stiffness, c.determined)
        );
    }
    println!("median {:.2} s", stylet_stats::order_statistics::median(&mut times_s));
    Ok(())
}

fn case_id(severity: Severity, seed: u64, index: u64) -> CaseId {
    let (world, wrong, hide, size) = (World::Plain, Wrong::NoScenario, Hide::Clean, Size::Strong);
    CaseId { world, wrong, severity, hide, size, seed, index }
}

fn identified(case: &Case) -> Option<DiagnosisResult> {
    let named = |r: &NamedFile| NamedRecording {
        name: r.name.clone(),
        recording: r.recording.clone(),
        notes: Vec::new(),
    };
    let recordings: Vec<NamedRecording> = case.question.recordings.iter().map(named).collect();
    identify("found", &recordings, None, &Options::default(), |_| {}).ok().map(|(_, result)| result)
}

impl Counts {
    fn add(&mut self, truth: &Tissue, found: Option<&DiagnosisResult>) {
        self.cases += 1;
        let Some(found) = found else { return };
        let tissue = &found.extended_scenario.tissue;
        self.clean +=
            usize::from(found.diagnosis.causes.is_empty() && found.diagnosis.verdict != Verdict::Unknown);
        if tissue.layers.len() != truth.layers.len() {
            return;
        }
        self.right_number += 1;
        // The far face of the last layer is not always reached.
        let mut front_m = tissue.surface_m;
        let mut largest_m = 0.0_f64;
        for (k, layer) in tissue.layers.iter().enumerate() {
            largest_m = largest_m.max((front_m - truth.front_m(k)).abs());
            front_m += layer.thickness_m;
        }
        self.right_faces += usize::from(largest_m <= MAX_FACE_ERROR_M);
        for (k, (layer, true_layer)) in tissue.layers.iter().zip(&truth.layers).enumerate() {
            let is_determined = found.diagnosis.parameters.iter().any(|p| {
                p.layer == k + 1
                    && p.effect.is_none()
                    && p.name == "stiffness_n_per_m"
                    && p.label == ParameterLabel::Determined
            });
            if is_determined {
                self.determined += 1;
                let error = (layer.stiffness_n_per_m / true_layer.stiffness_n_per_m - 1.0).abs();
                self.right_stiffness += usize::from(error <= MAX_STIFFNESS_ERROR);
            }
        }
    }
}
