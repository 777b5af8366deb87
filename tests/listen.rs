//! Promise: `stylet listen` loses no sample, gives the outputs of the core, and is not slowed by a stalled subscriber. The long
//! form (60 s at 1 kHz, a browser connection that stalls for 10 s):
//! `cargo test --release --test promises listen -- --ignored --nocapture`.

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

/// Feeds text to `stylet listen --stdin`; its lines, its messages and its exit code.
fn feed(input: &[u8]) -> (Vec<serde_json::Value>, String, Option<i32>) {
    let mut child = listen(&["--stdin"]);
    let mut stdin = child.stdin.take().expect("a pipe");
    let bytes = input.to_vec();
    let feeder = std::thread::spawn(move || {
        let _ = stdin.write_all(&bytes);
    });
    let output = child.wait_with_output().expect("it ends");
    feeder.join().expect("fed");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let lines = text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    (lines, String::from_utf8(output.stderr).expect("UTF-8"), output.status.code())
}

fn summary(stderr: &str) -> serde_json::Value {
    serde_json::from_str(stderr.lines().last().unwrap_or_default()).expect("a summary")
}

#[test]
fn one_wrong_time_stamp_costs_one_line_and_a_new_clock_restarts_with_a_message() {
    let mut input = String::new();
    for k in 0..3000 {
        input.push_str(&format!("{}\n", line(&sample(k))));
        if k == 1000 {
            input.push_str("1e9,0,0,0\n");
        }
    }
    // The controller starts again.
    for k in 0..2000 {
        input.push_str(&format!("{}\n", line(&sample(k))));
    }
    let (lines, stderr, code) = feed(input.as_bytes());
    assert_eq!((lines.len(), code), (5001, Some(0)));
    let unused: Vec<usize> = (0..lines.len()).filter(|k| lines[*k]["used"] == false).collect();
    assert_eq!(unused, [1001, 3001, 3002, 3003, 3004]);
    for (k, line) in lines.iter().enumerate() {
        let used = line["used"].as_bool().expect("every line says whether it was used");
        assert_eq!(used, line.get("reason").is_none(), "line {k} has a reason if it was not used");
        for value in ["enhanced_n", "state", "stiffness_n_per_m", "cumulative_friction_ns_per_m"] {
            assert_eq!(line[value].is_null(), !used, "{value} of line {k}");
        }
        assert_eq!(line["restarts"].as_u64(), Some(u64::from(k >= 3005)), "line {k}");
    }
    // After the restart the algorithm is as if it had begun with the first sample that it used.
    let alone: String = (4..2000).map(|k| format!("{}\n", line(&sample(k)))).collect();
    let (alone, _, _) = feed(alone.as_bytes());
    assert_eq!(lines[5000]["enhanced_n"], alone[1995]["enhanced_n"]);
    let summary = summary(&stderr);
    assert_eq!((summary["unused"].as_u64(), summary["restarts"].as_u64()), (Some(5), Some(1)));
    assert!(stderr.contains("a new clock: the algorithm begins again"), "{stderr}");
}

#[test]
fn bad_lines_are_counted_and_neither_end_the_stream_nor_reach_the_terminal() {
    let mut input = b"0,0,0\n0.001,0,\xff\n".to_vec();
    input.extend(b"1,\x1b[2J\x07\n");
    input.extend(vec![b'x'; 5_000_000]);
    input.extend(
        b"\n{\"seq\":1,\"time_s\":0.002,\"position_m\":0,\"force_n\":0,\"frame\":\"tool\"}\n0.003,0,0",
    );
    let (lines, stderr, code) = feed(&input);
    assert_eq!((lines.len(), code), (3, Some(0)), "{stderr}");
    assert_eq!(lines[1]["bad_lines"].as_u64(), Some(3));
    assert!(stderr.len() < 3000 && !stderr.chars().any(|c| c.is_control() && c != '\n'), "{stderr:?}");
    assert!(stderr.contains("line 2: byte 9 is not UTF-8") && stderr.contains("\"bad_lines\":3"), "{stderr}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_reported_and_the_summary_printed() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a full disk");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(["listen", "--stdin"])
        .stdin(Stdio::piped())
        .stdout(full)
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let _ = stdin.write_all(b"0,0,0\n0.001,0,0\n");
    // The input stays open: it ends by itself.
    let output = child.wait_with_output().expect("it ends");
    drop(stdin);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("standard output cannot be written") && stderr.contains("\"samples\":2"),
        "{stderr}"
    );
}

