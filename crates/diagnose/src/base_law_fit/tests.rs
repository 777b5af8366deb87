use super::*;
use crate::test_fixtures::{assumed_layers, blocks_of, fit_simulated, gel_tissue};
use stylet_tissue::{CoulombFriction, Effect};

fn blocks(f: impl Fn(f64) -> f64) -> BlockAverages {
    let t: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
    let z = t.iter().map(|t| 1e-3 * t).collect();
    let f = t.iter().map(|t| f(*t)).collect();
    blocks_of(t, z, f)
}

/// A third difference removes parabolas; of white noise it has twenty times the variance.
#[test]
fn roughness_follows_from_third_differences() {
    let parabola = blocks(|t| 3.0 - 0.4 * t + 0.07 * t * t);
    assert_eq!(roughness(&[parabola]), 1e-6);
    // Alternating by 0.02: every third difference is eight times that.
    let at = |t: f64| if (t / 0.02).round() as i64 % 2 == 0 { 0.02 } else { -0.02 };
    let wanted = 8.0 * 0.02 * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt();
    assert!((roughness(&[blocks(at)]) / wanted - 1.0).abs() < 1e-6);
    // The weights are 1, 3, 3, 1: a step every 20 blocks leaves the median unchanged, one every second block does
    // not.
    let irregular = blocks(|t| [0.0, 0.3, 0.1, -0.2, 0.05][(t / 0.02).round() as usize % 5]);
    let x = [0.0, 0.3, 0.1, -0.2, 0.05_f64];
    let mut all: Vec<f64> =
        (0..5).map(|k| (x[(k + 3) % 5] - 3.0 * x[(k + 2) % 5] + 3.0 * x[(k + 1) % 5] - x[k]).abs()).collect();
    all.sort_by(f64::total_cmp);
    let wanted = all[2] * stylet_stats::MAD_TO_SD / 20.0_f64.sqrt();
    assert!((roughness(&[irregular]) / wanted - 1.0).abs() < 1e-6);
}

#[test]
fn prepared_recordings_list_their_drops_and_largest_force() {
    let assumed = assumed_layers(&[]);
    let sawtooth = |t: f64| if t < 4.0 { 0.5 * t } else { 0.5 * t - 1.5 };
    let (a, b) = (blocks(sawtooth), blocks(|t| 0.6 * t));
    let largest = b.abs_force_n.iter().copied().fold(0.0, f64::max);
    let p = PreparedRecordings::new(assumed, vec![a, b], 0.01);
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

/// Insertions into the gel with dry friction of `c_n_per_m`, prepared, with blocks and noise of a fit that starts
/// at the truth.
fn prepared_gel(c_n_per_m: f64) -> (PreparedRecordings, FitData) {
    let f = fit_simulated(&[], &[CoulombFriction { c_n_per_m }.into()], &[[4e-3, 0.0], [6e-3, 0.0]], |_| 0.0);
    (PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0), f.data)
}

/// No random effects.
const NO_RANDOM_EFFECTS: (bool, bool) = (false, false);

fn dry_friction() -> EffectTerm {
    EffectTerm::new(CoulombFriction::default().info(), &[1.0])
}

#[test]
fn base_law_is_identified_from_the_prior() {
    let (prepared, _) = prepared_gel(0.0);
    let (f, data) = fit_base_law(&prepared).expect("a fit");
    let (fitted, truth) = (&f.model.tissue.layers[0], &gel_tissue().layers[0]);
    assert!((fitted.stiffness_n_per_m / truth.stiffness_n_per_m - 1.0).abs() < 0.02, "{fitted:?}");
    assert!(f.model.effects.is_empty() && f.model.rupture_times_s.iter().all(|t| t[0].is_finite()));
    assert!((2e-3..2e-2).contains(&data.noise.sd_n()), "{}", data.noise.sd_n());
}

