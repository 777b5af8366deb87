//! The online core on a live stream: samples arrive by UDP or as lines of text; outputs leave as JSON lines, by UDP, and to a
//! page in a browser.
//!
//! The receiving thread only parses, steps the core and appends one line to the ring of every subscriber. A slow subscriber
//! loses the oldest lines of its own ring; the core never waits for it.

mod broadcast;
mod http_page;
mod sample_parser;
mod stream_session;
mod velocity_from_positions;

pub use broadcast::{Broadcast, Subscriber};
pub use http_page::serve_page;
pub use sample_parser::{InvalidLine, StreamSample, parse_line};
pub use stream_session::{Session, StreamCounts};
