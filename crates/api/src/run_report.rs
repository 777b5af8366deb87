//! Conversion of results to the plain structures that the run report draws.

use stylet_core::config::{Algorithm, EnhanceConfig, Model};
use stylet_record::{Recording, Truth};
use stylet_report::insertion_report as report;
use stylet_scenario::Scenario;
use stylet_score::{LayerTruth, Score, Trace};

/// A run of the online algorithm with one model on one sensor.
pub struct AlgorithmRun {
    /// Name such as `paper/ml/force_torque`.
    pub name: String,
    /// Sensor.
    pub sensor: &'static str,
    /// Configuration.
    pub config: EnhanceConfig,
    /// Outputs.
    pub trace: Trace,
    /// Score, when the truth is known.
    pub score: Option<Score>,
}

/// The report of a run, without the truth.
pub fn run_report(
    recording: &Recording,
    forces: Vec<report::ForceTrace>,
    ran: &[AlgorithmRun],
) -> report::RunReport {
    report::RunReport {
        time_s: recording.time_s.clone(),
        position_m: recording.position_m.clone(),
        velocity_mps: recording.velocity_mps.clone(),
        forces,
        combinations: ran.iter().map(|r| combination(recording, r)).collect(),
        ..report::RunReport::default()
    }
}

/// The truth of a simulation.
pub fn report_truth(truth: &Truth, scenario: &Scenario, layers: &[LayerTruth]) -> report::Truth {
    let entered = |index: usize| match index.checked_sub(1) {
        None => truth.surface_contact_s,
        Some(before) => truth.ruptures.get(before).map(|r| r.time_s),
    };
    report::Truth {
        tip_force_n: truth.tip_force_n.clone(),
        cumulative_friction_ns_per_m: truth.cumulative_friction_ns_per_m.clone(),
        layers: layers
            .iter()
            .enumerate()
            .map(|(i, l)| report::TrueLayer {
                name: layer_name(scenario, i),
                front_m: l.front_m,
                thickness_m: l.thickness_m,
                stiffness_n_per_m: l.stiffness_n_per_m,
                friction_ns_per_m2: l.friction_ns_per_m2,
                entered_s: entered(i),
                ruptured_s: truth.ruptures.get(i).map(|r| r.time_s),
            })
            .collect(),
        ruptures: truth
            .ruptures
            .iter()
            .map(|r| report::TrueRupture {
                layer: r.layer,
                time_s: r.time_s,
                depth_m: r.position_m,
                cause: if r.by_force { "puncture force" } else { "far face" }.to_owned(),
            })
            .collect(),
    }
}

/// Name of a layer, or its number when it has none.
pub fn layer_name(scenario: &Scenario, index: usize) -> String {
    match scenario.tissue.layers.get(index) {
        Some(layer) if !layer.name.is_empty() => layer.name.clone(),
        _ => format!("layer {}", index + 1),
    }
}

fn combination(recording: &Recording, ran: &AlgorithmRun) -> report::Combination {
    let (trace, config) = (&ran.trace, &ran.config);
    let multi_layer = config.model == Model::MultiLayer;
    let ours = config.active_algorithm() == Algorithm::Stylet;
    let of = |wanted: bool, column: &[f64]| if wanted { column.to_vec() } else { Vec::new() };
    report::Combination {
        name: ran.name.clone(),
        sensor: ran.sensor.to_owned(),
        contact_s: trace.contact_s,
        contact: trace.contact.sentence(),
        reconstructed_force_n: trace.reconstructed_n.clone(),
        enhanced_force_n: trace.enhanced_n.clone(),
        tip_force_low_n: trace.low_n.clone(),
        tip_force_high_n: trace.high_n.clone(),
        stiffness_n_per_m: trace.stiffness_n_per_m.clone(),
        friction_ns_per_m2: of(multi_layer, &trace.friction),
        friction_ns_per_m: of(!multi_layer, &trace.friction),
        cumulative_friction_ns_per_m: trace.cumulative_friction_ns_per_m.clone(),
        cusum_n2: trace.cusum_n2.clone(),
        // The algorithm `Stylet` reports its largest CUSUM statistic relative to the threshold, and uses no derivative.
        cusum_threshold_n2: Some(if ours { 1.0 } else { config.cusum.threshold_n2() }),
        cusum_is_normalised: ours,
        cusum_drift_n2: (!ours).then(|| config.cusum.drift_n2()),
        force_derivative_n_per_s: of(!ours, &trace.derivative_n_per_s),
        derivative_on_n_per_s: (!ours).then_some(config.derivative.on_n_per_s),
        derivative_off_n_per_s: (!ours).then_some(config.derivative.off_n_per_s),
        states: spans(recording, trace),
        detections: trace
            .detections
            .iter()
            .enumerate()
            .map(|(i, d)| report::Detection {
                time_s: d.time_s,
                depth_m: d.position_m,
                trigger: d.cause.name().to_owned(),
                matched_layer: ran.score.as_ref().and_then(|score| {
                    score.ruptures.iter().find(|r| r.detection == Some(i + 1)).map(|r| r.layer)
                }),
            })
            .collect(),
        compensations_s: trace.estimates.iter().map(|e| e.time_s).collect(),
        layers: layers(ran, multi_layer),
        reconstruction_rms_n: ran.score.as_ref().and_then(|s| s.reconstruction_rms_n),
        score: ran.score.as_ref().map(|s| score(s, trace)),
    }
}

