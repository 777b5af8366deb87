//! A session of the online core on a stream, with its counts.

use super::broadcast::Broadcast;
use super::sample_parser::{InvalidLine, StreamSample, parse_line};
use super::velocity_from_positions::VelocityEstimator;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_core::{Enhancer, Output, Sample};
use stylet_scenario::EnhancerConfigFile;

/// Samples of a layer that the core stores: 65 s at 1 kHz.
const STORED_SAMPLES: usize = 1 << 16;

/// Counts of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamCounts {
    /// Samples received.
    pub samples: u64,
    /// Samples that the core ignored: not finite, out of range, or not later than the previous one.
    pub unused: u64,
    /// Lines that are no samples.
    pub bad_lines: u64,
    /// Ruptures declared.
    pub ruptures: u64,
    /// Lines lost by slow subscribers; the core lost no samples by them.
    pub dropped_by_readers: u64,
    /// Longest time from the arrival of a sample to its line in every ring, in s.
    pub worst_delay_s: f64,
    /// Mean of that time, in s.
    pub mean_delay_s: f64,
}

/// Output line of a sample. Names carry units, as PlotJuggler shows them.
#[derive(Serialize)]
struct OutputLine<'a> {
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
    layer: Option<LayerLine>,
    dropped: u64,
}

/// Layer estimate, at the sample at which it became available.
#[derive(Serialize)]
struct LayerLine {
    layer: usize,
    thickness_m: f64,
    stiffness_n_per_m: f64,
    friction: f64,
}

fn output_json(sample: &Sample, out: &Output, dropped: u64) -> String {
    let line = OutputLine {
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
        layer: out.estimate.map(|e| LayerLine {
            layer: e.layer,
            thickness_m: e.thickness_m,
            stiffness_n_per_m: e.stiffness_n_per_m,
            friction: e.friction,
        }),
        dropped,
    };
    // Serialisation cannot fail; numbers that are not finite become null.
    serde_json::to_string(&line).unwrap_or_default()
}

/// The core and its counts.
pub struct Session {
    core: Enhancer<Vec<Sample>>,
    velocity: VelocityEstimator,
    counts: StreamCounts,
    total_delay: Duration,
    lines: u64,
    broadcast: Arc<Broadcast>,
}

impl Session {
    /// A session that sends its lines to `broadcast`.
    #[must_use]
    pub fn new(config: &EnhancerConfigFile, broadcast: Arc<Broadcast>) -> Self {
        let storage = vec![Sample::default(); STORED_SAMPLES];
        Self {
            core: Enhancer::new(config.enhance.clone(), config.surface_m, storage),
            velocity: VelocityEstimator::default(),
            counts: StreamCounts::default(),
            total_delay: Duration::ZERO,
            lines: 0,
            broadcast,
        }
    }

    /// Processes a text of one or more lines that arrived at `arrived`.
    ///
    /// # Errors
    /// The first [`InvalidLine`]; the valid ones are processed all the same.
    pub fn process_text(&mut self, text: &str, arrived: Instant) -> Result<(), InvalidLine> {
        let mut outcome = Ok(());
        for line in text.lines() {
            self.lines += 1;
            match parse_line(self.lines, line) {
                Ok(Some(sample)) => self.step(sample, arrived),
                Ok(None) => {}
                Err(invalid) => {
                    self.counts.bad_lines += 1;
                    outcome = outcome.and(Err(invalid));
                }
            }
        }
        outcome
    }

    fn step(&mut self, sample: StreamSample, arrived: Instant) {
        let StreamSample { time_s, position_m, force_n, velocity_mps } = sample;
        let velocity_mps = velocity_mps.unwrap_or_else(|| self.velocity.update(time_s, position_m));
        let sample = Sample { time_s, position_m, velocity_mps, force_n };
        let out = self.core.step(sample);
        self.counts.samples += 1;
        self.counts.unused += u64::from(!out.used);
        self.counts.ruptures = out.ruptures as u64;
        self.broadcast.send(output_json(&sample, &out, self.broadcast.dropped()));
        let delay = arrived.elapsed();
        self.total_delay += delay;
        self.counts.worst_delay_s = self.counts.worst_delay_s.max(delay.as_secs_f64());
    }

    /// The counts so far.
    #[must_use]
    pub fn counts(&self) -> StreamCounts {
        let mean_delay_s = self.total_delay.as_secs_f64() / self.counts.samples.max(1) as f64;
        StreamCounts { dropped_by_readers: self.broadcast.dropped(), mean_delay_s, ..self.counts.clone() }
    }
}
