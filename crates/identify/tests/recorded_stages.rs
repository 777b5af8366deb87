//! Regression test of every stage of the identification.
//!
//! Seven small synthetic insertions go through velocity, motion, phases, blocks, drops, assignment, fit, noise,
//! effect trials and intervals. The results of each stage are compared with `recorded_stages.txt`: a name and
//! one or several numbers with ten digits. This covers branches of the model search that no closed form
//! describes. After an intended change record again (`STYLET_RECORD=1 cargo test -p stylet-identify --test
//! recorded_stages`) and explain the difference. Where the truth is known, estimates are also compared with it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::delay_refinement::{delay_s, refine_delay};
use stylet_identify::discrepancy_noise::discrepancy_noise;
use stylet_identify::fit::{
    Effort, Fit, JacobianColumn, Linearization, fit, fit_from_zero_scatter, fit_if_below,
};
use stylet_identify::force_drops::detect_force_drops;
use stylet_identify::insertion_phases;
use stylet_identify::likelihood::{FitData, ReplayCache, prior_nats, replay, residuals, rupture_nats};
use stylet_identify::model::{Assumptions, DayParameters, EffectTerm, Model, NO_RUPTURE, ParameterRole};
use stylet_identify::motion::smooth_positions;
use stylet_identify::motion::{Motion, MotionPiece};
use stylet_identify::motion::{VelocityJump, estimate_velocity};
use stylet_identify::noise::{Noise, NoiseSource};
use stylet_identify::rupture_assignment::assign_ruptures;
use stylet_identify::rupture_likelihood::{estimate_rupture_scatter, evaluate_rupture, rupture_sds};
use stylet_identify::score_test::{ScoreTest, scale_strengths};
use stylet_identify::update_event_times::update_event_times;
use stylet_record::Recording;
use stylet_tissue::effect::SGN_DEAD_BAND_MPS;
use stylet_tissue::{
    AnyEffect, ForceLaw, ForceLawState, Layer, MeasurementChain, SensorInput, Tissue, effect_info,
    general_effects,
};

// ---- Recorded values ----

/// Results of all stages for one insertion or several: names and numbers in order.
#[derive(Default)]
struct Record(Vec<(String, Vec<f64>)>);

impl Record {
    fn numbers(&mut self, name: &str, numbers: &[f64]) {
        self.0.push((name.to_owned(), numbers.to_vec()));
    }

    fn number(&mut self, name: &str, number: f64) {
        self.numbers(name, &[number]);
    }

    fn count(&mut self, name: &str, count: usize) {
        self.number(name, count as f64);
    }

    /// Summary of a column: mean, root mean square, that of its differences, and a weighted mean with distinct
    /// weights.
    fn column(&mut self, name: &str, x: &[f64]) {
        let n = x.len().max(1) as f64;
        let mean = |f: &dyn Fn(usize) -> f64| (0..x.len()).map(f).sum::<f64>() / n;
        let size = mean(&|k| x[k] * x[k]).sqrt();
        let steps = x.windows(2).map(|p| (p[1] - p[0]).powi(2)).sum::<f64>() / n;
        let weighted = mean(&|k| x[k] * libm::sin(1.0 + 0.37 * k as f64 + 2.0 * k as f64 / n));
        self.numbers(name, &[mean(&|k| x[k]), size, steps.sqrt(), weighted]);
    }

    fn flags(&mut self, name: &str, x: &[bool]) {
        self.column(name, &x.iter().map(|x| f64::from(u8::from(*x))).collect::<Vec<f64>>());
    }

    fn jumps(&mut self, name: &str, jumps: &[VelocityJump]) {
        self.count(&format!("{name} jumps"), jumps.len());
        for (i, k) in jumps.iter().enumerate().take(6) {
            self.numbers(
                &format!("{name} jump {i}"),
                &[
                    k.next_sample as f64,
                    k.time_s,
                    k.position_m,
                    k.velocity_mps[0],
                    k.velocity_mps[1],
                    k.position_sd_m,
                ],
            );
        }
    }

    fn pieces(&mut self, name: &str, p: &[MotionPiece]) {
        let column = |f: fn(&MotionPiece) -> f64| -> Vec<f64> { p.iter().map(f).collect() };
        self.count(&format!("{name} pieces"), p.len());
        self.column(&format!("{name} pieces block"), &column(|p| f64::from(p.block)));
        self.column(&format!("{name} pieces length_s"), &column(|p| p.end_s - p.start_s));
        self.column(&format!("{name} pieces position_m"), &column(|p| p.position_m));
        self.column(&format!("{name} pieces velocity_mps"), &column(|p| p.velocity_mps));
        self.column(&format!("{name} pieces acceleration_mps2"), &column(|p| p.acceleration_mps2));
    }

    fn blocks(&mut self, name: &str, b: &BlockAverages) {
        self.count(&format!("{name} blocks"), b.len());
        self.numbers(&format!("{name} span_s"), &[b.span_s().0, b.span_s().1]);
        let lengths: Vec<f64> = b.start_s.iter().zip(&b.end_s).map(|(a, b)| b - a).collect();
        self.column(&format!("{name} lengths_s"), &lengths);
        self.column(&format!("{name} force_n"), &b.force_n);
        self.flags(&format!("{name} compared"), &b.used);
        self.flags(&format!("{name} restart"), &b.memory_reset);
        self.column(&format!("{name} size_n"), &b.abs_force_n);
        self.column(&format!("{name} extra_sd_n"), &b.extra_sd_n);
        self.pieces(name, &b.pieces);
    }

