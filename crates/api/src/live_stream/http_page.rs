//! A local page with live curves: a small HTTP server with two addresses, the page and its event stream.
//!
//! Bounded in every respect: [`MAX_READERS`] connections, [`MAX_REQUEST_BYTES`] per request within [`REQUEST_TIMEOUT`]. Requests
//! for other hosts are refused, so that a foreign web page cannot reach it under a name of its own (DNS rebinding).

use super::broadcast::Broadcast;
use super::http_request::{Request, is_own_host, read_request};
use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Connections at the same time; further ones are answered with 503.
pub const MAX_READERS: usize = 32;
/// Longest request with its headers in bytes.
pub const MAX_REQUEST_BYTES: usize = 8192;
/// Longest time that a request may take.
pub const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between updates: faster than the eye, slow enough for a browser.
const UPDATE_INTERVAL: Duration = Duration::from_millis(40);
/// A browser that accepts nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(15);
/// Longest time for refusing a connection, which the accepting thread does itself.
const REFUSAL_TIMEOUT: Duration = Duration::from_millis(100);
/// Pause after a connection that cannot be accepted, as when all file handles are in use.
const RETRY_INTERVAL: Duration = Duration::from_millis(50);

/// The server of the live page.
pub struct PageServer {
    listener: TcpListener,
    /// Name or address that it was bound to.
    host: String,
    broadcast: Arc<Broadcast>,
    readers: Arc<AtomicUsize>,
    refused: Arc<AtomicU64>,
}

/// A place among the readers, free again when it is dropped.
struct ReaderSlot(Arc<AtomicUsize>);

impl Drop for ReaderSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

impl PageServer {
    /// A server on a bound socket; `host` is the name or address that it was bound to.
    #[must_use]
    pub fn new(listener: TcpListener, host: &str, broadcast: Arc<Broadcast>) -> Self {
        Self { listener, host: host.to_owned(), broadcast, readers: Arc::default(), refused: Arc::default() }
    }

    /// Number of connections refused because there were too many.
    #[must_use]
    pub fn refused(&self) -> Arc<AtomicU64> {
        self.refused.clone()
    }

    /// Serves the page until the program ends.
    pub fn serve(self) {
        for stream in self.listener.incoming() {
            match stream {
                Ok(stream) => self.accept(stream),
                Err(_) => std::thread::sleep(RETRY_INTERVAL),
            }
        }
    }

    fn accept(&self, stream: TcpStream) {
        let slot = ReaderSlot(self.readers.clone());
        if self.readers.fetch_add(1, Ordering::AcqRel) >= MAX_READERS {
            return self.refuse(stream);
        }
        let (broadcast, host) = (self.broadcast.clone(), self.host.clone());
        let spare = stream.try_clone();
        let started = std::thread::Builder::new().spawn(move || {
            // A browser that disconnects ends its own thread only.
            let _ = answer(stream, &host, &broadcast);
            drop(slot);
        });
        if let (Err(_), Ok(stream)) = (started, spare) {
            self.refuse(stream);
        }
    }

    fn refuse(&self, mut stream: TcpStream) {
        self.refused.fetch_add(1, Ordering::Relaxed);
        let _ = stream.set_write_timeout(Some(REFUSAL_TIMEOUT));
        let _ = write_status(&mut stream, "503 Service Unavailable", "Retry-After: 5\r\n");
    }
}

fn write_status(stream: &mut TcpStream, status: &str, headers: &str) -> std::io::Result<()> {
    let response = format!("HTTP/1.1 {status}\r\n{headers}Content-Length: 0\r\nConnection: close\r\n\r\n");
    stream.write_all(response.as_bytes())
}

fn answer(mut stream: TcpStream, host: &str, broadcast: &Arc<Broadcast>) -> std::io::Result<()> {
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    let deadline = Instant::now() + REQUEST_TIMEOUT;
    let request = match read_request(&mut stream, MAX_REQUEST_BYTES, deadline) {
        Ok(request) => request,
        Err(refusal) => return write_status(&mut stream, refusal.status(), ""),
    };
    let Request { method, path, hosts, origin } = request;
    if hosts.iter().any(|h| !is_own_host(h, host)) {
        return write_status(&mut stream, "421 Misdirected Request", "");
    }
    if origin.is_some_and(|origin| !is_own_host(origin.split_once("://").map_or("", |o| o.1), host)) {
        return write_status(&mut stream, "403 Forbidden", "");
    }
    if method != "GET" {
        return write_status(&mut stream, "405 Method Not Allowed", "Allow: GET\r\n");
    }
    match path.as_str() {
        "/events" => send_events(stream, broadcast),
        "/" => {
            let page = stylet_report::live_page::page();
            let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nConnection: close\r\n";
            write!(
                stream,
                "{head}X-Content-Type-Options: nosniff\r\nContent-Length: {}\r\n\r\n{page}",
                page.len()
            )
        }
        _ => write_status(&mut stream, "404 Not Found", ""),
    }
}

fn send_events(mut stream: TcpStream, broadcast: &Arc<Broadcast>) -> std::io::Result<()> {
    write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n"
    )?;
    let subscriber = broadcast.subscribe();
    let mut event = String::new();
    while let Some(lines) = subscriber.take(Duration::ZERO) {
        if !lines.is_empty() {
            event.clear();
            event.push_str("data: [");
            for (k, line) in lines.iter().enumerate() {
                event.push_str(if k == 0 { "" } else { "," });
                event.push_str(line);
            }
            event.push_str("]\n\n");
            drop(lines);
            stream.write_all(event.as_bytes())?;
        }
        std::thread::sleep(UPDATE_INTERVAL);
    }
    Ok(())
}
