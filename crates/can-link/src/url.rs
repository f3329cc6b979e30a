//! CAN URLs. A CAN URL identifies a bus in one word of a command line.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;

use crate::{SOCKETCAND_PORT, SlcanOptions};

/// Forms of URLs that every system can open, for error messages.
pub(crate) const OPENABLE: &str =
    "slcan:DEVICE@RATE, socketcand:HOST:PORT/can0, multicast:ADDR:PORT and virtual:NAME";

/// Default port of python-can's `udp_multicast`.
const MULTICAST_PORT: u16 = 43113;

/// A parsed CAN URL. `Display` prints the URL again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CanUrl {
    /// `socketcan:can0`: an interface of the Linux kernel.
    SocketCan {
        /// Network interface.
        interface: String,
    },
    /// `slcan:/dev/ttyACM0@1000000`; `?data=N` sets the bit rate of the CAN FD data phase, `?baud=N` the rate of the
    /// serial line.
    Slcan {
        /// Serial port, or `tcp:HOST:PORT`.
        device: String,
        /// Bit rate of the bus after the `@`, bit/s; with `None` the adapter keeps its own setting.
        rate: Option<u32>,
        /// Bit rate of the data phase, bit/s; with `None` the adapter keeps its own setting.
        data_rate: Option<u32>,
        /// Rate of the serial line, bit/s.
        baud: u32,
    },
    /// `socketcand:HOST:PORT/can0`; the port is optional.
    Socketcand {
        /// Name or address of the server; an IPv6 address without brackets.
        host: String,
        /// TCP port.
        port: u16,
        /// Bus of the server.
        channel: String,
    },
    /// `multicast:ADDR:PORT`, with IPv6 addresses in brackets; `?ttl=N` permits frames to leave this computer.
    Multicast {
        /// Multicast group.
        group: IpAddr,
        /// UDP port.
        port: u16,
        /// Maximum number of routers on the path, plus one; with 0, frames stay on this computer.
        ttl: u8,
    },
    /// `virtual:NAME`: a bus inside this process.
    Virtual {
        /// Name of the bus.
        name: String,
    },
}

impl CanUrl {
    /// Returns the part before the first colon.
    pub const fn scheme(&self) -> &'static str {
        match self {
            Self::SocketCan { .. } => "socketcan",
            Self::Slcan { .. } => "slcan",
            Self::Socketcand { .. } => "socketcand",
            Self::Multicast { .. } => "multicast",
            Self::Virtual { .. } => "virtual",
        }
    }
}

/// Reasons why a text is not a valid CAN URL.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UrlError {
    /// The URL has no scheme, or an unknown scheme.
    #[error(
        "`{url}` is not a valid CAN URL, expected socketcan:can0, slcan:/dev/ttyACM0@1000000, \
         socketcand:HOST:PORT/can0, multicast:ADDR:PORT and virtual:NAME"
    )]
    Scheme {
        /// Text that is not a valid CAN URL.
        url: String,
    },
    /// A part of the URL is missing or invalid.
    #[error("`{url}`: {what}; the form is {form}")]
    Part {
        /// Text that is not a valid CAN URL.
        url: String,
        /// Description of the error.
        what: &'static str,
        /// Required form of the URL.
        form: &'static str,
    },
}

impl FromStr for CanUrl {
    type Err = UrlError;

    fn from_str(url: &str) -> Result<Self, UrlError> {
        let unknown = || UrlError::Scheme { url: url.to_owned() };
        let (scheme, rest) = url.split_once(':').ok_or_else(unknown)?;
        let wrong = |what, form| UrlError::Part { url: url.to_owned(), what, form };
        match scheme {
            "socketcan" => match rest {
                "" => Err(wrong("the interface is missing", "socketcan:can0")),
                interface => Ok(Self::SocketCan { interface: interface.to_owned() }),
            },
            "slcan" => slcan(rest).map_err(|what| wrong(what, "slcan:/dev/ttyACM0@1000000")),
            "socketcand" => socketcand(rest).map_err(|what| wrong(what, "socketcand:HOST:PORT/can0")),
            "multicast" => multicast(rest).map_err(|what| {
                wrong(
                    what,
                    "multicast:239.74.163.2:43113 or multicast:[ff15::1]:43113, then ?ttl=1 to send to the \
                     local network",
                )
            }),
            "virtual" => match rest {
                "" => Err(wrong("the name is missing", "virtual:NAME")),
                name => Ok(Self::Virtual { name: name.to_owned() }),
            },
            _ => Err(unknown()),
        }
    }
}

