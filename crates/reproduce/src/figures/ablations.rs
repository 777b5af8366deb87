//! S Figs 10-15: covariance reset only at ruptures, and 40 Hz without re-weighting.

use super::Figure;
use super::panels::{Run, coefficients, force, picture};
use crate::case::Case;
use crate::spread::Spread;
use crate::study::{Insertion, ReproduceError, Study};
use crate::variant::{Protocol, Sensor, Variant};
use rayon::prelude::*;
use stylet_report::{Cell, Table, significant};

struct Spec {
    number: &'static str,
    file: &'static str,
    case: Case,
    protocol: Protocol,
    /// What it is compared with.
    beside: Protocol,
}

const SPECS: [Spec; 6] = {
    use Protocol::{KnownDepth, NoReweight, NoReweightKnown, OnlyRuptures, Paper};
    const fn spec(
        number: &'static str,
        file: &'static str,
        case: Case,
        protocol: Protocol,
        beside: Protocol,
    ) -> Spec {
        Spec { number, file, case, protocol, beside }
    }
    [
        spec("S Fig. 10", "figure_s10.svg", Case::Gel70Constant, OnlyRuptures, Paper),
        spec("S Fig. 11", "figure_s11.svg", Case::LatexSinusoidal, OnlyRuptures, Paper),
        spec("S Fig. 12", "figure_s12.svg", Case::Liver, OnlyRuptures, Paper),
        spec("S Fig. 13", "figure_s13.svg", Case::Gel70Sinusoidal, NoReweightKnown, KnownDepth),
        spec("S Fig. 14", "figure_s14.svg", Case::LatexSinusoidal, NoReweight, Paper),
        spec("S Fig. 15", "figure_s15.svg", Case::Liver, NoReweight, Paper),
    ]
};

fn make(study: &Study, spec: &Spec) -> Result<Figure, ReproduceError> {
    let scenario = spec.case.scenario()?;
    let insertion = Insertion::of(&scenario, scenario.seed)?;
    let only = spec.protocol == Protocol::OnlyRuptures;
    let runs = [Run::of(&insertion, Sensor::ForceTorque, Variant::ml(spec.protocol))];
    let what = if only {
        "covariance reset only at detected ruptures"
    } else {
        "covariance reset at 40 Hz, no a posteriori re-weighting"
    };
    let a = force(&insertion, Sensor::ForceTorque, &runs, !only);
    let b = coefficients(&insertion, &runs, !only);
    let mut all = vec![a.clone()];
    all.extend(b.iter().cloned());
    let look = match spec.protocol {
        Protocol::OnlyRuptures => {
            "The predicted force should leave the measured one, above all after abrupt drops."
        }
        _ => {
            "The predicted force should follow the measured one; the enhanced force should hardly differ from it."
        }
    };
    let known =
        if spec.protocol == Protocol::NoReweightKnown { ", with surface and depth known" } else { "" };
    Ok(Figure {
        number: spec.number,
        title: format!("{}: {what}", spec.case.name()),
        caption: format!(
            "Corresponds to {}. {look} Multi-layer model. Scenario: scenarios/{}{known}.",
            spec.number.replace("S Fig.", "the supplement's Fig."),
            spec.case.file().0
        ),
        force: Some(a),
        pictures: vec![picture(&b, "", "")],
        files: vec![(
            spec.file,
            picture(
                &all,
                &format!("{}: {}", spec.number, scenario.name),
                &format!("{what}; noise seed {}", scenario.seed),
            ),
        )],
        tables: vec![table(study, spec, what)],
    })
}

fn table(study: &Study, spec: &Spec, what: &str) -> Table {
    let row = |name: &str, protocol: Protocol| {
        let runs = study.at(spec.case, Variant::ml(protocol));
        let show = |s: Option<Spread>| {
            let text = |x: f64| significant(x, 3);
            Cell::number(s.map_or("–".to_owned(), |s| {
                format!("{} ({} to {})", text(s.median), text(s.p5), text(s.p95))
            }))
        };
        vec![
            Cell::text(name),
            show(Spread::of(runs.iter().map(|o| o.score.reconstruction_rms_n))),
            show(Spread::of(runs.iter().map(|o| o.reconstruction))),
            show(Spread::of(runs.iter().map(|o| o.cumulative_ratio))),
            Cell::number(format!("{} of {}", runs.iter().filter(|o| o.found_all()).count(), runs.len())),
        ]
    };
    Table {
        title: format!("Over {} noise seeds: median (5th to 95th percentile)", study.seeds),
        headers: [
            "",
            "RMS reconstruction error, N",
            "over RMS force",
            "D / true D at the end",
            "seeds: exactly the true ruptures",
        ]
        .map(String::from)
        .to_vec(),
        rows: vec![row(what, spec.protocol), row("40 Hz, with re-weighting", spec.beside)],
        ..Table::default()
    }
}

pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, ReproduceError> {
    SPECS.par_iter().map(|s| make(study, s)).collect()
}
