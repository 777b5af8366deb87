//! Decisions in air from the evidence of [`super::air_history`]: contact, steps of the sensor's zero, form of the baseline.

use super::air_history::{AirEvidence, DECISION_NATS, Form};
use super::baseline::MIN_SAMPLES;
use super::baseline_fit::BaselineFit;
use super::force_predictor::MotionStep;
use super::state::{FAILED_MISFIT, KalmanEnhancer};
use crate::bounds::{at_least, at_most};
use crate::config::{Contact, EnhanceConfig};
use crate::sample::{Baseline, Sample, ZeroStep};

/// Log odds at which a contact is final: 20 000 to 1.
const SETTLED_NATS: f64 = 10.0;

impl KalmanEnhancer {
    /// Evaluates the hypotheses in air whenever the number of samples has grown by a quarter or the force leaves the baseline
    /// (`side`: 1 above it, -1 below). Returns the evidence when a contact has begun.
    pub(super) fn evaluate_air_evidence(&mut self, sample: &Sample, side: i8) -> Option<AirEvidence> {
        let due = self.baseline.history.samples >= self.baseline.next_evaluation;
        if !due && side == 0 || self.baseline.history.samples < MIN_SAMPLES {
            return None;
        }
        if due {
            self.baseline.schedule();
        }
        self.operations += self.baseline.history.evaluation_operations();
        let evidence = self.baseline.history.evaluate();
        if evidence.step_nats() > DECISION_NATS {
            self.absorb_step_in_air(sample, &evidence);
        } else if evidence.contact_nats() > DECISION_NATS {
            // A moving baseline may already follow the load, so that the force does not leave it.
            let seen = side > 0 || self.baseline.moving || evidence.contact_nats() > SETTLED_NATS;
            return seen.then_some(evidence);
        } else if evidence.no_event.nats > evidence.bend.nats.max(evidence.step.nats) {
            let moves = evidence.no_event.form != Form::Constant
                && evidence.no_event.nats - evidence.constant_nats > DECISION_NATS;
            if moves || self.baseline.moving {
                self.follow_baseline(sample, &evidence);
            }
        }
        None
    }

    /// Fits the baseline to all samples in air.
    #[cold]
    fn follow_baseline(&mut self, sample: &Sample, evidence: &AirEvidence) {
        let fit = self.baseline.history.fit_all_blocks(evidence, sample);
        self.baseline.follow(&fit, evidence.no_event.form != Form::Constant, sample);
        self.restart_noise(sample, &fit, evidence.excess);
        (self.samples_above_threshold, self.samples_below_threshold) = (0, 0);
    }

    /// Re-initialises noise and offset of the force after subtraction of the baseline.
    fn restart_noise(&mut self, sample: &Sample, fit: &BaselineFit, excess: f64) {
        let history = &self.baseline.history;
        let (variance, rho) = (history.noise_variance(), history.rho());
        let level_n = fit.x[0] - self.baseline.subtracted_n(sample.time_s, sample.position_m);
        let long_run = variance * excess * (1.0 + rho) / (1.0 - rho);
        let count = at_least(1.0, at_most(fit.samples, long_run / at_least(1e-300, fit.p[0][0])));
        self.noise.restart_in_air(level_n, variance, rho, count, sample.force_n);
    }

    #[cold]
    fn absorb_step_in_air(&mut self, sample: &Sample, evidence: &AirEvidence) {
        let step = evidence.step;
        let baseline = &mut self.baseline;
        let (time_s, position_m) = baseline.history.onset(step.from);
        let fit = baseline.history.fit_behind_step(evidence, sample);
        baseline.history.absorb_step(step.from, step.size);
        baseline.zero_steps += 1;
        self.output.zero_step = Some(ZeroStep {
            time_s,
            position_m,
            size_n: step.size,
            sd_n: libm::sqrt(evidence.event_variance(&step)),
            in_tissue: false,
            withdrawn: None,
        });
        self.low_passed_n = sample.force_n;
        self.baseline.follow(&fit, step.form != Form::Constant, sample);
        self.restart_noise(sample, &fit, evidence.excess);
        (self.samples_above_threshold, self.samples_below_threshold) = (0, 0);
    }

