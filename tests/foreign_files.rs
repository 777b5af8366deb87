//! Promise: no command replaces a file that Stylet did not write, or one of its own inputs; the refusal names the file, and nothing is
//! changed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A short scenario with a comment that is worth keeping.
const SCENARIO: &str = r#"// my own notes
Scenario(
    name: "gel",
    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 8.0),
    robot: Replay,
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.4)]),
)
"#;

/// A folder of its own, removed afterwards.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("stylet-foreign-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        let scratch = Self(folder);
        scratch.write("gel.ron", SCENARIO);
        scratch
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, text).expect("written");
        path
    }

    fn text(&self, name: &str) -> String {
        String::from_utf8_lossy(&fs::read(self.0.join(name)).expect("a file")).into_owned()
    }

    fn stylet(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_stylet")).args(args).current_dir(&self.0).output().expect("it runs")
    }

    fn succeeds(&self, args: &[&str]) {
        let output = self.stylet(args);
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    }

    /// The command ends with 2, names the file, and leaves it as it is.
    fn is_refused(&self, args: &[&str], file: &str) {
        let snapshot = || list(&self.0).into_iter().map(|p| (fs::read(&p).ok(), p)).collect::<Vec<_>>();
        let before = snapshot();
        let output = self.stylet(args);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.replace(['\n', ' ', '│'], "").contains(file), "{args:?} names {file}: {stderr}");
        assert!(snapshot() == before, "{args:?} changes no file and leaves no other");
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// All paths below a folder.
fn list(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        if entry.path().is_dir() {
            all.extend(list(&entry.path()));
        }
        all.push(entry.path());
    }
    all.sort();
    all
}

#[test]
fn a_run_replaces_neither_its_scenario_nor_a_measured_recording() {
    let scratch = Scratch::new("run");
    scratch.write("scenario.ron", SCENARIO);
    scratch.is_refused(&["run", "scenario.ron", "--out", "."], "scenario.ron");
    scratch.write("m/recording.csv", "time_s,position_m,force_n\n0,0,0\n1,1,1\n");
    scratch.is_refused(&["run", "gel.ron", "--out", "m"], "recording.csv");
    scratch.write("x/manifest.json", "{\"name\": \"a web page\"}");
    scratch.is_refused(&["run", "gel.ron", "--out", "x"], "manifest.json");
    // What Stylet wrote itself is replaced, and foreign files beside it stay.
    scratch.write("own/notes.txt", "mine");
    for seed in ["1", "2"] {
        scratch.succeeds(&["run", "gel.ron", "--seed", seed, "--out", "own"]);
    }
    assert_eq!(scratch.text("own/notes.txt"), "mine");
    // The scenario of a run is repeated in place, but not changed.
    scratch.succeeds(&["run", "own/scenario.ron", "--out", "own"]);
    scratch.is_refused(&["run", "own/scenario.ron", "--seed", "9", "--out", "own"], "own/scenario.ron");
}

#[test]
fn a_set_of_another_command_is_refused_before_and_after() {
    let scratch = Scratch::new("mixed");
    scratch.succeeds(&["run", "gel.ron", "--out", "a"]);
    scratch.is_refused(&["enhance", "a/recording.csv", "--out", "a"], "score.json");
    scratch.write("b/enhanced.csv", "mine");
    scratch.is_refused(&["enhance", "a/recording.csv", "--out", "b"], "enhanced.csv");
}

#[test]
fn two_inputs_of_one_name_do_not_share_a_default_folder() {
    let scratch = Scratch::new("default");
    for folder in ["p-q", "p/q"] {
        scratch.succeeds(&["run", "gel.ron", "--out", folder]);
    }
    let default = "stylet-out/p-q-recording";
    scratch.succeeds(&["enhance", "p/q/recording.csv"]);
    scratch.succeeds(&["enhance", "./p/q/recording.csv"]);
    let before = scratch.text(&format!("{default}/enhance.json"));
    let output = scratch.stylet(&["enhance", "p-q/recording.csv"]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains(default) && stderr.contains("p/q/recording.csv"), "{stderr}");
    assert_eq!(scratch.text(&format!("{default}/enhance.json")), before);
    scratch.write("other/gel.ron", SCENARIO);
    scratch.succeeds(&["run", "gel.ron"]);
    let output = scratch.stylet(&["run", "other/gel.ron"]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr.contains("stylet-out/gel") && stderr.contains("gel.ron") && stderr.contains("--out"),
        "{stderr}"
    );
}

