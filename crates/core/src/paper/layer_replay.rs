//! Re-estimation of a traversed layer: RLS runs again over the layer's raw samples, with the prior that the force drop
//! suggests, a few samples per step.

use super::friction_compensation::FrictionCompensation;
use super::rls::Rls;
use super::sample_ring::{SampleRing, Storage};
use crate::config::{EnhanceConfig, Model, Reset};
use crate::sample::Sample;

/// Regressor of a model.
#[inline]
pub(crate) fn regressor(model: Model, depth_m: f64, velocity_mps: f64) -> [f64; 2] {
    match model {
        Model::KelvinVoigt => [depth_m, velocity_mps],
        Model::MultiLayer => [depth_m, depth_m * velocity_mps],
    }
}

/// Prior variance of the friction for which elastic and viscous force at the rupture have the measured ratio:
/// `sK (1 - kappa)/(kappa v²)` for the multi-layer model \[S (17)\], `sK (d/2)² (1 - kappa)/(kappa v²)` for Kelvin-Voigt
/// \[L\].
pub(crate) fn reweighted_prior(
    config: &EnhanceConfig,
    share: f64,
    mean_velocity_mps: f64,
    thickness_m: f64,
) -> f64 {
    let v2 = mean_velocity_mps * mean_velocity_mps;
    let ratio = (1.0 - share) / (share * v2);
    let prior = match config.model {
        Model::MultiLayer => config.prior_stiffness * ratio,
        Model::KelvinVoigt => config.prior_stiffness * ratio * (thickness_m / 2.0) * (thickness_m / 2.0),
    };
    if prior.is_finite() { prior } else { config.prior_friction }
}

/// Sampling interval of the paper (200 Hz), in s, at which a sample has unit weight.
const REFERENCE_INTERVAL_S: f64 = 0.005;

/// Noise variance of a sample after `dt_s` relative to one at 200 Hz: faster samples weigh less, so that the prior means the
/// same at every sampling rate \[D\].
#[inline]
pub(crate) fn relative_noise(dt_s: f64) -> f64 {
    if dt_s > 0.0 { REFERENCE_INTERVAL_S / dt_s } else { 1.0 }
}

/// Schedule of covariance resets, for the online estimate and the replay.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ResetClock {
    since_s: f64,
}

impl ResetClock {
    /// Resets the covariance when the policy demands it; to be called before each update.
    #[inline]
    pub(crate) fn reset_if_due(&mut self, reset: &Reset, dt_s: f64, prior: [f64; 2], rls: &mut Rls) {
        match *reset {
            Reset::Frequency { hz } => {
                self.since_s += dt_s;
                // Half an interval of tolerance, so that rounding of the time stamps cannot delay a reset.
                if (self.since_s + 0.5 * dt_s) * hz >= 1.0 {
                    // Keeping the phase makes the resets average to the frequency.
                    self.since_s = (self.since_s - 1.0 / hz).max(-dt_s);
                    rls.reset_covariance(prior);
                }
            }
            Reset::Trace { below } => {
                if rls.trace() < below {
                    rls.reset_covariance(prior);
                }
            }
            Reset::Ruptures => {}
        }
    }
}

/// A replay in progress.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerReplay {
    rls: Rls,
    clock: ResetClock,
    prior: [f64; 2],
    start_m: f64,
    next: u64,
    end: u64,
    last_s: Option<f64>,
    used: bool,
}

impl LayerReplay {
    /// Over the sample indices `first..end` of the layer that starts at `start_m`.
    pub(crate) fn new(prior: [f64; 2], start_m: f64, first: u64, end: u64) -> Self {
        Self {
            rls: Rls::new(prior),
            clock: ResetClock::default(),
            prior,
            start_m,
            next: first,
            end,
            last_s: None,
            used: false,
        }
    }

