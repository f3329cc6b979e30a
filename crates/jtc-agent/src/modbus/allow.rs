//! Addresses and networks of the clients that may connect to the Modbus server.
use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// Single address, or network of all addresses that have the same first bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    address: IpAddr,
    bits: u8,
}

/// Text that is neither an address nor a network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a valid address or network: {0}, expected for example 192.168.0.10, 192.168.0.0/24 or fd00::/8")]
pub struct NoNetwork(String);

impl Network {
    /// Returns `true` if the network contains this address.
    pub fn contains(&self, address: IpAddr) -> bool {
        let (own, other) = (number(self.address), number(address.to_canonical()));
        let left = own.1 - u32::from(self.bits);
        // If the network contains all addresses (`/0`), `left` is the full number of bits of an address, and
        // `checked_shr` returns `None`.
        own.1 == other.1 && own.0.checked_shr(left).unwrap_or(0) == other.0.checked_shr(left).unwrap_or(0)
    }
}

/// Returns an address as a number, and its number of bits.
fn number(address: IpAddr) -> (u128, u32) {
    match address {
        IpAddr::V4(address) => (u128::from(address.to_bits()), 32),
        IpAddr::V6(address) => (address.to_bits(), 128),
    }
}

impl FromStr for Network {
    type Err = NoNetwork;

    fn from_str(text: &str) -> Result<Self, NoNetwork> {
        let none = || NoNetwork(text.to_owned());
        let (address, bits) =
            text.split_once('/').map_or((text, None), |(address, bits)| (address, Some(bits)));
        let address: IpAddr = address.parse().map_err(|_| none())?;
        let whole = number(address).1;
        let bits = match bits {
            None => whole,
            Some(bits) if bits.bytes().all(|byte| byte.is_ascii_digit()) => {
                bits.parse().map_err(|_| none())?
            }
            Some(_) => return Err(none()),
        };
        let bits = u8::try_from(bits).ok().filter(|bits| u32::from(*bits) <= whole).ok_or_else(none)?;
        Ok(Self { address, bits })
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.address, self.bits)
    }
}

/// Networks whose addresses may connect to the Modbus server.
#[derive(Clone, Debug, Default)]
pub struct Allowed(Vec<Network>);

impl Allowed {
    /// Creates the list of allowed networks; an empty list allows only this computer.
    pub fn new(networks: Vec<Network>) -> Self {
        Self(networks)
    }

    /// Returns `true` if this address may connect to the Modbus server.
    pub fn contains(&self, address: IpAddr) -> bool {
        if self.0.is_empty() {
            return address.to_canonical().is_loopback();
        }
        self.0.iter().any(|network| network.contains(address))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allows(networks: &[&str], address: &str) -> bool {
        let networks = networks.iter().map(|text| text.parse().expect("a network")).collect();
        Allowed::new(networks).contains(address.parse().expect("an address"))
    }

    #[test]
    fn those_who_are_named_may_connect_and_without_names_this_computer_alone() {
        for (networks, address, allowed) in [
            (&[][..], "127.0.0.1", true),
            (&[], "::1", true),
            (&[], "::ffff:127.0.0.1", true),
            (&[], "192.168.0.10", false),
            (&["192.168.0.10"], "192.168.0.10", true),
            (&["192.168.0.10"], "192.168.0.11", false),
            (&["192.168.0.10"], "127.0.0.1", false),
            (&["192.168.0.0/24", "fd00::/8"], "192.168.0.255", true),
            (&["192.168.0.0/24", "fd00::/8"], "192.168.1.0", false),
            (&["192.168.0.0/24", "fd00::/8"], "fd12::1", true),
            (&["192.168.0.0/24"], "::ffff:192.168.0.7", true),
            (&["0.0.0.0/0"], "8.8.8.8", true),
            (&["0.0.0.0/0"], "fd12::1", false),
            (&["::/0"], "fd12::1", true),
        ] {
            assert_eq!(allows(networks, address), allowed, "{networks:?} {address}");
        }
        for wrong in [
            "",
            "/",
            "192.168.0",
            "192.168.0.0/33",
            "192.168.0.0/-1",
            "192.168.0.0/+8",
            "::/129",
            "::/",
            "plc.local",
        ] {
            assert!(wrong.parse::<Network>().is_err(), "{wrong}");
        }
    }
}
