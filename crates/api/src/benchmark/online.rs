//! Benchmark of online puncture detection: replays streams to a detector sample by sample, and scores its events.

use crate::error::Error;
use crate::live_stream::{STORED_SAMPLES, VelocityEstimator};
use crate::output_files::OutputFiles;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Mutex;
use std::time::Instant;
use stylet_core::config::Algorithm;
use stylet_core::{EnhanceConfig, Enhancer, Sample};
use stylet_examine::challenge_export::ChallengeError;
use stylet_examine::online::stream_folder::{
    EntrantFile, ExportedStream, exported_streams, read_answers, stream_samples, streams_with_truth,
};
use stylet_examine::online::stream_scores::{EntrantScore, score_entrant};
use stylet_stats::parallel::*;

fn request(error: ChallengeError) -> Error {
    Error::Request(error.to_string())
}

/// Detector under test.
#[derive(Clone, Debug, PartialEq)]
pub enum TestedDetector {
    /// A program with its arguments, started once per thread; samples and replies go through a pipe.
    Program(Vec<String>),
    /// An algorithm of this project.
    Core(Algorithm),
}

/// Reply of a detector to one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Reply {
    event: bool,
    drop_n: Option<f64>,
    confidence: Option<f64>,
    tip_force_n: Option<f64>,
}

/// Replays the streams of `folder` to a detector and writes its answers to the new folder `out`: `events.csv`, `entrant.json` and, if it
/// estimates the tip force, `enhanced/NNNN.csv`. Returns the number of samples. `done` is called after each stream.
///
/// # Errors [`Error::Request`] for a file that cannot be used, or for an invalid reply, with stream and sample. Partial output is
/// removed.
pub fn replay_streams(
    folder: &Path,
    player: &TestedDetector,
    name: &str,
    out: &Path,
    threads: usize,
    done: &(dyn Fn() + Sync),
) -> Result<u64, Error> {
    if out.exists() {
        return Err(request(ChallengeError::FolderExists(out.display().to_string())));
    }
    let streams = exported_streams(folder).map_err(request)?;
    let mut part = out.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let _ = std::fs::remove_dir_all(&part);
    let answers = Answers { folder: &part, done };
    let result = answers.collect(folder, &streams, player, name, threads).and_then(|samples| {
        std::fs::rename(&part, out).map_err(|why| Error::Output { path: out.display().to_string(), why })?;
        Ok(samples)
    });
    if result.is_err() {
        let _ = std::fs::remove_dir_all(&part);
    }
    result
}

struct Answers<'a> {
    folder: &'a Path,
    done: &'a (dyn Fn() + Sync),
}

/// Events of a stream as lines, its number of samples, and the processing time in s.
struct StreamAnswer {
    events: String,
    samples: u64,
    seconds: f64,
}

impl Answers<'_> {
    fn collect(
        &self,
        folder: &Path,
        streams: &[ExportedStream],
        player: &TestedDetector,
        name: &str,
        threads: usize,
    ) -> Result<u64, Error> {
        self.create_folder("enhanced")?;
        // Idle detectors; at most one per thread is started.
        let idle: Mutex<Vec<Detector>> = Mutex::new(Vec::new());
        let answers: Vec<StreamAnswer> = super::thread_pool(threads)?.install(|| {
            streams
                .par_iter()
                .map(|stream| {
                    let waiting = idle.lock().map_err(Error::internal)?.pop();
                    let mut detector = match waiting {
                        Some(detector) => detector,
                        None => Detector::start(player)?,
                    };
                    let answer = self.replay_stream(folder, stream, &mut detector)?;
                    idle.lock().map_err(Error::internal)?.push(detector);
                    (self.done)();
                    Ok(answer)
                })
                .collect::<Result<_, Error>>()
        })?;
        let events: String = answers.iter().map(|a| a.events.as_str()).collect();
        self.write("events.csv", &format!("stream,time_s,drop_n,confidence\n{events}"))?;
        let samples: u64 = answers.iter().map(|a| a.samples).sum();
        let seconds: f64 = answers.iter().map(|a| a.seconds).sum();
        let file =
            EntrantFile { name: name.to_owned(), ns_per_sample: Some(1e9 * seconds / samples.max(1) as f64) };
        self.write("entrant.json", &serde_json::to_string_pretty(&file).map_err(Error::internal)?)?;
        Ok(samples)
    }

    fn replay_stream(
        &self,
        folder: &Path,
        stream: &ExportedStream,
        detector: &mut Detector,
    ) -> Result<StreamAnswer, Error> {
        let samples = stream_samples(folder, &stream.number).map_err(request)?;
        let (mut events, mut enhanced) = (String::new(), String::new());
        let optional = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
        detector.begin(stream)?;
        let start = Instant::now();
        for (k, sample) in samples.iter().enumerate() {
            let reply = detector.step(sample).map_err(|why| {
                Error::Request(format!("stream {}, sample {}: {why}", stream.number, k + 1))
            })?;
            if reply.event {
                let (drop_n, confidence) = (optional(reply.drop_n), optional(reply.confidence));
                let _ = writeln!(events, "{},{},{drop_n},{confidence}", stream.number, sample[0]);
            }
            if let Some(tip_n) = reply.tip_force_n.filter(|f| f.is_finite()) {
                let _ = writeln!(enhanced, "{},{tip_n:.5}", sample[0]);
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        if !enhanced.is_empty() {
            self.write(
                &format!("enhanced/{}.csv", stream.number),
                &format!("time_s,tip_force_n\n{enhanced}"),
            )?;
        }
        Ok(StreamAnswer { events, samples: samples.len() as u64, seconds })
    }

    fn create_folder(&self, name: &str) -> Result<(), Error> {
        let path = self.folder.join(name);
        std::fs::create_dir_all(&path).map_err(|why| Error::Output { path: path.display().to_string(), why })
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Error> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).map_err(|why| Error::Output { path: path.display().to_string(), why })
    }
}

