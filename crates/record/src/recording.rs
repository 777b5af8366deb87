//! A recording: motion of the needle and measured force, one sample per time stamp.

use serde::{Deserialize, Serialize};

use crate::differentiate::{DEFAULT_HALF_WIDTH_S, differentiate};
use crate::error::RecordError;

/// Joints of the arm whose torques a recording may hold.
pub const JOINTS: usize = 7;

/// One sample of a [`Recording`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Time (s).
    pub time_s: f64,
    /// Tip position along the insertion axis (m), positive into the tissue.
    pub position_m: f64,
    /// Tip velocity (m/s), positive into the tissue.
    pub velocity_mps: f64,
    /// Axial force (N), positive when it resists the insertion.
    pub force_n: f64,
}

/// A needle insertion as plain columns of equal length.
///
/// The fields are public because every consumer works on columns. [`Recording::new`],
/// [`Recording::with_velocity`] and [`crate::read_csv`] return recordings whose values are finite and whose time stamps
/// strictly increase; for columns filled by hand there is [`Recording::check`]. Sampling may be irregular.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// Time (s), strictly increasing.
    pub time_s: Vec<f64>,
    /// Tip position (m), positive into the tissue.
    pub position_m: Vec<f64>,
    /// Axial force (N) of the force sensor, positive when it resists the insertion.
    pub force_n: Vec<f64>,
    /// Tip velocity (m/s): measured, or the slope of the position ([`mod@crate::differentiate`]).
    pub velocity_mps: Vec<f64>,
    /// Whether `velocity_mps` was given (`true`) or differentiated from the position (`false`).
    pub velocity_measured: bool,
    /// Joint torques of the arm (N m), one row of seven per sample; empty without an arm.
    #[serde(default)]
    pub joint_torque_nm: Vec<[f64; JOINTS]>,
    /// Axial force (N) of a virtual sensor (momentum observer), positive when it resists the insertion.
    #[serde(default)]
    pub force_virtual_n: Option<Vec<f64>>,
}

impl Recording {
    /// A recording whose velocity is the slope of the position, over windows of +-[`DEFAULT_HALF_WIDTH_S`].
    ///
    /// # Errors
    /// As [`Recording::check`].
    pub fn new(time_s: Vec<f64>, position_m: Vec<f64>, force_n: Vec<f64>) -> Result<Self, RecordError> {
        // Differentiation requires increasing time.
        let mut recording =
            Self { velocity_mps: vec![0.0; time_s.len()], time_s, position_m, force_n, ..Self::default() };
        recording.check()?;
        recording.velocity_mps =
            differentiate(&recording.time_s, &recording.position_m, DEFAULT_HALF_WIDTH_S);
        check_finite("velocity_mps (differentiated)", &recording.velocity_mps)?;
        Ok(recording)
    }

    /// A recording whose velocity was measured (or is known from a simulation).
    ///
    /// # Errors
    /// As [`Recording::check`].
    pub fn with_velocity(
        time_s: Vec<f64>,
        position_m: Vec<f64>,
        velocity_mps: Vec<f64>,
        force_n: Vec<f64>,
    ) -> Result<Self, RecordError> {
        let recording =
            Self { time_s, position_m, force_n, velocity_mps, velocity_measured: true, ..Self::default() };
        recording.check()?;
        Ok(recording)
    }

    /// A recording from its columns, with the velocity where there is one.
    ///
    /// # Errors
    /// As [`Recording::check`].
    pub fn from_columns(
        time_s: Vec<f64>,
        position_m: Vec<f64>,
        force_n: Vec<f64>,
        velocity_mps: Option<Vec<f64>>,
    ) -> Result<Self, RecordError> {
        match velocity_mps {
            Some(velocity_mps) => Self::with_velocity(time_s, position_m, velocity_mps, force_n),
            None => Self::new(time_s, position_m, force_n),
        }
    }

