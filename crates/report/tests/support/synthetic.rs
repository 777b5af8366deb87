//! A synthetic run: three gel layers, 50 s at 200 Hz, sawtooth elastic force, growing friction, noise. Detections are prescribed.

use stylet_report::insertion_report::{
    Combination, Detection, ForceTrace, LayerEstimate, Provenance, RunReport, RuptureScore, StateSpan,
    TrueLayer, TrueRupture, Truth,
};

const SPEED_MPS: f64 = 0.0023;
const RATE_HZ: f64 = 200.0;
const NAMES: [&str; 3] = ["isinglass 25 %", "isinglass 50 % in latex", "isinglass 70 %"];
const STIFFNESS: [f64; 3] = [40.0, 60.0, 80.0];
const FRICTION: [f64; 3] = [9e3, 12e3, 16e3];
const THICKNESS: [f64; 3] = [0.0282, 0.0377, 0.0322];

/// Approximately normal noise: four uniform numbers from a linear congruential generator.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        (uniform() + uniform() + uniform() + uniform()) * 3f64.sqrt()
    }
}

struct Layer {
    front: f64,
    entered: f64,
    ruptured: f64,
}

fn layers() -> Vec<Layer> {
    let mut front = 0.0;
    let mut out = Vec::new();
    for thickness in THICKNESS {
        let time = |depth: f64| (depth + 0.005) / SPEED_MPS;
        // The latex punctures before the far face.
        let end = if out.len() == 1 { front + 0.0366 } else { front + thickness };
        let entered = out.last().map_or(time(0.0), |l: &Layer| l.ruptured);
        out.push(Layer { front, entered, ruptured: time(end) });
        front += thickness;
    }
    out
}

/// The run with the requested number of combinations (`paper/ml/force_torque`, `paper/kv/force_torque`, ...).
pub fn synthetic_run(combinations: usize) -> RunReport {
    let count = (50.0 * RATE_HZ) as usize + 1;
    let time_s: Vec<f64> = (0..count).map(|i| i as f64 / RATE_HZ).collect();
    let mut noise = Noise(7);
    let layers = layers();
    let position_m: Vec<f64> = time_s.iter().map(|t| -0.005 + SPEED_MPS * t).collect();
    let velocity_mps: Vec<f64> = time_s.iter().map(|_| SPEED_MPS + 2e-6 * noise.next()).collect();
    let (mut tip, mut cumulative, mut force) = (Vec::new(), Vec::new(), Vec::new());
    for (t, z) in time_s.iter().zip(&position_m) {
        let (mut f_tip, mut d) = (0.0, 0.0);
        for (i, layer) in layers.iter().enumerate() {
            let inside = (z - layer.front).clamp(0.0, THICKNESS[i]);
            if *t >= layer.ruptured {
                d += FRICTION[i] * inside;
            } else if *t >= layer.entered {
                f_tip += STIFFNESS[i] * (z - layer.front).max(0.0) + FRICTION[i] * SPEED_MPS * inside;
            }
        }
        tip.push(f_tip);
        cumulative.push(d);
        force.push(f_tip + d * SPEED_MPS + 0.02 * noise.next());
    }
    let truth = Truth {
        tip_force_n: tip,
        cumulative_friction_ns_per_m: cumulative,
        layers: layers.iter().enumerate().map(|(i, l)| true_layer(i, l)).collect(),
        ruptures: layers.iter().enumerate().map(|(i, l)| true_rupture(i, l)).collect(),
    };
    let names = ["paper/ml/force_torque", "paper/kv/force_torque", "paper/ml/virtual", "paper/kv/virtual"];
    let combinations = names
        .iter()
        .take(combinations)
        .enumerate()
        .map(|(which, name)| combination(name, which, &time_s, &position_m, &force, &truth, &mut noise))
        .collect();
    RunReport {
        title: "Three gel layers, latex around the second, constant velocity".into(),
        source: "Made-up data in the manner of the main paper's Fig. 12".into(),
        provenance: Provenance {
            scenario_file: "three_layer_latex_constant.ron".into(),
            scenario_text: "Scenario(\n    name: \"three gel layers\",\n    motion: Constant(start_m: -0.005, velocity_mps: \
                            0.0023, duration_s: 50.0),\n    seed: 1,\n)\n"
                .into(),
            command: "stylet run scenarios/three_layer_latex_constant.ron --seed 1".into(),
            seed: Some(1),
            version: "0.1.0".into(),
            hash: "9f86d081884c7d65".into(),
        },
        notes: Vec::new(),
        remarks: Vec::new(),
        time_s,
        position_m,
        velocity_mps,
        forces: vec![ForceTrace { sensor: "force_torque".into(), force_n: force }],
        truth: Some(truth),
        combinations,
    }
}

