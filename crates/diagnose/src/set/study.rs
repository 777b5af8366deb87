//! The whole: from a set of insertions to its diagnosis, with the error on insertions that took no part.

use crate::leftover;
use crate::outcome::{
    Cause, Diagnosis, Differences, Estimate, EvidenceStep, Gain, LeftoverReport, NoiseReport, Rival, Trace,
    Verdict,
};
use crate::set::first::{Insertion, groups};
use crate::set::instrument::{Checks, Instrument, Undone};
use crate::set::laws::{Kind, Law, Laws, confidence, effects, laws, several, slip};
use crate::set::left_out::{Out, floor, runs_out, speeds_out};
use crate::set::nested::nested;
use crate::set::numbers::{Told, base_parameters, estimates};
use crate::set::repeats::{Bought, Repeats, Standing, repeats};
use crate::set::scenario::extended;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use std::collections::BTreeMap;
use stylet_identify::phases::noise_n;
use stylet_record::raw;
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
pub struct Study {
    /// Laws that were tried.
    pub laws: Laws,
    /// Every run predicted without it by the best law.
    pub out: Vec<Out>,
    /// And by the base law.
    pub base_out: Vec<Out>,
    /// The verdict and all that goes with it.
    pub diagnosis: Diagnosis,
    /// What repeats add.
    pub repeats: Repeats,
    /// The mean insertion as a scenario.
    pub extended: Scenario,
    /// The insertions as they were studied: what the instrument shows is undone.
    pub runs: Vec<Insertion>,
}

/// Studies insertions. What the instrument shows by itself is undone first.
#[must_use]
pub fn study(
    name: &str,
    believed: &Tissue,
    runs: &[&Insertion],
    checks: &Checks,
    mut progress: impl FnMut(&str),
) -> Option<Study> {
    let instrument = Instrument::look(checks, runs, believed.surface_m);
    let Undone { runs: undone, raw } = instrument.undo(runs);
    let runs: Vec<&Insertion> = undone.iter().collect();
    let runs = runs.as_slice();
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let laws = laws(believed, runs, &raw, &mut rng, &mut progress)?;
    progress("every run predicted without it");
    let out = runs_out(&laws.best.fitted, runs);
    let base_out = base_out(&laws, &out, runs);
    let by_speed = |law: &Law| several(runs).then(|| speeds_out(&law.fitted, runs));
    let (speed_out, base_speed_out) = (by_speed(&laws.best), by_speed(&laws.base));
    let floors = floor(runs);
    let standing = Standing {
        runs,
        law: &laws.best,
        out: &out,
        base_out: &base_out,
        speed_out: speed_out.as_deref(),
        base_speed_out: base_speed_out.as_deref(),
        floors: &floors,
    };
    let repeats = repeats(&standing, bought(&laws), instrument);
    let diagnosis = diagnosis(&laws, runs, believed, &out, &repeats, &raw);
    let extended = extended(name, &laws.best.fitted.fit.model, runs, &repeats.instrument);
    Some(Study { laws, out, base_out, diagnosis, repeats, extended, runs: undone })
}

impl Study {
    /// Asks what parts of the set are predicted to when the law and its parts are chosen without them.
    pub fn nest(&mut self) {
        let runs: Vec<&Insertion> = self.runs.iter().collect();
        self.repeats.nested = nested(&self.laws, &runs);
    }
}

/// Every run predicted without it by the base law, `out` being what the best one predicts.
fn base_out(laws: &Laws, out: &[Out], runs: &[&Insertion]) -> Vec<Out> {
    if laws.best.kind == Kind::Base { out.to_vec() } else { runs_out(&laws.base.fitted, runs) }
}

/// What each law and each part of the best one buys.
fn bought(laws: &Laws) -> Vec<Bought> {
    let mut out = Vec::new();
    let of = |step: String, law: &Law| Bought {
        step,
        left_out_n: law.left_out_n(),
        without_n: None,
        kept: law.kind == laws.best.kind,
    };
    if let Some(law) = &laws.library {
        out.push(of("base law with what the library adds".to_owned(), law));
    }
    if let Some(law) = &laws.slip {
        out.push(of("a shaft that slips".to_owned(), law));
    }
    for part in &laws.parts {
        out.push(Bought {
            step: part.name.clone(),
            left_out_n: laws.best.left_out_n(),
            without_n: Some(stylet_stats::mean(&part.without_n)).filter(|e| e.is_finite()),
            kept: part.kept,
        });
    }
    out
}

