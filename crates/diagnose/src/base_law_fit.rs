//! The base law fitted: drops of the force given to layers, numbers and instants in turn.

use crate::random_effect_selection::select_random_effects;
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::block_averages::BlockAverages;
use stylet_identify::fit::{Effort, Fit, fit, fit_from_zero_scatter};
use stylet_identify::force_drops::{ForceDrop, detect_force_drops};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{Assumptions, EffectTerm, Model};
use stylet_identify::noise::{Noise, NoiseSource};
use stylet_identify::rupture_assignment::assign_ruptures;
use stylet_identify::update_event_times::update_event_times;

/// Recordings made ready, with the drops of their forces.
#[derive(Clone, Debug)]
pub struct PreparedRecordings {
    /// What is believed.
    pub assumed: Arc<Assumptions>,
    /// The recordings.
    pub blocks: Arc<Vec<BlockAverages>>,
    /// Drops per recording.
    pub drops: Vec<Vec<ForceDrop>>,
    /// The noise is nowhere less, in N.
    pub min_noise_sd_n: f64,
}

impl PreparedRecordings {
    /// Finds the drops.
    #[must_use]
    pub fn new(belief: Arc<Assumptions>, blocks: Vec<BlockAverages>, floor_n: f64) -> Self {
        let drops = blocks.par_iter().map(detect_force_drops).collect();
        Self { assumed: belief, blocks: Arc::new(blocks), drops, min_noise_sd_n: floor_n }
    }

    /// Instants (s) of the drops.
    #[must_use]
    pub fn drop_times(&self) -> Vec<Vec<f64>> {
        self.drops.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect()
    }

    /// Largest force in N.
    #[must_use]
    pub fn largest_force_n(&self) -> f64 {
        self.blocks.iter().flat_map(|b| &b.abs_force_n).fold(1e-9, |m: f64, f| m.max(*f))
    }
}

/// The first fits see misfits of this share of the largest force as noise: no detail traps them.
const FIRST_SHARE: f64 = 0.03;

/// What leaves so many times the noise of its calm stretches is no fit.
pub(crate) const MISFIT_FACTOR: f64 = 1.2;
/// Blocks of the search are averaged by so many to rank starts.
pub(crate) const COARSENING_FACTOR: usize = 3;
/// The base law is begun anew where a sketch leaves less than this share of the nats.
const APART: f64 = 0.5;

/// Standard deviation in N of blocks about their neighbours.
pub(crate) fn roughness(blocks: &[BlockAverages]) -> f64 {
    stylet_stats::third_difference_sd(blocks.iter().map(|b| b.force_n.as_slice())).max(1e-6)
}

/// Which numbers each recording has of its own: its surface, its friction.
pub(crate) type RandomEffects = (bool, bool);

/// Those of a model.
pub(crate) fn random_effects_of(model: &Model) -> RandomEffects {
    (model.free.recording_surface, model.free.recording_friction)
}

/// Fits the base law; returns it with the noise by which it is judged. `None` when it cannot be replayed.
#[must_use]
pub fn fit_base_law(prepared: &PreparedRecordings) -> Option<(Fit, FitData)> {
    from_belief(prepared, &[], (false, false))
}

/// The law with effects, begun anew from what is believed: drops are given to layers by the law that makes them. Where an effect makes
/// drops of its own, or steps at faces, the base law alone has taken them for ruptures and moved its faces, and nothing that begins there
/// finds back.
#[must_use]
pub fn refit_from_prior(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    own: RandomEffects,
    data: &FitData,
) -> Option<Fit> {
    let (found, used) = from_belief(prepared, effects, own)?;
    data.count_replayed(used.blocks_replayed());
    let mut model = found.model;
    update_event_times(&mut model, data, &prepared.drop_times());
    fit(&model, data, Effort::FULL)
}

