//! Sensors of a drive: a coarse absolute encoder at the joint ([`EncoderPlace`](super::EncoderPlace)), and the
//! encoder of the motor. The delayed speed is computed from the encoder of the motor.

/// Counts per turn of the 16-bit absolute encoder.
const ENCODER_COUNTS: f64 = 65_536.0;
/// Position of 32768 encoder counts on the scale of the bus, rad.
const HALF_TURN: f64 = jtc_wire::POSITION_SCALE;
/// Counts of the motor's incremental encoder per radian of the joint, with the gear ratio of 121.
const MOTOR_COUNTS_PER_RAD: f64 = 10_000.0 * 121.0 / core::f64::consts::TAU;
/// Number of encoder differences (each over 1 ms) that the drive averages to compute the speed.
const SPEED_WINDOW: usize = 10;

/// Absolute encoder and motor encoder of a drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Encoders {
    /// Ring buffer with the motor encoder values of the last ticks, counts.
    history: [i64; SPEED_WINDOW],
    oldest: usize,
}

impl Encoders {
    /// Returns the speed of a joint (rad/s) after one more millisecond, in which the joint moved to `q` (rad). The speed is computed
    /// from the encoder of the motor, which is much finer than the encoder of the joint.
    pub(super) fn speed(&mut self, q: f64) -> f64 {
        let motor = floor(q * MOTOR_COUNTS_PER_RAD);
        let oldest = core::mem::replace(&mut self.history[self.oldest], motor);
        self.oldest = (self.oldest + 1) % SPEED_WINDOW;
        (motor - oldest) as f64 / (MOTOR_COUNTS_PER_RAD * SPEED_WINDOW as f64 * 0.001)
    }

    /// Returns the position of a joint at `q` (rad) as the absolute encoder measures it, rad. The absolute encoder does not count
    /// whole turns.
    pub(super) fn position(&self, q: f64) -> f64 {
        let turns = q / core::f64::consts::TAU;
        let count = floor(turns * ENCODER_COUNTS + 0.5) as i16;
        f64::from(count) * (HALF_TURN / 32_768.0)
    }
}

/// Returns the largest whole number that is less than or equal to `x`. The function replaces `f64::floor`, which is a slow function
/// call if the compiler does not use the processor instruction for it.
pub(super) fn floor(x: f64) -> i64 {
    let near = x as i64;
    near - i64::from(near as f64 > x)
}