    fn noise(&mut self, name: &str, noise: &Noise) {
        self.numbers(&format!("{name} edges_n"), &noise.edges_n);
        self.number(&format!("{name} sd_n"), noise.sd_n());
        for (k, bin) in noise.bins.iter().enumerate() {
            let of = |what: &str| format!("{name} range {k} {what}");
            self.numbers(&of("coefficients"), &bin.ar);
            self.numbers(&of("slow"), &bin.long_memory);
            self.numbers(&of("sizes_n"), &[bin.innovation_sd_n, bin.sd_n]);
            if noise.long_memory {
                let first: Vec<f64> =
                    bin.after_break.iter().flat_map(|f| f.ar.into_iter().chain(f.long_memory)).collect();
                self.numbers(&of("first"), &first);
                self.numbers(&of("first_n"), &bin.after_break.map(|f| f.sd_n));
            }
        }
    }

    fn rupture_times(&mut self, name: &str, rupture_times: &[f64]) {
        let actual: Vec<f64> =
            rupture_times.iter().map(|t| if *t < NO_RUPTURE { *t } else { -1.0 }).collect();
        self.numbers(name, &actual);
    }

    /// Estimates: shared and per-recording parameters, scatter, rupture times, residuals.
    fn fit(&mut self, name: &str, f: &Fit, data: &FitData) {
        let m = &f.model;
        let nats = [f.nats(), rupture_nats(m, &f.residuals), prior_nats(m)];
        self.numbers(
            &format!("{name} nats, of ruptures, of priors; rms_n"),
            &[&nats[..], &[f.rms_n(data)]].concat(),
        );
        let (shared, own) = (m.shared_parameters(), m.recording_parameters());
        self.numbers(
            &format!("{name} shared"),
            &shared.iter().map(|n| m.get(n.role, 0)).collect::<Vec<f64>>(),
        );
        for r in 0..data.recording_count() {
            let actual: Vec<f64> = own.iter().map(|n| m.get(n.role, r)).collect();
            self.rupture_times(&format!("{name} recording {r}"), &actual);
        }
        let s = &m.scatter;
        let scatter =
            [s.rupture_force, s.rupture_depth_m, s.surface_m, s.ln_friction, s.varying[0], s.varying[1]];
        self.numbers(&format!("{name} scatter"), &scatter);
    }

    fn of_column(&mut self, name: &str, c: &JacobianColumn) {
        for (r, (w, rows)) in c.innovations.iter().zip(&c.rupture_rows).enumerate().take(2) {
            self.column(&format!("{name} of {r} force"), w);
            self.column(&format!("{name} of {r} ruptures"), rows);
        }
    }
}

/// Relative tolerance, and absolute tolerance relative to the largest number of the line.
const RELATIVE_TOLERANCE: f64 = 1e-7;
const ABSOLUTE_TOLERANCE: f64 = 1e-10;

fn file() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/recorded_stages.txt")
}

fn written(all: &[(&str, Record)]) -> String {
    let mut text = String::new();
    for (insertion, record) in all {
        for (name, numbers) in &record.0 {
            let _ = write!(text, "{insertion}: {name} =");
            for x in numbers {
                let _ = if *x == 0.0 || x.fract() == 0.0 && x.abs() < 1e6 {
                    write!(text, " {x}")
                } else {
                    write!(text, " {x:.9e}")
                };
            }
            text.push('\n');
        }
    }
    text
}

fn parsed(text: &str) -> BTreeMap<&str, Vec<f64>> {
    let line = |l: &'_ str| -> Option<(usize, Vec<f64>)> {
        let at = l.find(" =")?;
        Some((at, l[at + 2..].split_whitespace().map(|x| x.parse().expect("a number")).collect()))
    };
    text.lines().filter_map(|l| line(l).map(|(at, x)| (&l[..at], x))).collect()
}

