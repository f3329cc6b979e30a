//! Virtual time of the emulator. The unit of virtual time is the grain. In grains, the period of every clock on the
//! board is a whole number.

/// Point in virtual time or duration, in grains; 1 s = [`SECOND`] grains.
pub type Time = u64;

/// Grains per second: the least common multiple of 64, 85, 400 and 480 MHz. With this unit, rounding does not cause
/// drift between core clock, CAN bits and timer ticks.
pub const SECOND: Time = 81_600_000_000;
/// Grains per millisecond.
pub const MILLISECOND: Time = SECOND / 1_000;
/// Grains per microsecond.
pub const MICROSECOND: Time = SECOND / 1_000_000;
/// Time value for events that never occur.
pub const NEVER: Time = Time::MAX;

/// Returns the period of a clock, rounded to the nearest grain.
pub fn period(hz: u64) -> Time {
    (SECOND + hz / 2).checked_div(hz).unwrap_or(NEVER)
}

/// Converts a time to whole microseconds.
pub fn to_us(time: Time) -> u64 {
    time / MICROSECOND
}

/// Converts a time to nanoseconds, rounded down.
pub fn to_ns(time: Time) -> u64 {
    (u128::from(time) * 1_000_000_000 / u128::from(SECOND)) as u64
}

/// Converts nanoseconds to a time, rounded down to a whole grain.
pub fn from_ns(ns: u64) -> Time {
    (u128::from(ns) * u128::from(SECOND) / 1_000_000_000) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_of_the_boards_clocks_are_exact() {
        for mhz in [8, 64, 85, 100, 120, 200, 240, 400, 480] {
            assert_eq!(period(mhz * 1_000_000) * mhz * 1_000_000, SECOND, "{mhz} MHz");
        }
        assert_eq!(period(32_000) * 32_000, SECOND);
        assert_eq!((to_us(MILLISECOND), to_ns(MICROSECOND), from_ns(1_000)), (1_000, 1_000, MICROSECOND));
    }
}
