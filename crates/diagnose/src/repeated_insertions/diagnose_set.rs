//! The whole: from a set of insertions to its diagnosis, with the error on insertions that took no part.

use crate::diagnosis_json::{
    Cause, Diagnosis, Estimate, Gain, NegligibleEffect, NoiseReport, RandomEffectSd, ResidualStructureReport,
    SearchCandidate, SearchStep, Verdict,
};
use crate::repeated_insertions::cross_validation::{
    HeldOutPrediction, leave_one_out, leave_speed_out, repeatability_floor,
};
use crate::repeated_insertions::instrument_faults::{
    CalibratedRecordings, InstrumentReport, ReferenceRecordings,
};
use crate::repeated_insertions::mean_scenario::mean_scenario;
use crate::repeated_insertions::model_selection::{
    CandidateModels, ModelFamily, ScoredModel, active_effects, have_several_speeds, paired_confidence,
    select_model, shaft_slip_info,
};
use crate::repeated_insertions::nested_cross_validation::nested_cross_validation;
use crate::repeated_insertions::parameter_estimates::{
    ParameterEstimate, base_parameters, jackknife_estimates,
};
use crate::repeated_insertions::repeatability_report::{
    AblationRow, RepeatabilityReport, ReportInputs, repeatability_report,
};
use crate::repeated_insertions::start_values::{SegmentedRecording, group_by_speed_and_stroke};
use crate::residual_tests;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::collections::BTreeMap;
use stylet_identify::insertion_phases::noise_n;
use stylet_record::sensor_artefacts;
use stylet_scenario::Scenario;
use stylet_tissue::{DelayedPuncture, Effect, PowerLawFriction, RateDependentPuncture, Tissue};

/// Seed of what the starts begin with.
const SEED: u64 = 1;
/// The unknown dominates when more than this share of what the base law leaves beyond the floor is still left,
const UNEXPLAINED: f64 = 0.1;
/// and insertions left out are predicted worse than by another one by this share.
const BEYOND_FLOOR: f64 = 0.2;
/// An effect of which a number stands where it may not go further is sure to this degree at most.
const AT_A_BOUND: f64 = 0.9;

/// The study of a set.
pub struct SetDiagnosis {
    /// Laws that were tried.
    pub candidates: CandidateModels,
    /// Every run predicted without it by the best law.
    pub held_out: Vec<HeldOutPrediction>,
    /// And by the base law.
    pub base_held_out: Vec<HeldOutPrediction>,
    /// The verdict and all that goes with it.
    pub diagnosis: Diagnosis,
    /// What repeats add.
    pub report: RepeatabilityReport,
    /// The mean insertion as a scenario.
    pub mean_scenario: Scenario,
    /// The insertions as they were studied: what the instrument shows is undone.
    pub recordings: Vec<SegmentedRecording>,
}

/// Studies insertions. What the instrument shows by itself is undone first.
#[must_use]
pub fn diagnose_set(
    name: &str,
    believed: &Tissue,
    runs: &[&SegmentedRecording],
    checks: &ReferenceRecordings,
    mut progress: impl FnMut(&str),
) -> Option<SetDiagnosis> {
    let instrument = InstrumentReport::assess(checks, runs, believed.surface_m);
    let CalibratedRecordings { recordings: undone, raw } = instrument.calibrate(runs);
    let runs: Vec<&SegmentedRecording> = undone.iter().collect();
    let runs = runs.as_slice();
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let laws = select_model(believed, runs, &raw, &mut rng, &mut progress)?;
    progress("every run predicted without it");
    let out = leave_one_out(&laws.best.set_fit, runs);
    let base_out = base_out(&laws, &out, runs);
    let by_speed = |law: &ScoredModel| have_several_speeds(runs).then(|| leave_speed_out(&law.set_fit, runs));
    let (speed_out, base_speed_out) = (by_speed(&laws.best), by_speed(&laws.base));
    let floors = repeatability_floor(runs);
    let standing = ReportInputs {
        recordings: runs,
        model: &laws.best,
        held_out: &out,
        base_held_out: &base_out,
        held_out_speeds: speed_out.as_deref(),
        base_held_out_speeds: base_speed_out.as_deref(),
        floors: &floors,
    };
    let repeats = repeatability_report(&standing, bought(&laws), instrument);
    let diagnosis = diagnosis(&laws, runs, believed, &out, &repeats, &raw);
    let extended = mean_scenario(name, &laws.best.set_fit.fit.model, runs, &repeats.instrument);
    Some(SetDiagnosis {
        candidates: laws,
        held_out: out,
        base_held_out: base_out,
        diagnosis,
        report: repeats,
        mean_scenario: extended,
        recordings: undone,
    })
}

