//! A data set: what was measured, where it lies, what is believed of it.
//!
//! ```ron
//! Dataset(
//!     name: "skin on muscle",
//!     columns: (time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz")),
//!     tissue: (surface_m: 0.004, layers: [(name: "skin", thickness_m: 0.011, stiffness_n_per_m: 300.0, friction_ns_per_m2: 10000.0)]),
//!     recordings: ["needle_phantom/skin-on-muscle_*.csv"],
//!     air: "needle_phantom/air_blank.csv",
//!     load: (file: "needle_phantom/constant_5N.csv", force_n: 5.0),
//! )
//! ```
//! File names are relative to the folder `STYLET_MEASURED`, by default `../shared/measured`; a `*` in the last part
//! stands for anything.

use crate::repeated_insertions::start_values::SegmentedRecording;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_record::{
    ColumnMap, QualityKind, QualityNote, ReadOptions, RecordError, Recording, check_usable,
    find_outlier_recordings, read_csv_bytes, read_csv_skip_nonfinite,
};
use stylet_scenario::{FieldError, InputError, parse, read_text};
use stylet_tissue::Tissue;

/// A recording of a force that is known.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownLoad {
    /// File.
    pub file: String,
    /// The force in N.
    pub force_n: f64,
}

/// Recordings of some of the layers alone.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SingleLayerPart {
    /// What it is.
    pub name: String,
    /// Which layer of the whole it is, 1-based.
    pub layer: usize,
    /// Files.
    pub recordings: Vec<String>,
}

/// A data set, as its file has it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Dataset", deny_unknown_fields)]
pub struct Dataset {
    /// What it is, for people.
    pub name: String,
    /// Where it comes from.
    #[serde(default)]
    pub source: String,
    /// Names and units of the columns; Stylet's own when left out.
    #[serde(default)]
    pub columns: Option<ColumnMap>,
    /// What is believed of the tissue: number, names and thickness of the layers.
    pub tissue: Tissue,
    /// Files of repeated insertions.
    #[serde(default)]
    pub recordings: Vec<String>,
    /// Columns whose values tell specimens in one file apart; each is then a material of its own.
    #[serde(default)]
    pub split_by: Vec<String>,
    /// A motion in air.
    #[serde(default)]
    pub air: Option<String>,
    /// A known load.
    #[serde(default)]
    pub load: Option<KnownLoad>,
    /// Recordings of single layers.
    #[serde(default)]
    pub parts: Vec<SingleLayerPart>,
    /// Rows with backward or repeated time stamps are dropped and told, as the command line asks.
    #[serde(skip)]
    pub repair: bool,
}

/// Why a data set cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The description is wrong.
    #[error(transparent)]
    Input(Box<InputError>),
    /// A recording is wrong.
    #[error(transparent)]
    Recording(#[from] RecordError),
    /// A file is not there.
    #[error(
        "no file matches {pattern} in {folder}; set STYLET_MEASURED to the folder that holds the recordings, or name them with --data"
    )]
    NoFile {
        /// What was looked for.
        pattern: String,
        /// Where.
        folder: String,
    },
    /// Too little to tell repeats from a law.
    #[error("{0}")]
    TooLittle(String),
}

impl From<InputError> for DatasetError {
    fn from(error: InputError) -> Self {
        Self::Input(Box::new(error))
    }
}

/// Whether a file describes a data set rather than a scenario.
///
/// # Errors
/// When the file cannot be read.
pub fn is_dataset(path: &Path) -> Result<bool, InputError> {
    let text = read_text(path)?;
    let first =
        text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with("//") && !l.starts_with("#!"));
    Ok(first.is_some_and(|l| l.starts_with("Dataset")))
}