#[test]
fn full_and_coarse_refits_recover_the_strength_of_an_effect() {
    let (prepared, data) = prepared_gel(60.0);
    let strength = |f: Option<Fit>| f.expect("a fit").model.effects[0].values[0];
    let coarse = data.with_recordings(data.recordings.iter().map(|b| b.coarsened(3)).collect());
    for fitted in [
        refit_from_prior(&prepared, &[dry_friction()], NO_RANDOM_EFFECTS, &data),
        coarse_refit(&prepared, &[dry_friction()], NO_RANDOM_EFFECTS, &coarse),
    ] {
        let fitted = strength(fitted);
        assert!((fitted / 60.0 - 1.0).abs() < 0.2, "{fitted}");
    }
}

#[test]
fn wrong_rupture_times_are_corrected_by_a_refit_with_random_effects() {
    let (prepared, _) = prepared_gel(0.0);
    let (base_fit, data) = fit_base_law(&prepared).expect("a fit");
    let rupture_times_s = |f: &Fit| f.model.rupture_times_s.iter().map(|t| t[0]).collect::<Vec<_>>();
    // A fit that leaves only noise is kept.
    let (same, _) = refit_with_random_effects(&prepared, base_fit.clone(), data.clone());
    assert_eq!((same.nats(), rupture_times_s(&same)), (base_fit.nats(), rupture_times_s(&base_fit)));
    let mut wrong = base_fit.clone();
    wrong.model.rupture_times_s.iter_mut().for_each(|t| t[0] -= 0.8);
    wrong.residuals = residuals(&wrong.model, &data).expect("a replay");
    let (fitted, _) = refit_with_random_effects(&prepared, wrong, data);
    for (fitted, truth) in rupture_times_s(&fitted).iter().zip(rupture_times_s(&base_fit)) {
        assert!((fitted - truth).abs() < 0.02, "{fitted} for {truth}");
    }
}

/// A coarse refit uses only the blocks that it is given.
#[test]
fn coarse_refit_uses_the_coarse_blocks_only() {
    let (prepared, data) = prepared_gel(60.0);
    let coarse = data.with_recordings(data.recordings.iter().map(|b| b.coarsened(3)).collect());
    let less = PreparedRecordings { blocks: Arc::clone(&coarse.recordings), ..prepared.clone() };
    let fitted = |p: &PreparedRecordings| {
        let f = coarse_refit(p, &[dry_friction()], NO_RANDOM_EFFECTS, &coarse).expect("a fit");
        (f.nats(), f.model.tissue.layers[0].stiffness_n_per_m)
    };
    assert_eq!(fitted(&prepared), fitted(&less));
}

/// The noise is a share of the largest force, or the blocks' own; the better of a strict and a lenient assignment
/// is kept.
#[test]
fn drops_are_assigned_under_a_wide_noise() {
    let (prepared, _) = prepared_gel(60.0);
    let (fitted, data) = fit_with_assigned_drops(&prepared, &[], NO_RANDOM_EFFECTS).expect("a fit");
    assert!((data.noise.sd_n() / (FIRST_NOISE_SHARE * prepared.largest_force_n()) - 1.0).abs() < 1e-12);
    let rough_n = roughness(&prepared.blocks);
    assert!(rough_n < 0.5 * data.noise.sd_n());
    let wide_noise = FitData::new(Arc::clone(&prepared.blocks), Noise::white(data.noise.sd_n()), 0.0);
    let fit_assigned = |from: &Model, strictness: f64| {
        let rupture_times_s = assign_ruptures(from, &prepared.blocks, &prepared.drops, strictness, rough_n);
        let next = Model { rupture_times_s, ..from.clone() };
        fit(&next, &wide_noise, Effort { max_iterations: 4, min_gain_nats: 0.3 }).expect("a fit")
    };
    let first = fit_assigned(&Model::base(prepared.assumed.clone(), 2), 1.0);
    let second = fit_assigned(&first.model, 0.5);
    assert_eq!(fitted.nats(), first.nats().min(second.nats()));
    assert!(fitted.model.rupture_times_s.iter().all(|t| t[0].is_finite()));
}
