//! Which effects were tried, and what each would have gained.

use crate::page_model::Section;
use crate::palette::Colour;
use crate::svg::{Bar, BarChart, FigureOptions, Theme, bar_chart};
use stylet_diagnose::diagnosis_json::Diagnosis;
use stylet_stats::number_format::significant;

pub(super) fn search_steps(d: &Diagnosis) -> Section {
    let mut section = Section::new("Evidence").text(
        "At each step every effect of the library was added to what stood and fitted together with all base parameters. The bars are the \
         logarithm of the likelihood that it gains, in nats, after the noise's colour was taken out; pale: compared on averages at 50 Hz only. An \
         effect is taken when it is the best and gains more than was needed on clean data.",
    );
    for (k, step) in d.search_steps.iter().enumerate() {
        let stood =
            if step.included.is_empty() { "the base law".to_owned() } else { step.included.join(" + ") };
        let end = match &step.selected {
            Some(taken) => format!("taken: {taken}"),
            None => "nothing was taken".to_owned(),
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
            title: format!("Step {}: beyond {stood}", k + 1),
            subtitle: format!("needed: {} nats; {end}", significant(step.required_nats, 3)),
            width_px: 960.0,
            theme: Theme::Auto,
        };
        let markup = bar_chart(
            &BarChart { label: "nats gained (in brackets: numbers fitted)".to_owned(), bars },
            &options,
        );
        section = section.picture(options.title, markup);
    }
    section
}
