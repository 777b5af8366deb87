//! The law of repeated insertions: its causes, what each buys, its equation and numbers.

use crate::page_model::{Cell, Section, Table};
use crate::pages::formatting::BASE_LAW_EQUATIONS;
use crate::palette::Colour;
use crate::svg::{Bar, BarChart, FigureOptions, bar_chart};
use std::fmt::Write as _;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;
use stylet_stats::number_format::significant;

fn bars(study: &SetDiagnosis) -> Vec<Bar> {
    let bar = |name: String, value: f64, colour| Bar { name, value, interval: None, colour };
    let mut bars = vec![bar("base law".to_owned(), study.candidates.base.held_out_n(), Colour::Vermillion)];
    for b in &study.report.ablation {
        let colour = if b.kept { Colour::Blue } else { Colour::Grey };
        match b.without_n {
            None => bars.push(bar(b.step.clone(), b.held_out_n, colour)),
            Some(e) => bars.push(bar(format!("without {}", b.step), e, Colour::SkyBlue)),
        }
    }
    bars.push(bar("the law".to_owned(), study.candidates.best.held_out_n(), Colour::Green));
    if let Some(floor) = study.report.mean.floor_n {
        bars.push(bar("mean of the other runs".to_owned(), floor, Colour::Grey));
    }
    bars
}

/// What each step buys: errors of models and nothing of the measured curves.
#[must_use]
pub fn ablation_figure(study: &SetDiagnosis) -> String {
    let options = FigureOptions {
        title: "What each cause buys".to_owned(),
        subtitle: "root mean square error on insertions that took no part in the fit".to_owned(),
        width_px: 860.0,
        ..FigureOptions::default()
    };
    bar_chart(&BarChart { label: "N rms".to_owned(), bars: bars(study) }, &options)
}

pub(super) fn causes(study: &SetDiagnosis) -> Section {
    let rows = study
        .diagnosis
        .causes
        .iter()
        .map(|c| {
            vec![
                Cell::text(c.effect.clone()),
                Cell::number(format!("{:.0} %", 100.0 * c.share)),
                Cell::number(significant(c.confidence, 3)),
            ]
        })
        .collect();
    let parts = study
        .report
        .ablation
        .iter()
        .filter_map(|b| {
            let without = b.without_n?;
            Some(vec![
                Cell::text(b.step.clone()),
                Cell::number(format!("{without:.3}")),
                Cell::text(if b.kept { "kept" } else { "left out" }),
            ])
        })
        .collect();
    let causes = Table::new(
        "Causes: what comes back of the base law's error without each, and how sure it is that new runs need it",
        &["effect", "of the error", "confidence"],
        rows,
    );
    let title = format!(
        "Without a part of the law, N on parts of the set left out; with all of them {:.3}",
        study.candidates.best.held_out_n()
    );
    Section::new("The causes, and what each buys")
        .text(
            "Three laws were fitted: the base law; the base law with what the search over the library adds to it; layers that \
             cling to the shaft, slip, give way after a while and let go. The one that predicts parts of the set left out best \
             was taken, the base law where the others are better by less than 2 %, and more than two effects of the library \
             only when they are better than a slipping shaft by a tenth. Then every part of it went in turn, and stayed away \
             where the others, and whole speeds left out, lose less than a twentieth without it (a hundredth for what only shapes an effect), or no more than chance.",
        )
        .picture("Error on runs left out of every law, and without every part", ablation_figure(study))
        .table(causes)
        .table(Table::new(title, &["part", "without it, N", ""], parts))
}

pub(super) fn extended_law(study: &SetDiagnosis) -> Section {
    let d = &study.diagnosis;
    let mut text = String::from(BASE_LAW_EQUATIONS);
    for c in &d.causes {
        let Some(info) = stylet_tissue::effect_info(&c.effect) else { continue };
        let _ = writeln!(text, "\n{}:\n    {}", c.effect, info.equation);
        for (path, e) in &c.parameters {
            let _ = writeln!(
                text,
                "    {path} = {} ({} to {})",
                significant(e.value, 4),
                significant(e.low, 3),
                significant(e.high, 3)
            );
        }
    }
    let rows = d
        .base_parameters
        .iter()
        .map(|b| {
            vec![
                Cell::text(format!("layer {}", b.layer)),
                Cell::text(b.name.clone()),
                Cell::number(significant(b.assumed, 4)),
                Cell::number(significant(b.value, 4)),
                Cell::number(format!("{} to {}", significant(b.low, 3), significant(b.high, 3))),
                Cell::text(if b.at_bound { "at its bound" } else { "" }),
            ]
        })
        .collect();
    let headers = ["", "parameter", "believed", "fitted", "95 % interval", ""];
    Section::new("The extended law")
        .text(
            "Values of the mean insertion; intervals of 95 % by the jackknife over runs, which counts what one law cannot say \
             about all of them.",
        )
        .code("equation", text)
        .texts(study.diagnosis.advice.clone())
        .table(Table::new("Base parameters", &headers, rows))
}
