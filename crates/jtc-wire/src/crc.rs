//! CRC-16/XMODEM of whole slices and of parts of a stream, and the arithmetic that checks a frame inside a longer stream.
use crc::{CRC_16_XMODEM, Crc, Table};

// On a microcontroller, the CRC function uses one table of 512 bytes. On a PC, it uses sixteen such tables, which is
// eight to ten times as fast.
#[cfg(target_pointer_width = "64")]
type Tables = Table<16>;
#[cfg(not(target_pointer_width = "64"))]
type Tables = Table<1>;

static CRC: Crc<u16, Tables> = Crc::<u16, Tables>::new(&CRC_16_XMODEM);

/// CRC-16/XMODEM (polynomial 0x1021, start 0, not reflected, no final xor).
///
/// ```
/// assert_eq!(jtc_wire::crc16(b"123456789"), 0x31C3);
/// ```
pub fn crc16(bytes: &[u8]) -> u16 {
    CRC.checksum(bytes)
}

/// Returns the CRC register after `bytes`, if the value before these bytes was `register`. With this function, the caller can compute
/// `crc16` in several steps.
///
/// ```
/// use jtc_wire::{crc16, crc16_update};
/// assert_eq!(crc16_update(crc16_update(0, b"12345"), b"6789"), crc16(b"123456789"));
/// ```
pub fn crc16_update(register: u16, bytes: &[u8]) -> u16 {
    let mut digest = CRC.digest_with_initial(register);
    digest.update(bytes);
    digest.finalize()
}

/// CRC polynomial without its highest term.
const POLYNOMIAL: u16 = 0x1021;

/// Returns the CRC register after one zero byte. `zero_byte` is the bit-by-bit definition of the CRC. The module computes its tables
/// with `zero_byte`.
const fn zero_byte(mut register: u16) -> u16 {
    let mut bit = 0;
    while bit < 8 {
        register = if register & 0x8000 != 0 { register << 1 ^ POLYNOMIAL } else { register << 1 };
        bit += 1;
    }
    register
}

/// Computes `crc16` in constant expressions.
pub(crate) const fn crc16_const(bytes: &[u8]) -> u16 {
    let mut register = 0;
    let mut i = 0;
    while i < bytes.len() {
        register = zero_byte(register ^ (bytes[i] as u16) << 8);
        i += 1;
    }
    register
}

/// Returns the product of two polynomials modulo the polynomial of the CRC.
const fn multiply(a: u16, b: u16) -> u16 {
    let mut product = 0;
    let mut bit = 16;
    while bit > 0 {
        bit -= 1;
        let carry = product & 0x8000 != 0;
        product <<= 1;
        // The multiplication uses masks instead of branches, so that its execution time does not depend on the data.
        product ^= POLYNOMIAL & 0u16.wrapping_sub(carry as u16);
        product ^= a & 0u16.wrapping_sub(b >> bit & 1);
    }
    product
}

const fn powers(step: usize) -> [u16; 256] {
    let mut table = [0; 256];
    let mut value = 1;
    let mut i = 0;
    while i < 256 {
        table[i] = value;
        let mut n = 0;
        while n < step {
            value = zero_byte(value);
            n += 1;
        }
        i += 1;
    }
    table
}

/// Powers x^(8·i) and x^(8·256·i) modulo the CRC polynomial.
static LOW: [u16; 256] = powers(1);
static HIGH: [u16; 256] = powers(256);

/// Returns the CRC register after `count` zero bytes, in constant time. `count` is below 65,536.
///
/// The CRC is linear. Let `a` and `b` be the registers at two positions of a stream, `count` bytes apart. The CRC of the bytes between
/// these positions is `b ^ advance(a, count)`. Two registers are therefore sufficient to check any frame in a stream.
pub(crate) fn advance(register: u16, count: usize) -> u16 {
    let power = multiply(LOW[count & 0xFF], HIGH[count >> 8 & 0xFF]);
    multiply(register, power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn j02_check_value() {
        assert_eq!(crc16(b"123456789"), 0x31C3);
        assert_eq!(crc16_const(b"123456789"), 0x31C3);
        assert_eq!(crc16(b""), 0);
    }

    proptest! {
        #[test]
        fn j02_tables_agree_with_the_definition(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            prop_assert_eq!(crc16(&bytes), crc16_const(&bytes));
        }

        #[test]
        fn pieces_give_the_whole(
            bytes in proptest::collection::vec(any::<u8>(), 0..300),
            cut in any::<proptest::sample::Index>(),
        ) {
            let cut = cut.index(bytes.len() + 1);
            prop_assert_eq!(crc16_update(crc16(&bytes[..cut]), &bytes[cut..]), crc16(&bytes));
        }

        #[test]
        fn a_crc_inside_a_stream(
            bytes in proptest::collection::vec(any::<u8>(), 0..2000),
            cut in any::<proptest::sample::Index>(),
            register: u16,
        ) {
            let cut = cut.index(bytes.len() + 1);
            let a = crc16_update(register, &bytes[..cut]);
            let b = crc16_update(register, &bytes);
            prop_assert_eq!(b ^ advance(a, bytes.len() - cut), crc16(&bytes[cut..]));
        }
    }

    #[test]
    fn advancing_by_any_count() {
        let mut register = 0xACE1;
        for count in 0..65_536 {
            assert_eq!(advance(0xACE1, count), register);
            register = zero_byte(register);
        }
    }
}