impl Dataset {
    /// Loads and checks a description.
    ///
    /// # Errors
    /// [`InputError`] with file, line and column.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &read_text(path)?)
    }

    /// Parses and checks a description; `file` is named in errors.
    ///
    /// # Errors
    /// [`InputError`] with line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, InputError> {
        let out: Self = parse(file, text)?;
        out.check().map_err(|problem| problem.in_file(file, text))?;
        Ok(out)
    }

    fn check(&self) -> Result<(), FieldError> {
        let layers = self.tissue.layers.len();
        if !(1..=7).contains(&layers) {
            return Err(FieldError::new(
                "tissue.layers",
                format!("there are {layers} layers; 1 to 7 can be told apart"),
            ));
        }
        for (i, layer) in self.tissue.layers.iter().enumerate() {
            if !(layer.thickness_m > 0.0 && layer.thickness_m < 1.0) {
                let what = format!("is {}; it must lie between 0 and 1 m", layer.thickness_m);
                return Err(FieldError::new(format!("tissue.layers[{i}].thickness_m"), what));
            }
        }
        for (i, part) in self.parts.iter().enumerate() {
            if !(1..=layers).contains(&part.layer) {
                let what = format!("is {}; the tissue has layers 1 to {layers}", part.layer);
                return Err(FieldError::new(format!("parts[{i}].layer"), what));
            }
        }
        match &self.load {
            Some(load) if !(load.force_n.is_finite() && load.force_n != 0.0) => Err(FieldError::new(
                "load.force_n",
                format!("is {}; it must be the known force in N", load.force_n),
            )),
            _ => Ok(()),
        }
    }

    /// How its files are read.
    #[must_use]
    pub fn options(&self) -> ReadOptions {
        ReadOptions { columns: self.columns.clone(), repair: self.repair }
    }

    /// Reads runs of `layers` layers. Each is judged by itself and beside the others, as every recording is
    /// ([`stylet_record::assess`], [`unlike_the_others`]).
    ///
    /// # Errors
    /// [`DatasetError`]; [`RecordError::Unusable`] names every recording from which nothing can be concluded. Of specimens in one file
    /// ([`Dataset::split_by`]), which share columns and sensor, those that are too short or never touched are left to the study.
    pub fn load_recordings(
        &self,
        files: &[PathBuf],
        layers: usize,
    ) -> Result<Vec<SegmentedRecording>, DatasetError> {
        let mut read = Vec::with_capacity(files.len());
        for file in files {
            read.extend(self.read(file)?);
        }
        if self.split_by.is_empty() {
            check_usable(read.iter().map(|(name, _, notes)| (name.as_str(), notes.as_slice())))?;
            let recordings: Vec<&Recording> = read.iter().map(|(_, recording, _)| recording).collect();
            let unlike = find_outlier_recordings(&recordings);
            for ((_, _, notes), unlike) in read.iter_mut().zip(unlike) {
                notes.extend(unlike);
            }
        } else {
            let grave = |notes: &[QualityNote]| {
                notes.iter().any(|n| {
                    n.blocking
                        && !matches!(n.kind, QualityKind::TooShort | QualityKind::InAir | QualityKind::Stuck)
                })
            };
            if read.iter().all(|(_, _, notes)| grave(notes)) {
                check_usable(read.iter().map(|(name, _, notes)| (name.as_str(), notes.as_slice())))?;
            }
        }
        Ok(read
            .into_iter()
            .map(|(name, recording, notes)| SegmentedRecording {
                notes,
                ..SegmentedRecording::new(name, recording, layers)
            })
            .collect())
    }

    fn read(&self, file: &Path) -> Result<Vec<(String, Recording, Vec<QualityNote>)>, DatasetError> {
        let name =
            file.file_name().map_or_else(|| file.display().to_string(), |n| n.to_string_lossy().into_owned());
        if self.split_by.is_empty() {
            let (recording, notes) = read_csv_skip_nonfinite(file, &self.options())?;
            return Ok(vec![(name, recording, notes)]);
        }
        let text = read_text_of(file)?;
        let mut lines = text.lines();
        let header = lines.next().unwrap_or_default();
        let columns: Vec<&str> = header.split(',').map(str::trim).collect();
        let mut places = Vec::new();
        for wanted in &self.split_by {
            let place = columns.iter().position(|c| c == wanted).ok_or_else(|| {
                DatasetError::TooLittle(format!(
                    "{}: there is no column {wanted:?} to split by; there are {}",
                    file.display(),
                    columns.join(", ")
                ))
            })?;
            places.push(place);
        }
        let mut groups: Vec<(String, String)> = Vec::new();
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let key =
                places.iter().map(|p| cells.get(*p).map_or("", |c| c.trim())).collect::<Vec<_>>().join(" ");
            let place = *known.entry(key).or_insert_with_key(|key| {
                groups.push((key.clone(), format!("{header}\n")));
                groups.len() - 1
            });
            groups[place].1.push_str(line);
            groups[place].1.push('\n');
        }
        let mut out = Vec::with_capacity(groups.len());
        for (key, text) in groups {
            let (recording, notes) = read_csv_bytes(text.as_bytes(), file, &self.options())?;
            out.push((key, recording, notes));
        }
        Ok(out)
    }
}

