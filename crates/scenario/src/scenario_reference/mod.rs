//! The reference pages of the scenario format and of the effects library, generated from the schema.
//!
//! [`scenario_page`] and [`effects_page`] are the contents of `docs/reference/scenario.md` and `docs/reference/effects.md`, [`effects_by_stage`] is the
//! table in `docs/reference/model.md`, [`custom_variables`] that in `docs/how-to/custom_effects.md`. Defaults and example values are read from RON that the parser accepts. The test
//! `tests/promises/reference_pages.rs` compares the files with these functions.

use crate::load_ron::parse;
use crate::ron_dialect::ron_options;
use crate::ron_outline::RonOutline;
use crate::scenario::Scenario;
use serde::Deserialize;
use std::fmt::Write;
use stylet_tissue::{EffectInfo, ParameterInfo, VARIABLES, general_effects, per_layer_effects};

/// Fields that belong together, as in `sections.ron`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Section {
    title: String,
    prefix: String,
    #[serde(default)]
    intro: String,
    #[serde(default)]
    required: String,
    /// The example has no optional fields.
    #[serde(default)]
    all_required: bool,
    example: String,
    /// Name, unit, range, meaning.
    fields: Vec<(String, String, String, String)>,
}

fn sections() -> Vec<Section> {
    parse("sections.ron", include_str!("sections.ron")).unwrap_or_default()
}

/// The required fields of a scenario, by name.
const REQUIRED: [(&str, &str); 3] = [
    ("name:", "name: \"x\","),
    (
        "tissue:",
        "tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]),",
    ),
    ("motion:", "motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 20.0),"),
];

/// A scenario of `fields`, completed by the required ones.
fn scenario_with(fields: &str) -> String {
    let mut text = format!("Scenario(\n{fields}\n");
    for (name, line) in REQUIRED {
        if !fields.split(['\n', ',']).any(|part| part.trim_start().starts_with(name)) {
            text += line;
            text.push('\n');
        }
    }
    text + ")\n"
}

/// The value at a documented path, in which variants follow a `/` and any element of a list is `[]`.
fn value_at<'a>(text: &'a str, path: &str) -> Option<&'a str> {
    let mut plain = String::new();
    for (i, part) in path.split('/').enumerate() {
        let field = if i == 0 { part } else { part.find('.').map_or("", |dot| &part[dot..]) };
        plain.push_str(field);
    }
    let outline = RonOutline::new(text);
    let entry = outline.locate(&plain.replace("[]", "[0]"))?;
    text.get(entry.start..entry.end)
}

/// A value in one line, as a user would write it; the content of long brackets is left out.
fn brief(value: &str, max_length: usize) -> String {
    let line = value.split_whitespace().collect::<Vec<_>>().join(" ");
    // The writer puts each field on its own line, and marks names that are reserved in Rust.
    let line = line.replace("( ", "(").replace(", )", ")").replace("r#", "");
    match line.find(['(', '[']) {
        Some(0) if line.len() > max_length && line.starts_with('[') => "[...]".to_owned(),
        Some(bracket) if line.len() > max_length => format!("{}(...)", &line[..bracket]),
        _ => line,
    }
}

fn default_of(section: &Section, path: &str) -> String {
    let given = scenario_with(if section.all_required { &section.example } else { &section.required });
    if value_at(&given, path).is_some() {
        return "required".to_owned();
    }
    let resolved = Scenario::parse("defaults", &given).ok().and_then(|s| s.to_ron().ok()).unwrap_or_default();
    match value_at(&resolved, path) {
        Some(value) => format!("`{}`", brief(value, 45)),
        None => match path {
            "robot/Arm.tip_m" => "given by `start_rad`".to_owned(),
            "robot/Arm.direction" => "axis of the needle".to_owned(),
            "enhance_virtual" => "as `enhance`".to_owned(),
            _ => "none".to_owned(),
        },
    }
}

/// `docs/reference/scenario.md`: every field of a scenario with default, unit, range and meaning, and lines to paste.
#[must_use]
pub fn scenario_page() -> String {
    let mut page = "# Scenario reference\n\n\
        Every field of a scenario, a RON file `Scenario(...)`. [Files](files.md) has the common rules of all files, [Model](model.md) the equations. This page is generated.\n\n"
        .to_owned();
    for section in sections() {
        let _ = writeln!(page, "## {}\n", section.title);
        if !section.intro.is_empty() {
            let _ = writeln!(page, "{}\n", section.intro);
        }
        page += "| field | default | unit | range | meaning |\n|---|---|---|---|---|\n";
        for (name, unit, range, meaning) in &section.fields {
            let path = format!("{}{name}", section.prefix);
            let default = default_of(&section, &path);
            let _ = writeln!(page, "| `{name}` | {default} | {unit} | {range} | {meaning} |");
        }
        let _ = writeln!(page, "\n```ron\n{}\n```\n", section.example);
    }
    page.truncate(page.trim_end().len());
    page + "\n"
}

/// The effects of the library, those of single layers last.
fn all_effects() -> impl Iterator<Item = &'static EffectInfo> {
    general_effects().chain(per_layer_effects())
}

