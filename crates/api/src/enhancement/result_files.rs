//! What was found as `enhance.json` and `events.json` have it, and the state as a column.

use crate::run_report::AlgorithmRun;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_core::LayerEstimate;
use stylet_core::config::Model;
use stylet_record::QualityNote;
use stylet_score::Trace;

/// `enhance.json`.
#[derive(Serialize)]
pub(super) struct EnhanceResult<'a> {
    pub recording: String,
    pub samples: usize,
    pub duration_s: f64,
    pub sample_hz: f64,
    pub hash: &'a str,
    pub version: &'a str,
    /// The law that the friction is taken from, where it is not the core's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<&'a str>,
    pub found: Vec<FoundBy>,
    pub data_quality: &'a [QualityNote],
}

/// What the core found, per model.
#[derive(Serialize)]
pub(super) struct FoundBy {
    model: String,
    contact_m: Option<f64>,
    contact_s: Option<f64>,
    ruptures: Vec<Found>,
    layers: Vec<Layer>,
}

/// A detection as `enhance.json` has it.
#[derive(Serialize)]
struct Found {
    time_s: f64,
    position_m: f64,
    located_s: f64,
    located_m: f64,
    cause: &'static str,
}

/// A layer as `enhance.json` has it.
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
    /// 95 % intervals, and friction along the shaft as the layer gave way; missing where the algorithm gives none.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    certain: Option<Certain>,
}

/// What an algorithm that knows its uncertainty says beside.
#[derive(Serialize)]
struct Certain {
    stiffness_interval: [f64; 2],
    friction_interval: [f64; 2],
    drop_interval: [f64; 2],
    cumulative_friction_ns_per_m: f64,
    cumulative_friction_interval: [f64; 2],
}

impl Certain {
    fn of(e: &LayerEstimate) -> Option<Self> {
        (e.stiffness_sd > 0.0).then(|| Self {
            stiffness_interval: around(e.stiffness_n_per_m, e.stiffness_sd),
            friction_interval: around(e.friction, e.friction_sd),
            drop_interval: around(e.drop_n, e.drop_sd_n),
            cumulative_friction_ns_per_m: e.cumulative_ns_per_m,
            cumulative_friction_interval: around(e.cumulative_ns_per_m, e.cumulative_sd),
        })
    }
}

/// The 95 % interval of a number with this standard deviation.
fn around(value: f64, sd: f64) -> [f64; 2] {
    [value - stylet_stats::Z95 * sd, value + stylet_stats::Z95 * sd]
}

/// What the core found with a model.
pub(super) fn results_of_run(ran: &AlgorithmRun) -> FoundBy {
    let friction_unit = match ran.config.model {
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
        certain: Certain::of(e),
    };
    FoundBy {
        model: ran.name.clone(),
        contact_m: ran.trace.contact_m,
        contact_s: ran.trace.contact_s,
        ruptures: ran
            .trace
            .detections
            .iter()
            .map(|d| Found {
                time_s: d.time_s,
                position_m: d.position_m,
                located_s: d.located_s,
                located_m: d.located_m,
                cause: d.cause.name(),
            })
            .collect(),
        layers: ran.trace.estimates.iter().map(layer).collect(),
    }
}

/// A rupture as `events.json` has it.
#[derive(Serialize)]
pub(super) struct Event {
    time_s: f64,
    position_m: f64,
    drop_n: DropSize,
    /// Probability that it is no false alarm, 0 to 1; missing where the algorithm does not tell.
    confidence: Option<f64>,
}

/// A drop with its 95 % interval, in N; the interval is missing where the algorithm gives none.
#[derive(Serialize)]
struct DropSize {
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
}

/// The ruptures that the core found.
pub(super) fn events(trace: &Trace) -> Vec<Event> {
    let told = |x: f64| (x != 0.0).then_some(x);
    let estimates: BTreeMap<usize, &LayerEstimate> = trace.estimates.iter().map(|e| (e.layer, e)).collect();
    trace
        .detections
        .iter()
        .map(|d| {
            let estimate = estimates.get(&d.layer).copied();
            // What the samples around the drop say; without that, what the layer's estimate says.
            let (value, sd) = match (told(d.drop_sd_n), estimate) {
                (Some(sd), _) => (Some(d.drop_n), Some(sd)),
                (None, Some(e)) => (Some(e.drop_n), told(e.drop_sd_n)),
                (None, None) => (None, None),
            };
            let interval = value.zip(sd).map(|(value, sd)| around(value, sd));
            Event {
                time_s: d.time_s,
                position_m: d.position_m,
                drop_n: DropSize { value, low: interval.map(|i| i[0]), high: interval.map(|i| i[1]) },
                confidence: told(d.confidence),
            }
        })
        .collect()
}
