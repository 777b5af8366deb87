//! The online core on repeated insertions, in words and as a table.

use crate::page_model::{Cell, Section, Table};
use std::fmt::Write as _;
use stylet_score::{MeasuredScore, ModelFrictionScore};

fn sums(all: &[MeasuredScore]) -> [usize; 5] {
    let of = |what: &dyn Fn(&MeasuredScore) -> usize| all.iter().map(what).sum();
    [
        of(&|o| o.drops),
        of(&|o| o.found),
        of(&|o| o.false_insertion),
        of(&|o| o.false_hold),
        of(&|o| o.false_retraction),
    ]
}

fn mean(all: &[MeasuredScore], what: impl Fn(&MeasuredScore) -> f64) -> f64 {
    stylet_stats::mean(&all.iter().map(what).collect::<Vec<_>>())
}

fn with_law(online: &MeasuredScore, what: fn(ModelFrictionScore) -> f64) -> f64 {
    online.with_model.map_or(f64::NAN, what)
}

/// What it found of all runs together, in lines.
#[must_use]
pub fn summary(all: &[MeasuredScore]) -> String {
    let [drops, found, inside, hold, back] = sums(all);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "  online core: {found} of {drops} drops found; false: {inside} on the way in, {hold} in the hold, {back} on the way back"
    );
    let measured_n = mean(all, |o| o.retraction_raw_n);
    // Not every insertion is recorded on its way back.
    if measured_n.is_finite() {
        let _ = writeln!(
            out,
            "  force on the way back, all of it friction (N rms): {measured_n:.3} measured, {:.3} left by the core alone, {:.3} with the extended law in it, {:.3} by that law replayed",
            mean(all, |o| o.retraction_enhanced_n),
            mean(all, |o| with_law(o, |w| w.residual_rms_n)),
            mean(all, |o| o.retraction_model_n)
        );
        let largest =
            all.iter().filter_map(|o| o.with_model).map(|w| w.residual_max_n).fold(f64::NAN, f64::max);
        let median = |what: fn(ModelFrictionScore) -> f64| {
            stylet_stats::median_of(all.iter().filter_map(|o| o.with_model.map(what)))
        };
        let _ = writeln!(
            out,
            "  with the law in it the largest is {largest:.2} N; of a pull of 0.5 N over 2 mm put in {:.0} % of the peak is kept, of a step {:.0} % after 1 mm",
            100.0 * median(|w| w.pulse_kept),
            100.0 * median(|w| w.step_kept)
        );
    }
    out
}

pub(super) fn section(all: &[MeasuredScore]) -> Section {
    let rows = all
        .iter()
        .map(|o| {
            vec![
                Cell::text(o.recording.clone()),
                Cell::number(format!("{} of {}", o.found, o.drops)),
                Cell::number(format!("{} / {} / {}", o.false_insertion, o.false_hold, o.false_retraction)),
                Cell::number(format!("{:.3}", o.retraction_raw_n)),
                Cell::number(format!("{:.3}", o.retraction_enhanced_n)),
                Cell::number(format!("{:.3}", with_law(o, |w| w.residual_rms_n))),
                Cell::number(format!("{:.3}", o.retraction_model_n)),
            ]
        })
        .collect();
    let said = summary(all).lines().map(|l| format!("All: {}.", l.trim())).collect::<Vec<_>>().join(" ");
    let headers = [
        "",
        "drops found",
        "false: in / hold / back",
        "measured",
        "core",
        "core with the law",
        "law replayed",
    ];
    let groups = [("", 3), ("force on the way back, N rms", 4)];
    Section::new("The online core on these insertions")
        .text(
            "On the way back nothing pushes the tip: all force there is friction, and an enhanced force should be zero. \
             Core: what its enhanced force leaves, with the friction that it learns by itself. Core with the law: it begins from the friction of the \
             law fitted to the other runs, a layer counting as punctured from the moment the core says so, and corrects it by what the \
             way back shows. Law replayed: without that.",
        )
        .text(said)
        .table(Table::new("By run", &headers, rows).with_column_groups(&groups))
}
