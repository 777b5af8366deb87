//! Accuracy of K and b against the ground truth by model, motion, noise and sensor, which the paper does not report.

use crate::algorithm_variant::{Ablation, Sensor, Setup};
use crate::all_runs::{NOISE_LEVELS_MN, NOISE_MN, Study};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::seed_spread::Spread;
use crate::study_conditions::{SENSITIVITY_SEEDS_ARM, View};
use crate::value_source::SourcedTable;
use stylet_report::Colour;
use stylet_report::svg::{FigureOptions, Strip, StripChart, StripGroup, strip_chart};
use stylet_report::{Block, Cell, Section, Status, SvgImage, Table, percent, significant};
use stylet_score::EstimateError;

type Row = (String, Case, u32, Sensor, Setup);

/// The virtual sensor uses the assumed detection thresholds: with the published range few ruptures are found.
const fn setup(sensor: Sensor) -> Setup {
    match sensor {
        Sensor::ForceTorque => Setup::Tuned,
        Sensor::Virtual => Setup::ScenarioThresholds,
    }
}

fn runs(
    study: &Study,
    case: Case,
    noise_mn: u32,
    sensor: Sensor,
    setup: Setup,
    kelvin_voigt: bool,
) -> &[Outcome] {
    let mut view = View::primary(study).noise(noise_mn).setup(setup);
    if matches!(case, Case::LiverArmFriction | Case::AbdomenArmFriction) {
        view = view.fewer(SENSITIVITY_SEEDS_ARM);
    }
    view.runs(case, sensor, kelvin_voigt, Ablation::None)
}

fn error(outcome: &Outcome, layer: usize, friction: bool) -> Option<f64> {
    let layer = outcome.score.layers.get(layer)?;
    let compared: EstimateError = if friction { layer.friction_ns_per_m2 } else { layer.stiffness_n_per_m };
    compared.relative_error
}

fn cell(spread: Option<Spread>) -> Cell {
    match spread {
        Some(s) if s.n * 2 < s.of => Cell::number(format!("{} of {}", s.n, s.of)).status(Status::Bad),
        Some(s) => {
            Cell::number(format!("{} ({})", significant(100.0 * s.median, 2), significant(100.0 * s.p95, 2)))
                .status(Status::at_most(s.median, 0.1, 0.5))
        }
        None => Cell::number("none").status(Status::Bad),
    }
}

fn table(study: &Study, title: &str, layers: usize, rows: &[Row]) -> SourcedTable {
    let mut out = Vec::new();
    for (name, case, noise_mn, sensor, setup) in rows {
        for kelvin_voigt in [false, true] {
            let found = runs(study, *case, *noise_mn, *sensor, *setup, kelvin_voigt);
            let missed: usize = found.iter().map(|o| o.score.missed).sum();
            let of: usize = found.iter().map(|o| o.score.ruptures.len()).sum();
            let alarms: usize = found.iter().map(|o| o.score.false_alarms).sum();
            let mut row = vec![
                Cell::text(name.clone()),
                Cell::text(if kelvin_voigt { "KV" } else { "ML" }),
                Cell::number(format!("{missed} / {alarms} of {of}")),
            ];
            for friction in [false, true] {
                row.extend(
                    (0..layers).map(|i| cell(Spread::of(found.iter().map(|o| error(o, i, friction))))),
                );
            }
            row.push(cell(Spread::of(
                found.iter().map(|o| o.score.cumulative_friction_ns_per_m.relative_error),
            )));
            out.push(row);
        }
    }
    let mut headers = vec!["".to_owned(), "model".to_owned(), "missed / false".to_owned()];
    headers.extend((1..=layers).map(|i| format!("K{i} %")));
    headers.extend((1..=layers).map(|i| format!("b{i} %")));
    headers.push("D %".to_owned());
    SourcedTable::computed(Table { title: title.to_owned(), headers, rows: out, ..Table::default() })
}

fn noises(case: Case, name: &str) -> Vec<Row> {
    NOISE_LEVELS_MN
        .iter()
        .map(|&mn| (format!("{name}, noise {mn} mN"), case, mn, Sensor::ForceTorque, Setup::Tuned))
        .collect()
}

/// Estimate over truth for every seed, layer by layer.
fn strips(study: &Study, friction: bool) -> String {
    let shown = [
        ("latex, constant", Case::LatexConstant, Sensor::ForceTorque, 3),
        ("latex, sinusoidal", Case::LatexSinusoidal, Sensor::ForceTorque, 3),
        ("liver, F/T", Case::Liver, Sensor::ForceTorque, 2),
        ("liver, virtual", Case::LiverArm, Sensor::Virtual, 2),
        ("abdomen, F/T", Case::Abdomen, Sensor::ForceTorque, 2),
        ("abdomen, virtual", Case::AbdomenArm, Sensor::Virtual, 2),
    ];
    // Ratios above four are drawn at four.
    let most = 4.0;
    let groups = shown
        .iter()
        .map(|(name, case, sensor, layers)| StripGroup {
            name: (*name).to_owned(),
            truth: Some(1.0),
            strips: (0..*layers)
                .flat_map(|layer| [(layer, false), (layer, true)])
                .map(|(layer, kelvin_voigt)| Strip {
                    name: if kelvin_voigt { "KV" } else { "ML" }.to_owned(),
                    colour: if kelvin_voigt { Colour::Blue } else { Colour::Vermillion },
                    values: runs(study, *case, NOISE_MN, *sensor, setup(*sensor), kelvin_voigt)
                        .iter()
                        .filter_map(|o| {
                            let l = o.score.layers.get(layer)?;
                            let c = if friction { l.friction_ns_per_m2 } else { l.stiffness_n_per_m };
                            Some((c.estimated? / c.truth).min(most))
                        })
                        .collect(),
                })
                .collect(),
        })
        .collect();
    let label = if friction { "b estimated / true" } else { "K estimated / true" };
    strip_chart(
        &StripChart { label: label.to_owned(), truth_label: "true".to_owned(), groups, height_px: 260.0 },
        &FigureOptions {
            title: if friction { "Friction b of every layer" } else { "Stiffness K of every layer" }
                .to_owned(),
            subtitle: format!(
                "layers from the left, ML and KV each; every dot one of {} noise seeds at {NOISE_MN} mN; cut at 4",
                study.seeds
            ),
            width_px: 1120.0,
        },
    )
}

