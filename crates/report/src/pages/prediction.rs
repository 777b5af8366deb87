//! The page of a prediction: a fitted model against held-out recordings.

use crate::chart_model::{Chart, Level, LineStyle, MarkerSet, Series, Side};
use crate::page_model::{Cell, Page, Section, Status, Table, Tile};
use crate::pages::formatting::{or_dash, significant_or_dash, zero_offset_sentences};
use crate::pages::transfer::difference;
use crate::palette::Colour;
use stylet_diagnose::prediction::{Prediction, PredictionCurves, PredictionResult, RecordingPrediction};
use stylet_scenario::Scenario;
use stylet_stats::Z95;
use stylet_stats::number_format::significant;

/// Largest number of recordings with individual charts.
const MAX_CHARTED: usize = 12;

/// The page of what `model`, which was read from `file`, predicts.
#[must_use]
pub fn page(model: &Scenario, file: &str, found: &PredictionResult) -> Page {
    let p = &found.prediction;
    let mut page = Page::new(format!("Prediction: {}", model.name))
        .subtitle(summary_sentence(p))
        .fact("model", file)
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(overview(found));
    let mut section = Section::new("Predicted and measured");
    for (r, shown) in p.recordings.iter().zip(&found.curves).take(MAX_CHARTED) {
        section = section.chart(force(r, shown)).chart(residual(r, shown, p.floor_n));
    }
    if p.recordings.len() > MAX_CHARTED {
        section = section.text(format!(
            "The other {} recordings are listed in the table only.",
            p.recordings.len() - MAX_CHARTED
        ));
    }
    page = page.section(section);
    page
}

/// The quality of a prediction in one sentence.
#[must_use]
pub fn summary_sentence(p: &Prediction) -> String {
    let ratio = p.rmse_n / p.floor_n.max(1e-300);
    let within = format!(
        "residual {} N rms, {} times the noise; {:.0} % of the samples in the 90 % band",
        significant(p.rmse_n, 3),
        significant(ratio, 2),
        100.0 * p.band_coverage
    );
    let is_in_own_band = p.coverage_by_group.map_or(p.band_coverage, |c| c.same) >= 0.8;
    let how = if ratio < 1.2 && p.band_coverage >= 0.8 {
        "The model predicts these recordings to within the noise"
    } else if p.band_coverage >= 0.8 && !is_in_own_band {
        "The model predicts these recordings within what another group may differ by"
    } else if p.band_coverage >= 0.8 {
        "The model predicts these recordings within the scatter it was fitted with"
    } else {
        "The model does not predict these recordings"
    };
    format!("{how}: {within}.")
}

/// A warning where recordings that made the model are predicted with it.
#[must_use]
pub fn training_sentence(p: &Prediction) -> Option<String> {
    let made: Vec<&str> =
        p.recordings.iter().filter(|r| r.is_training_recording).map(|r| r.name.as_str()).collect();
    (!made.is_empty()).then(|| {
        format!(
            "The model was fitted to {}, so the error there says nothing about new recordings.",
            made.join(", ")
        )
    })
}

/// Which group of recordings the band assumes.
#[must_use]
pub fn group_sentence(p: &Prediction) -> String {
    let assumed = if p.varying.is_empty() {
        "The band is that of a new recording of the group that made the model".to_owned()
    } else {
        let what: Vec<String> = p.varying.iter().map(|f| format!("another {}", f.name())).collect();
        format!("The band assumes another group than that which made the model: {}", what.join(", "))
    };
    let both = p.coverage_by_group.map_or_else(String::new, |c| {
        format!(
            "; {:.0} % of the samples are in the band of the same group, {:.0} % in that of an unseen one",
            100.0 * c.same,
            100.0 * c.unseen
        )
    });
    format!("{assumed}{both}.")
}

/// Changes by the refit.
#[must_use]
pub fn refit_sentence(p: &Prediction) -> Option<String> {
    let refit = p.refit.as_ref()?;
    let errors = format!(
        "RMS error of the {} (means over 20 ms) {} N without and {} N with it",
        if refit.recordings == 1 {
            "fitted recording".to_owned()
        } else {
            format!("{} fitted recordings", refit.recordings)
        },
        significant(refit.before_n, 3),
        significant(refit.after_n, 3)
    );
    if !refit.moved {
        return Some(format!("The refit gains nothing and is not used: {errors}."));
    }
    let parameters: Vec<String> = refit
        .parameters
        .iter()
        .map(|f| {
            let at = |sds: f64| f.parameter.shift_or_factor(f.value + sds * f.sd);
            difference(f.parameter, at(0.0), at(-Z95), at(Z95))
        })
        .collect();
    Some(format!("Refitted group (95 %): {}; {errors}.", parameters.join(", ")))
}

