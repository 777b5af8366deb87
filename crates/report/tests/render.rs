//! Promise: rendering is deterministic, files are small, and incomplete reports are rendered.

#[path = "support/synthetic.rs"]
mod synthetic;

use stylet_report::svg::{BarChart, FigureOptions, HeatMap, bar_chart, figure, heat_map};
use stylet_report::{Chart, Colour, RunReport, Series};

#[test]
fn the_same_report_gives_the_same_bytes() {
    let (a, b) = (synthetic::synthetic_run(2), synthetic::synthetic_run(2));
    assert_eq!(a.to_html(), b.to_html());
    assert_eq!(a.to_svg(&FigureOptions::default()), b.to_svg(&FigureOptions::default()));
}

#[test]
fn a_run_of_ten_thousand_samples_stays_below_three_megabytes() {
    for combinations in [1, 4] {
        let report = synthetic::synthetic_run(combinations);
        assert!(report.time_s.len() > 10_000);
        let size = report.to_html().len();
        assert!(size < 3_000_000, "{combinations} combinations: {size} bytes");
    }
}

#[test]
fn measured_data_have_detected_layers_and_no_scores() {
    let html = synthetic::measured_run().to_html();
    assert!(html.contains("Shaded: detected layers") && html.contains("no scores"));
}

#[test]
fn an_empty_report_is_a_page_without_charts() {
    let html = RunReport::default().to_html();
    assert!(html.contains("Research software, not a medical device"));
    assert!(!html.contains("class=\"plot\""));
    assert!(RunReport::default().to_svg(&FigureOptions::default()).starts_with("<svg"));
}

#[test]
fn columns_of_unequal_length_and_invalid_numbers_are_rendered() {
    let mut report = synthetic::synthetic_run(2);
    report.forces[0].force_n.truncate(17);
    report.combinations[0].cusum_n2.clear();
    report.combinations[1].enhanced_force_n = vec![f64::INFINITY; 40_000];
    report.combinations[1].layers.clear();
    report.combinations[1].detections.clear();
    report.combinations[1].derivative_on_n_per_s = Some(f64::NAN);
    report.combinations[1].cusum_threshold_n2 = Some(0.0);
    if let Some(truth) = &mut report.truth {
        truth.layers[1].thickness_m = f64::NAN;
        truth.ruptures[2].time_s = f64::NAN;
        truth.layers[2].entered_s = None;
    }
    let html = report.to_html();
    let data =
        html.split("id=\"data\">").nth(1).and_then(|rest| rest.split("</script>").next()).expect("data");
    serde_json::from_str::<serde_json::Value>(data).expect("valid JSON whatever the numbers");
    let svg = report.to_svg(&FigureOptions::default());
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "an SVG holds finite coordinates");
}

#[test]
fn pictures_are_well_formed_and_follow_the_colour_scheme() {
    let options = FigureOptions { title: "a < b & \"c\"".into(), ..FigureOptions::default() };
    let pictures = [
        synthetic::synthetic_run(1).to_svg(&options),
        figure(&[], &options),
        bar_chart(&BarChart::default(), &options),
        heat_map(&HeatMap::default(), &options),
    ];
    for svg in pictures {
        assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
        assert!(svg.contains("a &lt; b &amp; &quot;c&quot;"));
        assert!(!svg.contains("NaN") && svg.contains("prefers-color-scheme"));
    }
}

#[test]
fn many_points_are_drawn_without_rims() {
    // Rims would cover neighbouring points.
    let rims = |count: usize| {
        let x: Vec<f64> = (0..count).map(|k| k as f64 / count as f64).collect();
        let points = Series::points("trials", Colour::Blue, x.clone(), x);
        let chart = Chart::new("", "", "").with_series(points);
        let svg = figure(&[chart], &FigureOptions::default());
        (svg.matches("class=\"p f-").count(), svg.matches("class=\"f-blue\"").count())
    };
    assert_eq!(rims(20).1, 0);
    assert_eq!(rims(2000).1, 2000);
    assert!(rims(20).0 >= 20 && rims(2000).0 <= 1, "only the legend has a rim: {:?}", rims(2000));
}