/// The same in short, on blocks averaged further (`coarse`): enough to tell whether an effect is worth beginning anew.
#[must_use]
pub fn coarse_refit(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    own: RandomEffects,
    coarse: &FitData,
) -> Option<Fit> {
    let less = PreparedRecordings { blocks: Arc::clone(&coarse.recordings), ..prepared.clone() };
    let (found, used) = given(&less, effects, own)?;
    coarse.count_replayed(used.blocks_replayed());
    let mut model = found.model;
    if own != (false, false) {
        // Beside numbers that are not each recording's own yet, ruptures would go far to make up for them.
        model = fit(&model, coarse, Effort { max_iterations: 5, min_gain_nats: 0.3 })?.model;
    }
    update_event_times(&mut model, coarse, &prepared.drop_times());
    fit(&model, coarse, Effort { max_iterations: 5, min_gain_nats: 0.3 })
}

/// The base law begun anew with a surface and a friction of each recording's own, where that leaves so much less that its ruptures must
/// have been taken for what differs between the recordings.
#[must_use]
pub fn refit_with_random_effects(prepared: &PreparedRecordings, found: Fit, data: FitData) -> (Fit, FitData) {
    let better = || {
        let calm = data.with_estimated_noise(&found.residuals.residual_n, NoiseSource::Detrended);
        if data.recording_count() < 2 || found.rms_n(&data) < MISFIT_FACTOR * calm.noise.sd_n() {
            return None;
        }
        let coarse = data
            .with_recordings(data.recordings.par_iter().map(|b| b.coarsened(COARSENING_FACTOR)).collect());
        let coarse = coarse
            .with_estimated_noise(&residuals(&found.model, &coarse)?.residual_n, NoiseSource::Detrended);
        let stood = residuals(&found.model, &coarse)?.nats;
        let sketch = coarse_refit(prepared, &[], (true, true), &coarse)?;
        if sketch.nats() > APART * stood {
            return None;
        }
        let mut model = sketch.model;
        update_event_times(&mut model, &calm, &prepared.drop_times());
        let whole = fit(&model, &calm, Effort::FULL)?;
        let data = calm.with_estimated_noise(&whole.residuals.residual_n, NoiseSource::Detrended);
        let (better, data) =
            select_random_effects(fit_from_zero_scatter(&whole.model, &data, Effort::FULL)?, data);
        (better.nats() < residuals(&found.model, &data)?.nats).then_some((better, data))
    };
    better().unwrap_or((found, data))
}

/// Drops given to layers and numbers fitted, in turn, seen from afar.
fn given(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    own: RandomEffects,
) -> Option<(Fit, FitData)> {
    let rough_n = roughness(&prepared.blocks);
    let wide = Noise::white(rough_n.max(FIRST_SHARE * prepared.largest_force_n()));
    let data = FitData::new(Arc::clone(&prepared.blocks), wide, prepared.min_noise_sd_n);
    let mut start = Model::base(Arc::clone(&prepared.assumed), prepared.blocks.len());
    start.free.wide_thickness = true;
    (start.free.recording_surface, start.free.recording_friction) = own;
    let model = effects.iter().fold(start, |m, choice| m.with_effect(choice.clone()));
    let mut best: Option<Fit> = None;
    for trust in [1.0, 0.5] {
        let from = best.as_ref().map_or(&model, |b| &b.model);
        let instants = assign_ruptures(from, &prepared.blocks, &prepared.drops, trust, rough_n);
        let next = Model { rupture_times_s: instants, ..from.clone() };
        if let Some(new) = fit(&next, &data, Effort { max_iterations: 4, min_gain_nats: 0.3 })
            && best.as_ref().is_none_or(|b| new.nats() < b.nats())
        {
            best = Some(new);
        }
    }
    Some((best?, data))
}

fn from_belief(
    prepared: &PreparedRecordings,
    effects: &[EffectTerm],
    own: RandomEffects,
) -> Option<(Fit, FitData)> {
    let (mut best, mut data) = given(prepared, effects, own)?;
    let times = prepared.drop_times();
    for round in 0..3 {
        data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
        let mut model = best.model.clone();
        if round == 0 && own != (false, false) {
            model = fit(&model, &data, Effort { max_iterations: 5, min_gain_nats: 0.3 })?.model;
        }
        update_event_times(&mut model, &data, &times);
        best = fit(
            &model,
            &data,
            if round == 2 { Effort::FULL } else { Effort { max_iterations: 5, min_gain_nats: 0.3 } },
        )?;
    }
    data = data.with_estimated_noise(&best.residuals.residual_n, NoiseSource::Detrended);
    best = fit_from_zero_scatter(&best.model, &data, Effort::FULL)?;
    Some((best, data))
}