/// A running detector.
enum Detector {
    Program(ProgramPipe),
    Core(Box<BuiltInDetector>),
}

/// An algorithm of this project, with velocities estimated from the positions.
struct BuiltInDetector {
    config: EnhanceConfig,
    core: Enhancer<Vec<Sample>>,
    velocity: VelocityEstimator,
}

impl Detector {
    fn start(player: &TestedDetector) -> Result<Self, Error> {
        match player {
            TestedDetector::Program(command) => Ok(Self::Program(ProgramPipe::start(command)?)),
            TestedDetector::Core(algorithm) => {
                let mut config = EnhanceConfig { algorithm: *algorithm, ..EnhanceConfig::default() };
                config.stylet.derived_velocity = true;
                let core = Enhancer::new(config.clone(), 0.0, vec![Sample::default(); STORED_SAMPLES]);
                Ok(Self::Core(Box::new(BuiltInDetector {
                    config,
                    core,
                    velocity: VelocityEstimator::default(),
                })))
            }
        }
    }

    fn begin(&mut self, stream: &ExportedStream) -> Result<(), Error> {
        match self {
            Self::Program(pipe) => pipe
                .send(&format!("start {}\n", stream.rate_hz))
                .map_err(|why| Error::Request(format!("stream {}: {why}", stream.number))),
            Self::Core(own) => {
                own.core = Enhancer::new(own.config.clone(), 0.0, vec![Sample::default(); STORED_SAMPLES]);
                own.velocity = VelocityEstimator::default();
                Ok(())
            }
        }
    }

    fn step(&mut self, sample: &[f64; 3]) -> Result<Reply, String> {
        let [time_s, position_m, force_n] = *sample;
        match self {
            Self::Program(pipe) => {
                pipe.send(&format!("{time_s},{position_m},{force_n}\n"))?;
                pipe.reply()
            }
            Self::Core(own) => {
                let BuiltInDetector { core, velocity, .. } = own.as_mut();
                let velocity_mps = velocity.at(time_s, position_m);
                let out = core.step(Sample { time_s, position_m, velocity_mps, force_n });
                if out.used {
                    velocity.add(time_s, position_m);
                }
                // `Paper` gives neither drop nor confidence, which are then zero.
                let given = |x: f64| (x > 0.0).then_some(x);
                Ok(Reply {
                    event: out.detection.is_some(),
                    drop_n: out.detection.and_then(|d| given(d.drop_n)),
                    confidence: out.detection.and_then(|d| given(d.confidence)),
                    tip_force_n: out.used.then_some(out.enhanced_n),
                })
            }
        }
    }
}

/// A program and the two ends of its pipe.
struct ProgramPipe {
    child: Child,
    to: Option<BufWriter<ChildStdin>>,
    from: BufReader<ChildStdout>,
    line: String,
}

impl ProgramPipe {
    fn start(command: &[String]) -> Result<Self, Error> {
        let (program, arguments) = command
            .split_first()
            .ok_or_else(|| Error::Request("name the program after `--`, or an --algorithm".to_owned()))?;
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|why| Error::Request(format!("{program}: cannot be started: {why}")))?;
        let to = child.stdin.take().map(BufWriter::new);
        let from = child.stdout.take().map(BufReader::new).ok_or_else(|| Error::internal("no pipe"))?;
        Ok(Self { child, to, from, line: String::new() })
    }

    fn send(&mut self, line: &str) -> Result<(), String> {
        let to = self.to.as_mut().ok_or("the program has no input")?;
        to.write_all(line.as_bytes())
            .and_then(|()| to.flush())
            .map_err(|why| format!("the program does not take samples any more: {why}"))
    }

    fn reply(&mut self) -> Result<Reply, String> {
        self.line.clear();
        match self.from.read_line(&mut self.line) {
            Ok(0) => {
                Err("the program ended without a reply; it has to reply one line to every sample".to_owned())
            }
            Ok(_) => parse_reply(self.line.trim_end()),
            Err(why) => Err(format!("the program's reply cannot be read: {why}")),
        }
    }
}

impl Drop for ProgramPipe {
    fn drop(&mut self) {
        // Closing its input ends the program.
        self.to = None;
        let _ = self.child.wait();
    }
}