/// Whether two lines of numbers agree.
fn agree(a: &[f64], b: &[f64]) -> bool {
    let size = a.iter().filter(|x| x.is_finite()).fold(1e-15_f64, |m, x| m.max(x.abs()));
    let same = |(a, b): (&f64, &f64)| {
        a == b
            || a.is_nan() && b.is_nan()
            || (a - b).abs() <= RELATIVE_TOLERANCE * a.abs() + ABSOLUTE_TOLERANCE * size
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

// ---- Insertions ----

/// A leg of a motion: duration in s, velocity in m/s, amplitude of a velocity ripple in m/s and its frequency
/// in Hz.
type Leg = (f64, f64, f64, f64);

/// Position (m) and velocity (m/s) of a motion that starts 3 mm above the assumed surface.
fn moved(legs: &[Leg], t: f64) -> (f64, f64) {
    let (mut z, mut from) = (-0.003, 0.0);
    for (k, (lasts, speed, ripple, hz)) in legs.iter().enumerate() {
        let w = core::f64::consts::TAU * hz.max(1e-9);
        let along = |s: f64| speed * s + ripple / w * (1.0 - libm::cos(w * s));
        let s = t - from;
        if s < *lasts || k + 1 == legs.len() {
            return (z + along(s), speed + ripple * libm::sin(w * s));
        }
        z += along(*lasts);
        from += lasts;
    }
    (z, 0.0)
}

/// Reproducible normal numbers: sums of twelve uniform ones from a linear congruential generator (Knuth's
/// MMIX).
struct Normal(u64);

impl Normal {
    fn draw(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}

/// True properties of an insertion, and how it is recorded.
struct Insertion {
    legs: Vec<Leg>,
    tissue: Tissue,
    effects: Vec<AnyEffect>,
    rate_hz: f64,
    /// Noise of the force in N, and its growth with the force.
    noise: (f64, f64),
    /// Autocorrelation of the noise at one sample.
    memory: f64,
    /// Quantisation of positions in m.
    step_m: f64,
    /// Interval in s without samples.
    gap_s: (f64, f64),
    seed: u64,
}

impl Insertion {
    /// The recording and the true rupture times (s).
    fn recorded(&self) -> (Recording, Vec<f64>) {
        let law = ForceLaw::new(&self.tissue, &self.effects).expect("few effects");
        let chain = MeasurementChain::new(&self.effects);
        let (mut state, mut sensor) = (ForceLawState::default(), chain.start(self.rate_hz));
        let (mut t, mut z, mut f, mut ruptures) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut normal = Normal(self.seed);
        let mut slow = 0.0;
        let lasts_s: f64 = self.legs.iter().map(|l| l.0).sum();
        for k in 0..=(lasts_s * self.rate_hz) as usize {
            let at = k as f64 / self.rate_hz;
            let (true_m, velocity_mps) = moved(&self.legs, at);
            let tissue_n =
                law.step(&mut state, at, true_m, velocity_mps, |r| ruptures.push(r.time_s)).total_n;
            slow = self.memory * slow + (1.0 - self.memory * self.memory).sqrt() * normal.draw();
            let noise_n = slow * (self.noise.0 + self.noise.1 * tissue_n.abs());
            let reading =
                SensorInput { time_s: at, velocity_mps, tissue_n, noise_n, ..SensorInput::default() };
            let force_n = chain.step(&mut sensor, &reading);
            if at > self.gap_s.0 && at < self.gap_s.1 {
                continue;
            }
            t.push(at);
            let actual = chain.recorded_position(true_m);
            z.push(if self.step_m > 0.0 { libm::round(actual / self.step_m) * self.step_m } else { actual });
            f.push(force_n);
        }
        (Recording::new(t, z, f).expect("a recording"), ruptures)
    }
}

/// Layers: thickness (m), stiffness (N/m), friction (Ns/m²), puncture force (N).
fn tissue(surface_m: f64, layers: &[(f64, f64, f64, Option<f64>)]) -> Tissue {
    let layer = |&(thickness_m, stiffness_n_per_m, friction_ns_per_m2, puncture_n)| Layer {
        thickness_m,
        stiffness_n_per_m,
        friction_ns_per_m2,
        puncture_n,
        name: String::new(),
    };
    Tissue { surface_m, layers: layers.iter().map(layer).collect() }
}

/// Assumptions of all insertions.
fn assumptions() -> Assumptions {
    Assumptions {
        tissue: tissue(
            0.002,
            &[
                (0.012, 110.0, 5200.0, Some(0.8)),
                (0.015, 190.0, 9400.0, Some(1.7)),
                (0.03, 70.0, 6100.0, None),
            ],
        ),
        known_effects: Vec::new(),
        tolerance: vec![0.3, 0.25, 0.35],
        thickness_tolerance: vec![0.1, 0.12, 0.08],
        surface_tolerance_m: 0.001,
    }
}

/// True tissue of most insertions.
fn truth() -> Tissue {
    tissue(
        0.0024,
        &[
            (0.0115, 118.0, 5600.0, Some(0.74)),
            (0.0157, 171.0, 8900.0, Some(1.83)),
            (0.03, 77.0, 6500.0, None),
        ],
    )
}

fn effect(id: &str, values: &[f64]) -> AnyEffect {
    AnyEffect::from_parameters(id, values).expect("in the library")
}

fn term(id: &str, values: &[f64]) -> EffectTerm {
    EffectTerm::new(effect_info(id).expect("in the library"), values)
}

/// Insertion and retraction at constant velocity.
fn even() -> Insertion {
    Insertion {
        legs: vec![(8.2131, 0.005, 0.0, 0.0), (5.4, -0.0065, 0.0, 0.0)],
        tissue: truth(),
        effects: vec![effect("coulomb_friction", &[9.0])],
        rate_hz: 200.0,
        noise: (0.012, 0.0),
        memory: 0.0,
        step_m: 0.0,
        gap_s: (0.0, 0.0),
        seed: 11,
    }
}

/// A velocity ripple and a coarse encoder.
fn rippled() -> Insertion {
    Insertion {
        legs: vec![(1.5137, 0.0, 0.0, 0.0), (7.1071, 0.005, 0.002, 0.7), (3.3, -0.006, 0.0, 0.0)],
        effects: Vec::new(),
        step_m: 5e-5,
        seed: 12,
        ..even()
    }
}

/// Insertion, holds in the middle and at the end, retraction; a stretch was not recorded.
fn held() -> Insertion {
    Insertion {
        legs: vec![
            (3.6123, 0.004, 0.001, 0.4),
            (1.7071, 0.0, 0.0, 0.0),
            (5.1234, 0.0045, 0.0, 0.0),
            (1.8, 0.0, 0.0, 0.0),
            (4.0, -0.008, 0.0, 0.0),
        ],
        effects: vec![effect("stress_relaxation", &[0.3, 0.9])],
        noise: (0.008, 0.0),
        memory: 0.6,
        gap_s: (2.1, 2.35),
        seed: 13,
        ..even()
    }
}

/// Sampled at 50 Hz with a delayed force.
fn slow() -> Insertion {
    Insertion {
        legs: vec![
            (2.7317, 0.006, 0.0, 0.0),
            (1.9317, 0.003, 0.0, 0.0),
            (2.2317, 0.007, 0.0, 0.0),
            (1.2, 0.0, 0.0, 0.0),
            (2.5317, 0.004, 0.0, 0.0),
            (5.3, -0.006, 0.0, 0.0),
        ],
        effects: vec![effect("time_delay", &[0.0437])],
        rate_hz: 50.0,
        noise: (0.006, 0.0),
        seed: 14,
        ..even()
    }
}

/// Small drops under autocorrelated noise, and a membrane on the way.
fn small() -> Insertion {
    Insertion {
        legs: vec![(9.7131, 0.0041, 0.0008, 0.31), (4.0, -0.0075, 0.0, 0.0)],
        tissue: tissue(
            0.0017,
            &[
                (0.0126, 104.0, 4700.0, Some(0.21)),
                (0.0143, 205.0, 9900.0, Some(0.34)),
                (0.03, 64.0, 5500.0, None),
            ],
        ),
        effects: vec![effect("hidden_membrane", &[0.019, 120.0, 0.16])],
        noise: (0.011, 0.0),
        memory: 0.5,
        seed: 15,
        ..even()
    }
}

/// A deeper surface than assumed, and noise that grows with the force.
fn shifted() -> Insertion {
    let mut there = truth();
    there.surface_m = 0.0037;
    Insertion {
        legs: vec![(6.4131, 0.0065, 0.0015, 0.9), (1.6, 0.0, 0.0, 0.0), (6.2, -0.006, 0.001, 0.5)],
        tissue: there,
        effects: vec![effect("respiration", &[6e-4, 0.31, 0.7])],
        noise: (0.004, 0.02),
        seed: 16,
        ..even()
    }
}

/// One of several insertions with different surface and friction.
fn repeated(k: usize) -> Insertion {
    let mut there = truth();
    there.surface_m += [3e-4, -5e-4, 7e-4][k];
    for l in &mut there.layers {
        l.friction_ns_per_m2 *= [1.11, 0.93, 0.98][k];
    }
    Insertion {
        legs: vec![
            (7.3131 + 0.1 * k as f64, 0.005, 0.001, 0.6),
            (0.9, 0.0, 0.0, 0.0),
            (5.0, -0.006, 0.0, 0.0),
        ],
        tissue: there,
        effects: vec![effect("release_depth", &[2.0, 3.1e-3 + 4e-4 * k as f64])],
        noise: (0.01, 0.0),
        memory: 0.3,
        seed: 17 + k as u64,
        ..even()
    }
}

// ---- Stages ----

/// Motion and raw force.
fn raw_stages(record: &mut Record, r: &Recording, layers: usize) {
    let (t, z) = (&r.time_s, &r.position_m);
    let actual = estimate_velocity(t, z);
    record.column("velocity mps", &actual.velocity_mps);
    record.number("velocity noise_mps", actual.sd_mps);
    record.jumps("velocity", &actual.jumps);
    let calm = smooth_positions(t, z);
    record.column("smoothed position_m", &calm.position_m);
    record.column("smoothed mps", &calm.velocity_mps);
    record.number("smoothed sd_mps", calm.sd_mps);
    record.jumps("smoothed", &calm.jumps);
    let motion = Motion::from_recording(r, SGN_DEAD_BAND_MPS);
    record.numbers("motion noise", &[motion.velocity_sd_mps, motion.noise_m * 100.0]);
    for (i, j) in motion.jumps.iter().enumerate().take(6) {
        record.numbers(&format!("motion jump {i} times_s"), &[j.time_s, j.sample_mid_s, j.time_sd_s]);
        record.number(&format!("motion jump {i} position_m"), j.position_m);
        record.numbers(&format!("motion jump {i} mps"), &j.velocity_mps);
    }
    let end = t[t.len() - 1];
    let between: Vec<(f64, f64)> = (0..400).map(|k| motion.at(end * (f64::from(k) - 3.0) / 390.0)).collect();
    record.column("motion position_m", &between.iter().map(|m| m.0).collect::<Vec<f64>>());
    record.column("motion mps", &between.iter().map(|m| m.1).collect::<Vec<f64>>());
    let p = insertion_phases::detect_phases(r);
    record.numbers("phases", &[p.start as f64, p.deepest as f64, p.retraction as f64]);
    record.number("phases noise_n", insertion_phases::noise_n(&r.force_n));
    record.number("phases contact_m", insertion_phases::contact_m(r, &p));
    let falls = insertion_phases::abrupt_drops(r, &p);
    record.numbers("phases drops", &falls.iter().map(|d| d.sample as f64).collect::<Vec<f64>>());
    record.numbers("phases drops_n", &falls.iter().map(|d| d.size_n).collect::<Vec<f64>>());
    let of = insertion_phases::rupture_samples(&falls, layers);
    record.numbers("phases ruptures", &of.iter().map(|d| d.map_or(-1.0, |d| d as f64)).collect::<Vec<f64>>());
    for few in 1..=layers {
        let released = insertion_phases::releases(r, &p, few);
        record.numbers(
            &format!("phases {few} releases"),
            &released.iter().flat_map(|r| [r.position_m, 0.1 * r.size_n]).collect::<Vec<f64>>(),
        );
    }
}

/// Blocks: plain, delayed, coarser.
fn block_stages(record: &mut Record, b: &BlockAverages) {
    record.blocks("blocks", b);
    record.blocks("coarse", &b.coarsened(3));
    for (name, smeared, late_s, placed_s) in [
        ("low-pass", true, 0.0, None),
        ("delay", false, 0.0137, None),
        ("delay and low-pass", true, 0.0137, Some(0.02)),
        ("refined delay", false, 0.0437, Some(0.0391)),
    ] {
        record.pieces(name, &b.motion_pieces(smeared, late_s, placed_s));
    }
    record.column("delay extra_sd_n", &b.with_delayed_jump_uncertainty(0.0437).extra_sd_n);
    let e: Vec<f64> = (0..b.len()).map(|k| 0.05 * libm::sin(0.3 * k as f64)).collect();
    record.column("raw residual_n", &b.sample_residuals(&e));
    record.number("within_n", b.within_block_sd_n());
    let found = detect_force_drops(b);
    record.numbers("drops at_s", &found.iter().map(|d| d.time_s).collect::<Vec<f64>>());
    record.numbers("drops position_m", &found.iter().map(|d| d.position_m).collect::<Vec<f64>>());
    record.numbers("drops size_n", &found.iter().map(|d| d.size_n).collect::<Vec<f64>>());
    record.numbers("drops score", &found.iter().map(|d| d.score).collect::<Vec<f64>>());
}

/// Standard deviation in N of blocks about their neighbours.
fn roughness(blocks: &[BlockAverages]) -> f64 {
    let third = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
    let mut all: Vec<f64> = blocks.iter().flat_map(|b| b.force_n.windows(4).map(third)).collect();
    (stylet_stats::order_statistics::median(&mut all) * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt()).max(1e-6)
}

/// The base model fitted as in a diagnosis: drops assigned to layers, parameters and rupture times in turn.
fn base_stages(
    record: &mut Record,
    assumptions: &Arc<Assumptions>,
    blocks: &Arc<Vec<BlockAverages>>,
) -> (Fit, FitData) {
    let found: Vec<_> = blocks.iter().map(detect_force_drops).collect();
    let times: Vec<Vec<f64>> = found.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect();
    let rough_n = roughness(blocks);
    let largest = blocks.iter().flat_map(|b| &b.abs_force_n).fold(1e-9_f64, |m, f| m.max(*f));
    let mut data = FitData::new(Arc::clone(blocks), Noise::white(rough_n.max(0.03 * largest)), 1e-4);
    let model = Model::base(Arc::clone(assumptions), blocks.len());
    let mut best: Option<Fit> = None;
    for trust in [1.0, 0.5] {
        let from = best.as_ref().map_or(&model, |b| &b.model).clone();
        let rupture_times = assign_ruptures(&from, blocks, &found, trust, rough_n);
        for (r, i) in rupture_times.iter().enumerate() {
            record.rupture_times(&format!("assigned with {trust} of {r} times_s"), i);
        }
        let next = Model { rupture_times_s: rupture_times, ..from };
        let new = fit(&next, &data, Effort { max_iterations: 4, min_gain_nats: 0.3 }).expect("a fit");
        record.fit(&format!("first fit with {trust}"), &new, &data);
        if best.as_ref().is_none_or(|b| new.nats() < b.nats()) {
            best = Some(new);
        }
    }
    let mut best = best.expect("a fit");
    for round in 0..2 {
        data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
        record.noise(&format!("detrended noise {round}"), &data.noise);
        let mut model = best.model.clone();
        let moved = update_event_times(&mut model, &data, &times);
        record.flags(&format!("round {round} moved"), &[moved]);
        for (r, i) in model.rupture_times_s.iter().enumerate() {
            record.rupture_times(&format!("round {round} of {r} times_s"), i);
        }
        best = fit(&model, &data, Effort { max_iterations: 5, min_gain_nats: 0.3 }).expect("a fit");
        record.fit(&format!("round {round}"), &best, &data);
    }
    data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
    best = fit_from_zero_scatter(&best.model, &data, Effort::FULL).expect("a fit");
    record.fit("base", &best, &data);
    (best, data)
}

/// Noise from every source, and its effect on the residuals.
fn noise_stages(record: &mut Record, found: &Fit, data: &FitData) {
    let e = &found.residuals.residual_n;
    for from in
        [NoiseSource::Residual, NoiseSource::LongMemory, NoiseSource::Bootstrap, NoiseSource::Detrended]
    {
        let name = format!("noise {from:?}");
        let own = data.with_estimated_noise(e, from);
        record.noise(&name, &own.noise);
        let w = own.whiten(0, &e[0]);
        record.column(&format!("{name} innovations"), &w);
        record.column(&format!("{name} coloured_n"), &own.unwhiten(0, &w));
        let nats = residuals(&found.model, &own).expect("a replay").nats;
        record.number(&format!("{name} nats"), nats);
    }
    record.number("discrepancy_n", discrepancy_noise(&data.recordings, e, 1e-4).sd_n());
    record.count("compared", data.compared_block_count());
}

/// Linearization: columns, standard deviations, evidence; score tests of effects.
fn picture_stages(record: &mut Record, found: &Fit, data: &FitData) {
    let linearization = Linearization::new(&found.model, data, &found.residuals);
    let factor = linearization.factor();
    record.column("slope", &linearization.neg_gradient);
    let sds: Vec<f64> = factor.inverse_diagonal().iter().map(|v| v.sqrt()).collect();
    record.numbers("sds", &sds);
    record.number("ln determinant", factor.log_determinant());
    let numbers = linearization.shared.iter().chain(&linearization.per_recording);
    for (n, c) in numbers.zip(&linearization.columns) {
        record.of_column(&format!("column {:?}", n.role), c);
    }
    let step = |n: &stylet_identify::model::Parameter| match n.role {
        ParameterRole::Surface | ParameterRole::Thickness(_) => Some(2e-4),
        _ => None,
    };
    let wide = Linearization::new(&found.model, data, &found.residuals);
    let wide = wide.with_wide_differences(&found.model, data, &found.residuals, &step);
    record.column("wide slope", &wide.neg_gradient);
    record.number("wide ln determinant", wide.factor().log_determinant());
    let score_test = ScoreTest::new(found, data);
    for effect in general_effects() {
        let values: Vec<f64> = effect
            .parameters
            .iter()
            .map(|p| if p.integer { 1.0 } else { 0.7 * p.search.0 + 0.3 * p.search.1 })
            .collect();
        let one = EffectTerm::new(effect, &values);
        let Some(c) = one.effect().and_then(|_| score_test.effect_column(&one)) else { continue };
        let gain = score_test.gain(std::slice::from_ref(&c));
        let name = format!("score test {}", effect.id);
        record
            .numbers(&name, &[gain.nats, gain.detectable_nats, gain.unexplained_share, gain.coefficients[0]]);
        if effect.parameters.len() < 4 {
            record
                .numbers(&format!("{name} scaled"), &scale_strengths(effect, &[&values], &gain.coefficients));
        }
    }
    let (one, two) = (term("coulomb_friction", &[2.0]), term("stress_relaxation", &[0.2, 1.1]));
    let force: Vec<Vec<f64>> =
        data.recordings.iter().map(|b| b.start_s.iter().map(|t| 0.01 * t).collect()).collect();
    let columns = [
        score_test.effect_column(&one),
        score_test.effect_column(&two),
        Some(score_test.force_column(&force)),
    ]
    .map(|c| c.expect("a column"));
    let gain = score_test.gain(&columns);
    record.numbers(
        "score test three",
        &[&[gain.nats, gain.detectable_nats, gain.unexplained_share][..], &gain.coefficients].concat(),
    );
    for (l, e) in found.residuals.ruptures.iter().flatten().enumerate().take(4) {
        let s = found.model.scatter;
        let (a, b) = rupture_sds(e, &s);
        record.numbers(&format!("rupture {l} force"), &[e.force_excess, a, e.force_excess_rate, e.elastic_n]);
        record.numbers(&format!("rupture {l} position_m"), &[e.depth_excess_m, b, e.depth_rate_mps]);
        record.numbers(&format!("rupture {l} judged"), &evaluate_rupture(e, &s).rows);
        record.number(&format!("rupture {l} nats"), evaluate_rupture(e, &s).nats);
    }
    let all: Vec<_> = found.residuals.ruptures.iter().flatten().copied().collect();
    let s = estimate_rupture_scatter(&all, &found.model.scatter);
    record.numbers("estimated scatter", &[s.rupture_force, s.rupture_depth_m]);
}

/// Every effect of the library replayed with the law's own ruptures.
fn library_stages(record: &mut Record, found: &Fit, data: &FitData) {
    for effect in general_effects() {
        let values: Vec<f64> = effect
            .parameters
            .iter()
            .map(|p| if p.integer { 1.0 } else { 0.6 * p.search.0 + 0.4 * p.search.1 })
            .collect();
        let model = found.model.with_effect(EffectTerm::new(effect, &values));
        let Some(cache) = ReplayCache::new(&model, data, 0) else { continue };
        let rupture_times = cache.free_rupture_times();
        let there = Model { rupture_times_s: vec![rupture_times.clone()], ..model.clone() };
        let Some(out) = replay(&there, data, 0) else { continue };
        record.rupture_times(&format!("replay {} times_s", effect.id), &rupture_times);
        record.column(&format!("replay {} force_n", effect.id), &out.force_n);
        let actual = |e: &stylet_identify::rupture_likelihood::RuptureEvent| {
            [
                e.force_excess,
                e.force_excess_rate,
                e.elastic_n,
                e.depth_excess_m,
                e.depth_rate_mps,
                f64::from(u8::from(e.ruptured)),
            ]
        };
        let actual: Vec<f64> = out.ruptures.iter().flat_map(actual).collect();
        record.numbers(&format!("replay {} ruptures", effect.id), &actual);
        let nats = cache.nats_with_ruptures(&model, data, 0, &rupture_times);
        record.number(&format!("replay {} nats", effect.id), if nats < NO_RUPTURE { nats } else { -1.0 });
    }
}

/// Trial of an effect: rupture times updated, fitted, noise re-estimated.
fn trial_stages(record: &mut Record, name: &str, found: &Fit, data: &FitData, with: EffectTerm) -> Fit {
    let mut model = found.model.with_effect(with);
    let times: Vec<Vec<f64>> =
        data.recordings.iter().map(|b| detect_force_drops(b).iter().map(|d| d.time_s).collect()).collect();
    let short = fit(&model, data, Effort::SHORT).expect("a fit");
    record.number(&format!("{name} short fit nats"), short.nats());
    let hopeless = fit_if_below(&model, data, Effort::FULL, 0.5 * short.nats()).expect("a fit");
    record.number(&format!("{name} stopped fit nats"), hopeless.nats());
    model = short.model;
    update_event_times(&mut model, data, &times);
    let whole = fit(&model, data, Effort::FULL).expect("a fit");
    let own = data.with_estimated_noise(&whole.residuals.residual_n, NoiseSource::Residual);
    let best = fit_from_zero_scatter(&whole.model, &own, Effort::FULL).expect("a fit");
    record.fit(name, &best, &own);
    let linearization = Linearization::new(&best.model, &own, &best.residuals);
    let sds = linearization.factor().inverse_diagonal();
    record.numbers(
        &format!("{name} sds"),
        &sds[..linearization.shared.len()].iter().map(|v| v.sqrt()).collect::<Vec<f64>>(),
    );
    record.number(&format!("{name} ln determinant"), linearization.factor().log_determinant());
    best
}

/// All stages of a single insertion except effect trials.
fn one(record: &mut Record, of: &Insertion) -> (Fit, FitData, Vec<f64>) {
    let (recording, ruptures) = of.recorded();
    let assumptions = Arc::new(assumptions());
    raw_stages(record, &recording, 3);
    let exclude: Vec<bool> = recording.time_s.iter().map(|t| (*t - 1.3).abs() < 0.031).collect();
    let blocks = BlockAverages::new(&recording, &exclude, BLOCK_S);
    block_stages(record, &blocks);
    let (found, data) = base_stages(record, &assumptions, &Arc::new(vec![blocks]));
    noise_stages(record, &found, &data);
    (found, data, ruptures)
}

/// Rupture times agree with the true ones to `within_s`.
fn assert_close(found: &Fit, ruptures: &[f64], within_s: f64) {
    let actual = &found.model.rupture_times_s[0];
    for (t, truth) in actual.iter().zip(ruptures) {
        assert!((t - truth).abs() < within_s, "{actual:?} for {ruptures:?}");
    }
}

/// Parameters of the first two layers agree with the true ones.
fn lies_at(found: &Fit, truth: &Tissue) {
    let actual = &found.model.tissue;
    assert!((actual.surface_m - truth.surface_m).abs() < 1e-4, "{}", actual.surface_m);
    for (l, t) in actual.layers.iter().zip(&truth.layers).take(2) {
        close("stiffness", l.stiffness_n_per_m, t.stiffness_n_per_m, 0.02);
        close("friction", l.friction_ns_per_m2, t.friction_ns_per_m2, 0.02);
        close("puncture force", l.puncture_n.unwrap_or(0.0), t.puncture_n.unwrap_or(1.0), 0.02);
        assert!((l.thickness_m - t.thickness_m).abs() < 1e-4, "{}", l.thickness_m);
    }
}

fn close(name: &str, actual: f64, truth: f64, within: f64) {
    assert!((actual / truth - 1.0).abs() < within, "{name}: {actual} for {truth}");
}

fn even_stages() -> Record {
    let mut record = Record::default();
    let (found, data, ruptures) = one(&mut record, &even());
    assert_close(&found, &ruptures, 0.03);
    library_stages(&mut record, &found, &data);
    let best = trial_stages(&mut record, "dry friction", &found, &data, term("coulomb_friction", &[3.0]));
    assert_close(&best, &ruptures, 0.03);
    lies_at(&best, &truth());
    close("dry friction", best.model.effects[0].values[0], 9.0, 0.03);
    record
}

fn rippled_stages() -> Record {
    let mut record = Record::default();
    let (found, data, ruptures) = one(&mut record, &rippled());
    assert_close(&found, &ruptures, 0.03);
    lies_at(&found, &truth());
    let bent = trial_stages(&mut record, "compliance", &found, &data, term("needle_compliance", &[4000.0]));
    assert!(bent.model.effects[0].values[0] > 1e5, "a rigid needle gives: {:?}", bent.model.effects);
    library_stages(&mut record, &found, &data);
    record
}

fn held_stages() -> Record {
    let mut record = Record::default();
    let (found, data, ruptures) = one(&mut record, &held());
    assert_close(&found, &ruptures, 0.03);
    picture_stages(&mut record, &found, &data);
    library_stages(&mut record, &found, &data);
    let best = trial_stages(&mut record, "relaxing", &found, &data, term("stress_relaxation", &[0.2, 1.5]));
    assert_close(&best, &ruptures, 0.03);
    lies_at(&best, &truth());
    close("relaxing share", best.model.effects[0].values[0], 0.3, 0.03);
    close("time of relaxation", best.model.effects[0].values[1], 0.9, 0.1);
    record
}

fn slow_stages() -> Record {
    let mut record = Record::default();
    let (found, data, _) = one(&mut record, &slow());
    let best = trial_stages(&mut record, "delay", &found, &data, term("time_delay", &[0.03]));
    let (to_the_step, seen) = refine_delay(&best, &data).expect("an improved fit");
    record.fit("refined delay", &to_the_step, &seen);
    close("delay", delay_s(&to_the_step.model), 0.0437, 0.05);
    lies_at(&to_the_step, &truth());
    trial_stages(&mut record, "low-pass", &found, &data, term("low_pass_lag", &[0.03]));
    record
}

fn small_stages() -> Record {
    let mut record = Record::default();
    let (found, data, _) = one(&mut record, &small());
    picture_stages(&mut record, &found, &data);
    let with = term("hidden_membrane", &[0.018, 100.0, 0.2]);
    let best = trial_stages(&mut record, "membrane", &found, &data, with);
    let values = &best.model.effects[0].values;
    assert!((best.model.tissue.surface_m + values[0] - 0.0207).abs() < 2e-3, "{values:?}");
    close("the membrane's stiffness", values[1], 120.0, 0.1);
    record
}

fn shifted_stages() -> Record {
    let mut record = Record::default();
    let (found, data, ruptures) = one(&mut record, &shifted());
    assert_close(&found, &ruptures, 0.03);
    let breath =
        trial_stages(&mut record, "respiration", &found, &data, term("respiration", &[5e-4, 0.3, 0.5]));
    lies_at(&breath, &Tissue { surface_m: 0.0037, ..truth() });
    close("amplitude", breath.model.effects[0].values[0], 6e-4, 0.02);
    close("frequency", breath.model.effects[0].values[1], 0.31, 0.005);
    trial_stages(&mut record, "by speed", &found, &data, term("rate_dependent_puncture", &[0.1]));
    record
}

/// Three insertions, two on one day.
fn several_stages() -> Record {
    let mut record = Record::default();
    let assumptions = Arc::new(assumptions());
    let blocks: Vec<BlockAverages> = (0..3)
        .map(|k| {
            let (r, _) = repeated(k).recorded();
            BlockAverages::new(&r, &vec![false; r.time_s.len()], BLOCK_S)
        })
        .collect();
    let (found, data) = base_stages(&mut record, &assumptions, &Arc::new(blocks));
    noise_stages(&mut record, &found, &data);
    let mut own = found.model.clone();
    (own.free.recording_surface, own.free.recording_friction) = (true, true);
    let own = fit(&own, &data, Effort::FULL).expect("a fit");
    record.fit("random effects", &own, &data);
    for (k, expected) in [0.11, -0.07, -0.02].iter().enumerate() {
        let mean = own.model.per_recording.iter().map(|o| o.ln_friction).sum::<f64>() / 3.0;
        let actual = own.model.per_recording[k].ln_friction - mean;
        assert!((actual - (expected - 0.0067)).abs() < 0.03, "friction of {k}: {actual}");
    }
    picture_stages(&mut record, &own, &data);
    let mut incomplete = own.model.with_effect(term("release_depth", &[2.0, 3e-3]));
    incomplete.free.recording_effects = true;
    let incomplete = fit(&incomplete, &data, Effort::FULL).expect("a fit");
    record.fit("incomplete release", &incomplete, &data);
    let linearization = Linearization::new(&incomplete.model, &data, &incomplete.residuals);
    record.number("incomplete release ln determinant", linearization.factor().log_determinant());
    record.column("incomplete release slope", &linearization.neg_gradient);
    let mut days = found.model.clone();
    (days.days, days.day_of) = (vec![DayParameters::default(); 2], vec![0, 1, 0]);
    (days.free.day_surface, days.free.day_friction) = (true, true);
    days.fixed_scatter = true;
    let days = fit(&days, &data, Effort::FULL).expect("a fit");
    record.fit("days", &days, &data);
    let two = data.subset(&[2, 0]);
    let fewer = fit(&days.model.subset(&[2, 0]), &two, Effort::SHORT).expect("a fit");
    record.fit("two of them", &fewer, &two);
    record
}

#[test]
fn every_stage_agrees_with_the_recorded_values() {
    type Stages = fn() -> Record;
    let insertions: [(&str, Stages); 7] = [
        ("even", even_stages),
        ("rippled", rippled_stages),
        ("held", held_stages),
        ("slow", slow_stages),
        ("small", small_stages),
        ("shifted", shifted_stages),
        ("several", several_stages),
    ];
    let running = insertions.map(|(name, of)| (name, std::thread::spawn(of)));
    let all = running.map(|(name, record)| (name, record.join().expect("stages that run to their end")));
    let now = written(&all);
    if std::env::var_os("STYLET_RECORD").is_some() {
        std::fs::write(file(), now).expect("a place to write");
        return;
    }
    let then = std::fs::read_to_string(file()).expect("recorded stages");
    let (then, now) = (parsed(&then), parsed(&now));
    let differs = |name: &&str| match (then.get(*name), now.get(*name)) {
        (Some(a), Some(b)) => !agree(a, b),
        _ => true,
    };
    let names: std::collections::BTreeSet<&str> = then.keys().chain(now.keys()).copied().collect();
    let off: Vec<&str> = names.into_iter().filter(differs).collect();
    let first = off.first().map(|n| (n, then.get(*n), now.get(*n)));
    assert!(off.is_empty(), "{} of {} differ; the first: {first:?}", off.len(), now.len());
}