fn diagnosis(
    laws: &Laws,
    runs: &[&Insertion],
    believed: &Tissue,
    out: &[Out],
    repeats: &Repeats,
    raw: &raw::Raw,
) -> Diagnosis {
    let best = &laws.best;
    let model = &best.fitted.fit.model;
    let told = estimates(&best.fitted, out);
    let mean = &repeats.mean;
    let noise = repeats
        .instrument
        .noise_n
        .unwrap_or_else(|| stylet_stats::median_of(runs.iter().map(|r| noise_n(&r.recording.force_n))));
    let unsure = |id: &str| laws.parts.iter().any(|p| p.is_unsure() && p.effect == id);
    let mut causes: Vec<Cause> = effects(model)
        .into_iter()
        .filter(|id| !unsure(id))
        .map(|id| {
            let whole = if id == slip().id { Some(laws.base.errors_n.clone()) } else { None };
            let without = whole
                .or_else(|| laws.parts.iter().find(|p| p.kept && p.name == id).map(|p| p.without_n.clone()))
                .unwrap_or_default();
            cause(id, &told, confidence(&without, &best.errors_n), &without, best, &laws.base)
        })
        .collect();
    causes.sort_by(|a, b| b.share.total_cmp(&a.share));
    causes.extend(repeats.instrument.shown.iter().map(|s| s.cause()));
    causes.extend(crate::diagnose::raw_causes(raw, noise));
    let floor_n = mean.floor_n.unwrap_or(noise);
    let beyond = |e: f64| (e * e - floor_n * floor_n).max(0.0);
    let share = if best.kind == Kind::Base {
        1.0
    } else {
        (beyond(mean.law_n) / beyond(mean.base_n).max(1e-12)).min(1.0)
    };
    let unknown =
        share > UNEXPLAINED && mean.law_n > (1.0 + BEYOND_FLOOR) * floor_n && mean.floor_n.is_some();
    let told_left = leftover::test(&best.fitted.fit, &best.fitted.data).sure;
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
        invisible: untold(best, runs),
        gain: Gain {
            held_out: true,
            recordings: runs.iter().map(|r| r.name.clone()).collect(),
            rmse_before_n: mean.base_n,
            rmse_after_n: mean.extended_n,
            floor_n,
            each_n: repeats.runs.iter().map(|r| (r.base_n, r.extended_n)).collect(),
        },
        traces: dropped(laws),
        leftover: LeftoverReport {
            p_value: told_left.p_value,
            depends_on: told_left.depends_on.iter().map(|d| d.0.clone()).collect(),
            nats: told_left.nats,
            share: if unknown || best.kind != Kind::Base { share } else { 0.0 },
        },
        data_quality: crate::set::repeats::quality(runs),
        evidence: vec![evidence(laws)],
        noise: NoiseReport {
            sd_n: noise,
            ar: [repeats.instrument.ar1.unwrap_or(0.0), 0.0],
            from_air: repeats.instrument.noise_n.is_some(),
        },
        differences: Differences {
            puncture: scatter.force,
            face_m: scatter.place_m,
            surface_m: scatter.surface_m,
            friction: scatter.friction,
        },
        advice: advice(best, &told),
    }
}

/// What insertions at one speed cannot say; that a puncture waits only where no force at which a layer gives way would do.
fn untold(best: &Law, runs: &[&Insertion]) -> Vec<String> {
    let all = [
        PowerLawFriction { exponent: 1.0 }.info().id,
        RateDependentPuncture { alpha: 0.0 }.info().id,
        DelayedPuncture::default().info().id,
    ];
    let named = effects(&best.fitted.fit.model);
    let untold = all.iter().filter(|id| !several(runs) && !named.contains(id));
    untold.map(|id| (*id).to_owned()).collect()
}

fn cause(id: &str, told: &[Told], confidence: f64, without: &[f64], best: &Law, base: &Law) -> Cause {
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
        gain_nats: (base.fitted.fit.nats() - best.fitted.fit.nats()).max(0.0),
        share: if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 },
    }
}

/// Parts that the law was found to do without, and effects that it predicts better with, but not surely.
fn dropped(laws: &Laws) -> Vec<Trace> {
    let part = |p: &crate::set::laws::Part| Trace {
        effect: p.effect.to_owned(),
        parameters: BTreeMap::new(),
        why: format!(
            "{}: recordings left out are predicted to {:.3} N without it, {:.3} N with it{}",
            p.name,
            stylet_stats::mean(&p.without_n),
            laws.best.left_out_n(),
            if p.kept { ": too few to be sure, so that it stays in the law without a name" } else { "" }
        ),
    };
    laws.parts.iter().filter(|p| !p.kept || p.is_unsure()).map(part).collect()
}

