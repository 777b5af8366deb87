//! The base law fitted: drops of the force given to layers, numbers and instants in turn.

use crate::varied::varied;
use rayon::prelude::*;
use std::sync::Arc;
use stylet_identify::assign::assign_all;
use stylet_identify::blocks::Blocks;
use stylet_identify::drops::{Drop, drops};
use stylet_identify::fit::{Effort, Fit, fit, fit_sharp};
use stylet_identify::model::{Belief, Choice, Model};
use stylet_identify::noise::{From, Noise};
use stylet_identify::objective::{Data, residuals};
use stylet_identify::retime::retime;

/// Recordings made ready, with the drops of their forces.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// What is believed.
    pub belief: Arc<Belief>,
    /// The recordings.
    pub blocks: Arc<Vec<Blocks>>,
    /// Drops per recording.
    pub drops: Vec<Vec<Drop>>,
    /// The noise is nowhere less, in N.
    pub floor_n: f64,
}

impl Prepared {
    /// Finds the drops.
    #[must_use]
    pub fn new(belief: Arc<Belief>, blocks: Vec<Blocks>, floor_n: f64) -> Self {
        let drops = blocks.par_iter().map(drops).collect();
        Self { belief, blocks: Arc::new(blocks), drops, floor_n }
    }

    /// Instants (s) of the drops.
    #[must_use]
    pub fn drop_times(&self) -> Vec<Vec<f64>> {
        self.drops.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect()
    }

    /// Largest force in N.
    #[must_use]
    pub fn largest_n(&self) -> f64 {
        self.blocks.iter().flat_map(|b| &b.size_n).fold(1e-9, |m: f64, f| m.max(*f))
    }
}

/// The first fits see misfits of this share of the largest force as noise: no detail traps them.
const FIRST_SHARE: f64 = 0.03;

/// What leaves so many times the noise of its calm stretches is no fit.
pub(crate) const MISFIT: f64 = 1.2;
/// Blocks of the search are averaged by so many to rank starts.
pub(crate) const COARSER: usize = 3;
/// The base law is begun anew where a sketch leaves less than this share of the nats.
const APART: f64 = 0.5;

/// Standard deviation in N of blocks about their neighbours.
pub(crate) fn roughness(blocks: &[Blocks]) -> f64 {
    stylet_stats::roughness(blocks.iter().map(|b| b.f.as_slice())).max(1e-6)
}

/// Which numbers each recording has of its own: its surface, its friction.
pub(crate) type Apart = (bool, bool);

/// Those of a model.
pub(crate) fn own(model: &Model) -> Apart {
    (model.free.own_surface, model.free.own_friction)
}

/// Fits the base law; returns it with the noise by which it is judged. `None` when it cannot be replayed.
#[must_use]
pub fn base(prepared: &Prepared) -> Option<(Fit, Data)> {
    from_belief(prepared, &[], (false, false))
}

/// The law with effects, begun anew from what is believed: drops are given to layers by the law that makes them. Where an effect makes
/// drops of its own, or steps at faces, the base law alone has taken them for ruptures and moved its faces, and nothing that begins there
/// finds back.
#[must_use]
pub fn anew(prepared: &Prepared, effects: &[Choice], own: Apart, data: &Data) -> Option<Fit> {
    let (found, used) = from_belief(prepared, effects, own)?;
    data.worked(used.work());
    let mut model = found.model;
    retime(&mut model, data, &prepared.drop_times());
    fit(&model, data, Effort::FULL)
}

/// The same in short, on blocks averaged further (`coarse`): enough to tell whether an effect is worth beginning anew.
#[must_use]
pub fn sketched(prepared: &Prepared, effects: &[Choice], own: Apart, coarse: &Data) -> Option<Fit> {
    let less = Prepared { blocks: Arc::clone(&coarse.blocks), ..prepared.clone() };
    let (found, used) = given(&less, effects, own)?;
    coarse.worked(used.work());
    let mut model = found.model;
    if own != (false, false) {
        // Beside numbers that are not each recording's own yet, ruptures would go far to make up for them.
        model = fit(&model, coarse, Effort { turns: 5, enough: 0.3 })?.model;
    }
    retime(&mut model, coarse, &prepared.drop_times());
    fit(&model, coarse, Effort { turns: 5, enough: 0.3 })
}

