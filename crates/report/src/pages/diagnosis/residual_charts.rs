//! Residuals of the base law and the extended model: over time, depth, velocity and frequency, and before against after.

use super::summary_sentence::recording_differences;
use crate::chart_model::{Chart, Level, LineStyle, MarkerSet, Needle, Scale, Series, Side};
use crate::page_model::{Cell, Section, Status, Table};
use crate::palette::Colour;
use stylet_diagnose::DiagnosisResult;
use stylet_diagnose::diagnosis_json::Diagnosis;
use stylet_diagnose::report_curves::{
    RecordingCurves, binned_means, correlations, reported_fit, rms_by_layer_and_phase,
};
use stylet_diagnose::tone_detection::residual_spectrum;
use stylet_scenario::Scenario;
use stylet_stats::number_format::{p_value, significant};
use stylet_tissue::Slab;

/// The assumed scenario, and the residual of the recording that the base law fits worst.
pub(super) fn assumptions(scenario: &Scenario, d: &Diagnosis, all: &[RecordingCurves]) -> Section {
    let percent = |share: f64| significant(100.0 * share, 2);
    let text = format!(
        "Assumed: {} layer{}; stiffness, friction and puncture force to {} %, thickness to {} %, surface to {} mm{}. The base law was fitted within these tolerances.",
        scenario.tissue.layers.len(),
        if scenario.tissue.layers.len() == 1 { "" } else { "s" },
        percent(scenario.tolerance),
        percent(scenario.thickness_tolerance),
        significant(1e3 * scenario.surface_tolerance_m, 2),
        match scenario.effects.len() {
            0 => String::new(),
            n => format!(", {n} effect{} beyond the base law", if n == 1 { "" } else { "s" }),
        }
    );
    let section = Section::new("Assumptions and misfit").text(text);
    let Some((c, name)) = worst_recording(d, all) else { return section };
    section.chart(misfit_chart(d, c, name))
}

/// The recording that the base law fits worst, and its name.
pub(super) fn worst_recording<'a>(
    d: &'a Diagnosis,
    all: &'a [RecordingCurves],
) -> Option<(&'a RecordingCurves, &'a str)> {
    let mean_square = |c: &RecordingCurves| {
        c.base_residual_n.iter().zip(&c.used).filter(|(_, u)| **u).map(|(e, _)| e * e).sum::<f64>()
            / c.used.iter().filter(|u| **u).count().max(1) as f64
    };
    let named = all.iter().zip(d.gain.recordings.iter().map(String::as_str));
    named.max_by(|a, b| mean_square(a.0).total_cmp(&mean_square(b.0)))
}

/// Residuals of the base law and of the extended model over time.
pub(super) fn misfit_chart(d: &Diagnosis, c: &RecordingCurves, name: &str) -> Chart {
    let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, c.time_s.clone(), y.to_vec());
    Chart::new(format!("{name}: measured minus fitted"), "Time (s)", "Residual (N)")
        .caption(
            "The recording that the base law fits worst. Forces are averages over blocks of 20 ms, and ruptures are at their observed times: the \
             held-out error in the verdict also contains the error of the predicted rupture times, which is briefly as large as the force drop.",
        )
        .group(name)
        .height(260)
        .with_series(line("base law", Colour::Vermillion, &c.base_residual_n).width(1.2))
        .with_series(line("extended model", Colour::Blue, &c.extended_residual_n).width(1.0))
        .with_level(Level::dotted(2.0 * d.noise.sd_n, "twice the noise of a single sample"))
        .with_level(Level::dotted(-2.0 * d.noise.sd_n, ""))
}

/// The recording that the base law fits worst, with a needle that moves through the layers.
pub(super) fn insertion(d: &Diagnosis, examined: &DiagnosisResult, all: &[RecordingCurves]) -> Section {
    let section = Section::new("The insertion");
    let Some((c, name)) = worst_recording(d, all) else { return section };
    let tissue = &reported_fit(examined).model.tissue;
    let faces = (0..tissue.layers.len()).map(|k| tissue.front_m(k)).chain([tissue.end_m()]);
    let needle = Needle {
        time_s: c.time_s.clone(),
        tip_mm: c.position_m.iter().map(|z| 1e3 * z).collect(),
        faces_mm: faces.map(|m| 1e3 * m).collect(),
    };
    section.chart(fit_chart(c, name).with_needle(needle).group("insertion"))
}

