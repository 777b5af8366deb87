//! A local page with live curves: a small HTTP server with two addresses, the page and its event stream.

use super::broadcast::Broadcast;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

/// Interval between updates: faster than the eye, slow enough for a browser.
const UPDATE_INTERVAL: Duration = Duration::from_millis(40);
/// A browser that accepts nothing for this long is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(60);

/// Serves the page until the program ends; every browser has a ring of its own.
pub fn serve_page(listener: TcpListener, broadcast: Arc<Broadcast>) {
    for stream in listener.incoming().flatten() {
        let broadcast = broadcast.clone();
        // A browser that disconnects ends its own thread only.
        std::thread::spawn(move || drop(answer(stream, &broadcast)));
    }
}

fn answer(mut stream: TcpStream, broadcast: &Broadcast) -> std::io::Result<()> {
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    let mut request = String::new();
    BufReader::new(stream.try_clone()?).read_line(&mut request)?;
    let path = request.split_whitespace().nth(1).unwrap_or("/");
    match path {
        "/events" => send_events(stream, broadcast),
        "/" => {
            let page = stylet_report::live_page::page();
            let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nConnection: close\r\n";
            write!(stream, "{head}Content-Length: {}\r\n\r\n{page}", page.len())
        }
        _ => write!(stream, "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"),
    }
}

fn send_events(mut stream: TcpStream, broadcast: &Broadcast) -> std::io::Result<()> {
    write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n"
    )?;
    let subscriber = broadcast.subscribe();
    let result = loop {
        let Some(lines) = subscriber.take(UPDATE_INTERVAL) else { break Ok(()) };
        if !lines.is_empty() {
            let body = lines.iter().map(|l| &**l).collect::<Vec<_>>().join(",");
            if let Err(why) = write!(stream, "data: [{body}]\n\n").and_then(|()| stream.flush()) {
                break Err(why);
            }
        }
        std::thread::sleep(UPDATE_INTERVAL);
    };
    subscriber.unsubscribe();
    result
}
