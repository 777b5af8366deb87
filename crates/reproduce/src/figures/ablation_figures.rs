//! S Figs 10-15: covariance reset only at ruptures, and 40 Hz without re-weighting.

use super::figure::{Figure, FigureRecording};
use super::insertion_panels::{Run, coefficients, force, picture};
use super::supplement_comparison;
use crate::algorithm_variant::{Ablation, Sensor, Setup, Variant};
use crate::all_runs::{NOISE_MN, ReproduceError, Study};
use crate::paper_experiments::Case;
use crate::run_outcome::Outcome;
use crate::seed_spread::Spread;
use crate::simulated_insertion::Insertion;
use crate::study_conditions::View;
use crate::value_source::SourcedTable;
use stylet_report::{Cell, Table, percent, significant};
use stylet_stats::parallel::*;

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

const WITHOUT_REWEIGHTING: &str = "40 Hz, no re-weighting";
const RESETS_AT_RUPTURES: &str = "only at ruptures";

fn make(study: &Study, spec: &Spec) -> Result<Figure, ReproduceError> {
    let recording = FigureRecording::of(study, spec.case, Sensor::ForceTorque)?;
    let only = spec.ablation == Ablation::OnlyRuptures;
    let runs = [Run::of(&recording, Variant::ml(Setup::Tuned).without(spec.ablation))];
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
    let a = force(&recording, &runs, !only);
    let b = coefficients(&recording.insertion, &runs, !only);
    let mut all = vec![a.clone()];
    all.extend(b.iter().cloned());
    let subtitle = format!("{what}; noise seed {}, {NOISE_MN} mN", recording.seed);
    Ok(Figure {
        number: spec.number,
        title: format!("{}: {what}", spec.case.name()),
        caption: format!(
            "{says} Multi-layer model, layer depth unknown, s1 {} N and beta {} N/s tuned within the published range. Scenario: scenarios/{}.",
            recording.tuning.sigma_rupture_n,
            recording.tuning.on_n_per_s,
            spec.case.file().0
        ),
        force: Some(a),
        pictures: vec![picture(&b, "", "")],
        files: vec![(
            spec.file,
            picture(&all, &format!("{}: {}", spec.number, recording.insertion.scenario.name), &subtitle),
        )],
        tables: vec![
            supplement_comparison::statement_table(statements(study, spec, &recording.insertion, &runs)),
            table(study, spec),
            crate::value_source::table(spec.case, &recording.insertion.scenario),
        ],
    })
}

/// Time in s after a true or declared rupture that is attributed to it.
const AFTER_S: f64 = 1.0;

/// Shares of the squared reconstruction error: shortly after a rupture, true or declared; otherwise before the last true
/// one; otherwise after it.
fn error_shares(insertion: &Insertion, run: &Run) -> [f64; 3] {
    let ruptures = &insertion.simulation.truth.ruptures;
    let mut from: Vec<f64> = ruptures.iter().map(|r| r.time_s).collect();
    from.extend(run.trace.detections.iter().map(|d| d.time_s));
    let last_s = ruptures.last().map_or(f64::INFINITY, |r| r.time_s);
    let mut shares = [0.0; 3];
    for (time_s, error_n) in insertion.simulation.recording.time_s.iter().zip(&run.trace.error_n) {
        let after = from.iter().any(|f| (0.0..=AFTER_S).contains(&(time_s - f)));
        let place = if after { 0 } else { 1 + usize::from(*time_s > last_s) };
        shares[place] += error_n * error_n;
    }
    let all: f64 = shares.iter().sum();
    shares.map(|s| s / all)
}

/// Comparison of the supplement's statements on the figure with the results here.
fn statements(study: &Study, spec: &Spec, insertion: &Insertion, runs: &[Run]) -> Vec<[String; 3]> {
    let view = View::primary(study);
    let of = |ablation: Ablation| view.without(spec.case, ablation);
    let median = |ablation: Ablation, value: fn(&Outcome) -> Option<f64>| {
        Spread::of(of(ablation).iter().map(value)).map_or(f64::NAN, |s| s.median)
    };
    let rms = |ablation| median(ablation, |o| o.score.reconstruction_rms_n);
    let exactly = |ablation| {
        let runs = of(ablation);
        format!("{} of {}", runs.iter().filter(|o| o.found_all()).count(), runs.len())
    };
    let [rarely, often, whole] = [Ablation::OnlyRuptures, Ablation::NoReweight, Ablation::None].map(rms);
    let [after, before, behind] = runs.first().map_or([f64::NAN; 3], |run| error_shares(insertion, run));
    let mut rows = Vec::new();
    let mut row = |says: &str, here: String, why: &str| rows.push([says.to_owned(), here, why.to_owned()]);
    if spec.ablation == Ablation::OnlyRuptures {
        row(
            "poor reconstruction of the force",
            format!(
                "RMS error {} N, {} times that with resets at 40 Hz (medians)",
                significant(rarely, 3),
                significant(rarely / whole, 3)
            ),
            "see claim g; real tissue bends between ruptures, the tissue here is linear there as the model supposes: claim g's quadratic elasticity",
        );
        row(
            "particularly with abrupt force drops",
            format!(
                "of the squared error {} lies in the second after a rupture, true or declared, {} elsewhere before the last rupture, {} later \
                 behind it (seed drawn)",
                percent(after),
                percent(before),
                percent(behind)
            ),
            "before the last rupture the tissue here is linear, as the model supposes; behind it the force no longer grows with the depth, \
             which estimates without resets follow slowly",
        );
    } else {
        row(
            "the reconstruction improves significantly",
            format!(
                "RMS error {} N, {} times that with resets only at ruptures (medians)",
                significant(often, 3),
                significant(often / rarely, 3)
            ),
            "see claim h1; what is left of it here is the start after every declared rupture, because nothing carries over",
        );
        row(
            "the friction is negligible and compensates little",
            format!(
                "D / true D {} (median)",
                significant(median(Ablation::NoReweight, |o| o.cumulative_ratio), 3)
            ),
            "see claim h2",
        );
    }
    row(
        "nothing of how many ruptures are declared",
        format!(
            "exactly the true ruptures in {} seeds, as the algorithm is in {}",
            exactly(spec.ablation),
            exactly(Ablation::None)
        ),
        "what is not reconstructed or not compensated adds up in the CUSUM, the more the friction outweighs the drops",
    );
    let panels = if spec.ablation == Ablation::OnlyRuptures { "K and b" } else { "K, b and D" };
    rows.extend(supplement_comparison::common_statements(runs, panels));
    rows
}

fn table(study: &Study, spec: &Spec) -> SourcedTable {
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
    SourcedTable::computed(Table {
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
            row(RESETS_AT_RUPTURES, Ablation::OnlyRuptures),
            row(WITHOUT_REWEIGHTING, Ablation::NoReweight),
            row("40 Hz, with re-weighting", Ablation::None),
        ],
        ..Table::default()
    })
}

/// Records the runs that the tables need.
pub(super) fn request_runs(study: &Study) {
    for spec in &SPECS {
        let _ = table(study, spec);
    }
}

pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, ReproduceError> {
    SPECS.par_iter().map(|s| make(study, s)).collect()
}
