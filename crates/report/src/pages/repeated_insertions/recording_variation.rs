//! Variation between recordings, and effects of the instrument.

use crate::page_model::{Cell, Section, Table};
use crate::pages::formatting::three_decimals;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;

/// Random effects and the errors of each recording.
pub(super) fn between_recordings(study: &SetDiagnosis) -> Section {
    let r = &study.report;
    let list = |x: &[Option<f64>], scale: f64| {
        x.iter()
            .map(|x| x.map_or("-".to_owned(), |x| format!("{:.2}", scale * x)))
            .collect::<Vec<_>>()
            .join(" / ")
    };
    let rows = r
        .recordings
        .iter()
        .map(|run| {
            vec![
                Cell::text(run.name.clone()),
                Cell::number(format!("{:.2}", 1e3 * run.speed_mps)),
                Cell::number(format!("{:+.2}", 1e3 * run.surface_shift_m)),
                Cell::number(format!("{:.2}", run.friction)),
                Cell::number(list(&run.puncture_n, 1.0)),
                Cell::number(list(&run.releases_m, 1e3)),
                Cell::number(three_decimals(run.floor_n)),
                Cell::number(three_decimals(Some(run.base_n))),
                Cell::number(three_decimals(Some(run.model_n))),
                Cell::number(three_decimals(Some(run.with_discrepancy_n))),
                Cell::number(format!("{:.0} %", 100.0 * run.coverage)),
            ]
        })
        .collect();
    let p = &r.variability;
    let mut text = vec![format!(
        "Standard deviations between recordings: surface {:.2} mm, friction {:.1} %, puncture force {:.1} %; between sessions (one speed and \
         stroke each): surface {:.2} mm, friction {:.1} %.",
        1e3 * p.surface_m,
        100.0 * p.friction,
        100.0 * p.puncture,
        1e3 * p.day_surface_m,
        100.0 * p.day_friction
    )];
    for (i, drops) in p.drops.iter().enumerate() {
        let release = p.release_positions_m.get(i).copied().flatten().map_or(String::new(), |(z, sd)| {
            format!("; released at {:.2} ± {:.2} mm (standard deviation)", 1e3 * z, 1e3 * sd)
        });
        text.push(format!(
            "Layer {}: the rupture shows as a force drop in {drops} of {} recordings{release}.",
            i + 1,
            r.recordings.len()
        ));
    }
    if r.starts.0 > 1 {
        text.push(format!(
            "{} starts of the fit were continued after screening; {} of them agree.",
            r.starts.0, r.starts.1
        ));
    }
    let by_part = r
        .phases
        .iter()
        .map(|p| {
            vec![
                Cell::text(p.phase),
                Cell::number(three_decimals(p.floor_n)),
                Cell::number(format!("{:.3}", p.model_n)),
                Cell::number(format!("{:.3}", p.with_discrepancy_n)),
            ]
        })
        .collect();
    Section::new("Variation between recordings")
        .texts(text)
        .table(Table::new(
            "RMS error of held-out recordings by phase (N)",
            &["", "mean of the others", "extended law", "with discrepancy"],
            by_part,
        ))
        .table(Table::new(
            "Recordings",
            &[
                "",
                "mm/s",
                "surface, mm",
                "friction factor",
                "puncture, N",
                "release depth, mm",
                "mean of the others, N",
                "base law, N",
                "extended law, N",
                "with discrepancy, N",
                "in band",
            ],
            rows,
        ))
}

/// Effects of sensor and drive that were detected or excluded without a tissue model.
pub(super) fn measurement_chain(study: &SetDiagnosis) -> Section {
    let i = &study.report.instrument;
    let row = |effect: &str, size_n: f64, evidence: &str| {
        vec![Cell::text(effect), Cell::number(format!("{:.1} mN", 1e3 * size_n)), Cell::text(evidence)]
    };
    let excluded: Vec<_> = i.excluded.iter().map(|e| row(&e.effect, e.max_force_n, &e.evidence)).collect();
    let shown: Vec<_> = i.detected.iter().map(|e| row(&e.effect, e.max_force_n, &e.evidence)).collect();
    let mut section = Section::new("The instrument");
    if excluded.is_empty() && shown.is_empty() {
        return section.text("No recording in air, no known load and no samples before contact: no sensor effect can be excluded.");
    }
    section = section.text(
        "Determined without a tissue model: from motion in air and known loads where recorded, from the force before contact, and from the delay of \
         the force when the needle stops or reverses.",
    );
    if !shown.is_empty() {
        section = section.text(
            "Detected effects were corrected before fitting (except tones and drive friction): forces on this page are corrected, and the extended \
             scenario contains these effects.",
        );
    }
    for (title, rows) in [("Detected", shown), ("Excluded", excluded)] {
        if !rows.is_empty() {
            section = section.table(Table::new(title.to_owned(), &["effect", "size", "evidence"], rows));
        }
    }
    section
}
