//! CAN over UDP multicast, compatible with python-can's `udp_multicast` interface.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use socket2::{Domain, Protocol, Socket, Type};

use crate::datagram::{MAX_DATAGRAM, decode, encode};
use crate::{AttachError, CanBus, CanError, CanFrame, CanUrl};

/// Size of the receive buffer that is requested from the operating system, bytes; sufficient for about 4,000 frames.
const RECEIVE_BUFFER: usize = 2 << 20;

/// Longest time for which a send waits for space in the transmit queue of the operating system.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);

/// A member of a multicast group.
///
/// UDP loses frames if a member reads too slowly. UDP multicast is suitable for simulators and tools on one computer.
pub struct MulticastBus {
    url: String,
    /// Socket that listens at the group's port, which all members share.
    listener: UdpSocket,
    /// Socket that sends from its own port, so that the datagrams of this member can be distinguished from others.
    sender: UdpSocket,
    own: SocketAddr,
    /// Timeout of the listener; with `None`, the listener does not wait.
    timeout: Option<Duration>,
    ignored: u64,
}

impl MulticastBus {
    /// Joins a group. With `ttl` 0, frames stay on this computer; with `ttl` 1, frames can reach the local network.
    pub fn join(group: IpAddr, port: u16, ttl: u8) -> Result<Self, AttachError> {
        let failed = |(step, source)| AttachError::Join { group, port, step, source };
        // A computer without a network has no default interface. The second attempt therefore uses the IPv4 loopback
        // interface, on which programs on this computer can reach each other.
        let (listener, sender) = open_sockets(group, port, ttl, Ipv4Addr::UNSPECIFIED)
            .or_else(|first| open_sockets(group, port, ttl, Ipv4Addr::LOCALHOST).map_err(|_| first))
            .map_err(failed)?;
        let own = sender.local_addr().map_err(|source| failed(("reading the own address", source)))?;
        let url = CanUrl::Multicast { group, port, ttl }.to_string();
        Ok(Self { url, listener, sender, own, timeout: None, ignored: 0 })
    }

