//! S Fig. 2 and M Table I: the twelve friction estimates.

use super::Figure;
use crate::friction::{MOTIONS, Method, PHANTOMS, estimates, true_friction};
use crate::spread::Spread;
use crate::study::Study;
use crate::variant::Protocol;
use stylet_report::svg::{FigureOptions, Strip, StripChart, StripGroup, strip_chart};
use stylet_report::{Cell, Colour, Status, Table, percent, significant};

const ONLINE: Method = Method::Online(Protocol::KnownDepth);
const LABEL: &str = "Friction b (N s/m²)";

fn options(title: &str, subtitle: &str) -> FigureOptions {
    FigureOptions {
        title: title.to_owned(),
        subtitle: subtitle.to_owned(),
        width_px: 1120.0,
        ..FigureOptions::default()
    }
}

fn strip(study: &Study, phantom: usize, motion: usize, method: Method, name: &str, colour: Colour) -> Strip {
    let values = estimates(study, phantom, motion, method).flatten().collect();
    Strip { name: name.to_owned(), colour, values }
}

/// (a) by experiment, (b) by phantom.
pub(super) fn figure(study: &Study) -> Figure {
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
                strip(study, p, m, Method::Offline, "offline", Colour::Blue),
                strip(study, p, m, ONLINE, "online, depth known", Colour::Vermillion),
                strip(study, p, m, Method::Online(Protocol::Paper), "online, depth unknown", Colour::Orange),
            ],
        })
        .collect();
    let by_phantom = (0..PHANTOMS.len())
        .map(|p| StripGroup {
            name: format!("isinglass {}", PHANTOMS[p].name),
            truth: true_friction(study, p),
            strips: vec![
                strip(study, p, 0, Method::Offline, "offline, constant", Colour::Blue),
                strip(study, p, 1, Method::Offline, "offline, sinusoidal", Colour::SkyBlue),
                strip(study, p, 0, ONLINE, "online, constant", Colour::Vermillion),
                strip(study, p, 1, ONLINE, "online, sinusoidal", Colour::Orange),
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
        &options("(b) The twelve estimates by isinglass phantom", &format!("depths known; {seeds}")),
    );
    Figure {
        number: "S Fig. 2",
        title: "Friction estimates of the three isinglass phantoms".to_owned(),
        caption: "Corresponds to the supplement's Fig. 2 (12 estimates: three phantoms, two motions, offline and online). Offline is least \
                  squares with all force taken for friction, as the supplement supposes. With unknown depths the online algorithm gives \
                  an estimate only when it finds the tip's exit (none: in no seed)."
            .to_owned(),
        force: None,
        pictures: vec![a.clone(), b.clone()],
        files: vec![("figure_s02a.svg", a), ("figure_s02b.svg", b)],
        tables: Vec::new(),
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
    for (p, phantom) in PHANTOMS.iter().enumerate() {
        let truth = true_friction(study, p);
        let of = |m, method| estimates(study, p, m, method);
        let all =
            of(0, Method::Offline).chain(of(1, Method::Offline)).chain(of(0, ONLINE)).chain(of(1, ONLINE));
        let name = format!(
            "{}: all four (true {})",
            phantom.name,
            truth.map_or("–".to_owned(), |t| significant(t, 5))
        );
        rows.push(row(&name, Spread::of(all), truth));
        for (m, motion) in MOTIONS.iter().enumerate() {
            rows.push(row(&format!("  offline, {motion}"), Spread::of(of(m, Method::Offline)), truth));
            rows.push(row(&format!("  online, {motion}, depth known"), Spread::of(of(m, ONLINE)), truth));
            let unknown = of(m, Method::Online(Protocol::Paper));
            rows.push(row(&format!("  online, {motion}, depth unknown"), Spread::of(unknown), truth));
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
        tables: vec![Table { headers: headers.map(String::from).to_vec(), rows, ..Table::default() }],
    }
}
