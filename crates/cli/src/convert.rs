//! `stylet convert`: a recording in another format.

use crate::args::ConvertArgs;
use crate::exit::Failure;
use crate::terminal::{print, print_error};
use std::path::Path;
use stylet_api::output_folder::write_file_atomically;
use stylet_api::read_options;
use stylet_record::{Recording, read_csv, write_csv};

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn convert(args: &ConvertArgs) -> Result<(), Failure> {
    let write = writer(&args.to)?;
    let options = read_options(args.columns.as_deref(), args.repair)?;
    let (recording, notes) = read_csv(&args.from, &options)?;
    write_file_atomically(&args.to, &write(&recording, &args.to)?)?;
    if !args.quiet {
        for note in notes {
            print_error(&format!("{}: {}\n", args.from.display(), note.message));
        }
        print(&format!("{}: {} samples\n", args.to.display(), recording.len()))?;
    }
    Ok(())
}

type Write = fn(&Recording, &Path) -> Result<Vec<u8>, Failure>;

/// The format that a file's name asks for.
fn writer(to: &Path) -> Result<Write, Failure> {
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
            "{}: this build writes CSV alone: install with `cargo install --path . --features formats`",
            to.display()
        ))),
        _ => Err(Failure::Check(format!(
            "{}: the name must end in .csv, .parquet or .mcap: it says in which format to write",
            to.display()
        ))),
    }
}
