//! S Fig. 2 and M Table I: the twelve friction estimates.

use super::figure::Figure;
use super::supplement_comparison;
use crate::algorithm_variant::Setup;
use crate::all_runs::Study;
use crate::friction_estimates::{MOTIONS, Method, PHANTOMS, estimates, over, true_friction};
use crate::paper_experiments::Case;
use crate::seed_spread::Spread;
use crate::study_conditions::View;
use crate::value_source::SourcedTable;
use stylet_report::svg::{FigureOptions, Strip, StripChart, StripGroup, strip_chart};
use stylet_report::{Cell, Colour, Status, Table, percent, significant};

const LABEL: &str = "Friction b (N s/m²)";

fn options(title: &str, subtitle: &str) -> FigureOptions {
    FigureOptions { title: title.to_owned(), subtitle: subtitle.to_owned(), width_px: 1120.0 }
}

fn strip(
    view: &View<'_>,
    phantom: usize,
    motion: usize,
    method: Method,
    name: &str,
    colour: Colour,
) -> Strip {
    let values = estimates(view, phantom, motion, method).into_iter().flatten().collect();
    Strip { name: name.to_owned(), colour, values }
}

fn inputs() -> SourcedTable {
    let cases: Vec<Case> = PHANTOMS.iter().flat_map(|p| p.cases).collect();
    crate::value_source::table_of(&cases)
}

/// Median over the seeds of the ratio of paired estimates, over all phantoms and pairs.
fn median_ratio(pairs: impl Iterator<Item = (Vec<Option<f64>>, Vec<Option<f64>>)>) -> String {
    let all: Vec<Option<f64>> = pairs.flat_map(|(a, b)| over(&a, &b)).collect();
    Spread::of(all.into_iter()).map_or("–".to_owned(), |s| {
        format!(
            "{} (median; 5th to 95th percentile {} to {})",
            significant(s.median, 3),
            significant(s.p5, 3),
            significant(s.p95, 3)
        )
    })
}

/// Comparison of the supplement's statements on the figure with the results here.
fn statements(view: &View<'_>) -> Vec<[String; 3]> {
    const METHODS: [Method; 2] = [Method::Offline, Method::Online];
    let twelve: Vec<Vec<Vec<Option<f64>>>> = (0..PHANTOMS.len())
        .map(|p| (0..2).flat_map(|m| METHODS.map(|method| estimates(view, p, m, method))).collect())
        .collect();
    let seeds = twelve.iter().flatten().map(Vec::len).min().unwrap_or(0);
    let (mut whole, mut apart) = (0, 0);
    for seed in 0..seeds {
        let at = |p: &Vec<Vec<Option<f64>>>| p.iter().map(|e| e[seed]).collect::<Option<Vec<f64>>>();
        let Some(gels) = twelve.iter().map(at).collect::<Option<Vec<_>>>() else { continue };
        whole += 1;
        let highest = |gel: &[f64]| gel.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lowest = |gel: &[f64]| gel.iter().copied().fold(f64::INFINITY, f64::min);
        apart += usize::from(gels.windows(2).all(|pair| lowest(&pair[1]) > highest(&pair[0])));
    }
    let gels = || (0..PHANTOMS.len()).flat_map(|p| (0..2).map(move |m| (p, m)));
    let online = median_ratio(
        gels().map(|(p, m)| (estimates(view, p, m, Method::Online), estimates(view, p, m, Method::Offline))),
    );
    let sinusoidal =
        median_ratio((0..PHANTOMS.len()).flat_map(|p| {
            METHODS.map(|method| (estimates(view, p, 1, method), estimates(view, p, 0, method)))
        }));
    let rows: [(&str, String, &str); 4] = [
        (
            "12 estimates, one insertion each",
            format!("12 in {whole} of {seeds} seeds, fewer in the others"),
            "where the exit of the weakest gel is not found there is no online estimate: the drop there follows from K, which is ours",
        ),
        (
            "no superposition between the gels",
            format!("none in {apart} of the {whole} seeds with all twelve"),
            "see claim a1; real gels and insertions scatter, which no simulation has: claim a2",
        ),
        (
            "slightly lower when the online routine is used",
            format!("online over offline {online}"),
            "here because offline takes the elastic force for friction, K/v on top of b: see claim b1",
        ),
        (
            "slightly lower in sinusoidal velocity",
            format!("sinusoidal over constant {sinusoidal}"),
            "here because the offline estimate's K/v is smaller at higher speed; online there is no such difference: see claim b2",
        ),
    ];
    rows.map(|(says, here, why)| [says.to_owned(), here, why.to_owned()]).into()
}

