//! Outputs of the online core over a recording, as columns.

use crate::contact_finding::{ContactAssessor, ContactFinding};
use crate::enhancer_with_model::{EnhancerWithModel, RecordingScale, enhancer_in_units};
use crate::offline_least_squares::{LayerSample, OfflineEstimate, fit_layer_offline};
use crate::score::Score;
use crate::scorer::{Scorer, TrueSample};
use stylet_core::config::{Algorithm, EnhanceConfig, Model};
use stylet_core::{Baseline, Detection, LayerEstimate, Sample, State, Units, UnusedReason, ZeroStep};
use stylet_record::LayerTruth;
use stylet_record::{Recording, Truth};

/// Outputs of the core over a recording, one value per sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Enhanced force in N.
    pub enhanced_n: Vec<f64>,
    /// Lower end of the 95 % band on the tip force in N; NaN where the algorithm provides none.
    pub low_n: Vec<f64>,
    /// Upper end of that band.
    pub high_n: Vec<f64>,
    /// Reconstructed force in N.
    pub reconstructed_n: Vec<f64>,
    /// Innovation in N.
    pub error_n: Vec<f64>,
    /// Stiffness estimate in N/m; NaN before contact.
    pub stiffness_n_per_m: Vec<f64>,
    /// Friction estimate in the model's unit; NaN before contact.
    pub friction: Vec<f64>,
    /// Cumulative friction in N s/m.
    pub cumulative_friction_ns_per_m: Vec<f64>,
    /// CUSUM in N².
    pub cusum_n2: Vec<f64>,
    /// Force derivative in N/s.
    pub derivative_n_per_s: Vec<f64>,
    /// State.
    pub state: Vec<State>,
    /// Why the core ignored the sample, whose values are then NaN; `None` for the others.
    pub unused_reason: Vec<Option<UnusedReason>>,
    /// Declared ruptures.
    pub detections: Vec<Detection>,
    /// Estimates of the traversed layers.
    pub estimates: Vec<LayerEstimate>,
    /// Position of the first contact in m.
    pub contact_m: Option<f64>,
    /// Time at which the needle was first at that position, in s.
    pub contact_s: Option<f64>,
    /// Standard deviation of the position of the contact in m; zero where the algorithm does not provide it.
    pub contact_sd_m: f64,
    /// How the recording begins.
    pub contact: ContactFinding,
    /// Steps of the sensor's zero.
    pub zero_steps: Vec<ZeroStep>,
    /// Baseline of the force at the last sample.
    pub baseline: Baseline,
    /// Samples that the core ignored.
    pub unused: usize,
    /// Time in s from which the core's own friction replaced that of a model
    /// ([`EnhancerWithModel`](crate::EnhancerWithModel::model_rejected_s)).
    pub model_rejected_s: Option<f64>,
    /// Number of times that the core was re-initialised because of a new clock.
    pub restarts: usize,
    /// Index of the first estimate since the last restart, after which layers are counted from 1 again.
    pub first_estimate: usize,
    /// Index of the first rupture since the last restart.
    pub first_detection: usize,
    /// Index of the first value of the columns since the last restart.
    pub first_sample: usize,
    /// Number of samples whose events were recorded: all, also where the columns hold a selection.
    pub recorded: usize,
    /// As `recorded`, before the last restart.
    pub recorded_before_restart: usize,
}

impl Trace {
    /// Runs the core over a recording with the force of one sensor. `each` receives every sample index and output.
    #[must_use]
    pub fn run(
        recording: &Recording,
        force_n: &[f64],
        config: &EnhanceConfig,
        surface_m: f64,
        each: impl FnMut(usize, &stylet_core::Output),
    ) -> Self {
        let model = None::<fn(&Sample, usize) -> f64>;
        Self::collect(recording, force_n, (config, surface_m), ContactAssessor::default(), model, each)
    }