#[cfg(test)]
mod tests {
    use super::{
        FIRST_SHARE, PreparedRecordings, coarse_refit, fit_base_law, given, refit_from_prior,
        refit_with_random_effects, roughness,
    };
    use crate::test_fixtures::{assumed_layers, fit_from_truth, gel_tissue, simulated_recordings};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, Fit, fit};
    use stylet_identify::force_drops::ForceDrop;
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::{EffectTerm, Model};
    use stylet_identify::noise::Noise;
    use stylet_identify::rupture_assignment::assign_ruptures;
    use stylet_record::Recording;
    use stylet_tissue::{CoulombFriction, Effect};

    fn blocks(f: impl Fn(f64) -> f64) -> BlockAverages {
        let t: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
        let z = t.iter().map(|t| 1e-3 * t).collect();
        let f = t.iter().map(|t| f(*t)).collect();
        BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
    }

    /// A third difference takes away parabolas; of noise of one sort it has twenty times the variance.
    #[test]
    fn blocks_are_as_rough_as_their_third_differences() {
        let parabola = blocks(|t| 3.0 - 0.4 * t + 0.07 * t * t);
        assert_eq!(roughness(&[parabola]), 1e-6);
        // Alternating by 0.02: every third difference is eight times that.
        let at = |t: f64| if (t / 0.02).round() as i64 % 2 == 0 { 0.02 } else { -0.02 };
        let wanted = 8.0 * 0.02 * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt();
        assert!((roughness(&[blocks(at)]) / wanted - 1.0).abs() < 1e-6);
        // Differences are weighed 1, 3, 3, 1: a step every 20 blocks is not seen, one every second block is.
        let ragged = blocks(|t| [0.0, 0.3, 0.1, -0.2, 0.05][(t / 0.02).round() as usize % 5]);
        let x = [0.0, 0.3, 0.1, -0.2, 0.05_f64];
        let mut all: Vec<f64> = (0..5)
            .map(|k| (x[(k + 3) % 5] - 3.0 * x[(k + 2) % 5] + 3.0 * x[(k + 1) % 5] - x[k]).abs())
            .collect();
        all.sort_by(f64::total_cmp);
        let wanted = all[2] * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt();
        assert!((roughness(&[ragged]) / wanted - 1.0).abs() < 1e-6);
    }

    #[test]
    fn recordings_made_ready_tell_their_drops_and_their_largest_force() {
        let belief = assumed_layers(&[]);
        let saw = |t: f64| if t < 4.0 { 0.5 * t } else { 0.5 * t - 1.5 };
        let (a, b) = (blocks(saw), blocks(|t| 0.6 * t));
        let largest = b.abs_force_n.iter().copied().fold(0.0, f64::max);
        let p = PreparedRecordings::new(belief, vec![a, b], 0.01);
        assert!((p.largest_force_n() - largest).abs() < 1e-12 && largest > 4.0);
        assert_eq!((p.min_noise_sd_n, p.drops[1].len()), (0.01, 0));
        let times = p.drop_times();
        assert_eq!(
            times,
            p.drops
                .iter()
                .map(|d| d.iter().map(|d: &ForceDrop| d.time_s).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        );
        assert!(times[0].iter().any(|t| (t - 4.0).abs() < 0.05), "{times:?}");
    }

    /// Insertions into the gel that rub by so much (N/m), made ready, with blocks and noise as a fit from the truth has them.
    fn gels(c_n_per_m: f64) -> (PreparedRecordings, FitData) {
        let runs = simulated_recordings(&[CoulombFriction { c_n_per_m }.into()], &[[4e-3, 0.0], [6e-3, 0.0]]);
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        (PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0), f.data)
    }

    /// Nothing of their own.
    const ALIKE: (bool, bool) = (false, false);

    fn rubs() -> EffectTerm {
        EffectTerm::new(CoulombFriction::default().info(), &[1.0])
    }

    #[test]
    fn the_base_law_is_found_from_what_is_believed() {
        let (prepared, _) = gels(0.0);
        let (f, data) = fit_base_law(&prepared).expect("a fit");
        let (told, there) = (&f.model.tissue.layers[0], &gel_tissue().layers[0]);
        assert!((told.stiffness_n_per_m / there.stiffness_n_per_m - 1.0).abs() < 0.02, "{told:?}");
        assert!(f.model.effects.is_empty() && f.model.rupture_times_s.iter().all(|t| t[0].is_finite()));
        assert!((2e-3..2e-2).contains(&data.noise.sd_n()), "{}", data.noise.sd_n());
    }

    #[test]
    fn an_effect_begun_anew_or_sketched_has_its_strength() {
        let (prepared, data) = gels(60.0);
        let strength = |f: Option<Fit>| f.expect("a fit").model.effects[0].values[0];
        let coarse = data.with_recordings(data.recordings.iter().map(|b| b.coarsened(3)).collect());
        for told in [
            refit_from_prior(&prepared, &[rubs()], ALIKE, &data),
            coarse_refit(&prepared, &[rubs()], ALIKE, &coarse),
        ] {
            let told = strength(told);
            assert!((told / 60.0 - 1.0).abs() < 0.2, "{told}");
        }
    }

    #[test]
    fn a_law_whose_ruptures_are_wrong_is_begun_anew_with_numbers_of_each_recordings_own() {
        let (prepared, _) = gels(0.0);
        let (found, data) = fit_base_law(&prepared).expect("a fit");
        let instants = |f: &Fit| f.model.rupture_times_s.iter().map(|t| t[0]).collect::<Vec<_>>();
        // What leaves noise stays as it is.
        let (same, _) = refit_with_random_effects(&prepared, found.clone(), data.clone());
        assert_eq!((same.nats(), instants(&same)), (found.nats(), instants(&found)));
        let mut wrong = found.clone();
        wrong.model.rupture_times_s.iter_mut().for_each(|t| t[0] -= 0.8);
        wrong.residuals = residuals(&wrong.model, &data).expect("a replay");
        let (told, _) = refit_with_random_effects(&prepared, wrong, data);
        for (told, there) in instants(&told).iter().zip(instants(&found)) {
            assert!((told - there).abs() < 0.02, "{told} for {there}");
        }
    }

    /// A sketch sees nothing but the blocks that it is given.
    #[test]
    fn a_sketch_knows_the_coarse_blocks_alone() {
        let (prepared, data) = gels(60.0);
        let coarse = data.with_recordings(data.recordings.iter().map(|b| b.coarsened(3)).collect());
        let less = PreparedRecordings { blocks: Arc::clone(&coarse.recordings), ..prepared.clone() };
        let told = |p: &PreparedRecordings| {
            let f = coarse_refit(p, &[rubs()], ALIKE, &coarse).expect("a fit");
            (f.nats(), f.model.tissue.layers[0].stiffness_n_per_m)
        };
        assert_eq!(told(&prepared), told(&less));
    }

    /// Noise as large as a share of the largest force, or as the blocks' own; the better of a trusting and a doubting giving away.
    #[test]
    fn drops_are_given_away_from_afar() {
        let (prepared, _) = gels(60.0);
        let (told, data) = given(&prepared, &[], ALIKE).expect("a fit");
        assert!((data.noise.sd_n() / (FIRST_SHARE * prepared.largest_force_n()) - 1.0).abs() < 1e-12);
        let rough_n = roughness(&prepared.blocks);
        assert!(rough_n < 0.5 * data.noise.sd_n());
        let wide = FitData::new(Arc::clone(&prepared.blocks), Noise::white(data.noise.sd_n()), 0.0);
        let given_by = |from: &Model, trust: f64| {
            let instants = assign_ruptures(from, &prepared.blocks, &prepared.drops, trust, rough_n);
            let next = Model { rupture_times_s: instants, ..from.clone() };
            fit(&next, &wide, Effort { max_iterations: 4, min_gain_nats: 0.3 }).expect("a fit")
        };
        let first = given_by(&Model::base(prepared.assumed.clone(), 2), 1.0);
        let second = given_by(&first.model, 0.5);
        assert_eq!(told.nats(), first.nats().min(second.nats()));
        assert!(told.model.rupture_times_s.iter().all(|t| t[0].is_finite()));
    }
}
