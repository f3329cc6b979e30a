//! Encoding of the persistent state of the controller as bits. The flight recorder writes this state to a snapshot (J-56), and a replay
//! reads it.
//!
//! [`bit_codec!`] lists the fields of a type. A field that is missing in the list is a compile error, so every snapshot is complete.
//! Reading never fails. If the bits are not from a snapshot, the value that was read is arbitrary, and [`BitSource::is_damaged`] reports
//! this damage.
use jtc_bus::{JointReport, NodeState};
use jtc_wire::{ControllerState, StopKind, TrajectoryState};

/// Destination of the bits of a snapshot.
pub(crate) trait BitSink {
    /// Appends the lowest `bits` (0 to 32) of `value`. The higher bits of `value` must be zero.
    fn put(&mut self, value: u32, bits: u32);

    /// Appends 64 bits. If all 64 bits are zero, which is the case for joints at rest, appends a single bit.
    fn put_double(&mut self, value: u64) {
        self.put((value != 0).into(), 1);
        if value != 0 {
            self.put(value as u32, 32);
            self.put((value >> 32) as u32, 32);
        }
    }
}

/// Source of the bits of a snapshot, in the order in which the bits were written.
pub(crate) trait BitSource {
    /// Returns the next `bits` (0 to 32). Bits after the end are zero.
    fn take(&mut self, bits: u32) -> u32;
    /// Marks the source as damaged, because no writer can have produced the bits that were read.
    fn damage(&mut self);
    /// Returns `true` if bits after the end of the source were read, or if no writer can have produced these bits.
    fn is_damaged(&self) -> bool;
}

/// A value that is part of a snapshot.
pub(crate) trait BitCodec: Sized {
    /// Appends the value to a snapshot.
    fn write<S: BitSink>(&self, to: &mut S);
    /// Reads a value from a snapshot.
    fn read<S: BitSource>(from: &mut S) -> Self;
}

/// Implements [`BitCodec`] for a structure, with all its fields in the listed order.
macro_rules! bit_codec {
    ($type:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::bit_codec::BitCodec for $type {
            fn write<S: $crate::bit_codec::BitSink>(&self, to: &mut S) {
                let Self { $($field),+ } = self;
                $($crate::bit_codec::BitCodec::write($field, to);)+
            }

            fn read<S: $crate::bit_codec::BitSource>(from: &mut S) -> Self {
                $(let $field = $crate::bit_codec::BitCodec::read(from);)+
                Self { $($field),+ }
            }
        }
    };
}
pub(crate) use bit_codec;

impl BitCodec for bool {
    fn write<S: BitSink>(&self, to: &mut S) {
        to.put((*self).into(), 1);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        from.take(1) != 0
    }
}

macro_rules! whole {
    ($($type:ty, $bits:literal;)+) => {$(
        impl BitCodec for $type {
            fn write<S: BitSink>(&self, to: &mut S) {
                to.put((*self).into(), $bits);
            }

            fn read<S: BitSource>(from: &mut S) -> Self {
                from.take($bits) as $type
            }
        }
    )+};
}

whole! { u8, 8; u16, 16; u32, 32; }

impl BitCodec for u64 {
    fn write<S: BitSink>(&self, to: &mut S) {
        to.put_double(*self);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        if from.take(1) == 0 {
            return 0;
        }
        let low = from.take(32);
        u64::from(low) | u64::from(from.take(32)) << 32
    }
}

impl BitCodec for u128 {
    fn write<S: BitSink>(&self, to: &mut S) {
        (*self as u64).write(to);
        ((*self >> 64) as u64).write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        let low = u64::read(from);
        u128::from(low) | u128::from(u64::read(from)) << 64
    }
}

impl BitCodec for usize {
    fn write<S: BitSink>(&self, to: &mut S) {
        // All values in this program fit in 32 bits.
        to.put(*self as u32, 32);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        from.take(32) as usize
    }
}

impl BitCodec for f64 {
    // The function is not inlined, because a snapshot contains hundreds of these values and each inlined copy would
    // enlarge the program.
    #[inline(never)]
    fn write<S: BitSink>(&self, to: &mut S) {
        self.to_bits().write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        f64::from_bits(u64::read(from))
    }
}

impl BitCodec for f32 {
    fn write<S: BitSink>(&self, to: &mut S) {
        self.to_bits().write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        f32::from_bits(u32::read(from))
    }
}

