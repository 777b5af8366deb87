//! The fit of a set from several starts: the objective has many optima, and one start in three finds the best.

use crate::repeated_insertions::start_values::{
    EXPECTED_DAY_FRICTION_SD, EXPECTED_DAY_SURFACE_SD_M, SLIP_RATE_INDEX, SPEED_TOLERANCE,
    SegmentedRecording, StartValues, shaft_slip_start,
};
use rand::{RngExt, rngs::ChaCha8Rng};
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::discrepancy_noise::discrepancy_noise;
use stylet_identify::fit::{Effort, Fit, Linearization, fit_nonsmooth};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, Model, ParameterRole};
use stylet_identify::noise::Noise;
use stylet_identify::update_event_times::update_event_times;
use stylet_record::sensor_artefacts::SensorArtefacts;
use stylet_tissue::{AnyEffect, Effect, Tissue};

/// Length of the blocks of a set in s: insertions repeat no better.
pub const SET_BLOCK_S: f64 = 0.08;
/// Starts look at blocks so many times as long.
const COARSE: usize = 3;
/// The first fits see misfits of this share of the largest force as noise.
const FIRST_SHARE: f64 = 0.1;
/// The spread between days that is expected counts as that of so many days.
pub(super) const PRIOR_DAYS: f64 = 4.0;
/// Turns of the fits of a first look, and of those that go on;
const FIRST_LOOK: [usize; 2] = [6, 6];
/// the latter start from numbers that stand.
const LONG_LOOK: [usize; 2] = [6, 8];
/// So many starts go on.
const GO_ON: usize = 8;
/// So many fits that differ by more than a share are looked at closely,
const FEW_FITS: usize = 4;
/// that share,
const SAME: f64 = 0.002;
/// if they leave less than so many times what the best one leaves.
const WITHIN: f64 = 1.4;
/// Fits agree when their errors differ by less than this share.
const AGREE: f64 = 0.03;

/// A set that is fitted.
#[derive(Clone, Debug)]
pub struct SetFit {
    /// The fit.
    pub fit: Fit,
    /// The recordings, and what is left as noise.
    pub data: FitData,
    /// Instants (s) of the drops of every recording.
    pub drop_times_s: Vec<Vec<f64>>,
    /// Starts, and how many of them came to the same error.
    pub starts: (usize, usize),
}

impl SetFit {
    /// Root mean square in N of what the fit leaves with the ruptures where they were seen.
    #[must_use]
    pub fn rms_n(&self) -> f64 {
        self.fit.rms_n(&self.data)
    }

    /// The same recordings with another law, fitted from where it stands.
    #[must_use]
    pub fn refit_with(&self, model: &Model) -> Option<Self> {
        let (fit, data) = fit_with_noise_updates(model, self.data.clone(), &self.drop_times_s, &[6])?;
        Some(Self { fit, data, drop_times_s: self.drop_times_s.clone(), starts: self.starts })
    }
}

/// The recordings in blocks, without the samples that the raw force excludes.
#[must_use]
pub fn set_blocks(runs: &[&SegmentedRecording], raw: &SensorArtefacts) -> Vec<BlockAverages> {
    let none = Vec::new();
    runs.par_iter()
        .enumerate()
        .map(|(r, run)| BlockAverages::new(&run.recording, raw.exclude.get(r).unwrap_or(&none), SET_BLOCK_S))
        .collect()
}

/// The first noise: misfits of a share of the largest force.
fn unsettled(blocks: Vec<BlockAverages>) -> FitData {
    let largest = blocks.iter().flat_map(|b| &b.abs_force_n).fold(1e-6_f64, |m, f| m.max(*f));
    FitData::new(Arc::new(blocks), Noise::white(FIRST_SHARE * largest), 1e-3)
}

/// A model fitted to recordings from where it stands, by the set's own noise.
#[must_use]
pub fn fit_from(model: &Model, blocks: Vec<BlockAverages>, drops: Vec<Vec<f64>>) -> Option<SetFit> {
    let (fit, data) = fit_with_noise_updates(model, unsettled(blocks), &drops, &[6, 8])?;
    Some(SetFit { fit, data, drop_times_s: drops, starts: (1, 1) })
}

