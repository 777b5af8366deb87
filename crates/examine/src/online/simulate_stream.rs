//! Simulation of a stream: samples and ground truth.

use super::draw_stream::{StreamSetup, set_up_stream};
use super::moving_tissue::MovingTissue;
use super::stream_id::StreamId;
use crate::simulator::force_law::ForceLaw;
use crate::simulator::force_sensor::SensorModel;
use crate::simulator::insertion::simulate_insertion;
use crate::simulator::motion_path::MotionPath;
use crate::simulator::plain_world::PlainWorld;
use crate::simulator::rich_world::RichWorld;
use crate::simulator::sensor_noise::NoiseGenerator;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};
use stylet_stats::interpolate;

/// Longest step of the simulation in s.
const STEP_S: f64 = 2e-4;
/// Irregularity of the sampling where samples are missing, as a share of the interval.
const JITTER: f64 = 0.2;
/// Most samples missing in a row.
const LONGEST_GAP: usize = 20;
/// Resolution of the recorded position in m.
const ENCODER_M: f64 = 1e-6;

/// A true puncture, or in a recording a fall of the force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruePuncture {
    /// Time in s.
    pub time_s: f64,
    /// Position of the needle's base in m.
    pub position_m: f64,
    /// Elastic force that it released in N.
    pub drop_n: f64,
    /// Time in s at which the release is complete; infinite if the needle does not travel far enough.
    pub released_s: f64,
}

/// A stream with its truth.
#[derive(Clone, Debug)]
pub struct Stream {
    /// Row of the table.
    pub row: &'static str,
    /// Nominal rate in Hz.
    pub rate_hz: f64,
    /// Motion of the base; `None` in a recording.
    pub path: Option<MotionPath>,
    /// Times of the samples in s.
    pub time_s: Vec<f64>,
    /// Recorded positions in m.
    pub position_m: Vec<f64>,
    /// Recorded forces in N.
    pub force_n: Vec<f64>,
    /// Force on the tip in N at the samples; empty in a recording.
    pub tip_n: Vec<f64>,
    /// The punctures in the order of time.
    pub punctures: Vec<TruePuncture>,
    /// Possible punctures: an event there is neither a hit nor a false alarm.
    pub minor: Vec<TruePuncture>,
}

impl Stream {
    /// Duration in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().zip(self.time_s.first()).map_or(0.0, |(last, first)| last - first)
    }

    /// Position of the base in m: of the motion, or interpolated between the recorded samples.
    #[must_use]
    pub fn position_at_m(&self, time_s: f64) -> f64 {
        match &self.path {
            Some(path) => path.position_m(time_s),
            None => interpolate(&self.time_s, &self.position_m, time_s),
        }
    }
}

/// Simulates a stream.
#[must_use]
pub fn simulate_stream(id: &StreamId) -> Stream {
    let setup = set_up_stream(id);
    let mut rng = ChaCha8Rng::seed_from_u64(id.stream_seed());
    rng.set_stream(1);
    let mut time_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut noise_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut sensor = SensorModel::new(&setup.effects, 0.0);
    if let Some(step_n) = setup.rounding_n {
        sensor = sensor.with_rounding(step_n);
    }
    let at_s = sample_times_s(&setup, &mut time_rng);
    let mut disturbances = setup.disturbances.clone();
    let (mut plain, mut rich);
    let law: &mut dyn ForceLaw = match &setup.rich {
        None => {
            plain = PlainWorld::new(&setup.tissue, &setup.effects);
            &mut plain
        }
        Some(with) => {
            rich = RichWorld::new(&setup.tissue, with);
            &mut rich
        }
    };
    let step_s = STEP_S.min(0.5 / setup.rate_hz);
    let mut moving;
    let law: &mut dyn ForceLaw = match setup.tissue_motion {
        None => law,
        Some(tissue_motion) => {
            moving = MovingTissue { law, tissue_motion };
            &mut moving
        }
    };
    let insertion = simulate_insertion(law, &sensor, Some(&mut disturbances), &setup.path, &at_s, step_s);
    let mut noise = NoiseGenerator::new(&setup.noise, &mut noise_rng);
    let force_n = insertion
        .time_s
        .iter()
        .zip(&insertion.force_n)
        .map(|(&t, &f)| sensor.reading_n(t, f, noise.next(t, f, 1.0 / setup.rate_hz)))
        .collect();
    let last_s = insertion.time_s.last().copied().unwrap_or(0.0);
    let punctures = insertion
        .ruptures_s
        .iter()
        .zip(&insertion.released_n)
        .filter(|(time_s, _)| **time_s <= last_s)
        .map(|(&time_s, &drop_n)| {
            let position_m = setup.path.position_m(time_s);
            let far = |(t, z): &(&f64, &f64)| **t >= time_s && **z >= position_m + setup.release_m;
            let released_s = insertion
                .time_s
                .iter()
                .zip(&insertion.position_m)
                .find(far)
                .map_or(f64::INFINITY, |(t, _)| *t);
            TruePuncture { time_s, position_m, drop_n, released_s }
        })
        .collect();
    Stream {
        row: id.row.as_str(),
        rate_hz: setup.rate_hz,
        position_m: insertion.position_m.iter().map(|z| libm::round(z / ENCODER_M) * ENCODER_M).collect(),
        time_s: insertion.time_s,
        force_n,
        tip_n: insertion.tip_n,
        punctures,
        minor: Vec::new(),
        path: Some(setup.path),
    }
}

