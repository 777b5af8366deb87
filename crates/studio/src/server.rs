//! The local server: one page, the messages of [`Studio`], uploads, and the result files of the workspace.
//!
//! It listens on the loopback interface only. Every address begins with a random token; `Host` and `Origin` must be the server's own. The
//! page may load only its own files, and no inline script. Connections, request bodies and waiting times are bounded. Uploads go to a
//! temporary folder, which is removed at the end.

use crate::http::{Access, HttpServer, Limits, plain, respond, with_policy};
use crate::messages::Problem;
use crate::page;
use crate::studio::Studio;
use axum::Router;
use axum::body::{Body, HttpBody as _, to_bytes};
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::Response;
use axum::routing::{get, post};
use http_body_util::{BodyExt as _, LengthLimitError, Limited};
use std::io::{self, Write as _};
use std::net::{Ipv4Addr, TcpListener};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::time::timeout;

/// Connections served at a time; further ones wait in the system's queue.
const MAX_CONNECTIONS: usize = 512;
/// Bytes of a connection that are held in memory.
const BUFFER_BYTES: usize = 1 << 17;
const CONNECTION_LIFETIME: Duration = Duration::from_secs(300);
/// Longest pause inside the body of a request.
const BODY_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest message in bytes.
const MAX_MESSAGE_BYTES: usize = 1 << 20;
/// Largest recording in bytes: 10 million samples as CSV.
const MAX_UPLOAD_BYTES: usize = 512 << 20;
/// Bytes of randomness in the address.
const TOKEN_BYTES: usize = 16;
/// Policy of a result file: it may run its own scripts, without access to anything else, including the page.
const FILE_POLICY: &str = "sandbox allow-scripts allow-downloads; default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
     img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// State of all connections.
struct Shared {
    studio: Mutex<Studio>,
    uploads: tempfile::TempDir,
}

/// A running server; it ends when it is dropped.
pub struct Server {
    http: HttpServer,
    token: String,
}

impl Server {
    /// Starts a server on this port of the loopback interface (0: any free one).
    ///
    /// # Errors
    /// When the port is in use, or a temporary folder cannot be made.
    pub fn start(studio: Studio, port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let port = listener.local_addr()?.port();
        let token = random_token()?;
        let own_host = Box::new(move |host: &str| {
            ["127.0.0.1", "localhost"].iter().any(|own| *host == format!("{own}:{port}"))
        });
        let access = Access { own_host, token: Some(token.clone()) };
        let shared = Shared {
            studio: Mutex::new(studio),
            uploads: tempfile::Builder::new().prefix("stylet-studio-").tempdir()?,
        };
        let limits = Limits {
            connections: MAX_CONNECTIONS,
            refused: None,
            buffer_bytes: BUFFER_BYTES,
            lifetime: CONNECTION_LIFETIME,
        };
        Ok(Self { http: HttpServer::start(listener, router(Arc::new(shared)), access, limits)?, token })
    }

    /// Address of the page, with the token.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.http.address, self.token)
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
        .with_state(shared)
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

/// Runs `work` on a separate thread; a panic there is reported and the studio remains usable.
async fn with_studio<T: Send + 'static>(
    shared: Arc<Shared>,
    work: impl FnOnce(&mut Studio) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let work = move || work(&mut shared.studio.lock().unwrap_or_else(PoisonError::into_inner));
    tokio::task::spawn_blocking(work)
        .await
        .unwrap_or_else(|_| Err(Problem::new("internal error in this request; please report it")))
}

async fn upload(
    State(shared): State<Arc<Shared>>,
    Path((_, name)): Path<(String, String)>,
    body: Body,
) -> Response {
    const TOO_LARGE: &str = "a recording has at most 512 MB; cut it to the insertion";
    if body.size_hint().lower() > MAX_UPLOAD_BYTES as u64 {
        return plain(StatusCode::PAYLOAD_TOO_LARGE, TOO_LARGE);
    }
    let failed = |why: io::Error| json(Err(Problem::new(format!("the upload cannot be stored: {why}"))));
    let mut received = match tempfile::NamedTempFile::new_in(shared.uploads.path()) {
        Ok(file) => file,
        Err(why) => return failed(why),
    };
    let mut body = Limited::new(body, MAX_UPLOAD_BYTES);
    loop {
        let frame = match timeout(BODY_TIMEOUT, body.frame()).await {
            Ok(None) => break,
            Ok(Some(Ok(frame))) => frame,
            Ok(Some(Err(why))) if why.is::<LengthLimitError>() => {
                return plain(StatusCode::PAYLOAD_TOO_LARGE, TOO_LARGE);
            }
            Ok(Some(Err(_))) => return plain(StatusCode::BAD_REQUEST, "the upload ended early"),
            Err(_) => return plain(StatusCode::REQUEST_TIMEOUT, "the upload stopped"),
        };
        if let Some(Err(why)) = frame.data_ref().map(|data| received.write_all(data)) {
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
    with_policy(respond(StatusCode::OK, kind, content), FILE_POLICY)
}