/// In one sentence, the worst median over the layers: `K 3.1 %, b 0.7 %`.
fn worst(study: &Study, case: Case, sensor: Sensor, kelvin_voigt: bool) -> String {
    let found = runs(study, case, NOISE_MN, sensor, setup(sensor), kelvin_voigt);
    let layers = found.first().map_or(0, |o| o.score.layers.len());
    let of = |friction: bool| {
        let medians = (0..layers)
            .filter_map(|i| Spread::of(found.iter().map(|o| error(o, i, friction))).map(|s| s.median));
        percent(medians.fold(f64::NAN, f64::max))
    };
    format!("K {}, b {}", of(false), of(true))
}

/// The pictures, for the files.
#[must_use]
pub fn pictures(study: &Study) -> [(&'static str, String); 2] {
    [
        ("stiffness_against_truth.svg", strips(study, false)),
        ("friction_against_truth.svg", strips(study, true)),
    ]
}

/// The section of the page.
#[must_use]
pub fn section(study: &Study, pictures: &[(&'static str, String)]) -> Section {
    let (ml, kv) = (false, true);
    let at = |case, sensor, kelvin_voigt| worst(study, case, sensor, kelvin_voigt);
    use Sensor::{ForceTorque, Virtual};
    let mut section = Section::new("K and b against the truth")
        .text(format!(
            "How good are the coefficients really? Only a simulation knows. Worst layer, median over {} seeds at {NOISE_MN} mN of noise, depth unknown, detection tuned (for the virtual sensor ours). ML: latex stack, \
             constant: {}; sinusoidal: {}; liver by force/torque sensor: {}, by virtual sensor: {}; abdomen: {}, by virtual sensor: {}.",
            study.seeds,
            at(Case::LatexConstant, ForceTorque, ml),
            at(Case::LatexSinusoidal, ForceTorque, ml),
            at(Case::Liver, ForceTorque, ml),
            at(Case::LiverArm, Virtual, ml),
            at(Case::Abdomen, ForceTorque, ml),
            at(Case::AbdomenArm, Virtual, ml),
        ))
        .text(format!(
            "KV: latex stack, constant: {}; sinusoidal: {}; liver: {}, by virtual sensor: {}; abdomen: {}, by virtual sensor: {}. KV's b (N s/m) is \
             divided by the layer's thickness for the comparison.",
            at(Case::LatexConstant, ForceTorque, kv),
            at(Case::LatexSinusoidal, ForceTorque, kv),
            at(Case::Liver, ForceTorque, kv),
            at(Case::LiverArm, Virtual, kv),
            at(Case::Abdomen, ForceTorque, kv),
            at(Case::AbdomenArm, Virtual, kv),
        ))
        .text(
            "In the tables: relative error in %, median over the seeds with an estimate and in brackets the 95th percentile; where fewer than half of the \
             seeds gave an estimate, how many did. An estimate counts when its rupture was found within a second. Missed and false ruptures over all \
             seeds, of all true ruptures. Marked: median above 10 % (!) and above 50 % (✕).",
        );
    for (name, svg) in pictures {
        section =
            section.block(Block::Svg(SvgImage { description: (*name).to_owned(), markup: svg.clone() }));
    }
    let arm = |case: Case, name: &str| -> Vec<Row> {
        vec![
            (format!("{name} on the arm, force/torque"), case, NOISE_MN, ForceTorque, Setup::Tuned),
            (format!("{name} on the arm, virtual"), case, NOISE_MN, Virtual, Setup::ScenarioThresholds),
        ]
    };
    let mut liver = noises(Case::Liver, "liver");
    liver.extend(arm(Case::LiverArm, "liver"));
    liver.extend(arm(Case::LiverArmFriction, "liver, joint friction of a Panda,").into_iter().skip(1));
    let mut abdomen = noises(Case::Abdomen, "abdomen");
    abdomen.extend(arm(Case::AbdomenArm, "abdomen"));
    abdomen.extend(arm(Case::AbdomenArmFriction, "abdomen, joint friction of a Panda,").into_iter().skip(1));
    let gels: Vec<Row> = Case::GELS
        .into_iter()
        .flatten()
        .flat_map(|case| {
            [(Setup::KnownDepth, "depth known"), (Setup::Tuned, "depth unknown")]
                .map(|(p, name)| (format!("{}, {name}", case.name()), case, NOISE_MN, ForceTorque, p))
        })
        .collect();
    let mut latex = noises(Case::LatexConstant, "constant");
    latex.extend(noises(Case::LatexSinusoidal, "sinusoidal"));
    section
        .table(table(study, "Three gels, latex around the second", 3, &latex).into_table())
        .table(table(study, "Bovine liver, constant velocity", 2, &liver).into_table())
        .table(table(study, "Abdominal phantom, sinusoidal velocity", 2, &abdomen).into_table())
        .table(table(study, &format!("One gel, noise {NOISE_MN} mN"), 1, &gels).into_table())
}
