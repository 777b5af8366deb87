//! A small HTTP server for pages of this program: a router on a separate thread, bounded in connections, sizes and waiting times, which
//! checks `Host`, `Origin` and token to reject requests of foreign web pages.

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::{self, Next};
use axum::response::Response;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::pin::pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::sync::{Notify, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

/// Timeout for the head of a request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(2);
/// Time for the last request of a connection at the end of its lifetime.
const LAST_REQUEST_TIMEOUT: Duration = Duration::from_secs(60);
/// Pause after a connection that cannot be accepted, as when all file handles are in use.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);
/// Timeout for rejecting a connection.
const REFUSAL_TIMEOUT: Duration = Duration::from_millis(100);
const REFUSAL: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
/// Threads for blocking work.
const WORKERS: usize = 4;

/// Default content security policy: a page may load its own files, and results in frames.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; frame-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Bounds of a server.
pub struct Limits {
    /// Connections at the same time.
    pub connections: usize,
    /// Counter of further connections, which are answered with 503; without a counter they wait in the system's queue.
    pub refused: Option<Arc<AtomicU64>>,
    /// Bytes of a connection in memory, and so of the head of a request.
    pub buffer_bytes: usize,
    /// Lifetime of a connection, after which it ends with the request in progress.
    pub lifetime: Duration,
}

/// Request extension that ends the connection.
pub type ConnectionAbortHandle = Arc<OnceLock<AbortHandle>>;

/// Access rules for requests.
pub struct Access {
    /// Whether a `Host` value, with its port, is this server.
    pub own_host: Box<dyn Fn(&str) -> bool + Send + Sync>,
    /// First part of every path, if there is a token.
    pub token: Option<String>,
}

/// A running server; it ends when it is dropped.
pub struct HttpServer {
    pub address: SocketAddr,
    stop: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

impl HttpServer {
    /// Serves `router`, behind the check of `access`, on a bound socket.
    ///
    /// # Errors
    /// When socket, runtime or thread cannot be set up.
    pub fn start(listener: TcpListener, router: Router, access: Access, limits: Limits) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let router = router
            .fallback(async || plain(StatusCode::NOT_FOUND, "there is no such page"))
            .layer(middleware::from_fn_with_state(Arc::new(access), guard));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(WORKERS)
            .build()?;
        let stop = Arc::new(Notify::new());
        let stopped = stop.clone();
        let thread = std::thread::Builder::new().name("stylet-page".to_owned()).spawn(move || {
            runtime.block_on(async move {
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    tokio::spawn(accept(listener, router, limits));
                    stopped.notified().await;
                }
            });
            runtime.shutdown_timeout(Duration::from_secs(1));
        })?;
        Ok(Self { address, stop, thread: Some(thread) })
    }
}

impl Drop for HttpServer {
    fn drop(&mut self) {
        self.stop.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread was already reported.
            let _ = thread.join();
        }
    }
}

async fn accept(listener: tokio::net::TcpListener, router: Router, limits: Limits) {
    let free = Arc::new(Semaphore::new(limits.connections));
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIMEOUT)
        .max_buf_size(limits.buffer_bytes)
        // If connections are rejected, idle ones must be closed.
        .keep_alive(limits.refused.is_none());
    loop {
        if limits.refused.is_none() {
            // Only this task takes permits, so one stays free.
            drop(free.acquire().await);
        }
        let Ok((stream, _)) = listener.accept().await else {
            sleep(RETRY_INTERVAL).await;
            continue;
        };
        let Ok(permit) = free.clone().try_acquire_owned() else {
            if let Some(refused) = &limits.refused {
                refused.fetch_add(1, Ordering::Relaxed);
            }
            tokio::spawn(timeout(REFUSAL_TIMEOUT, refuse(stream)));
            continue;
        };
        let closing = ConnectionAbortHandle::default();
        let service = TowerToHyperService::new(router.clone().layer(Extension(closing.clone())));
        let connection = http.serve_connection(TokioIo::new(stream), service);
        let task = tokio::spawn(async move {
            let mut connection = pin!(connection);
            // A client that disconnects ends its own connection only.
            if timeout(limits.lifetime, connection.as_mut()).await.is_err() {
                connection.as_mut().graceful_shutdown();
                let _ = timeout(LAST_REQUEST_TIMEOUT, connection).await;
            }
            drop(permit);
        });
        let _ = closing.set(task.abort_handle());
    }
}

async fn refuse(stream: TcpStream) -> io::Result<()> {
    stream.writable().await?;
    stream.try_write(REFUSAL).map(drop)
}

/// Rejects requests that do not come from the page itself, and adds headers to every answer.
async fn guard(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let mut response = match refusal(&access, request.headers(), request.uri()) {
        Some((status, why)) => plain(status, why),
        None => next.run(request).await,
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(POLICY));
    for (name, value) in [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

fn refusal(access: &Access, headers: &HeaderMap, uri: &Uri) -> Option<(StatusCode, &'static str)> {
    let values = |name| headers.get_all(name).iter().map(|value| value.to_str().unwrap_or_default());
    let own = |host: &str| (access.own_host)(host);
    // Without a token, clients of HTTP/1.0 may read.
    let unnamed = access.token.is_some() && !headers.contains_key(header::HOST);
    // A request may name its host in its first line as well.
    let in_address = uri.authority().map(|a| a.as_str());
    if unnamed || !values(header::HOST).chain(in_address).all(own) {
        return Some((StatusCode::MISDIRECTED_REQUEST, "wrong Host: open the address that stylet printed"));
    }
    if !values(header::ORIGIN).all(|origin| origin.strip_prefix("http://").is_some_and(own)) {
        return Some((StatusCode::FORBIDDEN, "wrong Origin: only the page itself may send requests"));
    }
    let given = uri.path().trim_start_matches('/').split('/').next().unwrap_or_default();
    match &access.token {
        Some(token) if !equal_in_constant_time(given.as_bytes(), token.as_bytes()) => {
            Some((StatusCode::FORBIDDEN, "no access without the token in the address that stylet printed"))
        }
        _ => None,
    }
}

/// Constant-time comparison.
fn equal_in_constant_time(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |all, (x, y)| all | (x ^ y)) == 0
}

pub fn respond(status: StatusCode, kind: &'static str, body: impl Into<Body>) -> Response {
    let mut response = Response::new(body.into());
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

pub fn plain(status: StatusCode, text: &'static str) -> Response {
    respond(status, "text/plain; charset=utf-8", text)
}

/// Sets the content security policy of a response that must load more than [`POLICY`] allows.
pub fn with_policy(mut response: Response, policy: &'static str) -> Response {
    response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
    response
}
