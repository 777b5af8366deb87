//! Effects that were found and are too small to matter: traces.

use crate::diagnosis_json::Cause;
use crate::effect_selection::Search;
use crate::held_out::{FreeRunResidual, held_out_residuals_with_random_effects, pooled_rms};
use rayon::prelude::*;
use stylet_identify::fit::{Effort, fit};
use stylet_tissue::{ChainStage, EffectInfo, Proposal};

/// A trace.
#[derive(Clone, Debug)]
pub struct Negligible {
    /// Effect.
    pub effect: String,
    /// Why.
    pub reason: String,
}

/// A cause changes the left-out root mean square by at least this share of the noise.
const LEAST_SHARE: f64 = 0.002;
/// A lag or a delay below this share of the sampling step is none: positions and forces of one row are of no nearer instants, and half a
/// step of a simulation at 1 kHz is a tenth of one at 200 Hz.
const OF_STEP: f64 = 0.12;
/// A motion below this share of the encoder's noise is none.
const OF_ENCODER: f64 = 0.1;
/// A cause that brings back less than this share of the noise's variance is asked whether it pays.
const ASKED: f64 = 0.3;

/// A law is right to this share of the force that it explains: what gains less beside it may be its error. Motions are recorded with steps
/// and noise, and a simulation integrates.
const LAW_ERROR: f64 = 0.07;

/// Causes that are traces; `against_none` are the nats that speak against an effect's having no strength.
#[must_use]
pub fn negligible_effects(
    search: &Search,
    after: &[Option<FreeRunResidual>],
    causes: &[Cause],
    against_none: &[(String, f64)],
) -> Vec<Negligible> {
    let noise_n = crate::held_out::sample_noise_sd_n(&search.data);
    let free = search.best.model.free;
    let with_n = if free.recording_surface || free.recording_friction {
        pooled_rms(&held_out_residuals_with_random_effects(&search.best, &search.data), &search.data)
    } else {
        pooled_rms(after, &search.data)
    };
    let effects = &search.best.model.effects;
    let compared = search.data.compared_block_count() as f64;
    let one = |c: &Cause| -> Option<Negligible> {
        let k = effects.iter().position(|e| e.info.id == c.effect)?;
        let why = |why: String| Some(Negligible { effect: c.effect.clone(), reason: why });
        if let Some(reason) = unresolved(search, k) {
            return why(reason);
        }
        if unsure(c, against_none, search) {
            return why("too uncertain to be told from none after a search through every effect".to_owned());
        }
        let without = fit(
            &search.best.model.without_effect(k),
            &search.data,
            Effort { max_iterations: 4, min_gain_nats: 0.5 },
        )?;
        let lost = (without.nats() - search.best.nats()) / compared;
        let explained =
            causes.iter().filter(|o| o.effect != c.effect).map(|o| o.gain_nats).fold(0.0, f64::max);
        if at_every_sample(effects[k].info) && lost * compared < LAW_ERROR * LAW_ERROR * explained {
            return why("no more than the error that the law of a far greater cause may have".to_owned());
        }
        if lost > ASKED {
            return None;
        }
        let without_n =
            pooled_rms(&held_out_residuals_with_random_effects(&without, &search.data), &search.data);
        let gained = (without_n - with_n) / noise_n;
        (gained < LEAST_SHARE).then(|| {
            let change = if gained < 0.0 {
                "makes left-out recordings no better"
            } else {
                "changes left-out recordings by less than 0.2 % of the noise"
            };
            Negligible { effect: c.effect.clone(), reason: change.to_owned() }
        })
    };
    causes.par_iter().filter_map(one).collect()
}

/// Whether every strength of a cause is less sure than what the search asked for, slow noise counted in full and the geometry unsure.
fn unsure(cause: &Cause, against_none: &[(String, f64)], search: &Search) -> bool {
    let stage = search.stages.iter().find(|s| s.selected.is_some_and(|t| t.0 == cause.effect));
    let against = against_none.iter().find(|a| a.0 == cause.effect);
    stage.zip(against).is_some_and(|(stage, (_, nats))| *nats < stage.required_nats)
}

/// Whether an effect shows in every sample, and not only where something gives way.
fn at_every_sample(info: &EffectInfo) -> bool {
    !matches!(info.stage, ChainStage::Puncture | ChainStage::Release | ChainStage::Geometry)
        && !matches!(info.proposal, Proposal::MembraneRupture | Proposal::RawSamples)
}

