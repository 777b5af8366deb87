//! The settings file of `stylet enhance --config`.

use crate::input_error::InputError;
use crate::load_ron::{parse, read_text};
use crate::range_checks::finite;
use crate::ron_outline::RonOutline;
use crate::scenario::Scenario;
use crate::validate_enhancer::enhance;
use serde::{Deserialize, Serialize};
use std::path::Path;
use stylet_core::EnhanceConfig;
use stylet_core::config::{
    Algorithm, Contact, ContactConfig, CusumConfig, Depths, DerivativeConfig, DropConfig, FrictionLaw,
    GuardConfig, Model, Reset, StyletConfig,
};
use stylet_tissue::{AnyEffect, Tissue};

/// Surface position and settings of the online algorithm.
///
/// In a file the fields are flat, `Enhance(surface_m: 0.01, contact: Known, model: MultiLayer)`; a scenario file is accepted as well.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "FlatFields", into = "FlatFields")]
pub struct EnhancerConfigFile {
    /// Position of the surface in m, for `contact: Known`.
    pub surface_m: f64,
    /// The core.
    pub enhance: EnhanceConfig,
}

impl EnhancerConfigFile {
    /// Loads an `Enhance(...)` file, or the corresponding fields of a `Scenario(...)` file.
    ///
    /// # Errors
    /// [`InputError`] with file, line and column.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &read_text(path)?)
    }

    /// Parses and checks either kind of file; `file` is named in errors.
    ///
    /// # Errors
    /// As [`EnhancerConfigFile::load`].
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        if is_scenario(text) {
            let Scenario { tissue, mut enhance, effects, .. } = Scenario::parse(file, text)?;
            if enhance.stylet.friction_law == FrictionLaw::Auto {
                enhance.stylet.friction_law = friction_law(&tissue, &effects);
            }
            return Ok(Self { surface_m: tissue.surface_m, enhance });
        }
        let loaded: Self = parse(file, text)?;
        finite("surface_m", loaded.surface_m, "metres")
            .and_then(|()| enhance("", &loaded.enhance))
            .map_err(|problem| problem.in_file(file, text))?;
        Ok(loaded)
    }
}

/// The friction law of a scenario's effects: dry friction relative to the mean viscous friction of the layers. `Auto` without dry or without viscous
/// friction.
fn friction_law(tissue: &Tissue, effects: &[AnyEffect]) -> FrictionLaw {
    let (mut dry, mut travel_m) = (0.0, 0.0f64);
    for effect in effects {
        match effect {
            AnyEffect::CoulombFriction(e) => dry += e.c_n_per_m,
            AnyEffect::StribeckFriction(e) => dry += e.c_n_per_m,
            AnyEffect::PreslidingFriction(e) => {
                dry += e.c_n_per_m;
                travel_m = travel_m.max(e.delta_m);
            }
            _ => {}
        }
    }
    let depth: f64 = tissue.layers.iter().map(|l| l.thickness_m).sum();
    let viscous: f64 =
        tissue.layers.iter().map(|l| l.friction_ns_per_m2 * l.thickness_m).sum::<f64>() / depth;
    let dry_mps = dry / viscous;
    if dry <= 0.0 || !dry_mps.is_finite() {
        FrictionLaw::Auto
    } else if travel_m > 0.0 {
        FrictionLaw::Presliding { dry_mps, travel_m }
    } else {
        FrictionLaw::CoulombViscous { dry_mps }
    }
}

/// True if the type name, or a field that only scenarios have, shows a scenario file.
fn is_scenario(text: &str) -> bool {
    let outline = RonOutline::new(text);
    let named = outline.entries.first().is_some_and(|whole| text[whole.start..].starts_with("Scenario"));
    named || ["tissue", "motion"].into_iter().any(|field| outline.locate(field).is_some())
}

/// Form in the file: the fields of [`EnhanceConfig`] and the surface.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Enhance", default, deny_unknown_fields)]
struct FlatFields {
    surface_m: f64,
    algorithm: Algorithm,
    model: Model,
    reset: Reset,
    contact: Contact,
    depths: Depths,
    forgetting: f64,
    prior_stiffness: f64,
    prior_friction: f64,
    cusum: CusumConfig,
    derivative: DerivativeConfig,
    drop: DropConfig,
    contact_search: ContactConfig,
    guard: GuardConfig,
    stylet: StyletConfig,
}

impl Default for FlatFields {
    fn default() -> Self {
        EnhancerConfigFile::default().into()
    }
}

macro_rules! convert {
    ($($field:ident),*) => {
        impl From<FlatFields> for EnhancerConfigFile {
            fn from(FlatFields { surface_m, $($field),* }: FlatFields) -> Self {
                Self { surface_m, enhance: EnhanceConfig { $($field),* } }
            }
        }

        impl From<EnhancerConfigFile> for FlatFields {
            fn from(EnhancerConfigFile { surface_m, enhance: EnhanceConfig { $($field),* } }: EnhancerConfigFile) -> Self {
                Self { surface_m, $($field),* }
            }
        }
    };
}

convert!(
    algorithm,
    model,
    reset,
    contact,
    depths,
    forgetting,
    prior_stiffness,
    prior_friction,
    cusum,
    derivative,
    drop,
    contact_search,
    guard,
    stylet
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enhance_file_is_flat_and_reads_back() {
        let text =
            "Enhance(surface_m: 0.01, contact: Known, model: KelvinVoigt, cusum: (sigma_ordinary_n: 0.02))";
        let file = EnhancerConfigFile::parse("e.ron", text).expect("it is right");
        assert_eq!((file.surface_m, file.enhance.model), (0.01, Model::KelvinVoigt));
        assert_eq!(file.enhance.cusum.sigma_ordinary_n, 0.02);
        assert_eq!(file.enhance.guard, GuardConfig::default());
        let written = crate::ron_options().to_string(&file).expect("it can be written");
        assert_eq!(EnhancerConfigFile::parse("e.ron", &written).expect("it reads back"), file);
        assert_eq!(
            EnhancerConfigFile::parse("e.ron", "()").expect("all defaults"),
            EnhancerConfigFile::default()
        );
    }

    #[test]
    fn a_scenario_serves_as_an_enhance_file() {
        let text = r#"(name: "x", tissue: (surface_m: 0.02, layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0,
            friction_ns_per_m2: 9000.0)]), motion: Recorded, enhance: (forgetting: 0.99))"#;
        let file = EnhancerConfigFile::parse("s.ron", text).expect("it is right");
        assert_eq!((file.surface_m, file.enhance.forgetting), (0.02, 0.99));
    }

    #[test]
    fn errors_of_a_settings_file_name_their_location() {
        for (text, expected) in [
            (
                "Enhance(forgetting: 1.5)",
                "e.ron:1:21: forgetting: is 1.5; it must lie above 0 and be at most 1",
            ),
            ("Enhance(surface_m: NaN)", "e.ron:1:20: surface_m: is NaN"),
            (
                "Enhance(\n  modl: MultiLayer)",
                "e.ron:2:3: unknown field `modl` of `Enhance`; did you mean `model`?",
            ),
            ("Enhanc()", "e.ron:1:1: this is a `Enhanc`, where a `Enhance` is expected"),
        ] {
            let message = EnhancerConfigFile::parse("e.ron", text).expect_err(text).to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
