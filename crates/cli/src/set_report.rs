//! The report on repeated insertions: what the base law cannot say, the causes in the order of what each
//! buys, the extended law, and how well it predicts runs that took no part.

use crate::args::DiagnoseArgs;
use crate::set_online::{self, Online};
use crate::sets::{or_dash, sentence};
use std::fmt::Write as _;
use stylet_diagnose::set::Insertion;
use stylet_diagnose::set::dataset::Dataset;
use stylet_diagnose::set::study::{Study, speeds};
use stylet_report::svg::{Bar, BarChart, FigureOptions, bar_chart};
use stylet_report::{
    Block, Cell, Chart, Code, Colour, Level, LineStyle, Page, Scorecard, Section, Series, Status, SvgImage,
    Table, Text, Tile, significant,
};

/// The page.
pub fn page(
    args: &DiagnoseArgs,
    set: &Dataset,
    runs: &[&Insertion],
    study: &Study,
    online: &[Online],
) -> Page {
    let samples: usize = runs.iter().map(|r| r.recording.len()).sum();
    Page::new(format!("Diagnosis: {}", set.name))
        .subtitle(sentence(study))
        .fact("data set", args.scenario.display().to_string())
        .fact("recordings", runs.len().to_string())
        .fact("samples", samples.to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(verdict(study))
        .section(before_and_after(runs, study))
        .section(causes(study))
        .section(law(study))
        .section(residual(runs, study))
        .section(repeats(study))
        .section(set_online::section(online))
        .section(instrument(study))
        .section(quality(study))
        .section(how(args, runs))
}

fn verdict(study: &Study) -> Section {
    let m = &study.repeats.mean;
    let floor = m.floor_n;
    let tiles = vec![
        Tile::new(
            "A run that took no part",
            format!("{:.3} → {:.3} N", m.base_n, m.extended_n),
            format!(
                "base law → extended law, root mean square; another real insertion: {} N",
                or_dash(floor)
            ),
        )
        .status(floor.map_or(Status::Plain, |f| Status::at_most(m.extended_n, 1.2 * f, 1.5 * f))),
        Tile::new(
            "A speed that took no part",
            format!("{} → {} N", or_dash(m.base_speed_left_out_n), or_dash(m.speed_left_out_n)),
            "all runs of one speed predicted from the other speeds".to_owned(),
        ),
        Tile::new(
            "90 % band",
            format!("{:.1} %", 100.0 * m.covered),
            "of the samples of runs that took no part lie within it".to_owned(),
        )
        .status(if (0.8..=0.97).contains(&m.covered) { Status::Good } else { Status::Warn }),
        Tile::new("Causes", study.diagnosis.causes.len().to_string(), sentence(study)),
    ];
    Section::new("Verdict").block(Block::Scorecard(Scorecard { title: String::new(), tiles }))
}

fn bars(study: &Study) -> Vec<Bar> {
    let bar = |name: String, value: f64, colour| Bar { name, value, interval: None, colour };
    let mut bars = vec![bar("base law".to_owned(), study.laws.base.left_out_n(), Colour::Vermillion)];
    for b in &study.repeats.bought {
        let colour = if b.kept { Colour::Blue } else { Colour::Grey };
        match b.without_n {
            None => bars.push(bar(b.step.clone(), b.left_out_n, colour)),
            Some(e) => bars.push(bar(format!("without {}", b.step), e, Colour::SkyBlue)),
        }
    }
    bars.push(bar("the law".to_owned(), study.laws.best.left_out_n(), Colour::Green));
    if let Some(floor) = study.repeats.mean.floor_n {
        bars.push(bar("mean of the other runs".to_owned(), floor, Colour::Grey));
    }
    bars
}

/// What each step buys: errors of models and nothing of the measured curves.
pub fn gain_figure(study: &Study) -> String {
    let options = FigureOptions {
        title: "What each cause buys".to_owned(),
        subtitle: "root mean square error on insertions that took no part in the fit".to_owned(),
        width_px: 860.0,
        ..FigureOptions::default()
    };
    bar_chart(&BarChart { label: "N rms".to_owned(), bars: bars(study) }, &options)
}

fn causes(study: &Study) -> Section {
    let rows = study
        .diagnosis
        .causes
        .iter()
        .map(|c| {
            vec![
                Cell::text(c.effect.clone()),
                Cell::number(format!("{:.0} %", 100.0 * c.share)),
                Cell::number(significant(c.confidence, 3)),
            ]
        })
        .collect();
    let parts = study
        .repeats
        .bought
        .iter()
        .filter_map(|b| {
            let without = b.without_n?;
            Some(vec![
                Cell::text(b.step.clone()),
                Cell::number(format!("{without:.3}")),
                Cell::text(if b.kept { "kept" } else { "left out" }),
            ])
        })
        .collect();
    Section::new("The causes, and what each buys")
        .text(
            "Three laws were fitted: the base law; the base law with what the search over the library adds to it; layers that cling to the shaft, \
             slip, give way after a while and let go. The one that predicts parts of the set left out best was taken, the base law where the others are \
             better by less than 2 %, and more than two effects of the library only when they are better than a slipping shaft by a tenth. Then every part of it went in turn, and stayed away where the others do without it to 1 %.",
        )
        .block(Block::Svg(SvgImage {
            description: "Error on runs left out of every law, and without every part".to_owned(),
            markup: gain_figure(study),
        }))
        .table(Table {
            title: "Causes: what comes back of the base law's error without each, and how sure it is that new runs need it".to_owned(),
            groups: Vec::new(),
            headers: ["effect", "of the error", "confidence"].map(str::to_owned).to_vec(),
            rows,
        })
        .table(Table {
            title: format!("Without a part of the law, N on parts of the set left out; with all of them {:.3}", study.laws.best.left_out_n()),
            groups: Vec::new(),
            headers: ["part", "without it, N", ""].map(str::to_owned).to_vec(),
            rows: parts,
        })
}

fn law(study: &Study) -> Section {
    let d = &study.diagnosis;
    let mut text = String::from(
        "f   = f_K + f_B            until layer a = r + 1 ruptures: f_K >= F_a, or z >= s_a + d_a\nf_K = K_a max(0, z - s_a)\nf_B = v sum_i b_i l_i,      l_i = clamp(z - s_i, 0, d_i)\n",
    );
    for c in &d.causes {
        let Some(info) = stylet_tissue::info(&c.effect) else { continue };
        let _ = writeln!(text, "\n{}:\n    {}", c.effect, info.equation);
        for (path, e) in &c.parameters {
            let _ = writeln!(
                text,
                "    {path} = {} ({} to {})",
                significant(e.value, 4),
                significant(e.low, 3),
                significant(e.high, 3)
            );
        }
    }
    let rows = d
        .base_parameters
        .iter()
        .map(|b| {
            vec![
                Cell::text(format!("layer {}", b.layer)),
                Cell::text(b.name.clone()),
                Cell::number(significant(b.assumed, 4)),
                Cell::number(significant(b.value, 4)),
                Cell::number(format!("{} to {}", significant(b.low, 3), significant(b.high, 3))),
                Cell::text(if b.at_bound { "at its bound" } else { "" }),
            ]
        })
        .collect();
    Section::new("The extended law")
        .text("Values of the mean insertion; intervals of 95 % by the jackknife over runs, which counts what one law cannot say about all of them.")
        .block(Block::Code(Code { title: "equation".to_owned(), text, folded: false }))
        .block(Block::Text(Text { paragraphs: study.diagnosis.advice.clone(), status: Status::Plain }))
        .table(Table {
            title: "Base parameters".to_owned(),
            groups: Vec::new(),
            headers: ["", "parameter", "believed", "fitted", "95 % interval", ""].map(str::to_owned).to_vec(),
            rows,
        })
}

fn before_and_after(runs: &[&Insertion], study: &Study) -> Section {
    let r = &study.repeats;
    let rows = r
        .speeds
        .iter()
        .map(|s| {
            vec![
                Cell::text(format!("{:.2} mm/s", 1e3 * s.speed_mps)),
                Cell::number(s.runs.to_string()),
                Cell::number(or_dash(s.floor_n)),
                Cell::number(or_dash(Some(s.base_n))),
                Cell::number(or_dash(Some(s.extended_n))),
                Cell::number(format!("{:.1} %", 100.0 * s.covered)),
                Cell::number(or_dash(s.base_speed_left_out_n)),
                Cell::number(or_dash(s.speed_left_out_n)),
            ]
        })
        .chain(std::iter::once(vec![
            Cell::text("mean"),
            Cell::number(r.runs.len().to_string()),
            Cell::number(or_dash(r.mean.floor_n)),
            Cell::number(or_dash(Some(r.mean.base_n))),
            Cell::number(or_dash(Some(r.mean.extended_n))),
            Cell::number(format!("{:.1} %", 100.0 * r.mean.covered)),
            Cell::number(or_dash(r.mean.base_speed_left_out_n)),
            Cell::number(or_dash(r.mean.speed_left_out_n)),
        ]))
        .collect();
    let mut section = Section::new("Before and after").table(Table {
        title: "Each run predicted by laws fitted to the others, root mean square (N)".to_owned(),
        groups: vec![
            (String::new(), 2),
            ("one run left out".to_owned(), 4),
            ("a whole speed left out".to_owned(), 2),
        ],
        headers: [
            "",
            "runs",
            "mean of the others",
            "base law",
            "extended law",
            "in the 90 % band",
            "base law",
            "extended law",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows,
    });
    if let Some(parts) = &r.parts {
        let mut paragraphs: Vec<String> = parts
            .alone
            .iter()
            .map(|(name, floor, error)| {
                format!("{name}: {error:.3} N on runs left out, mean of the others {} N.", or_dash(*floor))
            })
            .collect();
        paragraphs.push(format!(
            "Both laws put together, on the whole: {:.3} N (mean over the speeds).",
            parts.mean_n
        ));
        section = section.block(Block::Text(Text { paragraphs, status: Status::Plain }));
    }
    // The middle run of each speed: neither the best nor the worst.
    let groups = speeds(runs);
    for (v, members) in groups {
        let mut order = members.clone();
        order.sort_by(|a, b| r.runs[*a].extended_n.total_cmp(&r.runs[*b].extended_n));
        let i = order[order.len() / 2];
        let (run, p) = (runs[i], &&study.out[i].prediction);
        let t = &run.recording.time_s;
        let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, t.clone(), y.to_vec());
        section = section.chart(
            Chart::new(format!("{} ({:.2} mm/s)", run.name, 1e3 * v), "Time (s)", "Force (N)")
                .caption(format!(
                    "Measured, and predicted by laws fitted to the other runs: base law {:.3} N, extended law {:.3} N rms; thin lines hold 90 %.",
                    r.runs[i].base_n, r.runs[i].extended_n
                ))
                .height(320)
                .with_series(line("measured", Colour::Grey, &run.recording.force_n).width(3.0))
                .with_series(line("base law", Colour::Vermillion, &study.base_out[i].prediction.mean).width(1.1))
                .with_series(line("extended law", Colour::Blue, &p.mean).width(1.5))
                .with_series(line("5 %", Colour::SkyBlue, &p.low).width(0.8).styled(LineStyle::Dashed))
                .with_series(line("95 %", Colour::SkyBlue, &p.high).width(0.8).styled(LineStyle::Dashed)),
        );
    }
    section
}

fn residual(runs: &[&Insertion], study: &Study) -> Section {
    let zero = || Level { y: 0.0, label: String::new(), colour: Colour::Grey, style: LineStyle::Solid };
    let mut section = Section::new("What remains").text(format!(
        "Measured less predicted force of runs left out, averaged in 60 pieces of depth. The residual that all fitted runs have in common depends on {} \
         (p = {}).",
        if study.diagnosis.leftover.depends_on.is_empty() { "nothing".to_owned() } else { study.diagnosis.leftover.depends_on.join(", ") },
        significant(study.diagnosis.leftover.p_value, 2)
    ));
    for (title, back) in [("Residual on the way in", false), ("Residual on the way back", true)] {
        let mut chart = Chart::new(title, "Depth (mm)", "Residual (N)").height(280).with_level(zero());
        for (name, colour, predictions) in
            [("base law", Colour::Vermillion, &study.base_out), ("extended law", Colour::Blue, &study.out)]
        {
            let (mut x, mut y) = (Vec::new(), Vec::new());
            for (run, p) in runs.iter().zip(predictions).map(|(run, out)| (run, &out.prediction)) {
                let r = &run.recording;
                for i in 0..r.len() {
                    let here = if back { i >= run.phases.back } else { i <= run.phases.deepest };
                    if here {
                        x.push(1e3 * r.position_m[i]);
                        y.push(r.force_n[i] - p.mean.get(i).copied().unwrap_or(f64::NAN));
                    }
                }
            }
            let used = vec![true; x.len()];
            let (bx, by) = stylet_diagnose::curves::binned(&x, &y, &used, 60);
            chart = chart.with_series(Series::line(name, colour, bx, by));
        }
        section = section.chart(chart);
    }
    section
}

fn repeats(study: &Study) -> Section {
    let r = &study.repeats;
    let list = |x: &[Option<f64>], scale: f64| {
        x.iter()
            .map(|x| x.map_or("-".to_owned(), |x| format!("{:.2}", scale * x)))
            .collect::<Vec<_>>()
            .join(" / ")
    };
    let rows = r
        .runs
        .iter()
        .map(|run| {
            vec![
                Cell::text(run.name.clone()),
                Cell::number(format!("{:.2}", 1e3 * run.speed_mps)),
                Cell::number(format!("{:+.2}", 1e3 * run.shift_m)),
                Cell::number(format!("{:.2}", run.friction)),
                Cell::number(list(&run.puncture_n, 1.0)),
                Cell::number(list(&run.releases_m, 1e3)),
                Cell::number(or_dash(run.floor_n)),
                Cell::number(or_dash(Some(run.base_n))),
                Cell::number(or_dash(Some(run.extended_n))),
                Cell::number(format!("{:.0} %", 100.0 * run.covered)),
            ]
        })
        .collect();
    let p = &r.population;
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
        let release = p.lets_go_m.get(i).copied().flatten().map_or(String::new(), |(z, sd)| {
            format!("; lets go at {:.2} mm, give or take {:.2} mm", 1e3 * z, 1e3 * sd)
        });
        text.push(format!(
            "Layer {}: its rupture is a drop in {drops} of {} runs{release}.",
            i + 1,
            r.runs.len()
        ));
    }
    if r.starts.0 > 1 {
        text.push(format!(
            "{} starts of the fit went on after a first look; of these, {} starts agree.",
            r.starts.0, r.starts.1
        ));
    }
    let by_part = r
        .parts_of_insertion
        .iter()
        .map(|p| {
            vec![
                Cell::text(p.part),
                Cell::number(or_dash(p.floor_n)),
                Cell::number(format!("{:.3}", p.extended_n)),
            ]
        })
        .collect();
    Section::new("What varies from run to run")
        .block(Block::Text(Text { paragraphs: text, status: Status::Plain }))
        .table(Table {
            title: "By part of an insertion, on runs left out (N rms)".to_owned(),
            groups: Vec::new(),
            headers: ["", "mean of the others", "extended law"].map(str::to_owned).to_vec(),
            rows: by_part,
        })
        .table(Table {
            title: "Runs".to_owned(),
            groups: Vec::new(),
            headers: [
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
            ]
            .map(str::to_owned)
            .to_vec(),
            rows,
        })
}

