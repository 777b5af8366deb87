//! `stylet listen`: the online core on a stream of samples.

use crate::cli::args::ListenArgs;
use crate::cli::exit_codes::Failure;
use std::io::{BufRead, Write};
use std::net::{TcpListener, UdpSocket};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stylet_live::{Broadcast, Session};
use stylet_scenario::EnhancerConfigFile;

/// The largest datagram there is.
const DATAGRAM: usize = 65_536;
/// Between two looks at the clock when nothing comes.
const PATIENCE: Duration = Duration::from_millis(100);

/// The command.
///
/// # Errors
/// [`Failure`] with the exit code that fits.
pub fn listen(args: &ListenArgs) -> Result<(), Failure> {
    let config = args.config.as_deref().map(EnhancerConfigFile::load).transpose()?.unwrap_or_default();
    let hub = Arc::new(Broadcast::default());
    let mut session = Session::new(&config, hub.clone());
    let bind = |what: &str, why: std::io::Error| Failure::Check(format!("{what}: {why}"));
    let socket = args.udp.map(|port| {
        UdpSocket::bind((args.host.as_str(), port))
            .map_err(|e| bind(&format!("--udp {port}: cannot be heard"), e))
    });
    let socket = socket.transpose()?;
    let mut readers = Vec::new();
    if !args.quiet {
        readers.push(printed(&hub));
    }
    if let Some(to) = &args.forward {
        readers.push(forwarded(&hub, to).map_err(|e| bind(&format!("--forward {to}"), e))?);
    }
    if let Some(port) = args.page {
        let page = TcpListener::bind((args.host.as_str(), port));
        let page = page.map_err(|e| bind(&format!("--page {port}: cannot be served"), e))?;
        let address = page.local_addr().map_err(|e| bind("--page", e))?;
        crate::cli::terminal_output::print_error(&format!("live page: http://{address}/\n"));
        let hub = hub.clone();
        std::thread::spawn(move || stylet_live::serve_page(page, hub));
    }
    match socket {
        Some(socket) => from_udp(&socket, &mut session, args.duration_s)?,
        None => from_lines(&mut session)?,
    }
    hub.close();
    for reader in readers {
        // A reader that panicked has said so itself.
        let _ = reader.join();
    }
    let json = serde_json::to_string(&session.counts()).map_err(Failure::internal)?;
    crate::cli::terminal_output::print_error(&format!("{json}\n"));
    Ok(())
}

fn complain(bad: &stylet_live::InvalidLine, told: &mut bool) {
    // Once: a stream of nonsense would bury everything else. The count is in the summary.
    if !std::mem::replace(told, true) {
        crate::cli::terminal_output::print_error(&format!("{bad} (further ones are counted)\n"));
    }
}

fn from_udp(socket: &UdpSocket, session: &mut Session, duration_s: Option<f64>) -> Result<(), Failure> {
    let failed = |e: std::io::Error| Failure::Check(format!("--udp: {e}"));
    socket.set_read_timeout(Some(PATIENCE)).map_err(failed)?;
    let end = duration_s.map(|s| Instant::now() + Duration::from_secs_f64(s));
    let mut datagram = vec![0; DATAGRAM];
    let mut told = false;
    while end.is_none_or(|end| Instant::now() < end) {
        match socket.recv(&mut datagram) {
            Ok(length) => {
                let arrived = Instant::now();
                let text = String::from_utf8_lossy(&datagram[..length]);
                if text.trim() == "end" {
                    break;
                }
                if let Err(bad) = session.process_text(&text, arrived) {
                    complain(&bad, &mut told);
                }
            }
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {}
            Err(e) => return Err(failed(e)),
        }
    }
    Ok(())
}

fn from_lines(session: &mut Session) -> Result<(), Failure> {
    let mut told = false;
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|e| Failure::Check(format!("standard input: {e}")))?;
        if let Err(bad) = session.process_text(if line.is_empty() { " " } else { &line }, Instant::now()) {
            complain(&bad, &mut told);
        }
    }
    Ok(())
}

/// A thread that prints every line, as fast as the terminal takes them.
fn printed(hub: &Broadcast) -> JoinHandle<()> {
    let reader = hub.subscribe();
    std::thread::spawn(move || {
        let mut out = std::io::stdout().lock();
        while let Some(lines) = reader.take(PATIENCE) {
            let written = lines.iter().try_for_each(|line| writeln!(out, "{line}"));
            if written.and_then(|()| out.flush()).is_err() {
                break;
            }
        }
        reader.unsubscribe();
    })
}

/// A thread that sends every line as a datagram.
fn forwarded(hub: &Broadcast, to: &str) -> std::io::Result<JoinHandle<()>> {
    let socket = UdpSocket::bind(("0.0.0.0", 0))?;
    socket.connect(to)?;
    let reader = hub.subscribe();
    Ok(std::thread::spawn(move || {
        while let Some(lines) = reader.take(PATIENCE) {
            for line in lines {
                // Nobody may be listening yet.
                let _ = socket.send(line.as_bytes());
            }
        }
        reader.unsubscribe();
    }))
}
