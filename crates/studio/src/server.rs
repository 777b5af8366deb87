//! The local server: one page, the messages of [`Studio`], uploads, and the result files of the workspace.
//!
//! It listens on the loopback interface only. Every address begins with a random token; `Host` and `Origin` must be the server's own. The
//! page may load nothing but its own files, and no inline script. Connections, request bodies and waiting times are bounded. Uploads go to
//! a temporary folder, which is removed at the end.

use crate::messages::Problem;
use crate::page;
use crate::studio::Studio;
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Path, Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::{self, Next};
use axum::response::Response;
use axum::routing::{get, post};
use http_body_util::BodyExt as _;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io::{self, Write as _};
use std::net::{Ipv4Addr, SocketAddr};
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{Notify, Semaphore};
use tokio::time::timeout;

/// Connections served at a time; further ones wait in the system's queue.
const MAX_CONNECTIONS: usize = 512;
/// Time in which a client must send the head of its request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(2);
/// Longest pause inside the body of a request.
const BODY_TIMEOUT: Duration = Duration::from_secs(10);
/// Lifetime of a connection; then it ends after the request in progress.
const CONNECTION_LIFETIME: Duration = Duration::from_secs(300);
/// Time for the last request of a connection at the end of its lifetime.
const LAST_REQUEST_TIMEOUT: Duration = Duration::from_secs(60);
/// Longest message in bytes.
const MAX_MESSAGE_BYTES: usize = 1 << 20;
/// Largest recording in bytes: 10 million samples as CSV.
const MAX_UPLOAD_BYTES: u64 = 512 << 20;
/// Bytes of randomness in the address.
const TOKEN_BYTES: usize = 16;
/// Threads that answer messages.
const WORKERS: usize = 4;

/// What the page may load: its own files, and results in frames.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; frame-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// A result file may run its own scripts without access to anything, the page included.
const FILE_POLICY: &str = "sandbox allow-scripts allow-downloads; default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
     img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// State of all connections.
struct Shared {
    token: String,
    port: u16,
    studio: Mutex<Studio>,
    uploads: tempfile::TempDir,
}

/// A running server; it ends when it is dropped.
pub struct Server {
    address: SocketAddr,
    token: String,
    stop: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts a server on this port of the loopback interface (0: any free one).
    ///
    /// # Errors
    /// When the port is in use, or a temporary folder cannot be made.
    pub fn start(studio: Studio, port: u16) -> io::Result<Self> {
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let token = random_token()?;
        let shared = Arc::new(Shared {
            token: token.clone(),
            port: address.port(),
            studio: Mutex::new(studio),
            uploads: tempfile::Builder::new().prefix("stylet-studio-").tempdir()?,
        });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(WORKERS)
            .build()?;
        let stop = Arc::new(Notify::new());
        let stopped = stop.clone();
        let thread = std::thread::Builder::new().name("stylet-studio".to_owned()).spawn(move || {
            runtime.block_on(async move {
                if let Ok(listener) = TcpListener::from_std(listener) {
                    tokio::spawn(accept(listener, router(shared)));
                    stopped.notified().await;
                }
            });
            runtime.shutdown_timeout(Duration::from_secs(1));
        })?;
        Ok(Self { address, token, stop, thread: Some(thread) })
    }

    /// Address of the page, with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Waits for Ctrl-C or the end of the process by a signal.
    ///
    /// # Errors
    /// When no signal can be received.
    pub fn wait_for_signal(&self) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(async {
            #[cfg(unix)]
            {
                let ended = Arc::new(Notify::new());
                for kind in
                    [tokio::signal::unix::SignalKind::terminate(), tokio::signal::unix::SignalKind::hangup()]
                {
                    let mut signal = tokio::signal::unix::signal(kind)?;
                    let ended = ended.clone();
                    tokio::spawn(async move {
                        signal.recv().await;
                        ended.notify_one();
                    });
                }
                let interrupted = ended.clone();
                tokio::spawn(async move {
                    let _ = tokio::signal::ctrl_c().await;
                    interrupted.notify_one();
                });
                ended.notified().await;
                Ok(())
            }
            #[cfg(not(unix))]
            tokio::signal::ctrl_c().await
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.notify_one();
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has reported it.
            let _ = thread.join();
        }
    }
}

fn random_token() -> io::Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/{token}/", get(index))
        .route("/{token}/{asset}", get(asset))
        .route("/{token}/api/{name}", post(message))
        .route("/{token}/upload/{name}", post(upload))
        .route("/{token}/file/{folder}/{name}", get(file))
        .fallback(async || plain(StatusCode::NOT_FOUND, "there is no such page"))
        .layer(middleware::from_fn_with_state(shared.clone(), guard))
        .with_state(shared)
}

async fn accept(listener: TcpListener, router: Router) {
    let free = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    loop {
        let Ok(permit) = free.clone().acquire_owned().await else { return };
        let Ok((stream, _)) = listener.accept().await else {
            // Too many open files, or a connection that was aborted.
            tokio::time::sleep(Duration::from_millis(20)).await;
            continue;
        };
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let mut builder = hyper::server::conn::http1::Builder::new();
            builder.timer(TokioTimer::new()).header_read_timeout(HEAD_TIMEOUT);
            let mut connection = pin!(builder.serve_connection(TokioIo::new(stream), service));
            if timeout(CONNECTION_LIFETIME, connection.as_mut()).await.is_err() {
                connection.as_mut().graceful_shutdown();
                let _ = timeout(LAST_REQUEST_TIMEOUT, connection).await;
            }
            drop(permit);
        });
    }
}