/// What start `k` begins with: the first in the middle of what is thought possible, the others anywhere in it.
fn guess(k: usize, rng: &mut ChaCha8Rng) -> StartValues {
    let mut within = |(low, high): (f64, f64)| {
        let drawn = rng.random::<f64>();
        low + (high - low) * if k == 0 { 0.5 } else { drawn }
    };
    let mut times = |(low, high): (f64, f64)| libm::exp(within((libm::log(low), libm::log(high))));
    let (exponent, fast, slow, waits) =
        (times((4.0, 18.0)), times((0.03, 3.0)), times((4.0, 20.0)), times((6.0, 20.0)));
    StartValues {
        linear_share: within((0.1, 0.9)),
        hold_ratio: within((0.3, 0.9)),
        pull_ratio: within((0.3, 0.9)),
        kept_share: within((0.4, 1.0)),
        exponent,
        wear_per_m: [within((0.0, 80.0)), within((0.0, 120.0))],
        rate: within((-0.3, 0.1)),
        fractions: [within((0.02, 0.4)), within((0.02, 0.4))],
        time_constants_s: [fast, slow],
        delay_exponent: waits,
        surface_m: within((-1.5e-3, 5e-4)),
        // Deeper layers rupture where the force drops, or shortly behind their front without a drop of their own.
        rupture_depth_m: Some(within((-4e-3, 6e-3))).filter(|m| *m > 0.0),
    }
}

/// Fits in rounds, the noise being what the round before has left.
#[must_use]
pub fn fit_with_noise_updates(
    model: &Model,
    data: FitData,
    drops: &[Vec<f64>],
    rounds: &[usize],
) -> Option<(Fit, FitData)> {
    let mut data = data;
    let mut best: Option<Fit> = None;
    for turns in rounds {
        let mut from = best.as_ref().map_or(model, |b| &b.model).clone();
        across(&mut from, &data);
        if let Some(best) = &best {
            data = data.with_noise(discrepancy_noise(
                &data.recordings,
                &best.residuals.residual_n,
                data.floor_n,
            ));
            update_event_times(&mut from, &data, drops);
            spreads(&mut from, &data, best);
        }
        best = Some(fit_nonsmooth(&from, &data, Effort { max_iterations: *turns, min_gain_nats: 0.05 })?);
    }
    let best = best?;
    data = data.with_noise(discrepancy_noise(&data.recordings, &best.residuals.residual_n, data.floor_n));
    Some((best, data))
}

/// Logarithm of the speed (in mm/s) of an advance.
fn ln_speed(blocks: &BlockAverages) -> f64 {
    let fastest = blocks.pieces.iter().map(|p| p.velocity_mps).fold(0.0, f64::max);
    let advance = blocks.pieces.iter().map(|p| p.velocity_mps).filter(|v| *v > 0.5 * fastest);
    libm::log(1e3 * stylet_stats::median_of(advance))
}

/// Gives what friction does from day to day along the logarithm of their speeds to the rate of the hold: that is the same force with days
/// that differ least, and a fit hardly moves along such a valley.
fn across(model: &mut Model, data: &FitData) {
    let held = |e: usize| {
        model.tied.iter().any(|b| (b.effect, b.parameter, b.tied_to) == (e, SLIP_RATE_INDEX, None))
    };
    let slips = |e: &usize| matches!(model.effects[*e].effect(), Some(AnyEffect::ShaftSlip(_)));
    let which: Vec<usize> = (0..model.effects.len()).filter(slips).collect();
    let speed =
        |day| model.day_of.iter().position(|d| *d == day).and_then(|r| data.recordings.get(r)).map(ln_speed);
    let days: Vec<(usize, f64)> =
        (0..model.days.len()).filter_map(|d| Some((d, speed(d).filter(|x| x.is_finite())?))).collect();
    let n = days.len() as f64;
    let (x, y) =
        days.iter().fold((0.0, 0.0), |(x, y), (d, s)| (x + s / n, y + model.days[*d].ln_friction / n));
    let (square, product) = days.iter().fold((0.0, 0.0), |(square, product), (d, s)| {
        (square + (s - x).powi(2), product + (s - x) * model.days[*d].ln_friction)
    });
    if which.is_empty()
        || which.iter().any(|e| held(*e))
        || square < libm::log1p(SPEED_TOLERANCE).powi(2) / 2.0
    {
        return;
    }
    let slope = product / square;
    let level = y - slope * x;
    days.iter().for_each(|(d, s)| model.days[*d].ln_friction -= level + slope * s);
    for e in which {
        let choice = &model.effects[e];
        if let Some(AnyEffect::ShaftSlip(mut s)) = choice.effect() {
            s.scale_friction(libm::exp(level));
            s.rate += slope;
            model.effects[e] = EffectTerm::new(choice.info, &AnyEffect::from(s).parameters());
        }
    }
}

