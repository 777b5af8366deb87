//! What an effect must gain to be named, in nats.
//!
//! Calibrated over the whole search on clean cases (every third of them with independent noise, AR(1) 0.5 and
//! 0.9): an effect that is sought at many places (depths of a membrane, frequencies) gains more by chance than
//! one that has a single number. The table is what this prints:
//! `cargo run --release -p stylet-diagnose --features own_world --example calibrate -- 160 7001`
//! For each effect: the 90 % quantile of what it gains on clean data, carried on along the exponential tail of a
//! likelihood ratio to its share of one accused case in a hundred; at least one more than it ever gained; and at
//! least [`LEAST`], since data are never quite what the cases assume.

/// No effect is named for less.
pub const LEAST: f64 = 10.0;

/// A second time constant of relaxation must gain this.
pub const SECOND_TERM: f64 = 12.0;

/// Effects that need more than [`LEAST`].
const TABLE: [(&str, f64); 3] =
    [("hidden_membrane", 16.5), ("periodic_interference", 23.3), ("respiration", 13.2)];

/// Nats that an effect must gain.
#[must_use]
pub fn needed(id: &str) -> f64 {
    TABLE.iter().find(|row| row.0 == id).map_or(LEAST, |row| row.1)
}
