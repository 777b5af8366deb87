//! Benchmark of online puncture detection: streams of time, position and force without truth, and the scoring of a detector's
//! events.
//!
//! | module | contents |
//! |---|---|
//! | [`stream_id`] | rows, severities and the name of a stream |
//! | [`draw_stream`] | tissue, motion, sensor and noise of each row |
//! | [`hand_held_motion`] | motion of a hand, of a sticking drive, and forces from the side |
//! | [`moving_tissue`] | tissue that moves periodically under the needle |
//! | [`simulate_stream`] | the samples and the truth |
//! | [`measured_stream`] | recordings as streams |
//! | [`stream_folder`] | export to a folder, and reading answers |
//! | [`event_matching`] | which event belongs to which puncture |
//! | [`stream_scores`] | precision, recall, delay, false alarms, by row and entrant |

pub mod draw_stream;
pub mod event_matching;
pub mod hand_held_motion;
pub mod measured_stream;
pub mod moving_tissue;
pub mod simulate_stream;
pub mod stream_folder;
pub mod stream_id;
pub mod stream_scores;
