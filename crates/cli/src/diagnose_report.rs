//! The report of a diagnosis: what was measured, what the base law cannot say, why, and what it gains.

use crate::args::DiagnoseArgs;
use crate::diagnose::sentence;
use std::fmt::Write as _;
use stylet_diagnose::Examined;
use stylet_diagnose::curves::{Curves, binned, by_layer_and_phase, correlations, curves, shown};
use stylet_diagnose::lines::spectrum;
use stylet_diagnose::outcome::{BaseParameter, Diagnosis, Verdict};
use stylet_report::svg::{Bar, BarChart, FigureOptions, Theme, bar_chart};
use stylet_report::{
    Block, Cell, Chart, Code, Colour, Level, LineStyle, MarkerSet, Page, Scale, Scorecard, Section, Series,
    Side, Status, SvgImage, Table, Text, Tile, significant,
};
use stylet_scenario::Scenario;
use stylet_tissue::Slab;

/// The page.
pub fn page(scenario: &Scenario, args: &DiagnoseArgs, examined: &Examined) -> Page {
    let d = &examined.diagnosis;
    let all = curves(examined);
    let samples: usize = all.iter().map(|c| c.time_s.len()).sum();
    Page::new(format!("Diagnosis: {}", scenario.name))
        .subtitle(sentence(d))
        .fact("scenario", args.scenario.display().to_string())
        .fact("recordings", d.gain.recordings.join(", "))
        .fact("samples", samples.to_string())
        .fact("stylet", env!("CARGO_PKG_VERSION"))
        .section(verdict(d))
        .section(differs(scenario, d, &all))
        .section(causes(d))
        .section(moved(scenario, d))
        .section(traces(d))
        .section(unseen(d))
        .section(remains(d, &all))
        .section(gain(d, &all))
        .section(residual(d, examined, &all))
        .section(evidence(d))
        .section(quality(d))
        .section(repeat(args, examined))
}

fn number(x: f64) -> String {
    significant(x, 4)
}

fn verdict(d: &Diagnosis) -> Section {
    let word = match d.verdict {
        Verdict::None => "none",
        Verdict::Named => "named",
        Verdict::Ambiguous => "ambiguous",
        Verdict::Unknown => "unknown",
    };
    let mut tiles = vec![Tile::new("Verdict", word, sentence(d))];
    for c in &d.causes {
        let parameters = c
            .parameters
            .iter()
            .map(|(p, e)| format!("{p} = {}", number(e.value)))
            .collect::<Vec<_>>()
            .join(", ");
        let mut detail = format!("{parameters}; confidence {}", significant(c.confidence, 2));
        if !c.equivalent.is_empty() {
            let _ = write!(detail, "; as good: {}", c.equivalent.join(", "));
        }
        tiles.push(Tile::new("Cause", c.effect.replace('_', " "), detail));
    }
    let g = &d.gain;
    let what = if g.held_out { "left-out recordings" } else { "the fitted recording" };
    tiles.push(Tile::new(
        "Residual",
        format!("{} → {} N", significant(g.rmse_before_n, 3), significant(g.rmse_after_n, 3)),
        format!("root mean square on {what}; the noise is {} N", significant(g.floor_n, 3)),
    ));
    let status = if d.leftover.p_value < 1e-3 { Status::Warn } else { Status::Good };
    tiles.push(
        Tile::new(
            "Left over",
            if d.leftover.p_value < 1e-3 { "structure" } else { "noise" },
            format!(
                "p = {} that the residual is the same in several recordings by chance",
                significant(d.leftover.p_value, 2)
            ),
        )
        .status(status),
    );
    let mut section =
        Section::new("Verdict").block(Block::Scorecard(Scorecard { title: String::new(), tiles }));
    for a in &d.advice {
        section = section.block(Block::Text(Text { paragraphs: vec![a.clone()], status: Status::Warn }));
    }
    section
}

