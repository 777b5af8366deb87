//! S Figs 10-15: covariance reset only at ruptures, and 40 Hz without re-weighting.

use super::panels::{Run, coefficients, force, picture};
use super::{Draw, Figure};
use crate::case::Case;
use crate::source::Sourced;
use crate::spread::Spread;
use crate::study::{NOISE_MN, ReproduceError, Study};
use crate::variant::{Ablation, Sensor, Setup, Variant};
use crate::view::View;
use rayon::prelude::*;
use stylet_report::{Cell, Table, significant};

struct Spec {
    number: &'static str,
    file: &'static str,
    case: Case,
    ablation: Ablation,
}

const SPECS: [Spec; 6] = {
    use Ablation::{NoReweight, OnlyRuptures};
    const fn spec(number: &'static str, file: &'static str, case: Case, ablation: Ablation) -> Spec {
        Spec { number, file, case, ablation }
    }
    [
        spec("S Fig. 10", "figure_s10.svg", Case::Gel70Constant, OnlyRuptures),
        spec("S Fig. 11", "figure_s11.svg", Case::LatexSinusoidal, OnlyRuptures),
        spec("S Fig. 12", "figure_s12.svg", Case::Liver, OnlyRuptures),
        spec("S Fig. 13", "figure_s13.svg", Case::Gel70Sinusoidal, NoReweight),
        spec("S Fig. 14", "figure_s14.svg", Case::LatexSinusoidal, NoReweight),
        spec("S Fig. 15", "figure_s15.svg", Case::Liver, NoReweight),
    ]
};

const WITHOUT: &str = "40 Hz, no re-weighting";
const RARELY: &str = "only at ruptures";

fn make(study: &Study, spec: &Spec) -> Result<Figure, ReproduceError> {
    let drawn = Draw::of(study, spec.case, Sensor::ForceTorque)?;
    let only = spec.ablation == Ablation::OnlyRuptures;
    let runs = [Run::of(&drawn, Variant::ml(Setup::Tuned).without(spec.ablation))];
    let (what, says) = if only {
        (
            "covariance reset only at detected ruptures",
            "The supplement sees the predicted force leave the measured one, above all after abrupt drops.",
        )
    } else {
        (
            "covariance reset at 40 Hz, no a posteriori re-weighting",
            "The supplement sees the predicted force follow the measured one, and hardly any compensation.",
        )
    };
    let a = force(&drawn, &runs, !only);
    let b = coefficients(&drawn.insertion, &runs, !only);
    let mut all = vec![a.clone()];
    all.extend(b.iter().cloned());
    let subtitle = format!("{what}; noise seed {}, {NOISE_MN} mN", drawn.seed);
    Ok(Figure {
        number: spec.number,
        title: format!("{}: {what}", spec.case.name()),
        caption: format!(
            "{says} What is seen here stands in the table; where it differs, the tissue here is linear between ruptures, as the model supposes. \
             Multi-layer model, layer depth unknown, s1 {} N. Scenario: scenarios/{}.",
            drawn.tuning.sigma_rupture_n,
            spec.case.file().0
        ),
        force: Some(a),
        pictures: vec![picture(&b, "", "")],
        files: vec![(
            spec.file,
            picture(&all, &format!("{}: {}", spec.number, drawn.insertion.scenario.name), &subtitle),
        )],
        tables: vec![table(study, spec), crate::source::table(spec.case, &drawn.insertion.scenario)],
    })
}

fn table(study: &Study, spec: &Spec) -> Sourced {
    let row = |name: &str, ablation: Ablation| {
        let runs = View::primary(study).without(spec.case, ablation);
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
    Sourced::computed(Table {
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
        rows: vec![
            row(RARELY, Ablation::OnlyRuptures),
            row(WITHOUT, Ablation::NoReweight),
            row("40 Hz, with re-weighting", Ablation::None),
        ],
        ..Table::default()
    })
}

/// Notes what the tables look up.
pub(super) fn ask(study: &Study) {
    for spec in &SPECS {
        let _ = table(study, spec);
    }
}

pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, ReproduceError> {
    SPECS.par_iter().map(|s| make(study, s)).collect()
}
