//! Estimates the deviations of a group's recordings, and the prediction errors with a deviation.

use super::group_deviation::{Factor, PARAMETERS, RECORDING_SD, Refit, Values};
use super::group_update::{GroupInformation, Observation, RecordingEstimate, estimate_recording};
use super::prepared::Prepared;
use super::target::Target;
use stylet_stats::parallel::*;

/// Recordings of a group with their estimated deviations from the model.
pub struct GroupFit<'a> {
    prepared: &'a Prepared<'a>,
    targets: &'a [Target],
    /// Indices of the recordings.
    pub recordings: Vec<usize>,
    estimates: Vec<RecordingEstimate>,
    /// Standard deviations between groups; zero for parameters that are not fitted.
    pub group_sd: Values,
    recording_sd: Values,
}

impl<'a> GroupFit<'a> {
    /// Estimates the deviations of `recordings` in `parameters`; the groups differ in the factors `varying`.
    pub fn new(
        prepared: &'a Prepared<'a>,
        targets: &'a [Target],
        parameters: &[Refit],
        varying: &[Factor],
        recordings: &[usize],
    ) -> Option<Self> {
        let wide = recordings
            .iter()
            .map(|r| prepared.group_sd(varying, *r))
            .fold([0.0; PARAMETERS], |a, b| std::array::from_fn(|k| f64::max(a[k], b[k])));
        let is_free = |k: usize| parameters.contains(&Refit::ALL[k]);
        let group_sd: Values = std::array::from_fn(|k| if is_free(k) { wide[k] } else { 0.0 });
        let recording_sd = prepared.training.map_or(RECORDING_SD, |t| t.recording_sd);
        // The deviation of a recording is that of its group plus its own.
        let prior_sd: Values = std::array::from_fn(|k| {
            if group_sd[k] > 0.0 { libm::hypot(group_sd[k], recording_sd[k]) } else { 0.0 }
        });
        let estimates = recordings
            .par_iter()
            .map(|r| {
                let b = &prepared.data.recordings[*r];
                let observed =
                    Observation { force_n: &b.force_n, used: &b.used, weight: prepared.weight(*r) };
                let force = |u: &Values| prepared.force(*r, u, &targets[*r].mean_residual);
                estimate_recording(&observed, force, prior_sd)
            })
            .collect::<Option<_>>()?;
        Some(Self { prepared, targets, recordings: recordings.to_vec(), estimates, group_sd, recording_sd })
    }

    /// Information of all recordings but `except`.
    pub fn information(&self, except: Option<usize>) -> GroupInformation {
        let kept = self.recordings.iter().zip(&self.estimates).filter(|(r, _)| Some(**r) != except);
        GroupInformation::new(&kept.map(|(_, e)| e).collect::<Vec<_>>(), &self.recording_sd)
    }

    /// RMS error (N) of the block means of all recordings, each with its own estimated deviation.
    pub fn own_rms_n(&self) -> Option<f64> {
        let own =
            |r: usize| self.recordings.iter().position(|k| *k == r).map(|k| self.estimates[k].deviation);
        self.rms_n(&self.recordings, |r| own(r).unwrap_or([0.0; PARAMETERS]))
    }

    /// RMS error (N) of the block means of `recordings`, each with its deviation.
    pub fn rms_n(&self, recordings: &[usize], deviation: impl Fn(usize) -> Values + Sync) -> Option<f64> {
        let each: Vec<(f64, f64)> =
            recordings.par_iter().map(|r| self.error(*r, &deviation(*r))).collect::<Option<_>>()?;
        let (square, blocks) = each.iter().fold((0.0, 0.0), |(s, n), e| (s + e.0, n + e.1));
        Some((square / f64::max(blocks, 1.0)).sqrt())
    }

    /// Sum of squared errors (N²) of recording `r` and its number of blocks.
    fn error(&self, r: usize, deviation: &Values) -> Option<(f64, f64)> {
        let b = &self.prepared.data.recordings[r];
        let force = self.prepared.force(r, deviation, &self.targets[r].mean_residual)?;
        let used = b.force_n.iter().zip(&force).zip(&b.used).filter(|(_, used)| **used);
        Some(used.fold((0.0, 0.0), |(s, n), ((y, f), _)| (s + (y - f).powi(2), n + 1.0)))
    }
}
