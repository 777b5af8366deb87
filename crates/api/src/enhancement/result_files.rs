//! Contents of `enhance.json` and `events.json`.

use crate::run_report::AlgorithmRun;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_core::LayerEstimate;
use stylet_core::config::Model;
use stylet_record::QualityNote;
use stylet_score::{ContactFinding, Trace};

/// `enhance.json`.
#[derive(Serialize)]
pub(super) struct EnhanceResult<'a> {
    pub recording: String,
    pub samples: usize,
    pub duration_s: f64,
    pub sample_hz: f64,
    pub hash: &'a str,
    pub version: &'a str,
    /// File of the identified model that provided the friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identified_model: Option<&'a str>,
    pub found: Vec<RunResult>,
    pub data_quality: &'a [QualityNote],
}

/// Results with one regressor.
#[derive(Serialize)]
pub(super) struct RunResult {
    model: String,
    contact_m: Option<f64>,
    contact_s: Option<f64>,
    contact: ContactFinding,
    ruptures: Vec<Rupture>,
    layers: Vec<Layer>,
    /// Samples that the algorithm ignored; their rows of `enhanced.csv` say why.
    unused_samples: usize,
    /// Restarts of the algorithm because of a new clock.
    restarts: usize,
}

/// A detection in `enhance.json`.
#[derive(Serialize)]
struct Rupture {
    time_s: f64,
    position_m: f64,
    located_s: f64,
    located_m: f64,
    cause: &'static str,
}

/// A layer in `enhance.json`.
#[derive(Serialize)]
struct Layer {
    layer: usize,
    start_m: f64,
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction: f64,
    friction_unit: &'static str,
    drop_n: f64,
    cumulative_friction_added_ns_per_m: f64,
    /// Estimates that are physically impossible, each with the reason.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    impossible: Vec<String>,
    /// 95 % intervals and cumulative friction, where the algorithm provides them.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    intervals: Option<Intervals>,
}

/// 95 % intervals, and the cumulative friction at the layer's rupture.
#[derive(Serialize)]
struct Intervals {
    stiffness_interval: [f64; 2],
    friction_interval: [f64; 2],
    drop_interval: [f64; 2],
    cumulative_friction_ns_per_m: f64,
    cumulative_friction_interval: [f64; 2],
}

impl Intervals {
    fn new(e: &LayerEstimate) -> Option<Self> {
        (e.stiffness_sd > 0.0).then(|| Self {
            stiffness_interval: interval(e.stiffness_n_per_m, e.stiffness_sd),
            friction_interval: interval(e.friction, e.friction_sd),
            drop_interval: interval(e.drop_n, e.drop_sd_n),
            cumulative_friction_ns_per_m: e.cumulative_ns_per_m,
            cumulative_friction_interval: interval(e.cumulative_ns_per_m, e.cumulative_sd),
        })
    }
}

/// The 95 % interval.
fn interval(value: f64, sd: f64) -> [f64; 2] {
    [value - stylet_stats::Z95 * sd, value + stylet_stats::Z95 * sd]
}

/// Physically impossible values of an estimate (negative stiffness or friction beyond the interval, layer thicker than 1 m),
/// each with the reason.
#[must_use]
pub fn impossible_estimates(e: &LayerEstimate) -> Vec<String> {
    let mut out = Vec::new();
    for (name, value, sd) in
        [("stiffness", e.stiffness_n_per_m, e.stiffness_sd), ("friction", e.friction, e.friction_sd)]
    {
        if value + stylet_stats::Z95 * sd < 0.0 {
            out.push(format!(
                "{name} is negative beyond its interval: the force does not follow K and b here"
            ));
        }
    }
    if e.thickness_m > MAX_LAYER_M {
        out.push("thickness is more than a metre: the position is not in metres".to_owned());
    }
    out
}

/// Thickest layer in m.
const MAX_LAYER_M: f64 = 1.0;

/// Results of a run.
pub(super) fn results_of_run(run: &AlgorithmRun) -> RunResult {
    let friction_unit = match run.config.model {
        Model::MultiLayer => "N s/m2",
        Model::KelvinVoigt => "N s/m",
    };
    let layer = |e: &LayerEstimate| Layer {
        layer: e.layer,
        start_m: e.start_m,
        thickness_m: e.thickness_m,
        stiffness_n_per_m: e.stiffness_n_per_m,
        friction: e.friction,
        friction_unit,
        drop_n: e.drop_n,
        cumulative_friction_added_ns_per_m: e.added_friction_ns_per_m,
        impossible: impossible_estimates(e),
        intervals: Intervals::new(e),
    };
    RunResult {
        model: run.name.clone(),
        contact_m: run.trace.contact_m,
        contact_s: run.trace.contact_s,
        contact: run.trace.contact.clone(),
        ruptures: run
            .trace
            .detections
            .iter()
            .map(|d| Rupture {
                time_s: d.time_s,
                position_m: d.position_m,
                located_s: d.located_s,
                located_m: d.located_m,
                cause: d.cause.name(),
            })
            .collect(),
        layers: run.trace.estimates.iter().map(layer).collect(),
        unused_samples: run.trace.unused,
        restarts: run.trace.restarts,
    }
}

/// A rupture in `events.json`.
#[derive(Serialize)]
pub(super) struct Event {
    time_s: f64,
    position_m: f64,
    drop_n: DropSize,
    /// Probability that it is not a false alarm, 0 to 1, where the algorithm provides it.
    confidence: Option<f64>,
}

/// A drop with its 95 % interval in N, where the algorithm provides it.
#[derive(Serialize)]
struct DropSize {
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
}

/// Detected ruptures.
pub(super) fn events(trace: &Trace) -> Vec<Event> {
    let provided = |x: f64| (x != 0.0).then_some(x);
    let estimates: BTreeMap<usize, &LayerEstimate> = trace.estimates.iter().map(|e| (e.layer, e)).collect();
    trace
        .detections
        .iter()
        .map(|d| {
            let estimate = estimates.get(&d.layer).copied();
            // From the samples around the drop, or else from the layer estimate.
            let (value, sd) = match (provided(d.drop_sd_n), estimate) {
                (Some(sd), _) => (Some(d.drop_n), Some(sd)),
                (None, Some(e)) => (Some(e.drop_n), provided(e.drop_sd_n)),
                (None, None) => (None, None),
            };
            let interval = value.zip(sd).map(|(value, sd)| interval(value, sd));
            Event {
                time_s: d.time_s,
                position_m: d.position_m,
                drop_n: DropSize { value, low: interval.map(|i| i[0]), high: interval.map(|i| i[1]) },
                confidence: provided(d.confidence),
            }
        })
        .collect()
}