    /// Replays at most `config.drop.replay_per_tick` samples. Returns the parameters when finished, or `online` when no
    /// samples are left or the result is not finite.
    pub(crate) fn process_batch(
        &mut self,
        config: &EnhanceConfig,
        ring: &SampleRing<impl Storage>,
        compensation: &FrictionCompensation,
        online: [f64; 2],
    ) -> Option<[f64; 2]> {
        self.next = self.next.max(ring.oldest_index());
        let stop = self.end.min(self.next.saturating_add(config.drop.replay_per_tick.max(1) as u64));
        while self.next < stop {
            let batch = ring.contiguous(self.next, stop);
            if batch.is_empty() {
                self.next = stop; // the rest is not kept
                break;
            }
            self.next += batch.len() as u64;
            self.update(config, compensation, batch);
        }
        let found = if self.used && self.rls.is_finite() { self.rls.theta } else { online };
        (self.next >= self.end).then_some(found)
    }

    fn update(&mut self, config: &EnhanceConfig, compensation: &FrictionCompensation, batch: &[Sample]) {
        let (mut rls, mut clock, mut last_s) = (self.rls, self.clock, self.last_s);
        self.used |= !batch.is_empty();
        let forgetting = config.forgetting;
        for s in batch {
            let dt_s = last_s.map_or(0.0, |last| s.time_s - last);
            last_s = Some(s.time_s);
            let depth_m = s.position_m - self.start_m;
            if depth_m > 0.0 {
                clock.reset_if_due(&config.reset, dt_s, self.prior, &mut rls);
                let phi = regressor(config.model, depth_m, s.velocity_mps);
                let y = s.force_n - compensation.friction_at_ns_per_m(s.position_m) * s.velocity_mps;
                rls.update_with_noise(phi, y, forgetting, relative_noise(dt_s));
            }
        }
        (self.rls, self.clock, self.last_s) = (rls, clock, last_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn with_model(model: Model) -> EnhanceConfig {
        EnhanceConfig { model, ..EnhanceConfig::paper() }
    }

    #[test]
    fn the_prior_gives_elastic_and_viscous_force_the_ratio_of_the_drop() {
        // Prior variances of elastic and friction force at the rupture have the ratio kappa to 1 - kappa.
        let (share, v, d) = (0.8, 0.0023, 0.03);
        for model in [Model::MultiLayer, Model::KelvinVoigt] {
            let config = with_model(model);
            let prior = reweighted_prior(&config, share, v, d);
            let elastic_n2 = config.prior_stiffness * d * d;
            let friction_n2 = match model {
                Model::MultiLayer => prior * (d * v) * (d * v),
                // Kelvin-Voigt friction does not grow with depth: evaluated at half of the travel.
                Model::KelvinVoigt => 4.0 * prior * v * v,
            };
            assert!((friction_n2 / elastic_n2 - 0.25).abs() < 1e-9, "{model:?}");
            // At standstill the prior is not changed.
            assert_eq!(reweighted_prior(&config, share, 0.0, d), config.prior_friction);
        }
    }

    #[test]
    fn the_weight_of_a_sample_is_proportional_to_its_interval() {
        for (dt_s, expected) in [(0.005, 1.0), (0.001, 5.0), (0.02, 0.25), (0.0, 1.0)] {
            assert!((relative_noise(dt_s) - expected).abs() < 1e-12);
        }
    }

    /// Samples after which the covariance equals its prior.
    fn resets(reset: Reset, dt_s: f64, count: usize) -> Vec<usize> {
        let (mut clock, mut rls) = (ResetClock::default(), Rls::new([1e6, 1e6]));
        (1..=count)
            .filter(|k| {
                clock.reset_if_due(&reset, dt_s, [1e6, 1e6], &mut rls);
                let fresh = rls.trace() == 2e6;
                rls.update([0.01, 1e-4 * *k as f64], 0.0, 1.0);
                *k > 1 && fresh
            })
            .collect()
    }

    #[test]
    fn the_covariance_is_reset_at_the_frequency_on_average_and_evenly() {
        for (hz, dt_s) in [(40.0, 0.005), (40.0, 0.01), (6.66, 0.005), (30.0, 0.001)] {
            let found = resets(Reset::Frequency { hz }, dt_s, 6000);
            let expected = 6000.0 * dt_s * hz;
            assert!((found.len() as f64 - expected).abs() <= 1.0, "{} for {expected}", found.len());
            let between = 1.0 / (hz * dt_s);
            for pair in found.windows(2) {
                let gap = (pair[1] - pair[0]) as f64;
                assert!((gap - between).abs() < 1.0, "{gap} samples for {between}");
            }
        }
    }

    #[test]
    fn the_covariance_is_reset_where_its_trace_has_fallen_below_the_threshold_and_not_elsewhere() {
        assert_eq!(resets(Reset::Ruptures, 0.005, 1000), [0_usize; 0]);
        assert_eq!(resets(Reset::Trace { below: 0.0 }, 0.005, 1000), [0_usize; 0]);
        let often = resets(Reset::Trace { below: 1.999e6 }, 0.005, 1000);
        assert_eq!(often.len(), 999, "the first sample takes more than that");
    }

    /// Air, then from sample 10 on a layer of 40 N/m and 9000 N s/m² at two speeds.
    fn layer(count: u64, hold: usize) -> SampleRing<Vec<Sample>> {
        let mut history = SampleRing::new(alloc::vec![Sample::default(); hold]);
        let mut z = -0.0001;
        for number in 0..count {
            let v = if number / 200 % 2 == 0 { 0.002 } else { 0.004 };
            z += 0.005 * v;
            let force_n = if z > 0.0 { 40.0 * z + 9000.0 * z * v } else { 0.0 };
            let time_s = 0.005 * number as f64;
            history.push(Sample { time_s, position_m: z, velocity_mps: v, force_n });
        }
        history
    }

    #[test]
    fn replaying_a_layer_takes_several_batches_and_recovers_the_parameters() {
        let mut config = with_model(Model::MultiLayer);
        config.drop.replay_per_tick = 64;
        config.reset = Reset::Ruptures;
        let history = layer(1000, 2000);
        let mut rerun = LayerReplay::new([1e6, 1e12], 0.0, 0, 1000);
        let mut ticks = 1;
        let found = loop {
            match rerun.process_batch(&config, &history, &FrictionCompensation::default(), [0.0; 2]) {
                Some(found) => break found,
                None => ticks += 1,
            }
        };
        assert_eq!(ticks, 16, "1000 samples by 64");
        assert!((found[0] / 40.0 - 1.0).abs() < 0.02 && (found[1] / 9000.0 - 1.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn the_replay_uses_the_samples_that_are_kept_and_falls_back_to_the_online_estimate() {
        let mut config = with_model(Model::MultiLayer);
        config.reset = Reset::Ruptures;
        let online = [1.0, 2.0];
        let through = |history: &SampleRing<Vec<Sample>>, first, end| {
            let mut rerun = LayerReplay::new([1e6, 1e12], 0.0, first, end);
            (0..100)
                .find_map(|_| rerun.process_batch(&config, history, &FrictionCompensation::default(), online))
        };
        let found = through(&layer(1000, 600), 0, 1000).expect("an end");
        assert!((found[0] / 40.0 - 1.0).abs() < 0.05, "{found:?}");
        assert_eq!(through(&layer(1000, 100), 0, 800), Some(online));
        assert_eq!(through(&layer(1000, 0), 0, 1000), Some(online));
    }

    #[test]
    fn the_replay_subtracts_the_friction_of_previous_layers() {
        let mut config = with_model(Model::MultiLayer);
        config.reset = Reset::Ruptures;
        let mut before = FrictionCompensation::default();
        before.add_layer(crate::sample::LayerEstimate {
            start_m: -0.02,
            thickness_m: 0.02,
            added_friction_ns_per_m: 200.0,
            ..crate::sample::LayerEstimate::default()
        });
        let (plain, mut history) = (layer(1000, 2000), SampleRing::new(alloc::vec![Sample::default(); 2000]));
        for number in 0..1000 {
            let s = *plain.get(number).expect("held");
            history.push(Sample { force_n: s.force_n + 200.0 * s.velocity_mps, ..s });
        }
        let run = |history: &SampleRing<Vec<Sample>>, compensation: &FrictionCompensation| {
            let mut rerun = LayerReplay::new([1e6, 1e12], 0.0, 0, 1000);
            (0..100)
                .find_map(|_| rerun.process_batch(&config, history, compensation, [0.0; 2]))
                .expect("an end")
        };
        let (with, without) = (run(&history, &before), run(&plain, &FrictionCompensation::default()));
        assert!((with[0] - without[0]).abs() < 1e-3 && (with[1] / without[1] - 1.0).abs() < 1e-4, "{with:?}");
    }
}
