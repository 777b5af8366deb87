//! An insertion nobody has seen: draws from what varies between recordings and days, their mean and their band.

use crate::repeated_insertions::instrument_faults::fit_trend;
use crate::repeated_insertions::multistart_fit::{PRIOR_DAYS, SetFit};
use crate::repeated_insertions::start_values::SegmentedRecording;
use std::collections::BTreeSet;
use stylet_identify::fit::Linearization;
use stylet_identify::likelihood::residuals;
use stylet_identify::model::{DayParameters, EffectTerm, Model, NO_RUPTURE, Parameter, RecordingParameters};
use stylet_record::Recording;
use stylet_stats::linear_algebra::CholeskyFactor;
use stylet_stats::normal::quantile;
use stylet_stats::{median_of, quantile_of_sorted, sorted, student_t};
use stylet_tissue::{Effect, ForceLawState, SensorInput, ShaftFriction};

/// Draws of a prediction.
pub const DRAWS: usize = 64;

/// The part of an insertion that a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsertionPhase {
    /// In air and until the first rupture.
    Loading,
    /// After it, on the way in.
    Cutting,
    /// At rest, deep.
    Hold,
    /// On the way back.
    Retraction,
}

/// What varies, and what the law leaves.
#[derive(Clone, Debug)]
pub struct Population {
    /// The law with no recording of its own.
    pub model: Model,
    /// Root mean square (N) of what is left in the tissue, by [`Part`], of a recording that takes part in the fit; single samples with their
    /// noise.
    pub residual_n: [f64; 4],
    /// The same as pieces of equal share: it is no normal distribution, most of it is where a layer gives way or lets go.
    pub residual_quantiles_n: [[f64; QUANTILES]; 4],
    /// The same in air, where nothing is left of a law but what the sensor does.
    pub air_quantiles_n: [f64; QUANTILES],
    /// Recordings that the law was fitted to: what varies between them is known as well as so many can tell.
    pub recordings: usize,
    /// Days that they were made on.
    pub days: usize,
    /// What the fit leaves open of the law's own numbers, where that is asked for: the numbers, and the factor of their information.
    pub parameter_information: Option<(Vec<Parameter>, CholeskyFactor)>,
}

/// Pieces of equal share that what is left is drawn as: the outermost of ten stand for the ends of a 90 % band.
pub const QUANTILES: usize = 10;

/// What is left of a normal distribution in pieces of equal share.
#[must_use]
pub fn normal_quantiles(sd_n: f64) -> [f64; QUANTILES] {
    std::array::from_fn(|k| sd_n * quantile((k as f64 + 0.5) / QUANTILES as f64))
}

/// The same of these values (N), as much to either side, with so much noise beside them.
fn pieces_of(left_n: &[f64], noise_n: f64) -> [f64; QUANTILES] {
    let sizes = sorted(left_n.iter().map(|e| e.abs()));
    let noise = normal_quantiles(noise_n);
    std::array::from_fn(|k| {
        let share = ((2 * k + 1) as f64 / QUANTILES as f64 - 1.0).abs();
        let size = if sizes.is_empty() { 0.0 } else { quantile_of_sorted(&sizes, share) };
        size.hypot(noise[k]).copysign(noise[k]) * f64::from(u8::from(2 * k + 1 != QUANTILES))
    })
}

/// Radical inverse of `k` in a base: points of the Halton sequence.
fn halton(mut k: usize, base: usize) -> f64 {
    let (mut share, mut out) = (1.0, 0.0);
    while k > 0 {
        share /= base as f64;
        out += share * (k % base) as f64;
        k /= base;
    }
    out
}

/// Bases of the Halton sequence.
const PRIMES: [usize; 24] =
    [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89];