impl SetDiagnosis {
    /// Asks what parts of the set are predicted to when the law and its parts are chosen without them.
    pub fn run_nested_cross_validation(&mut self) {
        let runs: Vec<&SegmentedRecording> = self.recordings.iter().collect();
        self.report.nested = nested_cross_validation(&self.candidates, &runs);
    }
}

/// Every run predicted without it by the base law, `out` being what the best one predicts.
fn base_out(
    laws: &CandidateModels,
    out: &[HeldOutPrediction],
    runs: &[&SegmentedRecording],
) -> Vec<HeldOutPrediction> {
    if laws.best.family == ModelFamily::Base { out.to_vec() } else { leave_one_out(&laws.base.set_fit, runs) }
}

/// What each law and each part of the best one buys.
fn bought(laws: &CandidateModels) -> Vec<AblationRow> {
    let mut out = Vec::new();
    let of = |step: String, law: &ScoredModel| AblationRow {
        step,
        held_out_n: law.held_out_n(),
        without_n: None,
        kept: law.family == laws.best.family,
    };
    if let Some(law) = &laws.library {
        out.push(of("base law with what the library adds".to_owned(), law));
    }
    if let Some(law) = &laws.slip {
        out.push(of("a shaft that slips".to_owned(), law));
    }
    for part in &laws.terms {
        out.push(AblationRow {
            step: part.name.clone(),
            held_out_n: laws.best.held_out_n(),
            without_n: Some(stylet_stats::mean(&part.without_n)).filter(|e| e.is_finite()),
            kept: part.kept,
        });
    }
    out
}

fn diagnosis(
    laws: &CandidateModels,
    runs: &[&SegmentedRecording],
    believed: &Tissue,
    out: &[HeldOutPrediction],
    repeats: &RepeatabilityReport,
    raw: &sensor_artefacts::SensorArtefacts,
) -> Diagnosis {
    let best = &laws.best;
    let model = &best.set_fit.fit.model;
    let told = jackknife_estimates(&best.set_fit, out);
    let mean = &repeats.mean;
    let noise = repeats
        .instrument
        .noise_n
        .unwrap_or_else(|| stylet_stats::median_of(runs.iter().map(|r| noise_n(&r.recording.force_n))));
    let unsure = |id: &str| laws.terms.iter().any(|p| p.is_uncertain() && p.effect == id);
    let mut causes: Vec<Cause> = active_effects(model)
        .into_iter()
        .filter(|id| !unsure(id))
        .map(|id| {
            let whole = if id == shaft_slip_info().id { Some(laws.base.errors_n.clone()) } else { None };
            let without = whole
                .or_else(|| laws.terms.iter().find(|p| p.kept && p.name == id).map(|p| p.without_n.clone()))
                .unwrap_or_default();
            cause(id, &told, paired_confidence(&without, &best.errors_n), &without, best, &laws.base)
        })
        .collect();
    causes.sort_by(|a, b| b.share.total_cmp(&a.share));
    causes.extend(repeats.instrument.detected.iter().map(|s| s.cause()));
    causes.extend(crate::sensor_artefact_causes::sensor_artefact_causes(raw, noise));
    let floor_n = mean.floor_n.unwrap_or(noise);
    let beyond = |e: f64| (e * e - floor_n * floor_n).max(0.0);
    let share = if best.family == ModelFamily::Base {
        1.0
    } else {
        (beyond(mean.model_n) / beyond(mean.base_n).max(1e-12)).min(1.0)
    };
    let unknown =
        share > UNEXPLAINED && mean.model_n > (1.0 + BEYOND_FLOOR) * floor_n && mean.floor_n.is_some();
    let told_left = residual_tests::test_residuals(&best.set_fit.fit, &best.set_fit.data).coloured_noise;
    let verdict = match (unknown, causes.is_empty()) {
        (true, _) => Verdict::Unknown,
        (false, true) => Verdict::None,
        (false, false) => Verdict::Named,
    };
    let scatter = &model.scatter;
    Diagnosis {
        verdict,
        causes,
        base_parameters: base_parameters(&told, believed),
        not_identifiable: untold(best, runs),
        gain: Gain {
            held_out: true,
            recordings: runs.iter().map(|r| r.name.clone()).collect(),
            rmse_before_n: mean.base_n,
            rmse_after_n: mean.with_discrepancy_n,
            floor_n,
            per_recording_n: repeats.recordings.iter().map(|r| (r.base_n, r.with_discrepancy_n)).collect(),
        },
        negligible: dropped(laws),
        residual_structure: ResidualStructureReport {
            p_value: told_left.p_value,
            depends_on: told_left.depends_on.iter().map(|d| d.0.clone()).collect(),
            nats: told_left.nats,
            share: if unknown || best.family != ModelFamily::Base { share } else { 0.0 },
        },
        data_quality: crate::repeated_insertions::repeatability_report::data_quality(runs),
        search_steps: vec![evidence(laws)],
        noise: NoiseReport {
            sd_n: noise,
            ar: [repeats.instrument.ar1.unwrap_or(0.0), 0.0],
            from_air: repeats.instrument.noise_n.is_some(),
        },
        random_effect_sd: RandomEffectSd {
            puncture: scatter.rupture_force,
            rupture_depth_m: scatter.rupture_depth_m,
            surface_m: scatter.surface_m,
            friction: scatter.ln_friction,
        },
        advice: advice(best, &told),
    }
}

