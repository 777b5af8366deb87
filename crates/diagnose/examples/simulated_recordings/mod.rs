//! Recordings simulated with the model fitted to a measured set.

use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::error::Error;
use std::path::Path;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::dataset::{Dataset, find_files};
use stylet_diagnose::repeated_insertions::insertion_phase::phase_at;
use stylet_diagnose::repeated_insertions::population_prediction::draw_force;
use stylet_diagnose::repeated_insertions::random_effects_population::Population;

/// Correlation time (s) of the residual.
const SLOW_S: f64 = 0.5;
/// Sensor noise (N).
const NOISE_N: f64 = 0.012;
/// Number of recordings of a population without sampling uncertainty.
pub const EXACT: usize = 1_000_000;

/// Command-line arguments and the data they name.
pub struct Arguments {
    /// File of the set.
    pub file: String,
    /// The set.
    pub set: Dataset,
    /// Its recordings.
    pub measured: Vec<SegmentedRecording>,
    /// Number of simulated sets.
    pub sets: usize,
    /// Seed.
    pub seed: u64,
}

/// Parses `FILE [SETS [SEED]]` and loads the set.
pub fn parse_arguments(sets: usize, seed: u64) -> Result<Arguments, Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let file = words.next().ok_or("name a data set")?;
    let sets = words.next().map_or(Ok(sets), |w| w.parse())?;
    let seed = words.next().map_or(Ok(seed), |w| w.parse())?;
    let set = Dataset::load(Path::new(&file))?;
    let mut files = Vec::new();
    for pattern in &set.recordings {
        files.extend(find_files(pattern)?);
    }
    let measured = set.load_recordings(&files, set.tissue.layers.len())?;
    Ok(Arguments { file, set, measured, sets, seed })
}

/// Simulates a recording.
pub fn simulate(
    population: &Population,
    run: &SegmentedRecording,
    k: usize,
    layers: usize,
    rng: &mut ChaCha8Rng,
) -> Option<SegmentedRecording> {
    let mut recording = run.recording.clone();
    recording.force_n =
        draw_force(population, run, k, Some(0).filter(|_| !population.model.days.is_empty()))?;
    let mut slow: f64 = StandardNormal.sample(rng);
    let first_s = run.ruptures_s.iter().copied().fold(f64::INFINITY, f64::min);
    for i in 0..recording.len() {
        let t = recording.time_s[i];
        let keep = if i > 0 { libm::exp(-(t - recording.time_s[i - 1]) / SLOW_S) } else { 0.0 };
        let (shock, white): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
        slow = keep * slow + (1.0 - keep * keep).max(0.0).sqrt() * shock;
        let left_n = population.residual_n[phase_at(run, t, first_s) as usize];
        let touches = recording.position_m[i] > population.model.tissue.surface_m;
        recording.force_n[i] += if touches { left_n * slow } else { 0.0 } + NOISE_N * white;
    }
    Some(SegmentedRecording::new(format!("{} {k}", run.name), recording, layers))
}
