//! A session of the online core on a stream, with its counts.

use super::broadcast::Broadcast;
use super::sample_parser::{InvalidLine, StreamSample, parse_bytes};
use super::velocity_from_positions::VelocityEstimator;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_core::{Enhancer, Output, Sample, UnusedReason};
use stylet_scenario::EnhancerConfigFile;

/// Samples of a layer that the core stores: 65 s at 1 kHz.
pub(crate) const STORED_SAMPLES: usize = 1 << 16;

/// Counts of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamCounts {
    /// Samples received.
    pub samples: u64,
    /// Samples that the core ignored: not finite, out of range, not later than the previous one, or at a jump of the clock.
    pub unused: u64,
    /// Restarts of the core because of a new clock.
    pub restarts: u64,
    /// Lines that are not samples.
    pub bad_lines: u64,
    /// Ruptures declared, over all restarts.
    pub ruptures: u64,
    /// Datagrams that the system dropped before they could be received, as reported with the last one received; null where the
    /// system does not count them.
    pub dropped_by_system: Option<u64>,
    /// Lines lost by slow subscribers; the core still processed these samples.
    pub dropped_by_readers: u64,
    /// Readers of the page that were refused because there were too many.
    pub refused_readers: u64,
    /// Lines that could not be sent to the address to forward to.
    pub not_forwarded: u64,
    /// Longest time from the arrival of a sample to its line in the ring, in s.
    pub worst_delay_s: f64,
    /// Mean of that time, in s.
    pub mean_delay_s: f64,
}

/// Message that the operator should see at once.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StreamMessage {
    /// A line that is not a sample.
    #[error("{0}")]
    Invalid(InvalidLine),
    /// The core ignored a sample.
    #[error("line {line}: sample not used: {}", reason.message())]
    Unused {
        /// Number of the line.
        line: u64,
        /// Reason.
        reason: UnusedReason,
    },
    /// The core has restarted.
    #[error(
        "line {line}: a new clock: the algorithm begins again, with ruptures, contact and layers from zero"
    )]
    Restarted {
        /// Number of the line.
        line: u64,
    },
}

/// Output line of a sample. Names carry units, as PlotJuggler shows them. Values that are not current are null.
#[derive(Serialize)]
struct OutputLine<'a> {
    time_s: f64,
    position_m: f64,
    velocity_mps: f64,
    force_n: f64,
    used: bool,
    /// Why the sample was not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'a str>,
    enhanced_n: Option<f64>,
    state: Option<&'a str>,
    ruptures: usize,
    ruptured: bool,
    stiffness_n_per_m: Option<f64>,
    friction: Option<f64>,
    cumulative_friction_ns_per_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    layer: Option<LayerLine>,
    /// Restarts of the core because of a new clock, so far.
    restarts: u64,
    /// Lines that are not samples, so far.
    bad_lines: u64,
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

fn output_json(sample: &Sample, out: &Output, counts: &StreamCounts, dropped: u64) -> String {
    let current = |value: f64| out.used.then_some(value);
    let line = OutputLine {
        time_s: sample.time_s,
        position_m: sample.position_m,
        velocity_mps: sample.velocity_mps,
        force_n: sample.force_n,
        used: out.used,
        reason: out.unused_reason.map(UnusedReason::message),
        enhanced_n: current(out.enhanced_n),
        state: out.used.then_some(out.state.name()),
        ruptures: out.ruptures,
        ruptured: out.detection.is_some(),
        stiffness_n_per_m: current(out.theta[0]),
        friction: current(out.theta[1]),
        cumulative_friction_ns_per_m: current(out.cumulative_friction_ns_per_m),
        layer: out.estimate.map(|e| LayerLine {
            layer: e.layer,
            thickness_m: e.thickness_m,
            stiffness_n_per_m: e.stiffness_n_per_m,
            friction: e.friction,
        }),
        restarts: counts.restarts,
        bad_lines: counts.bad_lines,
        dropped,
    };
    // Serialisation cannot fail; numbers that are not finite become null.
    serde_json::to_string(&line).unwrap_or_default()
}

