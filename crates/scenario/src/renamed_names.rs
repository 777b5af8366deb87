//! Public names that changed in 0.2. Files and command lines with an old name are rejected with an error that gives the new
//! one.

/// Fields and effects in RON files.
const RON_NAMES: &[(&str, &str)] = &[
    ("LetGo", "ReleaseDepth"),
    ("let_go", stylet_tissue::ReleaseDepth::ID),
    ("curve_n_per_m2", "curvature_n_per_m2"),
    ("kept", "retained_share"),
    ("smallest_noise_n", "min_noise_n"),
    ("longest_s", "max_duration_s"),
    ("old_ground_m", "revisit_margin_m"),
    ("law", "friction_law"),
    ("smallest_drop", "min_drop_share"),
    ("track_way_back", "track_retraction"),
];

/// Keys of `diagnosis.json`, which later commands read.
const JSON_KEYS: &[(&str, &str)] = &[
    ("differences", "random_effect_sd"),
    ("evidence", "search_steps"),
    ("invisible", "not_identifiable"),
    ("leftover", "residual_structure"),
    ("traces", "negligible"),
];

/// Flags and commands of the command line.
const FLAGS: &[(&str, &str)] = &[
    ("--believed", "--assumed"),
    ("--law", "--model"),
    ("--grade", "--severity"),
    ("--look", "--from-journal"),
    ("judge", "score"),
];

fn new_name_of(names: &'static [(&str, &str)], old: &str) -> Option<&'static str> {
    names.iter().find(|(name, _)| *name == old).map(|(_, new)| *new)
}

fn renamed_sentence(old: &str, new: &str) -> String {
    format!("`{old}` is called `{new}` since 0.2")
}

/// "`LetGo` is called `ReleaseDepth` since 0.2" for an old name of a field or an effect, if the new one is among `expected`.
#[must_use]
pub fn renamed_ron_name(old: &str, expected: &[&str]) -> Option<String> {
    let new = new_name_of(RON_NAMES, old)?;
    expected.contains(&new).then(|| renamed_sentence(old, new))
}

/// The same for the parts of a path such as `enhance.stylet.law`.
#[must_use]
pub fn renamed_path(path: &str) -> Option<String> {
    path.split(['.', '[', ']']).find_map(|part| Some(renamed_sentence(part, new_name_of(RON_NAMES, part)?)))
}

/// The same for an old key in the text of a JSON file.
#[must_use]
pub fn renamed_json_key(text: &str) -> Option<String> {
    let (old, new) = JSON_KEYS.iter().find(|(old, _)| text.contains(&format!("\"{old}\":")))?;
    Some(renamed_sentence(old, new))
}

/// The same for a flag or a command.
#[must_use]
pub fn renamed_flag(old: &str) -> Option<String> {
    Some(renamed_sentence(old, new_name_of(FLAGS, old)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EnhancerConfigFile, Scenario};

    #[test]
    fn old_names_in_files_are_refused_with_the_new_ones() {
        let scenario = |effect: &str| {
            format!(
                "Scenario(name: \"x\", tissue: (layers: [(thickness_m: 0.03, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0)]), motion: Recorded, effects: [{effect}])"
            )
        };
        for (effect, message) in [
            ("LetGo(layer: 1, depth_m: 0.003)", "`LetGo` is called `ReleaseDepth` since 0.2"),
            (
                "ViscoelasticPresliding(layer: 1, share: 0.5, delta_m: 0.002, kept: 1.0, time_constant_s: 2.0, release_m: 0.0)",
                "`kept` is called `retained_share` since 0.2",
            ),
        ] {
            let error = Scenario::parse("old.ron", &scenario(effect)).expect_err(effect).to_string();
            assert!(error.contains(message), "{error}");
        }
        let error =
            EnhancerConfigFile::parse("e.ron", "Enhance(stylet: (law: Viscous))").expect_err("old name");
        assert!(error.to_string().contains("`law` is called `friction_law` since 0.2"), "{error}");
    }

    #[test]
    fn old_paths_keys_and_flags_have_a_new_name() {
        assert_eq!(
            renamed_path("enhance.drop.longest_s").as_deref(),
            Some("`longest_s` is called `max_duration_s` since 0.2")
        );
        assert_eq!(renamed_path("enhance.drop.travel_m"), None);
        assert!(renamed_json_key("{\"invisible\": []}").is_some_and(|s| s.contains("`not_identifiable`")));
        assert_eq!(renamed_json_key("{\"why\": \"invisible\"}"), None);
        assert!(renamed_flag("--believed").is_some() && renamed_flag("--out").is_none());
    }
}
