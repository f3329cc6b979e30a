//! Scaling between physical values and the integers of the drives. Every encoding function limits the value to the range of the integer
//! (J-13).

/// Position that the largest 32-bit value represents, rad.
#[expect(clippy::approx_constant, reason = "the drives' number, which is not π")]
pub const POSITION_FULL_SCALE: f64 = 3.141592;
/// Torque that the largest 16-bit value represents, N·m.
pub const TORQUE_FULL_SCALE: f64 = 360.0;
/// Largest torque that each of the known drives supplies, base to wrist, N·m. A drive limits a larger torque command to this value without a
/// report.
pub const DRIVE_TORQUE_MAX: [f64; 6] = [364.0, 364.0, 364.0, 79.0, 79.0, 79.0];

/// Full-scale values of the quantities that drives report (J-11). The scales of position (3.141592) and torque (360) are constants of the
/// protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Velocity that the integer 32767 represents, rad/s. The velocity scale is 2.0, or 6.283185 on older drives.
    pub velocity: f64,
}

impl Scale {
    /// Scale of drives of the current generation.
    pub const CURRENT: Self = Self { velocity: 2.0 };
    /// Scale of drives of the older generation.
    #[expect(clippy::approx_constant, reason = "the drives' number, which is not 2π")]
    pub const OLDER: Self = Self { velocity: 6.283185 };
}

impl Default for Scale {
    fn default() -> Self {
        Self::CURRENT
    }
}

/// Returns the nearest 16-bit integer, limited to ±32767, and 0 for NaN.
#[inline]
pub(crate) fn to_i16(value: f64, full_scale: f64) -> [u8; 2] {
    (nearest(value, full_scale, f64::from(i16::MAX)) as i16).to_be_bytes()
}

/// Returns the nearest 32-bit integer, limited to ±2147483647, and 0 for NaN.
pub(crate) fn to_i32(value: f64, full_scale: f64) -> [u8; 4] {
    (nearest(value, full_scale, f64::from(i32::MAX)) as i32).to_be_bytes()
}

/// Returns the physical value of a 16-bit integer. The quotient in parentheses is the same for every answer of a
/// tick, so it is computed only once per tick. On the board, a division takes as long as seven multiplications.
#[inline]
pub(crate) fn from_i16(bytes: [u8; 2], full_scale: f64) -> f64 {
    f64::from(i16::from_be_bytes(bytes)) * (full_scale / f64::from(i16::MAX))
}

#[inline]
pub(crate) fn from_i32(bytes: [u8; 4], full_scale: f64) -> f64 {
    f64::from(i32::from_be_bytes(bytes)) * (full_scale / f64::from(i32::MAX))
}

/// Returns `value` as a number of integer steps, with half a step added to its magnitude. The cast to an integer,
/// which truncates, then rounds to the nearest integer and converts NaN to 0. With an invalid full scale (0, NaN),
/// the result is the limit value or 0, but never has the opposite sign.
fn nearest(value: f64, full_scale: f64, max: f64) -> f64 {
    let raw = value * (max / full_scale.abs());
    (raw + 0.5_f64.copysign(raw)).clamp(-max, max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::num::f64::ANY;
    use proptest::prelude::*;

    const EDGES: [f64; 14] = [
        0.0,
        -0.0,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MIN_POSITIVE,
        -5e-324,
        f64::MAX,
        f64::MIN,
        360.0,
        360.000001,
        720.0,
        -720.0,
        1080.01,
    ];

    fn check(value: f64) {
        let raw = i16::from_be_bytes(to_i16(value, TORQUE_FULL_SCALE));
        let long = i32::from_be_bytes(to_i32(value, POSITION_FULL_SCALE));
        assert!(raw != i16::MIN && long != i32::MIN, "{value}: outside the scale");
        if value.is_nan() {
            assert_eq!((raw, long), (0, 0));
            return;
        }
        // The sign never changes. Only a value below half a step becomes 0.
        assert!(f64::from(raw) * value >= 0.0, "{value} became {raw}");
        assert!(f64::from(long) * value >= 0.0, "{value} became {long}");
        if value.abs() >= TORQUE_FULL_SCALE {
            assert_eq!(raw.unsigned_abs(), 32767, "{value}");
        } else {
            let back = from_i16(raw.to_be_bytes(), TORQUE_FULL_SCALE);
            assert!((back - value).abs() <= 0.500001 * TORQUE_FULL_SCALE / 32767.0, "{value} became {back}");
        }
        if value.abs() >= POSITION_FULL_SCALE {
            assert_eq!(long.unsigned_abs(), i32::MAX as u32, "{value}");
        } else {
            let back = from_i32(long.to_be_bytes(), POSITION_FULL_SCALE);
            assert!((back - value).abs() <= 0.500001 * POSITION_FULL_SCALE / 2147483647.0, "{value}");
        }
    }

    #[test]
    fn j13_edges_saturate() {
        EDGES.into_iter().for_each(check);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..Default::default() })]
        #[test]
        fn j13_no_value_wraps_or_changes_sign(value in ANY) {
            check(value);
        }

        #[test]
        fn j13_values_near_the_scale_do_not_wrap(value in -1500.0..1500.0) {
            check(value);
        }

        #[test]
        fn j13_encoding_is_monotonic(a in -1000.0..1000.0, b in -1000.0..1000.0) {
            let raw = |v| i16::from_be_bytes(to_i16(v, TORQUE_FULL_SCALE));
            prop_assert_eq!(a < b && raw(a) > raw(b), false);
        }

        #[test]
        fn j13_a_nonsensical_scale_turns_no_sign(value in ANY, scale in ANY) {
            let raw = i16::from_be_bytes(to_i16(value, scale));
            prop_assert!(value.is_nan() || f64::from(raw) * value.signum() >= 0.0);
        }
    }

    #[test]
    fn j13_every_16_bit_number_survives() {
        for raw in -32767..=32767_i16 {
            let torque = from_i16(raw.to_be_bytes(), TORQUE_FULL_SCALE);
            assert_eq!(to_i16(torque, TORQUE_FULL_SCALE), raw.to_be_bytes());
        }
    }
}