/// Measured force of a recording, and the force fitted by the base law and by the extended model.
pub(super) fn fit_chart(c: &RecordingCurves, name: &str) -> Chart {
    let ruptures = MarkerSet {
        name: "observed ruptures".to_owned(),
        colour: Colour::Grey,
        style: LineStyle::Dashed,
        side: Side::Right,
        marks: c.ruptures_s.iter().enumerate().map(|(k, t)| (*t, format!("layer {}", k + 1))).collect(),
    };
    let fitted = |e: &[f64]| c.force_n.iter().zip(e).map(|(f, e)| f - e).collect::<Vec<_>>();
    let line = |name: &str, colour, y: Vec<f64>| Series::line(name, colour, c.time_s.clone(), y);
    Chart::new(name, "Time (s)", "Force (N)")
        .caption("Measured, and fitted by the base law and the extended model with ruptures at their observed times.")
        .group(name)
        .height(300)
        .with_series(line("measured", Colour::Grey, c.force_n.clone()).width(3.0))
        .with_series(line("base law", Colour::Vermillion, fitted(&c.base_residual_n)).width(1.1))
        .with_series(line("extended model", Colour::Blue, fitted(&c.extended_residual_n)).width(1.3))
        .with_markers(ruptures)
}

/// Errors before and after, and the fitted curves of up to 8 recordings.
pub(super) fn before_and_after(d: &Diagnosis, all: &[RecordingCurves]) -> Section {
    let g = &d.gain;
    let rows = g
        .recordings
        .iter()
        .zip(&g.per_recording_n)
        .map(|(name, (before, after))| {
            vec![
                Cell::text(name.clone()),
                Cell::number(significant(*before, 3)),
                Cell::number(significant(*after, 3)).status(Status::at_most(
                    *after,
                    1.15 * g.floor_n,
                    2.0 * g.floor_n,
                )),
                Cell::number(significant(g.floor_n, 3)),
            ]
        })
        .collect();
    let title = if g.held_out {
        "RMS error of each recording predicted from the others, rupture times predicted by the law (N)"
    } else {
        "RMS error of the fitted recording, rupture times predicted by the law (N)"
    };
    let mut section = Section::new("Before and after").table(Table::new(
        title.to_owned(),
        &["", "base law, re-fitted", "extended model", "noise"],
        rows,
    ));
    for (c, name) in all.iter().zip(&g.recordings).take(8) {
        section = section.chart(fit_chart(c, name));
    }
    section
}

/// The residual of the base law over time, depth, velocity and frequency.
pub(super) fn base_law_residual(
    d: &Diagnosis,
    examined: &DiagnosisResult,
    all: &[RecordingCurves],
) -> Section {
    let mut section = Section::new("Residual of the base law").text(
        "Measured minus fitted force of the re-fitted base law, ruptures at their observed times. The charts suggest causes; the \
         likelihood of the search below decides.",
    );
    let names = &d.gain.recordings;
    let mut time =
        Chart::new("Residual against time", "Time (s)", "Residual (N)").height(260).with_level(Level::zero());
    let mut depth = Chart::new("Residual against depth", "Depth (mm)", "Residual (N)")
        .caption("Means over 60 bins of depth; retraction dotted.")
        .height(260)
        .with_level(Level::zero());
    let mut velocity = Chart::new("Residual against velocity", "Velocity (mm/s)", "Residual (N)")
        .caption("Means over 60 bins of velocity, with the needle in the tissue.")
        .height(260)
        .with_level(Level::zero());
    for (k, (c, name)) in all.iter().zip(names).enumerate() {
        let colour = Colour::nth(k);
        time = time.with_series(
            Series::line(name.clone(), colour, c.time_s.clone(), c.base_residual_n.clone()).width(1.0),
        );
        let pick = |keep: &dyn Fn(usize) -> bool| -> Vec<bool> {
            (0..c.used.len()).map(|i| c.used[i] && keep(i)).collect()
        };
        let mm: Vec<f64> = c.position_m.iter().map(|z| z * 1e3).collect();
        let mmps: Vec<f64> = c.velocity_mps.iter().map(|v| v * 1e3).collect();
        let (x, y) = binned_means(&mm, &c.base_residual_n, &pick(&|i| c.velocity_mps[i] >= -1e-5), 60);
        depth = depth.with_series(Series::line(name.clone(), colour, x, y));
        let (x, y) = binned_means(&mm, &c.base_residual_n, &pick(&|i| c.velocity_mps[i] < -1e-5), 60);
        if !x.is_empty() {
            depth = depth.with_series(
                Series::line(format!("{name}, retraction"), colour, x, y).styled(LineStyle::Dotted),
            );
        }
        let (x, y) = binned_means(&mmps, &c.base_residual_n, &pick(&|i| c.position_m[i] > 0.0), 60);
        velocity = velocity.with_series(Series::points(name.clone(), colour, x, y));
    }
    section = section.chart(time).chart(depth).chart(velocity);
    let layers = examined.search.base.model.layers();
    let (before, after) = (
        rms_by_layer_and_phase(all, |c| &c.base_residual_n, layers),
        rms_by_layer_and_phase(all, |c| &c.extended_residual_n, layers),
    );
    let rows = before
        .iter()
        .zip(&after)
        .enumerate()
        .map(|(k, (b, a))| {
            let name = match k {
                0 => "in air".to_owned(),
                k if k > layers => "beyond the last layer".to_owned(),
                k => format!("layer {k}"),
            };
            let mut row = vec![Cell::text(name)];
            for (b, a) in b.iter().zip(a) {
                row.push(Cell::number(significant(*b, 3)).status(Status::at_most(
                    *b,
                    1.3 * d.noise.sd_n,
                    3.0 * d.noise.sd_n,
                )));
                row.push(Cell::number(significant(*a, 3)));
            }
            row
        })
        .collect();
    section = section.table(
        Table::new(
            "RMS residual by layer and phase, averages over 20 ms (N)",
            &["", "base", "extended", "base", "extended", "base", "extended"],
            rows,
        )
        .with_column_groups(&[("", 1), ("advance", 2), ("hold", 2), ("retraction", 2)]),
    );
    let slabs = Slab::stack(&examined.search.base.model.tissue);
    let (cb, ca) = (
        correlations(all, |c| &c.base_residual_n, &slabs),
        correlations(all, |c| &c.extended_residual_n, &slabs),
    );
    section = section.table(Table::new(
        "Correlation of the residual with motion and force",
        &["", "base law", "extended model"],
        cb.iter()
            .zip(&ca)
            .map(|((name, b), (_, a))| {
                vec![Cell::text(*name), Cell::number(format!("{b:+.3}")), Cell::number(format!("{a:+.3}"))]
            })
            .collect(),
    ));
    let search = &examined.search;
    let (f, base) = residual_spectrum(&search.base, &search.data);
    let best = reported_fit(examined);
    let (_, after) = residual_spectrum(best, &search.data);
    let keep: Vec<usize> = thin(&f, &base);
    let pick = |x: &[f64]| keep.iter().map(|k| x[*k]).collect::<Vec<_>>();
    let chart = Chart::new("Spectrum of the residual", "log10 of frequency (Hz)", "N/sqrt(Hz)")
        .caption("Amplitude spectral density at the sampling rate of the recordings, averaged over recordings; the largest value of each 1/50 decade is drawn.")
        .height(240);
    let log: Vec<f64> = pick(&f).iter().map(|f| libm::log10(*f)).collect();
    section.chart(Chart {
        scale: Scale::Log,
        ..chart
            .with_series(Series::line("base law", Colour::Vermillion, log.clone(), pick(&base)))
            .with_series(Series::line("extended model", Colour::Blue, log, pick(&after)))
    })
}