fn evidence(laws: &Laws) -> EvidenceStep {
    let rival = |name: &str, law: &Law| Rival {
        effect: name.to_owned(),
        gain_nats: laws.base.fitted.fit.nats() - law.fitted.fit.nats(),
        parameters: law.fitted.fit.model.effect_numbers(),
        screened_only: false,
    };
    let mut rivals = Vec::new();
    rivals.extend(laws.slip.as_ref().map(|l| rival(slip().id, l)));
    rivals.extend(laws.library.as_ref().map(|l| rival(&effects(&l.fitted.fit.model).join(", "), l)));
    EvidenceStep {
        standing: Vec::new(),
        rivals,
        needed_nats: 0.0,
        taken: (laws.best.kind != Kind::Base).then(|| effects(&laws.best.fitted.fit.model).join(", ")),
    }
}

/// What a reader should know before believing the numbers.
fn advice(best: &Law, told: &[Told]) -> Vec<String> {
    let mut out = Vec::new();
    let bounds: Vec<String> =
        told.iter().filter(|t| t.at_bound).map(|t| format!("{} of {}", t.path, t.owner)).collect();
    if !bounds.is_empty() {
        out.push(format!(
            "These numbers stand where they may not go further, so that their values say little: {}.",
            bounds.join(", ")
        ));
    }
    let (starts, agree) = best.fitted.starts;
    if best.kind == Kind::Slip && 2 * agree < starts {
        out.push(format!(
            "Only {agree} of {starts} starts came to this optimum: more insertions would make it surer."
        ));
    }
    out
}

/// Groups of one speed and stroke with their mean speed, slowest first.
#[must_use]
pub fn speeds(runs: &[&Insertion]) -> Vec<(f64, Vec<usize>)> {
    let mean = |g: &[usize]| g.iter().map(|i| runs[*i].speed_mps).sum::<f64>() / g.len().max(1) as f64;
    groups(runs).into_iter().map(|g| (mean(&g), g)).collect()
}

#[cfg(test)]
mod tests {
    use super::{BEYOND_FLOOR, advice, base_out, bought, cause, diagnosis, dropped, evidence, speeds};
    use crate::made;
    use crate::outcome::{Diagnosis, Verdict};
    use crate::set::Insertion;
    use crate::set::instrument::Instrument;
    use crate::set::laws::{Kind, Law, Laws, Part, confidence};
    use crate::set::left_out::Out;
    use crate::set::numbers::Told;
    use crate::set::repeats::{MeanReport, Repeats, Varies};
    use stylet_record::Recording;
    use stylet_record::raw::Raw;
    use stylet_tissue::{AnyEffect, CoulombFriction};

    fn law(kind: Kind, errors_n: &[f64], nats: f64, with: bool) -> Law {
        let rubs: [AnyEffect; 1] = [CoulombFriction { c_n_per_m: 3.0 }.into()];
        made::law(kind, &rubs[..usize::from(with)], errors_n, nats)
    }

