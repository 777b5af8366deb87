//! Promise: `--limit-memory` holds for pipes and for files of other programs: what they deliver or declare is compared with the limit, the
//! command ends with 2 and a remedy. More attacks: tests/attacks.py.

use std::io::Write as _;
use std::process::{Command, Output, Stdio};

fn enhance(args: &[&str], input: Option<&'static [u8]>) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .args(["enhance", "--limit-memory", "50MB", "--out"])
        .arg(std::env::temp_dir().join(format!("stylet-memory-{}", std::process::id())))
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let feeder = std::thread::spawn(move || {
        let piece = input.unwrap_or_default().repeat(10_000);
        // Without end, until the reader has had enough.
        while !piece.is_empty() && stdin.write_all(&piece).is_ok() {}
    });
    let output = child.wait_with_output().expect("it ends");
    feeder.join().expect("fed");
    output
}

fn is_refused(output: &Output) {
    let stderr = String::from_utf8_lossy(&output.stderr).replace(['\n', '│'], " ");
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("limit is 50 MB") && stderr.contains("--limit-memory"), "{stderr}");
}

#[test]
#[cfg(unix)]
fn a_pipe_without_end_is_refused() {
    is_refused(&enhance(&["/dev/stdin"], Some(b"1,2,3\n")));
    is_refused(&enhance(&["/dev/zero"], None));
}

#[test]
#[cfg(feature = "formats")]
fn a_small_parquet_file_of_many_rows_is_refused() {
    let column = vec![1.0; 2_000_000];
    let recording = stylet::record::Recording {
        time_s: column.clone(),
        position_m: column.clone(),
        velocity_mps: column.clone(),
        force_n: column,
        ..Default::default()
    };
    let path = std::env::temp_dir().join(format!("stylet-memory-{}.parquet", std::process::id()));
    let bytes = stylet::record::file_formats::to_parquet(&recording, &path).expect("encoded");
    assert!(bytes.len() < 200_000, "{} bytes", bytes.len());
    std::fs::write(&path, bytes).expect("written");
    let output = enhance(&[path.to_str().expect("a path")], None);
    std::fs::remove_file(&path).expect("removed");
    is_refused(&output);
}