fn read_text_of(file: &Path) -> Result<String, DatasetError> {
    std::fs::read_to_string(file)
        .map_err(|source| RecordError::Unreadable { path: file.to_owned(), source }.into())
}

/// The folder of measured data.
#[must_use]
pub fn measured_folder() -> PathBuf {
    std::env::var_os("STYLET_MEASURED").map_or_else(|| PathBuf::from("../shared/measured"), PathBuf::from)
}

/// The files that match a name, sorted.
///
/// # Errors
/// [`DatasetError::NoFile`].
pub fn find_files(pattern: &str) -> Result<Vec<PathBuf>, DatasetError> {
    let folder = measured_folder();
    let whole = folder.join(pattern);
    let missing =
        || DatasetError::NoFile { pattern: pattern.to_owned(), folder: folder.display().to_string() };
    let last = whole.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if !last.contains('*') {
        return if whole.is_file() { Ok(vec![whole]) } else { Err(missing()) };
    }
    let place = whole.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let mut out: Vec<PathBuf> = std::fs::read_dir(&place)
        .map_err(|_| missing())?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.file_name().is_some_and(|n| matches(&last, &n.to_string_lossy())))
        .collect();
    out.sort();
    if out.is_empty() { Err(missing()) } else { Ok(out) }
}

/// Whether `name` is `pattern` with anything in place of each `*`.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = name.strip_prefix(first) else { return false };
    let parts: Vec<&str> = parts.collect();
    for (i, part) in parts.iter().enumerate() {
        if i + 1 == parts.len() {
            return rest.ends_with(part);
        }
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_anything() {
        assert!(matches("skin-on-muscle_*.csv", "skin-on-muscle_1mmps_run5.csv"));
        assert!(
            matches("*_run?.csv", "x_run?.csv") && matches("a*b*c", "a--b-b-c") && matches("same", "same")
        );
        // What stands last has to be the end, wherever else it stands.
        assert!(matches("a*b", "abxb") && matches("*.csv", "a.csv.csv"));
        // What stood for one piece does not stand for the next.
        assert!(matches("a*bb*b", "abbb") && !matches("a*bb*b", "abb"));
        assert!(!matches("skin_*.csv", "skin-on-muscle_1mmps_run5.csv") && !matches("a*b", "ac"));
    }

    const TEXT: &str = r#"Dataset(
        name: "two",
        tissue: (surface_m: 0.004, layers: [
            (name: "a", thickness_m: 0.011, stiffness_n_per_m: 300.0, friction_ns_per_m2: 10.0),
            (name: "b", thickness_m: 0.08, stiffness_n_per_m: 200.0, friction_ns_per_m2: 20.0),
        ]),
        parts: [(name: "a alone", layer: 2, recordings: ["x.csv"])],
        load: (file: "load.csv", force_n: 5.0),
    )"#;

    fn said(text: &str) -> String {
        Dataset::parse("set.ron", text).map_or_else(|e| e.to_string(), |d| format!("fine: {}", d.name))
    }

    #[test]
    fn a_description_is_checked_from_both_sides() {
        assert_eq!(said(TEXT), "fine: two");
        for (thickness, fine) in
            [("0.0", false), ("-0.1", false), ("1e-9", true), ("0.999", true), ("1.0", false), ("2.0", false)]
        {
            let text = said(&TEXT.replace("thickness_m: 0.08", &format!("thickness_m: {thickness}")));
            assert_eq!(text.starts_with("fine"), fine, "{thickness}: {text}");
            assert!(fine || text.contains("between 0 and 1 m"), "{text}");
        }
        for (layer, fine) in [(0, false), (1, true), (2, true), (3, false)] {
            let text = said(&TEXT.replace("layer: 2", &format!("layer: {layer}")));
            assert_eq!(text.starts_with("fine"), fine, "{layer}: {text}");
            assert!(fine || text.contains("layers 1 to 2"), "{text}");
        }
        for (force, fine) in [("0.0", false), ("-5.0", true), ("inf", false), ("NaN", false), ("1e-3", true)]
        {
            let text = said(&TEXT.replace("force_n: 5.0", &format!("force_n: {force}")));
            assert_eq!(text.starts_with("fine"), fine, "{force}: {text}");
        }
        let layer = r#"(name: "a", thickness_m: 0.011, stiffness_n_per_m: 300.0, friction_ns_per_m2: 10.0),"#;
        for (count, fine) in [(0, false), (1, true), (7, true), (8, false)] {
            let text = said(&format!(
                "Dataset(name: \"n\", tissue: (surface_m: 0.0, layers: [{}]))",
                layer.repeat(count)
            ));
            assert_eq!(text.starts_with("fine"), fine, "{count}: {text}");
            assert!(fine || text.contains(&format!("there are {count} layers")), "{text}");
        }
    }

    /// A folder of its own for a test, and gone after it.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let at = std::env::temp_dir().join(format!("stylet-dataset-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&at).expect("a folder");
            Self(at)
        }

        fn file(&self, name: &str, text: &str) -> PathBuf {
            let at = self.0.join(name);
            std::fs::write(&at, text).expect("a file");
            at
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_file_is_a_data_set_when_its_first_words_say_so() {
        let folder = Folder::new("kind");
        for (text, yes) in [
            ("// what it is\n\n  #![enable(implicit_some)]\n\tDataset(name: \"x\")", true),
            ("Scenario(name: \"Dataset\")", false),
            ("// Dataset\n(name: 1)", false),
            ("// nothing yet", false),
        ] {
            assert_eq!(is_dataset(&folder.file("a.ron", text)).ok(), Some(yes), "{text}");
        }
        assert!(is_dataset(&folder.0.join("nowhere.ron")).is_err());
        let loaded = Dataset::load(&folder.file("set.ron", TEXT)).expect("a data set");
        assert_eq!((loaded.name.as_str(), loaded.tissue.layers.len(), loaded.repair), ("two", 2, false));
        assert!(!loaded.options().repair);
        assert!(Dataset { repair: true, ..loaded }.options().repair);
    }

    #[test]
    fn files_are_found_by_their_names_sorted() {
        let folder = Folder::new("find");
        for name in ["b_2.csv", "b_1.csv", "a_1.csv", "b_3.txt"] {
            folder.file(name, "");
        }
        let names = |pattern: &str| -> Option<Vec<String>> {
            let whole = folder.0.join(pattern);
            let found = find_files(&whole.to_string_lossy()).ok()?;
            Some(
                found
                    .iter()
                    .filter_map(|f| f.file_name())
                    .map(|n| n.to_string_lossy().into_owned())
                    .collect(),
            )
        };
        assert_eq!(names("b_*.csv"), Some(vec!["b_1.csv".to_owned(), "b_2.csv".to_owned()]));
        assert_eq!(names("a_1.csv"), Some(vec!["a_1.csv".to_owned()]));
        assert_eq!((names("c_*.csv"), names("c_1.csv"), names("no/b_*.csv")), (None, None, None));
        let measured = std::env::var_os("STYLET_MEASURED");
        assert_eq!(super::measured_folder(), PathBuf::from(measured.unwrap_or("../shared/measured".into())));
        let text = find_files("no such file.csv").err().map(|e| e.to_string()).unwrap_or_default();
        assert!(text.contains("no file matches no such file.csv"), "{text}");
    }

    fn rows(of: impl Fn(usize) -> (String, f64)) -> String {
        let mut text = "specimen,time_s,position_m,force_n,side\n".to_owned();
        for k in 0..300 {
            let (key, f) = of(k);
            let at = (k / 2) as f64;
            let (specimen, side) = key.split_once(' ').unwrap_or((&key, ""));
            text += &format!("{specimen},{:.3},{:.6},{f:.6},{side}\n", 0.01 * at, 1e-4 * at);
        }
        text
    }

    #[test]
    fn specimens_in_one_file_are_told_apart_by_their_columns() {
        let folder = Folder::new("split");
        let file = folder.file(
            "all.csv",
            &rows(|k| {
                (
                    if k % 2 == 0 { "p left".to_owned() } else { "q right".to_owned() },
                    0.02 * (k / 2) as f64 + 0.001 * (k % 7) as f64,
                )
            }),
        );
        let set = Dataset {
            split_by: vec!["specimen".to_owned(), "side".to_owned()],
            ..Dataset::parse("set", TEXT).expect("a set")
        };
        let runs = set.load_recordings(std::slice::from_ref(&file), 2).expect("runs");
        assert_eq!(runs.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["p left", "q right"]);
        assert!(runs.iter().all(|r| r.recording.len() == 150 && r.ruptures_s.len() == 2));
        assert!(
            (runs[1].recording.force_n[3] - (0.02 * 3.0)).abs() < 1e-9,
            "{}",
            runs[1].recording.force_n[3]
        );
        let wrong = Dataset { split_by: vec!["colour".to_owned()], ..set.clone() };
        let text = wrong
            .load_recordings(std::slice::from_ref(&file), 2)
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default();
        assert!(text.contains("no column \"colour\"") && text.contains("specimen, time_s"), "{text}");
        assert!(set.load_recordings(&[folder.0.join("nowhere.csv")], 2).is_err());
        // Whole files have the file's name.
        let plain = Dataset { split_by: Vec::new(), ..set };
        let mut text = "time_s,position_m,force_n\n".to_owned();
        for k in 0..300 {
            let (z, noise) = (1e-4 * f64::from(k), 1e-3 * f64::from((k * 37) % 11));
            text +=
                &format!("{:.3},{z:.6},{:.6}\n", 0.01 * f64::from(k), 200.0 * (z - 0.004).max(0.0) + noise);
        }
        let one = folder.file("one.csv", &text);
        let runs = plain.load_recordings(&[one.clone(), one], 1).expect("runs");
        assert_eq!(runs.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["one.csv", "one.csv"]);
        assert_eq!((runs[0].recording.len(), runs[0].releases_m.len()), (300, 1));
        // What never touches anything is refused in a file of its own, and left to the study among specimens.
        let still: String = text
            .lines()
            .map(|l| {
                format!(
                    "{}\n",
                    l.split(',').take(2).map(|c| format!("{c},")).collect::<String>()
                        + if l.starts_with('t') { "force_n" } else { "0.5" }
                )
            })
            .collect();
        let still = folder.file("still.csv", &still);
        assert!(plain.load_recordings(std::slice::from_ref(&still), 1).is_err());
    }

    /// Of specimens in one file what is too short is left to the study; a fault of the sensor in all of them is not, nor is every remark a
    /// fault.
    #[test]
    fn specimens_that_are_all_unusable_are_refused_but_for_the_short_ones() {
        let folder = Folder::new("grave");
        let set =
            Dataset { split_by: vec!["specimen".to_owned()], ..Dataset::parse("set", TEXT).expect("a set") };
        let key = |k: usize| if k.is_multiple_of(2) { "p".to_owned() } else { "q".to_owned() };
        let rising = rows(|k| (key(k), 0.02 * (k / 2) as f64 + 0.001 * (k % 7) as f64));
        let short: Vec<&str> = rising.lines().take(61).collect();
        let gap: Vec<&str> =
            rising.lines().enumerate().filter(|(k, _)| !(100..160).contains(k)).map(|l| l.1).collect();
        for (name, text, count) in [
            ("dead", rows(|k| (key(k), 0.5)), None),
            ("short", short.join("\n"), Some(2)),
            ("gap", gap.join("\n"), Some(2)),
        ] {
            let file = folder.file(&format!("{name}.csv"), &text);
            let told = set.load_recordings(&[file], 2).ok();
            assert_eq!(told.as_ref().map(Vec::len), count, "{name}");
            assert!(told.is_none_or(|runs| runs.iter().all(|r| !r.notes.is_empty())), "{name}");
        }
    }
}