    #[test]
    fn a_causes_share_is_what_comes_back_without_it_of_all_that_was_explained() {
        let base = law(Kind::Base, &[0.5, 0.7], -20.0, false);
        let best = law(Kind::Library, &[0.2, 0.1], -150.0, true);
        let told = |at_bound| Told {
            owner: "coulomb_friction".to_owned(),
            path: "c_n_per_m".to_owned(),
            value: 3.0,
            low: 2.0,
            high: 4.5,
            at_bound,
        };
        let other =
            Told { owner: "let_go".to_owned(), path: "depth_m".to_owned(), at_bound: true, ..told(false) };
        let c = cause("coulomb_friction", &[told(false), other.clone()], 0.97, &[0.3, 0.4], &best, &base);
        // Mean squares 0.37, 0.025 and 0.125.
        assert!((c.share - (0.125 - 0.025) / (0.37 - 0.025)).abs() < 1e-12, "{}", c.share);
        let nats = base.fitted.fit.nats() - best.fitted.fit.nats();
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

    fn laws() -> Laws {
        let part = |name: &str, without_n: &[f64], kept| Part {
            effect: "shaft_slip",
            name: name.to_owned(),
            without_n: without_n.to_vec(),
            loses: Vec::new(),
            speeds_lose: Vec::new(),
            nats: 0.0,
            kept,
            sure: kept,
        };
        Laws {
            base: law(Kind::Base, &[0.5, 0.7], -20.0, false),
            library: Some(law(Kind::Library, &[0.3, 0.1], -90.0, true)),
            slip: Some(law(Kind::Slip, &[0.25, 0.35], -70.0, true)),
            best: law(Kind::Library, &[0.3, 0.1], -90.0, true),
            parts: vec![
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
                    (b.left_out_n * 1e9).round() / 1e9,
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
            (traces[0].effect.as_str(), traces[0].why.as_str()),
            ("shaft_slip", "rate: recordings left out are predicted to 0.205 N without it, 0.200 N with it")
        );
        let e = evidence(&laws());
        assert_eq!(e.taken.as_deref(), Some("coulomb_friction"));
        let l = laws();
        let gained = |law: &Law| l.base.fitted.fit.nats() - law.fitted.fit.nats();
        assert_eq!(
            (e.rivals[0].effect.as_str(), e.rivals[1].effect.as_str()),
            ("shaft_slip", "coulomb_friction")
        );
        assert!((e.rivals[0].gain_nats - gained(l.slip.as_ref().expect("it"))).abs() < 1e-9);
        assert!((e.rivals[1].gain_nats - gained(&l.best)).abs() < 1e-9 && e.rivals[1].gain_nats > 50.0);
        let plain = Laws { best: l.base.clone(), ..laws() };
        assert_eq!(evidence(&plain).taken, None);
    }

    #[test]
    fn numbers_at_a_bound_and_starts_that_disagree_are_told() {
        let told = |at_bound| Told {
            owner: "layer.1".to_owned(),
            path: "stiffness_n_per_m".to_owned(),
            value: 3.0,
            low: 2.0,
            high: 4.5,
            at_bound,
        };
        let (slip, library) = (law(Kind::Slip, &[0.1], 0.0, true), law(Kind::Library, &[0.1], 0.0, true));
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
        agree.fitted.starts = (8, 4);
        assert!(advice(&agree, &[]).is_empty());
    }

    #[test]
    fn speeds_are_the_means_of_their_groups() {
        let run = |speed: f64| {
            let t: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
            let z = t.iter().map(|t| (speed * t).min(0.01)).collect();
            Insertion::new(String::new(), Recording::new(t, z, vec![0.0; 400]).expect("clean columns"), 1)
        };
        let mut all = [run(0.004), run(0.002), run(0.002)];
        (all[1].speed_mps, all[2].speed_mps) = (0.00205, 0.002);
        let refs: Vec<&Insertion> = all.iter().collect();
        let told = speeds(&refs);
        assert_eq!(told.iter().map(|s| s.1.clone()).collect::<Vec<_>>(), [vec![1, 2], vec![0]]);
        assert!((told[0].0 - 0.002025).abs() < 1e-12 && told[1].0 == all[0].speed_mps);
    }

    /// Repeats whose base law, extended law and floor leave so much (N); the noise is 0.1 N.
    fn repeats(base_n: f64, extended_n: f64, floor_n: Option<f64>) -> Repeats {
        Repeats {
            runs: Vec::new(),
            speeds: Vec::new(),
            mean: MeanReport { floor_n, base_n, law_n: extended_n, extended_n, ..MeanReport::default() },
            parts_of_insertion: Vec::new(),
            population: Varies {
                surface_m: 0.0,
                friction: 0.0,
                puncture: 0.0,
                day_surface_m: 0.0,
                day_friction: 0.0,
                drops: Vec::new(),
                lets_go_m: Vec::new(),
                residual_n: Vec::new(),
            },
            starts: (8, 3),
            bought: Vec::new(),
            instrument: Instrument { noise_n: Some(0.1), ..Instrument::default() },
            parts: None,
            nested: None,
        }
    }

    fn told(laws: &Laws, repeats: &Repeats) -> Diagnosis {
        diagnosis(laws, &[], &made::gel(), &[], repeats, &Raw::default())
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
            assert!((d.leftover.share - share(base_n, extended_n)).abs() < 1e-9, "{}", d.leftover.share);
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
        assert_eq!(told(&laws(), &repeats(0.5, 0.6, Some(0.1))).leftover.share, 1.0);
        assert_eq!(told(&laws(), &repeats(0.5, 0.05, Some(0.1))).leftover.share, 0.0);
        // What is learned beside the law does not make it known.
        let mut learned = repeats(0.5, 0.19, Some(0.1));
        learned.mean.extended_n = 0.1;
        assert_eq!(told(&laws(), &learned).verdict, Verdict::Unknown);
        // Without repeats of one speed nobody knows the floor; it is at least the noise.
        let d = told(&laws(), &repeats(0.5, 0.4, None));
        assert_eq!((d.verdict, d.gain.floor_n, d.noise.sd_n), (Verdict::Named, 0.1, 0.1));
    }

    #[test]
    fn the_base_law_alone_is_right_or_unknown() {
        let plain = Laws { best: law(Kind::Base, &[0.5, 0.7], -20.0, false), ..laws() };
        let d = told(&plain, &repeats(0.119, 0.119, Some(0.1)));
        assert_eq!((d.verdict, d.leftover.share, d.causes.len()), (Verdict::None, 0.0, 0));
        let d = told(&plain, &repeats(0.121, 0.121, Some(0.1)));
        assert_eq!((d.verdict, d.leftover.share), (Verdict::Unknown, 1.0));
    }

    /// Of several parts a cause is judged by its own, where that was kept.
    #[test]
    fn a_cause_is_judged_by_the_part_that_was_kept_of_it() {
        let mut laws = laws();
        laws.best = law(Kind::Library, &[0.2, 0.1], -90.0, true);
        let part = |name: &str, without_n: &[f64], kept| Part {
            effect: "coulomb_friction",
            name: name.to_owned(),
            without_n: without_n.to_vec(),
            loses: Vec::new(),
            speeds_lose: Vec::new(),
            nats: 0.0,
            kept,
            sure: kept,
        };
        laws.parts = vec![
            part("coulomb_friction", &[0.9, 0.9], false),
            part("wear", &[0.5, 0.6], true),
            part("coulomb_friction", &[0.3, 0.4], true),
        ];
        let d = told(&laws, &repeats(0.5, 0.12, Some(0.1)));
        assert_eq!(d.causes.len(), 1);
        // Mean squares 0.37, 0.025 and 0.125.
        assert!((d.causes[0].share - 0.1 / 0.345).abs() < 1e-12, "{}", d.causes[0].share);
        assert_eq!(d.causes[0].confidence, confidence(&[0.3, 0.4], &[0.2, 0.1]));
        assert_eq!(d.evidence[0].taken.as_deref(), Some("coulomb_friction"));
    }

    #[test]
    fn an_effect_that_predicts_better_but_not_surely_is_a_trace_and_stays_in_the_law() {
        let mut laws = laws();
        laws.best = law(Kind::Library, &[0.2, 0.1], -90.0, true);
        laws.parts = vec![Part {
            effect: "coulomb_friction",
            name: "coulomb_friction".to_owned(),
            without_n: vec![0.3, 0.2],
            loses: Vec::new(),
            speeds_lose: Vec::new(),
            nats: 0.0,
            kept: true,
            sure: false,
        }];
        let d = told(&laws, &repeats(0.12, 0.12, Some(0.1)));
        assert_eq!((d.verdict, d.causes.len(), d.traces.len()), (Verdict::None, 0, 1));
        assert!(d.traces[0].why.contains("too few to be sure"), "{}", d.traces[0].why);
        laws.parts[0].sure = true;
        let d = told(&laws, &repeats(0.12, 0.12, Some(0.1)));
        assert_eq!((d.verdict, d.causes.len(), d.traces.len()), (Verdict::Named, 1, 0));
    }

    #[test]
    fn the_base_law_predicts_by_itself_unless_it_is_the_best_one() {
        let runs = made::insertions(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, 0.0]]);
        let runs: Vec<&Insertion> = runs.iter().collect();
        let base = Law { fitted: made::settled(&[], &runs), ..law(Kind::Base, &[0.1; 3], 0.0, false) };
        let best = vec![Out::default(); 3];
        let laws = Laws { base, ..laws() };
        let told = base_out(&laws, &best, &runs);
        assert_eq!(told.iter().filter(|o| o.score.rmse_n > 0.0 && o.population.is_some()).count(), 3);
        let laws = Laws { best: laws.base.clone(), ..laws };
        let told = base_out(&laws, &best, &runs);
        assert_eq!(told.iter().filter(|o| o.population.is_none()).count(), 3);
    }
}
