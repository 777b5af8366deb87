//! One local page with live curves: a small HTTP server that knows two addresses, the page and its stream of events.

use crate::broadcast::Broadcast;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

/// Curves are sent so often, in s: faster than the eye, slow enough for a browser.
const EVERY: Duration = Duration::from_millis(40);
/// A browser that takes nothing for so long is gone.
const STALLED: Duration = Duration::from_secs(60);

/// Serves the page on a listener until the program ends; every browser has a ring of its own.
pub fn serve_page(listener: TcpListener, hub: Arc<Broadcast>) {
    for stream in listener.incoming().flatten() {
        let hub = hub.clone();
        // A browser that goes away ends its own thread only.
        std::thread::spawn(move || drop(answer(stream, &hub)));
    }
}

fn answer(mut stream: TcpStream, hub: &Broadcast) -> std::io::Result<()> {
    stream.set_write_timeout(Some(STALLED))?;
    let mut request = String::new();
    BufReader::new(stream.try_clone()?).read_line(&mut request)?;
    let path = request.split_whitespace().nth(1).unwrap_or("/");
    match path {
        "/events" => events(stream, hub),
        "/" => {
            let page = stylet_report::live_page::page();
            let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nConnection: close\r\n";
            write!(stream, "{head}Content-Length: {}\r\n\r\n{page}", page.len())
        }
        _ => write!(stream, "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"),
    }
}

fn events(mut stream: TcpStream, hub: &Broadcast) -> std::io::Result<()> {
    write!(
        stream,
        "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n"
    )?;
    let reader = hub.subscribe();
    let result = loop {
        let Some(lines) = reader.take(EVERY) else { break Ok(()) };
        if !lines.is_empty() {
            let body = lines.iter().map(|l| &**l).collect::<Vec<_>>().join(",");
            if let Err(gone) = write!(stream, "data: [{body}]\n\n").and_then(|()| stream.flush()) {
                break Err(gone);
            }
        }
        std::thread::sleep(EVERY);
    };
    reader.unsubscribe();
    result
}