fn instrument(study: &Study) -> Section {
    let i = &study.repeats.instrument;
    let row = |effect: &str, size_n: f64, evidence: &str| {
        vec![Cell::text(effect), Cell::number(format!("{:.1} mN", 1e3 * size_n)), Cell::text(evidence)]
    };
    let excluded: Vec<_> = i.excluded.iter().map(|e| row(&e.effect, e.size_n, &e.evidence)).collect();
    let shown: Vec<_> = i.shown.iter().map(|e| row(&e.effect, e.size_n, &e.evidence)).collect();
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
            section = section.table(Table {
                title: title.to_owned(),
                groups: Vec::new(),
                headers: ["effect", "force here", "evidence"].map(str::to_owned).to_vec(),
                rows,
            });
        }
    }
    section
}

fn quality(study: &Study) -> Section {
    let title = match study.repeats.instrument.shown.is_empty() {
        true => "Remarks; nothing was corrected or resampled",
        false => "Remarks; but for what the instrument shows nothing was corrected or resampled",
    };
    let rows = study
        .diagnosis
        .data_quality
        .iter()
        .map(|q| vec![Cell::text(q.recording.clone()), Cell::text(q.note.message.clone())])
        .collect();
    Section::new("Data quality").table(Table {
        title: title.to_owned(),
        groups: Vec::new(),
        headers: ["recording", "remark"].map(str::to_owned).to_vec(),
        rows,
    })
}

fn how(args: &DiagnoseArgs, runs: &[&Insertion]) -> Section {
    let mut text = format!("stylet diagnose {}", args.scenario.display());
    if !args.data.is_empty() {
        let _ = write!(text, " --data ...  # {} recordings", runs.len());
    }
    let _ = write!(text, "\nstylet run extended.ron  # the mean insertion, simulated");
    Section::new("To repeat").block(Block::Code(Code { title: "commands".to_owned(), text, folded: false }))
}
