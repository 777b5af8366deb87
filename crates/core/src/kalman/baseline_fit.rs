//! Baselines fitted to the blocks of [`super::air_history`].

use super::air_history::{AirEvidence, AirHistory, DECISION_NATS};
use super::air_sums::{Form, MIN_REMAINING_SHARE, Totals};
use crate::bounds::at_least;
use crate::sample::{BaselineKind, Sample};

/// Squared correlation of time and position above which drift and line are not separable.
const INSEPARABLE: f64 = 0.99;
/// Log odds between drift and line from which the more probable one is reported.
const NAMING_NATS: f64 = 3.0;

/// Probability from which drift and line of a baseline that is more probably constant are unknowns.
const MIN_MOVING_PROBABILITY: f64 = 0.1;

/// A baseline fitted to the samples in air, referred to `time_s` and `position_m`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BaselineFit {
    pub(crate) time_s: f64,
    pub(crate) position_m: f64,
    /// Level in N, drift in N/s, slope with position in N/m.
    pub(crate) x: [f64; 3],
    /// Their covariance.
    pub(crate) p: [[f64; 3]; 3],
    pub(crate) kind: BaselineKind,
    /// Number of samples fitted.
    pub(crate) samples: f64,
}

impl BaselineFit {
    /// The same baseline referred to another time and place.
    pub(super) fn at(&self, time_s: f64, position_m: f64) -> Self {
        let (dt, dz) = (time_s - self.time_s, position_m - self.position_m);
        let mut out = Self { time_s, position_m, ..*self };
        out.x[0] += dt * self.x[1] + dz * self.x[2];
        out.p[0][0] = self.level_variance(dt, dz);
        for k in 1..3 {
            out.p[0][k] = self.p[0][k] + dt * self.p[1][k] + dz * self.p[2][k];
            out.p[k][0] = out.p[0][k];
        }
        out
    }

    /// Variance in N² of the level after `dt_s` and `dz_m`.
    pub(crate) fn level_variance(&self, dt_s: f64, dz_m: f64) -> f64 {
        let p = &self.p;
        at_least(
            0.0,
            p[0][0]
                + dt_s * (2.0 * p[0][1] + dt_s * p[1][1])
                + dz_m * (2.0 * p[0][2] + dz_m * p[2][2])
                + 2.0 * dt_s * dz_m * p[1][2],
        )
    }
}

impl AirHistory {
    /// The baseline of all blocks, referred to a time and place.
    pub(super) fn fit_all_blocks(&self, evidence: &AirEvidence, at: &Sample) -> BaselineFit {
        self.fit(evidence, &evidence.total, evidence.no_event.form, at)
    }

    /// The baseline of the blocks before a bend. A drift or line that is not sure is fitted, but not named.
    pub(super) fn fit_before_bend(&self, evidence: &AirEvidence, at: &Sample) -> BaselineFit {
        let fit = self.fit(evidence, &evidence.total.before(&evidence.bend.sums), evidence.bend.form, at);
        let sure = evidence.bend.nats - evidence.constant_bend_nats > DECISION_NATS;
        BaselineFit { kind: if sure { fit.kind } else { BaselineKind::Constant }, ..fit }
    }

    /// A constant baseline fitted before a bend, with the covariance of its mixture with a moving one; `None` if that is improbable.
    pub(super) fn constant_mixture_fit(
        &self,
        mut constant: BaselineFit,
        evidence: &AirEvidence,
        at: &Sample,
    ) -> Option<BaselineFit> {
        let probability = evidence.moving_probability();
        if probability < MIN_MOVING_PROBABILITY {
            return None;
        }
        let bend = &evidence.moving_bend;
        let moving = self.fit(evidence, &evidence.total.before(&bend.sums), bend.form, at);
        let apart = [moving.x[0] - constant.x[0], moving.x[1], moving.x[2]];
        constant.p[0][0] *= 1.0 - probability;
        for i in 0..3 {
            for j in 0..3 {
                constant.p[i][j] += probability * (moving.p[i][j] + apart[i] * apart[j]);
            }
        }
        Some(constant)
    }

    /// The baseline behind a step, whose level is known from the samples behind it alone.
    pub(super) fn fit_behind_step(&self, evidence: &AirEvidence, at: &Sample) -> BaselineFit {
        let step = &evidence.step;
        let mut fit = self.fit(evidence, &evidence.total.without_step(&step.sums, step.size), step.form, at);
        fit.p[0][0] = at_least(fit.p[0][0], evidence.excess / at_least(1e-300, step.sums.n));
        fit
    }

    /// Joint least-squares fit of level, drift and line. Each slope has a prior of the size of the whole change, so that at constant
    /// speed, where both are collinear, each gets half of it.
    fn fit(&self, evidence: &AirEvidence, total: &Totals, form: Form, at: &Sample) -> BaselineFit {
        // Sums in units of the noise variance with its excess.
        let scale = 1.0 / evidence.excess;
        let total = &total.scaled(scale);
        let samples = total.weight / (scale * evidence.sample_weight);
        let centre = (total.time_s + self.origin.time_s, total.position_m + self.origin.position_m);
        let (dt, dz) = (at.time_s - centre.0, at.position_m - centre.1);
        let level = total.force_n + self.origin.force_n;
        let mut fit =
            BaselineFit { time_s: at.time_s, position_m: at.position_m, samples, ..BaselineFit::default() };
        fit.p[0][0] = 1.0 / at_least(1e-300, total.weight);
        fit.x[0] = level;
        if form == Form::Constant || total.tt <= 0.0 {
            return fit;
        }
        let travels = total.zz > MIN_REMAINING_SHARE * total.tt;
        let rate = if form == Form::Drift { total.tf / total.tt } else { total.zf / total.zz };
        let speed = libm::sqrt(total.zz / total.tt);
        let (rate_s, rate_m) = if form == Form::Drift { (rate, rate / speed) } else { (rate * speed, rate) };
        // Bounded so that products of two do not overflow.
        let squared = |x: f64| 1.0 / at_least(1e-100, x * x);
        let (pd, pl) = (squared(rate_s), squared(rate_m));
        let (a, c) = (total.tt + pd, total.zz + pl);
        let b = total.tz;
        let (drift, line, p11, p12, p22) = if travels && (a * c - b * b) > 0.0 {
            let det = a * c - b * b;
            let drift = (c * total.tf - b * total.zf) / det;
            let line = (a * total.zf - b * total.tf) / det;
            (drift, line, c / det, -b / det, a / det)
        } else {
            (total.tf / a, 0.0, 1.0 / a, 0.0, 0.0)
        };
        fit.x = [level + drift * dt + line * dz, drift, line];
        // From the centre to the reference.
        let p01 = dt * p11 + dz * p12;
        let p02 = dt * p12 + dz * p22;
        fit.p = [[fit.p[0][0] + dt * p01 + dz * p02, p01, p02], [p01, p11, p12], [p02, p12, p22]];
        let r2 = total.tz * total.tz / at_least(1e-300, total.tt * total.zz);
        let gain = |form| -0.5 * total.residual(form);
        let difference = gain(Form::Drift) - gain(Form::Line);
        fit.kind = if !travels {
            BaselineKind::Drift
        } else if r2 > INSEPARABLE || difference.abs() < NAMING_NATS {
            BaselineKind::DriftOrLine
        } else if difference > 0.0 {
            BaselineKind::Drift
        } else {
            BaselineKind::Line
        };
        fit
    }
}

#[cfg(test)]
mod tests;
