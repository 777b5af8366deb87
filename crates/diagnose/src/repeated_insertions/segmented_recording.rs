//! Segments recordings of insertions into phases and events, and groups them by speed and stroke.

use stylet_identify::insertion_phases::{
    AbruptDrop, InsertionPhases, abrupt_drops, contact_m, detect_phases, noise_n, releases, rupture_samples,
};
use stylet_identify::model::NO_RUPTURE;
use stylet_record::{QualityNote, Recording};
use stylet_stats::order_statistics::median_of;

/// Relative tolerance of the speeds in a group, which is assumed to be recorded on one day.
pub const SPEED_TOLERANCE: f64 = 0.1;
/// Tolerance (m) of the strokes in a group.
pub(crate) const STROKE_TOLERANCE_M: f64 = 1e-3;

/// A recording of an insertion with its phases and detected events.
#[derive(Clone, Debug)]
pub struct SegmentedRecording {
    /// Name.
    pub name: String,
    /// All samples.
    pub recording: Recording,
    /// Data-quality notes.
    pub notes: Vec<QualityNote>,
    /// Phases of the motion.
    pub phases: InsertionPhases,
    /// Median speed of the advance in m/s.
    pub speed_mps: f64,
    /// Largest position in m.
    pub stroke_m: f64,
    /// Position (m) at which the force rises from zero.
    pub contact_m: f64,
    /// Rupture time (s) per layer; [`NO_RUPTURE`] without a visible drop.
    pub ruptures_s: Vec<f64>,
    /// Force (N) just before the rupture, per layer.
    pub loads_n: Vec<Option<f64>>,
    /// Release position (m) during retraction per layer, if visible.
    pub releases_m: Vec<Option<f64>>,
    /// Saturation limit (N), if reached; forces above it are not compared.
    pub limit_n: Option<f64>,
}

impl SegmentedRecording {
    /// Segments a recording of a tissue with `layers` layers.
    #[must_use]
    pub fn new(name: String, recording: Recording, layers: usize) -> Self {
        let at = detect_phases(&recording);
        let ruptures = rupture_samples(&abrupt_drops(&recording, &at), layers);
        let found = releases(&recording, &at, layers);
        // Of fewer releases than layers, only the last one can be assigned, to the first layer.
        let releases_m = (0..layers)
            .map(|l| if found.len() == layers || l == 0 { found.get(l).map(|r| r.position_m) } else { None })
            .collect();
        let advance = recording.velocity_mps.get(at.start..=at.deepest).unwrap_or(&[]);
        let (time, force) = (&recording.time_s, &recording.force_n);
        Self {
            speed_mps: median_of(advance.iter().copied().filter(|v| *v > 0.0)),
            stroke_m: recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            contact_m: contact_m(&recording, &at),
            ruptures_s: ruptures
                .iter()
                .map(|i| i.filter(|i| *i > 0).map_or(NO_RUPTURE, |i| 0.5 * (time[i - 1] + time[i])))
                .collect(),
            loads_n: ruptures.iter().map(|i| i.map(|i| force[i.saturating_sub(4)])).collect(),
            releases_m,
            phases: at,
            limit_n: None,
            notes: Vec::new(),
            name,
            recording,
        }
    }

    /// Abrupt force drops before the retraction.
    #[must_use]
    pub fn drops(&self) -> Vec<AbruptDrop> {
        abrupt_drops(&self.recording, &self.phases)
    }

    /// Time (s) of the first rupture; [`NO_RUPTURE`] without one.
    pub(crate) fn first_rupture_s(&self) -> f64 {
        self.ruptures_s.iter().copied().fold(NO_RUPTURE, f64::min)
    }

    /// Standard deviation of the sensor noise in N.
    #[must_use]
    pub fn noise_n(&self) -> f64 {
        noise_n(&self.recording.force_n)
    }
}

/// Indices of the recordings grouped by speed and stroke, slowest first.
#[must_use]
pub fn group_by_speed_and_stroke(recordings: &[&SegmentedRecording]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..recordings.len()).collect();
    order.sort_by(|a, b| recordings[*a].speed_mps.total_cmp(&recordings[*b].speed_mps));
    let mut out: Vec<Vec<usize>> = Vec::new();
    for i in order {
        let same_group = |members: &Vec<usize>| {
            let first = recordings[members[0]];
            recordings[i].speed_mps < first.speed_mps * (1.0 + SPEED_TOLERANCE)
                && (recordings[i].stroke_m - first.stroke_m).abs() < STROKE_TOLERANCE_M
        };
        match out.iter_mut().rev().find(|g| same_group(g)) {
            Some(group) => group.push(i),
            None => out.push(vec![i]),
        }
    }
    out.iter_mut().for_each(|g| g.sort_unstable());
    out
}

/// Whether all recordings have the same speed.
pub(crate) fn have_one_speed(recordings: &[&SegmentedRecording]) -> bool {
    let slowest = recordings.iter().map(|r| r.speed_mps).fold(f64::INFINITY, f64::min);
    recordings.iter().all(|r| r.speed_mps < slowest * (1.0 + SPEED_TOLERANCE))
}

/// Whether the recordings have several speeds or strokes.
pub(crate) fn have_several_speeds(recordings: &[&SegmentedRecording]) -> bool {
    group_by_speed_and_stroke(recordings).len() > 1
}

/// Groups of one speed and stroke with their mean speed, slowest first.
#[must_use]
pub fn mean_speeds(recordings: &[&SegmentedRecording]) -> Vec<(f64, Vec<usize>)> {
    let mean = |g: &[usize]| g.iter().map(|i| recordings[*i].speed_mps).sum::<f64>() / g.len().max(1) as f64;
    group_by_speed_and_stroke(recordings).into_iter().map(|g| (mean(&g), g)).collect()
}

#[cfg(test)]
pub(crate) mod tests;