fn spans(recording: &Recording, trace: &Trace) -> Vec<report::StateSpan> {
    let mut spans: Vec<report::StateSpan> = Vec::new();
    for (time_s, state) in recording.time_s.iter().zip(&trace.state) {
        match spans.last_mut() {
            Some(last) if last.state == state.name() => last.to_s = *time_s,
            last => {
                if let Some(last) = last {
                    last.to_s = *time_s;
                }
                spans.push(report::StateSpan {
                    state: state.name().to_owned(),
                    from_s: *time_s,
                    to_s: *time_s,
                });
            }
        }
    }
    spans
}

fn signed(truth: f64, estimate: Option<f64>) -> Option<f64> {
    estimate.filter(|_| truth != 0.0).map(|e| (e - truth) / truth)
}

fn layers(ran: &AlgorithmRun, multi_layer: bool) -> Vec<report::LayerEstimate> {
    let estimate = |e: &stylet_core::LayerEstimate, layer: usize| report::LayerEstimate {
        layer,
        time_s: e.time_s,
        stiffness_n_per_m: Some(e.stiffness_n_per_m),
        friction_ns_per_m2: multi_layer.then_some(e.friction),
        friction_ns_per_m: (!multi_layer).then_some(e.friction),
        thickness_m: Some(e.thickness_m),
        stiffness_half_width: (e.stiffness_sd > 0.0).then_some(stylet_stats::Z95 * e.stiffness_sd),
        friction_half_width: (e.friction_sd > 0.0).then_some(stylet_stats::Z95 * e.friction_sd),
        ..report::LayerEstimate::default()
    };
    let Some(score) = &ran.score else {
        return ran.trace.estimates.iter().map(|e| estimate(e, e.layer)).collect();
    };
    score
        .layers
        .iter()
        .zip(&score.ruptures)
        .map(|(l, r)| {
            let found = r.detection.and_then(|d| ran.trace.estimates.iter().find(|e| e.layer == d));
            report::LayerEstimate {
                layer: l.layer,
                stiffness_error: signed(l.stiffness_n_per_m.truth, l.stiffness_n_per_m.estimated),
                friction_error: signed(l.friction_ns_per_m2.truth, l.friction_ns_per_m2.estimated),
                thickness_error: signed(l.thickness_m.truth, l.thickness_m.estimated),
                offline_stiffness_n_per_m: l.offline_stiffness_n_per_m,
                offline_friction_ns_per_m2: l.offline_friction_ns_per_m2,
                offline_separable: l.offline_separable,
                ..found.map(|e| estimate(e, l.layer)).unwrap_or_default()
            }
        })
        .collect()
}

fn score(s: &Score, trace: &Trace) -> report::Score {
    let d = s.cumulative_friction_ns_per_m;
    let delays_m: Vec<f64> = s.ruptures.iter().filter_map(|r| r.delay_mm).map(|mm| mm * 1e-3).collect();
    report::Score {
        ruptures: s
            .ruptures
            .iter()
            .map(|r| report::RuptureScore {
                layer: r.layer,
                delay_s: r.delay_s,
                delay_m: r.delay_mm.map(|mm| mm * 1e-3),
                detected_s: r.detected_s,
                trigger: r
                    .detection
                    .and_then(|d| trace.detections.get(d - 1))
                    .map_or(String::new(), |d| d.cause.name().to_owned()),
            })
            .collect(),
        missed: s.missed,
        false_detections: s.false_alarms,
        median_delay_s: s.median_delay_s(),
        median_delay_m: (!delays_m.is_empty()).then(|| stylet_stats::median_of(delays_m)),
        true_cumulative_friction_ns_per_m: Some(d.truth),
        cumulative_friction_ns_per_m: d.estimated,
        cumulative_friction_error: signed(d.truth, d.estimated),
        enhancement_rms_relative: s.enhancement.rms_relative,
        after_exit_relative: s.enhancement.after_exit_relative,
    }
}
