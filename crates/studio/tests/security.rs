//! What does not come from the page is refused, and the server stays alive.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stylet_studio::{Server, Studio};

/// A server with a new workspace, and its address.
struct Running {
    server: Option<Server>,
    folder: PathBuf,
    host: String,
    base: String,
}

impl Running {
    fn start(name: &str) -> Self {
        let folder =
            std::env::temp_dir().join(format!("stylet-studio-security-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let studio = Studio::open(&folder, &[] as &[PathBuf]).expect("a new workspace");
        let server = Server::start(studio, 0).expect("a server");
        let url = server.url();
        let (host, token) = url.trim_start_matches("http://").split_once('/').expect("a path");
        Self {
            host: host.to_owned(),
            base: format!("/{}", token.trim_end_matches('/')),
            server: Some(server),
            folder,
        }
    }

    /// Status and whole text of the answer to a request with these further header lines.
    fn send(&self, head: &str, headers: &[&str], body: &[u8]) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.host).expect("a connection");
        let host = format!("Host: {}", self.host);
        let own_host =
            if headers.iter().any(|h| h.starts_with("Host:")) { None } else { Some(host.as_str()) };
        let mut text = format!("{head} HTTP/1.1\r\nConnection: close\r\n");
        for line in own_host.iter().chain(headers) {
            text += &format!("{line}\r\n");
        }
        if !headers.iter().any(|h| h.starts_with("Content-Length") || h.starts_with("Transfer")) {
            text += &format!("Content-Length: {}\r\n", body.len());
        }
        text += "\r\n";
        // A server that refuses may close before it has read everything.
        let _ = stream.write_all(text.as_bytes()).and_then(|()| stream.write_all(body));
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        (status, answer)
    }

    fn page(&self) -> (u16, String) {
        self.send(&format!("GET {}/", self.base), &[], b"")
    }

    fn call(&self, name: &str, body: &str) -> (u16, String) {
        self.send(&format!("POST {}/api/{name}", self.base), &[], body.as_bytes())
    }

