//! `stylet benchmark export --online`, `replay` and `judge-online`: online detection of punctures by any program.

use crate::cli::args::{BenchmarkExportArgs, BenchmarkJudgeOnlineArgs, BenchmarkReplayArgs};
use crate::cli::exit_codes::Failure;
use crate::cli::progress_bar::Progress;
use crate::cli::terminal_output::print;
use std::path::PathBuf;
use stylet_api::benchmark::{OnlineExport, TestedDetector, online_files, replay_streams, score_online};
use stylet_examine::challenge_export::key_path;
use stylet_examine::online::stream_folder::exported_streams;
use stylet_examine::online::stream_scores::scores_text;

/// Writes streams without the truth, and their key.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn export(args: &BenchmarkExportArgs) -> Result<(), Failure> {
    let cases = &args.cases;
    let export = OnlineExport {
        world: &cases.world,
        rows: &args.rows,
        split: &args.split,
        cases: cases.cases,
        seed: cases.seed,
        measured: args.measured.as_deref(),
        parquet: args.parquet,
    };
    let written = export.write(&args.out)?;
    print(&format!(
        "{written} streams in {}\nKey, to be kept secret: {}\n",
        args.out.display(),
        key_path(&args.out).display()
    ))
}

/// Replays streams to a detector and writes its answers.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn replay(args: &BenchmarkReplayArgs) -> Result<(), Failure> {
    let player = match args.algorithm {
        Some(algorithm) => TestedDetector::Core(algorithm.into()),
        None => TestedDetector::Program(args.program.clone()),
    };
    let name = args.name.clone().unwrap_or_else(|| {
        args.out.file_name().map_or_else(|| "detector".to_owned(), |n| n.to_string_lossy().into_owned())
    });
    let streams = exported_streams(&args.folder).map_err(|e| Failure::Check(e.to_string()))?.len();
    let bar = Progress::new(streams as u64, "streams", false);
    let samples =
        replay_streams(&args.folder, &player, &name, &args.out, args.threads.unwrap_or(0), &|| {
            bar.advance(1);
        })?;
    bar.finish();
    print(&format!("{name}: {samples} samples of {streams} streams; answers in {}\n", args.out.display()))
}

/// Scores answers.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn judge(args: &BenchmarkJudgeOnlineArgs) -> Result<(), Failure> {
    let scores = score_online(&args.folder, &args.answers)?;
    if let Some(path) = &args.json {
        let json = stylet_api::output_files::to_json_bytes(&scores)?;
        std::fs::write(path, json)
            .map_err(|why| stylet_api::Error::Output { path: path.display().to_string(), why })?;
    }
    let folder = args.results.output_folder(&PathBuf::from("online"), "");
    args.results.write_and_print(&folder, &online_files(&scores)?, || scores_text(&scores))
}