/// Refuses what does not come from the page itself, and adds the headers of every answer.
async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let refused = refusal(&shared, request.headers(), request.uri().path());
    let mut response = match refused {
        Some(why) => plain(StatusCode::FORBIDDEN, why),
        None => next.run(request).await,
    };
    let headers = response.headers_mut();
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(PAGE_POLICY));
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

fn refusal(shared: &Shared, headers: &HeaderMap, path: &str) -> Option<&'static str> {
    let own =
        |text: &str| ["127.0.0.1", "localhost"].iter().any(|host| *text == format!("{host}:{}", shared.port));
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    if !text(header::HOST).is_some_and(own) {
        return Some("wrong Host: open the address that `stylet studio` printed");
    }
    if text(header::ORIGIN).is_some_and(|origin| !origin.strip_prefix("http://").is_some_and(own)) {
        return Some("wrong Origin: only the page itself may send requests");
    }
    let token = path.trim_start_matches('/').split('/').next().unwrap_or_default();
    if !equal_in_constant_time(token.as_bytes(), shared.token.as_bytes()) {
        return Some("no access without the token in the address that `stylet studio` printed");
    }
    None
}

/// Comparison whose duration does not depend on where the texts differ.
fn equal_in_constant_time(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |all, (x, y)| all | (x ^ y)) == 0
}

fn respond(status: StatusCode, kind: &'static str, body: impl Into<Body>) -> Response {
    let mut response = Response::new(body.into());
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

fn plain(status: StatusCode, text: &'static str) -> Response {
    respond(status, "text/plain; charset=utf-8", text)
}

fn json(answer: Result<Vec<u8>, Problem>) -> Response {
    const JSON: &str = "application/json";
    match answer {
        Ok(body) => respond(StatusCode::OK, JSON, body),
        Err(problem) => {
            respond(StatusCode::UNPROCESSABLE_ENTITY, JSON, serde_json::to_vec(&problem).unwrap_or_default())
        }
    }
}

async fn index() -> Response {
    respond(StatusCode::OK, "text/html; charset=utf-8", page::INDEX)
}

async fn asset(Path((_, name)): Path<(String, String)>) -> Response {
    match page::asset(&name) {
        Some((kind, text)) => respond(StatusCode::OK, kind, text),
        None => plain(StatusCode::NOT_FOUND, "the page has no such file"),
    }
}

async fn message(
    State(shared): State<Arc<Shared>>,
    Path((_, name)): Path<(String, String)>,
    body: Body,
) -> Response {
    let body = match timeout(BODY_TIMEOUT, to_bytes(body, MAX_MESSAGE_BYTES)).await {
        Ok(Ok(body)) => body,
        Ok(Err(_)) => return plain(StatusCode::PAYLOAD_TOO_LARGE, "a message has at most 1 MB"),
        Err(_) => return plain(StatusCode::REQUEST_TIMEOUT, "the message did not arrive in time"),
    };
    json(with_studio(shared, move |studio| studio.call(&name, &body)).await)
}

/// Runs `work` on a thread of its own; a panic there is reported and leaves the studio usable.
async fn with_studio<T: Send + 'static>(
    shared: Arc<Shared>,
    work: impl FnOnce(&mut Studio) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let work = move || work(&mut lock(&shared.studio));
    tokio::task::spawn_blocking(work)
        .await
        .unwrap_or_else(|_| Err(Problem::new("internal error in this request; please report it")))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn upload(
    State(shared): State<Arc<Shared>>,
    Path((_, name)): Path<(String, String)>,
    headers: HeaderMap,
    mut body: Body,
) -> Response {
    const TOO_LARGE: &str = "a recording has at most 512 MB; cut it to the insertion";
    let announced = headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|bytes| bytes > MAX_UPLOAD_BYTES) {
        return plain(StatusCode::PAYLOAD_TOO_LARGE, TOO_LARGE);
    }
    let failed = |why: io::Error| json(Err(Problem::new(format!("the upload cannot be stored: {why}"))));
    let mut received = match tempfile::NamedTempFile::new_in(shared.uploads.path()) {
        Ok(file) => file,
        Err(why) => return failed(why),
    };
    let mut bytes = 0;
    loop {
        let frame = match timeout(BODY_TIMEOUT, body.frame()).await {
            Ok(None) => break,
            Ok(Some(Ok(frame))) => frame,
            Ok(Some(Err(_))) => return plain(StatusCode::BAD_REQUEST, "the upload ended early"),
            Err(_) => return plain(StatusCode::REQUEST_TIMEOUT, "the upload stopped"),
        };
        let Ok(data) = frame.into_data() else { continue };
        bytes += data.len() as u64;
        if bytes > MAX_UPLOAD_BYTES {
            return plain(StatusCode::PAYLOAD_TOO_LARGE, TOO_LARGE);
        }
        if let Err(why) = received.write_all(&data) {
            return failed(why);
        }
    }
    json(with_studio(shared, move |studio| studio.add_file(&name, received.path())).await)
}

async fn file(
    State(shared): State<Arc<Shared>>,
    Path((_, folder, name)): Path<(String, String, String)>,
) -> Response {
    let wanted = name.clone();
    let read = with_studio(shared, move |studio| studio.result_file(&folder, &wanted)).await;
    let Ok(content) = read else {
        return plain(StatusCode::NOT_FOUND, "the workspace has no such file");
    };
    let kind = match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        _ => "text/plain; charset=utf-8",
    };
    let mut response = respond(StatusCode::OK, kind, content);
    response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(FILE_POLICY));
    response
}
