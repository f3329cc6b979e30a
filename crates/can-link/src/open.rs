//! Opens a bus of any kind from its URL. Only the module `open` knows all transports of the crate.

#[cfg(target_os = "linux")]
use crate::AttachError;
use crate::{CanBus, CanUrl, MulticastBus, OpenError, SlcanBus, SlcanOptions, SocketcandBus, VirtualBus};

/// Opens the bus with a URL such as `multicast:239.74.163.2:43113` or `virtual:bench`.
pub fn open(url: &str) -> Result<Box<dyn CanBus + Send>, OpenError> {
    open_url(&url.parse()?)
}

/// Opens the bus with a parsed URL.
pub fn open_url(url: &CanUrl) -> Result<Box<dyn CanBus + Send>, OpenError> {
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
        CanUrl::SocketCan { interface } => {
            Ok(Box::new(crate::SocketCanBus::open(interface).map_err(AttachError::from)?))
        }
        #[cfg(not(target_os = "linux"))]
        CanUrl::SocketCan { .. } => Err(OpenError::Unsupported { url: url.to_string(), kind: url.scheme() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_url_is_refused() {
        assert!(matches!(open("can0"), Err(OpenError::Url(_))));
    }

    #[cfg(not(target_os = "linux"))]
    #[test]
    fn what_only_linux_has_names_what_there_is() {
        let message = open("socketcan:can0").err().expect("not here").to_string();
        assert!(message.contains("multicast:ADDR:PORT"), "{message}");
    }
}