/// The core and its counts.
pub struct Session {
    config: EnhancerConfigFile,
    core: Enhancer<Vec<Sample>>,
    velocity: VelocityEstimator,
    counts: StreamCounts,
    total_delay: Duration,
    lines: u64,
    broadcast: Arc<Broadcast>,
}

fn new_core(config: &EnhancerConfigFile) -> Enhancer<Vec<Sample>> {
    let storage = vec![Sample::default(); STORED_SAMPLES];
    Enhancer::new(config.enhance.clone(), config.surface_m, storage)
}

impl Session {
    /// A session that sends its lines to `broadcast`.
    #[must_use]
    pub fn new(config: &EnhancerConfigFile, broadcast: Arc<Broadcast>) -> Self {
        Self {
            core: new_core(config),
            config: config.clone(),
            velocity: VelocityEstimator::default(),
            counts: StreamCounts::default(),
            total_delay: Duration::ZERO,
            lines: 0,
            broadcast,
        }
    }

    /// Processes a datagram of one or more lines that arrived at `arrived`; calls `report` with messages for the operator.
    pub fn process_datagram(
        &mut self,
        bytes: &[u8],
        arrived: Instant,
        report: &mut dyn FnMut(StreamMessage),
    ) {
        let bytes = bytes.strip_suffix(b"\n").unwrap_or(bytes);
        for line in bytes.split(|byte| *byte == b'\n') {
            self.process_line(line, arrived, report);
        }
    }

    /// As [`Self::process_datagram`] for one line.
    pub fn process_line(&mut self, line: &[u8], arrived: Instant, report: &mut dyn FnMut(StreamMessage)) {
        self.lines += 1;
        match parse_bytes(self.lines, line) {
            Ok(Some(sample)) => {
                let out = self.step(sample, arrived);
                match out.unused_reason {
                    Some(reason) => report(StreamMessage::Unused { line: self.lines, reason }),
                    None if out.restarted => report(StreamMessage::Restarted { line: self.lines }),
                    None => {}
                }
            }
            Ok(None) => {}
            Err(invalid) => {
                self.counts.bad_lines += 1;
                report(StreamMessage::Invalid(invalid));
            }
        }
    }

    fn step(&mut self, sample: StreamSample, arrived: Instant) -> Output {
        let StreamSample { time_s, position_m, force_n, velocity_mps } = sample;
        if self.counts.samples == 0 && velocity_mps.is_none() {
            self.config.enhance.stylet.derived_velocity = true;
            self.core = new_core(&self.config);
        }
        let velocity_mps = velocity_mps.unwrap_or_else(|| self.velocity.at(time_s, position_m));
        let sample = Sample { time_s, position_m, velocity_mps, force_n };
        let out = self.core.step(sample);
        if out.restarted {
            self.velocity = VelocityEstimator::default();
        }
        if out.used {
            self.velocity.add(time_s, position_m);
        }
        self.counts.samples += 1;
        self.counts.unused += u64::from(!out.used);
        self.counts.restarts += u64::from(out.restarted);
        self.counts.ruptures += u64::from(out.detection.is_some());
        let line = output_json(&sample, &out, &self.counts, self.broadcast.dropped());
        self.broadcast.send(line);
        let delay = arrived.elapsed();
        self.total_delay += delay;
        self.counts.worst_delay_s = self.counts.worst_delay_s.max(delay.as_secs_f64());
        out
    }

    /// The counts so far.
    #[must_use]
    pub fn counts(&self) -> StreamCounts {
        let mean_delay_s = self.total_delay.as_secs_f64() / self.counts.samples.max(1) as f64;
        StreamCounts { dropped_by_readers: self.broadcast.dropped(), mean_delay_s, ..self.counts.clone() }
    }
}
