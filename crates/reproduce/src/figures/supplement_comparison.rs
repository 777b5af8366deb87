//! Compares the supplement's statements on a figure with the results here, with the reason of each difference.

use super::insertion_panels::Run;
use crate::run_outcome::Outcome;
use crate::seed_spread::Spread;
use crate::simulated_insertion::Insertion;
use crate::value_source::SourcedTable;
use stylet_report::{Cell, Table, percent, significant};

/// Data of a figure.
pub(super) struct FigureData<'a> {
    pub insertion: &'a Insertion,
    pub measured_n: &'a [f64],
    pub ml: &'a [Outcome],
    pub kv: &'a [Outcome],
    /// The seed that is drawn, model by model.
    pub shown_runs: &'a [Run],
}

/// A statement of the supplement about a figure.
pub(super) struct Statement {
    /// The supplement's statement.
    says: &'static str,
    /// The result here.
    here: fn(&FigureData<'_>) -> String,
    /// Reason of the difference.
    why: &'static str,
}

const fn statement(says: &'static str, here: fn(&FigureData<'_>) -> String, why: &'static str) -> Statement {
    Statement { says, here, why }
}

fn exit(data: &FigureData<'_>) -> String {
    let truth = &data.insertion.simulation.truth;
    match (truth.surface_contact_s, truth.ruptures.last()) {
        (Some(contact), Some(exit)) => format!(
            "{} s after contact, at {} s of the recording",
            significant(exit.time_s - contact, 3),
            significant(exit.time_s, 3)
        ),
        _ => "the tip does not leave".to_owned(),
    }
}

fn peak(data: &FigureData<'_>) -> String {
    let peak = data.measured_n.iter().copied().filter(|f| f.is_finite()).fold(0.0, f64::max);
    format!("at most {} N", significant(peak, 3))
}

fn found(data: &FigureData<'_>) -> String {
    let of =
        |runs: &[Outcome]| format!("{} of {}", runs.iter().filter(|o| o.found_all()).count(), runs.len());
    format!("exactly the true ruptures in {} seeds (ML), {} (KV)", of(data.ml), of(data.kv))
}

fn median(runs: &[Outcome], value: fn(&Outcome) -> Option<f64>) -> Option<f64> {
    Spread::of(runs.iter().map(value)).map(|s| s.median)
}

fn pair(data: &FigureData<'_>, value: fn(&Outcome) -> Option<f64>, text: fn(f64) -> String) -> String {
    let of = |runs| median(runs, value).map_or("–".to_owned(), text);
    format!("ML {}, KV {} (medians)", of(data.ml), of(data.kv))
}

fn after_exit(data: &FigureData<'_>) -> String {
    format!("left of the force: {}", pair(data, |o| o.after_exit, percent))
}

fn cumulative(data: &FigureData<'_>) -> String {
    format!("D / true D: {}", pair(data, |o| o.cumulative_ratio, |x| significant(x, 3)))
}

fn elastic(data: &FigureData<'_>) -> String {
    format!("off the elastic part by {}", pair(data, |o| o.elastic_error, percent))
}

fn layers(data: &FigureData<'_>) -> String {
    let names: Vec<&str> = data.insertion.scenario.tissue.layers.iter().map(|l| l.name.as_str()).collect();
    names.join(", ")
}

const EXIT_REASON: &str =
    "how large the drop at the exit is follows from K, which is ours: see the assumed values of claim c1";
const TIME_REASON: &str = "our recording begins with 5 mm of air; thickness from this very time";
const AFTER_EXIT_REASON: &str =
    "here noise and the error of b are all that can stay; real friction is not purely viscous";

