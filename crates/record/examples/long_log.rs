//! Writes a log of any length for benchmarks: insertions of 20 s at 1 kHz into two layers that rupture, with noise of 10 mN; time,
//! position, velocity, force.
//!
//! `cargo run --release -p stylet-record --example long_log -- 1e7 > log.csv`

use std::io::{BufWriter, Write};

fn main() -> std::io::Result<()> {
    let samples = std::env::args().nth(1).and_then(|n| n.parse::<f64>().ok()).unwrap_or(1e7) as u64;
    let mut out = BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
    writeln!(out, "time_s,position_m,velocity_mps,force_n")?;
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for k in 0..samples {
        let t = k as f64 * 1e-3;
        let phase = (k % 20_000) as f64 * 1e-3;
        // Insertion at 5 mm/s for 12 s, 1 s hold, retraction at 10 mm/s, rest.
        let (z, v) = match phase {
            p if p < 12.0 => (5e-3 * p, 5e-3),
            p if p < 13.0 => (0.06, 0.0),
            p if p < 19.0 => (0.06 - 0.01 * (p - 13.0), -0.01),
            _ => (0.0, 0.0),
        };
        // Layers at 15, 30 and 45 mm, with friction behind their front.
        let inside = (z - 0.015).max(0.0);
        let tip = if v > 0.0 && inside > 0.0 { 60.0 * (inside % 0.015) } else { 0.0 };
        let noise: f64 = 0.02 * (uniform() + uniform() + uniform());
        let force = tip + 4000.0 * inside * v + noise;
        writeln!(out, "{t:.3},{z:.6},{v:.4},{force:.6}")?;
    }
    out.flush()
}