    /// As [`Trace::run`] with the shaft friction of an identified model, see [`EnhancerWithModel`].
    #[must_use]
    pub fn run_with_model(
        recording: &Recording,
        force_n: &[f64],
        config: &EnhanceConfig,
        surface_m: f64,
        model: impl FnMut(&Sample, usize) -> f64,
    ) -> Self {
        let assessor = ContactAssessor::default();
        Self::collect(recording, force_n, (config, surface_m), assessor, Some(model), |_, _| {})
    }

    /// As [`Trace::run`] for a measured recording, optionally with the shaft friction of an identified model: a second core shows
    /// whether the recording begins in the tissue ([`Trace::contact`]).
    #[must_use]
    pub fn run_measured(
        recording: &Recording,
        force_n: &[f64],
        config: &EnhanceConfig,
        surface_m: f64,
        model: Option<impl FnMut(&Sample, usize) -> f64>,
    ) -> Self {
        let assessor = ContactAssessor::new(config, surface_m, units_of(recording, force_n));
        Self::collect(recording, force_n, (config, surface_m), assessor, model, |_, _| {})
    }

    fn collect<M: FnMut(&Sample, usize) -> f64>(
        recording: &Recording,
        force_n: &[f64],
        (config, surface_m): (&EnhanceConfig, f64),
        mut assessor: ContactAssessor,
        model: Option<M>,
        mut each: impl FnMut(usize, &stylet_core::Output),
    ) -> Self {
        let mut trace = Trace::default();
        let units = units_of(recording, force_n);
        let mut core =
            EnhancerWithModel::new(enhancer_in_units(recording.len(), config, surface_m, units), model);
        for (index, (s, &force_n)) in recording.samples().zip(force_n).enumerate() {
            let sample =
                Sample { time_s: s.time_s, position_m: s.position_m, velocity_mps: s.velocity_mps, force_n };
            let out = core.step(sample);
            assessor.push(&sample, &out);
            each(index, &out);
            trace.push(&out);
            trace.record_events(&out);
        }
        trace.contact = assessor.finish(config.contact);
        trace.model_rejected_s = core.model_rejected_s();
        let mut since_restart = recording.samples().skip(trace.recorded_before_restart);
        trace.contact_s =
            trace.contact_m.and_then(|z| since_restart.find(|s| s.position_m >= z)).map(|s| s.time_s);
        trace
    }

    /// Appends the output of a sample to the columns.
    pub fn push(&mut self, out: &stylet_core::Output) {
        let [low, high] = out.band_n.unwrap_or([f64::NAN; 2]);
        let [stiffness, friction] = coefficients(out);
        if out.restarted {
            self.first_sample = self.enhanced_n.len();
        }
        self.enhanced_n.push(out.enhanced_n);
        self.low_n.push(low);
        self.high_n.push(high);
        self.reconstructed_n.push(out.reconstructed_n);
        self.error_n.push(out.error_n);
        self.stiffness_n_per_m.push(stiffness);
        self.friction.push(friction);
        self.cumulative_friction_ns_per_m.push(out.cumulative_friction_ns_per_m);
        self.cusum_n2.push(out.cusum_n2);
        self.derivative_n_per_s.push(out.derivative_n_per_s);
        self.state.push(out.state);
        self.unused_reason.push(out.unused_reason);
    }

    /// The ruptures since the last restart, from which layers are counted.
    #[must_use]
    pub fn detections_since_restart(&self) -> &[Detection] {
        self.detections.get(self.first_detection..).unwrap_or_default()
    }

    /// The estimates since the last restart.
    #[must_use]
    pub fn estimates_since_restart(&self) -> &[LayerEstimate] {
        self.estimates.get(self.first_estimate..).unwrap_or_default()
    }

