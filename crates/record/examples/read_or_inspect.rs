//! Reads files as the commands do, with what an inspection finds: `read_or_inspect [--map MAP.RON] [--repair] FILE...`

use std::path::PathBuf;
use stylet_record::inspect::{InspectOptions, inspect};
use stylet_record::{ColumnMap, ReadOptions, read_csv};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut options, mut files) = (ReadOptions::default(), Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--repair" => options.repair = true,
            "--map" => {
                let text = std::fs::read_to_string(arguments.next().unwrap_or_default())?;
                options.columns = Some(ron::from_str::<ColumnMap>(&text)?);
            }
            file => files.push(PathBuf::from(file)),
        }
    }
    for file in files {
        match read_csv(&file, &options) {
            Ok((recording, notes)) => {
                let rate = (recording.len() - 1) as f64 / recording.duration_s();
                println!("{}: {} samples, {rate:.3} Hz", file.display(), recording.len());
                notes.iter().for_each(|note| println!("  note: {}", note.message));
            }
            Err(error) => println!("{error}"),
        }
        match inspect(&file, &InspectOptions { columns: options.columns.clone() }) {
            Ok(found) => {
                found.findings.iter().for_each(|f| {
                    println!("  {}: {}", if f.obstacle { "OBSTACLE" } else { "remark" }, f.message)
                });
                println!("{}", found.to_ron());
            }
            Err(error) => println!("  inspect: {error}"),
        }
    }
    Ok(())
}
