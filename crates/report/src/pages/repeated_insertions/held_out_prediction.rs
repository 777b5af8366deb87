//! Each recording predicted by laws fitted to the others: errors, curves, residuals over depth.

use crate::chart_model::{Chart, Level, LineStyle, Series};
use crate::page_model::{Cell, Section, Table};
use crate::pages::formatting::three_decimals;
use crate::palette::Colour;
use stylet_diagnose::repeated_insertions::SegmentedRecording;
use stylet_diagnose::repeated_insertions::diagnose_set::SetDiagnosis;
use stylet_diagnose::repeated_insertions::segmented_recording::mean_speeds;
use stylet_diagnose::report_curves::binned_means;
use stylet_stats::number_format::p_value;

pub(super) fn held_out_predictions(runs: &[&SegmentedRecording], study: &SetDiagnosis) -> Section {
    let r = &study.report;
    let rows = r
        .speeds
        .iter()
        .map(|s| {
            vec![
                Cell::text(format!("{:.2} mm/s", 1e3 * s.speed_mps)),
                Cell::number(s.recordings.to_string()),
                Cell::number(three_decimals(s.floor_n)),
                Cell::number(three_decimals(Some(s.base_n))),
                Cell::number(three_decimals(Some(s.model_n))),
                Cell::number(three_decimals(Some(s.with_discrepancy_n))),
                Cell::number(format!("{:.1} %", 100.0 * s.coverage)),
                Cell::number(three_decimals(s.base_held_out_speed_n)),
                Cell::number(three_decimals(s.held_out_speed_n)),
            ]
        })
        .chain(std::iter::once(vec![
            Cell::text("mean"),
            Cell::number(r.recordings.len().to_string()),
            Cell::number(three_decimals(r.mean.floor_n)),
            Cell::number(three_decimals(Some(r.mean.base_n))),
            Cell::number(three_decimals(Some(r.mean.model_n))),
            Cell::number(three_decimals(Some(r.mean.with_discrepancy_n))),
            Cell::number(format!("{:.1} %", 100.0 * r.mean.coverage)),
            Cell::number(three_decimals(r.mean.base_held_out_speed_n)),
            Cell::number(three_decimals(r.mean.held_out_speed_n)),
        ]))
        .collect();
    let mut section = Section::new("Before and after").table(
        Table::new(
            "RMS error of held-out recordings (N)",
            &[
                "",
                "recordings",
                "mean of the others",
                "base law",
                "extended law",
                "with discrepancy",
                "in the 90 % band",
                "base law",
                "extended law",
            ],
            rows,
        )
        .with_column_groups(&[("", 2), ("one recording held out", 5), ("a whole speed held out", 2)]),
    );
    section = section.text(
        "Empirical discrepancy: the mean residual of the other recordings at the same speed, as far as it exceeds their scatter, added to \
         the prediction of the law. It does not extend to other speeds and identifies no cause.",
    );
    if let Some(nested) = &r.nested {
        section = section.text(format!(
            "Cross-validation over parts of the set: {:.3} N with the selected law, {:.3} N with laws selected without the held-out part.",
            nested.selected_with_n, nested.selected_without_n
        ));
    }
    if let Some(parts) = &r.composition {
        let mut paragraphs: Vec<String> = parts
            .single_layers
            .iter()
            .map(|(name, floor, error)| {
                format!(
                    "{name}: {error:.3} N on held-out recordings, mean of the others {} N.",
                    three_decimals(*floor)
                )
            })
            .collect();
        paragraphs.push(format!("Both laws combined: {:.3} N (mean over the speeds).", parts.mean_n));
        section = section.texts(paragraphs);
    }
    // The recording of median error at each speed.
    let groups = mean_speeds(runs);
    for (v, members) in groups {
        let mut order = members.clone();
        order.sort_by(|a, b| {
            r.recordings[*a].with_discrepancy_n.total_cmp(&r.recordings[*b].with_discrepancy_n)
        });
        let i = order[order.len() / 2];
        let (run, p) = (runs[i], &&study.held_out[i].prediction);
        let t = &run.recording.time_s;
        let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, t.clone(), y.to_vec());
        section = section.chart(
            Chart::new(format!("{} ({:.2} mm/s)", run.name, 1e3 * v), "Time (s)", "Force (N)")
                .caption(format!(
                    "Measured, and predicted from the other recordings: base law {:.3} N rms, extended law {:.3} N, with discrepancy {:.3} N. Dashed: \
                     90 % band.",
                    r.recordings[i].base_n, r.recordings[i].model_n, r.recordings[i].with_discrepancy_n
                ))
                .height(320)
                .with_series(line("measured", Colour::Grey, &run.recording.force_n).width(3.0))
                .with_series(line("base law", Colour::Vermillion, &study.base_held_out[i].model_force_n).width(1.1))
                .with_series(line("extended law", Colour::Blue, &study.held_out[i].model_force_n).width(1.5))
                .with_series(line("with discrepancy", Colour::Green, &p.mean_n).width(1.1))
                .with_series(line("5 %", Colour::SkyBlue, &p.low_n).width(0.8).styled(LineStyle::Dashed))
                .with_series(line("95 %", Colour::SkyBlue, &p.high_n).width(0.8).styled(LineStyle::Dashed)),
        );
    }
    section
}

pub(super) fn residual_charts(runs: &[&SegmentedRecording], study: &SetDiagnosis) -> Section {
    let mut section = Section::new("Residual").text(format!(
        "Measured minus predicted force of held-out recordings, averaged over 60 bins of depth. The residual common to all fitted recordings depends on {} \
         ({}).",
        if study.diagnosis.residual_structure.depends_on.is_empty() { "nothing".to_owned() } else { study.diagnosis.residual_structure.depends_on.join(", ") },
        p_value(study.diagnosis.residual_structure.p_value)
    ));
    for (title, back) in [("Residual during insertion", false), ("Residual during retraction", true)] {
        let mut chart = Chart::new(title, "Depth (mm)", "Residual (N)").height(280).with_level(Level::zero());
        for (name, colour, predictions) in [
            ("base law", Colour::Vermillion, &study.base_held_out),
            ("extended law", Colour::Blue, &study.held_out),
        ] {
            let (mut x, mut y) = (Vec::new(), Vec::new());
            for (run, law_n) in runs.iter().zip(predictions).map(|(run, out)| (run, &out.model_force_n)) {
                let r = &run.recording;
                for i in 0..r.len() {
                    let here = if back { i >= run.phases.retraction } else { i <= run.phases.deepest };
                    if here {
                        x.push(1e3 * r.position_m[i]);
                        y.push(r.force_n[i] - law_n.get(i).copied().unwrap_or(f64::NAN));
                    }
                }
            }
            let used = vec![true; x.len()];
            let (bx, by) = binned_means(&x, &y, &used, 60);
            chart = chart.with_series(Series::line(name, colour, bx, by));
        }
        section = section.chart(chart);
    }
    section
}
