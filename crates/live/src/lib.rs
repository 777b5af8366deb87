//! The online core on a stream: samples come in by UDP or as lines, what the core makes of them goes out as JSON by UDP, as
//! lines, and to a page in a browser.
//!
//! The thread that hears samples does nothing but parse, step the core and put one line into the ring of every reader. A
//! reader that is slow loses the oldest lines of its own ring, and nothing else: the core never waits for it.
#![forbid(unsafe_code)]

mod broadcast;
mod http_page;
mod sample_parser;
mod stream_session;
mod velocity_from_positions;

pub use broadcast::{Broadcast, Subscriber};
pub use http_page::serve_page;
pub use sample_parser::{InvalidLine, StreamSample, parse_line};
pub use stream_session::{Session, StreamCounts, output_json};
pub use velocity_from_positions::VelocityEstimator;
