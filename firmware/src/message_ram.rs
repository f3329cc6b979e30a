//! Layout of the message memory of the CAN controller, with the filters and the position of each buffer (J-10).
//!
//! Each of the 21 possible answers of the nodes has a dedicated buffer. The buffers are in the order of the
//! identifiers. The CAN controller rejects all other frames, and never overwrites a buffer that the program has not
//! read yet.
use jtc_bus::{MAX_LEN, NODES, id};

/// Size of the message memory, bytes.
pub const BYTES: usize = 10 * 1024;
/// Number of receive buffers, which are for the answers of seven nodes to Move, ChangeFsm and ChangeMode.
pub const RX: usize = 3 * NODES;
/// Number of transmit buffers. The two buffers are for the frame of this tick, and for the frame of the last tick
/// while it is being cancelled.
pub const TX: usize = 2;
/// Number of words per buffer: two words for the frame header, and the other words for the payload.
pub const BUFFER_WORDS: usize = 2 + MAX_LEN / 4;
/// Code of a 24-byte payload in RXESC and TXESC.
pub const SIZE_CODE: u8 = 4;

/// Index of the first word of the filters.
pub const FILTERS: usize = 0;
/// Index of the first word of the receive buffers.
pub const RX_BUFFERS: usize = FILTERS + RX;
/// Index of the first word of the transmit buffers.
pub const TX_BUFFERS: usize = RX_BUFFERS + RX * BUFFER_WORDS;
/// Number of words of the message memory that the program uses.
pub const END: usize = TX_BUFFERS + TX * BUFFER_WORDS;

const _: () = {
    assert!(END * 4 <= BYTES);
    // The size codes 0..4 mean 8, 12, 16, 20 and 24 bytes.
    assert!(MAX_LEN == 8 + 4 * SIZE_CODE as usize);
    // The new-data flags of all receive buffers must be in a single register.
    assert!(RX <= 32 && TX <= 32);
};

/// Returns the index of the first word of receive buffer `n`.
pub const fn rx(n: usize) -> usize {
    RX_BUFFERS + n * BUFFER_WORDS
}

/// Returns the index of the first word of transmit buffer `n`.
pub const fn tx(n: usize) -> usize {
    TX_BUFFERS + n * BUFFER_WORDS
}

/// Returns the identifier of the frames in receive buffer `n`.
pub const fn received_id(n: usize) -> u16 {
    let node = (n % NODES) as u8;
    match n / NODES {
        0 => id::answer(id::MOVE, node),
        1 => id::answer(id::CHANGE_FSM, node),
        _ => id::answer(id::CHANGE_MODE, node),
    }
}

/// Returns filter element `n`, which accepts only the frames for receive buffer `n`.
pub const fn filter(n: usize) -> u32 {
    const STORE_INTO_BUFFER: u32 = 0b111 << 27;
    STORE_INTO_BUFFER | (received_id(n) as u32) << 16 | n as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j10_exactly_the_expected_identifiers_are_received_each_in_its_own_buffer() {
        let expected: Vec<u16> = (0x200..=0x206).chain(0x210..=0x216).chain(0x2F0..=0x2F6).collect();
        let received: Vec<u16> = (0..RX).map(received_id).collect();
        assert_eq!(received, expected);
        for n in 0..RX {
            // According to the reference manual, SFEC is in bits 29..27, SFID1 in bits 26..16, and the buffer in bits
            // 5..0; bits 10..9 are zero.
            assert_eq!(filter(n) >> 27 & 0b111, 0b111);
            assert_eq!(filter(n) >> 16 & 0x7FF, u32::from(expected[n]));
            assert_eq!(filter(n) & 0x7FF, n as u32);
        }
    }

    #[test]
    fn areas_follow_each_other() {
        assert_eq!((FILTERS, RX_BUFFERS), (0, 21));
        assert_eq!((rx(0), rx(20) + BUFFER_WORDS, tx(1) + BUFFER_WORDS), (RX_BUFFERS, TX_BUFFERS, END));
    }
}
