//! The page of an experiment plan: the proposed motion, expected forces, and which candidates it separates.

use crate::chart_model::{Chart, Series};
use crate::page_model::{Cell, Page, Section, Status, Table, Tile};
use crate::pages::formatting::effect_label;
use crate::palette::Colour;
use std::fmt::Write as _;
use stylet_plan::{InformationState, Plan};
use stylet_scenario::{Motion, Scenario, Segment};
use stylet_stats::number_format::significant;

/// Candidates whose expected forces are drawn.
const MAX_CANDIDATES_DRAWN: usize = 7;

/// The page of a plan; `verdict` is the diagnosis it starts from.
#[must_use]
pub fn page(
    scenario: &Scenario,
    verdict: Option<String>,
    information: &InformationState,
    plan: &Plan,
) -> Page {
    let percent = |p: f64| format!("{:.0} %", 100.0 * p);
    let mut tiles = vec![
        Tile::new(
            "Correct single cause",
            format!("{} → {}", percent(plan.probability_now), percent(plan.probability_decided)),
            if plan.probability_source == "simulated" {
                "probability before and after the insertion, from simulated insertions and expected evidence"
            } else {
                "probability before and after the insertion, from expected evidence alone"
            },
        ),
        Tile::new(
            "Duration",
            format!("{} s", significant(plan.duration_s, 3)),
            format!("limit {} s", plan.limits.duration_s),
        ),
        Tile::new(
            "Depth",
            format!("{:.1} mm", 1e3 * plan.depth_m),
            format!("limit {:.1} mm", 1e3 * plan.limits.depth_m),
        ),
        Tile::new(
            "Largest force",
            format!("{} N", significant(plan.force_n, 3)),
            format!("largest under any candidate, noise included; limit {} N", plan.limits.force_n),
        ),
    ];
    if let Some(r) = &plan.repeats {
        tiles.push(Tile::new(
            "Repeats",
            r.insertions.to_string(),
            format!(
                "puncture forces scatter by {:.1} %: half at {} and half at {} mm/s estimate their mean to {:.1} %",
                100.0 * r.scatter,
                significant(1e3 * r.speeds_mps[0], 2),
                significant(1e3 * r.speeds_mps[1], 2),
                100.0 * r.mean_half_width
            ),
        ));
    }
    let mut page = Page::new(format!("The next insertion: {}", scenario.name))
        .subtitle(verdict.unwrap_or_else(|| {
            "Without measurements: every effect of the library is a candidate.".to_owned()
        }))
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .fact("motions evaluated", plan.motions_evaluated.to_string())
        .section(Section::new("Plan").tiles(tiles));
    page = page.section(motion(plan, information)).section(pairs(plan));
    if !plan.simulated.is_empty() {
        let rows = plan
            .simulated
            .iter()
            .map(|t| {
                vec![
                    Cell::text(effect_label(&t.candidate)),
                    Cell::number(format!("{} of {}", t.correct, t.trials)),
                ]
            })
            .collect();
        page = page.section(Section::new("Simulated and diagnosed").table(Table::new(
            "The chosen motion simulated under each candidate and diagnosed together with the existing recordings; these \
             simulations were not used to choose the motion",
            &["simulated cause", "diagnosed as the single cause"],
            rows,
        )));
    }
    page.section(intervals(plan)).section(alternatives(plan))
}

