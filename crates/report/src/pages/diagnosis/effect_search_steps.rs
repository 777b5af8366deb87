//! The steps of the search over the effect library, with the gain of each candidate.

use crate::page_model::Section;
use crate::palette::Colour;
use crate::svg::{Bar, BarChart, FigureOptions, bar_chart};
use stylet_diagnose::diagnosis_json::Diagnosis;
use stylet_stats::number_format::significant;

pub(super) fn search_steps(d: &Diagnosis) -> Section {
    let mut section = Section::new("Search over the effect library").text(
        "At each step every effect of the library was added to the current model and fitted together with all base parameters. The bars are \
         the gain in log likelihood, in nats, with autocorrelated noise accounted for; grey: compared on 50 Hz averages only. The best \
         effect is accepted when its gain exceeds the threshold calibrated on clean data.",
    );
    for (k, step) in d.search_steps.iter().enumerate() {
        let current =
            if step.included.is_empty() { "the base law".to_owned() } else { step.included.join(" + ") };
        let end = match &step.selected {
            Some(taken) => format!("accepted: {taken}"),
            None => "no effect accepted".to_owned(),
        };
        let bars: Vec<Bar> = step
            .candidates
            .iter()
            .take(14)
            .map(|r| Bar {
                name: format!("{} ({})", r.effect, r.parameters),
                value: r.gain_nats.max(0.0),
                interval: None,
                colour: match (&step.selected, r.screened_only) {
                    (Some(t), _) if *t == r.effect => Colour::Blue,
                    (_, true) => Colour::Grey,
                    _ => Colour::SkyBlue,
                },
            })
            .collect();
        if bars.is_empty() {
            continue;
        }
        let options = FigureOptions {
            title: format!("Step {}: in addition to {current}", k + 1),
            subtitle: format!("threshold: {} nats; {end}", significant(step.required_nats, 3)),
            width_px: 960.0,
        };
        let markup = bar_chart(
            &BarChart {
                label: "gain in log likelihood, nats (in brackets: fitted parameters)".to_owned(),
                bars,
            },
            &options,
        );
        section = section.picture(options.title, markup);
    }
    section
}
