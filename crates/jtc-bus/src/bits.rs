//! Bits of the nodes' bytes, in words.

/// Warning bits of a node.
pub mod warning {
    /// Position not accurate.
    pub const POSITION_NOT_ACCURATE: u8 = 0x01;
    /// Outside its working area.
    pub const OUTSIDE_WORKING_AREA: u8 = 0x02;
    /// Magnetic field of the encoder out of range.
    pub const MAGNETIC_FIELD: u8 = 0x04;
    /// Safety line active.
    pub const SAFETY_LINE: u8 = 0x08;
    /// In words, bit 0 first.
    pub const NAMES: [&str; 8] = [
        "position not accurate",
        "outside working area",
        "magnetic field of the encoder out of range",
        "safety line active",
        "bit 4",
        "bit 5",
        "bit 6",
        "bit 7",
    ];
}

/// Error bits of a node.
pub mod error {
    /// Position encoder failed (oldest drives).
    pub const POSITION_ENCODER: u8 = 0x01;
    /// Motor-control fault: its bits identify it.
    pub const MOTOR_CONTROL: u8 = 0x02;
    /// Joint over-speed.
    pub const OVER_SPEED: u8 = 0x04;
    /// Gate driver reports a hardware fault.
    pub const HARDWARE: u8 = 0x08;
    /// In words, bit 0 first.
    pub const NAMES: [&str; 8] = [
        "position encoder",
        "motor-control fault",
        "over-speed",
        "hardware fault of the gate driver",
        "bit 4",
        "bit 5",
        "bit 6",
        "bit 7",
    ];
}

/// Motor-control fault bits of a joint (now, and occurred).
pub mod motor_control {
    /// The current loop took too long.
    pub const FOC_DURATION: u8 = 0x01;
    /// Supply voltage too high.
    pub const OVER_VOLTAGE: u8 = 0x02;
    /// Supply voltage too low.
    pub const UNDER_VOLTAGE: u8 = 0x04;
    /// Power stage too hot.
    pub const OVER_TEMPERATURE: u8 = 0x08;
    /// Motor did not start.
    pub const START_UP: u8 = 0x10;
    /// Speed feedback lost.
    pub const SPEED_FEEDBACK: u8 = 0x20;
    /// Hardware over-current.
    pub const OVER_CURRENT: u8 = 0x40;
    /// Software error.
    pub const SOFTWARE: u8 = 0x80;
    /// In words, bit 0 first.
    pub const NAMES: [&str; 8] = [
        "current loop took too long",
        "over-voltage",
        "under-voltage",
        "over-temperature",
        "start-up failed",
        "speed feedback lost",
        "over-current",
        "software error",
    ];
}

/// Configuration bits of a node, sent with ChangeMode.
pub mod config {
    /// Keep to the working area.
    pub const WORKING_AREA: u8 = 0x01;
    /// Absolute encoder on; without it the position reads 0.
    pub const ABSOLUTE_ENCODER: u8 = 0x02;
    /// React to the safety line.
    pub const SAFETY_LINE: u8 = 0x04;
    /// Watch the bus.
    pub const BUS_WATCHDOG: u8 = 0x08;
    /// Trip on over-speed; a configuration without this bit switches the trip off.
    pub const OVER_SPEED_TRIP: u8 = 0x10;
    /// Default of a joint, 0x17.
    pub const JOINT_DEFAULT: u8 = WORKING_AREA | ABSOLUTE_ENCODER | SAFETY_LINE | OVER_SPEED_TRIP;
    /// Default of the gripper, 0x04.
    pub const GRIPPER_DEFAULT: u8 = SAFETY_LINE;
    /// In words, bit 0 first.
    pub const NAMES: [&str; 8] = [
        "working area",
        "absolute encoder",
        "safety line",
        "bus watchdog",
        "over-speed trip",
        "bit 5",
        "bit 6",
        "bit 7",
    ];
}

/// Set bits in words, separated by commas; `-` when there is none.
///
/// ```
/// use jtc_bus::{Bits, warning};
/// assert_eq!(Bits(0x09, &warning::NAMES).to_string(), "position not accurate, safety line active");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bits<'a>(pub u8, pub &'a [&'a str; 8]);

impl core::fmt::Display for Bits<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.0 == 0 {
            return f.write_str("-");
        }
        let mut first = true;
        for (bit, name) in self.1.iter().enumerate() {
            if self.0 >> bit & 1 == 1 {
                if !first {
                    f.write_str(", ")?;
                }
                first = false;
                f.write_str(name)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j11_default_configuration_bits() {
        assert_eq!(config::JOINT_DEFAULT, 0x17);
        assert_eq!(config::GRIPPER_DEFAULT, 0x04);
    }
}