    /// Records the ruptures, estimates and contact of a sample.
    pub fn record_events(&mut self, out: &stylet_core::Output) {
        if out.restarted {
            self.restarts += 1;
            self.first_estimate = self.estimates.len();
            self.first_detection = self.detections.len();
            self.recorded_before_restart = self.recorded;
        }
        self.recorded += 1;
        if let Some(whole) = out.completed_drop
            && let Some(d) =
                self.detections.iter_mut().skip(self.first_detection).rfind(|d| d.layer == whole.layer)
        {
            (d.drop_n, d.drop_sd_n) = (whole.drop_n, whole.drop_sd_n);
        }
        if let Some(step) = out.zero_step {
            // A step of the zero that was first declared as a rupture.
            if let Some(layer) = step.withdrawn {
                // Layers are counted from 1 again after a restart.
                remove_from(&mut self.detections, self.first_detection, |d| d.layer == layer);
                remove_from(&mut self.estimates, self.first_estimate, |e| e.layer == layer);
            }
            self.zero_steps.push(step);
        }
        self.detections.extend(out.detection);
        if let Some(estimate) = out.estimate {
            // A later estimate of a layer replaces the earlier one, which is among the last.
            let since_restart = self.estimates_since_restart();
            if let Some(earlier) = since_restart.iter().rposition(|e| e.layer == estimate.layer) {
                self.estimates.remove(self.first_estimate + earlier);
            }
            self.estimates.push(estimate);
        }
        (self.contact_m, self.contact_sd_m, self.baseline) = (out.contact_m, out.contact_sd_m, out.baseline);
        self.unused += usize::from(!out.used);
    }

    /// Offline estimate of the layer in the span `(start_m, end_m, until_s)`, given the cumulative friction of the previous layers.
    /// The elastic share of the online estimate determines the split where the data do not.
    fn offline(
        recording: &Recording,
        force_n: &[f64],
        span: (f64, f64, f64),
        cumulative_ns_per_m: f64,
        estimate: Option<&LayerEstimate>,
    ) -> Option<OfflineEstimate> {
        let (start_m, end_m, until_s) = span;
        let inside = || {
            recording.samples().zip(force_n).filter(move |(s, _)| {
                s.position_m > start_m && s.position_m < end_m && s.time_s < until_s && s.velocity_mps > 0.0
            })
        };
        let (count, speeds) = inside().fold((0.0, 0.0), |(n, sum), (s, _)| (n + 1.0, sum + s.velocity_mps));
        let speed_mps: f64 = speeds / count;
        let share = estimate.map_or(0.5, |e| e.elastic_share);
        let ratio = ((1.0 - share) / share).sqrt() / speed_mps;
        let found = fit_layer_offline(
            inside().map(|(s, f)| LayerSample {
                depth_m: s.position_m - start_m,
                velocity_mps: s.velocity_mps,
                force_n: f - cumulative_ns_per_m * s.velocity_mps,
            }),
            ratio,
        );
        // Without a measured drop an inseparable split is undetermined.
        found.filter(|f| f.separable || estimate.is_some())
    }
}

/// Internal units for the scale of the recording.
fn units_of(recording: &Recording, force_n: &[f64]) -> Units {
    let mut scale = RecordingScale::default();
    for (z, f) in recording.position_m.iter().zip(force_n) {
        scale.push(*z, *f);
    }
    scale.units()
}

/// Stiffness in N/m and friction in the model's unit; NaN before contact.
#[must_use]
pub fn coefficients(out: &stylet_core::Output) -> [f64; 2] {
    if out.theta == [0.0, 0.0] { [f64::NAN; 2] } else { out.theta }
}

