//! Messages between the page and the studio, JSON on the wire: the requests, and those parts of the answers that several handlers share.
//! Everything is ready for display: depths are in mm, numbers that are printed come as text, sliders as positions. The page does not
//! compute anything.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A request that cannot be fulfilled: reason and remedy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// The message.
    pub error: String,
}

impl Problem {
    /// A problem with this message.
    pub fn new(error: impl Into<String>) -> Self {
        Self { error: error.into() }
    }
}

impl<E: std::error::Error> From<E> for Problem {
    fn from(why: E) -> Self {
        Self::new(why.to_string())
    }
}

/// A command that reproduces an action of the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommandView {
    pub shell: String,
    pub python: String,
    pub files: Vec<String>,
}

/// A number that a slider changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SliderView {
    pub field: String,
    pub label: String,
    pub unit: &'static str,
    pub help: &'static str,
    pub position: usize,
    pub positions: usize,
    pub text: String,
}

/// A change of the phantom.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    Face {
        /// 0 is the surface.
        face: usize,
        depth_mm: f64,
    },
    Layer {
        layer: usize,
        field: String,
        to: Target,
    },
    LayerName {
        layer: usize,
        name: String,
    },
    SplitLayer {
        layer: usize,
    },
    RemoveLayer {
        layer: usize,
    },
    AddEffect {
        id: String,
    },
    Effect {
        effect: usize,
        field: String,
        to: Target,
    },
    RemoveEffect {
        effect: usize,
    },
    Tolerance {
        field: String,
        to: Target,
    },
    Name {
        name: String,
    },
    Motion {
        name: String,
    },
    Scenario {
        name: String,
    },
    FromRecording {
        file: String,
        algorithm: String,
        #[serde(default)]
        corrections: Corrections,
    },
    FromDiagnosis,
    FromPlan,
    Ron {
        text: String,
    },
}

/// New value of a number.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    Position(usize),
    /// A number as text; empty: none.
    Text(String),
}

/// Request for an edit.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditRequest {
    pub edit: Edit,
    /// Recording along which the force is predicted; without one the phantom's own motion.
    #[serde(default)]
    pub along: Option<String>,
    /// Mouse drag that the edit belongs to: one step of undo.
    #[serde(default)]
    pub stroke: Option<u64>,
    /// Whether the drag continues, so that nothing is written yet.
    #[serde(default)]
    pub transient: bool,
}

/// Request that names a recording, or none.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileRequest {
    #[serde(default)]
    pub file: Option<String>,
}

/// Columns of numbers for drawing; a missing value is null.
#[derive(Debug, Default, Serialize)]
pub struct Curves {
    pub time_s: Vec<f64>,
    pub depth_mm: Vec<f32>,
    pub velocity_mm_per_s: Vec<f32>,
    pub forces: Vec<ForceCurve>,
}

/// A force over the samples.
#[derive(Debug, Serialize)]
pub struct ForceCurve {
    /// Role: `measured`, `predicted`, `tip`, `enhanced`, `low`, `high`, `assumed`, `extended`.
    pub role: &'static str,
    pub name: String,
    pub force_n: Vec<f32>,
}

/// A rupture or contact.
#[derive(Clone, Debug, Serialize)]
pub struct EventView {
    pub time_s: f64,
    pub depth_mm: f64,
    pub label: String,
}

/// The predicted force of the phantom.
#[derive(Debug, Serialize)]
pub struct PreviewView {
    pub curves: Curves,
    pub ruptures: Vec<EventView>,
    pub summary: String,
}

/// Answer to an edit.
#[derive(Debug, Serialize)]
pub struct EditView {
    pub phantom: Value,
    pub preview: PreviewView,
    pub undo: usize,
    pub redo: usize,
}

/// Corrections of the online algorithm by the user.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Corrections {
    /// Depth of the contact, which the algorithm then takes as known.
    pub contact_mm: Option<f64>,
    /// Ruptures that were moved: algorithm, number from 0 in the order of detection, and depth. They change the layers, not the enhanced
    /// force.
    pub ruptures_mm: Vec<(String, usize, f64)>,
}

/// Request for the online algorithm on a recording.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingViewRequest {
    pub file: String,
    pub algorithms: Vec<String>,
    #[serde(default)]
    pub corrections: Corrections,
    /// Visible part of the recording in s.
    #[serde(default)]
    pub window_s: Option<[f64; 2]>,
}

/// A recording with the outputs of the online algorithm.
#[derive(Debug, Serialize)]
pub struct RecordingView {
    pub file: String,
    pub summary: String,
    pub findings: Vec<FindingView>,
    pub curves: Curves,
    /// Samples in the window, and those sent.
    pub samples: [usize; 2],
    pub runs: Vec<Value>,
}

/// A finding about a recording.
#[derive(Clone, Debug, Serialize)]
pub struct FindingView {
    /// `bad` (a diagnosis is refused), `warn` or `good`.
    pub level: &'static str,
    pub message: String,
}

/// A correction of a column.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnRequest {
    pub file: String,
    pub column: String,
    /// Quantity; empty: not used.
    pub quantity: String,
    #[serde(default)]
    pub unit: String,
    #[serde(default)]
    pub flipped: bool,
}

/// The sampling rate of a file without usable times.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RateRequest {
    pub file: String,
    pub rate_hz: f64,
}

/// Request for a diagnosis or a prediction.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilesRequest {
    pub files: Vec<String>,
}

/// Limits of the next insertion.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsView {
    pub depth_mm: f64,
    pub speed_mm_per_s: f64,
    pub acceleration_mm_per_s2: f64,
    pub duration_s: f64,
    pub force_n: f64,
}

/// Request for a plan after these recordings.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanRequest {
    pub files: Vec<String>,
    pub limits: LimitsView,
}

/// Request for the force without some of the causes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CausesRequest {
    pub file: String,
    pub causes: Vec<String>,
}

/// Measured, assumed and extended force.
#[derive(Debug, Serialize)]
pub struct CausesView {
    pub curves: Curves,
    pub summary: String,
}
