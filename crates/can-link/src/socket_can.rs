//! CAN interfaces of the Linux kernel.

mod convert;
mod retry;

use std::io;
use std::time::{Duration, Instant};

use socketcan::{CanFdSocket, Socket, SocketOptions};

use crate::{CanBus, CanError, CanFrame, CanUrl, ControllerState, ErrorState, InterfaceError};
use convert::{Received, from_kernel, to_kernel};
use retry::retry_while_full;

/// Linux error numbers.
const EINVAL: i32 = 22;
const ENODEV: i32 = 19;
const ENXIO: i32 = 6;
const EPERM: i32 = 1;
const EACCES: i32 = 13;
const EAFNOSUPPORT: i32 = 97;
const EPROTONOSUPPORT: i32 = 93;
const ENETDOWN: i32 = 100;

/// A CAN network interface of the kernel, such as `can0` or `vcan0`, with classic CAN and CAN FD.
pub struct SocketCanBus {
    url: String,
    interface: String,
    socket: CanFdSocket,
    state: ControllerState,
    times_bus_off: u64,
}

impl SocketCanBus {
    /// Opens an interface. The interface must be enabled (up).
    pub fn open(interface: &str) -> Result<Self, InterfaceError> {
        let failed = |source: io::Error| InterfaceError {
            url: CanUrl::SocketCan { interface: interface.to_owned() }.to_string(),
            hint: hint(&source, interface),
            source,
        };
        // A socket for all interfaces (index 0) can be opened only if the kernel supports CAN. This attempt shows
        // whether CAN support is missing or the interface name is wrong.
        drop(CanFdSocket::open_iface(0).map_err(failed)?);
        let socket = CanFdSocket::open(interface).map_err(failed)?;
        // The kernel reports an interface that is down as a pending error of the socket.
        if let Some(error) = socket.as_raw_socket().take_error().map_err(failed)? {
            return Err(failed(error));
        }
        socket.set_error_filter_accept_all().map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        let url = CanUrl::SocketCan { interface: interface.to_owned() }.to_string();
        Ok(Self {
            url,
            interface: interface.to_owned(),
            socket,
            state: ControllerState::default(),
            times_bus_off: 0,
        })
    }

    fn not_carried(&self, frame: &CanFrame) -> CanError {
        CanError::NotCarried {
            url: self.url.clone(),
            frame: *frame,
            why: "the interface is set up for classic CAN; if its adapter supports CAN FD, set it up with \
                  `dbitrate 5000000 fd on`",
        }
    }

    fn failed(&self, step: &'static str, source: io::Error) -> CanError {
        let url = self.url.clone();
        match source.raw_os_error() {
            Some(ENETDOWN | ENODEV | ENXIO) => {
                InterfaceError { url, hint: hint(&source, &self.interface), source }.into()
            }
            _ => CanError::Io { url, step, source },
        }
    }
}

/// Returns the likely cause and the command that solves the problem.
fn hint(error: &io::Error, interface: &str) -> String {
    let up = format!("sudo ip link set {interface} up type can bitrate 1000000");
    match error.raw_os_error() {
        Some(EAFNOSUPPORT | EPROTONOSUPPORT) => {
            "this kernel has no CAN: try `sudo modprobe -a can can_raw`; if that fails, use an slcan adapter, or \
             multicast:ADDR:PORT between programs of one computer"
                .to_owned()
        }
        Some(ENODEV | ENXIO) => format!(
            "this CAN interface does not exist; `ip -brief link show type can` lists the interfaces; plug \
             in the adapter, then `{up}`"
        ),
        Some(ENETDOWN) => format!("the interface is down: `{up}`"),
        Some(EPERM | EACCES) => "this user has no permission; check `id` and the rights of the container".to_owned(),
        _ => format!("see `ip -details link show {interface}`"),
    }
}

impl CanBus for SocketCanBus {
    fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
        // The largest frame of an interface shows how it is set up: 16 bytes for classic CAN, 72 bytes for CAN FD.
        let mtu = || std::fs::read_to_string(format!("/sys/class/net/{}/mtu", self.interface)).ok();
        let is_classic = frame.is_fd() && mtu().is_some_and(|mtu| mtu.trim() == "16");
        if is_classic { Err(self.not_carried(frame)) } else { Ok(()) }
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        let raw = to_kernel(frame);
        let result = retry_while_full(|| self.socket.write_frame(&raw), std::thread::sleep);
        result.map_err(|source| match source.raw_os_error() {
            Some(EINVAL) if frame.is_fd() => self.not_carried(frame),
            _ => self.failed("sending", source),
        })
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let deadline = Instant::now().checked_add(timeout);
        let mut read = self.socket.read_frame();
        loop {
            match read {
                Ok(raw) => match from_kernel(&raw, self.state) {
                    Received::Frame(frame) => return Ok(Some(frame)),
                    Received::State(state) => {
                        let left =
                            state.errors == ErrorState::BusOff && self.state.errors != ErrorState::BusOff;
                        self.times_bus_off += u64::from(left);
                        self.state = state;
                    }
                    Received::Nothing => {}
                },
                Err(error) if is_no_data(&error) => {}
                Err(error) => return Err(self.failed("receiving", error)),
            }
            read = self.socket.read_frame();
            if !read.as_ref().is_err_and(is_no_data) {
                continue;
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Ok(None);
            }
            read = self.socket.read_frame_timeout(left);
        }
    }

    /// Returns the state from the error frames that [`receive`](CanBus::receive) has read. The kernel sends no error
    /// frames until an error has occurred.
    fn state(&mut self) -> ControllerState {
        self.state
    }

    fn times_bus_off(&self) -> u64 {
        self.times_bus_off
    }
}

fn is_no_data(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs on any computer. If the kernel lacks CAN or this interface, the error must contain the command that
    /// solves the problem.
    #[test]
    fn what_cannot_be_opened_names_the_cause_and_what_to_do() {
        let error = SocketCanBus::open("nocan17").err().expect("no such interface").to_string();
        assert!(error.contains("socketcan:nocan17"), "{error}");
        assert!(error.contains("modprobe") || error.contains("ip -brief link"), "{error}");
    }

    #[test]
    fn each_cause_has_its_next_command() {
        for (number, part) in [
            (EAFNOSUPPORT, "modprobe -a can can_raw"),
            (ENODEV, "ip link set can0 up type can bitrate 1000000"),
            (ENETDOWN, "is down: `sudo ip link set can0 up type can bitrate 1000000`"),
            (EPERM, "no permission"),
            (EINVAL, "ip -details link show can0"),
        ] {
            let hint = hint(&io::Error::from_raw_os_error(number), "can0");
            assert!(hint.contains(part), "{hint}");
        }
    }
}