/// The base law begun anew with a surface and a friction of each recording's own, where that leaves so much less that its ruptures must
/// have been taken for what differs between the recordings.
#[must_use]
pub fn apart(prepared: &Prepared, found: Fit, data: Data) -> (Fit, Data) {
    let better = || {
        let calm = data.judged_by(&found.residuals.e, From::Calm);
        if data.recordings() < 2 || found.rms_n(&data) < MISFIT * calm.noise.sd_n() {
            return None;
        }
        let coarse = data.on(data.blocks.par_iter().map(|b| b.coarser(COARSER)).collect());
        let coarse = coarse.judged_by(&residuals(&found.model, &coarse)?.e, From::Calm);
        let stood = residuals(&found.model, &coarse)?.nats;
        let sketch = sketched(prepared, &[], (true, true), &coarse)?;
        if sketch.nats() > APART * stood {
            return None;
        }
        let mut model = sketch.model;
        retime(&mut model, &calm, &prepared.drop_times());
        let whole = fit(&model, &calm, Effort::FULL)?;
        let data = calm.judged_by(&whole.residuals.e, From::Calm);
        let (better, data) = varied(fit_sharp(&whole.model, &data, Effort::FULL)?, data);
        (better.nats() < residuals(&found.model, &data)?.nats).then_some((better, data))
    };
    better().unwrap_or((found, data))
}

/// Drops given to layers and numbers fitted, in turn, seen from afar.
fn given(prepared: &Prepared, effects: &[Choice], own: Apart) -> Option<(Fit, Data)> {
    let rough_n = roughness(&prepared.blocks);
    let wide = Noise::white(rough_n.max(FIRST_SHARE * prepared.largest_n()));
    let data = Data::new(Arc::clone(&prepared.blocks), wide, prepared.floor_n);
    let mut start = Model::base(Arc::clone(&prepared.belief), prepared.blocks.len());
    start.free.far = true;
    (start.free.own_surface, start.free.own_friction) = own;
    let model = effects.iter().fold(start, |m, choice| m.with(choice.clone()));
    let mut best: Option<Fit> = None;
    for trust in [1.0, 0.5] {
        let from = best.as_ref().map_or(&model, |b| &b.model);
        let instants = assign_all(from, &prepared.blocks, &prepared.drops, trust, rough_n);
        let next = Model { instants, ..from.clone() };
        if let Some(new) = fit(&next, &data, Effort { turns: 4, enough: 0.3 })
            && best.as_ref().is_none_or(|b| new.nats() < b.nats())
        {
            best = Some(new);
        }
    }
    Some((best?, data))
}

fn from_belief(prepared: &Prepared, effects: &[Choice], own: Apart) -> Option<(Fit, Data)> {
    let (mut best, mut data) = given(prepared, effects, own)?;
    let times = prepared.drop_times();
    for round in 0..3 {
        data = data.judged_by(&best.residuals.e, From::Calm);
        let mut model = best.model.clone();
        if round == 0 && own != (false, false) {
            model = fit(&model, &data, Effort { turns: 5, enough: 0.3 })?.model;
        }
        retime(&mut model, &data, &times);
        best = fit(&model, &data, if round == 2 { Effort::FULL } else { Effort { turns: 5, enough: 0.3 } })?;
    }
    data = data.judged_by(&best.residuals.e, From::Calm);
    best = fit_sharp(&best.model, &data, Effort::FULL)?;
    Some((best, data))
}

#[cfg(test)]
mod tests {
    use super::{FIRST_SHARE, Prepared, anew, apart, base, given, roughness, sketched};
    use crate::made::{believed, gel, insertions, settled};
    use std::sync::Arc;
    use stylet_identify::assign::assign_all;
    use stylet_identify::blocks::{BLOCK_S, Blocks};
    use stylet_identify::drops::Drop;
    use stylet_identify::fit::{Effort, Fit, fit};
    use stylet_identify::model::{Choice, Model};
    use stylet_identify::noise::Noise;
    use stylet_identify::objective::{Data, residuals};
    use stylet_record::Recording;
    use stylet_tissue::{CoulombFriction, Effect};

    fn blocks(f: impl Fn(f64) -> f64) -> Blocks {
        let t: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
        let z = t.iter().map(|t| 1e-3 * t).collect();
        let f = t.iter().map(|t| f(*t)).collect();
        Blocks::new(&Recording::new(t, z, f).expect("a recording"), &[], BLOCK_S)
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
        let belief = believed(&[]);
        let saw = |t: f64| if t < 4.0 { 0.5 * t } else { 0.5 * t - 1.5 };
        let (a, b) = (blocks(saw), blocks(|t| 0.6 * t));
        let largest = b.size_n.iter().copied().fold(0.0, f64::max);
        let p = Prepared::new(belief, vec![a, b], 0.01);
        assert!((p.largest_n() - largest).abs() < 1e-12 && largest > 4.0);
        assert_eq!((p.floor_n, p.drops[1].len()), (0.01, 0));
        let times = p.drop_times();
        assert_eq!(
            times,
            p.drops.iter().map(|d| d.iter().map(|d: &Drop| d.time_s).collect::<Vec<_>>()).collect::<Vec<_>>()
        );
        assert!(times[0].iter().any(|t| (t - 4.0).abs() < 0.05), "{times:?}");
    }

