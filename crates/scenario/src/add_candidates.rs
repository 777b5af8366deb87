//! Files of custom effects.

use crate::input_error::InputError;
use crate::load_ron::{parse, read_text};
use crate::motion::Motion;
use crate::scenario::Scenario;
use crate::validate_effects::candidate;
use std::path::{Path, PathBuf};
use stylet_tissue::{AnyEffect, Effect, Tissue};

/// The effects of a file of custom effects.
///
/// # Errors
/// [`InputError`] with line and column.
pub fn load_effects(file: &Path) -> Result<Vec<AnyEffect>, InputError> {
    parse(&file.display().to_string(), &read_text(file)?)
}

/// The effects of files of custom effects, as candidates of any scenario; duplicates are kept once.
///
/// # Errors
/// As [`Scenario::add_candidates`].
pub fn load_candidates(files: &[PathBuf]) -> Result<Vec<AnyEffect>, InputError> {
    let mut scenario = Scenario::new(String::new(), Tissue::three_gels(), Motion::Recorded);
    for file in files {
        scenario.add_candidates(file)?;
    }
    Ok(scenario.candidates)
}

/// The effects as the text of such a file.
///
/// # Errors
/// When an effect cannot be written as RON.
pub fn effects_to_ron(effects: &[AnyEffect]) -> Result<String, ron::Error> {
    let pretty = ron::ser::PrettyConfig::new().struct_names(false).depth_limit(4);
    crate::ron_dialect::ron_options().to_string_pretty(&effects, pretty)
}

impl Scenario {
    /// Adds the effects of a file to the candidates; duplicates are kept once.
    ///
    /// # Errors
    /// [`InputError`] when the file is wrong, or defines a candidate of the same name differently.
    pub fn add_candidates(&mut self, file: &Path) -> Result<(), InputError> {
        let name = file.display().to_string();
        let text = read_text(file)?;
        for (index, effect) in parse::<Vec<AnyEffect>>(&name, &text)?.into_iter().enumerate() {
            if !self.candidates.iter().any(|known| known.info() == effect.info()) {
                self.candidates.push(effect);
                let last = self.candidates.len() - 1;
                candidate(self, last, &format!("[{index}]"))
                    .map_err(|problem| problem.in_file(&name, &text))?;
            }
        }
        Ok(())
    }
}