/// What insertions at one speed cannot say; that a puncture waits only where no force at which a layer gives way would do.
fn untold(best: &ScoredModel, runs: &[&SegmentedRecording]) -> Vec<String> {
    let all = [
        PowerLawFriction { exponent: 1.0 }.info().id,
        RateDependentPuncture { alpha: 0.0 }.info().id,
        DelayedPuncture::default().info().id,
    ];
    let named = active_effects(&best.set_fit.fit.model);
    let untold = all.iter().filter(|id| !have_several_speeds(runs) && !named.contains(id));
    untold.map(|id| (*id).to_owned()).collect()
}

fn cause(
    id: &str,
    told: &[ParameterEstimate],
    confidence: f64,
    without: &[f64],
    best: &ScoredModel,
    base: &ScoredModel,
) -> Cause {
    let parameters: BTreeMap<String, Estimate> =
        told.iter().filter(|t| t.owner == id).map(|t| (t.path.clone(), t.estimate())).collect();
    let bound = told.iter().any(|t| t.owner == id && t.at_bound);
    let square = |e: &[f64]| stylet_stats::mean(&e.iter().map(|e| e * e).collect::<Vec<_>>());
    let explained = (square(&base.errors_n) - square(&best.errors_n)).max(1e-12);
    let share = (square(without) - square(&best.errors_n)) / explained;
    Cause {
        effect: id.to_owned(),
        equivalent: Vec::new(),
        confidence: if bound { confidence.min(AT_A_BOUND) } else { confidence },
        parameters,
        gain_nats: (base.set_fit.fit.nats() - best.set_fit.fit.nats()).max(0.0),
        share: if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 },
    }
}

/// Parts that the law was found to do without, and effects that it predicts better with, but not surely.
fn dropped(laws: &CandidateModels) -> Vec<NegligibleEffect> {
    let part = |p: &crate::repeated_insertions::model_selection::ModelTerm| NegligibleEffect {
        effect: p.effect.to_owned(),
        parameters: BTreeMap::new(),
        reason: format!(
            "{}: recordings left out are predicted to {:.3} N without it, {:.3} N with it{}",
            p.name,
            stylet_stats::mean(&p.without_n),
            laws.best.held_out_n(),
            if p.kept { ": too few to be sure, so that it stays in the law without a name" } else { "" }
        ),
    };
    laws.terms.iter().filter(|p| !p.kept || p.is_uncertain()).map(part).collect()
}

fn evidence(laws: &CandidateModels) -> SearchStep {
    let rival = |name: &str, law: &ScoredModel| SearchCandidate {
        effect: name.to_owned(),
        gain_nats: laws.base.set_fit.fit.nats() - law.set_fit.fit.nats(),
        parameters: law.set_fit.fit.model.effect_parameter_count(),
        screened_only: false,
    };
    let mut rivals = Vec::new();
    rivals.extend(laws.slip.as_ref().map(|l| rival(shaft_slip_info().id, l)));
    rivals.extend(laws.library.as_ref().map(|l| rival(&active_effects(&l.set_fit.fit.model).join(", "), l)));
    SearchStep {
        included: Vec::new(),
        candidates: rivals,
        required_nats: 0.0,
        selected: (laws.best.family != ModelFamily::Base)
            .then(|| active_effects(&laws.best.set_fit.fit.model).join(", ")),
    }
}