/// What was believed, and what of it the measured force contradicts: the recording that the base law predicts worst.
fn differs(scenario: &Scenario, d: &Diagnosis, all: &[Curves]) -> Section {
    let percent = |share: f64| significant(100.0 * share, 2);
    let beliefs = format!(
        "Believed: {} layer{}, stiffness, friction and puncture force to {} %, thickness to {} %, the surface to {} mm{}. Within that the base law was fitted.",
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
    let section = Section::new("What was believed, and what differs").text(beliefs);
    let square = |c: &Curves| {
        c.base_n.iter().zip(&c.used).filter(|(_, u)| **u).map(|(e, _)| e * e).sum::<f64>()
            / c.used.iter().filter(|u| **u).count().max(1) as f64
    };
    let worst = all.iter().zip(&d.gain.recordings).max_by(|a, b| square(a.0).total_cmp(&square(b.0)));
    let Some((c, name)) = worst else { return section };
    let line = |name: &str, colour, y: &[f64]| Series::line(name, colour, c.time_s.clone(), y.to_vec());
    let level = |y: f64, label: &str| Level {
        y,
        label: label.to_owned(),
        colour: Colour::Grey,
        style: LineStyle::Dotted,
    };
    section.chart(
        Chart::new(format!("{name}: measured less predicted"), "Time (s)", "Residual (N)")
            .caption("The recording that the base law fits worst: what it leaves, and what the extended model leaves.")
            .group(name.clone())
            .height(260)
            .with_series(line("base law, re-fitted", Colour::Vermillion, &c.base_n).width(1.2))
            .with_series(line("extended model", Colour::Blue, &c.extended_n).width(1.0))
            .with_level(level(2.0 * d.noise.sd_n, "twice the noise"))
            .with_level(level(-2.0 * d.noise.sd_n, "")),
    )
}

/// What the simulation lacks, with the extended law in the notation of SPEC section 1.
fn causes(d: &Diagnosis) -> Section {
    let section = Section::new("Causes");
    if d.causes.is_empty() {
        return section
            .text("None: the base law, re-fitted, is as good as any extension of it that was tried.");
    }
    let mut text = String::from(
        "f   = f_K + f_B            until layer a = r + 1 ruptures: f_K >= F_a, or z >= s_a + d_a\nf_K = K_a max(0, z - s_a)\nf_B = v sum_i b_i l_i,      l_i = clamp(z - s_i, 0, d_i)\n",
    );
    let mut rows = Vec::new();
    for c in &d.causes {
        let info = stylet_tissue::info(&c.effect);
        if let Some(info) = info {
            let _ = write!(text, "\n{}:\n    {}\n", c.effect, info.equation);
        }
        let unit = |path: &str| {
            info.and_then(|i| i.parameters.iter().find(|p| p.path == path)).map_or("", |p| p.unit)
        };
        for (k, (path, e)) in c.parameters.iter().enumerate() {
            let first = |text: String| Cell::text(if k == 0 { text } else { String::new() });
            rows.push(vec![
                first(c.effect.replace('_', " ")),
                first(c.equivalent.join(", ").replace('_', " ")),
                first(significant(c.confidence, 3)),
                first(if c.share > 0.0 { format!("{:.0} %", 100.0 * c.share) } else { "-".to_owned() }),
                Cell::text(path.clone()),
                Cell::number(format!("{} {}", number(e.value), unit(path))),
                Cell::number(format!("{} to {}", number(e.low), number(e.high))),
            ]);
        }
    }
    let g = &d.gain;
    let what =
        if g.held_out { "recordings left out of the fit" } else { "the recording, which was also fitted" };
    section
        .table(Table {
            title: format!(
                "What the simulation lacks; together it brings {} down from {} N to {} N rms, the noise being {} N",
                what,
                significant(g.rmse_before_n, 3),
                significant(g.rmse_after_n, 3),
                significant(g.floor_n, 3)
            ),
            groups: Vec::new(),
            headers: [
                "cause",
                "as good",
                "confidence",
                "of what the base law leaves",
                "number",
                "value",
                "95 % interval",
            ]
            .map(str::to_owned)
            .to_vec(),
            rows,
        })
        .block(Block::Code(Code { title: "equation".to_owned(), text, folded: false }))
}

/// Base numbers, those that moved first.
fn moved(scenario: &Scenario, d: &Diagnosis) -> Section {
    let mut order: Vec<&BaseParameter> = d.base_parameters.iter().collect();
    order.sort_by_key(|b| (!b.changed, !b.at_bound));
    let count = order.iter().filter(|b| b.changed).count();
    let rows = order
        .iter()
        .map(|b| {
            let status = match (b.at_bound, b.changed) {
                (true, _) => Status::Warn,
                (false, true) => Status::Good,
                (false, false) => Status::Plain,
            };
            vec![
                Cell::text(if b.layer > 0 { format!("layer {}", b.layer) } else { "tissue".to_owned() }),
                Cell::text(b.name.clone()),
                Cell::number(number(b.assumed)),
                Cell::number(number(b.value)),
                Cell::number(format!("{} to {}", number(b.low), number(b.high))),
                Cell::number(change(b)).status(status),
            ]
        })
        .collect();
    let mut section = Section::new("Numbers of the base law that moved").table(Table {
        title: format!(
            "{count} of {} differ from what was assumed by more than their interval",
            d.base_parameters.len()
        ),
        groups: Vec::new(),
        headers: ["", "parameter", "assumed", "fitted", "95 % interval", "change"]
            .map(str::to_owned)
            .to_vec(),
        rows,
    });
    let mut aloud = Vec::new();
    let bounds = order.iter().filter(|b| b.at_bound).count();
    if bounds > 0 {
        aloud.push(format!(
            "{bounds} number{} at the bound of what was believed: the tolerance is too narrow, or something else takes its work. Widen `tolerance` in the scenario and ask again.",
            if bounds == 1 { " stands" } else { "s stand" }
        ));
    }
    let tolerance = |b: &BaseParameter| match b.name.as_str() {
        "surface_m" => scenario.surface_tolerance_m,
        "thickness_m" => scenario.thickness_tolerance * b.assumed,
        _ => scenario.tolerance * b.assumed,
    };
    let blind: Vec<String> = order
        .iter()
        .filter(|b| b.high - b.low > BLIND * 2.0 * 1.96 * tolerance(b) && tolerance(b) > 0.0)
        .map(|b| format!("{} of layer {}", b.name, b.layer))
        .collect();
    if !blind.is_empty() {
        aloud.push(format!(
            "These recordings say next to nothing of {}: the interval is the belief's own.",
            blind.join(", ")
        ));
    }
    if !aloud.is_empty() {
        section = section.block(Block::Text(Text { paragraphs: aloud, status: Status::Warn }));
    }
    section
}

/// An interval so large a share of what was believed before is the belief's own.
const BLIND: f64 = 0.8;

/// What was found and is no cause.
fn traces(d: &Diagnosis) -> Section {
    let section = Section::new("Traces");
    if d.traces.is_empty() {
        return section
            .text("Nothing was found that is too small to matter or does not pay on recordings left out.");
    }
    let rows = d
        .traces
        .iter()
        .map(|t| {
            let numbers = t.parameters.iter().map(|(p, e)| format!("{p} = {}", number(e.value)));
            vec![
                Cell::text(t.effect.replace('_', " ")),
                Cell::text(numbers.collect::<Vec<_>>().join(", ")),
                Cell::text(t.why.clone()),
            ]
        })
        .collect();
    section.table(Table {
        title: "Found, and no cause".to_owned(),
        groups: Vec::new(),
        headers: ["effect", "numbers", "why it is no cause"].map(str::to_owned).to_vec(),
        rows,
    })
}

fn gain(d: &Diagnosis, all: &[Curves]) -> Section {
    let g = &d.gain;
    let rows = g
        .recordings
        .iter()
        .zip(&g.each_n)
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
        "Each recording predicted by models fitted to the others, with the law's own ruptures (N)"
    } else {
        "The one recording, which was also fitted, with the law's own ruptures (N)"
    };
    let mut section = Section::new("Before and after").table(Table {
        title: title.to_owned(),
        groups: Vec::new(),
        headers: ["", "base law, re-fitted", "extended model", "noise"].map(str::to_owned).to_vec(),
        rows,
    });
    for (c, name) in all.iter().zip(&g.recordings).take(8) {
        let ruptures = MarkerSet {
            name: "ruptures in the data".to_owned(),
            colour: Colour::Grey,
            style: LineStyle::Dashed,
            side: Side::Right,
            marks: c.ruptures_s.iter().enumerate().map(|(k, t)| (*t, format!("layer {}", k + 1))).collect(),
        };
        let minus = |e: &[f64]| c.force_n.iter().zip(e).map(|(f, e)| f - e).collect::<Vec<_>>();
        section = section.chart(
            Chart::new(name.clone(), "Time (s)", "Force (N)")
                .caption("Measured, and as base law and extended model have it.")
                .group(name.clone())
                .height(300)
                .with_series(
                    Series::line("measured", Colour::Grey, c.time_s.clone(), c.force_n.clone()).width(3.0),
                )
                .with_series(
                    Series::line("base law", Colour::Vermillion, c.time_s.clone(), minus(&c.base_n))
                        .width(1.1),
                )
                .with_series(
                    Series::line("extended model", Colour::Blue, c.time_s.clone(), minus(&c.extended_n))
                        .width(1.3),
                )
                .with_markers(ruptures),
        );
    }
    section
}

