//! The page of a diagnosis: verdict, causes, fitted parameters, residuals before and after, and the steps of the search.

mod causes_tables;
mod effect_search_steps;
mod parameter_labels;
mod proposed_formulas;
mod residual_charts;
mod summary_sentence;

pub(crate) use parameter_labels::label_cell;
pub use parameter_labels::{different_recordings, undetermined_parameters};
pub(crate) use summary_sentence::wrong_numbers;
pub use summary_sentence::{
    findings, general_forms, lower_limits, partial_model, proposed_formula, recording_differences,
    summary_sentence, unneeded_custom_effects,
};

use crate::page_model::{Page, Section, Status, Tile};
use crate::pages::experiment_check::{effects_table, items_table};
use crate::pages::formatting::data_quality_table;
use crate::svg::{FigureOptions, figure};
use causes_tables::{base_parameters, causes, negligible_effects, not_identifiable};
use effect_search_steps::search_steps;
use residual_charts::{
    assumptions, base_law_residual, before_and_after, fit_chart, insertion, misfit_chart,
    remaining_structure, worst_recording,
};
use std::fmt::Write as _;
use stylet_diagnose::DiagnosisResult;
use stylet_diagnose::claims::SIGNIFICANT_P_VALUE;
use stylet_diagnose::diagnosis_json::{Diagnosis, Letter, Verdict};
use stylet_diagnose::report_curves::recording_curves;
use stylet_scenario::Scenario;
use stylet_stats::number_format::{p_value, significant};

/// The page of a diagnosis of `scenario`, read from `file`; `command` reproduces it.
#[must_use]
pub fn page(scenario: &Scenario, file: &str, command: String, examined: &DiagnosisResult) -> Page {
    let d = &examined.diagnosis;
    let all = recording_curves(examined);
    let blocks: usize = all.iter().map(|c| c.time_s.len()).sum();
    Page::new(format!("Diagnosis: {}", scenario.name))
        .subtitle(match &d.grade {
            Some(grade) => format!("{} Grade {:?}.", summary_sentence(d), grade.letter),
            None => summary_sentence(d),
        })
        .fact("scenario", file)
        .fact("recordings", d.gain.recordings.join(", "))
        .fact("blocks of 20 ms", blocks.to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(Section::new("Before the fit").table(items_table(&d.check)))
        .section(verdict(d))
        .section(insertion(d, examined, &all))
        .section(assumptions(scenario, d, &all))
        .section(causes(d))
        .section(base_parameters(d))
        .section(parameter_labels::by_recording(d))
        .section(parameter_labels::correlations(d))
        .section(negligible_effects(d))
        .section(not_identifiable(d).table(effects_table(&d.visible_effects)))
        .section(remaining_structure(d, &all))
        .section(proposed_formulas::proposed_formulas(examined))
        .section(before_and_after(d, &all))
        .section(base_law_residual(d, examined, &all))
        .section(search_steps(d))
        .section(quality(d))
        .section(reproduce(command, examined))
}

/// The recording that the base law fits worst as one SVG figure, for pages and papers: force with both fits, and their residuals.
#[must_use]
pub fn figure_svg(examined: &DiagnosisResult) -> Option<String> {
    let d = &examined.diagnosis;
    let all = recording_curves(examined);
    let (c, name) = worst_recording(d, &all)?;
    let charts = [fit_chart(c, name), misfit_chart(d, c, name)];
    let g = &d.gain;
    let subtitle = format!(
        "held-out RMS with predicted rupture times: {} N before, {} N after; noise {} N; below, ruptures at their observed times",
        significant(g.rmse_before_n, 3),
        significant(g.rmse_after_n, 3),
        significant(g.floor_n, 3)
    );
    Some(figure(&charts, &FigureOptions { title: summary_sentence(d), subtitle, ..FigureOptions::default() }))
}

fn verdict(d: &Diagnosis) -> Section {
    let word = match d.verdict {
        Verdict::None => "none",
        Verdict::Named => "named",
        Verdict::Ambiguous => "ambiguous",
        Verdict::Unknown => "unknown",
        Verdict::Parameters => "parameters",
    };
    let mut tiles = vec![Tile::new("Verdict", word, summary_sentence(d))];
    if let Some(grade) = &d.grade {
        let status = match grade.letter {
            Letter::A => Status::Good,
            Letter::B | Letter::C => Status::Warn,
            Letter::D => Status::Bad,
        };
        let reasons: Vec<String> =
            grade.parts.iter().map(|p| format!("{:?}: {}", p.letter, p.reason)).collect();
        tiles.push(Tile::new("Grade", format!("{:?}", grade.letter), reasons.join("; ")).status(status));
    }
    for c in &d.causes {
        let parameters = c
            .parameters
            .iter()
            .map(|(p, e)| {
                let bound = if c.at_bound.contains(p) { " (at its bound)" } else { "" };
                format!("{p} = {}{bound}", significant(e.value, 4))
            })
            .collect::<Vec<_>>()
            .join(", ");
        let mut detail = format!("{parameters}; confidence {}", significant(c.confidence, 2));
        if !c.equivalent.is_empty() {
            let _ = write!(detail, "; not separable from: {}", c.equivalent.join(", "));
        }
        for remark in general_forms(c).iter().chain(&c.remark) {
            let _ = write!(detail, "; {remark}");
        }
        tiles.push(Tile::new("Cause", c.effect.replace('_', " "), detail));
    }
    let g = &d.gain;
    let what =
        if g.held_out { "held-out recordings, rupture times predicted" } else { "the fitted recording" };
    tiles.push(Tile::new(
        "Residual",
        format!("{} → {} N", significant(g.rmse_before_n, 3), significant(g.rmse_after_n, 3)),
        format!("RMS of {what}; noise {} N", significant(g.floor_n, 3)),
    ));
    let status = if d.residual_structure.p_value < SIGNIFICANT_P_VALUE { Status::Warn } else { Status::Good };
    tiles.push(
        Tile::new(
            "Remaining residual",
            if d.residual_structure.p_value < SIGNIFICANT_P_VALUE { "structure" } else { "noise" },
            format!("{} for a residual of noise alone", p_value(d.residual_structure.p_value)),
        )
        .status(status),
    );
    let mut section = Section::new("Verdict").tiles(tiles);
    let warnings: Vec<String> = findings(d)
        .into_iter()
        .chain(partial_model(d))
        .chain(proposed_formula(d))
        .chain(unneeded_custom_effects(d))
        .chain(undetermined_parameters(d))
        .chain(different_recordings(d))
        .collect();
    if !warnings.is_empty() {
        section = section.warnings(warnings);
    }
    for a in &d.advice {
        section = section.warnings(vec![a.clone()]);
    }
    section
}

fn quality(d: &Diagnosis) -> Section {
    let section = Section::new("Data quality");
    if d.data_quality.is_empty() {
        return section.text("No gaps, jitter, saturation, quantisation, spikes or inconsistent units.");
    }
    section.table(data_quality_table("", &d.data_quality))
}

fn reproduce(command: String, examined: &DiagnosisResult) -> Section {
    Section::new("Reproduce")
        .code("command", command)
        .folded("extended.ron", examined.extended_scenario.to_ron().unwrap_or_default())
}