/// What a reader should know before believing the numbers.
fn advice(best: &ScoredModel, told: &[ParameterEstimate]) -> Vec<String> {
    let mut out = Vec::new();
    let bounds: Vec<String> =
        told.iter().filter(|t| t.at_bound).map(|t| format!("{} of {}", t.path, t.owner)).collect();
    if !bounds.is_empty() {
        out.push(format!(
            "These numbers stand where they may not go further, so that their values say little: {}.",
            bounds.join(", ")
        ));
    }
    let (starts, agree) = best.set_fit.starts;
    if best.family == ModelFamily::ShaftSlip && 2 * agree < starts {
        out.push(format!(
            "Only {agree} of {starts} starts came to this optimum: more insertions would make it surer."
        ));
    }
    out
}

/// Groups of one speed and stroke with their mean speed, slowest first.
#[must_use]
pub fn mean_speeds(runs: &[&SegmentedRecording]) -> Vec<(f64, Vec<usize>)> {
    let mean = |g: &[usize]| g.iter().map(|i| runs[*i].speed_mps).sum::<f64>() / g.len().max(1) as f64;
    group_by_speed_and_stroke(runs).into_iter().map(|g| (mean(&g), g)).collect()
}

#[cfg(test)]
mod tests {
    use super::{BEYOND_FLOOR, advice, base_out, bought, cause, diagnosis, dropped, evidence, mean_speeds};
    use crate::diagnosis_json::{Diagnosis, Verdict};
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::cross_validation::HeldOutPrediction;
    use crate::repeated_insertions::instrument_faults::InstrumentReport;
    use crate::repeated_insertions::model_selection::{
        CandidateModels, ModelFamily, ModelTerm, ScoredModel, paired_confidence,
    };
    use crate::repeated_insertions::parameter_estimates::ParameterEstimate;
    use crate::repeated_insertions::repeatability_report::{MeanReport, RepeatabilityReport, Variability};
    use crate::test_fixtures;
    use stylet_record::Recording;
    use stylet_record::sensor_artefacts::SensorArtefacts;
    use stylet_tissue::{AnyEffect, CoulombFriction};

    fn law(kind: ModelFamily, errors_n: &[f64], nats: f64, with: bool) -> ScoredModel {
        let rubs: [AnyEffect; 1] = [CoulombFriction { c_n_per_m: 3.0 }.into()];
        test_fixtures::unmeasured_candidate(kind, &rubs[..usize::from(with)], errors_n, nats)
    }

    #[test]
    fn a_causes_share_is_what_comes_back_without_it_of_all_that_was_explained() {
        let base = law(ModelFamily::Base, &[0.5, 0.7], -20.0, false);
        let best = law(ModelFamily::Library, &[0.2, 0.1], -150.0, true);
        let told = |at_bound| ParameterEstimate {
            owner: "coulomb_friction".to_owned(),
            path: "c_n_per_m".to_owned(),
            value: 3.0,
            low: 2.0,
            high: 4.5,
            at_bound,
        };
        let other = ParameterEstimate {
            owner: "release_depth".to_owned(),
            path: "depth_m".to_owned(),
            at_bound: true,
            ..told(false)
        };
        let c = cause("coulomb_friction", &[told(false), other.clone()], 0.97, &[0.3, 0.4], &best, &base);
        // Mean squares 0.37, 0.025 and 0.125.
        assert!((c.share - (0.125 - 0.025) / (0.37 - 0.025)).abs() < 1e-12, "{}", c.share);
        let nats = base.set_fit.fit.nats() - best.set_fit.fit.nats();
        assert!((c.gain_nats - nats).abs() < 1e-9 && (nats - 130.0).abs() < 20.0, "{}", c.gain_nats);
        assert_eq!((c.confidence, c.parameters.len(), c.parameters["c_n_per_m"].high), (0.97, 1, 4.5));
        // At a bound nothing is surer than nine of ten.
        let c = cause("coulomb_friction", &[told(true)], 0.97, &[0.3, 0.4], &best, &base);
        assert_eq!(c.confidence, 0.9);
        assert_eq!(cause("coulomb_friction", &[told(true)], 0.6, &[0.3, 0.4], &best, &base).confidence, 0.6);
        // More than all is all, less than nothing nothing; where nobody knows it is all.
        assert_eq!(cause("x", &[], 1.0, &[3.0, 4.0], &best, &base).share, 1.0);
        assert_eq!(cause("x", &[], 1.0, &[0.01, 0.01], &best, &base).share, 0.0);
        assert_eq!(cause("x", &[], 1.0, &[f64::NAN, 0.01], &best, &base).share, 1.0);
        assert_eq!(cause("x", &[], 1.0, &[0.3], &base, &best).gain_nats, 0.0);
    }