    /// Insertions into the gel that rub by so much (N/m), made ready, with blocks and noise as a fit from the truth has them.
    fn gels(c_n_per_m: f64) -> (Prepared, Data) {
        let runs = insertions(&[CoulombFriction { c_n_per_m }.into()], &[[4e-3, 0.0], [6e-3, 0.0]]);
        let f = settled(&[], &runs.iter().collect::<Vec<_>>());
        (Prepared::new(f.fit.model.belief.clone(), f.data.blocks.to_vec(), 0.0), f.data)
    }

    /// Nothing of their own.
    const ALIKE: (bool, bool) = (false, false);

    fn rubs() -> Choice {
        Choice::new(CoulombFriction::default().info(), &[1.0])
    }

    #[test]
    fn the_base_law_is_found_from_what_is_believed() {
        let (prepared, _) = gels(0.0);
        let (f, data) = base(&prepared).expect("a fit");
        let (told, there) = (&f.model.tissue.layers[0], &gel().layers[0]);
        assert!((told.stiffness_n_per_m / there.stiffness_n_per_m - 1.0).abs() < 0.02, "{told:?}");
        assert!(f.model.effects.is_empty() && f.model.instants.iter().all(|t| t[0].is_finite()));
        assert!((2e-3..2e-2).contains(&data.noise.sd_n()), "{}", data.noise.sd_n());
    }

    #[test]
    fn an_effect_begun_anew_or_sketched_has_its_strength() {
        let (prepared, data) = gels(60.0);
        let strength = |f: Option<Fit>| f.expect("a fit").model.effects[0].values[0];
        let coarse = data.on(data.blocks.iter().map(|b| b.coarser(3)).collect());
        for told in [anew(&prepared, &[rubs()], ALIKE, &data), sketched(&prepared, &[rubs()], ALIKE, &coarse)]
        {
            let told = strength(told);
            assert!((told / 60.0 - 1.0).abs() < 0.2, "{told}");
        }
    }

    #[test]
    fn a_law_whose_ruptures_are_wrong_is_begun_anew_with_numbers_of_each_recordings_own() {
        let (prepared, _) = gels(0.0);
        let (found, data) = base(&prepared).expect("a fit");
        let instants = |f: &Fit| f.model.instants.iter().map(|t| t[0]).collect::<Vec<_>>();
        // What leaves noise stays as it is.
        let (same, _) = apart(&prepared, found.clone(), data.clone());
        assert_eq!((same.nats(), instants(&same)), (found.nats(), instants(&found)));
        let mut wrong = found.clone();
        wrong.model.instants.iter_mut().for_each(|t| t[0] -= 0.8);
        wrong.residuals = residuals(&wrong.model, &data).expect("a replay");
        let (told, _) = apart(&prepared, wrong, data);
        for (told, there) in instants(&told).iter().zip(instants(&found)) {
            assert!((told - there).abs() < 0.02, "{told} for {there}");
        }
    }

    /// A sketch sees nothing but the blocks that it is given.
    #[test]
    fn a_sketch_knows_the_coarse_blocks_alone() {
        let (prepared, data) = gels(60.0);
        let coarse = data.on(data.blocks.iter().map(|b| b.coarser(3)).collect());
        let less = Prepared { blocks: Arc::clone(&coarse.blocks), ..prepared.clone() };
        let told = |p: &Prepared| {
            let f = sketched(p, &[rubs()], ALIKE, &coarse).expect("a fit");
            (f.nats(), f.model.tissue.layers[0].stiffness_n_per_m)
        };
        assert_eq!(told(&prepared), told(&less));
    }

    /// Noise as large as a share of the largest force, or as the blocks' own; the better of a trusting and a doubting giving away.
    #[test]
    fn drops_are_given_away_from_afar() {
        let (prepared, _) = gels(60.0);
        let (told, data) = given(&prepared, &[], ALIKE).expect("a fit");
        assert!((data.noise.sd_n() / (FIRST_SHARE * prepared.largest_n()) - 1.0).abs() < 1e-12);
        let rough_n = roughness(&prepared.blocks);
        assert!(rough_n < 0.5 * data.noise.sd_n());
        let wide = Data::new(Arc::clone(&prepared.blocks), Noise::white(data.noise.sd_n()), 0.0);
        let given_by = |from: &Model, trust: f64| {
            let instants = assign_all(from, &prepared.blocks, &prepared.drops, trust, rough_n);
            let next = Model { instants, ..from.clone() };
            fit(&next, &wide, Effort { turns: 4, enough: 0.3 }).expect("a fit")
        };
        let first = given_by(&Model::base(prepared.belief.clone(), 2), 1.0);
        let second = given_by(&first.model, 0.5);
        assert_eq!(told.nats(), first.nats().min(second.nats()));
        assert!(told.model.instants.iter().all(|t| t[0].is_finite()));
    }
}
