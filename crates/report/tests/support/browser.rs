//! A headless browser, if this machine has one: opens a file, gives its DOM and a screenshot.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

/// A folder of this test alone, removed at the end.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(name: &str) -> Self {
        let path = env::temp_dir().join(format!("stylet-report-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder for temporary files");
        Self(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// `$CHROME`, or the first of the usual names that starts.
pub fn find() -> Option<PathBuf> {
    let named = env::var_os("CHROME").map(PathBuf::from);
    let usual = ["chromium", "chromium-browser", "google-chrome"].map(PathBuf::from);
    named.into_iter().chain(usual).find(|program| {
        let probe =
            Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        probe.is_ok_and(|status| status.success())
    })
}

fn run(program: &Path, scratch: &Scratch, name: &str, arguments: &[String]) -> String {
    let profile = scratch.path().join(format!("profile-{name}"));
    let out_path = scratch.path().join(format!("{name}.out"));
    let out = fs::File::create(&out_path).expect("a file for the browser's output");
    let mut child = Command::new(program)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args([
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--hide-scrollbars",
        ])
        .args(["--force-device-scale-factor=1", "--virtual-time-budget=5000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(arguments)
        .stdout(out)
        .stderr(Stdio::null())
        .spawn()
        .expect("the browser starts");
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("the browser can be waited for") {
            break status;
        }
        let late = begin.elapsed() > Duration::from_secs(120);
        if late {
            let _ = child.kill();
            let _ = child.wait();
        }
        assert!(!late, "the browser did not finish {name} within 120 s");
        thread::sleep(Duration::from_millis(50));
    };
    assert!(status.success(), "the browser failed on {name}: {status}");
    fs::read_to_string(out_path).expect("the browser prints UTF-8")
}

/// The DOM of the page after its self-test.
pub fn dump_dom(program: &Path, scratch: &Scratch, name: &str, page: &Path) -> String {
    let address = format!("file://{}#selftest", page.display());
    run(program, scratch, name, &["--window-size=1280,1600".into(), "--dump-dom".into(), address])
}

/// Pixels of a screenshot as RGB triples.
pub fn screenshot(program: &Path, scratch: &Scratch, name: &str, page: &Path) -> Vec<[u8; 3]> {
    let picture = scratch.path().join(format!("{name}.png"));
    let arguments = [
        "--window-size=1280,3000".into(),
        format!("--screenshot={}", picture.display()),
        format!("file://{}", page.display()),
    ];
    run(program, scratch, name, &arguments);
    let file = std::io::BufReader::new(fs::File::open(&picture).expect("the browser wrote the screenshot"));
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().expect("a PNG");
    let mut data = vec![0; reader.output_buffer_size().expect("a picture that fits in memory")];
    let frame = reader.next_frame(&mut data).expect("a whole PNG");
    let channels = frame.color_type.samples();
    data[..frame.buffer_size()].chunks_exact(channels).map(|p| [p[0], p[1], p[2]]).collect()
}
