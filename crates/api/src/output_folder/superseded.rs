//! Files of an old set that the new set does not have.

use super::manifest::{MANIFEST, Manifest, sha256_of_file};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Manifest of the set in a folder; an empty one if there is none.
pub(super) fn manifest_in(folder: &Path) -> Manifest {
    let text = fs::read(folder.join(MANIFEST)).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Unchanged files of the old set that are neither in the new one nor inputs, while the new set is moved from `whole` and the old one to
/// `old`: they are moved away with the rest of the old set.
pub(super) fn superseded_files(folder: &Path, whole: &Path, old: &Path) -> Vec<String> {
    let has_manifest = |from: &Path| from.join(MANIFEST).exists();
    // The old manifest is the first file to be moved away, the new one the last to be moved in.
    let (new, present) = match (has_manifest(whole), has_manifest(old)) {
        (true, false) => (manifest_in(whole), manifest_in(folder)),
        (true, true) => (manifest_in(whole), manifest_in(old)),
        (false, true) => (manifest_in(folder), manifest_in(old)),
        (false, false) => return Vec::new(),
    };
    // A manifest that was not written by Stylet could name files elsewhere.
    let is_here = |name: &str| Path::new(name).file_name().is_some_and(|file| file == name);
    let is_superseded = |(name, sum): &(String, String)| {
        is_here(name)
            && !new.sha256.contains_key(name)
            && (old.join(name).exists()
                || sha256_of_file(&folder.join(name)).is_ok_and(|found| found == *sum))
    };
    present.sha256.into_iter().filter(is_superseded).map(|(name, _)| name).collect()
}

/// Files of the present set that the new one does not have but that are inputs of the command, with their sums: they stay.
pub(super) fn kept_inputs(folder: &Path, is_input: impl Fn(&Path) -> bool) -> BTreeMap<String, String> {
    let present = manifest_in(folder).sha256.into_iter();
    present.filter(|(name, _)| is_input(&folder.join(name))).collect()
}
