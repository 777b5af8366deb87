//! S Figs 3-9 and M Figs 12-14: measured, predicted and enhanced force, and the coefficients. Figs 3 to 6 as
//! captioned, with unknown layer depth, and next to it with known depth.

use super::figure::{Figure, FigureRecording};
use super::insertion_panels::{Run, coefficients, force, picture, reached_compensation};
use super::supplement_comparison::{self, FigureData, Statement};
use crate::algorithm_variant::{Ablation, Sensor, Setup, Variant};
use crate::all_runs::{NOISE_MN, ReproduceError, Study};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::seed_spread::Spread;
use crate::study_conditions::View;
use crate::value_source::SourcedTable;
use stylet_report::{Cell, Table, percent, significant};
use stylet_stats::parallel::*;

/// A figure of one insertion.
pub(super) struct Spec {
    pub number: &'static str,
    pub file: &'static str,
    /// The picture with known depth.
    pub known: Option<&'static str>,
    pub case: Case,
    pub sensor: Sensor,
    pub says: &'static [Statement],
}

const fn gel(
    number: &'static str,
    file: &'static str,
    known: &'static str,
    case: Case,
    says: &'static [Statement],
) -> Spec {
    Spec { number, file, known: Some(known), case, sensor: Sensor::ForceTorque, says }
}

const fn other(
    number: &'static str,
    file: &'static str,
    case: Case,
    sensor: Sensor,
    says: &'static [Statement],
) -> Spec {
    Spec { number, file, known: None, case, sensor, says }
}

const SUPPLEMENT: [Spec; 7] = {
    use Sensor::ForceTorque;
    [
        gel(
            "S Fig. 3",
            "figure_s03.svg",
            "figure_s03_known.svg",
            Case::Gel25Constant,
            supplement_comparison::FIG_3,
        ),
        gel(
            "S Fig. 4",
            "figure_s04.svg",
            "figure_s04_known.svg",
            Case::Gel50Constant,
            supplement_comparison::FIG_4,
        ),
        gel(
            "S Fig. 5",
            "figure_s05.svg",
            "figure_s05_known.svg",
            Case::Gel25Sinusoidal,
            supplement_comparison::FIG_5,
        ),
        gel(
            "S Fig. 6",
            "figure_s06.svg",
            "figure_s06_known.svg",
            Case::Gel50Sinusoidal,
            supplement_comparison::FIG_6,
        ),
        other("S Fig. 7", "figure_s07.svg", Case::LatexSinusoidal, ForceTorque, supplement_comparison::FIG_7),
        other("S Fig. 8", "figure_s08.svg", Case::Liver, ForceTorque, supplement_comparison::FIG_8),
        other("S Fig. 9", "figure_s09.svg", Case::Abdomen, ForceTorque, supplement_comparison::FIG_9),
    ]
};

const MAIN: [Spec; 3] = [
    other(
        "M Fig. 12",
        "figure_m12.svg",
        Case::LatexConstant,
        Sensor::ForceTorque,
        supplement_comparison::MAIN_12,
    ),
    other("M Fig. 13", "figure_m13.svg", Case::LiverArm, Sensor::Virtual, supplement_comparison::MAIN_13),
    other("M Fig. 14", "figure_m14.svg", Case::AbdomenArm, Sensor::Virtual, supplement_comparison::MAIN_14),
];

fn make(study: &Study, spec: &Spec) -> Result<Figure, ReproduceError> {
    let recording = FigureRecording::of(study, spec.case, spec.sensor)?;
    let runs = |setup: Setup| [Variant::kv(setup), Variant::ml(setup)].map(|v| Run::of(&recording, v));
    let title = |what: &str| format!("{}: {}{what}", spec.number, recording.insertion.scenario.name);
    let subtitle = format!(
        "{} sensor, noise seed {}, {NOISE_MN} mN; s1 {} N and beta {} N/s tuned within the published range",
        spec.sensor.name(),
        recording.seed,
        recording.tuning.sigma_rupture_n,
        recording.tuning.on_n_per_s
    );
    let unknown = runs(Setup::Tuned);
    let a = force(&recording, &unknown, true);
    let b = coefficients(&recording.insertion, &unknown, true);
    let mut all = vec![a.clone()];
    all.extend(b.iter().cloned());
    let mut files = vec![(spec.file, picture(&all, &title(""), &subtitle))];
    let mut pictures = vec![picture(&b, "", "")];
    if let Some(file) = spec.known {
        let known = runs(Setup::KnownDepth);
        let mut all = vec![force(&recording, &known, true)];
        all.extend(coefficients(&recording.insertion, &known, true));
        let svg =
            picture(&all, &title(", surface and depth known"), "the same recording; published defaults");
        pictures.push(svg.clone());
        files.push((file, svg));
    }
    let nothing = if unknown.iter().any(reached_compensation) {
        ""
    } else {
        " In this seed nothing is found and nothing compensated."
    };
    let caption = format!(
        "As captioned: layer depth unknown{}. {subtitle}.{nothing} Scenario: scenarios/{}.",
        if spec.known.is_some() { ", and below it with surface and depth known" } else { "" },
        spec.case.file().0,
    );
    Ok(Figure {
        number: spec.number,
        title: recording.insertion.scenario.name.clone(),
        caption,
        force: Some(a),
        pictures,
        files,
        tables: vec![
            supplement_comparison::table(
                spec.says,
                &FigureData {
                    insertion: &recording.insertion,
                    measured_n: &recording.force_n,
                    ml: primary(study, spec, false),
                    kv: primary(study, spec, true),
                    shown_runs: &unknown,
                },
            ),
            numbers(study, spec),
            crate::value_source::table(spec.case, &recording.insertion.scenario),
        ],
    })
}