    /// Starts the contact at the bend of `evidence`, with the baseline fitted to the samples before it.
    #[cold]
    pub(super) fn start_contact_at_bend(
        &mut self,
        config: &EnhanceConfig,
        step: &MotionStep,
        sample: &Sample,
        evidence: &AirEvidence,
        (mut rise, mut sd): (f64, f64),
    ) {
        let bend = evidence.bend;
        let moving = bend.form != Form::Constant;
        let fit = self.baseline.history.fit_before_bend(evidence, sample);
        if moving || self.baseline.moving {
            self.baseline.follow(&fit, moving, sample);
            self.restart_noise(sample, &fit, evidence.excess);
            rise = at_least(0.0, self.low_passed_n - self.noise.bias_n());
            sd = libm::sqrt(sd * sd + fit.p[0][0]);
        }
        self.start_contact(config, step, sample, sample.position_m, rise, rise + 3.0 * sd);
        let unknown = if moving {
            Some(fit)
        } else {
            self.baseline.history.constant_mixture_fit(fit, evidence, sample)
        };
        if let Some(fit) = unknown {
            self.set_estimator_baseline(&fit);
        }
        self.set_onset(evidence);
        self.output.contact_probability = evidence.contact_probability();
        self.baseline.schedule();
    }

    /// Takes the position of the contact from the evidence.
    fn set_onset(&mut self, evidence: &AirEvidence) {
        let (onset_m, sd_m) = evidence.onset_m;
        (self.output.contact_m, self.output.contact_sd_m) = (Some(onset_m), sd_m);
        self.estimator.set_onset((onset_m, sd_m));
        self.snapshot.set_onset((onset_m, sd_m));
    }

    /// Makes drift and line of a fit unknowns of the layer estimator.
    pub(super) fn set_estimator_baseline(&mut self, fit: &BaselineFit) {
        self.estimator.set_baseline(fit, &self.noise);
        self.snapshot = self.estimator;
        self.free_tip.restart_from(&self.estimator);
    }

    /// Re-evaluates a contact that is not final, with the sample added to the history in air. Cancels the contact if a moving
    /// baseline or a step of the zero is more probable.
    #[cold]
    pub(super) fn verify_evidence(&mut self, config: &EnhanceConfig, sample: &Sample) {
        if config.contact != Contact::Detected || self.estimator.passed_count > 0 {
            self.baseline.settled = true;
            return;
        }
        self.baseline.history.push_uncertain(&Sample { force_n: self.baseline.measured_n, ..*sample });
        if self.baseline.history.samples < self.baseline.next_evaluation {
            return;
        }
        self.baseline.schedule();
        self.operations += self.baseline.history.evaluation_operations();
        let evidence = self.baseline.history.evaluate();
        self.output.contact_probability = evidence.contact_probability();
        if evidence.contact_nats() > SETTLED_NATS {
            self.baseline.settled = true;
            if evidence.onset_m.1 < self.output.contact_sd_m {
                self.set_onset(&evidence);
            }
        } else if evidence.contact_nats() < -DECISION_NATS {
            self.in_tissue = false;
            self.output.contact_m = None;
            (self.output.contact_sd_m, self.output.contact_probability) = (0.0, 0.0);
            (self.misfit, self.misfit_weight, self.base_law_failed) = (FAILED_MISFIT, 1.0, false);
            self.peak_force_n = 0.0;
            (self.candidate, self.deferred, self.spike_samples) = (None, false, 0);
            if evidence.step_nats() > 0.0 {
                self.absorb_step_in_air(sample, &evidence);
            } else {
                self.follow_baseline(sample, &evidence);
            }
            self.low_passed_n = self.noise.bias_n();
        }
    }

    /// True if the contact is final, or would be if it were evaluated now.
    #[cold]
    pub(super) fn is_contact_final(&mut self) -> bool {
        if !self.baseline.settled {
            self.operations += self.baseline.history.evaluation_operations();
            self.baseline.settled = self.baseline.history.evaluate().contact_nats() > SETTLED_NATS;
        }
        self.baseline.settled
    }

    /// The baseline at a sample, for the output.
    pub(super) fn baseline_now(&self, sample: &Sample) -> Baseline {
        let baseline = &self.baseline;
        let subtracted_n = baseline.subtracted_n(sample.time_s, sample.position_m);
        let mut out = Baseline {
            kind: if baseline.moving { baseline.fit.kind } else { Default::default() },
            offset_n: self.noise.bias_n() + subtracted_n,
            drift_n_per_s: baseline.rate[0],
            line_n_per_m: baseline.rate[1],
            sd: [libm::sqrt(self.noise.bias_variance()), 0.0, 0.0],
            zero_steps: baseline.zero_steps,
        };
        if self.in_tissue {
            let (mean, sd) = self.estimator.baseline_residual(&self.noise);
            if !self.base_law_failed {
                out.drift_n_per_s += mean[0];
                out.line_n_per_m += mean[1];
            }
            (out.sd[1], out.sd[2]) = (sd[0], sd[1]);
        } else if baseline.moving {
            let p = &baseline.fit.p;
            (out.sd[1], out.sd[2]) = (libm::sqrt(at_least(0.0, p[1][1])), libm::sqrt(at_least(0.0, p[2][2])));
        }
        out
    }
}
