//! `stylet listen`: the online core on a live stream of samples.

mod outputs;
mod poll_interval;
mod reporter;
mod udp_receiver;

use crate::cli::args::ListenArgs;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print_error;
use outputs::{Forwarder, Printer};
use poll_interval::POLL_INTERVAL;
use reporter::Reporter;
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};
use stylet_api::live_stream::{Broadcast, LineSplitter, Session, StreamCounts};
use stylet_scenario::EnhancerConfigFile;
#[cfg(feature = "studio")]
use stylet_studio::LiveServer;
use udp_receiver::{Received, UdpReceiver};

/// Longest time after a signal for printing the last lines.
const LAST_LINES_TIMEOUT: Duration = Duration::from_secs(2);
/// Bytes of standard input that are read at once, and pieces that may wait.
const PIECE_BYTES: usize = 1 << 16;
const WAITING_PIECES: usize = 16;
/// Exit code after a second signal: 128 and the number of SIGINT.
const INTERRUPTED_AGAIN: i32 = 130;

/// Stop conditions: a signal, a failed output, or the duration.
struct StopConditions {
    requested: Arc<AtomicBool>,
    at: Option<Instant>,
}

impl StopConditions {
    fn new(duration_s: Option<f64>) -> Result<Self, Failure> {
        let requested = Arc::new(AtomicBool::new(false));
        let flag = requested.clone();
        let handler = move || {
            if flag.swap(true, Ordering::AcqRel) {
                std::process::exit(INTERRUPTED_AGAIN);
            }
        };
        ctrlc::set_handler(handler).map_err(Failure::internal)?;
        Ok(Self { requested, at: duration_s.map(|s| Instant::now() + Duration::from_secs_f64(s)) })
    }

    fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Acquire)
    }

    fn is_reached(&self) -> bool {
        self.is_requested() || self.at.is_some_and(|at| Instant::now() >= at)
    }
}

/// Runs the command.
///
/// # Errors [`Failure`] with its exit code; the summary is printed in any case.
pub fn listen(args: &ListenArgs) -> Result<(), Failure> {
    let mut config = args.config.as_deref().map(EnhancerConfigFile::load).transpose()?.unwrap_or_default();
    if let Some(contact) = args.contact {
        config.enhance.contact = contact.setting();
    }
    let broadcast = Arc::new(Broadcast::default());
    let mut session = Session::new(&config, broadcast.clone());
    let mut receiver = args.udp.map(|port| UdpReceiver::bind(&args.host, port)).transpose()?;
    let forwarder = match &args.forward {
        Some(to) => Some(Forwarder::start(&broadcast, to, receiver.as_ref().and_then(UdpReceiver::address))?),
        None => None,
    };
    let page = args.page.map(|port| serve_page(&args.host, port, &broadcast)).transpose()?;
    let end = StopConditions::new(args.duration_s)?;
    let only_printed = args.page.is_none() && args.forward.is_none();
    let printer = match args.quiet {
        true => None,
        false => Some(Printer::start(&broadcast, only_printed.then(|| end.requested.clone()))?),
    };
    let mut reporter = Reporter::default();
    let read = match &mut receiver {
        Some(receiver) => read_udp(receiver, &mut session, &broadcast, &mut reporter, &end),
        None => read_stdin(&mut session, &broadcast, &mut reporter, &end),
    };
    broadcast.close();
    let wait = end.is_requested().then_some(LAST_LINES_TIMEOUT);
    let printed = printer.map_or(Ok(()), |printer| printer.finish(wait));
    let counts = StreamCounts {
        dropped_by_system: receiver.as_ref().map_or(Some(0), UdpReceiver::dropped),
        refused_readers: page.map_or(0, |page| page.refused()),
        not_forwarded: forwarder.map_or(0, |forwarder| forwarder.finish(wait)),
        ..session.counts()
    };
    let json = serde_json::to_string(&counts).map_err(Failure::internal)?;
    print_error(&format!("{json}\n"));
    read.and(printed)
}

#[cfg(feature = "studio")]
fn serve_page(host: &str, port: u16, broadcast: &Arc<Broadcast>) -> Result<LiveServer, Failure> {
    let page = LiveServer::start(host, port, broadcast.clone())
        .map_err(|why| Failure::Check(format!("--page {port}: cannot bind: {why}")))?;
    print_error(&format!("live page: http://{}/\n", page.address()));
    Ok(page)
}

/// Placeholder for the page in a build without it.
#[cfg(not(feature = "studio"))]
struct LiveServer;

#[cfg(not(feature = "studio"))]
impl LiveServer {
    fn refused(&self) -> u64 {
        0
    }
}

#[cfg(not(feature = "studio"))]
fn serve_page(_: &str, port: u16, _: &Arc<Broadcast>) -> Result<LiveServer, Failure> {
    let what = "this program was built without the feature `studio`, which serves the page";
    Err(Failure::Check(format!("--page {port}: {what}; use --forward")))
}

fn read_udp(
    receiver: &mut UdpReceiver,
    session: &mut Session,
    broadcast: &Broadcast,
    reporter: &mut Reporter,
    end: &StopConditions,
) -> Result<(), Failure> {
    while !end.is_reached() {
        match receiver.receive()? {
            Received::Datagram(bytes) if bytes.trim_ascii() == b"end" => break,
            Received::Datagram(bytes) => {
                session.process_datagram(bytes, Instant::now(), &mut |report| reporter.print(&report));
            }
            Received::Nothing => broadcast.flush(),
        }
    }
    Ok(())
}

/// A piece of standard input and the time of its arrival.
type Piece = std::io::Result<(Vec<u8>, Instant)>;

fn read_stdin(
    session: &mut Session,
    broadcast: &Broadcast,
    reporter: &mut Reporter,
    end: &StopConditions,
) -> Result<(), Failure> {
    let failed = |why: std::io::Error| Failure::Check(format!("standard input: {why}"));
    // A read of standard input cannot be interrupted; the thread ends with the program.
    let (sender, pieces) = sync_channel(WAITING_PIECES);
    std::thread::Builder::new().spawn(move || send_pieces(&sender)).map_err(failed)?;
    let mut splitter = LineSplitter::default();
    let mut report = |report| reporter.print(&report);
    let mut outcome = Ok(());
    while !end.is_reached() {
        match pieces.recv_timeout(POLL_INTERVAL) {
            Ok(Ok((piece, arrived))) => {
                splitter.push(&piece, |line| session.process_line(line, arrived, &mut report));
            }
            Ok(Err(why)) => {
                outcome = Err(failed(why));
                break;
            }
            Err(RecvTimeoutError::Timeout) => broadcast.flush(),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    // Process what had arrived before a signal.
    for (piece, arrived) in pieces.try_iter().take(WAITING_PIECES).flatten() {
        splitter.push(&piece, |line| session.process_line(line, arrived, &mut report));
    }
    splitter.finish(|line| session.process_line(line, Instant::now(), &mut report));
    outcome
}

fn send_pieces(sender: &SyncSender<Piece>) {
    let mut input = std::io::stdin().lock();
    let mut buffer = vec![0; PIECE_BYTES];
    loop {
        let piece = match input.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => Ok((buffer[..count].to_vec(), Instant::now())),
            Err(why) if why.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(why) => Err(why),
        };
        let last = piece.is_err();
        if sender.send(piece).is_err() || last {
            return;
        }
    }
}