    fn upload(&self, name: &str, content: &[u8]) -> (u16, String) {
        self.send(&format!("POST {}/upload/{name}", self.base), &[], content)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.server.take());
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

const RECORDING: &[u8] =
    b"time_s,position_m,force_n\n0.00,0.000,0.0\n0.01,0.002,0.1\n0.02,0.004,0.2\n0.03,0.006,0.3\n";

#[test]
fn a_foreign_host_origin_or_token_is_refused() {
    let running = Running::start("foreign");
    assert_eq!(running.page().0, 200);
    let page = format!("GET {}/", running.base);
    let port = running.host.rsplit(':').next().expect("a port");
    for (head, header) in [
        (page.as_str(), "Host: evil.example"),
        (page.as_str(), "Host: evil.example:80"),
        // A name of an attacker that resolves to this computer.
        (page.as_str(), &format!("Host: evil.example:{port}")),
        (page.as_str(), "Host: 127.0.0.1:1"),
        (page.as_str(), "Host:"),
        (page.as_str(), "Origin: http://evil.example"),
        (page.as_str(), "Origin: null"),
        (page.as_str(), &format!("Origin: https://{}", running.host)),
        ("GET /", "X: y"),
        ("GET /index.html", "X: y"),
        ("POST /api/state", "X: y"),
        ("GET /00000000000000000000000000000000/", "X: y"),
        (&page[..page.len() - 2], "X: y"),
    ] {
        let (status, answer) = running.send(head, &[header], b"");
        let expected = if header.starts_with("Host") { 421 } else { 403 };
        assert_eq!(status, expected, "{head} {header}");
        assert!(!answer.contains("phantom") && !answer.contains(&running.base), "{head} {header}: {answer}");
    }
    let mut unnamed = TcpStream::connect(&running.host).expect("a connection");
    write!(unnamed, "{page} HTTP/1.0\r\n\r\n").expect("sent");
    let mut answer = String::new();
    let _ = unnamed.read_to_string(&mut answer);
    assert!(answer.contains(" 421 "), "without Host: {answer}");
    let own = format!("Origin: http://{}", running.host);
    assert_eq!(running.send(&format!("POST {}/api/state", running.base), &[&own], b"{}").0, 200);
}

#[test]
fn the_page_may_load_nothing_but_its_own_files() {
    let running = Running::start("policy");
    let (_, answer) = running.page();
    let head = answer.split("\r\n\r\n").next().unwrap_or_default().to_lowercase();
    for needed in [
        "default-src 'none'",
        "script-src 'self'",
        "connect-src 'self'",
        "nosniff",
        "no-referrer",
        "no-store",
    ] {
        assert!(head.contains(needed), "{needed} in {head}");
    }
    assert!(!head.contains("unsafe"), "{head}");
    assert!(!answer.contains("onclick=") && !answer.contains("<style"), "no inline script or style");
    for name in ["app.js", "chart.js", "style.css", "uplot.js"] {
        let (status, answer) = running.send(&format!("GET {}/{name}", running.base), &[], b"");
        assert_eq!(status, 200, "{name}");
        assert!(!answer.contains("innerHTML") || name == "uplot.js", "{name} makes elements from text");
    }
}

#[test]
fn nothing_outside_the_workspace_is_read() {
    let running = Running::start("traversal");
    assert_eq!(running.upload("a.csv", RECORDING).0, 200);
    let secret = running.folder.with_extension("secret");
    std::fs::write(&secret, "secret").expect("a file outside");
    #[cfg(unix)]
    std::os::unix::fs::symlink(&secret, running.folder.join("data").join("link")).expect("a link");
    let name = secret.file_name().expect("a name").to_string_lossy().into_owned();
    for path in [
        format!("file/../{name}"),
        format!("file/data/../../{name}"),
        format!("file/%2e%2e/{name}"),
        format!("file/data/..%2f..%2f{name}"),
        format!("file/..%5c/{name}"),
        "file/data/link".to_owned(),
        "file/etc/passwd".to_owned(),
        "file/%2fetc/passwd".to_owned(),
        "..%2f..%2fetc%2fpasswd".to_owned(),
        "file/.hidden/x".to_owned(),
    ] {
        let (status, answer) = running.send(&format!("GET {}/{path}", running.base), &[], b"");
        assert!(status == 404 || status == 403, "{path}: {status}");
        assert!(!answer.contains("secret") && !answer.contains("root:"), "{path}: {answer}");
    }
    assert_eq!(running.send(&format!("GET {}/file/data/a.csv", running.base), &[], b"").0, 200);
    for (message, body) in [
        ("inspect", r#"{"file":"../x"}"#),
        ("look", r#"{"file":"/etc/passwd","algorithms":["Stylet"]}"#),
        ("remove", r#"{"file":"../../x"}"#),
        ("diagnose", r#"{"files":["../x"]}"#),
    ] {
        let (status, answer) = running.call(message, body);
        assert_eq!(status, 422, "{message}");
        assert!(answer.contains("has no recording"), "{answer}");
    }
    // An upload cannot choose its folder.
    assert_eq!(running.upload("..%2f..%2fescaped.csv", RECORDING).0, 200);
    assert!(running.folder.join("data").join("escaped.csv").exists());
    let _ = std::fs::remove_file(secret);
}

#[test]
fn script_in_names_is_kept_as_text_and_does_not_reach_file_names() {
    let running = Running::start("script");
    let (status, answer) = running.upload("%3Cscript%3Ealert(1)%3C%2Fscript%3E.csv", RECORDING);
    assert_eq!(status, 200, "{answer}");
    for entry in std::fs::read_dir(running.folder.join("data")).expect("the folder").flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        assert!(!name.contains(['<', '>', '(', '"', '\'', '&']), "{name}");
    }
    let edit = r#"{"edit":{"kind":"layer_name","layer":0,"name":"<img src=x onerror=alert(1)>"}}"#;
    let (status, answer) = running.call("edit", edit);
    assert_eq!(status, 200);
    assert!(answer.contains("content-type: application/json"), "JSON is never shown as a page");
    let edit = r#"{"edit":{"kind":"name","name":"<img src=x onerror=alert(2)>"}}"#;
    assert_eq!(running.call("edit", edit).0, 200);
    let (_, answer) = running.call("save", "{}");
    for number in [1, 2] {
        assert!(
            answer.contains(&format!("<img src=x onerror=alert({number})>")),
            "names are kept as they are"
        );
    }
    // A column that is not used, and one that is.
    let columns = RECORDING.to_vec();
    let columns =
        String::from_utf8(columns).expect("text").replace(",force_n", ",<script>alert(3)</script> force [N]");
    let (status, answer) = running.upload("columns.csv", columns.as_bytes());
    assert_eq!(status, 200, "{answer}");
    assert!(
        answer.contains("content-type: application/json") && answer.contains("<script>alert(3)"),
        "{answer}"
    );
    // A report may run its own scripts, but in a sandbox.
    assert_eq!(running.call("run", "{}").0, 200);
    let (_, answer) = running.send(&format!("GET {}/file/simulation/report.html", running.base), &[], b"");
    assert!(answer.contains("content-security-policy: sandbox"), "{}", &answer[..600]);
    assert!(!answer.contains("<img src=x onerror"), "the report escapes the names");
    let look = r#"{"file":"columns.csv","algorithms":["Stylet"]}"#;
    let (status, answer) = running.call("enhance", look);
    assert_eq!(status, 200, "{answer}");
    let (_, answer) =
        running.send(&format!("GET {}/file/enhanced-columns/report.html", running.base), &[], b"");
    assert!(!answer.contains("<script>alert(3)"), "the report escapes the column");
}

#[test]
fn an_upload_of_10_gb_and_a_message_of_2_mb_are_refused() {
    let running = Running::start("large");
    let upload = format!("POST {}/upload/a.csv", running.base);
    assert_eq!(running.send(&upload, &["Content-Length: 10737418240"], b"time_s").0, 413);
    let (status, _) = running.call("state", &" ".repeat(2 << 20));
    assert_eq!(status, 413);
    assert_eq!(running.call("state", "{}").0, 200);
    assert!(!running.folder.join("data").join("a.csv").exists());
}

#[test]
fn an_upload_without_a_length_is_cut_off_at_its_limit() {
    let running = Running::start("endless");
    let mut stream = TcpStream::connect(&running.host).expect("a connection");
    let head = format!(
        "POST {}/upload/a.csv HTTP/1.1\r\nHost: {}\r\nTransfer-Encoding: chunked\r\n\r\n",
        running.base, running.host
    );
    stream.write_all(head.as_bytes()).expect("sent");
    let piece = [b"100000\r\n".as_slice(), &vec![b'1'; 1 << 20], b"\r\n"].concat();
    let sent_mb = (0..2000).take_while(|_| stream.write_all(&piece).is_ok()).count();
    assert!((500..600).contains(&sent_mb), "{sent_mb} MB were taken");
    assert_eq!(running.call("state", "{}").0, 200);
    assert!(!running.folder.join("data").join("a.csv").exists());
}

#[test]
fn messages_that_are_not_understood_are_answered_with_a_reason() {
    let running = Running::start("invalid");
    for (name, body, words) in [
        ("nothing", "{}", "no message"),
        ("edit", "{", "invalid"),
        ("edit", r#"{"edit":{"kind":"face","face":99,"depth_mm":1.0}}"#, "no such face"),
        (
            "edit",
            r#"{"edit":{"kind":"layer","layer":0,"field":"stiffness","to":{"text":"much"}}}"#,
            "is no number",
        ),
        (
            "edit",
            r#"{"edit":{"kind":"layer","layer":0,"field":"stiffness","to":{"text":"-5"}}}"#,
            "stiffness",
        ),
        ("edit", r#"{"edit":{"kind":"ron","text":"Scenario(nam: 1)"}}"#, "phantom.ron"),
        (
            "plan",
            r#"{"files":[],"limits":{"depth_mm":1e400,"speed_mm_per_s":1,"acceleration_mm_per_s2":1,"duration_s":1,"force_n":1}}"#,
            "invalid",
        ),
    ] {
        let (status, answer) = running.call(name, body);
        assert_eq!(status, 422, "{name} {body}");
        assert!(answer.contains(words), "{words} in {answer}");
    }
    assert_eq!(running.call("state", "{}").0, 200);
}

#[test]
fn a_thousand_slow_connections_do_not_stop_the_page() {
    let running = Running::start("slow");
    // Each sends half a head and waits; the first ones are cut off while the last ones connect.
    let mut slow = Vec::new();
    for _ in 0..1000 {
        if let Ok(mut stream) = TcpStream::connect(&running.host) {
            let _ = stream.write_all(format!("GET {}/ HTTP/1.1\r\nHost:", running.base).as_bytes());
            slow.push(stream);
        }
    }
    assert!(slow.len() > 900, "{} connections", slow.len());
    let begin = Instant::now();
    assert_eq!(running.page().0, 200);
    assert!(begin.elapsed() < Duration::from_secs(20), "answered after {:?}", begin.elapsed());
}