fn primary<'a>(study: &'a Study, spec: &Spec, kelvin_voigt: bool) -> &'a [Outcome] {
    View::primary(study).runs(spec.case, spec.sensor, kelvin_voigt, Ablation::None)
}

/// Variation of the figure over all seeds and the laboratory's range of noise.
fn numbers(study: &Study, spec: &Spec) -> SourcedTable {
    let mut rows = Vec::new();
    let setups: &[(Setup, &str)] = if spec.known.is_some() {
        &[(Setup::Tuned, "depth unknown"), (Setup::KnownDepth, "depth known")]
    } else {
        &[(Setup::Tuned, "depth unknown")]
    };
    // The virtual sensor depends on the joint-torque noise only.
    let noises: &[u32] = if spec.sensor == Sensor::Virtual { &[NOISE_MN] } else { &[5, NOISE_MN, 20] };
    let show = |s: Option<Spread>, text: &dyn Fn(f64) -> String| {
        Cell::number(
            s.map_or("–".to_owned(), |s| format!("{} ({} to {})", text(s.median), text(s.p5), text(s.p95))),
        )
    };
    let short = |x: f64| significant(x, 3);
    for (setup, name) in setups {
        for noise_mn in noises {
            for kelvin_voigt in [true, false] {
                let view = View::primary(study).setup(*setup).noise(*noise_mn);
                let runs = view.runs(spec.case, spec.sensor, kelvin_voigt, Ablation::None);
                let found = runs.iter().filter(|o| o.found_all()).count();
                let of = |value: &dyn Fn(&Outcome) -> Option<f64>| Spread::of(runs.iter().map(value));
                let tuning = study.tuning(view.recording_key(spec.case), spec.sensor);
                let model = if kelvin_voigt { "KV" } else { "ML" };
                let noise = if spec.sensor == Sensor::Virtual {
                    "virtual".to_owned()
                } else {
                    format!("{noise_mn} mN")
                };
                rows.push(vec![
                    Cell::text(format!("{model}, {name}, {noise}")),
                    Cell::number(if *setup == Setup::Tuned {
                        significant(tuning.sigma_rupture_n, 2)
                    } else {
                        "0.15".to_owned()
                    }),
                    Cell::number(format!("{found} of {}", runs.len())),
                    show(of(&|o| o.score.median_delay_s().map(|s| s * 1e3)), &short),
                    show(of(&|o| o.cumulative_ratio), &short),
                    show(of(&|o| o.score.enhancement.rms_relative), &percent),
                    show(of(&|o| o.after_exit), &percent),
                ]);
            }
        }
    }
    SourcedTable::computed(Table {
        title: format!(
            "Over {} noise seeds: median (5th to 95th percentile); noise of 5 to 20 mN is the laboratory's range, 20 mN that of the shipped scenarios",
            study.seeds
        ),
        headers: [
            "model, depth, noise",
            "s1, N",
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
    })
}

/// Records the runs that the figures need.
pub(super) fn request_runs(study: &Study) {
    for spec in SUPPLEMENT.iter().chain(&MAIN) {
        let _ = numbers(study, spec);
        let _ = (primary(study, spec, false), primary(study, spec, true));
    }
}

/// Those of the supplement and those of the main paper.
pub(super) fn figures(study: &Study) -> Result<(Vec<Figure>, Vec<Figure>), ReproduceError> {
    let make_all = |specs: &[Spec]| specs.par_iter().map(|s| make(study, s)).collect::<Result<Vec<_>, _>>();
    Ok((make_all(&SUPPLEMENT)?, make_all(&MAIN)?))
}
