//! Threads that pass the lines on: to standard output, and as datagrams.

use super::poll_interval::POLL_INTERVAL;
use crate::cli::exit_codes::Failure;
use crate::cli::terminal_output::print_error;
use std::io::{ErrorKind, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stylet_api::live_stream::{Broadcast, Subscriber};

/// Polling interval for a thread that is ending.
const JOIN_INTERVAL: Duration = Duration::from_millis(10);

/// Waits for a thread, for at most `wait` if given; `None` if it has not ended or has panicked (a panic reports itself).
fn join<T>(thread: JoinHandle<T>, wait: Option<Duration>) -> Option<T> {
    if let Some(wait) = wait {
        let until = Instant::now() + wait;
        while !thread.is_finished() && Instant::now() < until {
            std::thread::sleep(JOIN_INTERVAL);
        }
        if !thread.is_finished() {
            return None;
        }
    }
    thread.join().ok()
}

/// Prints every line, as fast as the terminal accepts them.
pub struct Printer(JoinHandle<std::io::Result<()>>);

impl Printer {
    /// Starts the thread. If standard output cannot be written any more, it sets `stop`, or prints an error if `stop` is not
    /// given.
    pub fn start(broadcast: &Arc<Broadcast>, stop: Option<Arc<AtomicBool>>) -> Result<Self, Failure> {
        let subscriber = broadcast.subscribe();
        let run = move || {
            let printed = print_lines(&subscriber);
            match (&printed, &stop) {
                (Err(_), Some(stop)) => stop.store(true, Ordering::Release),
                (Err(why), None) => {
                    print_error(&format!("standard output: {why}; no more lines are printed\n"))
                }
                (Ok(()), _) => {}
            }
            printed
        };
        std::thread::Builder::new().spawn(run).map(Self).map_err(Failure::Stdout)
    }

    /// Waits for the last lines.
    ///
    /// # Errors [`Failure::Stdout`] when lines could not be printed; a reader that has closed the pipe is not an error.
    pub fn finish(self, wait: Option<Duration>) -> Result<(), Failure> {
        match join(self.0, wait) {
            Some(Err(why)) if why.kind() != ErrorKind::BrokenPipe => Err(Failure::Stdout(why)),
            _ => Ok(()),
        }
    }
}

fn print_lines(subscriber: &Subscriber) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let mut text = String::new();
    while let Some(lines) = subscriber.take(POLL_INTERVAL) {
        text.clear();
        for line in &lines {
            text.push_str(line);
            text.push('\n');
        }
        out.write_all(text.as_bytes())?;
        out.flush()?;
    }
    Ok(())
}

/// Sends every line as a datagram.
pub struct Forwarder {
    thread: JoinHandle<()>,
    not_sent: Arc<AtomicU64>,
}

impl Forwarder {
    /// Starts the thread; `own` is the address at which samples are received.
    pub fn start(broadcast: &Arc<Broadcast>, to: &str, own: Option<SocketAddr>) -> Result<Self, Failure> {
        let wrong = |why: std::io::Error| Failure::Check(format!("--forward {to}: {why}; give HOST:PORT"));
        let target = to.to_socket_addrs().map_err(wrong)?.next();
        let target = target.ok_or_else(|| wrong(ErrorKind::NotFound.into()))?;
        if own.is_some_and(|own| reaches(target, own)) {
            let what = format!(
                "--forward {to}: is the address of --udp, where the lines would be samples again; choose another port"
            );
            return Err(Failure::Check(what));
        }
        let any = if target.is_ipv4() {
            IpAddr::V4(Ipv4Addr::UNSPECIFIED)
        } else {
            IpAddr::V6(Ipv6Addr::UNSPECIFIED)
        };
        let socket = UdpSocket::bind((any, 0)).map_err(wrong)?;
        socket.connect(target).map_err(wrong)?;
        let (subscriber, not_sent) = (broadcast.subscribe(), Arc::new(AtomicU64::new(0)));
        let count = not_sent.clone();
        let run = move || {
            while let Some(lines) = subscriber.take(POLL_INTERVAL) {
                for line in lines {
                    // There may be no receiver yet.
                    if socket.send(line.as_bytes()).is_err() {
                        count.fetch_add(1, Ordering::Relaxed);
                    }
                }
            }
        };
        let thread = std::thread::Builder::new().spawn(run).map_err(wrong)?;
        Ok(Self { thread, not_sent })
    }

    /// Waits for the last lines; returns the number of lines that could not be sent.
    pub fn finish(self, wait: Option<Duration>) -> u64 {
        join(self.thread, wait);
        self.not_sent.load(Ordering::Relaxed)
    }
}

/// Whether a datagram to `target` arrives at a socket bound to `own`.
fn reaches(target: SocketAddr, own: SocketAddr) -> bool {
    let same = target.ip() == own.ip();
    let any = own.ip().is_unspecified() && (target.ip().is_loopback() || target.ip().is_unspecified());
    target.port() == own.port() && (same || any)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_that_leads_back_is_recognised() {
        let address = |text: &str| text.parse::<SocketAddr>().expect("an address");
        for (to, own, back) in [
            ("127.0.0.1:5005", "127.0.0.1:5005", true),
            ("127.0.0.1:5006", "127.0.0.1:5005", false),
            ("127.0.0.1:5005", "0.0.0.0:5005", true),
            ("192.0.2.1:5005", "0.0.0.0:5005", false),
            ("[::1]:5005", "[::]:5005", true),
        ] {
            assert_eq!(reaches(address(to), address(own)), back, "{to} {own}");
        }
    }
}
