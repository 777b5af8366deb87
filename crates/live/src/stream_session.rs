//! The core on a stream, and what is counted on the way.

use crate::broadcast::Broadcast;
use crate::sample_parser::{InvalidLine, StreamSample, parse_line};
use crate::velocity_from_positions::VelocityEstimator;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_core::{Enhancer, Output, Sample};
use stylet_scenario::EnhancerConfigFile;

/// Samples of a layer that are kept: 65 s at 1 kHz.
const STORAGE: usize = 1 << 16;

/// What a session has come to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamCounts {
    /// Samples that came.
    pub samples: u64,
    /// Of these passed over by the core: not finite, out of range, or not later than the one before.
    pub unused: u64,
    /// Lines that are no samples.
    pub bad_lines: u64,
    /// Ruptures declared.
    pub ruptures: u64,
    /// Lines that slow readers lost; the core lost none of its samples by them.
    pub dropped_by_readers: u64,
    /// From a sample's arrival to its line in every ring, at most, in s.
    pub worst_delay_s: f64,
    /// The same on average, in s.
    pub mean_delay_s: f64,
}

/// What the core said to a sample, as it goes out.
#[derive(Serialize)]
struct Said<'a> {
    time_s: f64,
    position_m: f64,
    velocity_mps: f64,
    force_n: f64,
    enhanced_n: f64,
    state: &'a str,
    ruptures: usize,
    ruptured: bool,
    stiffness_n_per_m: f64,
    friction: f64,
    cumulative_friction_ns_per_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    layer: Option<Layer>,
    dropped: u64,
}

/// A layer's estimate, at the sample at which it became available.
#[derive(Serialize)]
struct Layer {
    layer: usize,
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction: f64,
}

/// What the core said to a sample as one line of JSON: numbers with their units, names as PlotJuggler shows them.
#[must_use]
pub fn output_json(sample: &Sample, out: &Output, dropped: u64) -> String {
    let said = Said {
        time_s: sample.time_s,
        position_m: sample.position_m,
        velocity_mps: sample.velocity_mps,
        force_n: sample.force_n,
        enhanced_n: out.enhanced_n,
        state: out.state.name(),
        ruptures: out.ruptures,
        ruptured: out.detection.is_some(),
        stiffness_n_per_m: out.theta[0],
        friction: out.theta[1],
        cumulative_friction_ns_per_m: out.cumulative_friction_ns_per_m,
        layer: out.estimate.map(|e| Layer {
            layer: e.layer,
            thickness_m: e.thickness_m,
            stiffness_n_per_m: e.stiffness_n_per_m,
            friction: e.friction,
        }),
        dropped,
    };
    // A struct of numbers and names always has a JSON; numbers that are not finite become null.
    serde_json::to_string(&said).unwrap_or_default()
}

/// The core and its counts.
pub struct Session {
    core: Enhancer<Vec<Sample>>,
    slope: VelocityEstimator,
    counts: StreamCounts,
    delays: Duration,
    lines: u64,
    hub: Arc<Broadcast>,
}

impl Session {
    /// A session that gives its lines to the readers of `hub`.
    #[must_use]
    pub fn new(config: &EnhancerConfigFile, hub: Arc<Broadcast>) -> Self {
        let storage = vec![Sample::default(); STORAGE];
        Self {
            core: Enhancer::new(config.enhance.clone(), config.surface_m, storage),
            slope: VelocityEstimator::default(),
            counts: StreamCounts::default(),
            delays: Duration::ZERO,
            lines: 0,
            hub,
        }
    }

    /// Takes a text that came at `arrived`: one line or several.
    ///
    /// # Errors
    /// The first [`BadLine`]; the good ones are taken all the same.
    pub fn process_text(&mut self, text: &str, arrived: Instant) -> Result<(), InvalidLine> {
        let mut outcome = Ok(());
        for line in text.lines() {
            self.lines += 1;
            match parse_line(self.lines, line) {
                Ok(Some(given)) => self.step(given, arrived),
                Ok(None) => {}
                Err(bad) => {
                    self.counts.bad_lines += 1;
                    outcome = outcome.and(Err(bad));
                }
            }
        }
        outcome
    }

    fn step(&mut self, given: StreamSample, arrived: Instant) {
        let StreamSample { time_s, position_m, force_n, velocity_mps } = given;
        let velocity_mps = velocity_mps.unwrap_or_else(|| self.slope.update(time_s, position_m));
        let sample = Sample { time_s, position_m, velocity_mps, force_n };
        let out = self.core.step(sample);
        self.counts.samples += 1;
        self.counts.unused += u64::from(!out.used);
        self.counts.ruptures = out.ruptures as u64;
        self.hub.send(output_json(&sample, &out, self.hub.dropped()));
        let delay = arrived.elapsed();
        self.delays += delay;
        self.counts.worst_delay_s = self.counts.worst_delay_s.max(delay.as_secs_f64());
    }

    /// The counts so far.
    #[must_use]
    pub fn counts(&self) -> StreamCounts {
        let mean_delay_s = self.delays.as_secs_f64() / self.counts.samples.max(1) as f64;
        StreamCounts { dropped_by_readers: self.hub.dropped(), mean_delay_s, ..self.counts.clone() }
    }
}