    fn laws() -> CandidateModels {
        let part = |name: &str, without_n: &[f64], kept| ModelTerm {
            effect: "shaft_slip",
            name: name.to_owned(),
            without_n: without_n.to_vec(),
            held_out_loss: Vec::new(),
            held_out_speed_loss: Vec::new(),
            gain_nats: 0.0,
            kept,
            significant: kept,
        };
        CandidateModels {
            base: law(ModelFamily::Base, &[0.5, 0.7], -20.0, false),
            library: Some(law(ModelFamily::Library, &[0.3, 0.1], -90.0, true)),
            slip: Some(law(ModelFamily::ShaftSlip, &[0.25, 0.35], -70.0, true)),
            best: law(ModelFamily::Library, &[0.3, 0.1], -90.0, true),
            terms: vec![
                part("wear", &[0.4, 0.6], true),
                part("rate", &[0.21, 0.2], false),
                part("lost", &[f64::INFINITY], true),
            ],
        }
    }

    #[test]
    fn what_each_law_buys_is_told_with_what_was_kept() {
        let all = bought(&laws());
        let told: Vec<(&str, f64, Option<f64>, bool)> = all
            .iter()
            .map(|b| {
                (
                    b.step.as_str(),
                    (b.held_out_n * 1e9).round() / 1e9,
                    b.without_n.map(|x| (x * 1e9).round() / 1e9),
                    b.kept,
                )
            })
            .collect();
        assert_eq!(
            told,
            [
                ("base law with what the library adds", 0.2, None, true),
                ("a shaft that slips", 0.3, None, false),
                ("wear", 0.2, Some(0.5), true),
                ("rate", 0.2, Some(0.205), false),
                ("lost", 0.2, None, true),
            ]
        );
        let traces = dropped(&laws());
        assert_eq!(traces.len(), 1);
        assert_eq!(
            (traces[0].effect.as_str(), traces[0].reason.as_str()),
            ("shaft_slip", "rate: recordings left out are predicted to 0.205 N without it, 0.200 N with it")
        );
        let e = evidence(&laws());
        assert_eq!(e.selected.as_deref(), Some("coulomb_friction"));
        let l = laws();
        let gained = |law: &ScoredModel| l.base.set_fit.fit.nats() - law.set_fit.fit.nats();
        assert_eq!(
            (e.candidates[0].effect.as_str(), e.candidates[1].effect.as_str()),
            ("shaft_slip", "coulomb_friction")
        );
        assert!((e.candidates[0].gain_nats - gained(l.slip.as_ref().expect("it"))).abs() < 1e-9);
        assert!(
            (e.candidates[1].gain_nats - gained(&l.best)).abs() < 1e-9 && e.candidates[1].gain_nats > 50.0
        );
        let plain = CandidateModels { best: l.base.clone(), ..laws() };
        assert_eq!(evidence(&plain).selected, None);
    }

    #[test]
    fn numbers_at_a_bound_and_starts_that_disagree_are_told() {
        let told = |at_bound| ParameterEstimate {
            owner: "layer.1".to_owned(),
            path: "stiffness_n_per_m".to_owned(),
            value: 3.0,
            low: 2.0,
            high: 4.5,
            at_bound,
        };
        let (slip, library) =
            (law(ModelFamily::ShaftSlip, &[0.1], 0.0, true), law(ModelFamily::Library, &[0.1], 0.0, true));
        assert!(advice(&library, &[told(false)]).is_empty());
        let one = advice(&library, &[told(true), told(false)]);
        assert!(
            one.len() == 1
                && one[0].ends_with("so that their values say little: stiffness_n_per_m of layer.1."),
            "{one:?}"
        );
        let one = advice(&slip, &[told(false)]);
        assert!(one.len() == 1 && one[0].contains("Only 3 of 8 starts"), "{one:?}");
        // Half of them is enough.
        let mut agree = slip;
        agree.set_fit.starts = (8, 4);
        assert!(advice(&agree, &[]).is_empty());
    }

