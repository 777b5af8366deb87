//! How much better the extended model is on recordings that took no part in the fit.

use crate::otherwise::otherwise;
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::look::Look;
use stylet_identify::model::{Model, NEVER, Own};
use stylet_identify::objective::{Data, Trail, replay};

/// Samples by which a rupture may be early or late without counting as an error.
const FORGIVEN: f64 = 2.0;

/// What is left of one recording.
#[derive(Clone, Debug, Default)]
pub struct Left {
    /// Mean square in N² over the blocks compared.
    pub square_n2: f64,
    /// Blocks compared.
    pub blocks: usize,
    /// Residual of every block in N.
    pub e: Vec<f64>,
    /// The law's own instants in s.
    pub instants: Vec<f64>,
}

/// Residual of a model with its own ruptures, each as early or late by a sample or two as fits best.
#[must_use]
pub fn by_its_own(model: &Model, data: &Data, r: usize) -> Option<Left> {
    let mut trail = Trail::new(model, data, r)?;
    let b = &data.blocks[r];
    let mut instants = trail.own_instants();
    trail.stand(data, r, &instants);
    let (first, last) = b.span_s();
    for layer in 0..instants.len() {
        let own = instants[layer];
        if own == NEVER {
            continue;
        }
        let mut best = (f64::INFINITY, own);
        for k in [0.0, -0.5, 0.5, -1.0, 1.0, -FORGIVEN, FORGIVEN] {
            instants[layer] = (own + k * b.step_s).clamp(first, last);
            let nats = trail.nats_at(model, data, r, &instants);
            if nats < best.0 {
                best = (nats, instants[layer]);
            }
        }
        instants[layer] = best.1;
    }
    let mut at = model.clone();
    at.instants[r].clone_from(&instants);
    let predicted = replay(&at, data, r)?;
    let e: Vec<f64> = b.f.iter().zip(&predicted.f).map(|(y, f)| y - f).collect();
    let kept = e.iter().zip(&b.used).filter(|(_, u)| **u);
    let (square, blocks) = kept.fold((0.0, 0), |(s, n), (e, _)| (s + e * e, n + 1));
    Some(Left { square_n2: square / blocks.max(1) as f64, blocks, e, instants })
}

/// Predicts every recording from a fit to the others; with one recording the fit itself is used.
#[must_use]
pub fn left_out(best: &Fit, data: &Data) -> Vec<Option<Left>> {
    left_out_with(best, data, |_| Own::default())
}

/// As [`left_out`], with the numbers of its own (surface, friction) of the recording that is left out granted: what a cause is
/// worth does not hang on where the needle touched.
#[must_use]
pub fn left_out_granted(best: &Fit, data: &Data) -> Vec<Option<Left>> {
    left_out_with(best, data, |r| best.model.own[r])
}

fn left_out_with(best: &Fit, data: &Data, own: impl Fn(usize) -> Own + Sync) -> Vec<Option<Left>> {
    let n = data.recordings();
    (0..n)
        .into_par_iter()
        .map(|r| {
            let mut model = if n < 2 { best.model.clone() } else { without(best, data, r)? };
            if n > 1 {
                model.own[r] = own(r);
            }
            by_its_own(&model, data, r)
        })
        .collect()
}

/// How a cause fares when one recording is left out of the fit.
#[derive(Clone, Debug)]
pub struct Borne {
    /// Standard error of its strengths by the jackknife, relative to them; the largest.
    pub spread: f64,
    /// Share of what the model without it leaves on left-out recordings, beyond `with`, in mean square.
    pub gain: f64,
    /// Share of what the fit loses without it that its force would gain by acting otherwise ([`otherwise`](crate::otherwise)).
    pub otherwise: f64,
}

/// How the effects of a fit fare on recordings left out; `floor_n` is the noise.
#[must_use]
pub fn borne(best: &Fit, data: &Data, floor_n: f64) -> Vec<Borne> {
    let n = data.recordings();
    if n < 2 {
        let none = Borne { spread: 0.0, gain: 0.0, otherwise: 0.0 };
        return vec![none; best.model.effects.len()];
    }
    let square = |left: &[Option<Left>]| {
        let (sum, blocks) = left
            .iter()
            .flatten()
            .fold((0.0, 0.0), |(s, n), l| (s + l.square_n2 * l.blocks as f64, n + l.blocks as f64));
        sum / f64::max(blocks, 1.0)
    };
    let models: Vec<Option<Model>> = (0..n).into_par_iter().map(|r| without(best, data, r)).collect();
    let with: Vec<Option<Left>> =
        models.iter().enumerate().map(|(r, m)| by_its_own(m.as_ref()?, data, r)).collect();
    let with = square(&with);
    let look = Look::new(best, data);
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
            let without = fit(&best.model.without(k), data, Effort { turns: 3, enough: 1.0 });
            let Some(without) = without else {
                return Borne { spread, gain: 0.0, otherwise: f64::INFINITY };
            };
            let less = square(&left_out(&without, data));
            let gain = (less - with) / (less - floor_n * floor_n).max(1e-12);
            let otherwise = otherwise(&look, k, without.nats() - best.nats());
            Borne { spread, gain, otherwise: otherwise.map_or(f64::INFINITY, |o| o.share) }
        })
        .collect()
}