fn slcan(rest: &str) -> Result<CanUrl, &'static str> {
    let (rest, query) = rest.split_once('?').unwrap_or((rest, ""));
    let (device, rate) = match rest.rsplit_once('@') {
        Some((device, rate)) => (device, Some(rate.parse().map_err(|_| "the rate is not a number")?)),
        None => (rest, None),
    };
    if device.is_empty() {
        return Err("no serial port");
    }
    let (mut data_rate, mut baud) = (None, SlcanOptions::BAUD);
    for setting in query.split('&').filter(|setting| !setting.is_empty()) {
        match setting.split_once('=') {
            Some(("data", text)) => {
                data_rate = Some(text.parse().map_err(|_| "the data rate is not a number")?)
            }
            Some(("baud", text)) => baud = text.parse().map_err(|_| "the baud rate is not a number")?,
            _ => return Err("unknown setting, expected data or baud"),
        }
    }
    if rate == Some(0) || data_rate == Some(0) || baud == 0 {
        return Err("the rate is 0");
    }
    Ok(CanUrl::Slcan { device: device.to_owned(), rate, data_rate, baud })
}

/// Returns the host name or IPv6 address without brackets, and the port. If the text contains no port, the port is
/// `default`.
fn host_and_port(text: &str, default: u16) -> Result<(&str, u16), &'static str> {
    let port = |text: &str| match text.parse() {
        Ok(0) | Err(_) => Err("the port is out of range (1..65535)"),
        Ok(port) => Ok(port),
    };
    if let Some(rest) = text.strip_prefix('[') {
        let (host, rest) = rest.split_once(']').ok_or("a bracket is not closed")?;
        return match rest.strip_prefix(':') {
            Some(text) => Ok((host, port(text)?)),
            None if rest.is_empty() => Ok((host, default)),
            None => Err("there is text after the closing bracket"),
        };
    }
    match text.split_once(':') {
        Some((_, rest)) if rest.contains(':') => Err("an IPv6 address must be in brackets"),
        Some((host, text)) => Ok((host, port(text)?)),
        None => Ok((text, default)),
    }
}

fn socketcand(rest: &str) -> Result<CanUrl, &'static str> {
    let (address, channel) = rest.split_once('/').ok_or("the slash and the bus name are missing")?;
    let (host, port) = host_and_port(address, SOCKETCAND_PORT)?;
    if host.is_empty() {
        return Err("the host is missing");
    }
    if channel.is_empty() {
        return Err("the bus name after the slash is missing");
    }
    Ok(CanUrl::Socketcand { host: host.to_owned(), port, channel: channel.to_owned() })
}

fn multicast(rest: &str) -> Result<CanUrl, &'static str> {
    let (address, ttl) = match rest.split_once('?') {
        Some((address, query)) => {
            let ttl = query.strip_prefix("ttl=").ok_or("unknown setting, expected ttl")?;
            (address, ttl.parse().map_err(|_| "the ttl is out of range (0..255)")?)
        }
        None => (rest, 0),
    };
    let (host, port) = host_and_port(address, MULTICAST_PORT)?;
    let group: IpAddr = host.parse().map_err(|_| "the group is not an IP address")?;
    if !group.is_multicast() {
        return Err("the address is not a multicast address (224.0.0.0/4 or ff00::/8)");
    }
    Ok(CanUrl::Multicast { group, port, ttl })
}