/// A sentence for each mean curve that predicts better than the model.
#[must_use]
pub fn worse_than_baseline(p: &Prediction) -> Vec<String> {
    let worse = p.baselines.iter().filter(|b| b.prediction_is_worse);
    let sentence = |name: &str, own: f64, other: f64| {
        format!(
            "The model is worse than {name}: {} N rms against {} N.",
            significant(own, 3),
            significant(other, 3)
        )
    };
    worse.map(|b| sentence(baseline_name(&b.name), b.prediction_rmse_n, b.rmse_n)).collect()
}

fn baseline_name(name: &str) -> &'static str {
    match name {
        "mean_curve" => "the mean curve of the recordings that made it at this speed",
        _ => "the mean curve of the recordings that made it at other speeds, by depth and hold",
    }
}

fn overview(found: &PredictionResult) -> Section {
    let p = &found.prediction;
    let mut tiles = vec![
        Tile::new(
            "Residual",
            format!("{} N", significant(p.rmse_n, 3)),
            format!("RMS; noise {} N", significant(p.floor_n, 3)),
        )
        .status(Status::at_most(p.rmse_n, 1.2 * p.floor_n, 2.0 * p.floor_n)),
        Tile::new(
            "In the 90 % band",
            format!("{:.0} %", 100.0 * p.band_coverage),
            format!("nominal 90 %; the band includes {}", p.band_includes.join(", ")),
        )
        .status(if p.varying.is_empty() {
            Status::at_most((p.band_coverage - 0.9).abs(), 0.06, 0.15)
        } else {
            // The band of an unseen group may be wider than one group needs.
            Status::at_most(0.9 - p.band_coverage, 0.1, 0.2)
        }),
    ];
    if let Some(before) = p.assumed_rmse_n {
        tiles.push(Tile::new(
            "Assumed scenario",
            format!("{} N", significant(before, 3)),
            "RMS residual of the scenario before the diagnosis".to_owned(),
        ));
    }
    for b in &p.baselines {
        let tile = Tile::new(
            if b.name == "mean_curve" { "Mean curve" } else { "Mean of other speeds" },
            format!("{} N", significant(b.rmse_n, 3)),
            format!("RMS residual of {}", baseline_name(&b.name)),
        );
        tiles.push(tile.status(Status::at_most(b.prediction_rmse_n, b.rmse_n, f64::INFINITY)));
    }
    let rows = p
        .recordings
        .iter()
        .map(|r| {
            vec![
                Cell::text(r.name.clone()),
                Cell::number(significant(r.rmse_n, 3)).status(Status::at_most(
                    r.rmse_n,
                    1.2 * p.floor_n,
                    2.0 * p.floor_n,
                )),
                Cell::number(significant_or_dash(r.assumed_rmse_n, 1.0, 3)),
                Cell::number(format!("{:.0} %", 100.0 * r.band_coverage)),
                Cell::number(significant(r.peak_error_n, 2)),
                Cell::number(or_dash(r.surface_shift_m.map(|m| format!("{:+.2} mm", 1e3 * m)))),
                Cell::number(significant_or_dash(r.force_factor, 1.0, 3)),
                Cell::number(significant_or_dash(r.friction_factor, 1.0, 3)),
                Cell::number(significant_or_dash(r.puncture_factor, 1.0, 3)),
            ]
        })
        .collect();
    let mut section = Section::new("Prediction error").tiles(tiles).table(Table::new(
        "By recording",
        &[
            "",
            "residual RMS, N",
            "residual RMS of the assumed scenario, N",
            "in the 90 % band",
            "peak force, measured minus predicted, N",
            "fitted surface shift",
            "fitted force factor",
            "fitted friction factor",
            "fitted puncture factor",
        ],
        rows,
    ));
    section = section.text(group_sentence(p));
    if let Some(sentence) = refit_sentence(p) {
        section = section.text(sentence);
    }
    let mut warnings: Vec<String> = training_sentence(p).into_iter().chain(worse_than_baseline(p)).collect();
    warnings.extend(zero_offset_sentences(p.recordings.iter().map(|r| (r.name.as_str(), r.zero_offset_n))));
    if !p.held_out {
        warnings.push(
            "The group was fitted to the same recording, so the residual is smaller than for a new recording. With two or more \
             recordings each is predicted from the others."
                .to_owned(),
        );
    }
    if !warnings.is_empty() {
        section = section.warnings(warnings);
    }
    section
}