#[test]
#[cfg(unix)]
fn an_interrupted_session_prints_its_lines_and_its_summary() {
    use nix::sys::signal::{Signal, kill};
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let mut child = listen(&["--stdin"]);
        let mut stdin = child.stdin.take().expect("a pipe");
        writeln!(stdin, "0,0,0\n0.001,0,0").expect("fed");
        let mut first = String::new();
        let mut stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        stdout.read_line(&mut first).expect("a line");
        kill(nix::unistd::Pid::from_raw(child.id() as i32), signal).expect("sent");
        let mut stderr = String::new();
        child.stderr.take().expect("a pipe").read_to_string(&mut stderr).expect("read");
        assert_eq!(child.wait().expect("it ends").code(), Some(0), "{signal}");
        assert_eq!(summary(&stderr)["samples"].as_u64(), Some(2), "{signal}: {stderr}");
        drop(stdin);
    }
}

#[test]
fn lines_forwarded_to_the_own_port_are_refused() {
    let port = UdpSocket::bind("127.0.0.1:0").and_then(|s| s.local_addr()).expect("a port").port();
    let child = listen(&["--udp", &port.to_string(), "--forward", &format!("127.0.0.1:{port}")]);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("choose another port"));
}

/// A session with a page; its address.
fn with_page() -> (Child, String) {
    let mut child = listen(&["--stdin", "--page", "0", "--quiet"]);
    let mut first_line = String::new();
    let mut stderr = BufReader::new(child.stderr.take().expect("a pipe"));
    stderr.read_line(&mut first_line).expect("the page's address");
    child.stderr = Some(stderr.into_inner());
    (child, first_line.trim().trim_start_matches("live page: http://").trim_end_matches('/').to_owned())
}

/// First line of the response to a request.
fn status(address: &str, request: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).expect("a connection");
    let _ = stream.write_all(request);
    let mut line = String::new();
    let _ = BufReader::new(stream).read_line(&mut line);
    line.trim().to_owned()
}