impl fmt::Display for CanUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.scheme())?;
        match self {
            Self::SocketCan { interface } => f.write_str(interface),
            Self::Slcan { device, rate, data_rate, baud } => {
                f.write_str(device)?;
                rate.map_or(Ok(()), |rate| write!(f, "@{rate}"))?;
                let mut mark = '?';
                if let Some(rate) = data_rate {
                    write!(f, "{mark}data={rate}")?;
                    mark = '&';
                }
                if *baud == SlcanOptions::BAUD { Ok(()) } else { write!(f, "{mark}baud={baud}") }
            }
            Self::Socketcand { host, port, channel } if host.contains(':') => {
                write!(f, "[{host}]:{port}/{channel}")
            }
            Self::Socketcand { host, port, channel } => write!(f, "{host}:{port}/{channel}"),
            Self::Multicast { group, port, ttl } => {
                write!(f, "{}", SocketAddr::new(*group, *port))?;
                if *ttl > 0 { write!(f, "?ttl={ttl}") } else { Ok(()) }
            }
            Self::Virtual { name } => f.write_str(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_understood_and_written_again() {
        let parsed = |url: &str| url.parse::<CanUrl>().unwrap();
        for url in [
            "socketcan:can0",
            "slcan:/dev/ttyACM0@1000000",
            "slcan:COM7",
            "slcan:tcp:localhost:3000@500000",
            "slcan:/dev/ttyACM0@1000000?data=5000000",
            "slcan:/dev/ttyACM0@1000000?data=5000000&baud=1000000",
            "slcan:COM7?baud=57600",
            "socketcand:localhost:29536/can0",
            "socketcand:[::1]:5/vcan1",
            "multicast:239.74.163.2:43113",
            "multicast:239.74.163.2:43113?ttl=2",
            "multicast:[ff15::7079]:43113",
            "virtual:bench",
        ] {
            assert_eq!(parsed(url).to_string(), url);
        }
        assert_eq!(parsed("socketcand:h/can0"), parsed("socketcand:h:29536/can0"));
        assert_eq!(parsed("multicast:[ff15::1]"), parsed("multicast:[ff15::1]:43113?ttl=0"));
        let (rate, data_rate, baud) = (Some(1_000_000), None, 115_200);
        let slcan = CanUrl::Slcan { device: "/dev/ttyACM0".into(), rate, data_rate, baud };
        assert_eq!(parsed("slcan:/dev/ttyACM0@1000000"), slcan);
    }

    #[test]
    fn other_texts_are_errors_that_name_the_cause() {
        for (url, part) in [
            ("can0", "expected socketcan:can0"),
            ("usb:can0", "expected socketcan:can0"),
            ("socketcan:", "the interface is missing"),
            ("slcan:@5", "no serial port"),
            ("slcan:/dev/x@fast", "the rate is not a number"),
            ("slcan:/dev/x@0", "the rate is 0"),
            ("slcan:/dev/x@5?data=0", "the rate is 0"),
            ("slcan:/dev/x@5?data=x", "the data rate is not a number"),
            ("slcan:/dev/x@5?baud", "unknown setting, expected data or baud"),
            ("socketcand:host:1", "the bus name are missing"),
            ("socketcand:host:1/", "the bus name after the slash"),
            ("socketcand::1/can0", "the host is missing"),
            ("socketcand:host:0/can0", "the port"),
            ("multicast:10.0.0.1:5", "not a multicast address"),
            ("multicast:nowhere:5", "not an IP address"),
            ("multicast:ff15::1:5", "in brackets"),
            ("multicast:[ff15::1:5", "not closed"),
            ("multicast:[ff15::1]5", "after the closing bracket"),
            ("multicast:239.1.1.1:70000", "the port"),
            ("multicast:239.1.1.1:5?hops=1", "unknown setting, expected ttl"),
            ("multicast:239.1.1.1:5?ttl=256", "the ttl"),
            ("virtual:", "the name is missing"),
        ] {
            let message = url.parse::<CanUrl>().unwrap_err().to_string();
            assert!(message.contains(part) && message.contains(url), "{message}");
        }
    }
}
