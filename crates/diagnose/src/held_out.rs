//! How much better the extended model is on recordings that took no part in the fit.

use crate::varying_coefficient_test::varying_coefficient_test;
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::{FitData, ReplayCache, replay};
use stylet_identify::model::{Model, NO_RUPTURE, RecordingParameters};
use stylet_identify::score_test::ScoreTest;

/// Samples by which a rupture may be early or late without counting as an error.
const FORGIVEN: f64 = 2.0;

/// What is left of one recording.
#[derive(Clone, Debug, Default)]
pub struct FreeRunResidual {
    /// Mean square in N² over the blocks compared.
    pub mean_square_n2: f64,
    /// Blocks compared.
    pub compared_blocks: usize,
    /// Residual of every block in N.
    pub residual_n: Vec<f64>,
    /// The law's own instants in s.
    pub rupture_times_s: Vec<f64>,
}

/// Residual of a model with its own ruptures, each as early or late by a sample or two as fits best.
#[must_use]
pub fn predict_free_run(model: &Model, data: &FitData, r: usize) -> Option<FreeRunResidual> {
    let mut trail = ReplayCache::new(model, data, r)?;
    let b = &data.recordings[r];
    let mut instants = trail.free_rupture_times();
    trail.rebase(data, r, &instants);
    let (first, last) = b.span_s();
    for layer in 0..instants.len() {
        let own = instants[layer];
        if own == NO_RUPTURE {
            continue;
        }
        let mut best = (f64::INFINITY, own);
        for k in [0.0, -0.5, 0.5, -1.0, 1.0, -FORGIVEN, FORGIVEN] {
            instants[layer] = (own + k * b.sample_step_s).clamp(first, last);
            let nats = trail.nats_with_ruptures(model, data, r, &instants);
            if nats < best.0 {
                best = (nats, instants[layer]);
            }
        }
        instants[layer] = best.1;
    }
    let mut at = model.clone();
    at.rupture_times_s[r].clone_from(&instants);
    let predicted = replay(&at, data, r)?;
    let e: Vec<f64> = b.force_n.iter().zip(&predicted.force_n).map(|(y, f)| y - f).collect();
    let kept = e.iter().zip(&b.used).filter(|(_, u)| **u);
    let (square, blocks) = kept.fold((0.0, 0), |(s, n), (e, _)| (s + e * e, n + 1));
    Some(FreeRunResidual {
        mean_square_n2: square / blocks.max(1) as f64,
        compared_blocks: blocks,
        residual_n: e,
        rupture_times_s: instants,
    })
}

/// Predicts every recording from a fit to the others; with one recording the fit itself is used.
#[must_use]
pub fn held_out_residuals(best: &Fit, data: &FitData) -> Vec<Option<FreeRunResidual>> {
    left_out_with(best, data, |_| RecordingParameters::default())
}

/// As [`left_out`], with the numbers of its own (surface, friction) of the recording that is left out granted: what a cause is
/// worth does not hang on where the needle touched.
#[must_use]
pub fn held_out_residuals_with_random_effects(best: &Fit, data: &FitData) -> Vec<Option<FreeRunResidual>> {
    left_out_with(best, data, |r| best.model.per_recording[r])
}

fn left_out_with(
    best: &Fit,
    data: &FitData,
    own: impl Fn(usize) -> RecordingParameters + Sync,
) -> Vec<Option<FreeRunResidual>> {
    let n = data.recording_count();
    (0..n)
        .into_par_iter()
        .map(|r| {
            let mut model = if n < 2 { best.model.clone() } else { without(best, data, r)? };
            if n > 1 {
                model.per_recording[r] = own(r);
            }
            predict_free_run(&model, data, r)
        })
        .collect()
}

/// How a cause fares when one recording is left out of the fit.
#[derive(Clone, Debug)]
pub struct JackknifeResult {
    /// Standard error of its strengths by the jackknife, relative to them; the largest.
    pub relative_se: f64,
    /// Share of what the model without it leaves on left-out recordings, beyond `with`, in mean square.
    pub held_out_gain: f64,
    /// Share of what the fit loses without it that its force would gain by acting otherwise ([`otherwise`](crate::otherwise)).
    pub varying_coefficient_share: f64,
}

