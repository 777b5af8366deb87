//! S Figs 3-9 and M Figs 12-14: measured, predicted and enhanced force, and the coefficients.

use super::Figure;
use super::panels::{Run, coefficients, force, picture, visited};
use crate::case::Case;
use crate::outcome::Outcome;
use crate::spread::Spread;
use crate::study::{Insertion, NOISE_MN, ReproduceError, Study};
use crate::variant::{Protocol, Sensor, Variant};
use rayon::prelude::*;
use stylet_report::{Cell, Table, percent, significant};

struct Spec {
    number: &'static str,
    file: &'static str,
    case: Case,
    protocol: Protocol,
    sensor: Sensor,
    look: &'static str,
}

const fn spec(
    number: &'static str,
    file: &'static str,
    case: Case,
    protocol: Protocol,
    look: &'static str,
) -> Spec {
    Spec { number, file, case, protocol, sensor: Sensor::ForceTorque, look }
}

const SUPPLEMENT: [Spec; 7] = [
    spec(
        "S Fig. 3",
        "figure_s03.svg",
        Case::Gel25Constant,
        Protocol::KnownDepth,
        "Behind the gel only friction is left: the enhanced force should be zero.",
    ),
    spec(
        "S Fig. 4",
        "figure_s04.svg",
        Case::Gel50Constant,
        Protocol::KnownDepth,
        "Behind the gel only friction is left: the enhanced force should be zero.",
    ),
    spec(
        "S Fig. 5",
        "figure_s05.svg",
        Case::Gel25Sinusoidal,
        Protocol::KnownDepth,
        "The supplement sees KV over-compensate here.",
    ),
    spec(
        "S Fig. 6",
        "figure_s06.svg",
        Case::Gel50Sinusoidal,
        Protocol::KnownDepth,
        "As Fig. 5 with the stronger gel.",
    ),
    spec(
        "S Fig. 7",
        "figure_s07.svg",
        Case::LatexSinusoidal,
        Protocol::Paper,
        "Three ruptures; compare with M Fig. 12, constant velocity.",
    ),
    spec(
        "S Fig. 8",
        "figure_s08.svg",
        Case::Liver,
        Protocol::Paper,
        "Two ruptures; compare with M Fig. 13, virtual sensor.",
    ),
    spec(
        "S Fig. 9",
        "figure_s09.svg",
        Case::Abdomen,
        Protocol::Paper,
        "Two ruptures; compare with M Fig. 14, virtual sensor.",
    ),
];

const MAIN: [Spec; 3] = [
    spec(
        "M Fig. 12",
        "figure_m12.svg",
        Case::LatexConstant,
        Protocol::Paper,
        "Three ruptures at constant velocity.",
    ),
    Spec {
        sensor: Sensor::Virtual,
        ..spec(
            "M Fig. 13",
            "figure_m13.svg",
            Case::LiverArm,
            Protocol::Paper,
            "The same two ruptures as in S Fig. 8, felt through the joint torques.",
        )
    },
    Spec {
        sensor: Sensor::Virtual,
        ..spec(
            "M Fig. 14",
            "figure_m14.svg",
            Case::AbdomenArm,
            Protocol::Paper,
            "The same two ruptures as in S Fig. 9, felt through the joint torques.",
        )
    },
];

fn make(study: &Study, spec: &Spec) -> Result<Figure, ReproduceError> {
    let scenario = spec.case.scenario()?;
    let insertion = Insertion::of(&scenario, scenario.seed)?;
    let runs =
        [Variant::kv(spec.protocol), Variant::ml(spec.protocol)].map(|v| Run::of(&insertion, spec.sensor, v));
    let a = force(&insertion, spec.sensor, &runs, true);
    let b = coefficients(&insertion, &runs, true);
    let mut all = vec![a.clone()];
    all.extend(b.iter().cloned());
    let title = format!("{}: {}", spec.number, scenario.name);
    let sensor = format!("{} sensor, noise seed {}", spec.sensor.name(), scenario.seed);
    let nothing =
        if runs.iter().any(visited) { "" } else { " In this seed nothing is found and nothing compensated." };
    let caption = format!(
        "Corresponds to {}. {}{nothing} Scenario: scenarios/{}{}.",
        if spec.number.starts_with('S') {
            spec.number.replace("S Fig.", "the supplement's Fig.")
        } else {
            spec.number.replace("M Fig.", "the main paper's Fig.")
        },
        spec.look,
        spec.case.file().0,
        if spec.protocol == Protocol::KnownDepth {
            ", with surface and depth known, because with unknown depth the weak exit is rarely found (table below)"
        } else {
            ""
        }
    );
    Ok(Figure {
        number: spec.number,
        title: scenario.name.clone(),
        caption,
        force: Some(a),
        pictures: vec![picture(&b, "", "")],
        files: vec![(spec.file, picture(&all, &title, &sensor))],
        tables: vec![table(study, spec)],
    })
}

/// Over all seeds: what of the figure is chance.
fn table(study: &Study, spec: &Spec) -> Table {
    let mut rows = Vec::new();
    let protocols: &[(Protocol, &str)] = match spec.protocol {
        Protocol::KnownDepth => &[(Protocol::KnownDepth, "depth known"), (Protocol::Paper, "depth unknown")],
        _ => &[(Protocol::Paper, "depth unknown")],
    };
    let show = |s: Option<Spread>, text: &dyn Fn(f64) -> String| {
        Cell::number(
            s.map_or("–".to_owned(), |s| format!("{} ({} to {})", text(s.median), text(s.p5), text(s.p95))),
        )
    };
    let short = |x: f64| significant(x, 3);
    for (protocol, name) in protocols {
        for variant in [Variant::kv(*protocol), Variant::ml(*protocol)] {
            let runs = study.runs(spec.case, NOISE_MN, spec.sensor, variant);
            let found = runs.iter().filter(|o| o.found_all()).count();
            let of = |value: &dyn Fn(&Outcome) -> Option<f64>| Spread::of(runs.iter().map(value));
            rows.push(vec![
                Cell::text(format!("{}, {name}", variant.model_name())),
                Cell::number(format!("{found} of {}", runs.len())),
                show(of(&|o| o.score.median_delay_s().map(|s| s * 1e3)), &short),
                show(of(&|o| o.cumulative_ratio), &short),
                show(of(&|o| o.score.enhancement.rms_relative), &percent),
                show(of(&|o| o.after_exit), &percent),
            ]);
        }
    }
    Table {
        title: format!("Over {} noise seeds: median (5th to 95th percentile)", study.seeds),
        headers: [
            "model",
            "seeds: exactly the true ruptures",
            "delay, ms",
            "D / true D at the end",
            "enhanced force off by",
            "left behind the last layer",
        ]
        .map(String::from)
        .to_vec(),
        rows,
        ..Table::default()
    }
}

/// Those of the supplement and those of the main paper.
pub(super) fn figures(study: &Study) -> Result<(Vec<Figure>, Vec<Figure>), ReproduceError> {
    let make_all = |specs: &[Spec]| specs.par_iter().map(|s| make(study, s)).collect::<Result<Vec<_>, _>>();
    Ok((make_all(&SUPPLEMENT)?, make_all(&MAIN)?))
}