/// Why the number of an effect lies below what the instrument resolves.
fn unresolved(search: &Search, k: usize) -> Option<String> {
    let choice = &search.best.model.effects[k];
    let step_s = search.data.recordings.iter().map(|b| b.sample_step_s).fold(f64::INFINITY, f64::min);
    for (p, value) in choice.info.parameters.iter().zip(&choice.values) {
        if p.strength && p.unit == "s" && choice.info.stage == ChainStage::Sensor && *value < OF_STEP * step_s
        {
            return Some("below an eighth of the sampling step".to_owned());
        }
        if p.strength && p.unit == "m" && choice.info.proposal == Proposal::TissueMotion {
            let noise_m = search.data.recordings.iter().map(|b| b.motion.noise_m).fold(0.0, f64::max);
            if *value < OF_ENCODER * noise_m {
                return Some("below a tenth of the encoder's noise".to_owned());
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::{at_every_sample, negligible_effects, unresolved, unsure};
    use crate::diagnosis_json::Cause;
    use crate::effect_selection::Search;
    use crate::held_out::{
        FreeRunResidual, held_out_residuals_with_random_effects, pooled_rms, sample_noise_sd_n,
    };
    use crate::test_fixtures::{assumed_layers, fit_from_truth, recordings_with_added_force, search_stage};
    use std::collections::BTreeMap;
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, Fit, fit};
    use stylet_identify::likelihood::{FitData, Residuals};
    use stylet_identify::model::{EffectTerm, Model};
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;
    use stylet_tissue::{AnyEffect, CoulombFriction, Effect, ForceBias, ForceDrift, LowPassLag, Respiration};

    fn cause(effect: &str, gain_nats: f64) -> Cause {
        Cause {
            effect: effect.to_owned(),
            equivalent: Vec::new(),
            confidence: 1.0,
            parameters: BTreeMap::new(),
            gain_nats,
            share: 0.0,
        }
    }

    fn search(effects: &[AnyEffect]) -> Search {
        let belief = assumed_layers(&[]);
        let mut model = Model::base(belief, 2);
        model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        // One at 100 Hz and one at 50 Hz, positions to 20 micrometres.
        let blocks = [100.0, 50.0].map(|hz: f64| {
            let t: Vec<f64> = (0..400).map(|k| f64::from(k) / hz).collect();
            let z = t
                .iter()
                .enumerate()
                .map(|(k, t)| 1e-3 * t + 2e-5 * (((k * 7919) % 101) as f64 / 101.0 - 0.5))
                .collect();
            BlockAverages::new(&Recording::new(t, z, vec![0.0; 400]).expect("a recording"), &[], BLOCK_S)
        });
        let data = FitData::new(Arc::new(blocks.to_vec()), Noise::white(0.02), 0.0);
        let residuals =
            Residuals { residual_n: Vec::new(), innovations: Vec::new(), ruptures: Vec::new(), nats: 0.0 };
        Search::for_tests(Fit { model, residuals }, data)
    }

    #[test]
    fn what_lies_below_an_eighth_of_a_step_or_a_tenth_of_the_encoders_noise_is_not_resolved() {
        let lag = |time_constant_s: f64| unresolved(&search(&[LowPassLag { time_constant_s }.into()]), 0);
        assert_eq!(lag(1.1e-3).as_deref(), Some("below an eighth of the sampling step"));
        assert_eq!(lag(1.3e-3), None);
        let noise_m = search(&[]).data.recordings.iter().map(|b| b.motion.noise_m).fold(0.0, f64::max);
        assert!(noise_m > 1e-6, "{noise_m}");
        let breath = |amplitude_m: f64| {
            let e = Respiration { amplitude_m, frequency_hz: 0.3, phase_rad: 0.0 };
            unresolved(&search(&[CoulombFriction { c_n_per_m: 1.0 }.into(), e.into()]), 1)
        };
        assert_eq!(breath(0.09 * noise_m).as_deref(), Some("below a tenth of the encoder's noise"));
        assert_eq!(breath(0.11 * noise_m), None);
        // A length that is not a motion's is another matter.
        assert_eq!(unresolved(&search(&[CoulombFriction { c_n_per_m: 1e-9 }.into()]), 0), None);
    }

    #[test]
    fn a_cause_is_unsure_when_less_speaks_against_none_than_the_search_asked_for() {
        let mut s = search(&[]);
        s.stages = vec![search_stage(Some(("force_bias", 30.0)), 8.0, &[])];
        let told =
            |effect: &str, nats: f64| unsure(&cause(effect, 0.0), &[("force_bias".to_owned(), nats)], &s);
        assert!(told("force_bias", 7.9) && !told("force_bias", 8.0) && !told("force_drift", 1.0));
        assert!(!unsure(&cause("force_bias", 0.0), &[], &s));
    }

    #[test]
    fn effects_at_ruptures_faces_and_breaks_do_not_show_in_every_sample() {
        let shows = |id: &str| at_every_sample(stylet_tissue::effect_info(id).expect("in the library"));
        for id in [
            "coulomb_friction",
            "force_drift",
            "time_delay",
            "respiration",
            "position_scale",
            "stress_relaxation",
        ] {
            assert!(shows(id), "{id}");
        }
        for id in [
            "rate_dependent_puncture",
            "incomplete_release",
            "boundary_shift",
            "hidden_membrane",
            "force_spikes",
            "saturation",
        ] {
            assert!(!shows(id), "{id}");
        }
    }

    /// What is said of a drift of 20 mN/s that gained so many nats, and of a bias beside it, of this size (N) and in the law.
    fn said(bias_n: f64, drift_nats: f64) -> (Search, Vec<(String, String)>) {
        let at = [[4e-3, 3e-4], [5e-3, -3e-4], [6e-3, 0.0]];
        let runs = recordings_with_added_force(&[], &at, |t| bias_n + 0.02 * t);
        let effects: [AnyEffect; 2] =
            [ForceDrift { rate_n_per_s: 0.02 }.into(), ForceBias { force_n: bias_n }.into()];
        let f = fit_from_truth(&effects, &runs.iter().collect::<Vec<_>>());
        let search = Search::for_tests(f.fit, f.data);
        let after = held_out_residuals_with_random_effects(&search.best, &search.data);
        let causes = [cause(effects[0].id(), drift_nats), cause(effects[1].id(), 0.0)];
        let told = negligible_effects(&search, &after, &causes, &[]);
        (search, told.into_iter().map(|s| (s.effect, s.reason)).collect())
    }

    /// What gains less than 7 % of the force of a greater cause, 0.49 % of its nats, may be that cause's law's error.
    #[test]
    fn a_cause_is_small_beside_one_whose_law_may_err_by_as_much() {
        // Recordings left out show both, be the bias as large as the drift or as the noise.
        assert!(said(0.2, 0.0).1.is_empty());
        let (search, told) = said(0.02, 0.0);
        assert!(told.is_empty(), "{told:?}");
        let without = fit(
            &search.best.model.without_effect(1),
            &search.data,
            Effort { max_iterations: 4, min_gain_nats: 0.5 },
        )
        .expect("a fit");
        let lost = without.nats() - search.best.nats();
        assert!(lost > 10.0, "{lost}");
        for (share, small) in [(0.9, false), (1.1, true)] {
            let (_, told) = said(0.02, lost / 0.0049 * share);
            assert_eq!(!told.is_empty(), small, "{told:?}");
            assert!(
                told.iter().all(|t| t.0 == "force_bias" && t.1.contains("far greater cause")),
                "{told:?}"
            );
        }
    }

    /// What is said of a bias of this size (N) where recordings left out have this error (N), told from the error without it and the noise.
    fn asked(bias_n: f64, with_n: impl Fn(f64, f64) -> f64) -> Option<String> {
        let bias: AnyEffect = ForceBias { force_n: bias_n }.into();
        let runs = recordings_with_added_force(&[], &[[4e-3, 0.0], [6e-3, 0.0]], |_| bias_n);
        let f = fit_from_truth(std::slice::from_ref(&bias), &runs.iter().collect::<Vec<_>>());
        let mut model = f.fit.model;
        (model.free.recording_surface, model.free.recording_friction) = (false, false);
        let fitted = |m: &Model, effort| fit(m, &f.data, effort).expect("a fit");
        let search = Search::for_tests(fitted(&model, Effort::FULL), f.data.clone());
        let without =
            fitted(&search.best.model.without_effect(0), Effort { max_iterations: 4, min_gain_nats: 0.5 });
        let left = pooled_rms(&held_out_residuals_with_random_effects(&without, &f.data), &f.data);
        let square_n2 = with_n(left, sample_noise_sd_n(&f.data)).powi(2)
            - f.data.recordings[0].within_block_sd_n().powi(2);
        let after = [
            Some(FreeRunResidual {
                mean_square_n2: square_n2,
                compared_blocks: 1,
                ..FreeRunResidual::default()
            }),
            None,
        ];
        negligible_effects(&search, &after, &[cause(bias.id(), 0.0)], &[]).pop().map(|s| s.reason)
    }

    #[test]
    fn a_weak_cause_has_to_pay_on_recordings_left_out() {
        let pays = |share: f64| asked(3e-3, |left, noise| left - share * noise);
        assert_eq!(pays(-0.1).as_deref(), Some("makes left-out recordings no better"));
        assert_eq!(
            pays(0.0015).as_deref(),
            Some("changes left-out recordings by less than 0.2 % of the noise")
        );
        assert_eq!((pays(0.0025), pays(0.02)), (None, None));
        // A strong one is not asked.
        assert_eq!(asked(0.05, |left, _| 2.0 * left), None);
    }

    #[test]
    fn where_recordings_have_numbers_of_their_own_these_are_granted() {
        let bias: AnyEffect = ForceBias { force_n: 1e-5 }.into();
        let runs = recordings_with_added_force(&[], &[[4e-3, 0.0], [6e-3, 0.0]], |_| 0.0);
        let f = fit_from_truth(std::slice::from_ref(&bias), &runs.iter().collect::<Vec<_>>());
        let mut search = Search::for_tests(f.fit, f.data);
        let cause = cause(bias.id(), 0.0);
        // Left out with nothing granted they are far off.
        let after = [
            Some(FreeRunResidual { mean_square_n2: 1.0, compared_blocks: 1, ..FreeRunResidual::default() }),
            None,
        ];
        let mut told = |own_surface: bool, own_friction: bool| {
            let free = &mut search.best.model.free;
            (free.recording_surface, free.recording_friction) = (own_surface, own_friction);
            negligible_effects(&search, &after, std::slice::from_ref(&cause), &[]).len()
        };
        assert_eq!((told(true, true), told(true, false), told(false, false)), (0, 0, 1));
    }
}
