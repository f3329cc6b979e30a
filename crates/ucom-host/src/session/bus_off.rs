//! Message about bus-off (ISO 11898-1): the CAN controller of this computer has left the bus. The message also names the next command.

use host_kit::{Action, Next, next};

/// Minimum time between two messages in µs. With a bad wire, the controller enters bus-off repeatedly.
const AGAIN_US: u64 = 5_000_000;

/// Likely causes of a bus-off.
pub const WHY: &str =
    "too many of its frames failed: a wrong bit rate, no termination, or CAN_H and CAN_L swapped or shorted";

/// Record of the bus-off events reported so far.
#[derive(Debug, Default)]
pub struct BusOff {
    reported: u64,
    reported_us: Option<u64>,
}

impl BusOff {
    /// Returns the message about a new bus-off. Returns `None` without a new bus-off, or if a bus-off was
    /// reported in the last 5 s.
    pub fn look(&mut self, times: u64, now_us: u64, url: &str) -> Option<String> {
        let new = times.saturating_sub(self.reported);
        if new == 0 || self.reported_us.is_some_and(|at| now_us.saturating_sub(at) < AGAIN_US) {
            return None;
        }
        (self.reported, self.reported_us) = (times, Some(now_us));
        let often = if new == 1 { String::new() } else { format!(" ({new} times)") };
        Some(format!(
            "the CAN controller of this computer is bus-off{often}: {WHY}; the frames that it was sending \
             are lost\n  next: {}",
            next(url)
        ))
    }
}

/// Returns the next step, which ends the bus-off or shows its cause. Only the kernel's CAN interfaces stay off the bus until a command restarts
/// them.
pub fn next(url: &str) -> Next {
    match url.strip_prefix("socketcan:") {
        Some(interface) => Next::from(format!(
            "run sudo ip link set {interface} type can restart (with restart-ms 100 in its set-up, the interface \
             restarts by itself), then "
        ))
        .then(Action::ChainDoctor),
        None => next!("check the bus with {}", ChainDoctor),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first bus-off of the controller is reported at once. Later bus-offs are reported at most once in 5 s. The message contains the
    /// number of bus-offs.
    #[test]
    fn it_is_reported_once_and_counted() {
        let mut off = BusOff::default();
        let url = "socketcand:127.0.0.1:29536/can0";
        assert_eq!(off.look(0, 0, url), None);
        let message = off.look(1, 10, url).expect("reported at once");
        assert!(
            message.contains("is bus-off:") && message.contains("next: check the bus with `ucom doctor`"),
            "{message}"
        );
        assert_eq!(off.look(1, 20_000_000, url), None);
        let message = off.look(2, 20_000_000, url).expect("reported again");
        assert!(!message.contains("times"), "{message}");
        assert_eq!(off.look(7, 21_000_000, url), None);
        let message = off.look(9, 25_000_000, url).expect("reported again");
        assert!(message.contains("(7 times)"), "{message}");
    }

    #[test]
    fn an_interface_of_the_kernel_is_restarted() {
        assert!(next("socketcan:can3").to_string().contains("ip link set can3 type can restart"));
        assert!(!next("slcan:/dev/ttyACM0").to_string().contains("ip link"));
    }
}
