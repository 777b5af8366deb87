//! Entrants in Rust: `stylet-online-peers DETECTOR [--name value ...]`, speaking the protocol of `stylet benchmark replay`.
//!
//! `bocpd`: Bayesian online change-point detection (Adams, MacKay 2007, arXiv:0710.3742) by the crate changepoint, on the residual of
//! the force from its extrapolated straight line. `argpcp`: its detector with an autoregressive Gaussian process (Turner 2011), on the same.
//! Their confidence is the log-odds of a change within the last `window` seconds during which the mean residual is below zero.
//!
//! Options: `--trend` is the time constant of the line in s, `--run` the expected time between changes in s (bocpd), `--window` as
//! above, and `--threshold` the smallest confidence.

mod detectors;
mod residual;

use std::io::{BufRead, Write};

use detectors::Stream;

/// What the command line sets.
#[derive(Clone, Copy)]
pub struct Options {
    trend: f64,
    run: f64,
    window: f64,
    threshold: f64,
    gaussian_process: bool,
}

fn options() -> Result<Options, String> {
    let mut arguments = std::env::args().skip(1);
    let mut options =
        Options { trend: 0.02, run: 0.5, window: 0.01, threshold: 2.5, gaussian_process: false };
    match arguments.next().as_deref() {
        Some("bocpd") => {}
        Some("argpcp") => options.gaussian_process = true,
        _ => return Err("usage: stylet-online-peers bocpd|argpcp [--name value ...]".into()),
    }
    while let Some(name) = arguments.next() {
        let value = arguments.next().and_then(|text| text.parse().ok());
        let value = value.ok_or_else(|| format!("{name} needs a number"))?;
        match name.as_str() {
            "--trend" => options.trend = value,
            "--run" => options.run = value,
            "--window" => options.window = value,
            "--threshold" => options.threshold = value,
            _ => return Err(format!("there is no option {name}")),
        }
    }
    Ok(options)
}

fn answer(stream: &mut Stream, line: &str) -> Option<(f64, f64)> {
    let mut fields = line.split(',').map(|field| field.trim().parse::<f64>());
    let mut next = || fields.next()?.ok();
    let (time, position, force) = (next()?, next()?, next()?);
    if force.is_finite() {
        stream.sample(time, position, force)
    } else {
        None
    }
}

fn serve() -> Result<(), String> {
    let options = options()?;
    let mut stream = Stream::new(1000.0, options);
    let mut output = std::io::stdout().lock();
    let mut input = std::io::stdin().lock();
    let mut line = String::new();
    loop {
        line.clear();
        if input.read_line(&mut line).map_err(|error| error.to_string())? == 0 {
            return Ok(());
        }
        if let Some(rate) = line.strip_prefix("start") {
            let rate = rate.trim().parse().map_err(|_| "start needs the rate in Hz")?;
            stream = Stream::new(rate, options);
            continue;
        }
        let written = match answer(&mut stream, &line) {
            Some((drop, confidence)) if drop > 0.0 => {
                writeln!(output, "1,{drop:.4},{confidence:.4}")
            }
            Some((_, confidence)) => writeln!(output, "1,,{confidence:.4}"),
            None => output.write_all(b"\n"),
        };
        // The other side may have ended first: no fault of the entrant.
        if written.and_then(|()| output.flush()).is_err() {
            return Ok(());
        }
    }
}

fn main() {
    if let Err(error) = serve() {
        eprintln!("stylet-online-peers: {error}");
        std::process::exit(2);
    }
}