fn force(r: &RecordingPrediction, s: &PredictionCurves) -> Chart {
    let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, s.time_s.clone(), y.to_vec());
    let ruptures = MarkerSet {
        name: "predicted ruptures".to_owned(),
        colour: Colour::Grey,
        style: LineStyle::Dashed,
        side: Side::Right,
        marks: s.ruptures_s.iter().enumerate().map(|(k, t)| (*t, format!("layer {}", k + 1))).collect(),
    };
    let mut chart = Chart::new(r.name.clone(), "Time (s)", "Force (N)")
        .caption(format!(
            "Residual {} N rms. The dashed band is nominally 90 %; it contains {:.0} % of the samples.",
            significant(r.rmse_n, 3),
            100.0 * r.band_coverage
        ))
        .group(r.name.clone())
        .height(320)
        .with_series(line("measured", Colour::Grey, &s.measured_n).width(3.0));
    if let Some(before) = &s.assumed_n {
        chart = chart.with_series(line("assumed scenario", Colour::Vermillion, before).width(1.0));
    }
    let other = if s.is_unseen_group { "band of the same group" } else { "band of an unseen group" };
    if let Some((low, high)) = &s.other_band_n {
        for edge in [low, high] {
            chart = chart.with_series(line(other, Colour::Grey, edge).width(0.6));
        }
    }
    chart
        .with_series(line("predicted", Colour::Blue, &s.predicted_n).width(1.4))
        .with_series(line("5 %", Colour::SkyBlue, &s.low_n).width(0.8).styled(LineStyle::Dashed))
        .with_series(line("95 %", Colour::SkyBlue, &s.high_n).width(0.8).styled(LineStyle::Dashed))
        .with_markers(ruptures)
}

fn residual(r: &RecordingPrediction, s: &PredictionCurves, floor_n: f64) -> Chart {
    let residual_n: Vec<f64> = s.measured_n.iter().zip(&s.predicted_n).map(|(y, f)| y - f).collect();
    Chart::new(format!("{}: measured minus predicted", r.name), "Time (s)", "Residual (N)")
        .group(r.name.clone())
        .height(200)
        .with_series(Series::line("residual", Colour::Blue, s.time_s.clone(), residual_n).width(1.0))
        .with_level(Level::dotted(2.0 * floor_n, "twice the noise"))
        .with_level(Level::dotted(-2.0 * floor_n, ""))
}

#[cfg(test)]
mod tests {
    use super::{page, training_sentence};
    use stylet_diagnose::prediction::{Prediction, PredictionResult, RecordingPrediction};
    use stylet_scenario::Scenario;

    fn recording(name: &str, is_training_recording: bool) -> RecordingPrediction {
        RecordingPrediction {
            name: name.to_owned(),
            rmse_n: 0.02,
            assumed_rmse_n: None,
            band_coverage: 0.9,
            peak_error_n: 0.0,
            is_training_recording,
            zero_offset_n: None,
            surface_shift_m: None,
            force_factor: None,
            friction_factor: None,
            puncture_factor: None,
        }
    }

    #[test]
    fn the_page_states_which_recordings_the_model_was_fitted_to() {
        let of = |recordings: Vec<RecordingPrediction>| Prediction {
            recordings,
            rmse_n: 0.02,
            assumed_rmse_n: None,
            floor_n: 0.01,
            band_coverage: 0.9,
            varying: Vec::new(),
            coverage_by_group: None,
            band_includes: Vec::new(),
            refit: None,
            held_out: true,
            baselines: Vec::new(),
        };
        let layer = "(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)";
        let model = format!("Scenario(name: \"gel\", tissue: (layers: [{layer}]), motion: Recorded)");
        let model = Scenario::parse("extended.ron", &model).expect("a scenario");
        let page_of = |prediction: Prediction| {
            let found = PredictionResult { prediction, curves: Vec::new() };
            page(&model, "extended.ron", &found).to_html()
        };
        let new = of(vec![recording("new.csv", false)]);
        assert_eq!(training_sentence(&new), None);
        assert!(!page_of(new).contains("says nothing about new recordings"));
        let old = of(vec![recording("a.csv", true), recording("new.csv", false), recording("b.csv", true)]);
        let sentence =
            "The model was fitted to a.csv, b.csv, so the error there says nothing about new recordings.";
        assert_eq!(training_sentence(&old).as_deref(), Some(sentence));
        assert!(page_of(old).contains(sentence));
    }
}
