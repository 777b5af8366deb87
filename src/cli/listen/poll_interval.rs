//! Polling interval of waiting threads.

use std::time::Duration;

/// Longest time between two checks of the clock and of signals.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(100);
