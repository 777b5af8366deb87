//! Cost of reading a log on one core: the `csv` crate alone, with its fields parsed and added up, against this crate's reading
//! of the same columns, without and with the quality checks. Times are processor times on Linux, wall-clock times elsewhere.
//!
//! `cargo run --release -p stylet-record --example bare_csv -- log.csv FOLDER`

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;
use stylet_record::{LongRecording, ReadOptions};

/// Processor time in s, or wall-clock time where the system does not report it.
fn now_s(begin: Instant) -> f64 {
    let schedstat = std::fs::read_to_string("/proc/self/schedstat").ok();
    let nanoseconds = schedstat.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| begin.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let path = arguments.next().ok_or("name a CSV file with time_s, position_m, velocity_mps, force_n")?;
    let folder = arguments.next().unwrap_or_else(std::env::temp_dir);
    let begin = Instant::now();

    let start_s = now_s(begin);
    let mut reader = csv::ReaderBuilder::new().has_headers(true).from_path(&path)?;
    let names = reader.headers()?.clone();
    let wanted = ["time_s", "position_m", "velocity_mps", "force_n"];
    let columns: Vec<usize> = wanted.iter().filter_map(|w| names.iter().position(|n| n == *w)).collect();
    let (mut row, mut rows, mut sum) = (csv::ByteRecord::new(), 0_u64, 0.0);
    while reader.read_byte_record(&mut row)? {
        for column in &columns {
            sum += std::str::from_utf8(row.get(*column).unwrap_or_default())?.parse::<f64>()?;
        }
        rows += 1;
    }
    let bare_s = now_s(begin) - start_s;
    let print_rate = |what: &str, seconds: f64| {
        println!(
            "{what:<28} {:6.2} million samples/s, {:.2} times bare csv",
            rows as f64 / seconds / 1e6,
            seconds / bare_s
        );
    };
    print_rate(&format!("bare csv (sum {sum:.3})"), bare_s);

    let start_s = now_s(begin);
    let read = LongRecording::read(&path, &ReadOptions::default(), &folder)?.ok_or("not a plain CSV file")?;
    let read_s = now_s(begin) - start_s;
    if read.len() as u64 != rows {
        return Err(format!("{} samples instead of {rows}", read.len()).into());
    }
    print_rate("read", read_s);
    let start_s = now_s(begin);
    let notes = read.assess()?;
    print_rate(&format!("read and checked ({} notes)", notes.len()), read_s + now_s(begin) - start_s);
    Ok(())
}