/// Spreads between recordings and between days as a fit tells them: the mean square of the numbers and of what the data leave open
/// of them (expectation maximisation with the fit's own curvature), so that a number nobody can see keeps the spread that it had.
fn spreads(model: &mut Model, data: &FitData, at: &Fit) {
    let tangent = Linearization::new(&at.model, data, &at.residuals);
    let (recordings, own) = (data.recording_count(), tangent.per_recording.len());
    let conditional = |places: &[usize]| -> Vec<f64> {
        let factor = tangent.normal_matrix.submatrix(places).cholesky();
        (0..places.len())
            .map(|i| {
                let unit: Vec<f64> = (0..places.len()).map(|j| f64::from(u8::from(i == j))).collect();
                factor.solve(&unit)[i].max(0.0)
            })
            .collect()
    };
    let mut sums = vec![(0.0, 0.0); own];
    for r in 0..recordings {
        // An instant that never was moves nothing.
        let moves: Vec<usize> = (0..own)
            .filter(|o| tangent.normal_matrix.at(tangent.index_of(*o, r), tangent.index_of(*o, r)) > 0.0)
            .collect();
        let places: Vec<usize> = moves.iter().map(|o| tangent.index_of(*o, r)).collect();
        for (o, variance) in moves.iter().zip(conditional(&places)) {
            let x = at.model.get(tangent.per_recording[*o].role, r);
            sums[*o].0 += x * x + variance;
            sums[*o].1 += 1.0;
        }
    }
    for (n, (sum, count)) in tangent.per_recording.iter().zip(&sums) {
        let sd = (sum / f64::max(*count, 1.0)).sqrt();
        match n.role {
            ParameterRole::RecordingSurface => model.scatter.surface_m = sd,
            ParameterRole::RecordingFriction => model.scatter.ln_friction = sd,
            ParameterRole::RecordingEffect(k) => model.scatter.varying[k] = sd,
            _ => {}
        }
    }
    let mut days = [(0.0, 0.0); 2];
    for (i, n) in tangent.shared.iter().enumerate() {
        let kind = match n.role {
            ParameterRole::DaySurface(_) => 0,
            ParameterRole::DayFriction(_) => 1,
            _ => continue,
        };
        days[kind].0 += model.get(n.role, 0).powi(2) + conditional(&[i])[0];
        days[kind].1 += 1.0;
    }
    // Few days tell little of their spread: what is expected of it counts as much as some more days.
    let spread = |(sum, n): (f64, f64), expected: f64| {
        ((sum + PRIOR_DAYS * expected * expected) / (n + PRIOR_DAYS)).sqrt()
    };
    model.scatter.day_surface_m = spread(days[0], EXPECTED_DAY_SURFACE_SD_M);
    model.scatter.day_ln_friction = spread(days[1], EXPECTED_DAY_FRICTION_SD);
}

