//! `stylet studio` writes the bytes that the commands in its drawer write, and removes its temporary folder.
#![cfg(feature = "studio")]

use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const STYLET: &str = env!("CARGO_BIN_EXE_stylet");
const ASSUMED: &str = r#"Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Move(velocity_mps: 0.004, duration_s: 5.0), Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    robot: Replay,
)"#;

/// The running command.
struct Studio {
    child: Child,
    host: String,
    base: String,
}

impl Studio {
    fn start(folder: &Path, temporary: &Path, files: &[&str]) -> Self {
        let mut child = Command::new(STYLET)
            .current_dir(folder)
            .env("TMPDIR", temporary)
            .args(["studio", "--no-open", "--out", "w"])
            .args(files)
            .stdout(Stdio::piped())
            .spawn()
            .expect("stylet starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("the address");
        let url = line.split("http://").nth(1).expect("an address").trim();
        let (host, token) = url.split_once('/').expect("a path");
        Self { child, host: host.to_owned(), base: format!("/{}", token.trim_end_matches('/')) }
    }

    fn call(&self, name: &str, body: &Value) -> Value {
        let body = body.to_string();
        let mut stream = TcpStream::connect(&self.host).expect("a connection");
        write!(
            stream,
            "POST {}/api/{name} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
            self.base,
            self.host,
            body.len()
        )
        .expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        let (head, body) = answer.split_once("\r\n\r\n").expect("head and body");
        assert!(head.starts_with("HTTP/1.1 200"), "{name}: {answer}");
        serde_json::from_str(body).expect("JSON")
    }

    fn wait_for_job(&self) {
        let begin = Instant::now();
        loop {
            let job = self.call("job", &json!({}));
            match job["state"].as_str() {
                Some("running") => assert!(begin.elapsed() < Duration::from_secs(300), "{job}"),
                Some("done") => return,
                _ => panic!("{job}"),
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends it as Ctrl-C does.
    #[cfg(unix)]
    fn interrupt(mut self) {
        let id = nix::unistd::Pid::from_raw(i32::try_from(self.child.id()).expect("an id"));
        nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT).expect("a signal");
        assert!(self.child.wait().expect("its end").success());
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs a line of the drawer with another output folder.
fn repeat(line: &str, folder: &Path, out: &str) {
    let (line, _) = line.rsplit_once(" --out ").expect("an output folder");
    let words = line.strip_prefix("stylet ").expect("a command").split(' ');
    let status = Command::new(STYLET).current_dir(folder).args(words).args(["--out", out, "-q"]).status();
    assert!(status.expect("stylet starts").success(), "{line}");
}

#[test]
#[cfg(unix)]
fn the_commands_of_the_drawer_give_the_bytes_that_the_page_wrote() {
    let folder = std::env::temp_dir().join(format!("stylet-studio-bytes-{}", std::process::id()));
    let temporary = folder.join("temporary");
    fs::create_dir_all(&temporary).expect("a folder");
    let hidden = ASSUMED.replace("motion:", "effects: [CoulombFriction(c_n_per_m: 3.0)],\n motion:");
    fs::write(folder.join("real.ron"), hidden).expect("written");
    repeat("stylet run real.ron --seed 3 --out x", &folder, "measured");
    let studio = Studio::start(&folder, &temporary, &["measured/recording.csv"]);
    assert_eq!(fs::read_dir(&temporary).expect("readable").count(), 1, "a folder for uploads");
    studio.call("edit", &json!({"edit": {"kind": "ron", "text": ASSUMED}}));
    studio.call("run", &json!({}));
    studio.call("enhance", &json!({"file": "recording.csv", "algorithms": ["Paper"]}));
    studio.call("diagnose", &json!({"files": ["recording.csv"]}));
    studio.wait_for_job();
    let state = studio.call("state", &json!({}));
    assert!(
        state["diagnosis"]["sentence"].as_str().is_some_and(|s| s.contains("lacks")),
        "{}",
        state["diagnosis"]
    );
    let commands = state["commands"].as_array().expect("commands");
    assert_eq!(commands.len(), 3, "{commands:?}");
    for (command, written, file) in [
        (0, "w/simulation", "score.json"),
        (0, "w/simulation", "recording.csv"),
        (1, "w/enhanced-recording", "enhanced.csv"),
        (2, "w/diagnosis", "diagnosis.json"),
        (2, "w/diagnosis", "extended.ron"),
    ] {
        let again = format!("again-{command}");
        if !folder.join(&again).exists() {
            repeat(commands[command]["shell"].as_str().expect("a line"), &folder, &again);
        }
        let read = |path: String| fs::read(folder.join(path)).expect("a result");
        assert!(read(format!("{written}/{file}")) == read(format!("{again}/{file}")), "{file} differs");
    }
    studio.interrupt();
    assert_eq!(fs::read_dir(&temporary).expect("readable").count(), 0, "the folder for uploads is gone");
    // The workspace opens again.
    let studio = Studio::start(&folder, &temporary, &[]);
    let again = studio.call("state", &json!({}));
    assert_eq!(again["diagnosis"]["sentence"], state["diagnosis"]["sentence"]);
    assert_eq!(again["phantom"]["ron"], state["phantom"]["ron"]);
    assert_eq!(again["files"], json!(["recording.csv"]));
    drop(studio);
    let _ = fs::remove_dir_all(folder);
}