    /// Returns the number of datagrams received so far that did not contain a frame.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    fn failed(&self, step: &'static str) -> impl FnOnce(io::Error) -> CanError {
        let url = self.url.clone();
        move |source| CanError::Io { url, step, source }
    }

    /// Sets the timeout of the listener. Makes no system call if the timeout is unchanged, which is the usual case.
    fn set_timeout(&mut self, timeout: Option<Duration>) -> io::Result<()> {
        if timeout == self.timeout {
            return Ok(());
        }
        if timeout.is_none() || self.timeout.is_none() {
            self.listener.set_nonblocking(timeout.is_none())?;
        }
        if timeout.is_some() {
            self.listener.set_read_timeout(timeout)?;
        }
        self.timeout = timeout;
        Ok(())
    }

    /// Receives the next datagram from another sender.
    fn next(&mut self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        loop {
            match self.listener.recv_from(buffer) {
                // The operating system does not always report the scope of an IPv6 address, so only address and port
                // are compared.
                Ok((_, from)) if (from.ip(), from.port()) == (self.own.ip(), self.own.port()) => {}
                Ok((len, _)) => return Ok(Some(len)),
                Err(error) if is_no_data(&error) => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}

fn is_no_data(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}

type Step<T> = Result<T, (&'static str, io::Error)>;

fn step<T>(what: &'static str, result: io::Result<T>) -> Step<T> {
    result.map_err(|error| (what, error))
}

/// Opens the listener and the sender. IPv4 groups use the network interface in the argument, and IPv6 groups use the
/// default network interface.
fn open_sockets(group: IpAddr, port: u16, ttl: u8, interface: Ipv4Addr) -> Step<(UdpSocket, UdpSocket)> {
    let listener = step("opening a socket", udp(group))?;
    step("sharing the port", share_port(&listener))?;
    // A larger receive buffer is useful but not required.
    let _ = listener.set_recv_buffer_size(RECEIVE_BUFFER);
    // A listener that is bound to the group address receives no datagrams of other groups. On Windows, a socket can
    // only be bound to the computer's own addresses.
    let address = if cfg!(windows) { unspecified(group) } else { group };
    step("binding the port", listener.bind(&SocketAddr::new(address, port).into()))?;

    let sender = step("opening a socket", udp(group))?;
    let joined = match group {
        IpAddr::V4(group) => listener
            .join_multicast_v4(&group, &interface)
            .and_then(|()| sender.set_multicast_if_v4(&interface)),
        IpAddr::V6(group) => listener.join_multicast_v6(&group, 0),
    };
    step("joining", joined)?;
    step("setting the time to live", set_ttl(&sender, group, ttl))?;
    step("connecting", sender.connect(&SocketAddr::new(group, port).into()))?;
    step("setting the socket", listener.set_nonblocking(true))?;
    Ok((listener.into(), sender.into()))
}

fn udp(group: IpAddr) -> io::Result<Socket> {
    let socket =
        Socket::new(Domain::for_address(SocketAddr::new(group, 0)), Type::DGRAM, Some(Protocol::UDP))?;
    if group.is_ipv6() {
        socket.set_only_v6(true)?;
    }
    Ok(socket)
}

fn share_port(socket: &Socket) -> io::Result<()> {
    socket.set_reuse_address(true)?;
    #[cfg(unix)]
    socket.set_reuse_port(true)?;
    Ok(())
}

fn set_ttl(socket: &Socket, group: IpAddr, ttl: u8) -> io::Result<()> {
    match group {
        IpAddr::V4(_) => {
            socket.set_multicast_ttl_v4(ttl.into())?;
            socket.set_multicast_loop_v4(true)
        }
        IpAddr::V6(_) => {
            socket.set_multicast_hops_v6(ttl.into())?;
            socket.set_multicast_loop_v6(true)
        }
    }
}

fn unspecified(group: IpAddr) -> IpAddr {
    match group {
        IpAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        IpAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    }
}

impl CanBus for MulticastBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        let datagram = encode(frame);
        let give_up = Instant::now() + SEND_TIMEOUT;
        loop {
            match self.sender.send(&datagram) {
                Ok(_) => return Ok(()),
                Err(error) if is_queue_full(&error) && Instant::now() < give_up => {
                    std::thread::sleep(Duration::from_micros(200));
                }
                Err(error) => return Err(self.failed("sending")(error)),
            }
        }
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let mut buffer = [0; MAX_DATAGRAM];
        let deadline = Instant::now().checked_add(timeout);
        // The first attempt does not wait. If a datagram has already arrived, the timeout of the socket then stays
        // unchanged.
        let mut wait = None;
        loop {
            self.set_timeout(wait).map_err(self.failed("setting the timeout"))?;
            match self.next(&mut buffer).map_err(self.failed("receiving"))? {
                Some(len) => match decode(&buffer[..len]) {
                    Some(frame) => return Ok(Some(frame)),
                    None => self.ignored += 1,
                },
                None if timeout.is_zero() => return Ok(None),
                None => {}
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() && !timeout.is_zero() {
                return Ok(None);
            }
            wait = (!left.is_zero()).then_some(left);
        }
    }
}

/// Returns `true` if the queue of the interface or of the socket is full, which is temporary.
fn is_queue_full(error: &io::Error) -> bool {
    // The Rust library has no error kind for ENOBUFS. The number of ENOBUFS is 105 on Linux, 55 on the BSDs and macOS,
    // 10055 on Windows.
    let code = if cfg!(windows) {
        10055
    } else if cfg!(target_os = "linux") {
        105
    } else {
        55
    };
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
        || error.raw_os_error() == Some(code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;

    /// Receives a frame. The timeout expires only if the transport does not work.
    fn received(bus: &mut MulticastBus) -> Option<CanFrame> {
        bus.receive(Duration::from_secs(60)).unwrap()
    }

    fn check(group: IpAddr, port: u16) {
        let (mut a, mut b) = match (MulticastBus::join(group, port, 0), MulticastBus::join(group, port, 0)) {
            (Ok(a), Ok(b)) => (a, b),
            (Err(error), _) | (_, Err(error)) => {
                println!("skipped: {error}");
                return;
            }
        };
        let id = Id::extended(0x1234_5678).unwrap();
        let frames = [
            CanFrame::fd(id, &[0xA5; 64]).unwrap(),
            CanFrame::classic(id, &[1, 2]).unwrap(),
            CanFrame::remote(id, 3).unwrap(),
        ];
        for frame in frames {
            if let Err(error) = a.send(&frame) {
                println!("skipped: {error}");
                return;
            }
        }
        b.sender.send(b"noise").unwrap();
        b.send(&frames[1]).unwrap();
        for frame in frames {
            assert_eq!(received(&mut b), Some(frame));
        }
        assert_eq!(received(&mut a), Some(frames[1]), "it receives neither its own frames nor noise");
        assert_eq!((a.ignored(), b.ignored()), (1, 0));
        assert_eq!(a.receive(Duration::ZERO).unwrap(), None);
        assert_eq!(b.receive(Duration::from_millis(2)).unwrap(), None);
    }

    // Each test uses its own ports. The ports also differ between test runs, because several test runs can take place
    // at the same time.
    fn port(number: u16) -> u16 {
        20_000 + (std::process::id() % 10_000) as u16 * 4 + number
    }

    #[test]
    fn members_of_an_ipv4_group_hear_each_other() {
        check(Ipv4Addr::new(239, 74, 163, 7).into(), port(0));
    }

    #[test]
    fn members_of_an_ipv6_group_hear_each_other() {
        check("ff15::7079:7468:7".parse().unwrap(), port(1));
    }
}