/// The model fitted to all recordings but one; that one has nothing of its own.
fn without(best: &Fit, data: &Data, r: usize) -> Option<Model> {
    let others: Vec<usize> = (0..data.recordings()).filter(|k| *k != r).collect();
    let mut model = best.model.clone();
    model.instants.remove(r);
    model.own.remove(r);
    let fitted = fit(&model, &data.only(&others), Effort { turns: 2, enough: 0.5 })?;
    let mut model = fitted.model;
    model.instants.insert(r, vec![NEVER; best.model.layers()]);
    model.own.insert(r, Own::default());
    Some(model)
}

/// Root mean square in N over recordings, samples' own noise about their blocks' means included.
#[must_use]
pub fn rms(left: &[Option<Left>], data: &Data) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (l, b) in left.iter().zip(data.blocks.iter()) {
        if let Some(l) = l {
            sum += l.blocks as f64 * (l.square_n2 + b.within_n().powi(2));
            n += l.blocks as f64;
        }
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

/// Standard deviation in N of the noise of single samples.
#[must_use]
pub fn floor(data: &Data) -> f64 {
    let n = data.recordings().max(1) as f64;
    let within = data.blocks.iter().map(|b| b.within_n().powi(2)).sum::<f64>() / n;
    (data.noise.sd_n().powi(2) + within).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{Left, borne, by_its_own, floor, left_out, left_out_granted, rms, without};
    use crate::made::{insertions, settled};
    use crate::set::Insertion;
    use crate::set::fitted::Fitted;
    use std::sync::Arc;
    use stylet_identify::blocks::{BLOCK_S, Blocks};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::noise::Noise;
    use stylet_identify::objective::{Data, Trail};
    use stylet_record::Recording;
    use stylet_tissue::{AnyEffect, CoulombFriction};

    /// Four samples a block that alternate by so much.
    fn blocks(within_n: f64) -> Blocks {
        let t: Vec<f64> = (0..800).map(|k| f64::from(k) / 200.0).collect();
        let z = t.iter().map(|t| 1e-3 * t).collect();
        let f = (0..800).map(|k| if k % 2 == 0 { within_n } else { -within_n }).collect();
        Blocks::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
    }

    #[test]
    fn errors_and_the_floor_have_what_samples_scatter_within_their_blocks() {
        let (a, b) = (blocks(0.03), blocks(0.07));
        let (wa, wb) = (a.within_n(), b.within_n());
        assert!(wa > 0.02 && wb > 2.0 * wa, "{wa} {wb}");
        let data = Data::new(Arc::new(vec![a, b]), Noise::white(0.02), 0.0);
        let left = |square_n2: f64, blocks: usize| Some(Left { square_n2, blocks, ..Left::default() });
        let told = rms(&[left(0.0025, 30), left(0.0016, 70)], &data);
        let wanted = ((30.0 * (0.0025 + wa * wa) + 70.0 * (0.0016 + wb * wb)) / 100.0).sqrt();
        assert!((told - wanted).abs() < 1e-12, "{told} for {wanted}");
        // A recording that cannot be predicted does not count.
        let told = rms(&[None, left(0.0016, 70)], &data);
        assert!((told - (0.0016 + wb * wb).sqrt()).abs() < 1e-12);
        assert_eq!(rms(&[None, None], &data), 0.0);
        let wanted = (data.noise.sd_n().powi(2) + 0.5 * (wa * wa + wb * wb)).sqrt();
        assert!((floor(&data) - wanted).abs() < 1e-12);
    }

    fn rubbing(moved_m: &[f64]) -> Fitted {
        let rubs: AnyEffect = CoulombFriction { c_n_per_m: 150.0 }.into();
        let all: Vec<[f64; 2]> =
            moved_m.iter().enumerate().map(|(k, m)| [[0.008, 0.016][k % 2], *m]).collect();
        let runs = insertions(std::slice::from_ref(&rubs), &all);
        settled(&[rubs], &runs.iter().collect::<Vec<&Insertion>>())
    }

    /// A law whose puncture force is off by a little gives way early or late by a sample or so.
    #[test]
    fn a_rupture_may_be_early_or_late_by_two_samples_as_fits_best() {
        let told = rubbing(&[0.0]);
        let data = &told.data;
        let b = &data.blocks[0];
        let mut moved = 0;
        for factor in [0.96, 0.98, 1.0, 1.02, 1.04] {
            let mut model = told.fit.model.clone();
            model.tissue.layers[0].puncture_n = model.tissue.layers[0].puncture_n.map(|f| f * factor);
            let mut trail = Trail::new(&model, data, 0).expect("a trail");
            let own = trail.own_instants();
            trail.stand(data, 0, &own);
            let left = by_its_own(&model, data, 0).expect("a replay");
            let at = |instants: &[f64]| trail.nats_at(&model, data, 0, instants);
            let best = at(&left.instants);
            let samples = (left.instants[0] - own[0]) / b.step_s;
            assert!([0.0, 0.5, 1.0, 2.0].iter().any(|k| (samples.abs() - k).abs() < 1e-6), "{samples}");
            for k in [0.0, -0.5, 0.5, -1.0, 1.0, -2.0, 2.0] {
                assert!(at(&[own[0] + k * b.step_s]) >= best - 1e-9, "{factor}: {k}");
            }
            moved += usize::from(samples != 0.0);
            let kept: Vec<f64> = (0..b.len()).filter(|k| b.used[*k]).map(|k| left.e[k]).collect();
            let square = kept.iter().map(|e| e * e).sum::<f64>() / kept.len() as f64;
            assert!((left.square_n2 - square).abs() < 1e-15 && left.blocks == kept.len());
        }
        assert!(moved >= 2, "{moved}");
        // One that never gives way stays whole.
        let mut model = told.fit.model.clone();
        model.tissue.layers[0].puncture_n = Some(1e3);
        assert_eq!(by_its_own(&model, data, 0).expect("a replay").instants, [f64::INFINITY]);
    }

    #[test]
    fn a_recording_is_predicted_by_a_fit_to_the_others_with_nothing_of_its_own_but_what_is_granted() {
        let told = rubbing(&[4e-4, 0.0, -3e-4]);
        let (best, data) = (&told.fit, &told.data);
        let (plain, granted) = (left_out(best, data), left_out_granted(best, data));
        for r in 0..3 {
            let others: Vec<usize> = (0..3).filter(|k| *k != r).collect();
            let wanted =
                fit(&best.model.only(&others), &data.only(&others), Effort { turns: 2, enough: 0.5 });
            let mut model = without(best, data, r).expect("a fit");
            assert_eq!(model.tissue, wanted.expect("a fit").model.tissue);
            let of = |l: &Option<Left>| l.as_ref().expect("a prediction").e.clone();
            assert_eq!(of(&plain[r]), of(&by_its_own(&model, data, r)), "{r}");
            model.own[r] = best.model.own[r];
            assert_eq!(of(&granted[r]), of(&by_its_own(&model, data, r)), "{r}");
        }
        assert!(rms(&granted, data) < rms(&plain, data));
        // One alone is what the fit says of it.
        let alone = rubbing(&[4e-4]);
        let told = left_out(&alone.fit, &alone.data);
        let wanted = by_its_own(&alone.fit.model, &alone.data, 0).expect("a prediction");
        assert_eq!(told[0].as_ref().map(|l| &l.e), Some(&wanted.e));
    }

    #[test]
    fn a_cause_has_the_jackknifes_error_and_the_share_that_comes_back_without_it() {
        let told = rubbing(&[1e-4, 0.0, -1e-4, 2e-4]);
        let (best, data) = (&told.fit, &told.data);
        let of = &borne(best, data, 0.003)[0];
        let strength = |r: usize| without(best, data, r).expect("a fit").effects[0].values[0];
        let values: Vec<f64> = (0..4).map(strength).collect();
        let mean = stylet_stats::mean(&values);
        let error = (0.75 * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt() / mean;
        assert!((of.spread / error - 1.0).abs() < 1e-9 && error < 0.2, "{} for {error}", of.spread);
        let square = |left: &[Option<Left>]| {
            let all: Vec<&Left> = left.iter().flatten().collect();
            let blocks: usize = all.iter().map(|l| l.blocks).sum();
            all.iter().map(|l| l.square_n2 * l.blocks as f64).sum::<f64>() / blocks as f64
        };
        let less = fit(&best.model.without(0), data, Effort { turns: 3, enough: 1.0 }).expect("a fit");
        let (with, less) = (square(&left_out(best, data)), square(&left_out(&less, data)));
        let wanted = (less - with) / (less - 0.003 * 0.003);
        assert!((of.gain / wanted - 1.0).abs() < 1e-9 && wanted > 0.1, "{} for {wanted}", of.gain);
        // A single recording tells nothing of that.
        let alone = rubbing(&[0.0]);
        let told = borne(&alone.fit, &alone.data, 0.003);
        assert_eq!((told.len(), told[0].spread, told[0].gain), (1, 0.0, 0.0));
    }
}
