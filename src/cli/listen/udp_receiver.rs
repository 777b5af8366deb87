//! Reception of datagrams, with the number of those that the system has dropped.

use super::poll_interval::POLL_INTERVAL;
use crate::cli::exit_codes::Failure;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};

/// Largest datagram in bytes.
const MAX_DATAGRAM_BYTES: usize = 65_536;

/// A bound socket.
pub struct UdpReceiver {
    socket: UdpSocket,
    buffer: Vec<u8>,
    dropped: DropCounter,
}

/// A datagram, or nothing.
pub enum Received<'a> {
    Datagram(&'a [u8]),
    /// Nothing within the poll interval.
    Nothing,
}

impl UdpReceiver {
    /// Binds the socket.
    ///
    /// # Errors
    /// [`Failure::Check`] when it cannot be bound.
    pub fn bind(host: &str, port: u16) -> Result<Self, Failure> {
        let failed = |why: io::Error| Failure::Check(format!("--udp {port}: cannot bind: {why}"));
        let socket = UdpSocket::bind((host, port)).map_err(failed)?;
        socket.set_read_timeout(Some(POLL_INTERVAL)).map_err(failed)?;
        let dropped = DropCounter::new(&socket);
        Ok(Self { socket, buffer: vec![0; MAX_DATAGRAM_BYTES], dropped })
    }

    /// The address that it is bound to.
    pub fn address(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }

    /// Datagrams that the system had dropped when the last one was received; `None` where it does not count them.
    pub fn dropped(&self) -> Option<u64> {
        self.dropped.total()
    }

    /// The next datagram.
    ///
    /// # Errors
    /// [`Failure::Check`] when the socket has failed.
    pub fn receive(&mut self) -> Result<Received<'_>, Failure> {
        match self.dropped.receive(&self.socket, &mut self.buffer) {
            Ok(length) => Ok(Received::Datagram(self.buffer.get(..length).unwrap_or_default())),
            Err(why) if is_poll(why.kind()) => Ok(Received::Nothing),
            Err(why) => Err(Failure::Check(format!("--udp: {why}"))),
        }
    }
}

fn is_poll(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

#[cfg(not(target_os = "linux"))]
struct DropCounter;

#[cfg(not(target_os = "linux"))]
impl DropCounter {
    fn new(_: &UdpSocket) -> Self {
        Self
    }

    /// Only Linux reports the number with the datagrams.
    fn total(&self) -> Option<u64> {
        None
    }

    fn receive(&mut self, socket: &UdpSocket, buffer: &mut [u8]) -> io::Result<usize> {
        socket.recv(buffer)
    }
}

/// The kernel's counter of dropped datagrams (`SO_RXQ_OVFL`), which comes with each datagram.
#[cfg(target_os = "linux")]
struct DropCounter {
    enabled: bool,
    last: u32,
    total: u64,
    control: Vec<u8>,
}

#[cfg(target_os = "linux")]
impl DropCounter {
    /// Requested size of the kernel's buffer in bytes: seconds of samples at 1 kHz. The system may grant less.
    const BUFFER_BYTES: usize = 1 << 23;

    fn new(socket: &UdpSocket) -> Self {
        use nix::sys::socket::{setsockopt, sockopt};
        // Beyond `net.core.rmem_max` only for root.
        let forced = setsockopt(socket, sockopt::RcvBufForce, &Self::BUFFER_BYTES);
        let _ = forced.or_else(|_| setsockopt(socket, sockopt::RcvBuf, &Self::BUFFER_BYTES));
        let enabled = setsockopt(socket, sockopt::RxqOvfl, &1).is_ok();
        Self { enabled, last: 0, total: 0, control: nix::cmsg_space!(u32) }
    }

    fn total(&self) -> Option<u64> {
        self.enabled.then_some(self.total)
    }

    fn receive(&mut self, socket: &UdpSocket, buffer: &mut [u8]) -> io::Result<usize> {
        use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg};
        use std::os::fd::AsRawFd as _;
        let mut pieces = [io::IoSliceMut::new(buffer)];
        let message =
            recvmsg::<()>(socket.as_raw_fd(), &mut pieces, Some(&mut self.control), MsgFlags::empty())?;
        for control in message.cmsgs()? {
            if let ControlMessageOwned::RxqOvfl(count) = control {
                // The counter wraps at 2^32.
                self.total += u64::from(count.wrapping_sub(self.last));
                self.last = count;
            }
        }
        Ok(message.bytes)
    }
}
