//! `stylet listen`: the online core on a live stream of samples.

use crate::cli::args::ListenArgs;
use crate::cli::exit_codes::Failure;
use std::io::{BufRead, ErrorKind, Write};
use std::net::{TcpListener, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stylet_api::live_stream::{Broadcast, InvalidLine, Session, serve_page};
use stylet_scenario::EnhancerConfigFile;

/// Largest datagram in bytes.
const MAX_DATAGRAM_BYTES: usize = 65_536;
/// Longest time without a look at the clock.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn listen(args: &ListenArgs) -> Result<(), Failure> {
    let config = args.config.as_deref().map(EnhancerConfigFile::load).transpose()?.unwrap_or_default();
    let broadcast = Arc::new(Broadcast::default());
    let mut session = Session::new(&config, broadcast.clone());
    let bind = |what: &str, why: std::io::Error| Failure::Check(format!("{what}: {why}"));
    let socket = args.udp.map(|port| {
        UdpSocket::bind((args.host.as_str(), port))
            .map_err(|e| bind(&format!("--udp {port}: cannot bind"), e))
    });
    let socket = socket.transpose()?;
    let mut threads = Vec::new();
    if !args.quiet {
        threads.push(print_lines(&broadcast));
    }
    if let Some(to) = &args.forward {
        threads.push(forward_lines(&broadcast, to).map_err(|e| bind(&format!("--forward {to}"), e))?);
    }
    if let Some(port) = args.page {
        let page = TcpListener::bind((args.host.as_str(), port));
        let page = page.map_err(|e| bind(&format!("--page {port}: cannot bind"), e))?;
        let address = page.local_addr().map_err(|e| bind("--page", e))?;
        crate::cli::terminal_output::print_error(&format!("live page: http://{address}/\n"));
        let broadcast = broadcast.clone();
        std::thread::spawn(move || serve_page(page, broadcast));
    }
    match socket {
        Some(socket) => read_udp(&socket, &mut session, args.duration_s)?,
        None => read_stdin(&mut session)?,
    }
    broadcast.close();
    for thread in threads {
        // A thread that panicked has reported it.
        let _ = thread.join();
    }
    let json = serde_json::to_string(&session.counts()).map_err(Failure::internal)?;
    crate::cli::terminal_output::print_error(&format!("{json}\n"));
    Ok(())
}

/// Reports the first invalid line only; the number is in the summary.
fn report_invalid(invalid: &InvalidLine, reported: &mut bool) {
    if !std::mem::replace(reported, true) {
        crate::cli::terminal_output::print_error(&format!("{invalid} (further ones are counted)\n"));
    }
}

fn read_udp(socket: &UdpSocket, session: &mut Session, duration_s: Option<f64>) -> Result<(), Failure> {
    let failed = |e: std::io::Error| Failure::Check(format!("--udp: {e}"));
    socket.set_read_timeout(Some(POLL_INTERVAL)).map_err(failed)?;
    let end = duration_s.map(|s| Instant::now() + Duration::from_secs_f64(s));
    let mut datagram = vec![0; MAX_DATAGRAM_BYTES];
    let mut reported = false;
    while end.is_none_or(|end| Instant::now() < end) {
        match socket.recv(&mut datagram) {
            Ok(length) => {
                let arrived = Instant::now();
                let text = String::from_utf8_lossy(&datagram[..length]);
                if text.trim() == "end" {
                    break;
                }
                if let Err(invalid) = session.process_text(&text, arrived) {
                    report_invalid(&invalid, &mut reported);
                }
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(e) => return Err(failed(e)),
        }
    }
    Ok(())
}

fn read_stdin(session: &mut Session) -> Result<(), Failure> {
    let mut reported = false;
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|e| Failure::Check(format!("standard input: {e}")))?;
        // An empty line counts in the line numbers.
        let line = if line.is_empty() { " " } else { &line };
        if let Err(invalid) = session.process_text(line, Instant::now()) {
            report_invalid(&invalid, &mut reported);
        }
    }
    Ok(())
}

/// Starts a thread that prints every line, as fast as the terminal accepts them.
fn print_lines(broadcast: &Broadcast) -> JoinHandle<()> {
    let subscriber = broadcast.subscribe();
    std::thread::spawn(move || {
        let mut out = std::io::stdout().lock();
        while let Some(lines) = subscriber.take(POLL_INTERVAL) {
            let written = lines.iter().try_for_each(|line| writeln!(out, "{line}"));
            if written.and_then(|()| out.flush()).is_err() {
                break;
            }
        }
        subscriber.unsubscribe();
    })
}

/// Starts a thread that sends every line as a datagram.
fn forward_lines(broadcast: &Broadcast, to: &str) -> std::io::Result<JoinHandle<()>> {
    let socket = UdpSocket::bind(("0.0.0.0", 0))?;
    socket.connect(to)?;
    let subscriber = broadcast.subscribe();
    Ok(std::thread::spawn(move || {
        while let Some(lines) = subscriber.take(POLL_INTERVAL) {
            for line in lines {
                // There may be no receiver yet.
                let _ = socket.send(line.as_bytes());
            }
        }
        subscriber.unsubscribe();
    }))
}
