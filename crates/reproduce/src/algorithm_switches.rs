//! Effect of the algorithm's switches: the literal algorithm, derivative on drops, resets and re-weighting left out; the
//! offline estimate with and without the online drop; origin of Kelvin-Voigt's stiffness errors.

use crate::algorithm_variant::{Ablation, Sensor, Setup};
use crate::all_runs::Study;
use crate::effect_size::{ExperimentValues, Measured, Scale};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::seed_interval::Interval;
use crate::seed_spread::Spread;
use crate::study_conditions::View;
use crate::value_source::SourcedTable;
use serde::Serialize;
use stylet_report::{Cell, Section, Table, percent, significant};

/// A compared variant of the algorithm.
struct ComparedVariant {
    name: &'static str,
    setup: Setup,
    ablation: Ablation,
    kelvin_voigt: bool,
}

const fn variant(
    name: &'static str,
    setup: Setup,
    ablation: Ablation,
    kelvin_voigt: bool,
) -> ComparedVariant {
    ComparedVariant { name, setup, ablation, kelvin_voigt }
}

const COMPARED_VARIANTS: [ComparedVariant; 11] = [
    variant("the primary condition", Setup::Tuned, Ablation::None, false),
    variant("to the letter (Literal)", Setup::Literal, Ablation::None, false),
    variant("derivative on drops (Drop)", Setup::FallingForce, Ablation::None, false),
    variant("no detection by the trailing edge", Setup::NoTrailingEdge, Ablation::None, false),
    variant("resets at 6.66 Hz", Setup::SlowReset, Ablation::None, false),
    variant("resets only at ruptures", Setup::Tuned, Ablation::OnlyRuptures, false),
    variant("no re-weighting", Setup::Tuned, Ablation::NoReweight, false),
    variant("depth and surface known", Setup::KnownDepth, Ablation::None, false),
    variant("Kelvin-Voigt", Setup::Tuned, Ablation::None, true),
    variant("Kelvin-Voigt, no re-weighting", Setup::Tuned, Ablation::NoReweight, true),
    variant("Kelvin-Voigt, resets only at ruptures", Setup::Tuned, Ablation::OnlyRuptures, true),
];

const CASES: [Case; 5] =
    [Case::Gel50Constant, Case::LatexConstant, Case::LatexSinusoidal, Case::Liver, Case::Abdomen];

fn runs<'a>(study: &'a Study, case: Case, variant: &ComparedVariant) -> &'a [Outcome] {
    let view = View::primary(study).setup(variant.setup);
    view.runs(case, Sensor::ForceTorque, variant.kelvin_voigt, variant.ablation)
}

/// Median over the seeds of the relative errors of K, layer by layer.
fn stiffness_errors(runs: &[Outcome]) -> Vec<Option<f64>> {
    let layers = runs.iter().map(|o| o.score.layers.len()).max().unwrap_or(0);
    let of = |layer: usize| {
        let errors =
            runs.iter().map(|o| o.score.layers.get(layer).and_then(|l| l.stiffness_n_per_m.relative_error));
        Spread::of(errors).map(|s| s.median)
    };
    (0..layers).map(of).collect()
}

/// `1.2 / 3.4 / –`.
fn percents(errors: &[Option<f64>]) -> String {
    let text = |e: &Option<f64>| e.map_or("–".to_owned(), |e| significant(100.0 * e, 2));
    errors.iter().map(text).collect::<Vec<_>>().join(" / ")
}

/// Result of one variant on an experiment: a row of `switches.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablated {
    /// Experiment.
    pub experiment: &'static str,
    /// The switch.
    pub name: &'static str,
    /// Noise seeds.
    pub seeds: usize,
    /// Number of true ruptures over all seeds.
    pub ruptures: usize,
    /// Number of missed ruptures.
    pub missed: usize,
    /// Number of false ruptures.
    pub false_alarms: usize,
    /// Median over the seeds of the relative error of K, layer by layer; `None` without an estimate.
    pub stiffness_error: Vec<Option<f64>>,
    /// Cumulative friction at the end over the true one.
    pub cumulative_ratio: Option<Interval>,
    /// Relative error of the enhanced force.
    pub enhancement: Option<Interval>,
    /// RMS reconstruction error in N.
    pub reconstruction_rms_n: Option<Interval>,
}

fn ablated(study: &Study, case: Case, variant: &ComparedVariant) -> Ablated {
    let runs = runs(study, case, variant);
    let sum = |of: fn(&Outcome) -> usize| runs.iter().map(of).sum::<usize>();
    let mean = |value: fn(&Outcome) -> Option<f64>| {
        let parts = vec![ExperimentValues::new("", runs.iter().map(value))];
        Measured { scale: Scale::Mean, parts }.effect().interval
    };
    Ablated {
        experiment: case.name(),
        name: variant.name,
        seeds: runs.len(),
        ruptures: sum(|o| o.score.ruptures.len()),
        missed: sum(|o| o.score.missed),
        false_alarms: sum(|o| o.score.false_alarms),
        stiffness_error: stiffness_errors(runs),
        cumulative_ratio: mean(|o| o.cumulative_ratio),
        enhancement: mean(|o| o.score.enhancement.rms_relative),
        reconstruction_rms_n: mean(|o| o.score.reconstruction_rms_n),
    }
}

/// All variants on all experiments.
#[must_use]
pub fn record(study: &Study) -> Vec<Ablated> {
    CASES
        .iter()
        .flat_map(|case| COMPARED_VARIANTS.iter().map(|variant| ablated(study, *case, variant)))
        .collect()
}

