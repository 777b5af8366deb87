//! `stylet convert`: a recording in another file format.

use crate::cli::args::ConvertArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::{print, print_error};
use std::path::Path;
use stylet_api::output_folder::{check_own_file, write_file_atomically};
use stylet_api::read_options;
use stylet_record::{Recording, read_csv, write_csv};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn convert(args: &ConvertArgs) -> Result<(), Failure> {
    let encode = encoder(&args.to)?;
    let mut inputs = vec![args.from.as_path()];
    inputs.extend(args.reading.columns.as_deref());
    let options = read_options(args.reading.columns.as_deref(), args.reading.repair)?;
    let (recording, notes) = read_csv(&args.from, &options)?;
    let content = encode(&recording, &args.to)?;
    check_own_file(&args.to, &inputs, Some(&content), |_| false)?;
    write_file_atomically(&args.to, &content)?;
    if !args.quiet {
        for note in notes {
            print_error(&format!("{}: {}\n", args.from.display(), note.message));
        }
        print(&format!("{}: {} samples\n", args.to.display(), recording.len()))?;
    }
    Ok(())
}

type Encode = fn(&Recording, &Path) -> Result<Vec<u8>, Failure>;

/// The encoder for the ending of a file name.
fn encoder(to: &Path) -> Result<Encode, Failure> {
    let ending = to.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "csv" => Ok(|recording, _| {
            let mut bytes = Vec::new();
            write_csv(recording, None, &[], &mut bytes)?;
            Ok(bytes)
        }),
        #[cfg(feature = "formats")]
        "parquet" => Ok(|recording, path| Ok(stylet_record::file_formats::to_parquet(recording, path)?)),
        #[cfg(feature = "formats")]
        "mcap" => Ok(|recording, path| Ok(stylet_record::file_formats::to_mcap(recording, path)?)),
        #[cfg(not(feature = "formats"))]
        "parquet" | "mcap" => Err(Failure::Check(format!(
            "{}: this build writes only CSV: install with `cargo install --path . --features formats`",
            to.display()
        ))),
        _ => Err(Failure::Check(format!(
            "{}: the name must end in .csv, .parquet or .mcap, which selects the format",
            to.display()
        ))),
    }
}
