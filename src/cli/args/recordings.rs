//! Arguments of `stylet enhance`, `stylet convert` and `stylet listen`.

use crate::cli::output_args::OutputArgs;
use crate::cli::resource_limits::ResourceLimits;
use clap::Args;
use std::path::{Path, PathBuf};
use stylet_api::DiagnosisInputs;

/// How recordings are read.
#[derive(Clone, Debug, Args)]
pub struct ReadingArgs {
    /// Column map: names and units of the recordings' columns (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Drop rows with backward or repeated time stamps, and report which.
    #[arg(long)]
    pub repair: bool,
}

impl ReadingArgs {
    /// A scenario with recordings that are read in this way, and custom effects.
    pub fn inputs(&self, scenario: &Path, data: &[PathBuf], effects: &[PathBuf]) -> DiagnosisInputs {
        DiagnosisInputs {
            scenario: scenario.to_owned(),
            effects: effects.to_owned(),
            data: data.to_owned(),
            columns: self.columns.clone(),
            repair: self.repair,
        }
    }
}

/// Arguments of `stylet enhance`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet enhance recording.csv
  stylet enhance log.csv --columns map.ron --config tuned.ron --out out/log
  stylet enhance next_day.csv --model out/diagnosis/extended.ron

A column map for a log in microseconds and millimetres:
  Columns(time: (name: \"time\", scale: 1e-6), position: (name: \"pz\", scale: 1e-3),
          force: (name: \"fz\"))

A configuration: Enhance(cusum: (sigma_rupture_n: 0.1), model: MultiLayer).
Of a scenario file the `enhance` part and the surface are used.

With --model the friction along the shaft comes from a model that `stylet diagnose` fitted to other
insertions, and is corrected during retraction by the measured force. Model and recording must have the
same position origin.")]
pub struct EnhanceArgs {
    /// Recording (CSV with header).
    pub data: PathBuf,
    /// Configuration of the online algorithm (RON) [default: algorithm `Stylet` with its defaults].
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Take the shaft friction from this model: extended.ron of a diagnosis, or any scenario (RON).
    #[arg(long, value_name = "EXTENDED.RON")]
    pub model: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Run both the multi-layer and the Kelvin-Voigt model.
    #[arg(long)]
    pub compare: bool,
    /// Contact: found by evidence (auto), at `surface_m` of the configuration (known), or none, because the recording begins in the
    /// tissue [default: that of the configuration, auto].
    #[arg(long, value_name = "SETTING")]
    pub contact: Option<ContactArg>,
    #[command(flatten)]
    pub results: OutputArgs,
    #[command(flatten)]
    pub limits: ResourceLimits,
}

/// Source of the first contact.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum ContactArg {
    /// Found by evidence.
    Auto,
    /// At the surface of the configuration.
    Known,
    /// None: the needle is in the tissue from the first sample on.
    None,
}

impl ContactArg {
    /// The setting of the core.
    pub fn setting(self) -> stylet_core::config::Contact {
        use stylet_core::config::Contact;
        match self {
            Self::Auto => Contact::Detected,
            Self::Known => Contact::Known,
            Self::None => Contact::None,
        }
    }
}

/// Arguments of `stylet convert`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet convert bag.mcap insertion.csv --columns map.ron
  stylet convert out/recording.csv insertion.parquet

A column map for a robot's log with force and position on separate topics:
  Columns(time: (name: \"/ft_sensor/wrench.log_time\"), force: (name: \"/ft_sensor/wrench.wrench.force.z\"),
          position: (name: \"/tip.pose.position.z\"))")]
pub struct ConvertArgs {
    /// Recording to read.
    pub from: PathBuf,
    /// File to write; the ending .csv, .parquet or .mcap selects the format.
    pub to: PathBuf,
    #[command(flatten)]
    pub reading: ReadingArgs,
    /// Print nothing but errors.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Arguments of `stylet listen`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet listen --udp 5005 --page 8080 --forward 127.0.0.1:9870
  tail -f samples.csv | stylet listen --stdin --page 8080

A sample is a line `time_s,position_m,force_n[,velocity_mps]` or a JSON object with these names; a datagram
may hold several. Results go as JSON lines to standard output and to --forward (PlotJuggler: UDP server,
message protocol JSON). A slow reader loses its own oldest lines and never delays the algorithm. The datagram
`end`, Ctrl-C or SIGTERM end the session.")]
pub struct ListenArgs {
    /// Receive samples on this UDP port.
    #[arg(long, value_name = "PORT", conflicts_with = "stdin", required_unless_present = "stdin")]
    pub udp: Option<u16>,
    /// Read samples from standard input.
    #[arg(long)]
    pub stdin: bool,
    /// Address to receive and serve on; `0.0.0.0` opens it to the network.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub host: String,
    /// Serve a page with live curves on this port (0: any free one); needs the feature `studio`, which is on by default.
    #[arg(long, value_name = "PORT")]
    pub page: Option<u16>,
    /// Send every line as a datagram to this address.
    #[arg(long, value_name = "HOST:PORT")]
    pub forward: Option<String>,
    /// Configuration of the online algorithm: an Enhance(...) or Scenario(...) file.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Contact: found by evidence (auto), at `surface_m` of the configuration (known), or none, because the stream begins in the
    /// tissue [default: that of the configuration, auto].
    #[arg(long, value_name = "SETTING")]
    pub contact: Option<ContactArg>,
    /// End after this many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub duration_s: Option<f64>,
    /// Print no lines.
    #[arg(long, short)]
    pub quiet: bool,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s > 0.0 && s < 1e9 => Ok(s),
        _ => Err("must be a positive number of seconds".to_owned()),
    }
}
