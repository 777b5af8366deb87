//! Detects faults of the force sensor and the drive without a tissue model: from a motion in air, a known load, the air before contact, and
//! corners of the motion. Detected faults are corrected before any fit; excluded ones cannot explain a residual.

mod air_baseline;
mod assessment;
mod calibration;
mod instrument_report;
mod sensor_lag;

pub(crate) use air_baseline::fit_trend;
pub use assessment::{NEGLIGIBLE_SHARE, ReferenceRecordings};
pub use calibration::CalibratedRecordings;
pub use instrument_report::{DetectedFault, ExcludedFault, InstrumentReport};