impl Population {
    /// What a fit says of insertions in general.
    #[must_use]
    pub fn from_fit(fitted: &SetFit, runs: &[&SegmentedRecording]) -> Self {
        let (mut left, mut air): ([Vec<f64>; 4], Vec<f64>) = Default::default();
        let model = &fitted.fit.model;
        for (r, (b, e)) in fitted.data.recordings.iter().zip(&fitted.fit.residuals.residual_n).enumerate() {
            let first = model.rupture_times_s[r].iter().copied().fold(NO_RUPTURE, f64::min);
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                // In air the law's force is nothing.
                if e[k] == b.force_n[k] {
                    air.push(e[k]);
                } else {
                    left[phase_at(runs[r], 0.5 * (b.start_s[k] + b.end_s[k]), first) as usize].push(e[k]);
                }
            }
        }
        // Blocks average the noise of single samples away.
        let noise_n = median_of(runs.iter().map(|r| single(&r.recording)));
        let square = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>() / f64::max(e.len() as f64, 1.0);
        let residual_n = std::array::from_fn(|p| (square(&left[p]) + noise_n * noise_n).sqrt());
        let pieces_n = std::array::from_fn(|p| pieces_of(&left[p], noise_n));
        let days: BTreeSet<usize> = model.day_of.iter().copied().collect();
        let law = model.subset(&[]);
        let air_n = pieces_of(&air, noise_n);
        Self {
            model: law,
            residual_n,
            residual_quantiles_n: pieces_n,
            air_quantiles_n: air_n,
            recordings: runs.len(),
            days: days.len(),
            parameter_information: None,
        }
    }

    /// The same with what the fit leaves open of the law, which a speed that took no part has to know.
    #[must_use]
    pub fn with_parameter_uncertainty(self, fitted: &SetFit) -> Self {
        let model = &fitted.fit.model;
        let open = residuals(model, &fitted.data).map(|at| {
            let tangent = Linearization::new(model, &fitted.data, &at);
            let factor = tangent.factor();
            (tangent.shared, factor)
        });
        Self { parameter_information: open, ..self }
    }

    /// How far what varies lies from its mean in a recording that takes no part, over one that does: about a mean of `n` values another one
    /// scatters by `sqrt((n + 1)/n)` of their standard deviation, they by `sqrt((n - 1)/n)`. What a law of few numbers leaves is no mean of
    /// so few: drawn with it, sets of five had 94 % in a band of 90 %, and have 90 % without.
    fn beyond(&self) -> f64 {
        let n = self.recordings.max(2) as f64;
        ((n + 1.0) / (n - 1.0)).sqrt()
    }

    /// The `k`-th drawn insertion, from 1 on; on a known day or on one that is drawn too.
    fn draw(&self, k: usize, day: Option<usize>) -> Model {
        let mut dimension = 0;
        let mut place = || {
            let base = PRIMES[dimension % PRIMES.len()];
            dimension += 1;
            halton(k, base)
        };
        // What varies is drawn about a mean, and with a spread, that so many recordings tell no better: Student's. What adds up is told by
        // each recording as often as there are numbers that vary (Satterthwaite 1946, of equal parts): with the degrees of one of them
        // the sum would be too wide.
        let vary = 2 + self.model.layers() + self.model.varying_parameters().count();
        let dof = vary as f64 * (self.recordings.max(2) as f64 - 1.0);
        let mut normal = || student_t::quantile(place(), dof) * self.beyond();
        let mut model = self.model.clone();
        let s = &self.model.scatter;
        let (surface, friction) = (normal(), normal());
        let free = model.free;
        let mut own = RecordingParameters::default();
        if free.recording_surface {
            own.surface_m = s.surface_m * surface;
        }
        if free.recording_friction {
            own.ln_friction = s.ln_friction * friction;
        }
        for layer in 0..model.layers() {
            let factor = (1.0 + s.rupture_force * normal()).max(0.2);
            if let Some(f) = &mut model.tissue.layers[layer].puncture_n {
                *f *= factor;
            }
            for choice in &mut model.effects {
                if let Some(mut effect) = choice.effect() {
                    effect.scale_puncture(layer + 1, factor);
                    *choice = EffectTerm::new(choice.info, &effect.parameters());
                }
            }
        }
        if free.recording_effects {
            for k in 0..self.model.varying_parameters().count() {
                own.varying[k] = self.model.varying_sd(k) * normal();
            }
        }
        // Days were as few as they are, and what is expected of them counts as some more.
        let days = self.days as f64;
        let wide = (1.0 + 1.0 / days.max(1.0)).sqrt();
        let mut of_day = || student_t::quantile(place(), days.max(1.0) + PRIOR_DAYS - 1.0) * wide;
        let drawn = DayParameters {
            surface_m: s.day_surface_m * of_day(),
            ln_friction: s.day_ln_friction * of_day(),
        };
        let day = day.unwrap_or_else(|| {
            model.days.push(DayParameters {
                surface_m: if free.day_surface { drawn.surface_m } else { 0.0 },
                ln_friction: if free.day_friction { drawn.ln_friction } else { 0.0 },
            });
            model.days.len() - 1
        });
        model.per_recording = vec![own];
        model.day_of = vec![day];
        model.rupture_times_s = vec![vec![NO_RUPTURE; model.layers()]];
        model
    }
}

/// Samples of a window in which single ones scatter about a line.
const WINDOW: usize = 8;

/// Standard deviation (N) of single samples about what a block follows.
fn single(recording: &Recording) -> f64 {
    let (t, f) = (&recording.time_s, &recording.force_n);
    let of = |(t, f): (&[f64], &[f64])| fit_trend(t, f).sd_n * (WINDOW as f64 / (WINDOW as f64 - 2.0)).sqrt();
    median_of(t.chunks_exact(WINDOW).zip(f.chunks_exact(WINDOW)).map(of))
}

