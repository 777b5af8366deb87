//! The page of `stylet listen`: the live curves and their event stream.
//!
//! A slow reader loses lines; one that accepts nothing for long is disconnected. The online algorithm never waits for a reader.

use crate::http::{Access, ConnectionAbortHandle, HttpServer, Limits, respond, with_policy};
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::uri::Authority;
use axum::response::Response;
use axum::routing::get;
use axum::{Extension, Router};
use http_body_util::channel::Channel;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use stylet_api::live_stream::Broadcast;
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

/// Connections at the same time; further ones are answered with 503.
const MAX_READERS: usize = 32;
/// Longest head of a request in bytes.
const MAX_HEAD_BYTES: usize = 8192;
/// Interval between updates: smooth for the eye and slow enough for a browser.
const UPDATE_INTERVAL: Duration = Duration::from_millis(40);
/// Time without progress after which a browser is disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(15);
/// The page is one file with its own script.
const LIVE_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The server of the live page; it ends when it is dropped.
pub struct LiveServer {
    server: HttpServer,
    refused: Arc<AtomicU64>,
}

impl LiveServer {
    /// Serves the lines of `broadcast` at this name or address.
    ///
    /// # Errors
    /// When the socket cannot be bound.
    pub fn start(host: &str, port: u16, broadcast: Arc<Broadcast>) -> io::Result<Self> {
        let listener = TcpListener::bind((host, port))?;
        let bound = host.to_owned();
        let access = Access { own_host: Box::new(move |host| is_own_host(host, &bound)), token: None };
        let refused = Arc::<AtomicU64>::default();
        let limits = Limits {
            connections: MAX_READERS,
            refused: Some(refused.clone()),
            buffer_bytes: MAX_HEAD_BYTES,
            lifetime: Duration::MAX,
        };
        let router = Router::new().route("/", get(index)).route("/events", get(events)).with_state(broadcast);
        Ok(Self { server: HttpServer::start(listener, router, access, limits)?, refused })
    }

    /// The address that it is bound to.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address
    }

    /// Number of connections refused because there were too many.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused.load(Ordering::Relaxed)
    }
}

/// Whether a host with an optional port is this computer by an address or as `localhost`, or the name that the server was bound to.
/// Other names may belong to a foreign web page that resolves them to this computer.
fn is_own_host(given: &str, bound: &str) -> bool {
    let Ok(authority) = given.parse::<Authority>() else { return false };
    let host = authority.host().trim_start_matches('[').trim_end_matches(']');
    let known = host.parse::<IpAddr>().is_ok()
        || ["localhost", bound].iter().any(|own| host.eq_ignore_ascii_case(own));
    known && !given.contains('@')
}

async fn index() -> Response {
    let page = stylet_report::live_page::page();
    with_policy(respond(StatusCode::OK, "text/html; charset=utf-8", page), LIVE_POLICY)
}

async fn events(
    State(broadcast): State<Arc<Broadcast>>,
    Extension(closing): Extension<ConnectionAbortHandle>,
) -> Response {
    let (mut sender, body) = Channel::<Bytes>::new(1);
    tokio::spawn(async move {
        let subscriber = broadcast.subscribe();
        while let Some(lines) = subscriber.take(Duration::ZERO) {
            if !lines.is_empty() {
                let event = format!("data: [{}]\n\n", lines.join(","));
                match timeout(WRITE_TIMEOUT, sender.send_data(event.into())).await {
                    Ok(Ok(())) => {}
                    // The browser has disconnected.
                    Ok(Err(_)) => return,
                    Err(_) => return closing.get().map_or((), AbortHandle::abort),
                }
            }
            sleep(UPDATE_INTERVAL).await;
        }
    });
    respond(StatusCode::OK, "text/event-stream", Body::new(body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_own_host_is_an_address_or_a_name_that_it_was_bound_to() {
        for own in
            ["127.0.0.1:8080", "127.0.0.1", "localhost:1", "LOCALHOST", "[::1]:8080", "[::1]", "lab-pc:80"]
        {
            assert!(is_own_host(own, "lab-pc"), "{own}");
        }
        for foreign in [
            "evil.example",
            "evil.example:8080",
            "localhost.evil.example",
            "",
            "[::1",
            "a:b",
            "lab-pc.evil",
            "evil@localhost",
        ] {
            assert!(!is_own_host(foreign, "lab-pc"), "{foreign}");
        }
        assert!(!is_own_host("", ""));
    }
}