/// Runs the core over a simulated recording and scores it against the truth.
#[must_use]
pub fn score_run(
    recording: &Recording,
    force_n: &[f64],
    truth: &Truth,
    layers: &[LayerTruth],
    config: &EnhanceConfig,
) -> (Trace, Score) {
    let mut scorer = Scorer::new(layers.to_vec(), config.model);
    for rupture in &truth.ruptures {
        scorer.add_rupture(*rupture);
    }
    let surface_m = layers.first().map_or(0.0, |l| l.front_m);
    let trace = Trace::run(recording, force_n, config, surface_m, |index, out| {
        scorer.add_event(out);
        scorer.set_contact(out.contact_m);
        if !out.used {
            return;
        }
        scorer.add_sample(
            &TrueSample {
                position_m: recording.position_m[index],
                force_n: force_n[index],
                tip_n: truth.tip_force_n[index],
                total_n: truth.tissue_force_n[index],
            },
            &out.into(),
        );
    });
    let mut score = scorer.finish();
    let mut cumulative = 0.0;
    for index in 0..score.layers.len() {
        let rupture = score.ruptures[index];
        let Some(layer) = layers.get(rupture.layer - 1) else { continue };
        let estimate = rupture.detection.and_then(|d| trace.estimates.iter().find(|e| e.layer == d));
        let span = (layer.front_m, rupture.true_m, rupture.true_s);
        if let Some(found) = Trace::offline(recording, force_n, span, cumulative, estimate) {
            cumulative += found.friction_ns_per_m2.max(0.0) * (rupture.true_m - layer.front_m);
            let slot = &mut score.layers[index];
            slot.offline_stiffness_n_per_m = Some(found.stiffness_n_per_m);
            slot.offline_friction_ns_per_m2 = Some(found.friction_ns_per_m2);
            slot.offline_separable = Some(found.separable);
        }
    }
    (trace, score)
}

/// Removes the elements from index `first` on for which `is_removed` holds.
fn remove_from<T>(all: &mut Vec<T>, first: usize, is_removed: impl Fn(&T) -> bool) {
    let mut index = 0;
    all.retain(|x| {
        index += 1;
        index <= first || !is_removed(x)
    });
}

/// Short name of an algorithm, as in `paper/ml/force_torque`.
#[must_use]
pub fn algorithm_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Paper => "paper",
        Algorithm::Literal => "literal",
        Algorithm::Stylet => "stylet",
    }
}

/// Short name of a model, as in `paper/ml/force_torque`.
#[must_use]
pub fn model_name(model: Model) -> &'static str {
    match model {
        Model::KelvinVoigt => "kv",
        Model::MultiLayer => "ml",
    }
}

#[cfg(test)]
mod tests {
    use super::Trace;
    use stylet_core::{Cause, CompletedDrop, Detection, Output, ZeroStep};

    #[test]
    fn a_step_of_the_zero_withdraws_no_rupture_from_before_a_restart() {
        let rupture = |time_s: f64| Detection {
            layer: 1,
            time_s,
            position_m: 0.0,
            located_s: time_s,
            located_m: 0.0,
            cause: Cause::Cusum,
            drop_n: 0.0,
            drop_sd_n: 0.0,
            confidence: 1.0,
        };
        let step = ZeroStep {
            time_s: 2.0,
            position_m: 0.0,
            size_n: 1.0,
            sd_n: 0.1,
            in_tissue: true,
            withdrawn: Some(1),
        };
        let mut trace = Trace::default();
        trace.record_events(&Output { detection: Some(rupture(1.0)), used: true, ..Output::default() });
        trace.record_events(&Output { restarted: true, used: true, ..Output::default() });
        trace.record_events(&Output { detection: Some(rupture(1.5)), used: true, ..Output::default() });
        let whole = CompletedDrop { layer: 1, drop_n: 2.0, drop_sd_n: 0.1 };
        trace.record_events(&Output { completed_drop: Some(whole), used: true, ..Output::default() });
        let drops: Vec<f64> = trace.detections.iter().map(|d| d.drop_n).collect();
        assert_eq!(drops, [0.0, 2.0], "the drop of the rupture since the restart");
        trace.record_events(&Output { zero_step: Some(step), used: true, ..Output::default() });
        assert_eq!(trace.detections, [rupture(1.0)]);
    }
}
