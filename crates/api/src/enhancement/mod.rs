//! Enhancement of measured recordings by the online core, with or without an identified model of the shaft friction.

mod enhanced_csv;
mod identified_model;
mod plot_samples;
mod result;
mod result_files;
mod streaming;
mod whole_recording;

pub use identified_model::IdentifiedModel;
pub use result::{
    AppliedModel, EnhancementResult, RecordingExtent, ResultSource, enhance_recording, unused_note,
};
pub use result_files::impossible_estimates;
pub use streaming::enhance_long_recording;
pub use whole_recording::{enhance, enhance_as, enhance_with_model};