#[test]
fn a_converted_recording_replaces_no_file() {
    let scratch = Scratch::new("convert");
    scratch.succeeds(&["run", "gel.ron", "--out", "a"]);
    scratch.write("p.csv", "mine");
    scratch.is_refused(&["convert", "a/recording.csv", "p.csv"], "p.csv");
    fs::copy(scratch.0.join("a/recording.csv"), scratch.0.join("with_truth.csv")).expect("copied");
    scratch.is_refused(&["convert", "with_truth.csv", "with_truth.csv"], "with_truth.csv");
    scratch.succeeds(&["convert", "a/recording.csv", "new.csv"]);
    // Repeating it changes nothing.
    scratch.succeeds(&["convert", "a/recording.csv", "new.csv"]);
    // A device is written to, not replaced.
    #[cfg(unix)]
    {
        let link = scratch.0.join("null.csv");
        std::os::unix::fs::symlink("/dev/null", &link).expect("a link");
        scratch.succeeds(&["convert", "a/recording.csv", "null.csv", "--quiet"]);
        assert!(fs::symlink_metadata(link).expect("a link").is_symlink());
    }
}

#[test]
fn a_plan_replaces_only_plans() {
    let scratch = Scratch::new("plan");
    let program = SCENARIO.replace(
        "Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 8.0)",
        "Program(start_m: -0.005, segments: [Move(velocity_mps: 0.002, duration_s: 8.0)])",
    );
    scratch.write("p.ron", &program);
    scratch.write(
        "limits.ron",
        "Limits(depth_m: 0.02, speed_mps: 0.01, acceleration_mps2: 0.1, duration_s: 20.0, force_n: 5.0)",
    );
    for (name, out) in [("q.ron", "q.ron"), ("r.json", "r.ron"), ("s.html", "s.ron")] {
        scratch.write(name, "mine");
        scratch.is_refused(&["plan", "p.ron", "--limits", "limits.ron", "--quick", "--out", out], name);
    }
    scratch.is_refused(&["plan", "p.ron", "--limits", "limits.ron", "--quick", "--out", "p.ron"], "p.ron");
    scratch.is_refused(
        &["plan", "p.ron", "--limits", "limits.ron", "--quick", "--out", "limits.ron"],
        "limits.ron",
    );
}

#[test]
fn a_merged_sweep_removes_its_shards_only() {
    let scratch = Scratch::new("sweep");
    scratch.write("s.ron", "Sweep(scenario: \"gel.ron\", trials: 4, seed: 1, vary: [(path: \"tissue.layers[0].stiffness_n_per_m\", with: Uniform(40.0, 60.0))])");
    let reference = scratch.stylet(&["sweep", "s.ron", "--out", "probe", "--quiet"]);
    assert!(reference.status.success(), "{}", String::from_utf8_lossy(&reference.stderr));
    for shard in ["1/2", "2/2"] {
        scratch.succeeds(&["sweep", "run-shard", shard, "s.ron", "--out", "w"]);
    }
    scratch.write("w/shards/README", "mine");
    scratch.write("w/shards/notes.shard", "mine too");
    scratch.succeeds(&["sweep", "merge", "s.ron", "--out", "w"]);
    assert_eq!(
        (scratch.text("w/shards/README"), scratch.text("w/shards/notes.shard")),
        ("mine".into(), "mine too".into())
    );
    assert_eq!(fs::read_dir(scratch.0.join("w/shards")).expect("a folder").count(), 2);
    scratch.write("v/trials.csv", "mine");
    scratch.is_refused(&["sweep", "s.ron", "--out", "v"], "trials.csv");
}
