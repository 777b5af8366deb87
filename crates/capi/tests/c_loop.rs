//! Promise: a C loop, built with `cc` against the static library, gives bitwise the results of Rust without allocation. The time per
//! step is printed, not tested: `STYLET_C_STEPS=10000000 cargo test --release -p stylet-capi
//! --test c_loop -- --nocapture`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use stylet_core::{EnhanceConfig, Enhancer, Sample};

/// The static library of this test, built by cargo into the same folder.
fn library() -> PathBuf {
    let deps = std::env::current_exe().expect("a path").parent().expect("a folder").to_owned();
    // `cargo test` does not build the library itself.
    let mut args = vec!["build", "-p", "stylet-capi", "--lib"];
    if !cfg!(debug_assertions) {
        args.push("--release");
    }
    let folder = deps.parent().expect("the profile's folder").to_owned();
    let target = folder.parent().expect("the target folder");
    let done =
        Command::new(env!("CARGO")).args(&args).env("CARGO_TARGET_DIR", target).status().expect("cargo");
    assert!(done.success());
    folder.join("libstylet.a")
}

fn program() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("loop");
    let status = Command::new("cc")
        .args(["-O2", "-Wall", "-Wextra", "-Werror", "-std=c11", "-I"])
        .arg(root.join("include"))
        .arg(root.join("tests/loop.c"))
        .arg(library())
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .status()
        .expect("a C compiler");
    assert!(status.success(), "compiles without warnings");
    program
}

/// Layers of growing stiffness with a little noise from a small generator.
fn samples() -> Vec<Sample> {
    let mut state = 1u64;
    (0..60_000)
        .map(|k| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise = (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5;
            let time_s = k as f64 * 1e-3;
            let position_m = -0.005 + 2.3e-3 * time_s;
            let layer = (position_m / 0.03).floor().max(0.0);
            let inside = position_m - 0.03 * layer;
            let stiffness = 50.0 + 30.0 * layer;
            let elastic = if position_m > 0.0 { stiffness * inside } else { 0.0 };
            let friction = 9000.0 * position_m.max(0.0) * 2.3e-3;
            Sample { time_s, position_m, velocity_mps: 2.3e-3, force_n: elastic + friction + 0.02 * noise }
        })
        .collect()
}

#[test]
fn a_c_loop_gives_bitwise_the_results_of_rust_without_allocation() {
    let program = program();
    let samples = samples();
    let mut child =
        Command::new(&program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let bytes: Vec<u8> = samples
        .iter()
        .flat_map(|s| [s.time_s, s.position_m, s.velocity_mps, s.force_n])
        .flat_map(f64::to_le_bytes)
        .collect();
    let feeder = std::thread::spawn(move || stdin.write_all(&bytes));
    let output = child.wait_with_output().expect("it ends");
    feeder.join().expect("fed").expect("written");
    assert!(output.status.success());
    let numbers: Vec<u64> =
        output.stdout.chunks_exact(8).map(|b| u64::from_le_bytes(b.try_into().expect("eight"))).collect();
    assert_eq!(numbers.len(), 3 * samples.len());
    let mut core = Enhancer::new(EnhanceConfig::default(), 0.0, vec![Sample::default(); 16_384]);
    let mut ruptures = 0;
    for (k, (s, c)) in samples.iter().zip(numbers.chunks_exact(3)).enumerate() {
        let out = core.step(*s);
        ruptures = out.ruptures;
        let rust = [out.enhanced_n, out.theta[0], out.state as i32 as f64].map(f64::to_bits);
        assert_eq!(rust, [c[0], c[1], c[2]], "sample {k}");
    }
    assert!(ruptures >= 2, "ruptures must be detected");

    let steps = std::env::var("STYLET_C_STEPS").unwrap_or_else(|_| "200000".to_owned());
    let timed = Command::new(&program).arg(steps).output().expect("it runs");
    let report = String::from_utf8_lossy(&timed.stdout);
    println!("{report}");
    assert!(timed.status.success() && report.contains("allocations 0 "), "{report}");
}