    #[test]
    fn speeds_are_the_means_of_their_groups() {
        let run = |speed: f64| {
            let t: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
            let z = t.iter().map(|t| (speed * t).min(0.01)).collect();
            SegmentedRecording::new(
                String::new(),
                Recording::new(t, z, vec![0.0; 400]).expect("clean columns"),
                1,
            )
        };
        let mut all = [run(0.004), run(0.002), run(0.002)];
        (all[1].speed_mps, all[2].speed_mps) = (0.00205, 0.002);
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let told = mean_speeds(&refs);
        assert_eq!(told.iter().map(|s| s.1.clone()).collect::<Vec<_>>(), [vec![1, 2], vec![0]]);
        assert!((told[0].0 - 0.002025).abs() < 1e-12 && told[1].0 == all[0].speed_mps);
    }

    /// Repeats whose base law, extended law and floor leave so much (N); the noise is 0.1 N.
    fn repeats(base_n: f64, extended_n: f64, floor_n: Option<f64>) -> RepeatabilityReport {
        RepeatabilityReport {
            recordings: Vec::new(),
            speeds: Vec::new(),
            mean: MeanReport {
                floor_n,
                base_n,
                model_n: extended_n,
                with_discrepancy_n: extended_n,
                ..MeanReport::default()
            },
            phases: Vec::new(),
            variability: Variability {
                surface_m: 0.0,
                friction: 0.0,
                puncture: 0.0,
                day_surface_m: 0.0,
                day_friction: 0.0,
                drops: Vec::new(),
                release_positions_m: Vec::new(),
                residual_n: Vec::new(),
            },
            starts: (8, 3),
            ablation: Vec::new(),
            instrument: InstrumentReport { noise_n: Some(0.1), ..InstrumentReport::default() },
            composition: None,
            nested: None,
        }
    }

    fn told(laws: &CandidateModels, repeats: &RepeatabilityReport) -> Diagnosis {
        diagnosis(laws, &[], &test_fixtures::gel_tissue(), &[], repeats, &SensorArtefacts::default())
    }

    /// Unknown is what a law leaves beyond the floor when that is a tenth of what the base law leaves, and a fifth of the floor.
    #[test]
    fn a_set_is_unknown_when_its_law_leaves_a_tenth_of_what_is_beyond_the_floor() {
        let share = |base: f64, extended: f64| (extended * extended - 0.01) / (base * base - 0.01);
        for (base_n, extended_n, unknown) in [
            (0.5, 0.18, false),
            (0.5, 0.19, true),
            // Less than a fifth above the floor is no structure.
            (0.13, 0.119, false),
            (0.13, 0.121, true),
        ] {
            let d = told(&laws(), &repeats(base_n, extended_n, Some(0.1)));
            assert_eq!(d.verdict, if unknown { Verdict::Unknown } else { Verdict::Named }, "{extended_n}");
            assert!(
                (d.residual_structure.share - share(base_n, extended_n)).abs() < 1e-9,
                "{}",
                d.residual_structure.share
            );
            assert_eq!(
                (d.gain.floor_n, d.gain.rmse_before_n, d.gain.rmse_after_n),
                (0.1, base_n, extended_n)
            );
        }
        // Just a tenth (8 of 80 N^2 beyond a floor of 1 N), or just a fifth above the floor, is known still.
        for (base_n, extended_n) in [(9.0, 3.0), (2.0, 1.0 + BEYOND_FLOOR)] {
            let d = told(&laws(), &repeats(base_n, extended_n, Some(1.0)));
            assert_eq!(d.verdict, Verdict::Named, "{extended_n}");
        }
        // A law that is worse than the base law leaves all, and one below the floor nothing.
        assert_eq!(told(&laws(), &repeats(0.5, 0.6, Some(0.1))).residual_structure.share, 1.0);
        assert_eq!(told(&laws(), &repeats(0.5, 0.05, Some(0.1))).residual_structure.share, 0.0);
        // What is learned beside the law does not make it known.
        let mut learned = repeats(0.5, 0.19, Some(0.1));
        learned.mean.with_discrepancy_n = 0.1;
        assert_eq!(told(&laws(), &learned).verdict, Verdict::Unknown);
        // Without repeats of one speed nobody knows the floor; it is at least the noise.
        let d = told(&laws(), &repeats(0.5, 0.4, None));
        assert_eq!((d.verdict, d.gain.floor_n, d.noise.sd_n), (Verdict::Named, 0.1, 0.1));
    }

