//! View of a phantom for the page: shipped scenarios, parameters as sliders, texts.

use crate::messages::*;
use crate::sliders::Scale;
use serde_json::{Value, json};
use stylet_scenario::{Motion, Scenario, Segment};
use stylet_tissue::{AnyEffect, Effect as _, Layer};

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../scenarios/", $name, ".ron")))),*]
    };
}

/// The shipped scenarios; the first is the phantom of an empty workspace.
pub const SCENARIOS: [(&str, &str); 13] = shipped![
    "three_layers",
    "three_layer_latex_constant",
    "three_layer_latex_sinusoidal",
    "isinglass_25_constant",
    "isinglass_25_sinusoidal",
    "isinglass_50_constant",
    "isinglass_50_sinusoidal",
    "isinglass_70_constant",
    "isinglass_70_sinusoidal",
    "bovine_liver_constant",
    "bovine_liver_constant_virtual",
    "abdomen_sinusoidal",
    "abdomen_sinusoidal_virtual",
];

pub fn parse(file: &str, text: &str) -> Result<Scenario, Problem> {
    Ok(Scenario::parse(file, text)?)
}

/// The phantom of an empty workspace.
pub fn first() -> Result<Scenario, Problem> {
    parse(SCENARIOS[0].0, SCENARIOS[0].1)
}

pub fn ron(scenario: &Scenario) -> Result<String, Problem> {
    Ok(scenario.to_ron()?)
}

pub fn title(id: &str) -> String {
    id.replace('_', " ")
}

const LAYER_FIELDS: [(&str, &str); 4] = [
    ("thickness", ""),
    ("stiffness", "elastic force per depth inside the layer"),
    ("friction", "viscous friction per length of needle inside"),
    ("puncture", "elastic force at which the layer ruptures; without one it ruptures at its far face"),
];
const TOLERANCES: [&str; 3] = ["tolerance", "thickness_tolerance", "surface_tolerance_m"];

fn layer_value(layer: &Layer, field: &str) -> Option<f64> {
    match field {
        "thickness" => Some(layer.thickness_m),
        "stiffness" => Some(layer.stiffness_n_per_m),
        "friction" => Some(layer.friction_ns_per_m2),
        _ => layer.puncture_n,
    }
}

pub fn tolerance<'a>(scenario: &'a mut Scenario, field: &str) -> Option<&'a mut f64> {
    Some(match field {
        "tolerance" => &mut scenario.tolerance,
        "thickness_tolerance" => &mut scenario.thickness_tolerance,
        "surface_tolerance_m" => &mut scenario.surface_tolerance_m,
        _ => return None,
    })
}

pub fn view(scenario: &Scenario) -> Result<Value, Problem> {
    let tissue = &scenario.tissue;
    let layer = |layer: &Layer| {
        let sliders = LAYER_FIELDS.iter().filter_map(|(field, help)| {
            Some(Scale::of_layer(field)?.view(field, "", help, layer_value(layer, field)))
        });
        json!({ "name": layer.name, "sliders": sliders.collect::<Vec<_>>() })
    };
    let effect = |effect: &AnyEffect| {
        let info = effect.info();
        let sliders = info.parameters.iter().zip(effect.parameters()).map(|(info, value)| {
            Scale::of_parameter(info).view(info.path, info.meaning, info.path, Some(value))
        });
        json!({ "id": info.id, "title": title(info.id), "sliders": sliders.collect::<Vec<_>>() })
    };
    let mut copy = scenario.clone();
    let mut tolerance_view = |field: &&str| {
        let value = *tolerance(&mut copy, field)?;
        Some(Scale::of_tolerance(field)?.view(field, "", "", Some(value)))
    };
    let faces = (0..=tissue.layers.len()).map(|face| millimetres(tissue.front_m(face)));
    Ok(json!({
        "name": scenario.name,
        "faces_mm": faces.collect::<Vec<_>>(),
        "layers": tissue.layers.iter().map(layer).collect::<Value>(),
        "effects": scenario.effects.iter().map(effect).collect::<Value>(),
        "tolerances": TOLERANCES.iter().filter_map(&mut tolerance_view).collect::<Vec<_>>(),
        "motion": motion_text(&scenario.motion),
        "ron": ron(scenario)?,
    }))
}

/// Millimetres, rounded to 0.1 µm.
pub fn millimetres(metres: f64) -> f64 {
    (1e7 * metres).round() / 1e4
}

fn motion_text(motion: &Motion) -> String {
    let mm = |x: f64| stylet_report::significant(1e3 * x, 3);
    match motion {
        Motion::Constant { velocity_mps, duration_s, .. } => {
            format!("constant {} mm/s over {duration_s} s", mm(*velocity_mps))
        }
        Motion::Sinusoidal { amplitude_m, frequency_hz, duration_s, .. } => {
            format!("sinusoidal, {} mm at {frequency_hz} Hz over {duration_s} s", mm(2.0 * amplitude_m))
        }
        Motion::Program { segments, .. } => segments.iter().map(segment_text).collect::<Vec<_>>().join(", "),
        Motion::Recorded => "that of the recordings".to_owned(),
    }
}

pub fn segment_text(segment: &Segment) -> String {
    let mm = |x: f64| stylet_report::significant(1e3 * x, 3);
    let s = |x: f64| stylet_report::significant(x, 3);
    match *segment {
        Segment::Move { velocity_mps, duration_s } => {
            format!("{} mm/s for {} s", mm(velocity_mps), s(duration_s))
        }
        Segment::Hold { duration_s } => format!("hold {} s", s(duration_s)),
        Segment::Ripple { velocity_mps, amplitude_mps, frequency_hz, duration_s } => format!(
            "{} ± {} mm/s at {} Hz for {} s",
            mm(velocity_mps),
            mm(amplitude_mps.abs()),
            s(frequency_hz),
            s(duration_s)
        ),
    }
}