/// (a) by experiment, (b) by phantom.
pub(super) fn figure(study: &Study) -> Figure {
    let primary = View::primary(study);
    let known = primary.setup(Setup::KnownDepth);
    let (v, k) = (&primary, &known);
    let chart = |groups| StripChart {
        label: LABEL.to_owned(),
        truth_label: "true".to_owned(),
        groups,
        height_px: 330.0,
    };
    let experiments = (0..PHANTOMS.len()).flat_map(|p| (0..2).map(move |m| (p, m)));
    let by_experiment = experiments
        .map(|(p, m)| StripGroup {
            name: format!("{}, {}", PHANTOMS[p].name, MOTIONS[m]),
            truth: true_friction(study, p),
            strips: vec![
                strip(v, p, m, Method::Offline, "offline", Colour::Blue),
                strip(v, p, m, Method::Online, "online, depth unknown", Colour::Vermillion),
                strip(k, p, m, Method::Online, "online, depth known", Colour::Orange),
            ],
        })
        .collect();
    let by_phantom = (0..PHANTOMS.len())
        .map(|p| StripGroup {
            name: format!("isinglass {}", PHANTOMS[p].name),
            truth: true_friction(study, p),
            strips: vec![
                strip(v, p, 0, Method::Offline, "offline, constant", Colour::Blue),
                strip(v, p, 1, Method::Offline, "offline, sinusoidal", Colour::SkyBlue),
                strip(v, p, 0, Method::Online, "online, constant", Colour::Vermillion),
                strip(v, p, 1, Method::Online, "online, sinusoidal", Colour::Orange),
            ],
        })
        .collect();
    let seeds = format!(
        "every dot a noise seed ({}); large dot and bar: median, 5th to 95th percentile",
        study.seeds
    );
    let a = strip_chart(&chart(by_experiment), &options("(a) Estimates by experiment", &seeds));
    let b = strip_chart(
        &chart(by_phantom),
        &options("(b) The twelve estimates by isinglass phantom", &format!("depths unknown; {seeds}")),
    );
    Figure {
        number: "S Fig. 2",
        title: "Friction estimates of the three isinglass phantoms".to_owned(),
        caption: "12 estimates: three phantoms, two motions, offline and online, layer depth unknown as captioned in Figs 3 to 6; in (a) also with \
                  known depth. Offline is least squares with all force taken for friction, as the supplement supposes. With unknown depths the \
                  online algorithm gives an estimate only when it finds the tip's exit (none: in no seed). In the supplement each estimate is one \
                  insertion into a real gel; here every dot differs by sensor noise alone, so the width of the strips cannot be compared."
            .to_owned(),
        force: None,
        pictures: vec![a.clone(), b.clone()],
        files: vec![("figure_s02a.svg", a), ("figure_s02b.svg", b)],
        tables: vec![supplement_comparison::statement_table(statements(v)), inputs()],
    }
}

fn row(name: &str, spread: Option<Spread>, truth: Option<f64>) -> Vec<Cell> {
    let (Some(s), Some(truth)) = (spread, truth) else {
        return vec![
            Cell::text(name),
            Cell::number("–"),
            Cell::number("–"),
            Cell::number("–"),
            Cell::number("0"),
        ];
    };
    let error = s.mean / truth - 1.0;
    vec![
        Cell::text(name),
        Cell::number(significant(s.mean, 4)),
        Cell::number(significant(s.sd, 3)),
        Cell::number(format!("{}{}", if error > 0.0 { "+" } else { "" }, percent(error)))
            .status(Status::at_most(error.abs(), 0.1, 0.25)),
        Cell::number(format!("{} of {}", s.n, s.of)),
    ]
}

/// The means of Table I.
pub(super) fn table_one(study: &Study) -> Figure {
    let mut rows = Vec::new();
    let primary = View::primary(study);
    let known = primary.setup(Setup::KnownDepth);
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        let truth = true_friction(study, p);
        let of = |m, method| estimates(&primary, p, m, method).into_iter();
        let four = [(0, Method::Offline), (1, Method::Offline), (0, Method::Online), (1, Method::Online)];
        let all = four.into_iter().flat_map(|(m, method)| of(m, method));
        let name = format!(
            "{}: all four (true {})",
            phantom.name,
            truth.map_or("–".to_owned(), |t| significant(t, 5))
        );
        rows.push(row(&name, Spread::of(all), truth));
        for (m, motion) in MOTIONS.iter().enumerate() {
            rows.push(row(&format!("  offline, {motion}"), Spread::of(of(m, Method::Offline)), truth));
            let both = Spread::of(of(m, Method::OfflineBoth));
            rows.push(row(&format!("  offline with K, {motion}"), both, truth));
            rows.push(row(&format!("  online, {motion}"), Spread::of(of(m, Method::Online)), truth));
            let known = Spread::of(estimates(&known, p, m, Method::Online).into_iter());
            rows.push(row(&format!("  online, {motion}, depth known"), known, truth));
        }
    }
    let headers =
        ["isinglass", "mean b, N s/m²", "standard deviation", "error of the mean", "seeds with an estimate"];
    Figure {
        number: "M Table I",
        title: "Friction coefficients: mean, spread, percentage error".to_owned(),
        caption: "Corresponds to the main paper's Table I as the supplement describes it: the average of the four estimates per phantom, \
                  their spread and percentage error. The paper has no truth; our error is against the simulated b."
            .to_owned(),
        force: None,
        pictures: Vec::new(),
        files: Vec::new(),
        tables: vec![
            supplement_comparison::statement_table(vec![[
                "average of the four estimates, variance, percentage error".to_owned(),
                "mean, standard deviation, error against the true b".to_owned(),
                "the paper's error is against its average, for lack of a truth; its scatter is of real insertions, ours of sensor noise alone"
                    .to_owned(),
            ]]),
            SourcedTable::computed(Table {
                title: "True b is ours".to_owned(),
                headers: headers.map(String::from).to_vec(),
                rows,
                ..Table::default()
            }),
            inputs(),
        ],
    }
}
