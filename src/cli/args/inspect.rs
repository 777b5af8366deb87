//! Arguments of `stylet inspect`.

use clap::Args;
use std::path::PathBuf;

/// Arguments of `stylet inspect`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  stylet inspect machine.csv
  stylet inspect machine.xlsx --write-map map.ron
  stylet inspect *.csv --page page.html
  stylet inspect log.mat --json | jq .sampling.rate_hz

It reads what every other command reads: text tables in any common encoding and notation, MATLAB before
v7.3, and with the feature `formats` spreadsheets, MATLAB v7.3, HDF5, Parquet, MCAP and ROS 2 bags. Units
come from names, a row of units or types. Where there are none, the map has a guess from the magnitude:
check it.")]
pub struct InspectArgs {
    /// Files of any supported format.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Column map whose fields are taken as given (RON).
    #[arg(long, value_name = "FILE")]
    pub columns: Option<PathBuf>,
    /// Write the proposed column map of the first file (RON).
    #[arg(long, value_name = "MAP.RON")]
    pub write_map: Option<PathBuf>,
    /// Write a page with the findings and curves (HTML).
    #[arg(long, value_name = "PAGE.HTML")]
    pub page: Option<PathBuf>,
    /// Print JSON instead of text: one object per file, in an array.
    #[arg(long)]
    pub json: bool,
}
