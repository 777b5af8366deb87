//! Measured sets with instrument faults: writes copies of the recordings with eight faults, reference
//! recordings included.
//!
//! ```sh
//! STYLET_MEASURED=folder cargo run --release -p stylet-diagnose --example instrument_faults -- out
//! STYLET_MEASURED=out/gain stylet diagnose scenarios/measured/skin.ron
//! ```
//!
//! Reads `needle_phantom/*.csv` (columns `time` in microseconds, `fz` in N) and writes
//! `out/<fault>/needle_phantom/*.csv`. The output is derived from the recordings and has their licence.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stylet_stats::interpolate;

/// Change of a force column: times in s, forces in N.
type Fault = fn(&[f64], &[f64]) -> Vec<f64>;

/// Faults by name.
const FAULTS: [(&str, Fault); 8] = [
    ("gain", |_, f| f.iter().map(|f| 1.1 * f).collect()),
    ("bias", |_, f| f.iter().map(|f| f + 0.3).collect()),
    ("drift", |t, f| {
        let whole = (t[t.len() - 1] - t[0]).max(1e-9);
        t.iter().zip(f).map(|(at, f)| f + 0.6 * (at - t[0]) / whole).collect()
    }),
    ("hum", |t, f| {
        let at = |t: f64| 0.3 * (std::f64::consts::TAU * HUM_HZ * t).sin();
        t.iter().zip(f).map(|(t, f)| f + at(*t)).collect()
    }),
    (stylet_tissue::Saturation::ID, |_, f| f.iter().map(|f| f.clamp(-LIMIT_N, LIMIT_N)).collect()),
    ("steps", |_, f| f.iter().map(|f| 0.25 * (f / 0.25).round()).collect()),
    ("delay", |t, f| t.iter().map(|at| interpolate(t, f, at - 0.3)).collect()),
    ("lag", |t, f| {
        let mut y = f[0];
        let mut out = vec![y];
        for k in 1..f.len() {
            y += (f[k] - y) * (1.0 - (-(t[k] - t[k - 1]) / 0.3).exp());
            out.push(y);
        }
        out
    }),
];
/// Frequency of the hum in Hz.
const HUM_HZ: f64 = 17.0;
/// Range of the saturated sensor in N.
const LIMIT_N: f64 = 3.5;

fn main() -> Result<(), Box<dyn Error>> {
    let folder =
        std::env::var_os("STYLET_MEASURED").ok_or("set STYLET_MEASURED to the folder of recordings")?;
    let out = PathBuf::from(std::env::args().nth(1).ok_or("name the folder to write to")?);
    let mut files: Vec<PathBuf> = std::fs::read_dir(PathBuf::from(folder).join("needle_phantom"))?
        .flatten()
        .map(|e| e.path())
        .collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "csv"));
    files.sort();
    for (name, fault) in FAULTS {
        let to = out.join(name).join("needle_phantom");
        std::fs::create_dir_all(&to)?;
        for file in &files {
            if let Some(name) = file.file_name() {
                std::fs::write(to.join(name), with(file, fault)?)?;
            }
        }
        println!("{}", to.display());
    }
    Ok(())
}

/// The file with its force column changed.
fn with(file: &Path, fault: Fault) -> Result<String, Box<dyn Error>> {
    let text = std::fs::read_to_string(file)?;
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    let place = |wanted: &str| {
        let mut names = header.split(',').map(|c| c.trim().trim_matches('"'));
        names.position(|c| c == wanted).ok_or_else(|| format!("{}: no column {wanted}", file.display()))
    };
    let (time, force) = (place("time")?, place("fz")?);
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    let column = |k: usize, scale: f64| -> Result<Vec<f64>, Box<dyn Error>> {
        rows.iter()
            .map(|r| Ok(scale * r.get(k).copied().unwrap_or_default().trim().parse::<f64>()?))
            .collect()
    };
    let (t, f) = (column(time, 1e-6)?, column(force, 1.0)?);
    if f.is_empty() {
        return Ok(text);
    }
    let mut out = format!("{header}\n");
    for (row, f) in rows.iter().zip(fault(&t, &f)) {
        for (k, cell) in row.iter().enumerate() {
            let comma = if k > 0 { "," } else { "" };
            if k == force { write!(out, "{comma}{f}")? } else { write!(out, "{comma}{cell}")? }
        }
        out.push('\n');
    }
    Ok(out)
}