/// The force (N) of the `k`-th drawn insertion (from 1 on), moved as `run` was, without what the law leaves.
#[must_use]
pub fn draw_force(
    population: &Population,
    run: &SegmentedRecording,
    k: usize,
    day: Option<usize>,
) -> Option<Vec<f64>> {
    force(population, run, k, day).map(|f| f.0)
}

/// The same with the instant (s) of its first rupture.
fn force(
    population: &Population,
    run: &SegmentedRecording,
    k: usize,
    day: Option<usize>,
) -> Option<(Vec<f64>, f64)> {
    simulate_force(&population.draw(k, day), run)
}

/// The force (N) of a model moved as `run` was, and the instant (s) of its first rupture.
pub(super) fn simulate_force(model: &Model, run: &SegmentedRecording) -> Option<(Vec<f64>, f64)> {
    let r = &run.recording;
    let model = model.compile(0)?;
    let mut chain = model.chain.start(2.0 * r.sample_hz());
    let mut state = ForceLawState::default();
    let mut first_s = NO_RUPTURE;
    let force = (0..r.len())
        .map(|i| {
            let (t, z, v) = (
                r.time_s[i],
                r.position_m[i] * model.true_over_recorded,
                r.velocity_mps[i] * model.true_over_recorded,
            );
            let f = model.law.step(&mut state, t, z, v, |at| first_s = first_s.min(at.time_s)).total_n;
            if !model.has_measurement_chain {
                return f;
            }
            let reading = SensorInput { time_s: t, velocity_mps: v, tissue_n: f, ..SensorInput::default() };
            model.chain.step(&mut chain, &reading)
        })
        .collect::<Vec<f64>>();
    force.iter().all(|f| f.is_finite()).then_some((force, first_s))
}

/// The part of an insertion at a time, its first rupture being at `first_s`.
#[must_use]
pub fn phase_at(run: &SegmentedRecording, time_s: f64, first_s: f64) -> InsertionPhase {
    let at = |i: usize| run.recording.time_s.get(i).copied().unwrap_or(f64::INFINITY);
    if time_s >= at(run.phases.retraction) {
        InsertionPhase::Retraction
    } else if time_s > at(run.phases.deepest) {
        InsertionPhase::Hold
    } else if time_s >= first_s {
        InsertionPhase::Cutting
    } else {
        InsertionPhase::Loading
    }
}

/// A prediction.
#[derive(Clone, Debug, Default)]
pub struct PredictedForce {
    /// Mean force in N at every sample.
    pub mean_n: Vec<f64>,
    /// Lower end of the 90 % band in N.
    pub low_n: Vec<f64>,
    /// Upper end.
    pub high_n: Vec<f64>,
}

/// Half the width of a normal 90 % band in standard deviations.
pub(super) const Z90: f64 = 1.644_853_626_951_472_2;

impl PredictedForce {
    /// Makes the band as wide as something of this standard deviation (N) beside it asks for.
    pub(super) fn widen(&mut self, sd_n: &[f64]) {
        for ((mean, sd), (low, high)) in
            self.mean_n.iter().zip(sd_n).zip(self.low_n.iter_mut().zip(&mut self.high_n))
        {
            *low = mean - (mean - *low).hypot(Z90 * sd);
            *high = mean + (*high - mean).hypot(Z90 * sd);
        }
    }
}

/// Predicts a recording from its motion alone.
#[must_use]
pub fn predict_force(
    population: &Population,
    run: &SegmentedRecording,
    day: Option<usize>,
    draws: usize,
) -> PredictedForce {
    let r = &run.recording;
    let forces: Vec<(Vec<f64>, f64)> = (1..=draws).filter_map(|k| force(population, run, k, day)).collect();
    if forces.is_empty() {
        return PredictedForce::default();
    }
    let mut out = PredictedForce::default();
    let mut all = Vec::with_capacity(forces.len() * QUANTILES);
    for i in 0..r.len() {
        out.mean_n.push(forces.iter().map(|f| f.0[i]).sum::<f64>() / forces.len() as f64);
        all.clear();
        for (force, first_s) in &forces {
            let part = phase_at(run, r.time_s[i], *first_s) as usize;
            let pieces = if force[i] == 0.0 {
                &population.air_quantiles_n
            } else {
                &population.residual_quantiles_n[part]
            };
            all.extend(pieces.iter().map(|left| force[i] + left));
        }
        let n = all.len();
        let (low, high) = (n / 20, n - 1 - n / 20);
        all.select_nth_unstable_by(low, f64::total_cmp);
        out.low_n.push(all[low]);
        all.select_nth_unstable_by(high, f64::total_cmp);
        out.high_n.push(all[high]);
    }
    if let Some(sd_n) = population
        .parameter_information
        .as_ref()
        .filter(|_| day.is_none())
        .and_then(|o| open_n(population, o, run))
    {
        out.widen(&sd_n);
    }
    out
}

