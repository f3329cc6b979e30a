//! Bits of the words in JtcStatus that describe the controller. A table for each word contains the number, name, text
//! and meaning of each bit.
use jtc_bus::bit_words;

bit_words! {
    /// Bits of the controller's error words, current and occurred.
    error: u16 {
        /// The safety input is low.
        EMERGENCY_INPUT = 0, "emergency input";
        /// An internal error keeps the safety output at 0.
        EMERGENCY_OUTPUT = 1, "emergency output";
        /// The controller reports an internal error of any kind.
        INTERNAL = 2, "internal error";
        /// The controller reports an external error of any kind.
        EXTERNAL = 3, "external error";
        /// A joint has an internal error.
        INTERNAL_JOINTS = 4, "internal joints error";
        /// A frame was not acknowledged in time, a node did not answer in time, or the controller is bus-off.
        INTERNAL_CAN = 5, "internal CAN error";
        /// Error of the host link. The controller of openjtc does not use the bit, because it does not report a
        /// silent host as an error.
        INTERNAL_COM = 6, "internal COM error";
        /// A node reports an error or does not behave as expected.
        EXTERNAL_JOINTS = 7, "external joints error";
    }

    /// Bits of a joint's internal error words, current and occurred.
    joint_error: u16 {
        /// A commanded position exceeds its limit.
        POSITION = 0, "position over limit";
        /// A commanded velocity exceeds its limit, or a measured speed exceeds the limit for measured speeds (J-35).
        VELOCITY = 1, "velocity over limit";
        /// A commanded acceleration exceeds its limit.
        ACCELERATION = 2, "acceleration over limit";
        /// A computed torque exceeds its limit.
        TORQUE = 3, "torque over limit";
        /// The position error exceeds its limit.
        POSITION_ERROR = 4, "position error over limit";
        /// The friction table contains no value for the current state.
        FRICTION_TABLE = 5, "friction table value missing";
    }

    /// Bits of the parameters that the controller has not received.
    missing_parameter: u8 {
        /// The friction polynomial or the friction table is missing.
        FRICTION = 0, "friction";
        /// The PID gains are missing.
        PID = 1, "PID";
        /// The arm model is missing.
        MODEL = 2, "arm model";
    }
}

/// Bits of the CAN flags, current and occurred.
pub mod can_flag {
    /// No node acknowledges the frames of the controller, or its CAN controller is bus-off.
    pub const TRANSMIT_TIMEOUT: u32 = 1 << 0;

    /// Returns bit 8+n, which means that node n (joints 0..5, gripper 6) does not answer.
    pub const fn no_answer(node: usize) -> u32 {
        0x100_u32.wrapping_shl(node as u32)
    }
}