/// How the effects of a fit fare on recordings left out; `floor_n` is the noise.
#[must_use]
pub fn jackknife_effects(best: &Fit, data: &FitData, floor_n: f64) -> Vec<JackknifeResult> {
    let n = data.recording_count();
    if n < 2 {
        let none = JackknifeResult { relative_se: 0.0, held_out_gain: 0.0, varying_coefficient_share: 0.0 };
        return vec![none; best.model.effects.len()];
    }
    let square = |left: &[Option<FreeRunResidual>]| {
        let (sum, blocks) = left.iter().flatten().fold((0.0, 0.0), |(s, n), l| {
            (s + l.mean_square_n2 * l.compared_blocks as f64, n + l.compared_blocks as f64)
        });
        sum / f64::max(blocks, 1.0)
    };
    let models: Vec<Option<Model>> = (0..n).into_par_iter().map(|r| without(best, data, r)).collect();
    let with: Vec<Option<FreeRunResidual>> =
        models.iter().enumerate().map(|(r, m)| predict_free_run(m.as_ref()?, data, r)).collect();
    let with = square(&with);
    let look = ScoreTest::new(best, data);
    (0..best.model.effects.len())
        .map(|k| {
            let choice = &best.model.effects[k];
            let mut spread = 0.0_f64;
            for (p, _) in choice.info.parameters.iter().enumerate().filter(|(_, p)| p.strength) {
                let values: Vec<f64> = models.iter().flatten().map(|m| m.effects[k].values[p]).collect();
                let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
                let sum: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
                let count = values.len() as f64;
                spread = spread.max((sum * (count - 1.0) / count).sqrt() / mean.abs().max(1e-300));
            }
            let without =
                fit(&best.model.without_effect(k), data, Effort { max_iterations: 3, min_gain_nats: 1.0 });
            let Some(without) = without else {
                return JackknifeResult {
                    relative_se: spread,
                    held_out_gain: 0.0,
                    varying_coefficient_share: f64::INFINITY,
                };
            };
            let less = square(&held_out_residuals(&without, data));
            let gain = (less - with) / (less - floor_n * floor_n).max(1e-12);
            let otherwise = varying_coefficient_test(&look, k, without.nats() - best.nats());
            JackknifeResult {
                relative_se: spread,
                held_out_gain: gain,
                varying_coefficient_share: otherwise.map_or(f64::INFINITY, |o| o.share),
            }
        })
        .collect()
}

/// The model fitted to all recordings but one; that one has nothing of its own.
fn without(best: &Fit, data: &FitData, r: usize) -> Option<Model> {
    let others: Vec<usize> = (0..data.recording_count()).filter(|k| *k != r).collect();
    let mut model = best.model.clone();
    model.rupture_times_s.remove(r);
    model.per_recording.remove(r);
    let fitted = fit(&model, &data.subset(&others), Effort { max_iterations: 2, min_gain_nats: 0.5 })?;
    let mut model = fitted.model;
    model.rupture_times_s.insert(r, vec![NO_RUPTURE; best.model.layers()]);
    model.per_recording.insert(r, RecordingParameters::default());
    Some(model)
}