pub(super) const FIG_3: &[Statement] = &[
    statement("the tip exits at t = 12.5 s", exit, TIME_REASON),
    statement("the range of the force is 0.5 N", peak, "b was chosen for it"),
    statement("the exit is marked as detected", found, EXIT_REASON),
    statement("ML is closer to zero behind the gel than KV", after_exit, "see claim c1"),
    statement("the compensated force does not vanish completely", after_exit, AFTER_EXIT_REASON),
];
pub(super) const FIG_4: &[Statement] = &[
    statement("the tip exits at t = 17 s", exit, TIME_REASON),
    statement("the exit is marked as detected", found, EXIT_REASON),
    statement("again ML is more effective behind the gel", after_exit, "see claim c1"),
];
pub(super) const FIG_5: &[Statement] = &[
    statement("the exit is marked as detected", found, EXIT_REASON),
    statement(
        "KV over-compensates",
        cumulative,
        "see claim d: the sinusoid's friction grows with the speed here, as the model supposes",
    ),
    statement(
        "no range given",
        peak,
        "viscous b from 2.3 mm/s gives four times the force at 10 mm/s; real friction may grow less",
    ),
];
pub(super) const FIG_6: &[Statement] = &[
    statement("the exit is marked as detected", found, EXIT_REASON),
    statement("no comparison given", after_exit, "see claim c1, sensitivity to sinusoidal velocity"),
];
pub(super) const FIG_7: &[Statement] = &[
    statement("three ruptures correctly detected", found, "drops of 1.1 to 2.6 N are ours: see claim e"),
    statement(
        "gels of 20, 50 and 70 % (caption; elsewhere 25 %)",
        layers,
        "we follow the text and Fig. 1 of the main paper",
    ),
    statement("no range given", peak, "viscous b makes the friction five times the drops at full speed"),
];
pub(super) const FIG_8: &[Statement] = &[
    statement("two ruptures correctly detected", found, "puncture forces from the literature: see claim f1"),
    statement("ML renders the elastic part better", elastic, "see claim c2"),
];
pub(super) const FIG_9: &[Statement] = &[statement("two ruptures correctly detected", found, "see claim f1")];
pub(super) const MAIN_12: &[Statement] = &[
    statement("three ruptures at constant velocity", found, "see claim e"),
    statement("no number given", after_exit, AFTER_EXIT_REASON),
];
pub(super) const MAIN_13: &[Statement] = &[
    statement(
        "the same two ruptures as in S Fig. 8, by virtual sensor",
        found,
        "another arm and assumed noise: see claims f1 and f2",
    ),
    statement(
        "ML renders the elastic part better",
        elastic,
        "see claim c2, sensitivity to the virtual sensor",
    ),
];
pub(super) const MAIN_14: &[Statement] = &[statement(
    "the same two ruptures as in S Fig. 9, by virtual sensor",
    found,
    "another arm and assumed noise: see claims f1 and f2",
)];

/// Times of the ruptures declared in the drawn runs.
fn declared(runs: &[Run]) -> String {
    let of = |run: &Run| {
        let at: Vec<String> = run.trace.detections.iter().map(|d| significant(d.time_s, 4)).collect();
        let at = if at.is_empty() { "none".to_owned() } else { format!("{} s", at.join(", ")) };
        format!("{} {at}", run.variant.model_name())
    };
    runs.iter().map(of).collect::<Vec<_>>().join("; ")
}

/// Statements checked for every figure of an insertion.
pub(super) fn common_statements(runs: &[Run], panels: &str) -> Vec<[String; 3]> {
    [
        (
            "(b) shows the elastic, the local friction and the cumulative friction coefficients",
            format!("{panels}; thin online, thick a posteriori, dashed true"),
            "b has another unit in each model (N s/m and N s/m²): one axis would mislead",
        ),
        (
            "one pair of vertical lines per rupture",
            format!("in (a) those of ML, the other model's in its own panel; declared in the seed drawn: {}", declared(runs)),
            "the models need not find a rupture at the same instant; the supplement does not say whose its lines are",
        ),
    ]
    .map(|(says, here, why)| [says.to_owned(), here, why.to_owned()])
    .into()
}

/// The table of a figure, with rows of supplement's statement, result here, reason of the difference.
pub(super) fn statement_table(rows: Vec<[String; 3]>) -> SourcedTable {
    SourcedTable::named(Table {
        title: "Compared with the supplement".to_owned(),
        headers: ["the supplement says (the paper's)", "here (computed)", "what differs, and why (ours)"]
            .map(String::from)
            .to_vec(),
        rows: rows.into_iter().map(|row| row.map(Cell::text).into()).collect(),
        ..Table::default()
    })
}

/// The table of a figure of an insertion.
pub(super) fn table(statements: &[Statement], data: &FigureData<'_>) -> SourcedTable {
    let said = statements.iter().map(|s| [s.says.to_owned(), (s.here)(data), s.why.to_owned()]);
    let panels = "K, b of ML, b of KV, D";
    statement_table(said.chain(common_statements(data.shown_runs, panels)).collect())
}
