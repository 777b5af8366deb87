//! The extended law of repeated insertions: its causes with their improvement, its equation and parameters.

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
    bars.push(bar("selected law".to_owned(), study.candidates.best.held_out_n(), Colour::Green));
    if let Some(floor) = study.report.mean.floor_n {
        bars.push(bar("mean of the other recordings".to_owned(), floor, Colour::Grey));
    }
    bars
}

/// Bar chart of the held-out error of each model and of the selected law without each of its parts. It contains no measured data.
#[must_use]
pub fn ablation_figure(study: &SetDiagnosis) -> String {
    let options = FigureOptions {
        title: "Held-out error by model".to_owned(),
        subtitle: "RMS error on insertions that took no part in the fit".to_owned(),
        width_px: 860.0,
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
                Cell::text(if b.kept { "kept" } else { "removed" }),
            ])
        })
        .collect();
    let causes = Table::new(
        "Causes: share of the base law's error that returns without each, and confidence that new recordings need it",
        &["effect", "share of the error", "confidence"],
        rows,
    );
    let title = format!(
        "Ablation: cross-validated RMS without each part, N; with all parts {:.3}",
        study.candidates.best.held_out_n()
    );
    Section::new("Causes and their improvement")
        .text(
            "The laws fitted: the base law; the base law with the effects that the search adds, if any; and, where these leave more \
             than noise, layers that stick to the shaft, slip, yield with a delay and release. The law with the smallest cross-validated error was selected: an \
             extension only when it improves on the base law by 2 % or more, and more than two effects of the library only when \
             they improve on the slipping shaft by 10 %. Each part of the selected law was then removed in turn, and stayed \
             removed where the error on held-out recordings and speeds rises by less than 5 % (1 % for a parameter that only \
             shapes an effect), or not significantly.",
        )
        .picture("Held-out error of every law, and of the selected law without each part", ablation_figure(study))
        .table(causes)
        .table(Table::new(title, &["part", "RMS without it, N", ""], parts))
}

pub(super) fn extended_law(study: &SetDiagnosis) -> Section {
    let d = &study.diagnosis;
    let mut text = String::from(BASE_LAW_EQUATIONS);
    for c in &d.causes {
        let Some(info) = stylet_tissue::known_effect_info(&c.effect) else { continue };
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
                Cell::text(if b.layer > 0 { format!("layer {}", b.layer) } else { "tissue".to_owned() }),
                Cell::text(b.name.clone()),
                Cell::number(significant(b.assumed, 4)),
                Cell::number(significant(b.value, 4)),
                Cell::number(format!("{} to {}", significant(b.low, 3), significant(b.high, 3))),
                Cell::text(if b.at_bound { "at its bound" } else { "" }),
            ]
        })
        .collect();
    let headers = ["", "parameter", "assumed", "fitted", "95 % interval", ""];
    Section::new("The extended law")
        .text(
            "Parameters of the mean insertion with 95 % intervals by the jackknife over recordings, which includes the variation \
             between them.",
        )
        .code("equation", text)
        .texts(study.diagnosis.advice.clone())
        .table(Table::new("Base parameters", &headers, rows))
}