/// Standard deviation (N) that the fit leaves open of a force, by its derivatives along the numbers of the law.
fn open_n(
    population: &Population,
    open: &(Vec<Parameter>, CholeskyFactor),
    run: &SegmentedRecording,
) -> Option<Vec<f64>> {
    let (numbers, factor) = open;
    let mut law = population.model.clone();
    (law.per_recording, law.day_of) = (vec![RecordingParameters::default()], vec![law.days.len()]);
    law.days.push(DayParameters::default());
    law.rupture_times_s = vec![vec![NO_RUPTURE; law.layers()]];
    let here = simulate_force(&law, run)?.0;
    let slopes: Option<Vec<Vec<f64>>> = numbers
        .iter()
        .map(|n| {
            let x = law.get(n.role, 0);
            let step = if x + n.step > n.high { -n.step } else { n.step };
            let mut there = law.clone();
            there.set(n.role, 0, x + step);
            Some(simulate_force(&there, run)?.0.iter().zip(&here).map(|(t, h)| (t - h) / step).collect())
        })
        .collect();
    let slopes = slopes?;
    let sd = |i: usize| {
        let mut along = vec![0.0; factor.size()];
        along.iter_mut().zip(&slopes).for_each(|(a, s)| *a = s[i]);
        factor.forward_substitute(&along).iter().map(|y| y * y).sum::<f64>().sqrt()
    };
    Some((0..here.len()).map(sd).collect())
}

/// Friction along the shaft as the mean law has it, which is told sample by sample how many layers have given way: what a compensation may
/// take from a measured force at every instant.
#[must_use]
pub fn friction_model(population: &Population, recording: &Recording) -> Option<ShaftFriction> {
    let mut model = population.model.clone();
    model.per_recording = vec![RecordingParameters::default()];
    model.day_of = Vec::new();
    Some(ShaftFriction::new(model.compile(0)?.law, &[], recording.sample_hz()))
}