    #[test]
    fn the_base_law_alone_is_right_or_unknown() {
        let plain = CandidateModels { best: law(ModelFamily::Base, &[0.5, 0.7], -20.0, false), ..laws() };
        let d = told(&plain, &repeats(0.119, 0.119, Some(0.1)));
        assert_eq!((d.verdict, d.residual_structure.share, d.causes.len()), (Verdict::None, 0.0, 0));
        let d = told(&plain, &repeats(0.121, 0.121, Some(0.1)));
        assert_eq!((d.verdict, d.residual_structure.share), (Verdict::Unknown, 1.0));
    }

    /// Of several parts a cause is judged by its own, where that was kept.
    #[test]
    fn a_cause_is_judged_by_the_part_that_was_kept_of_it() {
        let mut laws = laws();
        laws.best = law(ModelFamily::Library, &[0.2, 0.1], -90.0, true);
        let part = |name: &str, without_n: &[f64], kept| ModelTerm {
            effect: "coulomb_friction",
            name: name.to_owned(),
            without_n: without_n.to_vec(),
            held_out_loss: Vec::new(),
            held_out_speed_loss: Vec::new(),
            gain_nats: 0.0,
            kept,
            significant: kept,
        };
        laws.terms = vec![
            part("coulomb_friction", &[0.9, 0.9], false),
            part("wear", &[0.5, 0.6], true),
            part("coulomb_friction", &[0.3, 0.4], true),
        ];
        let d = told(&laws, &repeats(0.5, 0.12, Some(0.1)));
        assert_eq!(d.causes.len(), 1);
        // Mean squares 0.37, 0.025 and 0.125.
        assert!((d.causes[0].share - 0.1 / 0.345).abs() < 1e-12, "{}", d.causes[0].share);
        assert_eq!(d.causes[0].confidence, paired_confidence(&[0.3, 0.4], &[0.2, 0.1]));
        assert_eq!(d.search_steps[0].selected.as_deref(), Some("coulomb_friction"));
    }

    #[test]
    fn an_effect_that_predicts_better_but_not_surely_is_a_trace_and_stays_in_the_law() {
        let mut laws = laws();
        laws.best = law(ModelFamily::Library, &[0.2, 0.1], -90.0, true);
        laws.terms = vec![ModelTerm {
            effect: "coulomb_friction",
            name: "coulomb_friction".to_owned(),
            without_n: vec![0.3, 0.2],
            held_out_loss: Vec::new(),
            held_out_speed_loss: Vec::new(),
            gain_nats: 0.0,
            kept: true,
            significant: false,
        }];
        let d = told(&laws, &repeats(0.12, 0.12, Some(0.1)));
        assert_eq!((d.verdict, d.causes.len(), d.negligible.len()), (Verdict::None, 0, 1));
        assert!(d.negligible[0].reason.contains("too few to be sure"), "{}", d.negligible[0].reason);
        laws.terms[0].significant = true;
        let d = told(&laws, &repeats(0.12, 0.12, Some(0.1)));
        assert_eq!((d.verdict, d.causes.len(), d.negligible.len()), (Verdict::Named, 1, 0));
    }

    #[test]
    fn the_base_law_predicts_by_itself_unless_it_is_the_best_one() {
        let runs = test_fixtures::simulated_recordings(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
        let runs: Vec<&SegmentedRecording> = runs.iter().collect();
        let base = ScoredModel {
            set_fit: test_fixtures::fit_from_truth(&[], &runs),
            ..law(ModelFamily::Base, &[0.1; 3], 0.0, false)
        };
        let best = vec![HeldOutPrediction::default(); 3];
        let laws = CandidateModels { base, ..laws() };
        let told = base_out(&laws, &best, &runs);
        assert_eq!(told.iter().filter(|o| o.score.rmse_n > 0.0 && o.population.is_some()).count(), 3);
        let laws = CandidateModels { best: laws.base.clone(), ..laws };
        let told = base_out(&laws, &best, &runs);
        assert_eq!(told.iter().filter(|o| o.population.is_none()).count(), 3);
    }
}
