use super::*;

#[test]
fn a_star_matches_any_text() {
    assert!(matches("skin-on-muscle_*.csv", "skin-on-muscle_1mmps_run5.csv"));
    assert!(matches("*_run?.csv", "x_run?.csv") && matches("a*b*c", "a--b-b-c") && matches("same", "same"));
    assert!(matches("a*b", "abxb") && matches("*.csv", "a.csv.csv"));
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

fn outcome(text: &str) -> String {
    Dataset::parse("set.ron", text).map_or_else(|e| e.to_string(), |d| format!("fine: {}", d.name))
}

#[test]
fn a_description_is_validated_at_both_limits() {
    assert_eq!(outcome(TEXT), "fine: two");
    for (thickness, fine) in
        [("0.0", false), ("-0.1", false), ("1e-9", true), ("0.999", true), ("1.0", false), ("2.0", false)]
    {
        let text = outcome(&TEXT.replace("thickness_m: 0.08", &format!("thickness_m: {thickness}")));
        assert_eq!(text.starts_with("fine"), fine, "{thickness}: {text}");
        assert!(fine || text.contains("between 0 and 1 m"), "{text}");
    }
    for (layer, fine) in [(0, false), (1, true), (2, true), (3, false)] {
        let text = outcome(&TEXT.replace("layer: 2", &format!("layer: {layer}")));
        assert_eq!(text.starts_with("fine"), fine, "{layer}: {text}");
        assert!(fine || text.contains("layers 1 to 2"), "{text}");
    }
    for (force, fine) in [("0.0", false), ("-5.0", true), ("inf", false), ("NaN", false), ("1e-3", true)] {
        let text = outcome(&TEXT.replace("force_n: 5.0", &format!("force_n: {force}")));
        assert_eq!(text.starts_with("fine"), fine, "{force}: {text}");
    }
    let layer = r#"(name: "a", thickness_m: 0.011, stiffness_n_per_m: 300.0, friction_ns_per_m2: 10.0),"#;
    for (count, fine) in [(0, false), (1, true), (7, true), (8, false)] {
        let text = outcome(&format!(
            "Dataset(name: \"n\", tissue: (surface_m: 0.0, layers: [{}]))",
            layer.repeat(count)
        ));
        assert_eq!(text.starts_with("fine"), fine, "{count}: {text}");
        assert!(fine || text.contains(&format!("there are {count} layers")), "{text}");
    }
}

/// Temporary folder, removed on drop.
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
fn a_data_set_is_recognised_by_its_first_word() {
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
fn matching_files_are_sorted() {
    let folder = Folder::new("find");
    for name in ["b_2.csv", "b_1.csv", "a_1.csv", "b_3.txt"] {
        folder.file(name, "");
    }
    let names = |pattern: &str| -> Option<Vec<String>> {
        let whole = folder.0.join(pattern);
        let found = find_files(&whole.to_string_lossy()).ok()?;
        Some(found.iter().filter_map(|f| f.file_name()).map(|n| n.to_string_lossy().into_owned()).collect())
    };
    assert_eq!(names("b_*.csv"), Some(vec!["b_1.csv".to_owned(), "b_2.csv".to_owned()]));
    assert_eq!(names("a_1.csv"), Some(vec!["a_1.csv".to_owned()]));
    assert_eq!((names("c_*.csv"), names("c_1.csv"), names("no/b_*.csv")), (None, None, None));
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
fn specimens_in_one_file_are_split_by_columns() {
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
    let recordings = set.load_recordings(std::slice::from_ref(&file), 2).expect("runs");
    assert_eq!(recordings.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["p left", "q right"]);
    assert!(recordings.iter().all(|r| r.recording.len() == 150 && r.ruptures_s.len() == 2));
    assert!(
        (recordings[1].recording.force_n[3] - (0.02 * 3.0)).abs() < 1e-9,
        "{}",
        recordings[1].recording.force_n[3]
    );
    let wrong = Dataset { split_by: vec!["colour".to_owned()], ..set.clone() };
    let text = wrong
        .load_recordings(std::slice::from_ref(&file), 2)
        .err()
        .map(|e| e.to_string())
        .unwrap_or_default();
    assert!(text.contains("no column \"colour\"") && text.contains("\"specimen\", \"time_s\""), "{text}");
    assert!(set.load_recordings(&[folder.0.join("nowhere.csv")], 2).is_err());
    let plain = Dataset { split_by: Vec::new(), ..set };
    let mut text = "time_s,position_m,force_n\n".to_owned();
    for k in 0..300 {
        let (z, noise) = (1e-4 * f64::from(k), 1e-3 * f64::from((k * 37) % 11));
        text += &format!("{:.3},{z:.6},{:.6}\n", 0.01 * f64::from(k), 200.0 * (z - 0.004).max(0.0) + noise);
    }
    let one = folder.file("one.csv", &text);
    let recordings = plain.load_recordings(&[one.clone(), one], 1).expect("runs");
    assert_eq!(recordings.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["one.csv", "one.csv"]);
    assert_eq!((recordings[0].recording.len(), recordings[0].releases_m.len()), (300, 1));
    // A recording that never touches is refused as a file and accepted among specimens.
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

#[test]
fn a_file_of_unusable_specimens_is_refused() {
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
        let result = set.load_recordings(&[file], 2).ok();
        assert_eq!(result.as_ref().map(Vec::len), count, "{name}");
        assert!(result.is_none_or(|recordings| recordings.iter().all(|r| !r.notes.is_empty())), "{name}");
    }
}
