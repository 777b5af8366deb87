//! The reference pages of the scenario format and of the effects library, generated from the schema.
//!
//! [`scenario_page`] and [`effects_page`] are the contents of `docs/reference/scenario.md` and `docs/reference/effects.md`, [`effects_table`] is the
//! table in `docs/reference/model.md`. Defaults and example values are read from RON that the parser accepts. The test
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

/// The value at a documented path, in which variants stand behind `/` and any element of a list is `[]`.
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

/// A value in one line; what is inside the brackets of a long one is left out.
fn brief(value: &str, max_length: usize) -> String {
    let line = value.split_whitespace().collect::<Vec<_>>().join(" ");
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

/// `docs/reference/scenario.md`: every field of a scenario with default, unit, range, meaning and a line to paste.
#[must_use]
pub fn scenario_page() -> String {
    let mut page = "# Scenario reference\n\n\
        Generated from the schema; `cargo test -p stylet-scenario reference` with `STYLET_BLESS=1` writes it again.\n\n\
        A scenario is a RON file, `Scenario(...)`. Unknown fields are errors that point at line and column. All values are in SI units. Comments begin with `//`.\n\
        An optional value is written as such: `puncture_n: 0.8` and `puncture_n: Some(0.8)` are the same. [model.md](model.md) has the equations, [effects.md](effects.md)\n\
        the fields of the effects, [files.md](files.md) the other files.\n\n"
        .to_owned();
    for section in sections() {
        let _ = writeln!(page, "## {}\n", section.title);
        if !section.intro.is_empty() {
            let _ = writeln!(page, "{}\n", section.intro);
        }
        page += "| field | default | unit | range | meaning | line |\n|---|---|---|---|---|---|\n";
        for (name, unit, range, meaning) in &section.fields {
            let path = format!("{}{name}", section.prefix);
            let value = value_at(&scenario_with(&section.example), &path)
                .map(|value| brief(value, 130))
                .unwrap_or_default();
            let field = name.rsplit(['.', ']']).next().unwrap_or(name);
            let default = default_of(&section, &path);
            let _ = writeln!(
                page,
                "| `{name}` | {default} | {unit} | {range} | {meaning} | `{field}: {value}` |"
            );
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

/// Names, equations and places of all effects: the table in `docs/reference/model.md`.
#[must_use]
pub fn effects_table() -> String {
    let mut table = "| effect | acts on | equation |\n|---|---|---|\n".to_owned();
    for info in all_effects() {
        let place = format!("{:?}", info.stage).to_lowercase();
        let _ = writeln!(
            table,
            "| [`{}`](effects.md#{}) | {place} | `{}` |",
            info.id,
            info.id,
            info.equation.replace('|', "\\|")
        );
    }
    table
}

/// `docs/reference/effects.md`: every effect with equation, source, signature, parameters and a line to paste.
#[must_use]
pub fn effects_page() -> String {
    let mut page = "# Effects reference\n\n\
        Generated from the library; `cargo test -p stylet-scenario reference` with `STYLET_BLESS=1` writes it again.\n\n\
        Every effect has one name: `coulomb_friction` in outputs and on the command line, `CoulombFriction` in scenarios. Lines go into the list `effects: [...]` of a\n\
        scenario. *Inactive* is the value at which a parameter has no effect, *typical* where a fit starts. Symbols: [model.md](model.md#symbols-and-signs).\n\n\
        The pictures show the force of one insertion without and with the effect, and the difference; some have another size than the typical one, so that it can be seen.\n\n"
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
            "\n![Force without and with {}](../figures/effects/{}.svg)\n\nSignature: {}\nSource: {}.\n",
            info.id,
            info.id,
            info.signature,
            info.source.trim_end_matches('.')
        );
    }
    page += &custom_effects_section();
    page.truncate(page.trim_end().len());
    page + "\n"
}

/// The fields of custom effects, and the variables of their formulas.
fn custom_effects_section() -> String {
    let mut section = "## Custom effects\n\n\
        `Custom(...)` is an effect given by formulas: [how to use it](../how-to/custom_effects.md).\n\n```ron\n\
        Custom(name: \"ageing_friction\", place: Friction, force: \"c * sgn(v) * inserted * (1 + travel/l)\", parameters: {\n    \
        c: (start: 3.0, unit: \"N/m\", inactive: 0.0),\n    \
        l: (start: 0.02, prior: LogNormal(median: 0.02, factor: 3.0), unit: \"m\"),\n\
        }),\n```\n\n| variable | unit | meaning | places |\n|---|---|---|---|\n"
        .to_owned();
    for v in &VARIABLES {
        let places: Vec<String> = v.places.iter().map(|place| format!("`{place:?}`")).collect();
        let _ = writeln!(section, "| `{}` | {} | {} | {} |", v.name, v.unit, v.meaning, places.join(", "));
    }
    section
}

#[cfg(test)]
mod tests;
