//! Properties that differ between drives, and the effects of faults on drives.

/// Side of the gear on which the encoder is mounted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderPlace {
    /// The encoder is on the motor side of the gear. The drive converts the position to the joint side with the gear
    /// ratio.
    #[default]
    Motor,
    /// The encoder is on the link side of the gear.
    Link,
}

/// Properties that differ between drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Time without answers after power-up and reset, ms.
    pub boot_ms: u32,
    /// Duration of the first enable after a reset, with the motor alignment, ms.
    pub first_enable_ms: u32,
    /// Duration of later enables, ms.
    pub enable_ms: u32,
    /// Duration of the pause of the motor control after a stop, ms.
    pub rest_ms: u32,
    /// Speed that the raw value 32767 represents, rad/s. The velocity scale is 2.0, or 6.283185 for older drives.
    pub velocity_full_scale: f64,
    /// Measured speed at which the drive trips, rad/s, in both directions. Real drives have a limit of 1.8 (older
    /// drives 1.5 or 1.0). The limit of 1.8 is 1.2 times the default arm's velocity limit.
    /// [`SimConfig::new`](crate::SimConfig::new) uses 1.2 times the velocity limit of each joint.
    pub over_speed: f64,
    /// Side of the gear at which the drive measures the position. The drive always measures the speed at the motor.
    /// The side makes a difference only with elastic gears.
    pub encoder: EncoderPlace,
    /// Half of the working area, rad.
    pub working_area: f64,
    /// Ratio of the torque at the joint to the requested torque, about 1/1.3 for real drives. The drive does not know
    /// this ratio, and reports the requested torque as the actual torque.
    pub delivers: f64,
    /// `true` if the drive processes only one message per interrupt. After two requests without a pause between them,
    /// one request stays in the receive buffer. From then on, the drive processes each request only when the next
    /// request arrives.
    pub one_message_per_interrupt: bool,
    /// `true` if the drive executes ChangeFsm in the interrupt and answers with the code of the transition. Otherwise
    /// the drive answers with its previous state.
    pub answers_transition: bool,
    /// `true` if answers to Move have 20 bytes, otherwise 16.
    pub long_answers: bool,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            boot_ms: 250,
            first_enable_ms: 4000,
            enable_ms: 20,
            rest_ms: 400,
            velocity_full_scale: 2.0,
            over_speed: 1.8,
            encoder: EncoderPlace::Motor,
            working_area: 2.9905,
            delivers: 1.0,
            one_message_per_interrupt: false,
            answers_transition: false,
            long_answers: true,
        }
    }
}

impl DriveConfig {
    /// Smallest and largest over-speed limit that the simulator's options accept, rad/s.
    pub const OVER_SPEED: (f64, f64) = (0.01, 100.0);

    /// Returns the properties of drives with the previous firmware: a different speed scale, short answers, and one
    /// message per interrupt.
    pub fn older() -> Self {
        Self {
            velocity_full_scale: 6.283185,
            one_message_per_interrupt: true,
            answers_transition: true,
            long_answers: false,
            ..Self::default()
        }
    }
}

/// Current effects of faults on a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveFault {
    /// `true` if the node is disconnected from the bus while its motor continues.
    pub silent: bool,
    /// Motor-control fault bits.
    pub motor_control: u8,
    /// `true` if the gate driver reports a fault.
    pub hardware: bool,
    /// Offset of the encoder reading, rad.
    pub encoder_offset: f64,
    /// `true` if the drive reports its position as inaccurate.
    pub not_accurate: bool,
    /// `true` if the safety line has the level that means danger.
    pub safety_line: bool,
    /// `true` if the drive answers requests for a different state but does not change its state.
    pub ignores_state: bool,
}