fn table(study: &Study, case: Case) -> SourcedTable {
    let rows = COMPARED_VARIANTS
        .iter()
        .map(|variant| {
            let found = ablated(study, case, variant);
            let show = |interval: Option<Interval>, text: &dyn Fn(f64) -> String| {
                Cell::number(interval.map_or("–".to_owned(), |i| {
                    format!("{} ({} to {})", text(i.value), text(i.low), text(i.high))
                }))
            };
            let short = |x: f64| significant(x, 3);
            vec![
                Cell::text(variant.name),
                Cell::number(format!("{} / {} of {}", found.missed, found.false_alarms, found.ruptures)),
                Cell::number(percents(&found.stiffness_error)),
                show(found.cumulative_ratio, &short),
                show(found.enhancement, &percent),
                show(found.reconstruction_rms_n, &short),
            ]
        })
        .collect();
    SourcedTable::computed(Table {
        title: format!("{}: mean over {} seeds (95 % interval)", case.name(), study.seeds),
        headers: [
            "",
            "missed / false",
            "K off by, %, median",
            "D / true D",
            "enhanced force off by",
            "RMS reconstruction error, N",
        ]
        .map(String::from)
        .to_vec(),
        rows,
        ..Table::default()
    })
}

/// K and b offline, with the drop's share as the online algorithm measured it, and without any drop.
fn offline(study: &Study) -> SourcedTable {
    let view = View::primary(study);
    let mut rows = Vec::new();
    for case in CASES {
        let (offline, online) = (view.offline(case), view.ml(case));
        let layers = online.iter().map(|o| o.score.layers.len()).max().unwrap_or(0);
        for layer in 0..layers {
            let truth = online.first().and_then(|o| o.score.layers.get(layer));
            let Some(truth) = truth else { continue };
            let (k, b) = (truth.stiffness_n_per_m.truth, truth.friction_ns_per_m2.truth);
            let error = |with_drop: bool, friction: bool| {
                let values = offline.iter().map(|o| {
                    let all = if with_drop { &o.with_drop } else { &o.without_drop };
                    let e = all.get(layer).copied().flatten()?;
                    Some(if friction { e.friction_ns_per_m2 / b } else { e.stiffness_n_per_m / k } - 1.0)
                });
                Cell::number(Spread::of(values).map_or("–".to_owned(), |s| percent(s.median)))
            };
            let identified = offline
                .iter()
                .filter(|o| o.without_drop.get(layer).copied().flatten().is_some_and(|e| e.separable))
                .count();
            rows.push(vec![
                Cell::text(format!("{}, layer {}", case.name(), layer + 1)),
                Cell::number(format!("{identified} of {}", offline.len())),
                error(true, false),
                error(false, false),
                error(true, true),
                error(false, true),
            ]);
        }
    }
    SourcedTable::computed(Table {
        title: "Offline least squares, off by (median); without the drop, elastic and viscous column weigh the same (eq. 17)".to_owned(),
        headers: [
            "",
            "seeds in which the data tell K from b",
            "K, with the drop",
            "K, without",
            "b, with the drop",
            "b, without",
        ]
        .map(String::from)
        .to_vec(),
        rows,
        ..Table::default()
    })
}

/// Kelvin-Voigt fitted by least squares over the whole layer attributes the local friction to K: the error is `b v / K`.
fn kelvin_voigt(study: &Study) -> SourcedTable {
    let case = Case::LatexConstant;
    let rows = [
        ("40 Hz, re-weighted", &COMPARED_VARIANTS[8]),
        ("40 Hz, not re-weighted", &COMPARED_VARIANTS[9]),
        ("no resets within a layer", &COMPARED_VARIANTS[10]),
    ]
    .map(|(name, variant)| {
        vec![Cell::text(name), Cell::number(percents(&stiffness_errors(runs(study, case, variant))))]
    });
    let predicted = case.scenario().map(|s| {
        let speed = match s.motion {
            stylet_scenario::Motion::Constant { velocity_mps, .. } => velocity_mps,
            _ => f64::NAN,
        };
        let of = |l: &stylet_tissue::Layer| {
            significant(100.0 * l.friction_ns_per_m2 * speed / l.stiffness_n_per_m, 2)
        };
        s.tissue.layers.iter().map(of).collect::<Vec<_>>().join(" / ")
    });
    let mut rows: Vec<Vec<Cell>> = rows.into();
    if let Ok(predicted) = predicted {
        rows.push(vec![Cell::text("b v / K"), Cell::number(predicted)]);
    }
    SourcedTable::computed(Table {
        title: "Kelvin-Voigt on the latex stack, constant velocity".to_owned(),
        headers: ["", "K off by, %, layer by layer"].map(String::from).to_vec(),
        rows,
        ..Table::default()
    })
}

/// The section of the page; in a planning study it records the runs that it needs.
#[must_use]
pub fn section(study: &Study) -> Section {
    let mut section = Section::new("Switches of the algorithm")
        .text(
            "The supplement and the laboratory leave some switches open, and Stylet had to complete some steps. What each does, with everything else as in the \
             primary conditions. To the letter: no blind travel after contact and rupture, no guards, the drop from extremes. Derivative on drops: the \
             supplement's eq. (1) speaks of force drops, the laboratory acts on the rising force.",
        );
    for case in CASES {
        section = section.table(table(study, case).into_table());
    }
    section
        .table(offline(study).into_table())
        .text(
            "Kelvin-Voigt's K: at constant velocity its friction column is a mere offset, and least squares over the whole layer (no resets within it) puts all \
             local friction into K, which is then off by b v / K. Resets at 40 Hz make the estimate local and re-weighting by the drop splits it.",
        )
        .table(kelvin_voigt(study).into_table())
}