impl<A: BitCodec, B: BitCodec> BitCodec for (A, B) {
    fn write<S: BitSink>(&self, to: &mut S) {
        self.0.write(to);
        self.1.write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        let first = A::read(from);
        (first, B::read(from))
    }
}

impl<T: BitCodec, const N: usize> BitCodec for [T; N] {
    fn write<S: BitSink>(&self, to: &mut S) {
        for value in self {
            value.write(to);
        }
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        core::array::from_fn(|_| T::read(from))
    }
}

impl<T: BitCodec> BitCodec for Option<T> {
    fn write<S: BitSink>(&self, to: &mut S) {
        self.is_some().write(to);
        if let Some(value) = self {
            value.write(to);
        }
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        bool::read(from).then(|| T::read(from))
    }
}

impl BitCodec for NodeState {
    fn write<S: BitSink>(&self, to: &mut S) {
        self.code().write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        Self::new(u8::read(from))
    }
}

/// Implements [`BitCodec`] for a one-byte code with a fixed list of values.
macro_rules! code {
    ($($type:ty),+) => {$(
        impl BitCodec for $type {
            fn write<S: BitSink>(&self, to: &mut S) {
                (*self as u8).write(to);
            }

            fn read<S: BitSource>(from: &mut S) -> Self {
                Self::from_byte(u8::read(from)).unwrap_or_else(|| {
                    from.damage();
                    Self::default()
                })
            }
        }
    )+};
}

code!(ControllerState, StopKind, TrajectoryState);

bit_codec!(JointReport {
    position,
    velocity,
    torque,
    temperature,
    state,
    mc_current,
    mc_occurred,
    errors,
    warnings,
    motor_temperature,
});

#[cfg(test)]
pub(crate) mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    /// List of bits, which is stored as words.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(crate) struct Bits {
        words: Vec<u32>,
        len: usize,
        at: usize,
        damaged: bool,
    }

    impl BitSink for Bits {
        fn put(&mut self, value: u32, bits: u32) {
            for bit in 0..bits {
                if self.len.is_multiple_of(32) {
                    self.words.push(0);
                }
                *self.words.last_mut().unwrap() |= (value >> bit & 1) << (self.len % 32);
                self.len += 1;
            }
        }
    }

    impl BitSource for Bits {
        fn take(&mut self, bits: u32) -> u32 {
            let mut value = 0;
            for bit in 0..bits {
                if self.at < self.len {
                    value |= (self.words[self.at / 32] >> (self.at % 32) & 1) << bit;
                } else {
                    self.damaged = true;
                }
                self.at += 1;
            }
            value
        }

        fn damage(&mut self) {
            self.damaged = true;
        }

        fn is_damaged(&self) -> bool {
            self.damaged
        }
    }

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Mixed {
        flag: bool,
        count: u16,
        value: f64,
        list: [Option<u8>; 3],
        history: u128,
        place: usize,
        state: ControllerState,
    }

    bit_codec!(Mixed { flag, count, value, list, history, place, state });

    proptest! {
        #[test]
        fn j56_what_is_remembered_reads_back_bit_for_bit(
            (flag, count, value) in (any::<bool>(), any::<u16>(), prop_oneof![Just(0.0f64), any::<f64>()]),
            list in prop::array::uniform3(any::<Option<u8>>()),
            (history, place, state) in (any::<u128>(), 0..1usize << 20, 0..6usize),
        ) {
            let state = ControllerState::ALL[state];
            let mixed = Mixed { flag, count, value, list, history, place, state };
            let mut bits = Bits::default();
            mixed.write(&mut bits);
            let read = Mixed::read(&mut bits);
            prop_assert!(!bits.is_damaged() && bits.at == bits.len);
            prop_assert_eq!(read.value.to_bits(), value.to_bits());
            prop_assert_eq!(Mixed { value: 0.0, ..read }, Mixed { value: 0.0, ..mixed });
        }
    }

    #[test]
    fn j56_bits_that_were_never_written_are_seen() {
        let mut bits = Bits::default();
        bits.put(0xEE, 8);
        assert_eq!(ControllerState::read(&mut bits), ControllerState::default());
        assert!(bits.is_damaged());
        let mut bits = Bits::default();
        bits.put(1, 1);
        assert_eq!(f64::read(&mut bits), 0.0);
        assert!(bits.is_damaged());
    }
}