#[cfg(test)]
mod tests {
    use super::{
        DRAWS, InsertionPhase, PRIMES, Population, draw_force, friction_model, halton, normal_quantiles,
        phase_at, pieces_of, predict_force, single,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use crate::test_fixtures;
    use std::sync::Arc;
    use stylet_identify::model::{Assumptions, DayParameters, EffectTerm, Model, NO_RUPTURE};
    use stylet_record::Recording;
    use stylet_stats::normal::quantile;
    use stylet_stats::student_t;
    use stylet_tissue::{
        DelayedPuncture, DriveFriction, Effect, ForceDrift, ForceLaw, ForceLawState, Layer, PositionScale,
        ReleaseDepth, ShaftSlip, TimeDelay, Tissue,
    };

    #[test]
    fn halton_points_are_digits_mirrored_at_the_point() {
        // 6 is 110 in base two, 11 is 102 in base three, 23 is 43 in base five.
        assert_eq!(halton(6, 2), 0.375);
        assert!((halton(11, 3) - (2.0 / 3.0 + 1.0 / 27.0)).abs() < 1e-15);
        assert!((halton(23, 5) - (3.0 / 5.0 + 4.0 / 25.0)).abs() < 1e-15);
        assert_eq!(halton(0, 7), 0.0);
    }

    fn tissue() -> Tissue {
        let layer = |k: f64, f: f64| Layer {
            name: String::new(),
            thickness_m: 0.02,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 4000.0,
            puncture_n: Some(f),
        };
        Tissue { surface_m: 0.002, layers: vec![layer(150.0, 1.1), layer(220.0, 1.9)] }
    }

    fn population() -> Population {
        let belief = Assumptions {
            tissue: tissue(),
            known_effects: Vec::new(),
            tolerance: vec![0.3; 2],
            thickness_tolerance: vec![0.1; 2],
            surface_tolerance_m: 0.01,
        };
        let mut law = Model::base(Arc::new(belief), 0);
        (law.scatter.surface_m, law.scatter.ln_friction, law.scatter.rupture_force) = (3e-4, 0.07, 0.05);
        (law.scatter.day_surface_m, law.scatter.day_ln_friction) = (7e-4, 0.11);
        (
            law.free.recording_surface,
            law.free.recording_friction,
            law.free.day_surface,
            law.free.day_friction,
        ) = (true, true, true, true);
        law.days = vec![DayParameters { surface_m: 1e-3, ln_friction: 0.2 }];
        let residual_n = [0.03, 0.05, 0.02, 0.07];
        let pieces_n = residual_n.map(normal_quantiles);
        Population {
            model: law,
            residual_n,
            residual_quantiles_n: pieces_n,
            air_quantiles_n: normal_quantiles(0.01),
            recordings: 5,
            days: 1,
            parameter_information: None,
        }
    }

    /// In by 30 mm in 6 s, a rest of 2 s, and back.
    fn run() -> SegmentedRecording {
        let t: Vec<f64> = (0..700).map(|k| 0.02 * f64::from(k)).collect();
        let z = t.iter().map(|t| {
            if *t < 6.0 {
                0.005 * t
            } else if *t < 8.0 {
                0.03
            } else {
                0.03 - 0.005 * (t - 8.0)
            }
        });
        let z: Vec<f64> = z.collect();
        let f = z.iter().map(|z| 100.0 * z).collect();
        SegmentedRecording::new("one".to_owned(), Recording::new(t, z, f).expect("clean columns"), 2)
    }

    /// Every number that varies has a dimension of the Halton sequence of its own, in the order surface, friction, each layer's force, the
    /// numbers of effects, the day: Student's, wider by what a mean and a spread of so many leave open.
    #[test]
    fn a_drawn_insertion_has_its_numbers_by_the_points_of_a_sequence() {
        let mut p = population();
        let wide = (6.0_f64 / 4.0).sqrt();
        // Four numbers vary, each told by five recordings.
        let n = |k: usize, dimension: usize| student_t::quantile(halton(k, PRIMES[dimension]), 16.0) * wide;
        // One day, and four more that are expected.
        let day = |k: usize, dimension: usize| {
            student_t::quantile(halton(k, PRIMES[dimension]), 4.0) * 2.0_f64.sqrt()
        };
        for k in [1, 7, 50] {
            let m = p.draw(k, None);
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{k}: {a} for {b}");
            near(m.per_recording[0].surface_m, 3e-4 * n(k, 0));
            near(m.per_recording[0].ln_friction, 0.07 * n(k, 1));
            near(m.tissue.layers[0].puncture_n.unwrap_or(0.0), 1.1 * (1.0 + 0.05 * n(k, 2)));
            near(m.tissue.layers[1].puncture_n.unwrap_or(0.0), 1.9 * (1.0 + 0.05 * n(k, 3)));
            near(m.days[1].surface_m, 7e-4 * day(k, 4));
            near(m.days[1].ln_friction, 0.11 * day(k, 5));
            assert_eq!(
                (m.day_of.as_slice(), m.rupture_times_s.as_slice()),
                (&[1][..], &[vec![NO_RUPTURE; 2]][..])
            );
            assert_eq!(p.draw(k, Some(0)).day_of, [0]);
            assert_eq!(p.draw(k, Some(0)).days.len(), 1);
        }
        // A mean of two or one is as open as one of two.
        p.recordings = 1;
        let open =
            p.draw(7, None).per_recording[0].surface_m / (3e-4 * student_t::quantile(halton(7, 2), 4.0));
        assert!((open - 3.0_f64.sqrt()).abs() < 1e-12, "{open}");
        // Days by what they are.
        p.days = 3;
        let open =
            p.draw(7, None).days[1].surface_m / (7e-4 * student_t::quantile(halton(7, PRIMES[4]), 6.0));
        assert!((open - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{open}");
        p.days = 1;
        p.recordings = 5;
        p.model.free = stylet_identify::model::FreeParameters::default();
        let m = p.draw(7, None);
        assert_eq!(
            (
                m.per_recording[0].surface_m,
                m.per_recording[0].ln_friction,
                m.days[1].surface_m,
                m.days[1].ln_friction
            ),
            (0.0, 0.0, 0.0, 0.0)
        );
        // Forces never fall below a fifth.
        p.model.scatter.rupture_force = 9.0;
        let k = (1..200).find(|k| halton(*k, PRIMES[2]) < 0.2).expect("a low point");
        assert!((p.draw(k, None).tissue.layers[0].puncture_n.unwrap_or(0.0) - 0.22).abs() < 1e-12);
    }

    #[test]
    fn what_effects_say_of_a_layers_strength_is_drawn_with_it() {
        let mut p = population();
        let effects: [stylet_tissue::AnyEffect; 3] = [
            ShaftSlip { layer: 1, push_n: 1.0, ..ShaftSlip::default() }.into(),
            DelayedPuncture { layer: 2, force_n: 2.0, exponent: 9.0 }.into(),
            ReleaseDepth { layer: 1, depth_m: 1e-3 }.into(),
        ];
        p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        p.model.free.recording_effects = true;
        p.model.scatter.varying[0] = 4e-4;
        let m = p.draw(9, Some(0));
        let wide = (6.0_f64 / 4.0).sqrt();
        let n = |dimension: usize| student_t::quantile(halton(9, PRIMES[dimension]), 20.0) * wide;
        let force = m.effects[1].values[1];
        assert!((force - 2.0 * (1.0 + 0.05 * n(3))).abs() < 1e-12, "{force}");
        let differing = p.model.varying_parameters().count();
        assert!(differing > 0);
        for k in 0..differing {
            assert!((m.per_recording[0].varying[k] - p.model.varying_sd(k) * n(4 + k)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_drawn_force_is_that_of_the_law_moved_as_the_run_was() {
        let p = population();
        let run = run();
        let m = p.draw(3, Some(0));
        let mut there = m.tissue.clone();
        there.surface_m += m.per_recording[0].surface_m + 1e-3;
        for layer in &mut there.layers {
            layer.friction_ns_per_m2 *= (m.per_recording[0].ln_friction + 0.2).exp();
        }
        let law = ForceLaw::new(&there, &[]).expect("a law");
        let mut state = ForceLawState::default();
        let r = &run.recording;
        let told = draw_force(&p, &run, 3, Some(0)).expect("a force");
        for i in 0..r.len() {
            let f = law.step(&mut state, r.time_s[i], r.position_m[i], r.velocity_mps[i], |_| {}).total_n;
            assert!((told[i] - f).abs() < 1e-9, "{i}: {} for {f}", told[i]);
        }
    }

    /// The band of a day that took no part knows what the fit leaves open of the law, that of a known day does not.
    #[test]
    fn a_day_that_took_no_part_is_told_less_surely() {
        let all = test_fixtures::simulated_recordings(&[], &[[0.008, 1e-4], [0.008, -1e-4], [0.016, 0.0]]);
        let runs: Vec<&SegmentedRecording> = all.iter().collect();
        let fitted = test_fixtures::fit_from_truth(&[], &runs);
        let plain = Population::from_fit(&fitted, &runs);
        let open = plain.clone().with_parameter_uncertainty(&fitted);
        let wide = |p: &Population, day| {
            let told = predict_force(p, runs[0], day, 8);
            (told.high_n[150] - told.low_n[150], told.mean_n)
        };
        assert_eq!(wide(&open, Some(0)), wide(&plain, Some(0)));
        let (told, without) = (wide(&open, None), wide(&plain, None));
        assert!(told.0 > 1.001 * without.0 && told.1 == without.1, "{} {}", told.0, without.0);
        assert!(told.0 < 2.0 * without.0);
    }

    #[test]
    fn parts_of_an_insertion_follow_one_another() {
        let run = run();
        let t = &run.recording.time_s;
        let (deepest, back) = (t[run.phases.deepest], t[run.phases.retraction]);
        for (at, first, wanted) in [
            (2.0, 3.0, InsertionPhase::Loading),
            (3.0, 3.0, InsertionPhase::Cutting),
            (deepest, 3.0, InsertionPhase::Cutting),
            (deepest, NO_RUPTURE, InsertionPhase::Loading),
            (deepest + 1e-6, 3.0, InsertionPhase::Hold),
            (back - 1e-6, 3.0, InsertionPhase::Hold),
            (back, 3.0, InsertionPhase::Retraction),
            (99.0, NO_RUPTURE, InsertionPhase::Retraction),
        ] {
            assert_eq!(phase_at(&run, at, first), wanted, "{at}");
        }
    }

    #[test]
    fn single_samples_scatter_about_a_line_through_eight() {
        // Alternating noise of 0.02 about a ramp: about the line of eight its mean square is 0.02^2 (1 - 64/1344 ... ) by hand below.
        let t: Vec<f64> = (0..83).map(|k| 0.1 * f64::from(k)).collect();
        let f: Vec<f64> = t
            .iter()
            .enumerate()
            .map(|(k, t)| 1.0 + 0.3 * t + if k % 2 == 0 { 0.02 } else { -0.02 })
            .collect();
        let r = Recording::new(t, vec![0.0; 83], f).expect("clean columns");
        // sum (k - 3.5)(-1)^k = -4 over sum (k - 3.5)^2 = 42: the line takes 16/42 of 8.
        let wanted = 0.02 * ((8.0 - 16.0 / 42.0) / 8.0_f64 * 8.0 / 6.0).sqrt();
        assert!((single(&r) / wanted - 1.0).abs() < 1e-9, "{} for {wanted}", single(&r));
    }

    /// With the noise alone the band is that of nine of ten of ten pieces each, in air as the sensor is.
    #[test]
    fn the_band_holds_nine_of_ten_of_what_was_drawn_and_of_what_is_left() {
        let mut p = population();
        let run = run();
        let first = |k: usize| super::force(&p, &run, k, Some(0)).expect("a force");
        let forces: Vec<(Vec<f64>, f64)> = (1..=12).map(first).collect();
        let told = predict_force(&p, &run, Some(0), 12);
        let beyond = (6.0_f64 / 4.0).sqrt();
        assert!((p.beyond() - beyond).abs() < 1e-15);
        for i in [5, 120, 250, 340, 600] {
            let mean = forces.iter().map(|f| f.0[i]).sum::<f64>() / 12.0;
            assert!((told.mean_n[i] - mean).abs() < 1e-12);
            let mut all = Vec::new();
            for (f, at) in &forces {
                let left = p.residual_n[phase_at(&run, run.recording.time_s[i], *at) as usize];
                let left = if f[i] == 0.0 { 0.01 } else { left };
                for share in [0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95] {
                    all.push(f[i] + left * quantile(share));
                }
            }
            all.sort_by(f64::total_cmp);
            assert!((told.low_n[i] - all[6]).abs() < 1e-9 && (told.high_n[i] - all[113]).abs() < 1e-9, "{i}");
        }
        // In air: nine of ten of the sensor's noise.
        assert!(
            (told.high_n[5] - told.mean_n[5] - 0.01 * quantile(0.95)).abs() < 1e-12 && forces[0].0[5] == 0.0
        );
        p.recordings = 2;
        assert!((p.beyond() - 3.0_f64.sqrt()).abs() < 1e-15);
        assert!(predict_force(&p, &run, Some(0), 0).mean_n.is_empty());
        assert_eq!(DRAWS, 64);
    }

    /// By hand: of sizes 0 to 10 a tenth lies below 1, and so on; noise of 1 adds 0.1257 to 1.6449 of a normal distribution.
    #[test]
    fn what_is_left_is_drawn_as_it_is_distributed() {
        let left: Vec<f64> =
            (0..=10).map(|k| if k % 2 == 0 { f64::from(k) } else { -f64::from(k) }).collect();
        let near = |told: [f64; 10], wanted: [f64; 5]| {
            for k in 0..5 {
                let (low, high) = (told[4 - k], told[5 + k]);
                assert!((high - wanted[k]).abs() < 1e-3 && (low + wanted[k]).abs() < 1e-3, "{told:?}");
            }
        };
        let noise = [0.1257, 0.3853, 0.6745, 1.0364, 1.6449];
        near(pieces_of(&left, 0.0), [1.0, 3.0, 5.0, 7.0, 9.0]);
        near(pieces_of(&left, 1.0), std::array::from_fn(|k| f64::hypot(2.0 * k as f64 + 1.0, noise[k])));
        near(pieces_of(&[], 1.0), noise);
        // Few large ones make the band no wider, as they would by their root mean square.
        let spikes: Vec<f64> = left.iter().map(|e| if e.abs() < 10.0 { *e } else { 100.0 * e }).collect();
        near(pieces_of(&spikes, 0.0), [1.0, 3.0, 5.0, 7.0, 9.0]);
    }

    #[test]
    fn friction_is_that_of_the_mean_law_with_layers_that_rupture_when_told() {
        let mut p = population();
        let run = run();
        let r = &run.recording;
        // Behind a rupture the tissue holds the shaft.
        let slips: [stylet_tissue::AnyEffect; 2] =
            [1, 2].map(|layer| ShaftSlip { layer, push_n: 1.0, ..ShaftSlip::default() }.into());
        p.model.effects = slips.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        let law = ForceLaw::new(&tissue(), &slips).expect("a law");
        for instants in [vec![], vec![2.5], vec![2.5, 5.0]] {
            let mut told = friction_model(&p, r).expect("friction");
            let mut state = ForceLawState::default();
            for i in 0..r.len() {
                let (t, z, v) = (r.time_s[i], r.position_m[i], r.velocity_mps[i]);
                let count = instants.iter().filter(|at| **at <= t).count();
                let f = law.step_imposed(&mut state, t, z, v, count, |_| {});
                let wanted = if v < 0.0 { f.friction_n } else { f.total_n - f.tip_n };
                assert!((told.step(t, z, v, count) - wanted).abs() < 1e-12, "{instants:?} {i}");
            }
        }
    }

    /// Root mean squares of the blocks compared in each part, with the noise that blocks average away.
    #[test]
    fn what_a_law_leaves_is_told_part_by_part() {
        let all = test_fixtures::simulated_recordings(&[], &[[0.004, 0.0], [0.008, 0.0]]);
        let runs: Vec<&SegmentedRecording> = all.iter().collect();
        let mut fitted = test_fixtures::fit_from_truth(&[], &runs);
        for (r, e) in fitted.fit.residuals.residual_n.iter_mut().enumerate() {
            e.iter_mut().enumerate().for_each(|(k, e)| *e = 1e-3 * ((k * (r + 3)) % 17) as f64);
        }
        let mut blocks = fitted.data.recordings.to_vec();
        blocks[1].used[20..30].fill(false);
        fitted.data = fitted.data.with_recordings(blocks);
        let noise_n = 0.5 * (single(&all[0].recording) + single(&all[1].recording));
        // Two blocks of the way in where the law had no force.
        for k in 3..5 {
            fitted.fit.residuals.residual_n[0][k] = fitted.data.recordings[0].force_n[k];
        }
        let told_so = |r: usize, k: usize| (r, k) != (0, 3) && (r, k) != (0, 4);
        let air: Vec<f64> = fitted.data.recordings[0].force_n[3..5].to_vec();
        let told = Population::from_fit(&fitted, &runs);
        assert_eq!(told.air_quantiles_n, pieces_of(&air, noise_n));
        for wanted in [
            InsertionPhase::Loading,
            InsertionPhase::Cutting,
            InsertionPhase::Hold,
            InsertionPhase::Retraction,
        ] {
            let mut e = Vec::new();
            for (r, b) in fitted.data.recordings.iter().enumerate() {
                let first = fitted.fit.model.rupture_times_s[r][0];
                let here = |k: &usize| {
                    told_so(r, *k) && phase_at(runs[r], 0.5 * (b.start_s[*k] + b.end_s[*k]), first) == wanted
                };
                e.extend(
                    (0..b.len())
                        .filter(|k| b.used[*k])
                        .filter(here)
                        .map(|k| fitted.fit.residuals.residual_n[r][k]),
                );
            }
            assert!(e.len() > 10, "{wanted:?}");
            let square = e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64 + noise_n * noise_n;
            assert!((told.residual_n[wanted as usize] - square.sqrt()).abs() < 1e-12, "{wanted:?}");
            assert_eq!(told.residual_quantiles_n[wanted as usize], pieces_of(&e, noise_n), "{wanted:?}");
        }
        assert_eq!((told.recordings, told.model.per_recording.len()), (2, 0));
    }

    /// The scale of the position acts on way and speed, and what is measured is what a drive adds to the tissue's force.
    #[test]
    fn a_drawn_force_is_measured_as_the_instrument_measures() {
        let run = run();
        let with = |effects: &[stylet_tissue::AnyEffect]| {
            let mut p = population();
            p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
            draw_force(&p, &run, 3, Some(0)).expect("a force")
        };
        let plain = with(&[]);
        let drive = with(&[DriveFriction { force_n: 0.3 }.into()]);
        let r = &run.recording;
        let moving = |i: &usize| r.velocity_mps[*i].abs() > 1e-3;
        for i in (0..r.len()).filter(moving) {
            let wanted = plain[i] + 0.3 * r.velocity_mps[i].signum();
            assert!((drive[i] - wanted).abs() < 1e-9, "{i}: {} for {wanted}", drive[i]);
        }
        let drift = with(&[ForceDrift { rate_n_per_s: 0.05 }.into()]);
        for (i, t) in r.time_s.iter().enumerate() {
            assert!((drift[i] - plain[i] - 0.05 * t).abs() < 1e-9, "{i}: {}", drift[i]);
        }
        // What is written down is too long by a tenth.
        let scaled = with(&[PositionScale { eps: 0.1 }.into()]);
        let mut shorter = run.clone();
        let scale = Model {
            effects: vec![EffectTerm::new(PositionScale { eps: 0.1 }.info(), &[0.1])],
            ..population().model
        };
        let to_true = scale.compile(0).expect("a law").true_over_recorded;
        assert!((to_true - 1.0).abs() > 0.05, "{to_true}");
        shorter.recording.position_m.iter_mut().for_each(|z| *z *= to_true);
        shorter.recording.velocity_mps.iter_mut().for_each(|v| *v *= to_true);
        let wanted = draw_force(&population(), &shorter, 3, Some(0)).expect("a force");
        assert!(scaled.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    /// Nearly twice as many samples a second come on the way in as behind it.
    #[test]
    fn a_force_comes_late_by_the_same_time_where_samples_come_faster() {
        let at = |k: i32| f64::from(k.min(216)) / 36.0 + f64::from((k - 216).max(0)) / 20.0;
        let t: Vec<f64> = (0..1200).map(at).collect();
        let z: Vec<f64> = t.iter().map(|t| (0.005 * t).min(0.03)).collect();
        let n = t.len();
        let run = SegmentedRecording::new(
            "a".to_owned(),
            Recording::new(t, z, vec![0.0; n]).expect("clean columns"),
            2,
        );
        let with = |effects: &[stylet_tissue::AnyEffect]| {
            let mut p = population();
            p.model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
            draw_force(&p, &run, 3, Some(0)).expect("a force")
        };
        let (plain, late) = (with(&[]), with(&[TimeDelay { delay_s: 2.0 }.into()]));
        for i in 73..216 {
            assert!((late[i] - plain[i - 72]).abs() < 1e-6, "{i}: {} for {}", late[i], plain[i - 72]);
        }
        assert!(late[200] < plain[200] - 0.1);
    }
}
