//! Properties that differ between drives, and effects of faults on them.

/// Side of the gear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderPlace {
    /// The motor's, seen through the gear.
    #[default]
    Motor,
    /// The link's.
    Link,
}

/// Properties that differ between drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Silence after power-up and reset, ms.
    pub boot_ms: u32,
    /// Motor alignment at the first enable after a reset, ms.
    pub first_enable_ms: u32,
    /// Later enables, ms.
    pub enable_ms: u32,
    /// Rest of the motor control after a stop, ms.
    pub rest_ms: u32,
    /// Speed at 32767, rad/s: 2.0, older drives 6.283185.
    pub velocity_full_scale: f64,
    /// Measured speed that trips, rad/s, either way. Known drives: 1.8 (older ones 1.5 or 1.0), which is 1.2 times the default
    /// arm's velocity limit; [`SimConfig::new`](crate::SimConfig::new) sets each joint's to 1.2 times its limit.
    pub over_speed: f64,
    /// Side of the gear at which the position is read; the speed is always the motor's. The side matters only for gears that yield.
    pub encoder: EncoderPlace,
    /// Half of the working area, rad.
    pub working_area: f64,
    /// Torque at the joint over the requested torque, which the drive reports as delivered. Known drives: about 1/1.3.
    pub delivers: f64,
    /// The drive takes one message per interrupt: after back-to-back requests it is one message late for good.
    pub one_message_per_interrupt: bool,
    /// ChangeFsm is executed in the interrupt and answered with the transition's code; else with the state
    /// before.
    pub answers_transition: bool,
    /// Answers to Move have 20 bytes; else 16.
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
    /// Smallest and largest speed of the trip that the simulator's options take, rad/s.
    pub const OVER_SPEED: (f64, f64) = (0.01, 100.0);

    /// The firmware before the present one: other speed scale, short answers, one message per interrupt.
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

/// Effects of faults on a drive at the moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveFault {
    /// The node is off the bus; its motor goes on.
    pub silent: bool,
    /// Motor-control fault bits.
    pub motor_control: u8,
    /// The gate driver reports a fault.
    pub hardware: bool,
    /// Offset of the encoder reading, rad.
    pub encoder_offset: f64,
    /// The position is reported as not accurate.
    pub not_accurate: bool,
    /// The safety line is at the level that means danger.
    pub safety_line: bool,
    /// Requests for another state are answered and have no effect.
    pub ignores_state: bool,
}
