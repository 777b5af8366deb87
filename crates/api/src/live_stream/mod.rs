//! The online core on a live stream: samples arrive by UDP or as lines of text; outputs leave as JSON lines, by UDP, and to a
//! page in a browser.
//!
//! The receiving thread only parses, steps the core and appends one line to a ring, which subscribers read on their own. A slow
//! subscriber loses the oldest lines; the core never waits for any, and its work does not depend on their number.

mod broadcast;
mod line_splitter;
mod sample_parser;
mod stream_session;
mod velocity_from_positions;

pub use broadcast::{Broadcast, Subscriber};
pub use line_splitter::{LineSplitter, MAX_LINE_BYTES};
pub use sample_parser::{InvalidLine, StreamSample, parse_bytes, parse_line};
pub(crate) use stream_session::STORED_SAMPLES;
pub use stream_session::{Session, StreamCounts, StreamMessage};
pub(crate) use velocity_from_positions::VelocityEstimator;
