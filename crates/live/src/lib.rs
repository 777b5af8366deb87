//! The online core on a stream: samples come in by UDP or as lines, what the core makes of them goes out as JSON by UDP, as
//! lines, and to a page in a browser.
//!
//! The thread that hears samples does nothing but parse, step the core and put one line into the ring of every reader. A
//! reader that is slow loses the oldest lines of its own ring, and nothing else: the core never waits for it.
#![forbid(unsafe_code)]

mod input;
mod page;
mod ring;
mod session;
mod velocity;

pub use input::{BadLine, Given, parse};
pub use page::serve;
pub use ring::{Hub, Reader};
pub use session::{Counts, Session, said};
pub use velocity::Slope;
