//! Tunes the detection thresholds within the published range, and the threshold of the triggered reset, on noise seeds that are used for
//! nothing else.

use crate::algorithm_variant::{Ablation, Sensor, Setup, Variant};
use crate::simulated_insertion::Insertion;
use crate::tuned_thresholds::{ON_N_PER_S, SIGMA_RUPTURE_N, Tuning};
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_score::match_ruptures;

/// First of the noise seeds that are used only for tuning.
pub const TUNING_FIRST_SEED: u64 = 1_000_001;
/// Number of tuning seeds if one simulation can be used for all.
pub const TUNING_SEEDS: u64 = 10;
/// Number of tuning seeds on the arm.
pub const TUNING_SEEDS_ARM: u64 = 4;

/// Thresholds on `trace P` that are tried; the trace of the prior is 2e6. At constant velocity the entry of the friction stays near 1e6
/// and the threshold must lie above it; at varying speed that entry falls too.
pub const TRACE_BELOW: [f64; 14] = [
    2e5, 5e5, 9e5, 9.9e5, 1.000_05e6, 1.000_5e6, 1.002e6, 1.005e6, 1.02e6, 1.05e6, 1.1e6, 1.2e6, 1.4e6, 1.7e6,
];

/// Number of missed and false ruptures.
fn count_missed_and_false(insertion: &Insertion, samples: &[Sample], config: &EnhanceConfig) -> usize {
    let mut core =
        Enhancer::new(config.clone(), insertion.surface_m(), vec![Sample::default(); samples.len()]);
    let mut detections = Vec::new();
    core.run(samples, |out| detections.extend(out.detection));
    let (ruptures, is_false) = match_ruptures(&insertion.simulation.truth.ruptures, &detections);
    ruptures.iter().filter(|r| r.detected_s.is_none()).count() + is_false.iter().filter(|f| **f).count()
}

/// RMS of the innovation in N over the whole recording.
fn reconstruction_n(insertion: &Insertion, samples: &[Sample], config: &EnhanceConfig) -> f64 {
    let mut core =
        Enhancer::new(config.clone(), insertion.surface_m(), vec![Sample::default(); samples.len()]);
    let mut sum = 0.0;
    core.run(samples, |out| sum += out.error_n * out.error_n);
    (sum / samples.len().max(1) as f64).sqrt()
}

impl Tuning {
    /// Tunes on recordings, each with its insertion; with `trace` also the threshold of the triggered reset.
    #[must_use]
    pub fn of(recordings: &[(&Insertion, Vec<Sample>)], sensor: Sensor, trace: bool) -> Self {
        let with = |tuning: &Tuning, ablation: Ablation| {
            let variant = Variant::ml(Setup::Tuned).without(ablation);
            recordings.first().map(|(once, _)| variant.config(&once.scenario, sensor, tuning))
        };
        let mut best: Option<Tuning> = None;
        'grid: for sigma_rupture_n in SIGMA_RUPTURE_N {
            for on_n_per_s in ON_N_PER_S {
                let mut tried = Tuning { sigma_rupture_n, on_n_per_s, ..Tuning::default() };
                let Some(config) = with(&tried, Ablation::None) else { return tried };
                tried.wrong = recordings
                    .iter()
                    .map(|(once, samples)| count_missed_and_false(once, samples, &config))
                    .sum();
                if best.is_none_or(|b| tried.wrong < b.wrong) {
                    best = Some(tried);
                }
                if tried.wrong == 0 {
                    break 'grid;
                }
            }
        }
        let mut best = best.unwrap_or_default();
        if trace {
            let rms = |tuning: &Tuning, ablation| {
                let Some(config) = with(tuning, ablation) else { return f64::NAN };
                stylet_stats::median_of(recordings.iter().map(|(once, s)| reconstruction_n(once, s, &config)))
            };
            let aim = rms(&best, Ablation::None);
            let off = |below: f64| {
                let tried = Tuning { trace_below: below, ..best };
                libm::log(rms(&tried, Ablation::Trace) / aim).abs()
            };
            let distances = TRACE_BELOW.map(off);
            let nearest = distances.iter().zip(TRACE_BELOW).min_by(|a, b| a.0.total_cmp(b.0));
            best.trace_below = nearest.map_or(best.trace_below, |(_, below)| below);
        }
        best
    }
}
