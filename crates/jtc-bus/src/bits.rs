//! Bit words of the bus. A table for each word contains the number, name, text and meaning of each bit.

/// Declares bit words. Each row describes one bit: its meaning (as documentation), the name of its mask, its number
/// and its text.
///
/// Each word becomes a module with a mask for each bit, and with the texts in `NAMES`.
#[doc(hidden)]
#[macro_export]
macro_rules! bit_words {
    ($($(#[$doc:meta])* $word:ident: $type:ty {
        $($(#[$meaning:meta])+ $name:ident = $bit:literal, $text:literal;)+
        $(with $($also:item)+)?
    })+) => {$(
        $(#[$doc])*
        pub mod $word {
            $($(#[$meaning])+ pub const $name: $type = 1 << $bit;)+
            /// Texts of the bits, in the order of the bits from bit 0.
            pub const NAMES: [&str; [$($bit),+].len()] = {
                let mut names = [""; [$($bit),+].len()];
                $(names[$bit] = $text;)+
                names
            };
            $($($also)+)?
        }
    )+};
}

bit_words! {
    /// Warning bits of a node.
    warning: u8 {
        /// The position is not accurate.
        POSITION_NOT_ACCURATE = 0, "position not accurate";
        /// The position is outside the working area.
        OUTSIDE_WORKING_AREA = 1, "outside working area";
        /// The magnetic field of the encoder is out of range.
        MAGNETIC_FIELD = 2, "magnetic field of the encoder out of range";
        /// The safety line is active.
        SAFETY_LINE = 3, "safety line active";
    }

    /// Error bits of a node.
    error: u8 {
        /// The position encoder failed (reported only by the oldest drives).
        POSITION_ENCODER = 0, "position encoder";
        /// A motor-control fault occurred. The motor-control bits show its kind.
        MOTOR_CONTROL = 1, "motor-control fault";
        /// The joint exceeded its over-speed limit.
        OVER_SPEED = 2, "over-speed";
        /// The gate driver reports a hardware fault.
        HARDWARE = 3, "hardware fault of the gate driver";
    }

    /// Motor-control fault bits of a joint. Present faults and faults that have occurred use the same bits.
    motor_control: u8 {
        /// The current loop took too long.
        FOC_DURATION = 0, "current loop took too long";
        /// The supply voltage is too high.
        OVER_VOLTAGE = 1, "over-voltage";
        /// The supply voltage is too low.
        UNDER_VOLTAGE = 2, "under-voltage";
        /// The power stage is too hot.
        OVER_TEMPERATURE = 3, "over-temperature";
        /// The motor did not start.
        START_UP = 4, "start-up failed";
        /// The speed feedback was lost.
        SPEED_FEEDBACK = 5, "speed feedback lost";
        /// The hardware detected an over-current.
        OVER_CURRENT = 6, "over-current";
        /// The drive software detected an error.
        SOFTWARE = 7, "software error";
    }

    /// Configuration bits of a node, which the controller sends with ChangeMode.
    config: u8 {
        /// Limits the motion to the working area.
        WORKING_AREA = 0, "working area";
        /// Switches the absolute encoder on. Without this encoder, the reported position is 0.
        ABSOLUTE_ENCODER = 1, "absolute encoder";
        /// Lets the node react to the safety line.
        SAFETY_LINE = 2, "safety line";
        /// Monitors the bus.
        BUS_WATCHDOG = 3, "bus watchdog";
        /// Enables the over-speed trip. If the bit is 0, the drive does not trip on over-speed.
        OVER_SPEED_TRIP = 4, "over-speed trip";
        with
        /// Default configuration bits of a joint, 0x17.
        pub const JOINT_DEFAULT: u8 = WORKING_AREA | ABSOLUTE_ENCODER | SAFETY_LINE | OVER_SPEED_TRIP;
        /// Default configuration bits of the gripper, 0x04.
        pub const GRIPPER_DEFAULT: u8 = SAFETY_LINE;
    }
}

/// Texts of the set bits, separated by commas. If no bit is set, the output is `-`. A bit without a text is shown as `bit N`.
///
/// ```
/// use jtc_bus::{Bits, warning};
/// assert_eq!(Bits(0x09, &warning::NAMES).to_string(), "position not accurate, safety line active");
/// assert_eq!(Bits(0x11, &warning::NAMES).to_string(), "position not accurate, bit 4");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bits<'a>(pub u32, pub &'a [&'a str]);

impl<'a> Bits<'a> {
    /// Returns the number and the text of each set bit. The text is empty if the list of texts has no text for the bit.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &'a str)> + use<'a> {
        let (word, names) = (self.0, self.1);
        (0..u32::BITS)
            .filter(move |bit| word >> bit & 1 == 1)
            .map(move |bit| (bit, names.get(bit as usize).copied().unwrap_or("")))
    }
}

impl core::fmt::Display for Bits<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.0 == 0 {
            return f.write_str("-");
        }
        for (i, (bit, name)) in self.iter().enumerate() {
            if i > 0 {
                f.write_str(", ")?;
            }
            match name {
                "" => write!(f, "bit {bit}")?,
                name => f.write_str(name)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn bits_print_their_texts_or_else_their_numbers() {
        assert_eq!(Bits(0, &warning::NAMES).to_string(), "-");
        assert_eq!(Bits(0x11, &warning::NAMES).to_string(), "position not accurate, bit 4");
    }

    #[test]
    fn j11_default_configuration_bits() {
        assert_eq!(config::JOINT_DEFAULT, 0x17);
        assert_eq!(config::GRIPPER_DEFAULT, 0x04);
    }
}