fn sample_times_s(setup: &StreamSetup, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = (setup.path.duration_s() * setup.rate_hz) as usize;
    let jitter = if setup.missing > 0.0 { JITTER } else { 0.0 };
    // Probability that a gap begins, so that this share is missing.
    let begins = setup.missing / (1.0 - setup.missing) / (0.5 * (1.0 + LONGEST_GAP as f64));
    let mut out = Vec::with_capacity(n);
    let mut missing = 0;
    for k in 0..n {
        let off = if k == 0 { 0.0 } else { jitter * (2.0 * rng.random::<f64>() - 1.0) };
        if missing == 0 && k > 0 && rng.random::<f64>() < begins {
            missing = rng.random_range(1..=LONGEST_GAP);
        }
        if missing > 0 {
            missing -= 1;
        } else {
            out.push((k as f64 + off) / setup.rate_hz);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::stream_id::{Row, Split, stream_ids};
    use super::*;
    use crate::cases::case_id::World;

    #[test]
    fn every_row_has_punctures_and_the_samples_of_its_rate_and_is_the_same_again() {
        for world in [World::Plain, World::Rich] {
            for id in stream_ids(world, Row::ALL, Split::Make, 3, 5) {
                let stream = simulate_stream(&id);
                assert!((1..=8).contains(&stream.punctures.len()), "{id:?}: {:?}", stream.punctures);
                assert!(stream.punctures.iter().all(|p| p.drop_n > 0.0), "{id:?}: {:?}", stream.punctures);
                assert!(stream.punctures.is_sorted_by(|a, b| a.time_s <= b.time_s));
                assert!(stream.time_s.is_sorted_by(|a, b| a < b), "{id:?}");
                assert!(stream.force_n.iter().all(|f| f.is_finite() && f.abs() < 60.0), "{id:?}");
                let share = stream.time_s.len() as f64 / (stream.duration_s() * stream.rate_hz);
                assert!(share > 0.5 && share < 1.01, "{id:?}: {share}");
                let again = simulate_stream(&id);
                assert_eq!((again.time_s, again.force_n), (stream.time_s, stream.force_n), "{id:?}");
            }
        }
    }

    #[test]
    fn the_drop_of_the_tip_s_force_is_the_released_force() {
        for id in stream_ids(World::Plain, &[Row::Constant], Split::Make, 6, 2) {
            let stream = simulate_stream(&id);
            for p in &stream.punctures {
                let k = stream.time_s.partition_point(|t| *t < p.time_s);
                let fall = stream.tip_n[k - 1] - stream.tip_n[k];
                // One sample of loading lies between.
                assert!((fall - p.drop_n).abs() < 0.05 * p.drop_n + 0.02, "{id:?}: {fall} {p:?}");
            }
        }
    }

    #[test]
    fn splits_rows_and_seeds_are_other_streams() {
        let of = |split, seed| {
            let ids = stream_ids(World::Plain, &[Row::Constant, Row::Hold], split, 2, seed);
            ids.iter().map(|id| simulate_stream(id).force_n[40].to_bits()).collect::<Vec<_>>()
        };
        let mut all = [of(Split::Make, 1), of(Split::Judge, 1), of(Split::Judge, 2)].concat();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}
