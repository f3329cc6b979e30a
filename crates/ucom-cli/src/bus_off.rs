//! The controller of this computer has left the bus (bus-off, ISO 11898-1): said in words, with the next command.

/// On a bad wire it leaves the bus all the time: said again no sooner than after this, µs.
const AGAIN_US: u64 = 5_000_000;

/// The likely causes.
pub const WHY: &str =
    "too many of its frames failed: a wrong bit rate, no termination, or CAN_H and CAN_L swapped or shorted";

/// What has been said of it.
#[derive(Debug, Default)]
pub struct BusOff {
    said: u64,
    said_us: Option<u64>,
}

impl BusOff {
    /// What is to be said when it has left the bus so often; `None`: nothing new, or it was said a moment ago.
    pub fn look(&mut self, times: u64, now_us: u64, url: &str) -> Option<String> {
        let new = times.saturating_sub(self.said);
        if new == 0 || self.said_us.is_some_and(|at| now_us.saturating_sub(at) < AGAIN_US) {
            return None;
        }
        (self.said, self.said_us) = (times, Some(now_us));
        let often = if new == 1 { String::new() } else { format!(" ({new} times)") };
        Some(format!(
            "the CAN controller of this computer is bus-off{often}: {WHY}; what it was sending is lost\n  next: {}",
            next(url)
        ))
    }
}

/// What brings it back and finds the cause. Only the kernel's interfaces stay away until they are told otherwise.
pub fn next(url: &str) -> String {
    match url.strip_prefix("socketcan:") {
        Some(interface) => format!(
            "sudo ip link set {interface} type can restart brings it back (restart-ms 100 at the interface's set-up does so by itself), then ucom doctor"
        ),
        None => "ucom doctor looks at the bus".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Once at first, then no more often than every 5 s, and no time it happened is left out.
    #[test]
    fn it_is_said_once_and_counted() {
        let mut off = BusOff::default();
        let url = "socketcand:127.0.0.1:29536/can0";
        assert_eq!(off.look(0, 0, url), None);
        let said = off.look(1, 10, url).expect("said at once");
        assert!(said.contains("is bus-off:") && said.contains("next: ucom doctor"), "{said}");
        assert_eq!(off.look(1, 20_000_000, url), None);
        let said = off.look(2, 20_000_000, url).expect("said again");
        assert!(!said.contains("times"), "{said}");
        assert_eq!(off.look(7, 21_000_000, url), None);
        let said = off.look(9, 25_000_000, url).expect("said again");
        assert!(said.contains("(7 times)"), "{said}");
    }

    #[test]
    fn an_interface_of_the_kernel_is_restarted() {
        assert!(next("socketcan:can3").contains("ip link set can3 type can restart"));
        assert!(!next("slcan:/dev/ttyACM0").contains("ip link"));
    }
}
