//! The online core on repeated insertions, in words and as a table.

use std::fmt::Write as _;
use stylet_report::{Cell, Section, Table};
use stylet_score::Online;

fn sums(all: &[Online]) -> [usize; 5] {
    let of = |what: &dyn Fn(&Online) -> usize| all.iter().map(what).sum();
    [of(&|o| o.drops), of(&|o| o.found), of(&|o| o.false_in), of(&|o| o.false_hold), of(&|o| o.false_back)]
}

fn mean(all: &[Online], what: impl Fn(&Online) -> f64) -> f64 {
    stylet_stats::mean(&all.iter().map(what).collect::<Vec<_>>())
}

/// What it found of all runs together, in lines.
#[must_use]
pub fn summary(all: &[Online]) -> String {
    let [drops, found, inside, hold, back] = sums(all);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "  online core: {found} of {drops} drops found; false: {inside} on the way in, {hold} in the hold, {back} on the way back"
    );
    let measured_n = mean(all, |o| o.back_raw_n);
    // Not every insertion is recorded on its way back.
    if measured_n.is_finite() {
        let _ = writeln!(
            out,
            "  force on the way back, all of it friction (N rms): {measured_n:.3} measured, {:.3} left by the core alone, {:.3} with the extended law's friction",
            mean(all, |o| o.back_before_n),
            mean(all, |o| o.back_after_n)
        );
    }
    out
}

pub(super) fn section(all: &[Online]) -> Section {
    let rows = all
        .iter()
        .map(|o| {
            vec![
                Cell::text(o.run.clone()),
                Cell::number(format!("{} of {}", o.found, o.drops)),
                Cell::number(format!("{} / {} / {}", o.false_in, o.false_hold, o.false_back)),
                Cell::number(format!("{:.3}", o.back_raw_n)),
                Cell::number(format!("{:.3}", o.back_before_n)),
                Cell::number(format!("{:.3}", o.back_after_n)),
            ]
        })
        .collect();
    let said = summary(all).lines().map(|l| format!("All: {}.", l.trim())).collect::<Vec<_>>().join(" ");
    let headers = ["", "drops found", "false: in / hold / back", "measured", "core", "extended law"];
    let groups = [("", 3), ("force on the way back, N rms", 3)];
    Section::new("The online core on these insertions")
        .text(
            "On the way back nothing pushes the tip: all force there is friction, and an enhanced force should be zero. \
             Core: what its enhanced force leaves, with the friction that it learns by itself. Extended law: the friction of the law fitted to \
             the other runs, a layer counting as punctured from the moment the core says so.",
        )
        .text(said)
        .table(Table::new("By run", &headers, rows).grouped(&groups))
}
