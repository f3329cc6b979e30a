//! The trait of all buses, and how to open one.

use std::time::Duration;

use crate::{
    CanError, CanFrame, CanUrl, ControllerState, MulticastBus, SlcanBus, SlcanOptions, SocketcandBus,
    VirtualBus,
};

/// A member of a CAN bus.
///
/// Implementations deliver frames of every other member in the order of the bus, and none of their own.
pub trait CanBus {
    /// Puts a frame on the bus. A full transmit queue is waited for; it is no error unless it stays full for seconds, as on a
    /// bus where nobody acknowledges.
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError>;

    /// The next frame of another member; `None` when none came within `timeout`. Zero does not wait.
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError>;

    /// How this member's controller gets on with the bus, as far as is known from what was received so far.
    fn state(&mut self) -> ControllerState {
        ControllerState::default()
    }

    /// How often this member's controller has left the bus, as far as is known from what was received so far. It may be back by
    /// now: what was sent meanwhile is lost all the same. Nothing is asked of the adapter; 0 where it does not report.
    fn times_bus_off(&self) -> u64 {
        0
    }
}

impl<B: CanBus + ?Sized> CanBus for &mut B {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        (**self).send(frame)
    }
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        (**self).receive(timeout)
    }
    fn state(&mut self) -> ControllerState {
        (**self).state()
    }
    fn times_bus_off(&self) -> u64 {
        (**self).times_bus_off()
    }
}

impl<B: CanBus + ?Sized> CanBus for Box<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        (**self).send(frame)
    }
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        (**self).receive(timeout)
    }
    fn state(&mut self) -> ControllerState {
        (**self).state()
    }
    fn times_bus_off(&self) -> u64 {
        (**self).times_bus_off()
    }
}

/// Opens the bus of a URL such as `multicast:239.74.163.2:43113` or `virtual:bench`.
pub fn open(url: &str) -> Result<Box<dyn CanBus + Send>, CanError> {
    open_url(&url.parse()?)
}

/// Opens the bus of a parsed URL.
pub fn open_url(url: &CanUrl) -> Result<Box<dyn CanBus + Send>, CanError> {
    match url {
        CanUrl::Virtual { name } => Ok(Box::new(VirtualBus::join(name))),
        CanUrl::Multicast { group, port, ttl } => Ok(Box::new(MulticastBus::join(*group, *port, *ttl)?)),
        CanUrl::Socketcand { host, port, channel } => {
            Ok(Box::new(SocketcandBus::connect(host, *port, channel)?))
        }
        CanUrl::Slcan { device, rate, data_rate, baud } => {
            let (rate, data_rate, baud) = (*rate, *data_rate, *baud);
            let options = SlcanOptions { device: device.clone(), rate, data_rate, baud };
            Ok(Box::new(SlcanBus::open(&options)?))
        }
        #[cfg(target_os = "linux")]
        CanUrl::SocketCan { interface } => Ok(Box::new(crate::SocketCanBus::open(interface)?)),
        #[cfg(not(target_os = "linux"))]
        CanUrl::SocketCan { .. } => Err(CanError::Unsupported { url: url.to_string(), kind: url.scheme() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_url_is_refused() {
        assert!(matches!(open("can0"), Err(CanError::Url(_))));
    }

    #[cfg(not(target_os = "linux"))]
    #[test]
    fn what_only_linux_has_names_what_there_is() {
        let message = open("socketcan:can0").err().expect("not here").to_string();
        assert!(message.contains("multicast:ADDR:PORT"), "{message}");
    }
}