fn motion(plan: &Plan, information: &InformationState) -> Section {
    let mut section = Section::new("Proposed motion");
    if let Some(e) = information.expected_forces(&plan.motion) {
        let mm: Vec<f64> = e.position_m.iter().map(|z| 1e3 * z).collect();
        section = section.chart(
            Chart::new("Position", "Time (s)", "Position (mm)")
                .group("plan")
                .height(220)
                .with_series(Series::line("tip", Colour::Blue, e.time_s.clone(), mm)),
        );
        let mut forces = Chart::new("Expected force under each candidate", "Time (s)", "Force (N)")
            .group("plan")
            .height(320);
        let mut differ = Chart::new("Differences between candidates", "Time (s)", "Force minus that of the likeliest (N)")
            .caption("Each candidate with base parameters fitted to the existing recordings. Part of a difference may be absorbed by re-fitting them: the evidence in nats accounts for that, this chart does not.")
            .group("plan")
            .height(260);
        for (k, f) in e.force_n.iter().enumerate().take(MAX_CANDIDATES_DRAWN) {
            let name = effect_label(information.name(k));
            forces = forces.with_series(
                Series::line(name.clone(), Colour::nth(k), e.time_s.clone(), f.clone()).width(1.3),
            );
            if k > 0 {
                let less: Vec<f64> = f.iter().zip(&e.force_n[0]).map(|(f, g)| f - g).collect();
                differ =
                    differ.with_series(Series::line(name, Colour::nth(k), e.time_s.clone(), less).width(1.3));
            }
        }
        section = section.chart(forces);
        if e.force_n.len() > 1 {
            section = section.chart(differ);
        }
    }
    let mut text = String::new();
    if let Motion::Program { start_m, segments } = &plan.motion {
        let _ = writeln!(text, "start   {:>8.3} mm", 1e3 * start_m);
        for s in segments {
            let _ = match *s {
                Segment::Move { velocity_mps, duration_s } => {
                    writeln!(
                        text,
                        "move    {:>8.3} mm/s            for {duration_s:.3} s",
                        1e3 * velocity_mps
                    )
                }
                Segment::Hold { duration_s } => {
                    writeln!(text, "hold                             for {duration_s:.3} s")
                }
                Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s }
                    if frequency_hz * duration_s <= 0.2501 =>
                {
                    writeln!(
                        text,
                        "change  {:>8.3} to {:>6.3} mm/s    in  {duration_s:.3} s",
                        1e3 * velocity_mps,
                        1e3 * (velocity_mps + amplitude_mps)
                    )
                }
                Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s } => {
                    writeln!(
                        text,
                        "ripple  {:>8.3} +- {:>6.3} mm/s    for {duration_s:.3} s at {frequency_hz:.3} Hz",
                        1e3 * velocity_mps,
                        1e3 * amplitude_mps
                    )
                }
            };
        }
    }
    section.code("segments", text)
}

fn pairs(plan: &Plan) -> Section {
    let mut all: Vec<_> = plan.pairs.iter().collect();
    all.sort_by(|a, b| a.nats_after.total_cmp(&b.nats_after));
    let rows = all
        .iter()
        .take(60)
        .map(|p| {
            let status =
                if !p.distinguishable { Status::Plain } else { Status::at_most(-p.nats_after, -10.0, -3.0) };
            vec![
                Cell::text(effect_label(&p.a)),
                Cell::text(effect_label(&p.b)),
                Cell::number(significant(p.nats_before, 3)),
                Cell::number(significant(p.nats_after, 3)).status(status),
                Cell::number(format!("{:.0} %", 100.0 * p.p_correct_before)),
                Cell::number(format!("{:.0} %", 100.0 * p.p_correct_after)),
                Cell::text(if p.distinguishable { "" } else { "not separable within the limits" }),
            ]
        })
        .collect();
    let mut section = Section::new("Pairs of candidates").text(
        "Expected difference of the log likelihood in nats between the true candidate and the other, re-fitted together with all base \
         parameters. Below 3 nats two candidates are not separable; from 10 nats on they are. Probability: of choosing the right one of \
         the two.",
    );
    if all.is_empty() {
        section = section
            .text("No candidates are left to separate: the motion was chosen for the narrowest intervals.");
    }
    section.table(
        Table::new(
            "Hardest pairs first, at most 60",
            &["candidate", "alternative", "before", "after", "before", "after", ""],
            rows,
        )
        .with_column_groups(&[("", 2), ("evidence, nats", 2), ("probability correct", 2), ("", 1)]),
    )
}

fn intervals(plan: &Plan) -> Section {
    let rows = plan
        .intervals
        .iter()
        .map(|i| {
            vec![
                Cell::text(i.name.clone()),
                Cell::number(significant(i.half_width_before, 2)),
                Cell::number(significant(i.half_width_after, 2)),
            ]
        })
        .collect();
    Section::new("Intervals").table(Table::new(
        "Half widths of the 95 % intervals: relative for K, b and F; in m for positions",
        &["parameter", "before", "after"],
        rows,
    ))
}

fn alternatives(plan: &Plan) -> Section {
    let rows = plan
        .alternatives
        .iter()
        .map(|a| {
            let segments = if let Motion::Program { segments, .. } = &a.motion { segments.len() } else { 0 };
            vec![
                Cell::number(segments.to_string()),
                Cell::number(significant(a.duration_s, 3)),
                Cell::number(significant(a.force_n, 3)),
                Cell::number(significant(a.worst_pair_nats, 3)),
                Cell::number(format!("{:.0} %", 100.0 * a.probability_decided)),
                Cell::number(if a.simulated > 0 {
                    format!("{} of {}", a.correct, a.simulated)
                } else {
                    "-".to_owned()
                }),
            ]
        })
        .collect();
    Section::new("Alternative motions").table(Table::new(
        "Next best motions; their segments are in plan.json",
        &[
            "segments",
            "duration, s",
            "peak force, N",
            "hardest pair, nats",
            "probability correct",
            "correct in simulation",
        ],
        rows,
    ))
}
