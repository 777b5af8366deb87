//! How often waiting threads look whether they shall end.

use std::time::Duration;

/// Longest time without a look at the clock and at signals.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(100);