/// A line for the `effects` list of a scenario, with typical parameters: `CoulombFriction(c_n_per_m: 6.0),`.
#[must_use]
pub fn effect_line(info: &'static EffectInfo) -> String {
    let typical: Vec<f64> = info.parameters.iter().map(|p| p.demonstration.unwrap_or(p.start)).collect();
    info.with_parameters(&typical)
        .and_then(|effect| ron_options().to_string(&effect).ok())
        .map(|text| text.replace(':', ": ").replace(',', ", ") + ",")
        .unwrap_or_default()
}

/// `>= 0`, `0 to 1`: the physical range of a parameter.
fn range(p: &ParameterInfo) -> String {
    match (p.low, p.high) {
        (f64::NEG_INFINITY, f64::INFINITY) => "finite".to_owned(),
        (low, f64::INFINITY) => format!(">= {low}"),
        (low, high) => format!("{low} to {high}"),
    }
}

/// The effects of each stage, in the order of evaluation: the table in `docs/reference/model.md`.
#[must_use]
pub fn effects_by_stage() -> String {
    let mut stages: Vec<(String, Vec<String>)> = Vec::new();
    for info in all_effects() {
        let stage = format!("{:?}", info.stage).to_lowercase();
        let link = format!("[`{}`](effects.md#{})", info.id, info.id);
        match stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, links)) => links.push(link),
            None => stages.push((stage, vec![link])),
        }
    }
    stages.into_iter().fold("| stage | effects |\n|---|---|\n".to_owned(), |mut table, (stage, links)| {
        let _ = writeln!(table, "| {stage} | {} |", links.join(", "));
        table
    })
}

/// `docs/reference/effects.md`: every effect with equation, source, signature, parameters and a line to paste, then the `examples` of custom effects,
/// the text of a list of `Custom(...)`.
#[must_use]
pub fn effects_page(examples: &str) -> String {
    let mut page = "# Effects reference\n\n\
        An effect is `coulomb_friction` in outputs and on the command line, `CoulombFriction` in the list `effects: [...]` of a scenario. Per effect: equation\n\
        ([symbols](model.md#symbols-and-signs)), a line to paste, parameters (*inactive*: the value without effect, *typical*: where a fit starts), pictures, how to recognise it, and *a source*.\n\
        Pictures and lines may have another size than the typical one. This page is generated.\n\n\
        Pictures: the force without and with the effect; a recording (noise 0.01 N) less the simulation without it; the same recording less the simulation of\n\
        the `extended.ron` that `stylet diagnose` wrote from it and one of another motion, with the verdict. Single spikes at ruptures are a sample of timing.\n\n"
        .to_owned();
    let mut heading = "General effects";
    let _ = writeln!(page, "## {heading}\n");
    for info in all_effects() {
        if heading == "General effects" && per_layer_effects().any(|e| e.id == info.id) {
            heading = "Effects of single layers";
            let _ = writeln!(
                page,
                "## {heading}\n\nNot searched in single insertions; data sets of repeats use them.\n"
            );
        }
        let _ = writeln!(
            page,
            "### {}\n\n    {}\n\n```ron\n{}\n```\n\n| parameter | unit | range | inactive | typical | meaning |\n|---|---|---|---|---|---|",
            info.id,
            info.equation,
            effect_line(info)
        );
        for p in info.extended.unwrap_or(info).parameters {
            let inactive = if p.strength { p.inactive.to_string() } else { String::new() };
            let _ = writeln!(
                page,
                "| `{}` | {} | {} | {inactive} | {} | {} |",
                p.path,
                p.unit,
                range(p),
                p.start,
                p.meaning
            );
        }
        let _ = writeln!(
            page,
            "\n![{}](../figures/effects/{}.svg)\n\n{} *{}.*\n",
            info.id,
            info.id,
            info.signature,
            info.source.trim_end_matches('.')
        );
    }
    page += &custom_section(examples);
    page.truncate(page.trim_end().len());
    page + "\n"
}

/// The custom effects in the text of a list, each as it stands there, with its picture.
fn custom_section(examples: &str) -> String {
    let mut section = "## Custom effects\n\n\
        [Formulas](../how-to/custom_effects.md) from `scenarios/effects/examples.ron`, diagnosed with `--effects` and that file.\n"
        .to_owned();
    let outline = RonOutline::new(examples);
    let text = |path: &str| outline.locate(path).and_then(|entry| examples.get(entry.start..entry.end));
    for k in 0.. {
        let (Some(effect), Some(name)) = (text(&format!("[{k}]")), text(&format!("[{k}].name"))) else {
            break;
        };
        let name = name.trim_matches('"');
        // The list indents its entries by four spaces.
        let lines = effect.replace("\n    ", "\n");
        let _ = writeln!(
            section,
            "\n### {name}\n\n```ron\n{lines},\n```\n\n![{name}](../figures/effects/{name}.svg)"
        );
    }
    section
}

/// The variables in the formulas of custom effects: the table in `docs/how-to/custom_effects.md`.
#[must_use]
pub fn custom_variables() -> String {
    let mut table = "| variable | unit | meaning | places |\n|---|---|---|---|\n".to_owned();
    for v in &VARIABLES {
        let places: Vec<String> = v.places.iter().map(|place| format!("`{place:?}`")).collect();
        let _ = writeln!(table, "| `{}` | {} | {} | {} |", v.name, v.unit, v.meaning, places.join(", "));
    }
    table
}

#[cfg(test)]
mod tests;