/// The same without anything only a simulation knows: what `stylet enhance` has on measured data.
pub fn measured_run() -> RunReport {
    let mut report = synthetic_run(1);
    report.truth = None;
    report.title = "Needle phantom, 2 mm/s, run 1".into();
    report.notes = vec!["3 gaps longer than five samples; the longest lasts 0.12 s at 11.3 s.".into()];
    for combination in &mut report.combinations {
        combination.score = None;
        for detection in &mut combination.detections {
            detection.matched_layer = None;
        }
    }
    report
}

fn true_layer(i: usize, layer: &Layer) -> TrueLayer {
    TrueLayer {
        name: NAMES[i].into(),
        front_m: layer.front,
        thickness_m: THICKNESS[i],
        stiffness_n_per_m: STIFFNESS[i],
        friction_ns_per_m2: FRICTION[i],
        entered_s: Some(layer.entered),
        ruptured_s: Some(layer.ruptured),
    }
}

fn true_rupture(i: usize, layer: &Layer) -> TrueRupture {
    TrueRupture {
        layer: i + 1,
        time_s: layer.ruptured,
        depth_m: layer.ruptured * SPEED_MPS - 0.005,
        cause: if i == 1 { "puncture force" } else { "far face" }.into(),
    }
}

/// Recursive least squares over the true layers, with detections a sample or two late.
fn combination(
    name: &str,
    which: usize,
    time_s: &[f64],
    position_m: &[f64],
    force_n: &[f64],
    truth: &Truth,
    noise: &mut Noise,
) -> Combination {
    let kv = name.contains("kv");
    let late = if name.contains("virtual") { 0.045 } else { 0.005 };
    let found: Vec<f64> =
        truth.ruptures.iter().map(|r| ((r.time_s + late) * RATE_HZ).ceil() / RATE_HZ).collect();
    let mut out = Combination {
        name: name.into(),
        sensor: name.rsplit('/').next().unwrap_or("").into(),
        ..Default::default()
    };
    out.contact_s = truth.layers.first().and_then(|l| l.entered_s);
    let (mut th, mut p, mut start, mut layer, mut d) = ([0.0; 2], [1e6, 0.0, 1e6], 0.0, 0, 0.0);
    let (mut g, mut low_pass, mut derivative) = (0.0_f64, 0.0, 0.0);
    for (i, t) in time_s.iter().enumerate() {
        if layer < found.len() && *t >= found[layer] {
            layer += 1;
            (th, p, start) = ([0.0; 2], [1e6, 0.0, 1e6], position_m[i]);
        }
        if layer > 0 && (*t - found[layer - 1] - 3.26).abs() < 0.5 / RATE_HZ {
            d = truth.layers[..layer].iter().map(|l| l.friction_ns_per_m2 * l.thickness_m).sum::<f64>()
                * 0.98;
            out.compensations_s.push(*t);
        }
        let v = SPEED_MPS;
        let dz = position_m[i] - start;
        let contact = out.contact_s.is_some_and(|c| *t >= c);
        let mut e = 0.0;
        let phi = if kv { [dz, v] } else { [dz, dz * v] };
        if contact {
            let y = force_n[i] - d * v;
            e = y - phi[0] * th[0] - phi[1] * th[1];
            let q = [p[0] * phi[0] + p[1] * phi[1], p[1] * phi[0] + p[2] * phi[1]];
            let den = 1.0 + phi[0] * q[0] + phi[1] * q[1];
            th = [th[0] + q[0] * e / den, th[1] + q[1] * e / den];
            p = [p[0] - q[0] * q[0] / den, p[1] - q[0] * q[1] / den, p[2] - q[1] * q[1] / den];
            if i % 5 == 0 {
                p = [1e6, 0.0, if kv { 1e6 } else { 1.1e10 }];
            }
        }
        let blind = layer > 0 && *t - found[layer - 1] < 3.26;
        g = if blind { 0.0 } else { (g + e * e - 0.0113).max(0.0) };
        let before = low_pass;
        low_pass += 0.01 * (force_n[i] - low_pass);
        derivative += 0.1 * ((low_pass - before) * RATE_HZ - derivative);
        out.cusum_n2.push(if found.iter().any(|f| (*t - f).abs() < 1e-9) { 1.9 } else { g });
        out.force_derivative_n_per_s.push(derivative);
        out.stiffness_n_per_m.push(if contact { th[0] } else { f64::NAN });
        let friction = if contact { th[1] } else { f64::NAN };
        if kv {
            out.friction_ns_per_m.push(friction)
        } else {
            out.friction_ns_per_m2.push(friction)
        }
        out.cumulative_friction_ns_per_m.push(d);
        out.reconstructed_force_n.push(phi[0] * th[0] + phi[1] * th[1] + d * v);
        out.enhanced_force_n.push(force_n[i] - d * v);
    }
    out.cusum_threshold_n2 = Some(0.0112);
    out.derivative_on_n_per_s = Some(0.075);
    out.derivative_off_n_per_s = Some(-0.03);
    out.reconstruction_rms_n = Some(0.0214);
    out.states = states(&found, time_s.last().copied().unwrap_or(0.0));
    for (i, (t, rupture)) in found.iter().zip(&truth.ruptures).enumerate() {
        let layer = &truth.layers[i];
        out.detections.push(Detection {
            time_s: *t,
            depth_m: *t * SPEED_MPS - 0.005,
            trigger: if i == 2 { "force derivative" } else { "CUSUM" }.into(),
            matched_layer: Some(i + 1),
        });
        let off = |size: f64, noise: &mut Noise| size * (1.0 + which as f64) * noise.next();
        let (k, b, w) = (off(0.025, noise), off(0.05, noise), off(0.002, noise));
        let friction = layer.friction_ns_per_m2 * (1.0 + b);
        out.layers.push(LayerEstimate {
            layer: i + 1,
            time_s: t + 2.17,
            stiffness_n_per_m: Some(layer.stiffness_n_per_m * (1.0 + k)),
            stiffness_error: Some(k),
            friction_ns_per_m2: (!kv).then_some(friction),
            friction_ns_per_m: kv.then_some(friction * layer.thickness_m),
            friction_error: Some(b),
            thickness_m: Some(layer.thickness_m * (1.0 + w)),
            thickness_error: Some(w),
            offline_stiffness_n_per_m: Some(layer.stiffness_n_per_m * (1.0 + 0.4 * k)),
            offline_friction_ns_per_m2: (!kv).then_some(layer.friction_ns_per_m2 * (1.0 - 0.3 * b)),
            offline_friction_ns_per_m: None,
            ..Default::default()
        });
        out.score.get_or_insert_default().ruptures.push(RuptureScore {
            layer: i + 1,
            delay_s: Some(t - rupture.time_s),
            delay_m: Some((t - rupture.time_s) * SPEED_MPS),
            detected_s: Some(*t),
            trigger: if i == 2 { "force derivative" } else { "CUSUM" }.into(),
        });
    }
    if let Some(score) = &mut out.score {
        score.median_delay_s = Some(found[1] - truth.ruptures[1].time_s);
        score.median_delay_m = score.median_delay_s.map(|s| s * SPEED_MPS);
        score.true_cumulative_friction_ns_per_m = truth.cumulative_friction_ns_per_m.last().copied();
        score.cumulative_friction_ns_per_m = Some(d);
        score.cumulative_friction_error = Some(-0.02 * (1.0 + 3.0 * which as f64));
        score.enhancement_rms_relative = Some(0.155 * (1.0 + which as f64));
        score.after_exit_relative = Some(0.034);
    }
    out
}

fn states(found: &[f64], end_s: f64) -> Vec<StateSpan> {
    let mut out = Vec::new();
    let mut at = 0.0;
    let mut push = |state: &str, to: f64| {
        out.push(StateSpan { state: state.into(), from_s: at, to_s: to });
        at = to;
    };
    for t in found {
        push("NoRupture", t - 4.0);
        push("ExpectedRupture", *t);
        push("DetectedRupture", t + 1.0 / RATE_HZ);
        push("ForceDropMeasuring", t + 2.17);
        push("ForceCompensation", t + 3.26);
    }
    push("NoRupture", end_s);
    out
}
