//! Promise: `stylet listen` loses no sample, gives the outputs of the core, and is not slowed by a stalled subscriber. The long
//! form (60 s at 1 kHz, a browser connection that stalls for 10 s):
//! `cargo test --release --test listen -- --ignored --nocapture`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use stylet::{EnhanceConfig, Enhancer, Sample};

fn sample(k: u64) -> Sample {
    let time_s = k as f64 * 1e-3;
    let position_m = -0.004 + 0.0023 * time_s;
    let inside = (position_m.max(0.0)) % 0.03;
    let noise = 0.01 * (12.9898 * k as f64).sin();
    let force_n = if position_m > 0.0 { 60.0 * inside + 20.0 * position_m } else { 0.0 } + noise;
    Sample { time_s, position_m, velocity_mps: 0.0023, force_n }
}

fn line(s: &Sample) -> String {
    format!("{:?},{:?},{:?},{:?}", s.time_s, s.position_m, s.force_n, s.velocity_mps)
}

fn listen(args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_stylet"))
        .arg("listen")
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts")
}

#[test]
fn lines_from_standard_input_give_the_outputs_of_the_core() {
    let mut child = listen(&["--stdin"]);
    let mut stdin = child.stdin.take().expect("a pipe");
    let feeder = std::thread::spawn(move || {
        writeln!(stdin, "time_s,position_m,force_n,velocity_mps").expect("written");
        for k in 0..5000 {
            writeln!(stdin, "{}", line(&sample(k))).expect("written");
        }
        writeln!(stdin, "1,2").expect("written");
    });
    let output = child.wait_with_output().expect("it ends");
    feeder.join().expect("fed");
    assert!(output.status.success());
    let mut core = Enhancer::new(EnhanceConfig::default(), 0.0, vec![Sample::default(); 1 << 16]);
    let text = String::from_utf8_lossy(&output.stdout);
    let lines: Vec<serde_json::Value> =
        text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    assert_eq!(lines.len(), 5000);
    for (k, line) in lines.iter().enumerate() {
        let out = core.step(sample(k as u64));
        assert_eq!(line["enhanced_n"].as_f64(), Some(out.enhanced_n), "sample {k}");
        assert_eq!(line["state"].as_str(), Some(out.state.name()));
    }
    let end = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(end.contains("line 5002: 2 field(s)") && end.contains("\"bad_lines\":1"), "{end}");
}

/// Sends samples at 1 kHz while a subscriber of the page stalls after its first read; returns the summary.
fn over_loopback(seconds: u64, stall: Duration) -> serde_json::Value {
    let free = |s: std::io::Result<UdpSocket>| s.and_then(|s| s.local_addr()).expect("a port").port();
    let port = free(UdpSocket::bind("127.0.0.1:0"));
    let forward = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let to = forward.local_addr().expect("an address").to_string();
    let mut child = listen(&["--udp", &port.to_string(), "--page", "0", "--forward", &to, "--quiet"]);
    let mut stderr = BufReader::new(child.stderr.take().expect("a pipe"));
    let mut first_line = String::new();
    stderr.read_line(&mut first_line).expect("the page's address");
    let address = first_line.trim().trim_start_matches("live page: http://").trim_end_matches('/').to_owned();
    let mut page = TcpStream::connect(&address).expect("a page");
    write!(page, "GET / HTTP/1.1\r\n\r\n").expect("asked");
    let mut text = String::new();
    page.read_to_string(&mut text).expect("read");
    assert!(text.contains("EventSource"), "the page");
    let mut slow = TcpStream::connect(&address).expect("a stream");
    write!(slow, "GET /events HTTP/1.1\r\n\r\n").expect("asked");
    let reader = std::thread::spawn(move || {
        let mut some = [0; 4096];
        let first = slow.read(&mut some).expect("read");
        std::thread::sleep(stall);
        let mut all = first;
        while let Ok(n @ 1..) = slow.read(&mut some) {
            all += n;
        }
        all
    });
    let counter = std::thread::spawn(move || {
        forward.set_read_timeout(Some(Duration::from_secs(3))).expect("set");
        let (mut datagram, mut count) = ([0; 2048], 0u64);
        while forward.recv(&mut datagram).is_ok() {
            count += 1;
        }
        count
    });
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.connect(("127.0.0.1", port)).expect("connected");
    let start = Instant::now();
    for k in 0..seconds * 1000 {
        let due = start + Duration::from_micros(k * 1000);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        socket.send(line(&sample(k)).as_bytes()).expect("sent");
    }
    std::thread::sleep(Duration::from_millis(300));
    socket.send(b"end").expect("sent");
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).expect("the summary");
    assert!(child.wait().expect("it ends").success());
    assert!(reader.join().expect("read") > 4096);
    let counts: serde_json::Value =
        serde_json::from_str(rest.lines().last().unwrap_or_default()).expect("a summary");
    println!("{counts}, forwarded {}", counter.join().expect("counted"));
    counts
}

#[test]
fn no_sample_is_lost_at_one_kilohertz() {
    let counts = over_loopback(3, Duration::from_secs(1));
    assert_eq!((counts["samples"].as_u64(), counts["unused"].as_u64()), (Some(3000), Some(0)));
}

#[test]
#[ignore = "a minute"]
fn a_minute_at_one_kilohertz_with_a_subscriber_that_stalls_for_ten_seconds() {
    let counts = over_loopback(60, Duration::from_secs(10));
    assert_eq!((counts["samples"].as_u64(), counts["unused"].as_u64()), (Some(60_000), Some(0)));
}
