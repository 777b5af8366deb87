//! The page: claims, assumed values, figures in the supplement's order, switches, estimates against the truth.

use crate::all_runs::Study;
use crate::assumed_values;
use crate::claim_verdict::Verdict;
use crate::claims::{Claim, Condition};
use crate::effect_size::CriterionResult;
use crate::figures::Figure;
use crate::value_source::SourcedTable;
use crate::{algorithm_switches, estimates_against_truth};
use stylet_report::{Block, Cell, Page, Section, Status, SvgImage, Table};

const fn status(verdict: Verdict) -> Status {
    match verdict {
        Verdict::Supported => Status::Good,
        Verdict::Contradicted => Status::Bad,
        Verdict::Assumed | Verdict::Undecided => Status::Warn,
        Verdict::Untestable => Status::Plain,
    }
}

const fn said(says: CriterionResult) -> Status {
    match says {
        CriterionResult::Supports => Status::Good,
        CriterionResult::Contradicts => Status::Bad,
        CriterionResult::Undecided => Status::Warn,
    }
}

fn summary(claims: &[Claim], study: &Study) -> Section {
    let rows = claims
        .iter()
        .map(|c| {
            let (effect, bar, says) = c.primary.as_ref().map_or_else(
                || ("–".to_owned(), "–".to_owned(), Cell::text("–")),
                |p| (p.effect.words(), p.bar.words(), Cell::text(p.says.words()).status(said(p.says))),
            );
            let mut hangs: Vec<&str> = c.verdict_changing_trials().map(|t| t.change.value.name()).collect();
            hangs.dedup();
            let carried = |says: CriterionResult| c.sensitivities.iter().filter(|s| s.says == says).count();
            let carries = if c.sensitivities.is_empty() {
                "–".to_owned()
            } else {
                format!("{} of {}", carried(CriterionResult::Supports), c.sensitivities.len())
            };
            vec![
                Cell::text(format!("({}) {}", c.id, c.claim)),
                Cell::text(c.verdict.as_str()).status(status(c.verdict)),
                Cell::number(effect),
                Cell::text(bar),
                says,
                Cell::text(if hangs.is_empty() { "–".to_owned() } else { hangs.join(", ") }),
                Cell::text(carries),
            ]
        })
        .collect();
    let (first, last) = (study.first_seed, study.first_seed + study.seeds - 1);
    Section::new("Claims")
        .text(format!(
            "The primary condition is the paper's own protocol and decides alone: from it one effect with its 95 % interval over the noise seeds {first} to {last}. \
             Supported: the whole interval on the claim's side of the limit; contradicted: on the other side; undecided: neither. Assumed: a number that we chose \
             decides, because the effect changes sides when it is halved or doubled. Untestable: no simulation can say. Sensitivity conditions say how far a \
             claim carries and change no verdict. Protocols and criteria were written down before the numbers were computed; claims/README.md lists at its end what was changed afterwards, and why. S: supplement, M: main paper."
        ))
        .text(
            "The intervals hold the noise of the simulated sensor and nothing else: not the scatter of real gels, not the error of the law. A narrow one says that \
             the simulation is sure, not that the paper is right or wrong.",
        )
        .table(
            SourcedTable::named(Table {
                title: "Claims and verdicts".to_owned(),
                headers: [
                    "claim (the paper's)",
                    "verdict (computed)",
                    "effect (computed)",
                    "criterion (ours)",
                    "primary condition (computed)",
                    "depends on assumed values (computed)",
                    "sensitivity conditions in which it holds (computed)",
                ]
                .map(String::from)
                .to_vec(),
                rows,
                ..Table::default()
            })
            .into_table(),
        )
}

fn conditions(title: &str, list: &[Condition]) -> Table {
    let rows = list
        .iter()
        .map(|c| {
            vec![
                Cell::text(c.name.clone()),
                Cell::number(c.effect.words()),
                Cell::text(c.bar.words()),
                Cell::text(c.says.words()).status(said(c.says)),
                Cell::number(format!("{} of {}", c.effect.seeds, c.effect.of)),
            ]
        })
        .collect();
    let headers = ["condition", "effect", "criterion (ours)", "says", "seeds with a value"];
    SourcedTable::computed(Table {
        title: title.to_owned(),
        headers: headers.map(String::from).to_vec(),
        rows,
        ..Table::default()
    })
    .into_table()
}