fn zero() -> Level {
    Level { y: 0.0, label: String::new(), colour: Colour::Grey, style: LineStyle::Solid }
}

fn residual(d: &Diagnosis, examined: &Examined, all: &[Curves]) -> Section {
    let mut section = Section::new("What the base law cannot say").text(
        "The residual of the re-fitted base law: measured less predicted force, ruptures taken where the data show them. These pictures \
         propose causes; the likelihood below decides.",
    );
    let names = &d.gain.recordings;
    let mut time =
        Chart::new("Residual against time", "Time (s)", "Residual (N)").height(260).with_level(zero());
    let mut depth = Chart::new("Residual against depth", "Depth (mm)", "Residual (N)")
        .caption("Means over 60 bins of depth, advance and retraction apart (retraction dotted).")
        .height(260)
        .with_level(zero());
    let mut velocity = Chart::new("Residual against velocity", "Velocity (mm/s)", "Residual (N)")
        .caption("Means over 60 bins of velocity, with the needle in the tissue.")
        .height(260)
        .with_level(zero());
    for (k, (c, name)) in all.iter().zip(names).enumerate() {
        let colour = Colour::nth(k);
        time = time
            .with_series(Series::line(name.clone(), colour, c.time_s.clone(), c.base_n.clone()).width(1.0));
        let pick = |keep: &dyn Fn(usize) -> bool| -> Vec<bool> {
            (0..c.used.len()).map(|i| c.used[i] && keep(i)).collect()
        };
        let mm: Vec<f64> = c.position_m.iter().map(|z| z * 1e3).collect();
        let mmps: Vec<f64> = c.velocity_mps.iter().map(|v| v * 1e3).collect();
        let (x, y) = binned(&mm, &c.base_n, &pick(&|i| c.velocity_mps[i] >= -1e-5), 60);
        depth = depth.with_series(Series::line(name.clone(), colour, x, y));
        let (x, y) = binned(&mm, &c.base_n, &pick(&|i| c.velocity_mps[i] < -1e-5), 60);
        if !x.is_empty() {
            depth = depth
                .with_series(Series::line(format!("{name}, back"), colour, x, y).styled(LineStyle::Dotted));
        }
        let (x, y) = binned(&mmps, &c.base_n, &pick(&|i| c.position_m[i] > 0.0), 60);
        velocity = velocity.with_series(Series::points(name.clone(), colour, x, y));
    }
    section = section.chart(time).chart(depth).chart(velocity);
    let layers = examined.search.base.model.layers();
    let (before, after) =
        (by_layer_and_phase(all, |c| &c.base_n, layers), by_layer_and_phase(all, |c| &c.extended_n, layers));
    let rows = before
        .iter()
        .zip(&after)
        .enumerate()
        .map(|(k, (b, a))| {
            let name = match k {
                0 => "in air".to_owned(),
                k if k > layers => "behind the last layer".to_owned(),
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
    section = section.table(Table {
        title: "Root mean square by layer and phase (N): base law, extended model".to_owned(),
        groups: vec![
            (String::new(), 1),
            ("advance".to_owned(), 2),
            ("hold".to_owned(), 2),
            ("retraction".to_owned(), 2),
        ],
        headers: ["", "base", "extended", "base", "extended", "base", "extended"].map(str::to_owned).to_vec(),
        rows,
    });
    let slabs = Slab::stack(&examined.search.base.model.tissue);
    let (cb, ca) = (correlations(all, |c| &c.base_n, &slabs), correlations(all, |c| &c.extended_n, &slabs));
    section = section.table(Table {
        title: "Correlation of the residual with what was done".to_owned(),
        groups: Vec::new(),
        headers: ["", "base law", "extended model"].map(str::to_owned).to_vec(),
        rows: cb
            .iter()
            .zip(&ca)
            .map(|((name, b), (_, a))| {
                vec![Cell::text(*name), Cell::number(format!("{b:+.3}")), Cell::number(format!("{a:+.3}"))]
            })
            .collect(),
    });
    let search = &examined.search;
    let (f, base) = spectrum(&search.base, &search.data);
    let best = shown(examined);
    let (_, after) = spectrum(best, &search.data);
    let keep: Vec<usize> = thin(&f, &base);
    let pick = |x: &[f64]| keep.iter().map(|k| x[*k]).collect::<Vec<_>>();
    let chart = Chart::new("Spectrum of the residual", "log10 of frequency (Hz)", "N/sqrt(Hz)")
        .caption("Amplitude of the residual at the recordings' own rate, mean over recordings; the highest of each fiftieth of a decade is drawn.")
        .height(240);
    let log: Vec<f64> = pick(&f).iter().map(|f| f.log10()).collect();
    section.chart(Chart {
        scale: Scale::Log,
        ..chart
            .with_series(Series::line("base law", Colour::Vermillion, log.clone(), pick(&base)))
            .with_series(Series::line("extended model", Colour::Blue, log, pick(&after)))
    })
}

/// The highest value of each fiftieth of a decade.
fn thin(f: &[f64], value: &[f64]) -> Vec<usize> {
    let mut kept: Vec<(i64, usize)> = Vec::new();
    for (k, f) in f.iter().enumerate().filter(|(_, f)| **f > 0.01) {
        let bin = (f.log10() * 50.0).floor() as i64;
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

fn evidence(d: &Diagnosis) -> Section {
    let mut section = Section::new("Evidence").text(
        "At each step every effect of the library was added to what stood and fitted together with all base parameters. The bars are the \
         logarithm of the likelihood that it gains, in nats, after the noise's colour was taken out; pale: compared on averages at 50 Hz only. An \
         effect is taken when it is the best and gains more than was needed on clean data.",
    );
    for (k, step) in d.evidence.iter().enumerate() {
        let stood =
            if step.standing.is_empty() { "the base law".to_owned() } else { step.standing.join(" + ") };
        let end = match &step.taken {
            Some(taken) => format!("taken: {taken}"),
            None => "nothing was taken".to_owned(),
        };
        let bars: Vec<Bar> = step
            .rivals
            .iter()
            .take(14)
            .map(|r| Bar {
                name: format!("{} ({})", r.effect, r.parameters),
                value: r.gain_nats.max(0.0),
                interval: None,
                colour: match (&step.taken, r.screened_only) {
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
            subtitle: format!("needed: {} nats; {end}", significant(step.needed_nats, 3)),
            width_px: 960.0,
            theme: Theme::Auto,
        };
        let markup = bar_chart(
            &BarChart { label: "nats gained (in brackets: numbers fitted)".to_owned(), bars },
            &options,
        );
        section = section.block(Block::Svg(SvgImage { description: options.title, markup }));
    }
    section
}

fn remains(d: &Diagnosis, all: &[Curves]) -> Section {
    let text = if d.leftover.p_value < 1e-3 {
        format!(
            "The residual of the extended model is still predictable: it depends on {} (p = {}; {} nats).",
            d.leftover.depends_on.join(", "),
            significant(d.leftover.p_value, 2),
            significant(d.leftover.nats, 3)
        )
    } else {
        format!(
            "Nothing that is the same in several recordings remains (p = {}). The noise: {} N, autoregressive coefficients {} and {} per sample, {}.",
            significant(d.leftover.p_value, 2),
            significant(d.noise.sd_n, 3),
            significant(d.noise.ar[0], 3),
            significant(d.noise.ar[1], 3),
            if d.noise.from_air { "checked in air" } else { "without air to check it in" }
        )
    };
    let mut chart = Chart::new("What the extended model leaves", "Depth (mm)", "Residual (N)")
        .caption("Means over 60 bins of depth.")
        .height(240)
        .with_level(zero());
    for (k, (c, name)) in all.iter().zip(&d.gain.recordings).enumerate() {
        let mm: Vec<f64> = c.position_m.iter().map(|z| z * 1e3).collect();
        let (x, y) = binned(&mm, &c.extended_n, &c.used, 60);
        chart = chart.with_series(Series::line(name.clone(), Colour::nth(k), x, y));
    }
    let section = Section::new("What remains").text(text);
    let section = match crate::diagnose::differ(d) {
        Some(differ) => section.text(format!(
            "Fitted, and no cause: {differ}. A simulation that does not know them misses the next insertion by as much."
        )),
        None => section,
    };
    section.chart(chart)
}

fn unseen(d: &Diagnosis) -> Section {
    let rows = d
        .invisible
        .iter()
        .map(|id| {
            let info = stylet_tissue::info(id);
            vec![
                Cell::text(id.clone()),
                Cell::text(info.map_or("", |i| i.equation)),
                Cell::text(info.map_or("", |i| i.signature)),
            ]
        })
        .collect();
    Section::new("What these recordings cannot show").table(Table {
        title: "Effects that other base parameters imitate to within the noise".to_owned(),
        groups: Vec::new(),
        headers: ["effect", "equation", "how it would show"].map(str::to_owned).to_vec(),
        rows,
    })
}

fn quality(d: &Diagnosis) -> Section {
    let rows = d
        .data_quality
        .iter()
        .map(|q| vec![Cell::text(q.recording.clone()), Cell::text(q.note.message.clone())])
        .collect();
    let section = Section::new("Data quality");
    if d.data_quality.is_empty() {
        return section
            .text("No gaps, no jitter, no saturation, no quantisation, no spikes, no mixed-up units.");
    }
    section.table(Table {
        title: String::new(),
        groups: Vec::new(),
        headers: ["recording", "remark"].map(str::to_owned).to_vec(),
        rows,
    })
}

fn repeat(args: &DiagnoseArgs, examined: &Examined) -> Section {
    let mut command = format!("stylet diagnose {} --data", args.scenario.display());
    for path in &args.data {
        let _ = write!(command, " {}", path.display());
    }
    if let Some(columns) = &args.columns {
        let _ = write!(command, " --columns {}", columns.display());
    }
    Section::new("Repeat")
        .block(Block::Code(Code { title: "command".to_owned(), text: command, folded: false }))
        .block(Block::Code(Code {
            title: "extended.ron".to_owned(),
            text: examined.extended.to_ron().unwrap_or_default(),
            folded: true,
        }))
}

/// By how much a re-fitted number differs from the one assumed, and whether it may go no further.
fn change(b: &BaseParameter) -> String {
    let place = matches!(b.name.as_str(), "surface_m" | "thickness_m");
    let by = if place {
        format!("{:+.2} mm", 1e3 * (b.value - b.assumed))
    } else {
        format!("{:+.1} %", 100.0 * (b.value / b.assumed - 1.0))
    };
    if b.at_bound { format!("{by}, at its bound") } else { by }
}
