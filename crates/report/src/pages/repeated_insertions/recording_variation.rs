//! What varies from run to run, and what the instrument does by itself.

use crate::page_model::{Cell, Section, Table};
use crate::pages::formatting::three_decimals;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;

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
        "From run to run the surface shifts by {:.2} mm, friction varies by {:.1} % and what a layer bears by {:.1} %; from day to day (a speed, a \
         stroke) the surface by {:.2} mm and friction by {:.1} % (standard deviations).",
        1e3 * p.surface_m,
        100.0 * p.friction,
        100.0 * p.puncture,
        1e3 * p.day_surface_m,
        100.0 * p.day_friction
    )];
    for (i, drops) in p.drops.iter().enumerate() {
        let release = p.release_positions_m.get(i).copied().flatten().map_or(String::new(), |(z, sd)| {
            format!("; lets go at {:.2} mm, give or take {:.2} mm", 1e3 * z, 1e3 * sd)
        });
        text.push(format!(
            "Layer {}: its rupture is a drop in {drops} of {} runs{release}.",
            i + 1,
            r.recordings.len()
        ));
    }
    if r.starts.0 > 1 {
        text.push(format!(
            "{} starts of the fit went on after a first look; of these, {} starts agree.",
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
    Section::new("What varies from run to run")
        .texts(text)
        .table(Table::new(
            "By part of an insertion, on runs left out (N rms)",
            &["", "mean of the others", "extended law", "and what is alike"],
            by_part,
        ))
        .table(Table::new(
            "Runs",
            &[
                "",
                "mm/s",
                "surface, mm",
                "friction, times",
                "puncture, N",
                "lets go, mm",
                "floor, N",
                "base law, N",
                "extended, N",
                "in band",
            ],
            rows,
        ))
}

pub(super) fn measurement_chain(study: &SetDiagnosis) -> Section {
    let i = &study.report.instrument;
    let row = |effect: &str, size_n: f64, evidence: &str| {
        vec![Cell::text(effect), Cell::number(format!("{:.1} mN", 1e3 * size_n)), Cell::text(evidence)]
    };
    let excluded: Vec<_> = i.excluded.iter().map(|e| row(&e.effect, e.max_force_n, &e.evidence)).collect();
    let shown: Vec<_> = i.detected.iter().map(|e| row(&e.effect, e.max_force_n, &e.evidence)).collect();
    let mut section = Section::new("The instrument");
    if excluded.is_empty() && shown.is_empty() {
        return section.text("No recording in air, no known load, no air before contact: nothing of the sensor can be excluded.");
    }
    section = section.text(
        "Seen without a law: a motion in air and a known load where they were recorded, the force before the needle reaches the tissue, and whether \
         the force answers at once where the needle stops or its way back begins.",
    );
    if !shown.is_empty() {
        section = section.text(
            "What it shows was undone before any law was fitted (but tones and the drive's friction): the forces on this page are the corrected ones, and \
             the extended scenario has these effects in its sensor.",
        );
    }
    for (title, rows) in [("Shown: a cause", shown), ("Excluded as causes", excluded)] {
        if !rows.is_empty() {
            section =
                section.table(Table::new(title.to_owned(), &["effect", "force here", "evidence"], rows));
        }
    }
    section
}
