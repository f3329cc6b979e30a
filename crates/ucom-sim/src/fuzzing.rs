//! Code of the fuzz targets for simulated boards.

use ucom::node::{Application, Flash, Node, NodeConfig, Phase, Pins, Store};
use ucom::{Frame, FromBoard, Profile};

/// Runs a simulated board through a sequence of steps. The first byte of each step defines the time that passes, the length of a frame, and
/// whether the board is polled in that time. After the first byte of a step, two bytes of identifier and up to eight bytes of data follow.
/// The status of the board must never be contradictory, and the board must send only allowed frames.
pub fn node(data: &[u8]) {
    use crate::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};

    let application = MemoryApplication::new("fuzz", &["a", "b", "c", "d"], &["e", "f", "g", "h"], &["i"]);
    let pins = WirePins::chain(1).remove(0);
    let config = NodeConfig::new(0x21);
    let mut board = Node::new(config, MemoryFlash::default(), pins, MemoryStore::default(), application, 0);
    board.flash.install(ucom::node::Record { program_id: 1, date: 2, address: 0, words: 4 }, &[0; 8]);
    let mut now = 100_000;
    board.poll(now);
    let mut rest = data;
    while let Some((&[step, high, low], tail)) = rest.split_first_chunk::<3>() {
        let len = usize::from(step & 15).min(8).min(tail.len());
        let (payload, tail) = tail.split_at(len);
        rest = tail;
        let until = now + [0, 100, 1000, 10_000, 100_000, 500_000, 1_500_000, 10][usize::from(step >> 5)];
        match step & 16 {
            0 => pass(&mut board, &mut now, until),
            _ => now = until,
        }
        // The mask keeps only numbers 0 and 1, so that many frames are addressed to the board.
        let id = u16::from_be_bytes([high, low]) & 0x7E1;
        let Some(frame) = Frame::new(id, payload) else { continue };
        board.receive(now, &frame);
        pass(&mut board, &mut now, until);
        assert_eq!(board.status().contradiction(), None);
        assert!(!board.application.active || board.phase() == Phase::Running);
    }
}

/// Advances the time of the board. The function polls the board at its deadlines, and puts its frames on the bus.
fn pass<F: Flash, P: Pins, S: Store, A: Application>(
    board: &mut Node<F, P, S, A>,
    now: &mut u64,
    until: u64,
) {
    for _ in 0..200 {
        if let Some(frame) = board.poll(*now) {
            assert!(FromBoard::decode(&frame, &Profile::default()).is_ok(), "{frame}");
            *now += 100;
            board.sent(*now, &frame);
        } else if *now < until {
            *now = board.next_deadline().clamp(*now + 1, until);
        } else {
            break;
        }
    }
    *now = until.max(*now);
}
