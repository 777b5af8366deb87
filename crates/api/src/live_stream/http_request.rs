//! Reading of an HTTP request, bounded in size and time.

use std::io::{ErrorKind, Read};
use std::net::{IpAddr, TcpStream};
use std::time::{Duration, Instant};

/// What the page server needs of a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Request {
    pub method: String,
    pub path: String,
    /// Values of all `Host` headers.
    pub hosts: Vec<String>,
    pub origin: Option<String>,
}

/// Why a request is not answered.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// Not HTTP.
    Malformed,
    /// Not complete in time.
    TooSlow,
    /// Longer than allowed.
    TooLong,
}

impl Refusal {
    /// Status code and text.
    pub(super) fn status(&self) -> &'static str {
        match self {
            Self::Malformed => "400 Bad Request",
            Self::TooSlow => "408 Request Timeout",
            Self::TooLong => "431 Request Header Fields Too Large",
        }
    }
}

/// Reads up to the blank line after the headers.
pub(super) fn read_request(
    stream: &mut TcpStream,
    max_bytes: usize,
    deadline: Instant,
) -> Result<Request, Refusal> {
    let mut bytes = Vec::new();
    let mut piece = [0; 1024];
    while !is_complete(&bytes) {
        if bytes.len() >= max_bytes {
            return Err(Refusal::TooLong);
        }
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left.max(Duration::from_millis(1)))).is_err() {
            return Err(Refusal::TooSlow);
        }
        let room = piece.len().min(max_bytes - bytes.len());
        match stream.read(&mut piece[..room]) {
            Ok(0) => return Err(Refusal::Malformed),
            Ok(count) => bytes.extend_from_slice(&piece[..count]),
            Err(why) if why.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Err(Refusal::TooSlow),
        }
    }
    parse(&bytes).ok_or(Refusal::Malformed)
}

fn is_complete(bytes: &[u8]) -> bool {
    bytes.windows(4).any(|w| w == b"\r\n\r\n") || bytes.windows(2).any(|w| w == b"\n\n")
}

fn parse(bytes: &[u8]) -> Option<Request> {
    let text = std::str::from_utf8(bytes).ok()?;
    let mut lines = text.lines();
    let mut words = lines.next()?.split(' ');
    let (method, target, version) = (words.next()?, words.next()?, words.next()?);
    if !version.starts_with("HTTP/1.") || words.next().is_some() || !target.starts_with('/') {
        return None;
    }
    let path = target.split('?').next().unwrap_or("/").to_owned();
    let mut request = Request { method: method.to_owned(), path, hosts: Vec::new(), origin: None };
    for line in lines.take_while(|line| !line.is_empty()) {
        let (name, value) = line.split_once(':')?;
        let value = value.trim().to_owned();
        match name.to_ascii_lowercase().as_str() {
            "host" => request.hosts.push(value),
            "origin" => request.origin = Some(value),
            _ => {}
        }
    }
    Some(request)
}

/// Whether a host with an optional port is this computer by its address or as `localhost`, or the name that the server was bound to.
/// Other names may belong to a foreign web page.
pub(super) fn is_own_host(value: &str, bound: &str) -> bool {
    let host = match value.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((address, port)) if port.is_empty() || is_port(port) => address,
            _ => return false,
        },
        None => match value.split_once(':') {
            Some((host, port)) if port.bytes().all(|b| b.is_ascii_digit()) => host,
            Some(_) => return false,
            None => value,
        },
    };
    host.parse::<IpAddr>().is_ok()
        || host.eq_ignore_ascii_case("localhost")
        || (!host.is_empty() && host.eq_ignore_ascii_case(bound))
}

fn is_port(text: &str) -> bool {
    text.strip_prefix(':').is_some_and(|port| port.bytes().all(|b| b.is_ascii_digit()))
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
        for foreign in
            ["evil.example", "evil.example:8080", "localhost.evil.example", "", "[::1", "a:b", "lab-pc.evil"]
        {
            assert!(!is_own_host(foreign, "lab-pc"), "{foreign}");
        }
        assert!(!is_own_host("", ""));
    }

    #[test]
    fn a_request_is_parsed_and_anything_else_malformed() {
        let request =
            parse(b"GET /events?x=1 HTTP/1.1\r\nhOsT: a\r\nOrigin: http://b\r\n\r\n").expect("valid");
        assert_eq!((request.method.as_str(), request.path.as_str()), ("GET", "/events"));
        assert_eq!((request.hosts, request.origin), (vec!["a".to_owned()], Some("http://b".to_owned())));
        for bad in [
            "",
            "\r\n\r\n",
            "GET /\r\n\r\n",
            "GET / HTTP/2\r\n\r\n",
            "GET / / HTTP/1.1\r\n\r\n",
            "GET a HTTP/1.1\r\n\r\n",
            "GET / HTTP/1.1\r\nno colon\r\n\r\n",
            "GET http://x/ HTTP/1.1\r\n\r\n",
        ] {
            assert_eq!(parse(bad.as_bytes()), None, "{bad:?}");
        }
        assert_eq!(parse(b"GET /\xff HTTP/1.1\r\n\r\n"), None);
    }
}
