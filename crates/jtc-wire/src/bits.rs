//! Bits of the controller's words in JtcStatus. Each word is a table with bit, name, text and meaning.
use jtc_bus::bit_words;

bit_words! {
    /// Bits of the controller's error words, current and occurred.
    error: u16 {
        /// Safety input low.
        EMERGENCY_INPUT = 0, "emergency input";
        /// Safety output held at 0 by an internal error.
        EMERGENCY_OUTPUT = 1, "emergency output";
        /// Any internal error.
        INTERNAL = 2, "internal error";
        /// Any external error.
        EXTERNAL = 3, "external error";
        /// A joint's internal error.
        INTERNAL_JOINTS = 4, "internal joints error";
        /// CAN timeout or bus-off.
        INTERNAL_CAN = 5, "internal CAN error";
        /// Host link (not used by this controller: a silent host is no error).
        INTERNAL_COM = 6, "internal COM error";
        /// A node reports an error or misbehaves.
        EXTERNAL_JOINTS = 7, "external joints error";
    }

    /// Bits of a joint's internal error words, current and occurred.
    joint_error: u16 {
        /// Set position over limit.
        POSITION = 0, "position over limit";
        /// Set velocity over limit, or measured speed over its own (J-35).
        VELOCITY = 1, "velocity over limit";
        /// Set acceleration over limit.
        ACCELERATION = 2, "acceleration over limit";
        /// Computed torque over limit.
        TORQUE = 3, "torque over limit";
        /// Position error over limit.
        POSITION_ERROR = 4, "position error over limit";
        /// No friction table value.
        FRICTION_TABLE = 5, "friction table value missing";
    }

    /// Bits of the parameters that the controller has not received.
    missing_parameter: u8 {
        /// Friction polynomial or table.
        FRICTION = 0, "friction";
        /// PID gains.
        PID = 1, "PID";
        /// Arm model.
        MODEL = 2, "arm model";
    }
}

/// Bits of the CAN flags, current and occurred.
pub mod can_flag {
    /// Frames of the controller are not acknowledged, or the controller is off the bus.
    pub const TRANSMIT_TIMEOUT: u32 = 1 << 0;

    /// Bit 8+n: node n (joints 0..5, gripper 6) does not answer.
    pub const fn no_answer(node: usize) -> u32 {
        0x100_u32.wrapping_shl(node as u32)
    }
}