/// Indices of the largest value in each 1/50 decade of frequency.
fn thin(f: &[f64], value: &[f64]) -> Vec<usize> {
    let mut kept: Vec<(i64, usize)> = Vec::new();
    for (k, f) in f.iter().enumerate().filter(|(_, f)| **f > 0.01) {
        let bin = libm::floor(libm::log10(*f) * 50.0) as i64;
        match kept.last_mut() {
            Some((last, best)) if *last == bin => {
                if value[k] > value[*best] {
                    *best = k;
                }
            }
            _ => kept.push((bin, k)),
        }
    }
    kept.into_iter().map(|k| k.1).collect()
}

/// Residual with the extended model.
pub(super) fn remaining_structure(d: &Diagnosis, all: &[RecordingCurves]) -> Section {
    let text = if d.residual_structure.p_value < 1e-3 {
        format!(
            "The residual of the extended model has structure: it depends on {} ({}{}).",
            d.residual_structure.depends_on.join(", "),
            p_value(d.residual_structure.p_value),
            if d.residual_structure.nats > 0.0 {
                format!("; {} nats", significant(d.residual_structure.nats, 3))
            } else {
                String::new()
            }
        )
    } else {
        format!(
            "No structure common to the recordings remains ({}). Estimated noise of a single sample: {} N, autoregressive coefficients {} and {}, {}.",
            p_value(d.residual_structure.p_value),
            significant(d.noise.sd_n, 3),
            significant(d.noise.ar[0], 3),
            significant(d.noise.ar[1], 3),
            if d.noise.from_air { "checked on samples in air" } else { "not checked in air" }
        )
    };
    let mut chart = Chart::new("Residual of the extended model", "Depth (mm)", "Residual (N)")
        .caption("Means over 60 bins of depth.")
        .height(240)
        .with_level(Level::zero());
    for (k, (c, name)) in all.iter().zip(&d.gain.recordings).enumerate() {
        let mm: Vec<f64> = c.position_m.iter().map(|z| z * 1e3).collect();
        let (x, y) = binned_means(&mm, &c.extended_residual_n, &c.used, 60);
        chart = chart.with_series(Series::line(name.clone(), Colour::nth(k), x, y));
    }
    let section = Section::new("Remaining residual").text(text);
    let section = match recording_differences(d) {
        Some(differences) => section.text(format!(
            "Random effects, fitted but not causes: {differences}. They limit the prediction of a new insertion."
        )),
        None => section,
    };
    section.chart(chart)
}