fn detail(claim: &Claim) -> Section {
    let protocol = &claim.protocol;
    let mut section = Section::new(format!("Claim ({}): {}", claim.id, claim.verdict.as_str()))
        .text(format!("{}. {}", claim.claim, protocol.section("The paper says")))
        .text(format!("Source: {}", claim.source))
        .text(format!("Why: {}", claim.reason));
    for heading in ["Primary condition", "Effect", "Assumed", "Untestable"] {
        let text = protocol.section(heading);
        if !(text.is_empty() || text == "none" || text == "nothing") {
            section = section.text(format!("{heading}: {text}"));
        }
    }
    let Some(primary) = &claim.primary else { return section };
    let whole = Condition {
        name: "all together: decides".to_owned(),
        bar: primary.bar,
        effect: primary.effect.clone(),
        says: primary.says,
    };
    let mut parts = vec![whole];
    parts.extend(primary.parts.iter().cloned());
    let trials = claim
        .trials
        .iter()
        .map(|t| {
            let decides = if t.decides {
                Cell::text("decides").status(Status::Warn)
            } else {
                Cell::text("no other verdict")
            };
            vec![
                Cell::text(t.change.words()),
                Cell::number(t.effect.words()),
                decides,
                Cell::number(format!("{} of {}", t.effect.seeds, t.effect.of)),
            ]
        })
        .collect();
    section
        .table(conditions("Primary condition, and its experiments one by one", &parts))
        .table(conditions("Sensitivity conditions: how far it carries", &claim.sensitivities))
        .table(
            SourcedTable::computed(Table {
                title: "Numbers of ours, halved and doubled".to_owned(),
                headers: ["change", "effect", "", "seeds with a value"].map(String::from).to_vec(),
                rows: trials,
                ..Table::default()
            })
            .into_table(),
        )
}

fn figure(figure: Figure) -> Section {
    let mut section =
        Section::new(format!("{}: {}", figure.number, figure.title)).text(figure.caption.clone());
    if let Some(force) = figure.force {
        section = section.chart(force.group(figure.number));
    }
    for markup in figure.pictures {
        let description = format!("{}: {}", figure.number, figure.title);
        section = section.block(Block::Svg(SvgImage { description, markup }));
    }
    for table in figure.tables {
        section = section.table(table.into_table());
    }
    section
}

fn tunings(study: &Study) -> Table {
    let rows = study
        .tunings()
        .filter(|((recording_key, _), _)| recording_key.change.is_none())
        .map(|((recording_key, sensor), t)| {
            let noise = format!("{} mN", recording_key.noise_mn);
            vec![
                Cell::text(format!("{}, {} sensor", recording_key.case.name(), sensor.name())),
                Cell::number(noise),
                Cell::number(format!("{}", t.sigma_rupture_n)),
                Cell::number(format!("{}", t.on_n_per_s)),
                Cell::number(format!("{}", t.wrong)),
            ]
        })
        .collect();
    let headers = ["recording", "noise", "s1, N", "beta, N/s", "missed and false over the tuning seeds"];
    SourcedTable::computed(Table {
        title: "How the detection was tuned, within the laboratory's range".to_owned(),
        headers: headers.map(String::from).to_vec(),
        rows,
        ..Table::default()
    })
    .into_table()
}

/// The whole page.
#[must_use]
pub fn page(
    study: &Study,
    claims: &[Claim],
    figures: Vec<Figure>,
    truth_svgs: &[(&'static str, String)],
) -> Page {
    let mut page = Page::new("The paper, figure by figure")
        .subtitle("Ferro, Gaz, Anzidei, Vendittelli 2021 and its supplement, re-made on a testbed that knows the truth")
        .fact("noise seeds", format!("{} from {}", study.seeds, study.first_seed))
        .fact("version", env!("CARGO_PKG_VERSION"))
        .fact(
            "command",
            format!("stylet reproduce --out DIR --seeds {} --first-seed {}", study.seeds, study.first_seed),
        );
    page = page.section(
        Section::new("What this is")
            .text(
                "Our analogues of the supplement's Figs 1 to 15 and, as far as the supplement describes them, of the main paper's Table I and Figs 12, 13, 14. \
                 The phantoms are simulated, the algorithm is our own implementation of the paper's. The brackets behind every table name the origin of its numbers: \
                 the paper's (printed in the supplement), the laboratory's (published with its software, facts only), literature (measured by others), \
                 ours (chosen), computed (printed by this program from runs). Curves and dots in the figures are computed; the numbers that went \
                 into them stand under each with their class. In running text the paper's numbers follow `The paper says`, ours `Assumed`. The figures were compared with the supplement's text and captions, which is what \
                 was at hand: curves and axes of the printed figures could not be measured.",
            )
            .text(
                "Colours are the paper's: measured green, predicted yellow (here orange), enhanced blue (KV) and red (ML); continuous black lines: rupture detected, \
                 dashed: compensated. What only a simulation can add is dashed black: the truth. In the coefficient panels the thin lines are the online estimates, \
                 the thick ones the a posteriori estimates over the time in which their layer was traversed.",
            ),
    );
    page = page.section(summary(claims, study));
    page = page.section(assumed_values::section(study, claims).table(tunings(study)));
    for f in figures {
        page = page.section(figure(f));
    }
    page = page.section(algorithm_switches::section(study));
    page = page.section(estimates_against_truth::section(study, truth_svgs));
    for claim in claims {
        page = page.section(detail(claim));
    }
    page
}
