//! A posteriori re-estimation of a traversed layer: the RLS runs again over the layer's raw
//! samples with the prior that the force drop suggests, a few samples per tick.

use crate::compensation::Compensation;
use crate::config::{EnhanceConfig, Model, Reset};
use crate::history::History;
use crate::rls::Rls;
use crate::sample::Sample;

/// Regressor of a model.
#[inline]
pub(crate) fn regressor(model: Model, depth_m: f64, velocity_mps: f64) -> [f64; 2] {
    match model {
        Model::KelvinVoigt => [depth_m, velocity_mps],
        Model::MultiLayer => [depth_m, depth_m * velocity_mps],
    }
}

/// Prior variance of the friction that makes elastic and viscous force at the rupture stand in the
/// measured proportion: `sK (1 - kappa)/(kappa v²)` for the multi-layer model \[S (17)\],
/// `sK (d/2)² (1 - kappa)/(kappa v²)` for Kelvin-Voigt \[L\].
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

/// Interval in s at which a sample weighs as much as in the paper's 200 Hz.
const ORDINARY_INTERVAL_S: f64 = 0.005;

/// Noise variance of a sample after `dt_s`, relative to one at 200 Hz: samples that come faster weigh
/// less, so that the prior means the same at every sampling rate \\[D\\].
#[inline]
pub(crate) fn relative_noise(dt_s: f64) -> f64 {
    if dt_s > 0.0 { ORDINARY_INTERVAL_S / dt_s } else { 1.0 }
}

/// When the covariance is to be reset: shared by the online run and the re-run.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ResetClock {
    since_s: f64,
}

impl ResetClock {
    /// Resets the covariance when the policy says so; call before each update.
    #[inline]
    pub(crate) fn tick(&mut self, reset: &Reset, dt_s: f64, prior: [f64; 2], rls: &mut Rls) {
        match *reset {
            Reset::Frequency { hz } => {
                self.since_s += dt_s;
                // Half an interval of grace, so that rounding in the time stamps cannot add one.
                if (self.since_s + 0.5 * dt_s) * hz >= 1.0 {
                    // The phase is kept: between samples the resets average to the frequency.
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

/// The re-run in progress.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rerun {
    rls: Rls,
    clock: ResetClock,
    prior: [f64; 2],
    start_m: f64,
    next: u64,
    end: u64,
    last_s: Option<f64>,
    used: bool,
}

impl Rerun {
    /// Over the samples numbered `first..end` of the layer that starts at `start_m`.
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

    /// Does at most `config.drop.replay_per_tick` samples. When it is through, the parameters, or
    /// `online` when the samples are gone or spoilt.
    pub(crate) fn work<B: AsRef<[Sample]> + AsMut<[Sample]>>(
        &mut self,
        config: &EnhanceConfig,
        history: &History<B>,
        compensation: &Compensation,
        online: [f64; 2],
    ) -> Option<[f64; 2]> {
        self.next = self.next.max(history.oldest());
        let stop = self.end.min(self.next + config.drop.replay_per_tick.max(1) as u64);
        while self.next < stop {
            let run = history.run(self.next, stop);
            if run.is_empty() {
                self.next = stop; // what is not there cannot be run again
                break;
            }
            self.next += run.len() as u64;
            self.learn(config, compensation, run);
        }
        let found = if self.used && self.rls.is_finite() { self.rls.theta } else { online };
        (self.next >= self.end).then_some(found)
    }

    fn learn(&mut self, config: &EnhanceConfig, compensation: &Compensation, run: &[Sample]) {
        let (mut rls, mut clock, mut last_s) = (self.rls, self.clock, self.last_s);
        self.used |= !run.is_empty();
        let forgetting = config.forgetting;
        for s in run {
            let dt_s = last_s.map_or(0.0, |last| s.time_s - last);
            last_s = Some(s.time_s);
            let depth_m = s.position_m - self.start_m;
            if depth_m > 0.0 {
                clock.tick(&config.reset, dt_s, self.prior, &mut rls);
                let phi = regressor(config.model, depth_m, s.velocity_mps);
                let y = s.force_n - compensation.around_shaft_ns_per_m(s.position_m) * s.velocity_mps;
                rls.update_with_noise(phi, y, forgetting, relative_noise(dt_s));
            }
        }
        (self.rls, self.clock, self.last_s) = (rls, clock, last_s);
    }
}