    /// Checks the invariants of the type: columns of one length, at least two samples, finite values, increasing time.
    ///
    /// # Errors
    /// [`RecordError::TooShort`], [`RecordError::LengthMismatch`], [`RecordError::NotFiniteAt`] or
    /// [`RecordError::TimeNotIncreasing`], naming the column and the index.
    pub fn check(&self) -> Result<(), RecordError> {
        let samples = self.len();
        if samples < 2 {
            return Err(RecordError::TooShort { samples });
        }
        check_length("position_m", self.position_m.len(), samples)?;
        check_length("force_n", self.force_n.len(), samples)?;
        check_length("velocity_mps", self.velocity_mps.len(), samples)?;
        if !self.joint_torque_nm.is_empty() {
            check_length("joint_torque_nm", self.joint_torque_nm.len(), samples)?;
        }
        check_finite("time_s", &self.time_s)?;
        check_finite("position_m", &self.position_m)?;
        check_finite("force_n", &self.force_n)?;
        check_finite("velocity_mps", &self.velocity_mps)?;
        if let Some(force_virtual_n) = &self.force_virtual_n {
            check_length("force_virtual_n", force_virtual_n.len(), samples)?;
            check_finite("force_virtual_n", force_virtual_n)?;
        }
        for (index, torques) in self.joint_torque_nm.iter().enumerate() {
            for (joint, &value) in torques.iter().enumerate() {
                if !value.is_finite() {
                    let column = format!("joint_torque_{}_nm", joint + 1);
                    return Err(RecordError::NotFiniteAt { column, index, value });
                }
            }
        }
        match self.time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            None => Ok(()),
            Some(before) => Err(RecordError::TimeNotIncreasing {
                index: before + 1,
                time_s: self.time_s[before + 1],
                previous_s: self.time_s[before],
            }),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The samples in time order.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        let motion = self.time_s.iter().zip(&self.position_m).zip(&self.velocity_mps);
        motion.zip(&self.force_n).map(|(((&time_s, &position_m), &velocity_mps), &force_n)| Sample {
            time_s,
            position_m,
            velocity_mps,
            force_n,
        })
    }

    /// Time from the first to the last sample (s); 0 without samples.
    pub fn duration_s(&self) -> f64 {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// Median interval between samples (s): robust against gaps. `NaN` with fewer than two samples.
    pub fn median_interval_s(&self) -> f64 {
        stylet_stats::median_of(self.time_s.windows(2).map(|pair| pair[1] - pair[0]))
    }

    /// Mean sampling rate (Hz): intervals per duration. `NaN` with fewer than two samples.
    pub fn mean_hz(&self) -> f64 {
        if self.len() < 2 { f64::NAN } else { (self.len() - 1) as f64 / self.duration_s() }
    }

    /// Typical sampling rate (Hz): the inverse of the median interval. `NaN` with fewer than two samples.
    pub fn sample_hz(&self) -> f64 {
        1.0 / self.median_interval_s()
    }
}

pub(crate) fn check_length(column: &str, found: usize, expected: usize) -> Result<(), RecordError> {
    if found == expected {
        return Ok(());
    }
    Err(RecordError::LengthMismatch { column: column.to_owned(), found, expected })
}

pub(crate) fn check_finite(column: &str, values: &[f64]) -> Result<(), RecordError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            Err(RecordError::NotFiniteAt { column: column.to_owned(), index, value: values[index] })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sampling_rate_is_the_median_one_in_spite_of_a_gap() -> Result<(), RecordError> {
        let mut time_s: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.005).collect();
        time_s.extend((0..100).map(|i| 3.0 + f64::from(i) * 0.005));
        let recording = Recording::new(time_s, vec![0.0; 200], vec![0.0; 200])?;
        assert!((recording.sample_hz() - 200.0).abs() < 1e-6, "{}", recording.sample_hz());
        assert!((recording.duration_s() - 3.495).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn samples_have_the_values_of_one_time_stamp() -> Result<(), RecordError> {
        let recording =
            Recording::with_velocity(vec![0.0, 1.0], vec![0.1, 0.2], vec![0.3, 0.4], vec![5.0, 6.0])?;
        let last = recording.samples().last();
        assert_eq!(last, Some(Sample { time_s: 1.0, position_m: 0.2, velocity_mps: 0.4, force_n: 6.0 }));
        assert!(recording.velocity_measured);
        Ok(())
    }

    #[test]
    fn a_recording_built_in_memory_is_checked_like_one_from_a_file() {
        let refuses = |result: Result<Recording, RecordError>, words: &str| {
            let message = result.map(|_| ()).expect_err("must be refused").to_string();
            assert!(message.contains(words), "{message}");
        };
        refuses(Recording::new(vec![0.0], vec![0.0], vec![0.0]), "at least 2");
        refuses(Recording::new(vec![0.0, 1.0], vec![0.0], vec![0.0; 2]), "position_m has 1 values");
        refuses(
            Recording::new(vec![0.0, 1.0], vec![0.0, f64::NAN], vec![0.0; 2]),
            "position_m: the value at index 1",
        );
        refuses(Recording::new(vec![0.0, 0.0], vec![0.0; 2], vec![0.0; 2]), "time must increase");
        refuses(
            Recording::new(vec![0.0, 1e-300], vec![0.0, 1e300], vec![0.0; 2]),
            "velocity_mps (differentiated)",
        );
    }

    #[test]
    fn an_empty_recording_has_no_rate_and_does_not_panic() {
        let empty = Recording::default();
        assert!(empty.is_empty() && empty.median_interval_s().is_nan() && empty.sample_hz().is_nan());
        assert_eq!(empty.samples().count(), 0);
    }
}