fn parse_reply(line: &str) -> Result<Reply, String> {
    let mut fields = line.split(',').map(str::trim);
    let mut next = || match fields.next() {
        None | Some("") => Ok(None),
        Some(field) => field.parse::<f64>().map(Some).map_err(|_| {
            let line: String = line.chars().take(60).collect();
            format!("the reply `{}` is not `event,drop_n,confidence,tip_force_n`", line.escape_default())
        }),
    };
    let event = next()?;
    Ok(Reply {
        event: event.is_some_and(|e| e != 0.0),
        drop_n: next()?,
        confidence: next()?,
        tip_force_n: next()?,
    })
}

/// Scores of the answers in these folders to the streams of `folder`, best F1 within 0.5 mm first.
///
/// # Errors [`Error::Request`] with file and line.
pub fn score_online(folder: &Path, answers: &[PathBuf]) -> Result<Vec<EntrantScore>, Error> {
    let streams = streams_with_truth(folder).map_err(request)?;
    let mut scores = answers
        .iter()
        .map(|answers| Ok(score_entrant(&streams, &read_answers(answers, &streams).map_err(request)?)))
        .collect::<Result<Vec<_>, Error>>()?;
    let f1 = |s: &EntrantScore| s.all.f1_half_mm.value.unwrap_or(0.0);
    scores.sort_by(|a, b| f1(b).total_cmp(&f1(a)));
    Ok(scores)
}

/// The files that `stylet benchmark judge-online` writes.
///
/// # Errors
/// [`Error::Internal`] when a value cannot be written.
pub fn online_files(scores: &[EntrantScore]) -> Result<OutputFiles, Error> {
    let mut output = OutputFiles::default();
    output.add_json("online.json", &scores)?;
    output.add("report.html", stylet_report::pages::online_benchmark::page(scores).to_html());
    Ok(output)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::OnlineExport;
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("stylet-online-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    fn exported(folder: &Path) -> PathBuf {
        let rows = ["constant".to_owned()];
        let export = OnlineExport {
            world: "plain",
            rows: &rows,
            split: "make",
            cases: 3,
            seed: 4,
            measured: None,
            parquet: false,
        };
        let streams = folder.join("streams");
        export.write(&streams).unwrap();
        streams
    }

    #[test]
    fn a_reply_has_up_to_four_numbers_any_of_which_may_be_left_out() {
        assert_eq!(parse_reply(""), Ok(Reply::default()));
        let all = Reply { event: true, drop_n: Some(0.5), confidence: Some(0.9), tip_force_n: Some(1.5) };
        assert_eq!(parse_reply("1,0.5,0.9,1.5"), Ok(all));
        assert_eq!(parse_reply(",,,1.5"), Ok(Reply { tip_force_n: Some(1.5), ..Reply::default() }));
        assert!(parse_reply("0").is_ok_and(|r| !r.event));
        assert!(parse_reply("yes").is_err_and(|e| e.contains("`yes`")));
    }

    #[test]
    fn the_core_finds_the_punctures_and_a_silent_program_none() {
        let folder = scratch("silent");
        let streams = exported(&folder);
        let (core, silent) = (folder.join("core"), folder.join("silent"));
        replay_streams(&streams, &TestedDetector::Core(Algorithm::Stylet), "Stylet", &core, 2, &|| {})
            .unwrap();
        // One empty line per sample.
        let program = ["sh", "-c", "while read -r line; do case $line in start*) ;; *) echo;; esac; done"];
        let program = TestedDetector::Program(program.map(str::to_owned).to_vec());
        replay_streams(&streams, &program, "silent", &silent, 1, &|| {}).unwrap();
        let scores = score_online(&streams, &[silent, core]).unwrap();
        assert_eq!(scores.iter().map(|s| s.entrant.as_str()).collect::<Vec<_>>(), ["Stylet", "silent"]);
        assert!(scores[0].all.missed <= 1 && scores[0].all.false_alarms <= 1, "{:?}", scores[0].all);
        assert!(scores[0].all.enhancement_error.is_some_and(|e| e < 0.5), "{:?}", scores[0].all);
        assert_eq!(scores[1].all.missed, scores[1].all.punctures);
        let _ = std::fs::remove_dir_all(folder);
    }

    #[test]
    fn a_program_that_ends_or_replies_invalidly_is_reported_with_the_sample_and_leaves_no_answers() {
        let folder = scratch("wrong");
        let streams = exported(&folder);
        for (script, expected) in [
            (
                "read -r a; read -r b; echo; read -r c; echo nonsense; cat >/dev/null",
                "sample 2: the reply `nonsense`",
            ),
            ("read -r a; exit 0", "sample 1"),
        ] {
            let program = TestedDetector::Program(vec!["sh".to_owned(), "-c".to_owned(), script.to_owned()]);
            let out = folder.join("answers");
            let error = replay_streams(&streams, &program, "x", &out, 1, &|| {}).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
            assert!(!out.exists() && !folder.join("answers.part").exists());
        }
        let _ = std::fs::remove_dir_all(folder);
    }
}
