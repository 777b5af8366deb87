//! Scores of the online algorithm on repeated insertions, as text and as a table.

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

fn with_model(online: &MeasuredScore, what: fn(ModelFrictionScore) -> f64) -> f64 {
    online.with_model.map_or(f64::NAN, what)
}

/// The scores over all recordings, in lines for the terminal.
#[must_use]
pub fn summary(all: &[MeasuredScore]) -> String {
    let [drops, found, inside, hold, back] = sums(all);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "  online algorithm: {found} of {drops} force drops detected; false detections: {inside} during insertion, {hold} during the hold, {back} during retraction"
    );
    let measured_n = mean(all, |o| o.retraction_raw_n);
    // Not every recording contains a retraction.
    if measured_n.is_finite() {
        let _ = writeln!(
            out,
            "  force during retraction, all of it friction (N rms): {measured_n:.3} measured, {:.3} enhanced, {:.3} enhanced with the extended law, {:.3} minus the replayed law",
            mean(all, |o| o.retraction_enhanced_n),
            mean(all, |o| with_model(o, |w| w.residual_rms_n)),
            mean(all, |o| o.retraction_model_n)
        );
        let largest =
            all.iter().filter_map(|o| o.with_model).map(|w| w.residual_max_n).fold(f64::NAN, f64::max);
        let median = |what: fn(ModelFrictionScore) -> f64| {
            stylet_stats::median_of(all.iter().filter_map(|o| o.with_model.map(what)))
        };
        let _ = writeln!(
            out,
            "  enhanced with the extended law: peak {largest:.2} N; of an added pulse of 0.5 N over 2 mm {:.0} % of the peak is kept, of a step {:.0} % after 1 mm",
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
                Cell::number(format!("{:.3}", with_model(o, |w| w.residual_rms_n))),
                Cell::number(format!("{:.3}", o.retraction_model_n)),
            ]
        })
        .collect();
    let totals = summary(all).lines().map(|l| format!("All: {}.", l.trim())).collect::<Vec<_>>().join(" ");
    let headers = [
        "",
        "drops detected",
        "false: insertion / hold / retraction",
        "measured",
        "enhanced",
        "enhanced with the law",
        "minus the replayed law",
    ];
    let groups = [("", 3), ("force during retraction, N rms", 4)];
    Section::new("Online enhancement")
        .text(
            "During retraction the force is friction alone, so the enhanced force should be zero. Enhanced: the online algorithm with the friction that \
             it estimates itself. Enhanced with the law: it starts from the friction of the law fitted to the other recordings, treats a layer as \
             ruptured from its detection on, and corrects the friction during retraction. Minus the replayed law: the fitted friction without the \
             online algorithm.",
        )
        .text(totals)
        .table(Table::new("By recording", &headers, rows).with_column_groups(&groups))
}