/// Root mean square in N over recordings, samples' own noise about their blocks' means included.
#[must_use]
pub fn pooled_rms(left: &[Option<FreeRunResidual>], data: &FitData) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (l, b) in left.iter().zip(data.recordings.iter()) {
        if let Some(l) = l {
            sum += l.compared_blocks as f64 * (l.mean_square_n2 + b.within_block_sd_n().powi(2));
            n += l.compared_blocks as f64;
        }
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

/// Standard deviation in N of the noise of single samples.
#[must_use]
pub fn sample_noise_sd_n(data: &FitData) -> f64 {
    let n = data.recording_count().max(1) as f64;
    let within = data.recordings.iter().map(|b| b.within_block_sd_n().powi(2)).sum::<f64>() / n;
    (data.noise.sd_n().powi(2) + within).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{
        FreeRunResidual, held_out_residuals, held_out_residuals_with_random_effects, jackknife_effects,
        pooled_rms, predict_free_run, sample_noise_sd_n, without,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::multistart_fit::SetFit;
    use crate::test_fixtures::{fit_from_truth, simulated_recordings};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::likelihood::{FitData, ReplayCache};
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;
    use stylet_tissue::{AnyEffect, CoulombFriction};

    /// Four samples a block that alternate by so much.
    fn blocks(within_n: f64) -> BlockAverages {
        let t: Vec<f64> = (0..800).map(|k| f64::from(k) / 200.0).collect();
        let z = t.iter().map(|t| 1e-3 * t).collect();
        let f = (0..800).map(|k| if k % 2 == 0 { within_n } else { -within_n }).collect();
        BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
    }

    #[test]
    fn errors_and_the_floor_have_what_samples_scatter_within_their_blocks() {
        let (a, b) = (blocks(0.03), blocks(0.07));
        let (wa, wb) = (a.within_block_sd_n(), b.within_block_sd_n());
        assert!(wa > 0.02 && wb > 2.0 * wa, "{wa} {wb}");
        let data = FitData::new(Arc::new(vec![a, b]), Noise::white(0.02), 0.0);
        let left = |square_n2: f64, blocks: usize| {
            Some(FreeRunResidual {
                mean_square_n2: square_n2,
                compared_blocks: blocks,
                ..FreeRunResidual::default()
            })
        };
        let told = pooled_rms(&[left(0.0025, 30), left(0.0016, 70)], &data);
        let wanted = ((30.0 * (0.0025 + wa * wa) + 70.0 * (0.0016 + wb * wb)) / 100.0).sqrt();
        assert!((told - wanted).abs() < 1e-12, "{told} for {wanted}");
        // A recording that cannot be predicted does not count.
        let told = pooled_rms(&[None, left(0.0016, 70)], &data);
        assert!((told - (0.0016 + wb * wb).sqrt()).abs() < 1e-12);
        assert_eq!(pooled_rms(&[None, None], &data), 0.0);
        let wanted = (data.noise.sd_n().powi(2) + 0.5 * (wa * wa + wb * wb)).sqrt();
        assert!((sample_noise_sd_n(&data) - wanted).abs() < 1e-12);
    }

    fn rubbing(moved_m: &[f64]) -> SetFit {
        let rubs: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
        let all: Vec<[f64; 2]> =
            moved_m.iter().enumerate().map(|(k, m)| [[0.008, 0.016][k % 2], *m]).collect();
        let runs = simulated_recordings(std::slice::from_ref(&rubs), &all);
        fit_from_truth(&[rubs], &runs.iter().collect::<Vec<&SegmentedRecording>>())
    }

    /// A law whose puncture force is off by a little gives way early or late by a sample or so.
    #[test]
    fn a_rupture_may_be_early_or_late_by_two_samples_as_fits_best() {
        let told = rubbing(&[0.0]);
        let data = &told.data;
        let b = &data.recordings[0];
        let mut moved = 0;
        for factor in [0.96, 0.98, 1.0, 1.02, 1.04] {
            let mut model = told.fit.model.clone();
            model.tissue.layers[0].puncture_n = model.tissue.layers[0].puncture_n.map(|f| f * factor);
            let mut trail = ReplayCache::new(&model, data, 0).expect("a trail");
            let own = trail.free_rupture_times();
            trail.rebase(data, 0, &own);
            let left = predict_free_run(&model, data, 0).expect("a replay");
            let at = |instants: &[f64]| trail.nats_with_ruptures(&model, data, 0, instants);
            let best = at(&left.rupture_times_s);
            let samples = (left.rupture_times_s[0] - own[0]) / b.sample_step_s;
            assert!([0.0, 0.5, 1.0, 2.0].iter().any(|k| (samples.abs() - k).abs() < 1e-6), "{samples}");
            for k in [0.0, -0.5, 0.5, -1.0, 1.0, -2.0, 2.0] {
                assert!(at(&[own[0] + k * b.sample_step_s]) >= best - 1e-9, "{factor}: {k}");
            }
            moved += usize::from(samples != 0.0);
            let kept: Vec<f64> = (0..b.len()).filter(|k| b.used[*k]).map(|k| left.residual_n[k]).collect();
            let square = kept.iter().map(|e| e * e).sum::<f64>() / kept.len() as f64;
            assert!((left.mean_square_n2 - square).abs() < 1e-15 && left.compared_blocks == kept.len());
        }
        assert!(moved >= 2, "{moved}");
        // One that never gives way stays whole.
        let mut model = told.fit.model.clone();
        model.tissue.layers[0].puncture_n = Some(1e3);
        assert_eq!(predict_free_run(&model, data, 0).expect("a replay").rupture_times_s, [f64::INFINITY]);
    }

    #[test]
    fn a_recording_is_predicted_by_a_fit_to_the_others_with_nothing_of_its_own_but_what_is_granted() {
        let told = rubbing(&[4e-4, 0.0, -3e-4]);
        let (best, data) = (&told.fit, &told.data);
        let (plain, granted) =
            (held_out_residuals(best, data), held_out_residuals_with_random_effects(best, data));
        for r in 0..3 {
            let others: Vec<usize> = (0..3).filter(|k| *k != r).collect();
            let wanted = fit(
                &best.model.subset(&others),
                &data.subset(&others),
                Effort { max_iterations: 2, min_gain_nats: 0.5 },
            );
            let mut model = without(best, data, r).expect("a fit");
            assert_eq!(model.tissue, wanted.expect("a fit").model.tissue);
            let of = |l: &Option<FreeRunResidual>| l.as_ref().expect("a prediction").residual_n.clone();
            assert_eq!(of(&plain[r]), of(&predict_free_run(&model, data, r)), "{r}");
            model.per_recording[r] = best.model.per_recording[r];
            assert_eq!(of(&granted[r]), of(&predict_free_run(&model, data, r)), "{r}");
        }
        assert!(pooled_rms(&granted, data) < pooled_rms(&plain, data));
        // One alone is what the fit says of it.
        let alone = rubbing(&[4e-4]);
        let told = held_out_residuals(&alone.fit, &alone.data);
        let wanted = predict_free_run(&alone.fit.model, &alone.data, 0).expect("a prediction");
        assert_eq!(told[0].as_ref().map(|l| &l.residual_n), Some(&wanted.residual_n));
    }

    #[test]
    fn a_cause_has_the_jackknifes_error_and_the_share_that_comes_back_without_it() {
        let told = rubbing(&[1e-4, 0.0, -1e-4, 2e-4]);
        let (best, data) = (&told.fit, &told.data);
        let of = &jackknife_effects(best, data, 0.003)[0];
        let strength = |r: usize| without(best, data, r).expect("a fit").effects[0].values[0];
        let values: Vec<f64> = (0..4).map(strength).collect();
        let mean = stylet_stats::mean(&values);
        let error = (0.75 * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt() / mean;
        assert!((of.relative_se / error - 1.0).abs() < 1e-9 && error < 0.2, "{} for {error}", of.relative_se);
        let square = |left: &[Option<FreeRunResidual>]| {
            let all: Vec<&FreeRunResidual> = left.iter().flatten().collect();
            let blocks: usize = all.iter().map(|l| l.compared_blocks).sum();
            all.iter().map(|l| l.mean_square_n2 * l.compared_blocks as f64).sum::<f64>() / blocks as f64
        };
        let less = fit(&best.model.without_effect(0), data, Effort { max_iterations: 3, min_gain_nats: 1.0 })
            .expect("a fit");
        let (with, less) =
            (square(&held_out_residuals(best, data)), square(&held_out_residuals(&less, data)));
        let wanted = (less - with) / (less - 0.003 * 0.003);
        assert!(
            (of.held_out_gain / wanted - 1.0).abs() < 1e-9 && wanted > 0.1,
            "{} for {wanted}",
            of.held_out_gain
        );
        // A single recording tells nothing of that.
        let alone = rubbing(&[0.0]);
        let told = jackknife_effects(&alone.fit, &alone.data, 0.003);
        assert_eq!((told.len(), told[0].relative_se, told[0].held_out_gain), (1, 0.0, 0.0));
    }
}