/// Fits from every start, those that leave least first.
fn from_all(models: &[Model], data: &FitData, drops: &[Vec<f64>], rounds: &[usize]) -> Vec<(f64, Model)> {
    let one = |model: &Model| {
        let (fit, data) = fit_with_noise_updates(model, data.clone(), drops, rounds)?;
        Some((fit.rms_n(&data), fit.model))
    };
    let mut found: Vec<(f64, Model)> = models.par_iter().filter_map(one).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// Of fits that leave so much, the smallest first: how many agree with the best one, and which few differ and are looked at closely.
fn apart(errors: &[f64]) -> (usize, Vec<usize>) {
    let best = errors.first().copied().unwrap_or(f64::NAN);
    let agree = errors.iter().filter(|e| **e < best * (1.0 + AGREE)).count();
    let mut apart: Vec<usize> = Vec::new();
    for (k, e) in errors.iter().enumerate().filter(|(_, e)| **e < best * WITHIN) {
        if apart.len() < FEW_FITS && apart.iter().all(|f| *e > errors[*f] * (1.0 + SAME)) {
            apart.push(k);
        }
    }
    (agree, apart)
}

/// Where `starts` fits of a set begin; `rng` draws it.
#[must_use]
pub fn draw_starts(
    believed: &Tissue,
    runs: &[&SegmentedRecording],
    starts: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Model> {
    (0..starts.max(1)).map(|k| shaft_slip_start(believed, runs, &guess(k, rng))).collect()
}

/// Fits of a set from where they begin: the best few that differ, those that leave least first.
///
/// What leaves least need not predict best: which of them stands is for recordings left out to say. Deterministic for any number of
/// threads.
#[must_use]
pub fn multistart_fit(began: &[Model], runs: &[&SegmentedRecording], raw: &SensorArtefacts) -> Vec<SetFit> {
    let fine = set_blocks(runs, raw);
    let drops: Vec<Vec<f64>> =
        runs.iter().map(|r| r.ruptures_s.iter().copied().filter(|t| t.is_finite()).collect()).collect();
    let coarse = unsettled(fine.iter().map(|b| b.coarsened(COARSE)).collect());
    // Most starts are given up after a look; those that promise most go on.
    let mut found = from_all(began, &coarse, &drops, &FIRST_LOOK);
    found.truncate(GO_ON);
    let promising: Vec<Model> = found.into_iter().map(|f| f.1).collect();
    let found = from_all(&promising, &coarse, &drops, &LONG_LOOK);
    let errors: Vec<f64> = found.iter().map(|f| f.0).collect();
    let (agree, apart) = apart(&errors);
    let whole = unsettled(fine);
    let mut out: Vec<SetFit> = apart
        .par_iter()
        .filter_map(|k| {
            let (fit, data) =
                fit_with_noise_updates(&found[*k].1, whole.clone(), &drops, &[4, 8, 10, 6, 6, 6])?;
            Some(SetFit { fit, data, drop_times_s: drops.clone(), starts: (found.len(), agree) })
        })
        .collect();
    out.sort_by(|a, b| a.rms_n().total_cmp(&b.rms_n()));
    out
}

#[cfg(test)]
mod tests {
    use super::{
        AGREE, SAME, SET_BLOCK_S, SLIP_RATE_INDEX, StartValues, WITHIN, across, apart, fit_from,
        fit_with_noise_updates, guess, set_blocks, spreads, unsettled,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use crate::test_fixtures::{
        SENSOR_NOISE_SD_N, assumed_layers, fit_from_truth, gel_tissue, simulated_recordings,
    };
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use std::sync::Arc;
    use stylet_identify::fit::{Fit, Linearization};
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::{DayParameters, EffectTerm, Model, ParameterRole, TiedParameter};
    use stylet_identify::noise::Noise;
    use stylet_record::sensor_artefacts::SensorArtefacts;
    use stylet_tissue::{AnyEffect, Effect, ReleaseDepth, ShaftSlip};

    /// What a start begins with, each as its place between the ends of what is thought possible: none at the lower one, 1 at the upper.
    fn places(g: &StartValues) -> Vec<f64> {
        let even = |x: f64, low: f64, high: f64| (x - low) / (high - low);
        let by_factors = |x: f64, low: f64, high: f64| (x / low).ln() / (high / low).ln();
        vec![
            even(g.linear_share, 0.1, 0.9),
            even(g.hold_ratio, 0.3, 0.9),
            even(g.pull_ratio, 0.3, 0.9),
            even(g.kept_share, 0.4, 1.0),
            by_factors(g.exponent, 4.0, 18.0),
            even(g.wear_per_m[0], 0.0, 80.0),
            even(g.wear_per_m[1], 0.0, 120.0),
            even(g.rate, -0.3, 0.1),
            even(g.fractions[0], 0.02, 0.4),
            even(g.fractions[1], 0.02, 0.4),
            by_factors(g.time_constants_s[0], 0.03, 3.0),
            by_factors(g.time_constants_s[1], 4.0, 20.0),
            by_factors(g.delay_exponent, 6.0, 20.0),
            even(g.surface_m, -1.5e-3, 5e-4),
        ]
    }

    #[test]
    fn the_first_start_begins_in_the_middle_of_what_is_thought_possible_and_the_others_anywhere_in_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let first = guess(0, &mut rng);
        assert!(places(&first).iter().all(|x| (x - 0.5).abs() < 1e-12), "{:?}", places(&first));
        assert!((first.rupture_depth_m.expect("behind its front") - 1e-3).abs() < 1e-15);
        let all: Vec<StartValues> = (1..=1500).map(|k| guess(k, &mut rng)).collect();
        for place in 0..14 {
            let mut x: Vec<f64> = all.iter().map(|g| places(g)[place]).collect();
            x.sort_by(f64::total_cmp);
            assert!(x[0] >= 0.0 && x[0] < 0.01 && x[1499] <= 1.0 && x[1499] > 0.99, "{place}");
            assert!((x[750] - 0.5).abs() < 0.05, "{place}: {}", x[750]);
        }
        // Six of ten give way behind their front, the others where the force drops.
        let behind: Vec<f64> = all.iter().filter_map(|g| g.rupture_depth_m).collect();
        assert!((behind.len() as f64 / 1500.0 - 0.6).abs() < 0.05, "{}", behind.len());
        assert!(behind.iter().all(|m| *m > 0.0 && *m <= 6e-3) && stylet_stats::mean(&behind) > 2.7e-3);
    }

    #[test]
    fn blocks_of_a_set_are_eight_hundredths_of_a_second_long_and_leave_out_what_the_raw_force_excludes() {
        let all = simulated_recordings(&[], &[[0.004, 0.0], [0.004, 0.0]]);
        let runs: Vec<&SegmentedRecording> = all.iter().collect();
        let n = all[0].recording.len();
        let exclude = vec![(0..n).map(|k| (100..150).contains(&k)).collect()];
        let told = set_blocks(&runs, &SensorArtefacts { exclude, ..SensorArtefacts::default() });
        assert_eq!(told.len(), 2);
        assert!((told[0].end_s[7] - told[0].start_s[7] - SET_BLOCK_S).abs() < 1e-9);
        let left_out = |b: &stylet_identify::block_averages::BlockAverages| {
            (0..b.len()).filter(|k| !b.used[*k]).map(|k| b.end_s[k] - b.start_s[k]).sum::<f64>()
        };
        // A second, but for the blocks at its ends; of the other recording nothing is excluded.
        let more = left_out(&told[0]) - left_out(&told[1]);
        assert!((more - 1.0).abs() < 0.17, "{} {}", left_out(&told[0]), left_out(&told[1]));
        // The first noise is a tenth of the largest force.
        let largest = told.iter().flat_map(|b| &b.abs_force_n).fold(0.0_f64, |m, x| m.max(*x));
        assert!((unsettled(told).noise.sd_n() / (0.1 * largest) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_set_settles_at_its_law_and_at_the_noise_that_it_has() {
        let all = simulated_recordings(&[], &[[0.004, 3e-4], [0.004, -2e-4], [0.008, 1e-4], [0.008, -2e-4]]);
        let runs: Vec<&SegmentedRecording> = all.iter().collect();
        let told = fit_from_truth(&[], &runs);
        let layer = &told.fit.model.tissue.layers[0];
        let gel = &gel_tissue().layers[0];
        assert!((layer.stiffness_n_per_m / gel.stiffness_n_per_m - 1.0).abs() < 0.02, "{layer:?}");
        assert!((layer.friction_ns_per_m2 / gel.friction_ns_per_m2 - 1.0).abs() < 0.02, "{layer:?}");
        // Four samples are averaged in a block.
        let block_n = SENSOR_NOISE_SD_N / 2.0;
        assert!((told.rms_n() / block_n - 1.0).abs() < 0.1, "{}", told.rms_n());
        let sd_n = told.data.noise.sd_n();
        assert!((sd_n / block_n - 1.0).abs() < 0.1, "{sd_n}");
        assert_eq!(told.starts, (1, 1));
        // Where the surfaces of the runs lie apart they are told apart, and so is how much.
        let moved: Vec<f64> = told.fit.model.per_recording.iter().map(|o| o.surface_m).collect();
        for (own, wanted) in moved.iter().zip([3e-4, -2e-4, 1e-4, -2e-4]) {
            assert!((own - wanted).abs() < 2e-5, "{moved:?}");
        }
        let spread = told.fit.model.scatter.surface_m;
        assert!((spread - 2.1e-4).abs() < 3e-5, "{spread}");
        // Another law goes on from there; without a round there is no fit.
        let stiff = told.refit_with(&told.fit.model).expect("a fit");
        assert!((stiff.rms_n() / told.rms_n() - 1.0).abs() < 0.01 && stiff.drop_times_s == told.drop_times_s);
        assert!(
            fit_with_noise_updates(&told.fit.model, told.data.clone(), &told.drop_times_s, &[]).is_none()
        );
        let again = fit_from(&told.fit.model, told.data.recordings.to_vec(), told.drop_times_s.clone())
            .expect("a fit");
        assert!((again.rms_n() / told.rms_n() - 1.0).abs() < 0.01);
    }

    /// A model with numbers of each recording's own, where it stands in recordings that it did not make.
    fn standing(noise_n: f64, change: impl Fn(&mut Model)) -> (Fit, FitData) {
        let all = simulated_recordings(&[], &[[0.004, 0.0], [0.008, 0.0], [0.008, 0.0]]);
        let runs: Vec<&SegmentedRecording> = all.iter().collect();
        let data = FitData::new(
            Arc::new(set_blocks(&runs, &SensorArtefacts::default())),
            Noise::white(noise_n),
            0.0,
        );
        let mut model = Model::base(assumed_layers(&[[0.05, 250.0, 2e4]]), 3);
        change(&mut model);
        let residuals = residuals(&model, &data).expect("a replay");
        (Fit { model, residuals }, data)
    }

    fn near(told: f64, wanted: f64) {
        assert!((told / wanted - 1.0).abs() < 1e-4, "{told} for {wanted}");
    }

    /// Expectation maximisation: the mean of the squares and of the variances that the data leave of them, here by the inverse of two by two.
    #[test]
    fn a_spread_between_recordings_is_that_of_their_numbers_and_of_what_the_data_leave_open() {
        for noise_n in [0.01, 3.0] {
            let (at, data) = standing(noise_n, |m| {
                (m.free.recording_surface, m.free.recording_friction) = (true, true);
                for (own, x) in m.per_recording.iter_mut().zip([[3e-4, -0.02], [-5e-4, 0.07], [1e-4, 0.03]]) {
                    [own.surface_m, own.ln_friction] = x;
                }
            });
            let tangent = Linearization::new(&at.model, &data, &at.residuals);
            let (mut surface, mut friction) = (0.0, 0.0);
            for r in 0..3 {
                let (i, j) = (tangent.index_of(0, r), tangent.index_of(1, r));
                let (a, b, c) = (
                    tangent.normal_matrix.at(i, i),
                    tangent.normal_matrix.at(j, i),
                    tangent.normal_matrix.at(j, j),
                );
                let own = at.model.per_recording[r];
                surface += own.surface_m.powi(2) + c / (a * c - b * b);
                friction += own.ln_friction.powi(2) + a / (a * c - b * b);
            }
            let mut told = at.model.clone();
            spreads(&mut told, &data, &at);
            near(told.scatter.surface_m, (surface / 3.0).sqrt());
            near(told.scatter.ln_friction, (friction / 3.0).sqrt());
            assert_eq!(told.per_recording, at.model.per_recording);
        }
    }

    #[test]
    fn a_number_that_nobody_can_see_keeps_the_spread_that_it_had() {
        // The tissue lies deeper than the needle goes.
        let (at, data) = standing(0.01, |m| {
            (m.free.recording_surface, m.free.recording_friction, m.free.recording_effects) =
                (true, true, true);
            m.tissue.surface_m = 0.1;
            let release: AnyEffect = ReleaseDepth::default().into();
            m.effects = vec![EffectTerm::new(release.info(), &release.parameters())];
            (m.scatter.surface_m, m.scatter.ln_friction, m.scatter.varying[0]) = (7e-4, 0.03, 9e-4);
        });
        let mut told = at.model.clone();
        (told.scatter.surface_m, told.scatter.ln_friction, told.scatter.varying[0]) = (1.0, 1.0, 1.0);
        spreads(&mut told, &data, &at);
        near(told.scatter.surface_m, 7e-4);
        near(told.scatter.ln_friction, 0.03);
        near(told.scatter.varying[0], 9e-4);
    }

    /// What is expected of days counts as four more of them.
    #[test]
    fn few_days_tell_a_spread_between_days_together_with_what_is_expected_of_it() {
        let (at, data) = standing(0.5, |m| {
            (m.free.day_surface, m.free.day_friction) = (true, true);
            m.day_of = vec![0, 1, 1];
            m.days = vec![
                DayParameters { surface_m: 8e-4, ln_friction: -0.06 },
                DayParameters { surface_m: -3e-4, ln_friction: 0.09 },
            ];
        });
        let tangent = Linearization::new(&at.model, &data, &at.residuals);
        let (mut surface, mut friction) = (4.0 * 3e-4 * 3e-4, 4.0 * 0.03 * 0.03);
        for (i, n) in tangent.shared.iter().enumerate() {
            let open = 1.0 / tangent.normal_matrix.at(i, i);
            match n.role {
                ParameterRole::DaySurface(d) => surface += at.model.days[d].surface_m.powi(2) + open,
                ParameterRole::DayFriction(d) => friction += at.model.days[d].ln_friction.powi(2) + open,
                _ => {}
            }
        }
        let mut told = at.model.clone();
        spreads(&mut told, &data, &at);
        near(told.scatter.day_surface_m, (surface / 6.0).sqrt());
        near(told.scatter.day_ln_friction, (friction / 6.0).sqrt());
    }

    /// Two speeds, each on a day of its own: days that differ as the speeds do say the same as a rate does.
    #[test]
    fn friction_that_goes_along_the_speeds_of_the_days_is_the_rates() {
        let slip = ShaftSlip { push_n: 1.0, pull_n: 0.6, rate: 0.1, ..ShaftSlip::default() };
        let friction = |m: &Model| m.days.iter().map(|d| d.ln_friction).collect::<Vec<_>>();
        let (at, data) = standing(0.1, |m| {
            let slip: AnyEffect = slip.clone().into();
            m.effects = vec![EffectTerm::new(slip.info(), &slip.parameters())];
            m.day_of = vec![0, 1, 1];
            m.days = vec![
                DayParameters { ln_friction: 0.2, ..DayParameters::default() },
                DayParameters { ln_friction: -0.1, ..DayParameters::default() },
            ];
        });
        let mut told = at.model.clone();
        across(&mut told, &data);
        // Speeds of 4 and 8 mm/s.
        let slope = -0.3 / 2.0_f64.ln();
        let level = 0.2 - slope * 4.0_f64.ln();
        let [push, rate] = [1, SLIP_RATE_INDEX].map(|k| told.effects[0].values[k]);
        assert!(
            (rate - 0.1 - slope).abs() < 5e-3 && (push / level.exp() - 1.0).abs() < 1e-2,
            "{push} {rate}"
        );
        assert!(friction(&told).iter().all(|f| f.abs() < 1e-12), "{:?}", told.days);
        let same = residuals(&told, &data).expect("a replay");
        let (a, b) = (same.residual_n.concat(), at.residuals.residual_n.concat());
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.02));
        // A rate that is held stays, and at one speed there is nothing to give.
        let mut held = at.model.clone();
        held.tied = vec![TiedParameter { effect: 0, parameter: SLIP_RATE_INDEX, tied_to: None }];
        let mut one = at.model.clone();
        one.day_of = vec![0, 0, 0];
        for mut m in [held, one] {
            let before = m.clone();
            across(&mut m, &data);
            assert_eq!((friction(&m), &m.effects[0].values), (friction(&before), &before.effects[0].values));
        }
    }

    /// Three per cent for agreement, two thousandths for the same, two fifths for being looked at: just as much is too much, or too little.
    #[test]
    fn fits_agree_that_leave_about_the_same_and_the_best_few_that_differ_are_looked_at() {
        assert_eq!(apart(&[2.0, 2.003, 2.005, 2.059, 2.07, 2.79, 2.81]), (4, vec![0, 2, 3, 4]));
        assert_eq!(apart(&[2.0, 2.79, 2.81]), (1, vec![0, 1]));
        assert_eq!(apart(&[2.0, 2.0 * (1.0 + SAME), 2.0 * (1.0 + AGREE), 2.0 * WITHIN]), (2, vec![0, 2]));
        assert_eq!(apart(&[]), (0, vec![]));
    }
}