#[test]
fn the_page_answers_only_short_requests_for_this_computer() {
    let (mut child, address) = with_page();
    let get = |headers: &str| status(&address, format!("GET / HTTP/1.1\r\n{headers}\r\n").as_bytes());
    for own in ["", "Host: localhost:8080\r\n", &format!("Host: {address}\r\n"), "Host: [::1]\r\n"] {
        assert_eq!(get(own), "HTTP/1.1 200 OK", "{own}");
    }
    assert_eq!(get("Host: evil.example:8080\r\n"), "HTTP/1.1 421 Misdirected Request");
    assert_eq!(get("Host: localhost\r\nHost: evil.example\r\n"), "HTTP/1.1 421 Misdirected Request");
    assert_eq!(get("Host: localhost\r\nOrigin: https://evil.example\r\n"), "HTTP/1.1 403 Forbidden");
    assert_eq!(status(&address, b"POST / HTTP/1.1\r\n\r\n"), "HTTP/1.1 405 Method Not Allowed");
    assert_eq!(status(&address, b"GET /../etc/passwd HTTP/1.1\r\n\r\n"), "HTTP/1.1 404 Not Found");
    assert_eq!(status(&address, b"\x16\x03\x01\n\n"), "HTTP/1.1 400 Bad Request");
    assert_eq!(status(&address, &[b'a'; 8192]), "HTTP/1.1 431 Request Header Fields Too Large");
    // One byte at a time: the request as a whole must be complete within 5 s.
    let start = Instant::now();
    let mut slow = TcpStream::connect(&address).expect("a connection");
    slow.set_read_timeout(Some(Duration::from_millis(200))).expect("set");
    let mut answer = [0; 64];
    let length = loop {
        let _ = slow.write_all(b"a");
        match slow.read(&mut answer) {
            Ok(length) => break length,
            Err(_) => assert!(start.elapsed() < Duration::from_secs(9), "still open"),
        }
    };
    assert!(answer[..length].starts_with(b"HTTP/1.1 408") || length == 0);
    drop(child.stdin.take());
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn more_readers_than_places_are_refused_and_counted_and_the_core_loses_nothing() {
    const SAMPLES: u64 = 80_000;
    let (mut child, address) = with_page();
    let streams: Vec<TcpStream> = (0..100)
        .map(|_| {
            let mut stream = TcpStream::connect(&address).expect("a connection");
            let _ = stream.write_all(b"GET /events HTTP/1.1\r\n\r\n");
            stream
        })
        .collect();
    let mut stdin = child.stdin.take().expect("a pipe");
    // More than the buffers of the system hold.
    for k in 0..SAMPLES {
        writeln!(stdin, "{}", line(&sample(k))).expect("fed");
    }
    drop(stdin);
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let summary = summary(&String::from_utf8_lossy(&output.stderr));
    assert_eq!((summary["samples"].as_u64(), summary["unused"].as_u64()), (Some(SAMPLES), Some(0)));
    assert_eq!(summary["refused_readers"].as_u64(), Some(68));
    assert!(summary["dropped_by_readers"].as_u64() > Some(0), "stalled readers lose lines");
    drop(streams);
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

/// Requests of every wrong kind, again and again; their number.
fn attack(address: &str, kind: usize, stop: &std::sync::atomic::AtomicBool) -> usize {
    let requests: [&[u8]; 6] = [
        b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        b"GET /events HTTP/1.1\r\nOrigin: https://evil.example\r\n\r\n",
        b"GET /../../etc/passwd HTTP/1.1\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 10737418240\r\n\r\n",
        b"\x16\x03\x01\n\n",
        // Half a head, which stays open.
        b"GET / HTTP/1.1\r\nHost:",
    ];
    let (mut sent, mut open) = (0, Vec::new());
    while !stop.load(std::sync::atomic::Ordering::Relaxed) {
        if let Ok(mut stream) = TcpStream::connect(address) {
            let _ = stream.write_all(requests[(kind + sent) % requests.len()]);
            sent += 1;
            open.push(stream);
        }
        // Never more than the system allows.
        open.truncate(100);
        std::thread::sleep(Duration::from_millis(1));
    }
    sent
}

#[test]
fn no_sample_is_lost_while_the_page_is_attacked() {
    const SAMPLES: u64 = 3000;
    let port = UdpSocket::bind("127.0.0.1:0").and_then(|s| s.local_addr()).expect("a port").port();
    let mut child = listen(&["--udp", &port.to_string(), "--page", "0", "--quiet"]);
    let mut stderr = BufReader::new(child.stderr.take().expect("a pipe"));
    let mut first_line = String::new();
    stderr.read_line(&mut first_line).expect("the page's address");
    let address = first_line.trim().trim_start_matches("live page: http://").trim_end_matches('/').to_owned();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.connect(("127.0.0.1", port)).expect("connected");
    let attacks: usize = std::thread::scope(|scope| {
        let attackers: Vec<_> = (0..4)
            .map(|kind| {
                scope.spawn({
                    let (address, stop) = (&address, &stop);
                    move || attack(address, kind, stop)
                })
            })
            .collect();
        let start = Instant::now();
        for k in 0..SAMPLES {
            let due = start + Duration::from_micros(k * 1000);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            socket.send(line(&sample(k)).as_bytes()).expect("sent");
        }
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        attackers.into_iter().map(|attacker| attacker.join().expect("no panic")).sum()
    });
    std::thread::sleep(Duration::from_millis(300));
    socket.send(b"end").expect("sent");
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).expect("the summary");
    assert!(child.wait().expect("it ends").success());
    let counts = summary(&rest);
    println!("{attacks} attacks, {counts}");
    assert!(attacks > 500, "{attacks} attacks");
    assert_eq!((counts["samples"].as_u64(), counts["unused"].as_u64()), (Some(SAMPLES), Some(0)));
    assert_eq!(counts["dropped_by_system"].as_u64().unwrap_or(0), 0);
    assert!(counts["refused_readers"].as_u64() > Some(0), "held connections fill the places: {counts}");
}
